# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Manoeuvres as data, and the angles of both tracks that they ask for.

A manoeuvre is a list of segments of the mean steering angle (the angle of a wheel in the middle of the axle); the
Ackermann
relation gives the two track angles. A recorded bag or a CSV file may prescribe both tracks instead.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from lugre_steering.errors import DataError
from lugre_steering.files import read_text
from lugre_steering.recording import Array, Recording
from lugre_steering.schema import Reader
from lugre_steering.vehicle import Axle, Vehicle

STEP_S = 0.002
"""Grid of the simulation; the bristle step is exact at constant rate, so this only has to resolve the corners of the
motion."""
SAMPLE_S = 0.02
"""Sampling interval of a manoeuvre that is only looked at, by a card or to choose the next experiment."""
SMOOTHING_S = 0.2
"""Width of each of the two running means that round the corners: rates rise over 0.4 s, accelerations are
continuous."""
SHORTEST_S, LONGEST_S = 0.05, 7200.0
LARGEST_DEG = 60.0
LONGEST_CSV = 1 << 28
"""Bytes of a table of angles: two hours at the grid's rate have a few dozen million."""


@dataclass(frozen=True)
class Sweep:
    """Turn to ``to_deg`` at ``rate_deg_s``, then stay there for ``hold_s``."""

    to_deg: float
    rate_deg_s: float
    hold_s: float = 0.0


@dataclass(frozen=True)
class Hold:
    """Stay for ``duration_s``."""

    duration_s: float


@dataclass(frozen=True)
class Chirp:
    """Oscillate about the present angle with a linearly changing frequency; the amplitude swells in and out over one
    second."""

    amplitude_deg: float
    from_Hz: float
    to_Hz: float
    duration_s: float


Segment = Sweep | Hold | Chirp


@dataclass(frozen=True)
class Manoeuvre:
    """A named list of segments of the mean steering angle, which starts at zero."""

    name: str
    description: str
    segments: tuple[Segment, ...]


@dataclass(frozen=True)
class Motion:
    """True angles: ``time`` (n,) [s] on a uniform grid from 0, ``theta`` (sides, n) [rad]."""

    time: Array
    theta: Array

    @property
    def rate(self) -> Array:
        """(sides, n) [rad/s]."""
        return np.gradient(self.theta, self.time, axis=1)

    @property
    def acceleration(self) -> Array:
        """(sides, n) [rad/s2]."""
        return np.gradient(self.rate, self.time, axis=1)


def cycles(limit_deg: float, rate_deg_s: float, count: int, hold_s: float = 3.0) -> tuple[Segment, ...]:
    """``count`` full cycles 0, +limit, -limit, ..., back to 0, held at each limit, parked for 2 s before and after."""
    turns = [Sweep(limit_deg if i % 2 == 0 else -limit_deg, rate_deg_s, hold_s) for i in range(2 * count)]
    return (Hold(2.0), *turns, Sweep(0.0, rate_deg_s), Hold(2.0))


LIMIT_DEG = 28.0
"""Mean steering angle at the limits of the test vehicle (inner track 32 deg); the paper's own limit is lost."""

HEATING = ("six-cycles", "heat-and-rest")
"""Built-in manoeuvres that only tell something of rubber that warms."""

