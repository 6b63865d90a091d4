# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What people call their columns and units, in English and German."""

from __future__ import annotations

import re
from collections.abc import Mapping

_SPELLINGS: Mapping[str, str] = {
    "s": "s sec secs second seconds sekunden", "ms": "ms msec msecs millis milliseconds", "us": "us usec micros microseconds",
    "ns": "ns nsec nsecs nanos nanoseconds", "min": "min minutes", "h": "h hr hrs hour hours stunden", "d": "d day days tage",
    "rad": "rad radian radians", "mrad": "mrad", "deg": "deg degree degrees ° grad",
    "0.1 deg": "ddeg decideg 0.1_deg 0.1deg 0.1° 0.1_° 1/10_deg 1/10deg 1/10° deg/10 °/10",
    "0.01 deg": "cdeg centideg 0.01_deg 0.01deg 0.01° 0.01_° 1/100_deg 1/100deg 1/100° deg/100 °/100",
    "rev": "rev revs revolution revolutions turn turns", "m": "m meter metre", "cm": "cm", "mm": "mm", "um": "um micron microns",
    "in": "in inch inches",
    "rad/s": "rad/s rad_s rads rad/sec radps", "deg/s": "deg/s deg_s °/s dps deg/sec °/sec degs grad/s",
    "rpm": "rpm 1/min u/min rev/min", "m/s": "m/s m_s mps", "mm/s": "mm/s mm_s", "Pa": "pa pascal", "kPa": "kpa", "MPa": "mpa",
    "mbar": "mbar hpa", "bar": "bar bara barg bar(a) bar(g) bar_(a) bar_(g) bar_abs bar_rel", "psi": "psi psia psig psi(a) psi(g)",
    "kg/cm2": "kg/cm2 kg/cm² kg/cm^2 kgf/cm2 kgf/cm² kgf/cm^2 kp/cm2 kp/cm²", "N": "n newton", "kN": "kn", "lbf": "lbf lb lbs",
    "N m": "nm n_m n·m n*m n.m n-m newtonmeter", "kN m": "knm kn_m kn·m kn*m kn.m", "mN m": "mNm mN_m mN·m mN*m mN.m",
    "lbf ft": "lbf_ft lbf-ft lbf·ft lbf*ft lbfft lb_ft lb-ft lbft ft_lbf ft-lbf ftlbf ft_lb ft-lb ftlb",
    "lbf in": "lbf_in lbf-in lbf·in lbf*in lbfin lb_in lb-in lbin in_lbf in-lbf inlbf in_lb in-lb inlb",
    "degC": "degc c °c celsius deg_c", "degF": "degf f °f fahrenheit deg_f", "K": "k kelvin",
}  # fmt: skip
UNIT_OF: Mapping[str, str] = {spelling: unit for unit, text in _SPELLINGS.items() for spelling in text.split()}
"""Spelling -> unit; in any case, but for capitals here: mNm is not MNm."""
_IN_BRACKETS_ONLY = ("in", "d")
"""Units that at the end of a name are words of their own: p_in."""
_LETTERS: Mapping[str, tuple[str, ...]] = {
    "m": ("position",), "M": ("position",), "n": ("torque",), **dict.fromkeys(("c", "f", "k"), ("temperature", "air"))
}  # fmt: skip
"""Ends of a name that are units only if it tells their quantity: theta_m is the measured one, but F_N is in newton."""
_UNSCALED = frozenset(
    ("%", "%fs", "%_fs", "percent", "pct", "a", "ma", "amp", "amps", "v", "mv", "volt", "volts", "count", "counts", "ticks", "lsb")
)
"""What is stated of a quantity that only a scale, which nobody states, could give."""

WORDS: Mapping[str, frozenset[str]] = {
    kind: frozenset(text.split())
    for kind, text in {
        "command": "goal target ref reference command commanded cmd desired des set setp setpoint soll demand dem nominal nom",
        "state": "error enable enabled flag status mode valid",
        "time": "t time zeit timestamp stamp clock elapsed secs millis tstamp date datum uhrzeit",
        "rate": "rate speed velocity vel omega dq dtheta gyro geschwindigkeit drehzahl",
        "temperature": "temp temperature temperatur",
        "air": "air ambient outside luft aussen außen umgebung",
        "pressure": "p pressure press pres druck",
        "torque": "torque moment drehmoment tau trq force kraft",
        "force": "force kraft",
        "angle": "angle theta phi winkel lenkwinkel steer steering position pos q qm qs encoder joint alpha",
        "position": "position pos stroke",
        "left": "left l li links lh",
        "right": "right r re rechts rh",
    }.items()
}
_QUANTITIES = frozenset(WORDS) - {"left", "right", "air", "command"}


