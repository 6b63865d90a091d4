# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How numbers, quantities and curves are shown to people, the same in every picture and page."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lugre_steering import units
from lugre_steering.recording import Array
from lugre_steering.vehicle import Vehicle

_HANDIER = (("rad", "deg", 180.0 / math.pi), ("m", "mm", 1e3), ("Pa", "MPa", 1e-6))


@dataclass(frozen=True)
class Axis:
    """A quantity on an axis: its name and unit, and what to multiply SI values by."""

    name: str
    unit: str
    scale: float

    @property
    def label(self) -> str:
        """As every axis of a picture or chart is labelled."""
        return labelled(self.name, self.unit)


def labelled(name: str, unit: str) -> str:
    """A quantity with its unit, if it has one."""
    return name if unit in ("", "1") else f"{name} ({unit})"


def torque_axis(vehicle: Vehicle, *values: Array) -> Axis:
    """Torque (or force) in N m, or in kN m where the values are large."""
    unit = vehicle.coordinate.force_unit
    top = max((float(np.nanmax(np.abs(v))) for v in values if v.size), default=0.0)
    return Axis("torque", f"k{unit}", 1e-3) if top >= 2000.0 else Axis("torque", unit, 1.0)


def coordinate_axis(vehicle: Vehicle, name: str) -> Axis:
    """A coordinate of ``units.COORDINATE_UNITS``, or its name in this vehicle's words, in its words and units; angles in degrees."""
    name = {units.words(vehicle, key): key for key in units.COORDINATE_UNITS}.get(name, name)
    if name == "torque":
        return Axis(units.words(vehicle, name), f"k{vehicle.coordinate.force_unit}", 1e-3)
    unit, scale = units.label(vehicle, units.COORDINATE_UNITS.get(name, "")), 1.0
    for plain, handy, factor in _HANDIER:
        if re.match(rf"{plain}(?!\w)|{plain}/", unit):
            unit, scale = handy + unit[len(plain) :], factor
            break
    return Axis(coordinate_name(vehicle, name), unit, scale)


def coordinate_name(vehicle: Vehicle, name: str) -> str:
    """'steering rate' of a linear axis called position: 'position rate'; 'steering angle' by the name it has in the file."""
    return units.words(vehicle, name).replace("steering angle", vehicle.coordinate.name)


def with_article(noun: str) -> str:
    """'a steering rate', 'an angle'."""
    return f"{'an' if noun[:1] in 'aeiou' else 'a'} {noun}"


def number(value: float | None, digits: int = 4) -> str:
    """Plain text with ``digits`` significant digits; '-' where there is none."""
    if value is None or not math.isfinite(value):
        return "-"
    if value == 0.0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    if not -4 <= decimals <= 6:
        return f"{value:.{digits - 1}e}"
    text = f"{round(value, decimals):.{max(decimals, 0)}f}"
    if abs(value) >= 1e4:  # four digits read well without a gap
        text = f"{round(value, decimals):,.{max(decimals, 0)}f}".replace(",", "\u202f")
    return text.rstrip("0").rstrip(".") if "." in text else text


def whole(count: int) -> str:
    """A count, exact, in groups of three digits where :func:`number` has them too."""
    return f"{count:,}".replace(",", "\u202f") if abs(count) >= 10_000 else str(count)


def tenths(value: float, sign: str = "", beside: float = 0.0) -> str:
    """One decimal, as columns of errors have it, or three digits of what is below ten, or of the larger one ``beside`` it; ``sign``
    "+": always with its sign."""
    size = max(abs(value), beside)
    decimals = 1 if size >= 10.0 or size == 0.0 else min(2 - math.floor(math.log10(size)), 12)
    return f"{value:{sign}.{decimals}f}"


def quantity(value: float | None, unit: str) -> str:
    """A number with its unit; what is counted in ones has none."""
    return number(value, 3) if unit in ("", "1") else f"{number(value, 3)} {unit}"