BUILT_IN = {
    m.name: m
    for m in (
        Manoeuvre(
            "double-cycle",
            "the paper's test: 0, +limit, -limit, +limit, -limit, 0 at 6 deg/s, 3 s held at each limit",
            cycles(LIMIT_DEG, 6.0, 2),
        ),
        Manoeuvre("six-cycles", "six full cycles at 4 deg/s: heating", cycles(LIMIT_DEG, 4.0, 6)),
        Manoeuvre(
            "varied-rates",
            "full sweeps at 1.5 to 10 deg/s with short holds: speed dependence",
            (
                Hold(2.0),
                *(
                    Sweep(LIMIT_DEG if i % 2 == 0 else -LIMIT_DEG, rate, 1.5)
                    for i, rate in enumerate((8.0, 3.0, 10.0, 1.5, 6.0, 2.0))
                ),
                Sweep(0.0, 5.0),
                Hold(2.0),
            ),
        ),
        Manoeuvre(
            "small-loops",
            "reversals of 1 to 8 deg on the way out and back: presliding stiffness, play, compliance",
            (
                Hold(2.0),
                *(
                    Sweep(to, 2.0, 0.5)
                    for to in (10.0, 9.0, 12.0, 10.0, 20.0, 16.0, 24.0, 16.0, 0.0, 4.0, -12.0, -10.0, -20.0, -12.0, 0.0)
                ),
                Hold(2.0),
            ),
        ),
        Manoeuvre(
            "chirp",
            "10 deg at 0.05 to 0.3 Hz: lag, delay, inertia",
            (Hold(2.0), Chirp(10.0, 0.05, 0.3, 60.0), Hold(2.0)),
        ),
        Manoeuvre(
            "hold-and-rest",
            "a turn held for a minute half way and at the limit: relaxation, leakage, cooling",
            (
                Hold(5.0),
                Sweep(14.0, 5.0, 60.0),
                Sweep(LIMIT_DEG, 5.0, 60.0),
                Sweep(-LIMIT_DEG, 5.0, 30.0),
                Sweep(0.0, 5.0, 30.0),
            ),
        ),
        Manoeuvre(
            "slow-sweeps",
            "half sweeps at 0.5, 1, 4 and 2 deg/s: static against sliding friction, Stribeck speed",
            (Hold(2.0), Sweep(14.0, 0.5, 2.0), Sweep(-14.0, 1.0, 2.0), Sweep(14.0, 4.0, 2.0), Sweep(0.0, 2.0, 2.0)),
        ),
        Manoeuvre(
            "heat-and-rest",
            "four cycles at 8 deg/s, three minutes parked, one more cycle: heat capacity, cooling",
            (*cycles(LIMIT_DEG, 8.0, 4, 1.0), Hold(180.0), *cycles(LIMIT_DEG, 8.0, 1, 1.0)),
        ),
    )
}


def ackermann(mean: Array, axle: Axle) -> Array:
    """Left and right track angle (2, n) [rad] for mean angles (n,) [rad]: cot(right) - cot(left) = b / L (b kingpin
    distance,
    L wheelbase), the inner track turning more."""
    tangent = np.tan(mean)
    half = 0.5 * axle.kingpin_distance_m / axle.wheelbase_m * tangent
    return np.stack([np.arctan2(tangent, 1.0 - half), np.arctan2(tangent, 1.0 + half)])


def motion_of(manoeuvre: Manoeuvre, vehicle: Vehicle) -> Motion:
    """Angles of all tracks for a manoeuvre of this vehicle (a single joint turns by the mean angle itself)."""
    return _motion(*_mean_angle(manoeuvre), vehicle)


def _motion(time: Array, mean: Array, vehicle: Vehicle) -> Motion:
    """Both tracks from mean angles [rad] at any times."""
    grid, (smooth,) = _on_grid(time, mean[None, :])
    if vehicle.axle is None:
        return Motion(grid, np.repeat(smooth[None, :], len(vehicle.sides), axis=0))
    if (largest := float(np.degrees(np.abs(smooth).max()))) > LARGEST_DEG:
        raise DataError(f"the mean steering angle reaches {largest:.3g} deg, expected at most {LARGEST_DEG:g} deg")
    both = dict(zip(("left", "right"), ackermann(smooth, vehicle.axle), strict=True))
    return Motion(grid, np.stack([both[side] for side in vehicle.sides]))


def _on_grid(time: Array, value: Array) -> tuple[Array, Array]:
    """Uniform grid (n,) and the rows of ``value`` on it, corners rounded."""
    if time[-1] - time[0] < SHORTEST_S:
        raise DataError(f"the motion lasts {time[-1] - time[0]:g} s, expected at least {SHORTEST_S:g} s")
    grid = np.arange(0.0, time[-1] - time[0] + 0.5 * STEP_S, STEP_S)
    rows = np.stack([np.interp(grid, time - time[0], row) for row in value])
    width = round(SMOOTHING_S / STEP_S)
    for _ in range(2):
        rows = uniform_filter1d(rows, width, axis=1, mode="nearest")
    return grid, rows