def parts_of(name: str) -> list[str]:
    """The parts of a path (``log.p.main_a``, ``/steering/left/position``), outermost first, without what stands in brackets."""
    plain = re.sub(r"[\[(].*?[\])]", " ", name)
    return [part for part in re.split(r"[./]", plain) if part.strip()]


def words_of(name: str) -> list[str]:
    """The words of a column's name, in lower case: of a path those of the innermost part that tells of a quantity, else of the last."""
    parts = [_words(part) for part in reversed(parts_of(name))]
    quantities = (words for words in parts if any(_tell(words, kind) for kind in _QUANTITIES))
    return next(quantities, parts[0] if parts else [])


def _words(part: str) -> list[str]:
    return [word.lower() for word in re.findall(r"[^\W\d_]+", spaced(part))]


def spaced(text: str) -> str:
    """``PressMainA`` as ``Press Main A``."""
    return re.sub(r"(?<=[a-zäöü])(?=[A-Z])", " ", text)


def tells(name: str, kind: str) -> bool:
    """Whether a name holds a word of this kind; side, air and command are told by any part of a path and in round brackets too."""
    return _tell(words_of(name) if kind in _QUANTITIES else _words(re.sub(r"\[.*?\]", " ", name)), kind)


def _tell(words: list[str], kind: str) -> bool:
    """Long words count as part of a compound too (Umgebungstemperatur)."""
    known = WORDS[kind]
    return any(word in known or any(len(part) > 4 and part in word for part in known) for word in words)


def side_alone(name: str) -> str | None:
    """The side that a name spells out and says nothing else."""
    words = words_of(name)
    spelt = len(words) == 1 and len(words[0]) > 3
    return next((side for side in ("left", "right") if spelt and words[0] in WORDS[side]), None)


def unit_in(text: str, whole: bool = False) -> str | None:
    """A unit that a name or a header cell states: in brackets, at its end after a blank or _, or as the ``whole`` text."""
    square, rounded = _bracketed(text)
    ends = [text] if whole else [end for end in _ends(text) if _is_unit(end, text)]
    return next((unit for candidate in (*square, *rounded, *ends) if (unit := _known(candidate)) is not None), None)


def _is_unit(end: str, name: str) -> bool:
    """Whether the end of a name may be a unit at all."""
    return end.lower() not in _IN_BRACKETS_ONLY and (end not in _LETTERS or any(tells(name, kind) for kind in _LETTERS[end]))


def stated_in(text: str, whole: bool = False) -> str | None:
    """What stands in place of a unit, known or not; at the end of a name only what nothing else can mean."""
    if whole:
        return text.strip("[]() -?") or None
    square, rounded = _bracketed(text)
    found = [part for part in square if not part.isdigit() and not _is_side(part)]
    found += [part for part in rounded if _known(part) or _unscaled(part) or re.search(r"[/%°^*·²]", part)]
    found += [end for end in _ends(text) if _unscaled(end)]
    return found[0] if found else None


def remark_in(text: str) -> str | None:
    """What stands in round brackets and is no side: a unit that is not known, or a remark."""
    return next((part for part in _bracketed(text)[1] if not part.isdigit() and not _is_side(part)), None)


def _unscaled(text: str) -> bool:
    """Two letters as they are written, not any: the pressures A and ma are of lines."""
    return text.lower() in _UNSCALED and (len(text) > 2 or text in ("%", "mA", "mV"))


def _bracketed(text: str) -> tuple[list[str], list[str]]:
    """What stands in square brackets, and outside of them in round ones."""
    square = re.findall(r"\[([^\[\]]+)\]", text)
    rounded = re.findall(r"\(((?:[^()]|\([^()]*\))+)\)", re.sub(r"\[[^\[\]]*\]", " ", text))
    return [part.strip() for part in square], [part.strip() for part in rounded]


def _ends(text: str) -> list[str]:
    """The last two words of a name, and the last."""
    parts = re.split(r"[\s_]+", text.strip())
    return ["_".join(parts[-2:]), parts[-1]] if len(parts) > 1 else []


def _known(text: str) -> str | None:
    spelt = _spelt(text)
    return UNIT_OF.get(spelt) or UNIT_OF.get(spelt.lower())


def _spelt(text: str) -> str:
    return re.sub(r"\s+", "_", text.strip().replace("µ", "u").replace("μ", "u"))


def _is_side(text: str) -> bool:
    return tells(text, "left") or tells(text, "right")