def torque(vehicle: Vehicle, value: float) -> str:
    """A torque (or force) as in every sentence and table: three digits with its unit, large ones in thousands."""
    unit = vehicle.coordinate.force_unit
    return f"{number(1e-3 * value, 3)} k{unit}" if abs(value) >= 9995.0 else f"{number(value, 3)} {unit}"


def estimate(value: float | None, ends: Sequence[float | None] | None) -> tuple[str, str]:
    """Value and interval, with as many digits as tell the ends of the interval apart, all with a power of ten where one needs it."""
    if value is None or ends is None or None in ends or not ends[0] < ends[1]:  # type: ignore[operator]
        return number(value), "-" if ends is None else " … ".join(number(end) for end in ends)
    largest = max(abs(value), *(abs(end) for end in ends if end is not None))
    digits = min(max(math.floor(math.log10(largest / (ends[1] - ends[0]))) + 3, 3), 9)  # type: ignore[operator]
    texts = [number(each, digits) for each in (value, *ends)]
    if any("e" in text for text in texts):
        texts = [f"{each:.{digits - 1}e}" if each else text for each, text in zip((value, *ends), texts, strict=True)]
    return texts[0], " … ".join(texts[1:])


def percent(share: float | None) -> str:
    if share is None or not math.isfinite(share):
        return "-"
    size = abs(100.0 * share)
    if size < 0.05:
        return "less than 0.1 %" if share > 0.0 else "0 %"
    return f"{100.0 * share:.1f} %" if size < 10.0 else f"{100.0 * share:.0f} %"


def percents(low: float | None, high: float | None) -> str:
    """An interval: '97 to 98 %', '97.8 to 98.1 %' where whole percents are one, 'about 98 %' where tenths are too."""
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return "-"
    for decimals in (0, 1):
        ends = [f"{round(100.0 * end, decimals) + 0.0:.{decimals}f}" for end in (low, high)]  # + 0.0: nothing is no minus nothing
        if ends[0] != ends[1]:
            return f"{ends[0]} to {ends[1]} %"
    return f"about {ends[0].removesuffix('.0')} %"


def named(key: str) -> str:
    """A key of a file in words: 'heat capacity', 'Stribeck speed'."""
    return re.sub(r"\bstribeck\b", "Stribeck", key.replace("_", " "))


def chance(p: float | None) -> str:
    if p is None:
        return "-"
    return "< 0.001" if p < 0.001 else f"{p:.2g}"


def spans(intervals: Sequence[Sequence[float]], most: int = 10) -> str:
    """'12.1-16.3, 20-24.5 s'."""
    shown = ", ".join(f"{number(a, 3)}–{number(b, 3)}" for a, b in intervals[:most])
    more = f" and {len(intervals) - most} more" if len(intervals) > most else ""
    return f"{shown} s{more}" if shown else "-"


def thin(values: Array, limit: int) -> tuple[Array, int]:
    """A curve of at most ``limit`` points that keeps every peak (smallest and largest of each bin, in their order), and
    how many samples one point stands for."""
    if values.size <= limit:
        return values, 1
    width = 2 * math.ceil(values.size / limit)
    rows = np.pad(values, (0, -values.size % width), mode="edge").reshape(-1, width)
    first, last = np.sort(np.stack([rows.argmin(axis=1), rows.argmax(axis=1)]), axis=0)
    at = np.arange(len(rows))
    return np.stack([rows[at, first], rows[at, last]], axis=1).ravel(), width // 2


def sentences(text: str) -> list[str]:
    """A paragraph sentence by sentence."""
    return [sentence for sentence in re.split(r"(?<=[.)]) (?=[A-Z]|[a-z]+[._]\w+)", text) if sentence]


def broken(x: Array, y: Array) -> tuple[Array, Array]:
    """A line with gaps where x jumps, so that no stroke joins what time does not join."""
    jumps = np.flatnonzero(np.abs(np.diff(x)) > 0.05 * float(np.ptp(x))) + 1
    return np.insert(x, jumps, np.nan), np.insert(y, jumps, np.nan)
