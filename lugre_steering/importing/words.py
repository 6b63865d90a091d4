# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What people call their columns and units, in English and German."""

from __future__ import annotations

import re
from collections.abc import Mapping

_SPELLINGS: Mapping[str, str] = {
    "s": "s sec secs second seconds sekunden", "ms": "ms msec msecs millis milliseconds", "us": "us usec micros microseconds",
    "ns": "ns nsec nsecs nanos nanoseconds", "min": "min minutes", "rad": "rad radian radians", "mrad": "mrad",
    "deg": "deg degree degrees ° grad", "m": "m meter metre", "cm": "cm", "mm": "mm",
    "rad/s": "rad/s rad_s rads rad/sec radps", "deg/s": "deg/s deg_s °/s dps deg/sec degs grad/s",
    "rpm": "rpm 1/min u/min", "m/s": "m/s m_s mps", "mm/s": "mm/s mm_s", "Pa": "pa pascal", "kPa": "kpa", "MPa": "mpa",
    "mbar": "mbar hpa", "bar": "bar", "psi": "psi", "N": "n newton", "kN": "kn", "N m": "nm n_m n·m n*m n.m newtonmeter",
    "kN m": "knm kn_m kn·m kn*m kn.m", "degC": "degc c °c celsius deg_c", "K": "k kelvin",
}  # fmt: skip
UNIT_OF: Mapping[str, str] = {spelling: unit for unit, text in _SPELLINGS.items() for spelling in text.split()}

WORDS: Mapping[str, frozenset[str]] = {
    kind: frozenset(text.split())
    for kind, text in {
        "command": "goal target ref reference command commanded cmd desired set setpoint soll demand error enable enabled "
        "flag status mode valid",
        "time": "t time zeit timestamp stamp clock elapsed secs millis tstamp",
        "rate": "rate speed velocity vel omega dq dtheta gyro geschwindigkeit drehzahl",
        "temperature": "temp temperature temperatur",
        "air": "air ambient outside luft aussen außen umgebung",
        "pressure": "p pressure press pres druck",
        "torque": "torque moment drehmoment tau trq force kraft",
        "force": "force kraft",
        "angle": "angle theta phi winkel lenkwinkel steer steering position pos q qm qs encoder joint alpha",
        "left": "left l li links lh",
        "right": "right r re rechts rh",
    }.items()
}


def words_of(name: str) -> list[str]:
    """The words of a column's name, in lower case; of a path its last part."""
    last = re.sub(r"[\[(].*?[\])]", " ", name.rsplit(".", 1)[-1])
    spaced = re.sub(r"(?<=[a-zäöü])(?=[A-Z])", " ", last)
    return [word.lower() for word in re.findall(r"[^\W\d_]+", spaced)]


def tells(name: str, kind: str) -> bool:
    """Whether a name holds a word of this kind; long words count as part of a compound too (Umgebungstemperatur)."""
    known, words = WORDS[kind], words_of(name)
    return any(word in known or any(len(part) > 4 and part in word for part in known) for word in words)


def unit_in(text: str, whole: bool = False) -> str | None:
    """A unit that a name or a header cell states: in brackets, at its end after a blank or _, or as the ``whole`` text."""
    text = text.strip().replace("µ", "u").replace("μ", "u")
    bracketed = re.findall(r"[\[(]\s*([^\])]+?)\s*[\])]", text)
    parts = re.split(r"[\s_]+", text)
    ends = [text] if whole else ["_".join(parts[-2:]), parts[-1]] if len(parts) > 1 else []
    for candidate in (*bracketed, *ends):
        unit = UNIT_OF.get(re.sub(r"\s+", "_", candidate.strip()).lower())
        if unit is not None:
            return unit
    return None
