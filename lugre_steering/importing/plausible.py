# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether the unit that a map states can be true: angles and their rates tell by a factor of 57, the rest by range."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from lugre_steering.counted import counted
from lugre_steering.errors import MapFileError
from lugre_steering.importing.channels import Imported
from lugre_steering.importing.map import RADIANS, ImportMap
from lugre_steering.recording import RATE_LIMIT, Array

DEGREES = 180.0 / math.pi
_SHARE = 0.01
"""So many samples say nothing about the range of a channel: they may be outliers."""
_ALIKE = 0.1
"""Relative deviation of a ratio from 57.3 that still means degrees for radians."""
_CORRELATED = 0.9
_UNRELATED, _MOVES = 0.5, 0.05
"""A smaller correlation of an angle that travels farther [rad or m] with its rate is that of another motion."""
_MIN_SAMPLES = 20

_PRESSURES_PA = (2e4, 2e8)
"""Where the highest pressure of a hydraulic machine lies."""
_VACUUM_PA = -1.05e5
"""No gauge of a pressure reads less."""
_AIR_DEGC = (-60.0, 80.0)


def check_units(file: Path, mapping: ImportMap, channels: Mapping[str, Imported]) -> None:
    """Refuse angles whose unit cannot be true."""
    angles = {name: channel for name, channel in channels.items() if channel.unit == "rad"}
    for name, channel in angles.items():
        low, high = _range(channel.value)
        unit, farthest = mapping.channels[name].unit, mapping.channels[name].farthest
        too_far = high - low > 2.0 * math.pi or max(-low, high) > 2.0 * math.pi if farthest is None else max(-low, high) > farthest
        if unit in RADIANS and too_far:
            expected = "less than a turn (6.28 rad)" if farthest is None else f"up to {farthest:g} rad"
            raise MapFileError(
                f"{file}: channel {name}: the unit '{unit}' makes it {low:.4g} ... {high:.4g} rad, "
                f"expected {expected}; is the column in deg? A joint that turns further says so in its channel: "
                f"'farthest: {_ceiling(low, high):g}'"
            )
        if channel.rate is not None and (ratio := _ratio(*_moved(channel))) is not None:
            _refuse_degrees(file, name, f"rate/{name.removeprefix('angle/')}", ratio)
    if len(angles) == 2 and len({channel.value.size for channel in angles.values()}) == 1:
        left, right = angles.values()
        if (ratio := _ratio(left.value - left.value.mean(), right.value - right.value.mean())) is not None:
            _refuse_degrees(file, left.name, right.name, ratio)


def doubts(mapping: ImportMap, channel: Imported, others: Iterable[Imported]) -> list[str]:
    """What is odd about the numbers of a channel, but possible."""
    low, high = float(np.min(channel.value)), float(np.max(channel.value))
    begin, end = channel.time_s.min(), channel.time_s.max()
    apart = [other.name for other in others if other.time_s.min() > end or other.time_s.max() < begin]
    found = [f"no time in common with {', '.join(apart)}: clocks of different zero?"] if apart else []
    unit = mapping.channels[channel.name].unit
    if channel.unit == "rad":
        low, high = _range(channel.value)
        if max(-low, high) > (math.pi if unit == "deg" else 0.5 * math.pi):
            found.append(f"{math.degrees(low):.0f} ... {math.degrees(high):.0f} deg: is the unit {unit}, and the zero right?")
        if unit == "deg" and 0.0 < high - low < math.radians(3.0):
            found.append(f"travels {math.degrees(high - low):.2g} deg only: is the unit deg?")
    elif channel.unit == "Pa":
        if max(-low, high) > 0.0 and not _PRESSURES_PA[0] <= max(-low, high) <= _PRESSURES_PA[1]:
            found.append(f"up to {max(-low, high):.3g} Pa: is the unit {unit}?")
        if below := int(np.sum(channel.value < _VACUUM_PA)):
            samples = counted(below, "sample")
            found.append(f"{samples} below a vacuum, down to {1e-5 * low:.3g} bar: a broken wire, or is the offset or zero wrong?")
    elif channel.unit == "degC" and not _AIR_DEGC[0] <= low <= high <= _AIR_DEGC[1]:
        found.append(f"{low:.3g} ... {high:.3g} degC: is the unit {unit}?")
    if channel.name.startswith("rate/") and (beyond := int(np.sum(np.abs(channel.value) >= RATE_LIMIT))):
        found.append(f"{counted(beyond, 'sample')} beyond {RATE_LIMIT:g} {channel.unit}, which count as missing: is the unit {unit}?")
    return found + _doubts_of_rate(channel)


def _doubts_of_rate(angle: Imported) -> list[str]:
    """Whether a rate tells of another motion than its angle."""
    if angle.rate is None:
        return []
    turned, by_rate = _moved(angle)
    ratio, correlation, (low, high) = _ratio(turned, by_rate), _correlation(turned, by_rate), _range(angle.value)
    if ratio is not None and not 0.8 < ratio < 1.25:
        return [f"moves {ratio:.3g} times what its rate says"]
    if correlation is not None and abs(correlation) < _UNRELATED and high - low > _MOVES:
        return [f"moves otherwise than its rate says (correlation {correlation:.2f}): is it the rate of this angle?"]
    return []


def _ceiling(low: float, high: float) -> float:
    """A round number above both magnitudes."""
    most = max(-low, high)
    unit = 10.0 ** math.floor(math.log10(most))
    return unit * math.ceil(1.1 * most / unit)


def _range(value: Array) -> tuple[float, float]:
    """Where all but a few values lie."""
    low, high = np.quantile(value, [_SHARE / 2, 1.0 - _SHARE / 2])
    return float(low), float(high)


def _moved(channel: Imported) -> tuple[Array, Array]:
    """Angle covered between samples, by the angle and by its rate, where both are known."""
    assert channel.rate is not None
    step, turned = np.diff(channel.time_s), np.diff(channel.value)
    rate = np.where(np.abs(channel.rate) < RATE_LIMIT, channel.rate, np.nan)
    by_rate = 0.5 * (rate[1:] + rate[:-1]) * step
    known = np.isfinite(by_rate) & (step > 0.0)
    # Sums over about a hundredth of the recording: single steps are mostly the resolution of the sensor.
    edges = np.arange(0, int(known.sum()), max(1, int(known.sum()) // 100))
    if edges.size < _MIN_SAMPLES:
        return np.empty(0), np.empty(0)
    return np.add.reduceat(turned[known], edges), np.add.reduceat(by_rate[known], edges)


def _ratio(value: Array, other: Array) -> float | None:
    """How many times ``other`` the ``value`` is, where both surely tell of the same motion."""
    correlation = _correlation(value, other)
    if correlation is None or abs(correlation) < _CORRELATED:
        return None
    return math.copysign(math.sqrt((value @ value) / (other @ other)), correlation)


def _correlation(value: Array, other: Array) -> float | None:
    """Without means, as both are zero at rest; nothing where too few tell."""
    if value.size < _MIN_SAMPLES:
        return None
    power = math.sqrt(float(value @ value) * float(other @ other))
    return float(value @ other) / power if power > 0.0 else 0.0


def _refuse_degrees(file: Path, name: str, other: str, ratio: float) -> None:
    for factor, first, second in ((DEGREES, name, other), (1.0 / DEGREES, other, name)):
        if abs(abs(ratio) / factor - 1.0) < _ALIKE:
            raise MapFileError(
                f"{file}: channel {first}: moves {DEGREES:.0f} times as far as {second} says, expected the same; "
                f"{first} is in deg and not in rad, or {second} the other way round"
            )