def _mean_angle(manoeuvre: Manoeuvre) -> tuple[Array, Array]:
    """Times [s] and mean angles [rad] of all segments in a row, linear in between."""
    time, angle = [np.zeros(1)], [np.zeros(1)]
    now, at = 0.0, 0.0
    for segment in manoeuvre.segments:
        if isinstance(segment, Sweep):
            turn = abs(segment.to_deg - at) / segment.rate_deg_s
            piece = np.array([turn, turn + segment.hold_s]), np.array([segment.to_deg, segment.to_deg])
        elif isinstance(segment, Hold):
            piece = np.array([segment.duration_s]), np.array([at])
        else:
            piece = _chirp(segment, at)
        time.append(now + piece[0])
        angle.append(piece[1])
        now, at = float(time[-1][-1]), float(angle[-1][-1])
    if now > LONGEST_S:
        raise DataError(f"manoeuvre '{manoeuvre.name}': lasts {now:.0f} s, expected at most {LONGEST_S:.0f} s")
    return np.concatenate(time), np.radians(np.concatenate(angle))


def _chirp(chirp: Chirp, at: float) -> tuple[Array, Array]:
    t = np.append(np.arange(STEP_S, chirp.duration_s, STEP_S), chirp.duration_s)
    phase = 2.0 * math.pi * t * (chirp.from_Hz + 0.5 * (chirp.to_Hz - chirp.from_Hz) * t / chirp.duration_s)
    swell = np.clip(np.minimum(t, chirp.duration_s - t), 0.0, 1.0)
    return t, at + chirp.amplitude_deg * swell * np.sin(phase)


_SEGMENTS: dict[str, type[Sweep] | type[Hold] | type[Chirp]] = {"sweep": Sweep, "hold": Hold, "chirp": Chirp}
_BOUNDS = {
    "to_deg": (-LARGEST_DEG, LARGEST_DEG),
    "rate_deg_s": (1e-3, 100.0),
    "hold_s": (0.0, LONGEST_S),
    "duration_s": (0.01, LONGEST_S),
    "amplitude_deg": (0.0, LARGEST_DEG),
    "from_Hz": (0.0, 50.0),
    "to_Hz": (0.0, 50.0),
}


def from_yaml(file: Path) -> Manoeuvre:
    """A manoeuvre from a YAML file: ``segments:`` with a list of ``sweep:``, ``hold:`` and ``chirp:`` mappings, and maybe a
    ``description:``."""
    reader = Reader(file, DataError)
    data = reader.load()
    if not isinstance(data, Mapping):
        raise reader.fail("(top level)", data, "a mapping with the list 'segments'")
    for key in data:
        if key not in ("segments", "description"):
            raise reader.fail(str(key), data[key], "no such key; segments and description only")
    segments = data.get("segments")
    if not isinstance(segments, list) or not segments:
        raise reader.fail("segments", segments, "a list of sweep, hold and chirp")
    built = tuple(_segment(item, f"{file}: key 'segments[{i}]'") for i, item in enumerate(segments))
    return Manoeuvre(file.stem, str(data.get("description", f"from {file.name}")), built)


def _segment(item: Any, where: str) -> Segment:
    if not isinstance(item, Mapping) or len(item) != 1 or next(iter(item)) not in _SEGMENTS:
        raise DataError(f"{where}: got {item!r}, expected one of {', '.join(_SEGMENTS)}")
    kind, values = next(iter(item.items()))
    fields = {f.name: f for f in dataclasses.fields(_SEGMENTS[kind])}
    if not isinstance(values, Mapping) or not set(values) <= set(fields):
        raise DataError(f"{where}: {kind} got {values!r}, expected a mapping of {', '.join(fields)}")
    numbers = {}
    for name, field in fields.items():
        value = values.get(name, field.default)
        low, high = _BOUNDS[name]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            got = "nothing" if value is dataclasses.MISSING else repr(value)
            raise DataError(f"{where}: {kind}.{name}: got {got}, expected a number from {low:g} to {high:g}")
        numbers[name] = float(value)
    return _SEGMENTS[kind](**numbers)


_COLUMNS: tuple[tuple[str, Callable[[Array], Array]], ...] = (("rad", lambda x: x), ("deg", np.radians))


def from_csv(file: Path, vehicle: Vehicle) -> Motion:
    """Angles from a CSV file: column ``time_s`` and either one column per track (``left_deg``, ``right_deg``, or
    ``..._rad``) or the mean angle (``angle_deg`` or ``angle_rad``). Lines that begin with # are comments."""
    header, rows = _csv_rows(file)
    columns = dict(zip(header, rows.T, strict=True))
    if "time_s" not in columns:
        raise DataError(f"{file}: columns {', '.join(header)}; expected time_s among them")
    time = columns["time_s"]
    backward = np.flatnonzero(np.diff(time) <= 0.0)
    if backward.size:
        at = int(backward[0]) + 1
        raise DataError(
            f"{file}: time_s {time[at]:g} follows {time[at - 1]:g} in data row {at + 1}; expected increasing times"
        )
    if time[-1] - time[0] > LONGEST_S:
        raise DataError(f"{file}: lasts {time[-1] - time[0]:.0f} s, expected at most {LONGEST_S:.0f} s")
    for unit, convert in _COLUMNS:
        names = [f"{side}_{unit}" for side in vehicle.sides]
        if all(name in columns for name in names):
            theta = np.stack([convert(columns[name]) for name in names])
            _check_angles(file, theta)
            return Motion(*_on_grid(time, theta))
        if f"angle_{unit}" in columns:
            mean = convert(columns[f"angle_{unit}"])
            _check_angles(file, mean)
            return _motion(time, mean, vehicle)
    wanted = " and ".join(f"{side}_deg" for side in vehicle.sides)
    raise DataError(f"{file}: columns {', '.join(header)}; expected {wanted}, or angle_deg (or the same in _rad)")


def _csv_rows(file: Path) -> tuple[list[str], Array]:
    try:
        lines = read_text(file, LONGEST_CSV).removeprefix("\ufeff").splitlines()  # spreadsheets put a byte order mark first
    except (OSError, ValueError) as error:
        raise DataError(f"{file}: cannot be read: {error}") from error
    kept = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    if len(kept) < 3:
        raise DataError(f"{file}: has {max(len(kept) - 1, 0)} data rows, expected a header and at least two rows")
    header = [cell.strip() for cell in kept[0][1].split(",")]
    for name in header:
        if header.count(name) > 1:
            raise DataError(f"{file}: line {kept[0][0]}: column '{name}' occurs twice; expected distinct column names")
    rows = np.empty((len(kept) - 1, len(header)))
    for i, (number, line) in enumerate(kept[1:]):
        cells = line.split(",")
        try:
            values = [float(cell) for cell in cells]
        except ValueError:
            values = []
        if len(values) != len(header):
            raise DataError(f"{file}: line {number}: got '{line}', expected {len(header)} numbers")
        rows[i] = values
        if not np.isfinite(rows[i]).all():
            raise DataError(f"{file}: line {number}: got '{line}', expected finite numbers")
    return header, rows


def _check_angles(source: object, theta: Array) -> None:
    largest = float(np.degrees(np.abs(theta).max()))
    if largest > LARGEST_DEG:
        raise DataError(f"{source}: an angle of {largest:.3g} deg, expected at most {LARGEST_DEG:g} deg either way")


def from_recording(recording: Recording, vehicle: Vehicle) -> Motion:
    """The angles of a recorded bag, sensor noise smoothed away by the running means that round every manoeuvre.

    Only the stretch that all tracks have in common is used; gaps are bridged linearly.
    """
    signals = []
    for side in vehicle.sides:
        if side not in recording.angle:
            raise DataError(f"{recording.name}: no usable steering angle of the {side} track")
        signals.append(recording.angle[side])
    begin, end = max(s.time_s[0] for s in signals), min(s.time_s[-1] for s in signals)
    if end - begin < 1.0:
        raise DataError(
            f"{recording.name}: the angles of all tracks overlap for {max(end - begin, 0):.2f} s, expected 1 s or more"
        )
    if end - begin > LONGEST_S:
        raise DataError(f"{recording.name}: lasts {end - begin:.0f} s, expected at most {LONGEST_S:.0f} s")
    time = np.arange(begin, end, STEP_S)
    theta = np.stack([np.interp(time, s.time_s, _quiet(s.value, vehicle)) for s in signals])
    _check_angles(recording.name, theta)
    return Motion(*_on_grid(time, theta))


def _quiet(angle: Array, vehicle: Vehicle) -> Array:
    """Recorded angles with a parked joint truly at rest: noise below four standard deviations is no motion (play
    operator)."""
    return np.array(_play(angle.tolist(), 4.0 * vehicle.sensors.angle_sigma))


def _play(values: Sequence[float], half_width: float) -> list[float]:
    out, centre = [], values[0]
    for value in values:
        centre = min(max(centre, value - half_width), value + half_width)
        out.append(centre)
    return out
