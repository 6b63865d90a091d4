# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Channels that measure nothing of this machine: constant, noise alone, a copy of another, a zero far off.

Each is told by what the rest of the recording says that it should have shown; none of them leaves anything to diagnose.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares

from lugre_steering import units
from lugre_steering.chain.step import torque_side
from lugre_steering.data.dataset import Run, prepare
from lugre_steering.data.sensing import FOURTH, sensed, white_noise
from lugre_steering.errors import DataError
from lugre_steering.recording import Array, Finding, Kind, Recording, Signal
from lugre_steering.report.words import percent
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.actuation import line_pressures, total_gains
from lugre_steering.vehicle.model import Model, build_model

MEAN_S = 0.25
"""Over which noise is averaged out before a channel's travel is measured."""
MOVES = 2.0
"""Presliding lengths that the tracks must turn before anything is expected of other channels."""
ALIVE = 0.05
"""Share of its expected travel that a pressure must show, or an angle of that of MOVES."""
RESTS = 0.1
"""Share of its own travel that a line moves at most where only its counterpart works."""
ALL_NOISE, BEYOND = 0.5, 10.0
"""Share of a channel's variance that may be white noise, and times the sheet's noise up to which it may only stand still."""
WORKS = 0.5
"""Share of the sliding friction of all tracks that moves them, if it comes both ways."""
ROUGH = 0.05
"""Of a presliding length: noise of an angle sample from which a bristle cannot be followed."""
COPIED, APART_RAD = 0.1, float(np.radians(0.3))
"""Share of the geometry's difference between the tracks that two sensors must show, where it reaches that root mean square."""
ZERO_RAD, RESTORED, MISSED_RAD = float(np.radians(3.0)), 0.4, float(np.radians(1.0))
"""Zeros of the angles so far off, which restore the steering geometry to so much of its error, where that is so large."""
IDLE = 4.0
"""Times its white noise that the mean over MEAN_S of a channel moves by chance."""
FAR_RAD = np.pi / 2.0
"""No steered track turns so far: another unit, which the check of wiring tells."""
HELD = 0.2
"""Share of a recording in which an angle sensor may stand at an end of its range."""


TopicNames = dict[tuple[Kind, str], str]
Intervals = tuple[tuple[float, float], ...]


def inspect_dead(recording: Recording, vehicle: Vehicle) -> tuple[Finding, ...]:
    """Findings about channels that show nothing of the machine."""
    topics = {(c.kind, c.name): c.topic for c in vehicle.channels}
    farthest = max((float(np.abs(s.value).max()) for s in recording.angle.values() if s.value.size), default=0.0)
    if vehicle.track is not None and farthest > FAR_RAD:
        return ()
    if noise := tuple(_noise_alone(recording, vehicle, topics)):
        return noise
    try:
        run = prepare(recording, vehicle)
    except DataError:
        return ()
    angles = tuple(_frozen(run, vehicle, topics)) or tuple(_zeros(run, vehicle, topics))
    return (*dict.fromkeys(angles), *_constant(run, vehicle, topics))


def inspect_angles(recording: Recording, vehicle: Vehicle) -> tuple[Finding, ...]:
    """Findings about angles of sound units that are too noisy to follow a bristle."""
    try:
        run = prepare(recording, vehicle)
    except DataError:
        return ()
    topics = {(c.kind, c.name): c.topic for c in vehicle.channels}
    return tuple(_rough(recording, run, vehicle, topics))


def inspect_copies(recording: Recording, vehicle: Vehicle) -> tuple[Finding, ...]:
    """A finding where both angles are alike although the steering geometry makes them differ.

    About the recording as it came: a copy that lags looks so noisy that nothing of it may be left to use.
    """
    ratio = _ratio(vehicle)
    left, right = (recording.angle.get(side) for side in ("left", "right"))
    if ratio is None or left is None or right is None or min(left.time_s.size, right.time_s.size) < 2:
        return ()
    apart = _rms(_other(left.value, ratio) - left.value)
    if apart < APART_RAD or _rms(np.interp(left.time_s, right.time_s, right.value) - left.value) > COPIED * apart:
        return ()
    topics = {c.name: c.topic for c in vehicle.channels if c.kind is Kind.ANGLE}
    statement = (
        f"show one and the same angle, where the steering geometry makes the tracks differ by {np.degrees(apart):.1f} deg; one sensor is "
        "missing, or read twice (with one sensor alone, say so: sensors.angle_from)"
    )
    return (_finding("copied_sensor", f"{topics['left']}, {topics['right']}", statement),)


def _finding(name: str, topic: str, statement: str, intervals: Intervals = ()) -> Finding:
    return Finding(name, topic, f"{topic}: {statement}", intervals)


def _signals(recording: Recording, vehicle: Vehicle) -> Iterator[tuple[Kind, str, Signal]]:
    for side in vehicle.sides:
        if side in recording.angle:
            yield Kind.ANGLE, side, recording.angle[side]
    for line in vehicle.hydraulics.lines if vehicle.hydraulics is not None else ():
        if line in recording.pressure:
            yield Kind.PRESSURE, line, recording.pressure[line]


def _noise_alone(recording: Recording, vehicle: Vehicle, topics: TopicNames) -> Iterator[Finding]:
    """All angles, or all pressures, hold more white noise than anything else, and far more than the sheet's: no standstill."""
    sheet = {Kind.ANGLE: vehicle.sensors.angle_sigma, Kind.PRESSURE: vehicle.sensors.pressure_noise_Pa}
    for kind, what in ((Kind.ANGLE, "angle"), (Kind.PRESSURE, "pressure")):
        shown = [(name, signal) for of, name, signal in _signals(recording, vehicle) if of is kind and signal.time_s.size >= 100]
        random = [
            name for name, s in shown if white_noise(s) ** 2 > max((BEYOND * sheet[kind]) ** 2, ALL_NOISE * float(np.var(s.value)))
        ]
        if shown and len(random) == len(shown):
            topic = ", ".join(dict.fromkeys(topics[kind, name] for name in random))
            statement = f"noise and no {what}: nothing of it lasts from one sample to the next; check the sensor"
            yield _finding("dead_sensor", topic, statement)


def _rough(recording: Recording, run: Run, vehicle: Vehicle, topics: TopicNames) -> Iterator[Finding]:
    """Angles too noisy to follow a bristle; a rig's stiffness is a guess, by which nothing is judged.

    What counts is the noise on the common clock, for which samples of a fast sensor are averaged; a sensor is known by that of one sample.
    """
    if vehicle.contact is not None:
        return
    presliding = _presliding(build_model(vehicle))
    left = run.angle.sigma()
    if left > ROUGH * presliding:
        single = max(sensed(signal).sigma() for signal in recording.angle.values())
        averaged = f", {units.distance(vehicle, left, degrees='.2g')} in the mean over a step of the clock," if left < 0.9 * single else ""
        topic = ", ".join(dict.fromkeys(topics[Kind.ANGLE, side] for side in vehicle.sides))
        yield _finding(
            "noisy_sensor", topic,
            f"noise of {units.distance(vehicle, single, degrees='.2g')} per sample{averaged} is {percent(left / presliding)} of what the "
            "contact turns before it slides; no friction can be told from it; check the sensor and its cable",
        )  # fmt: skip


def _smooth(run: Run, values: Array) -> Array:
    """Values (n,) with noise averaged out."""
    return np.asarray(uniform_filter1d(values, max(1, round(MEAN_S / float(run.time[1] - run.time[0])))))


def _travel(run: Run, values: Array) -> float:
    """Span of (n,) values once noise is averaged out."""
    return float(np.ptp(_smooth(run, values))) if values.size else 0.0


def _still(values: Array, limit: float) -> tuple[slice, slice]:
    """The longest beginning and the longest end in which each row of values (k, n) stays within ``limit``."""

    def stays(rows: Array) -> int:
        return int(((np.maximum.accumulate(rows, axis=1) - np.minimum.accumulate(rows, axis=1)).max(axis=0) <= limit).sum())

    return slice(0, stays(values)), slice(values.shape[1] - stays(values[:, ::-1]), values.shape[1])


def _stretch(run: Run, part: slice) -> tuple[str, Intervals]:
    """When a part of a run was, in words and as intervals; nothing to say of the whole."""
    if part == slice(0, run.time.size):
        return "", ()
    start, end = float(run.time[part][0]), float(run.time[part][-1])
    return (f" until {end:.1f} s" if part.start == 0 else f" from {start:.1f} s on"), ((start, end),)


def _presliding(model: Model) -> float:
    record = model.parameters[0][0]
    return float(record["coulomb_torque"] / record["sigma_0"])


def _frozen(run: Run, vehicle: Vehicle, topics: TopicNames) -> Iterator[Finding]:
    """An angle that stays while the other turns, or all of them while the torque works both ways."""
    model = build_model(vehicle)
    least = MOVES * _presliding(model)
    for row, side in enumerate(vehicle.sides):
        for part in _still(run.theta[[row]], ALIVE * least):
            if float(np.ptp(run.theta[:, part], axis=1).max(initial=0.0)) > least:
                when, intervals = _stretch(run, part)
                statement = f"stays where it is{when} while the other track turns; check the sensor and its driver"
                yield _finding("dead_sensor", topics[Kind.ANGLE, side], statement, intervals)
    if vehicle.contact is not None:  # the load of a joint that is held may come from elsewhere
        return
    enough = WORKS * sum(float(parameters[0]["coulomb_torque"]) for parameters in model.parameters)
    for part in _still(run.theta, ALIVE * least):
        work = _smooth(run, run.measured)[part][run.valid[part]]
        # A shorter stretch may be a stop beside pressures of another clock.
        if work.size > HELD * run.time.size and min(float(work.max()), -float(work.min())) > enough:
            when, intervals = _stretch(run, part)
            statement = f"stays where it is{when} while the cylinders push both ways; check the sensor and its driver"
            topic = ", ".join(dict.fromkeys(topics[Kind.ANGLE, side] for side in vehicle.sides))
            yield _finding("dead_sensor", topic, statement, intervals)


def _geometry(run: Run, vehicle: Vehicle) -> tuple[Array, Array, float] | None:
    """Left and right angle (n,) and b / L of a vehicle whose two sensors obey a steering geometry."""
    ratio = _ratio(vehicle)
    if ratio is None:
        return None
    left, right = (run.theta[vehicle.sides.index(side)][run.valid] for side in ("left", "right"))
    return left, right, ratio


def _ratio(vehicle: Vehicle) -> float | None:
    """b / L of a vehicle with two angle sensors that obey a steering geometry."""
    if vehicle.axle is None or set(vehicle.sides) != {"left", "right"} or vehicle.sensors.angle_from is not None:
        return None
    return vehicle.axle.kingpin_distance_m / vehicle.axle.wheelbase_m


def _other(left: Array, ratio: float) -> Array:
    """Right angle (n,) by the steering geometry, cot(left) - cot(right) = -b / L."""
    t = np.tan(left)
    return np.asarray(np.arctan2(t, 1.0 + ratio * t))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def _zeros(run: Run, vehicle: Vehicle, topics: TopicNames) -> Iterator[Finding]:
    """Zeros of the angles so far off that the steering geometry shows it."""
    both = _geometry(run, vehicle)
    if both is None:
        return
    left, right, ratio = (both[0][::10], both[1][::10], both[2])
    missed = _rms(right - _other(left, ratio))
    if missed < MISSED_RAD:
        return
    found = least_squares(lambda off: right - off[1] - _other(left - off[0], ratio), np.zeros(2))
    worst = int(np.abs(found.x).argmax())
    if abs(float(found.x[worst])) < ZERO_RAD or _rms(found.fun) > RESTORED * missed:
        return
    for side, off in zip(("left", "right"), found.x, strict=True):
        if abs(float(off)) > 0.5 * abs(float(found.x[worst])):
            statement = f"its zero is about {np.degrees(off):+.0f} deg off by the steering geometry; set it anew"
            yield _finding("angle_zero", topics[Kind.ANGLE, side], statement)


def _constant(run: Run, vehicle: Vehicle, topics: TopicNames) -> Iterator[Finding]:
    """Lines that stay though the tracks turn there and back against friction, and no other line of their circuits does their work."""
    if vehicle.hydraulics is None:
        return
    model = build_model(vehicle)
    rows = zip(model.parameters, run.theta, run.omega, run.alpha, strict=True)
    torque = np.asarray(np.sum([torque_side(p, model.rubber, run.time, *row) for p, *row in rows], axis=0))
    try:
        expected = line_pressures(torque, total_gains(vehicle, run.theta))
    except DataError:  # angles that these cylinders cannot reach: a matter of units
        return
    lines, cylinders = vehicle.hydraulics.lines, vehicle.hydraulics.cylinders.values()
    pressure, nominal = dict(zip(lines, run.pressure, strict=True)), dict(zip(lines, expected, strict=True))
    least = MOVES * _presliding(model)

    def stays(line: str) -> slice | None:
        """The part of the run in which the line does not do what it should."""
        shown = _smooth(run, pressure[line])
        about = _still(shown[None], ALIVE * _travel(run, nominal[line][run.valid]))
        for end, noise in enumerate(_moved_by_noise(run, pressure[line], part) for part in about):
            part = _still(shown[None], noise)[end]
            should = _travel(run, nominal[line][part][run.valid[part]])
            if noise < ALIVE * should and max(_there_and_back(theta[part]) for theta in run.theta) > least:
                return part
        return None

    still = {line: part for line in lines if (part := stays(line)) is not None}

    def rests(other: str, line: str) -> bool:
        needed = run.valid & (nominal[line] > 0.5 * nominal[line].max())
        needed[: still[line].start] = needed[still[line].stop :] = False
        return other in still or _travel(run, pressure[other][needed]) < RESTS * _travel(run, pressure[other][run.valid])

    circuits = [{c.cap, c.rod} & set(lines) for c in cylinders]
    dead = [line for line in still if all(rests(other, line) for c in circuits if line in c for other in c)]
    for when, intervals in dict.fromkeys(_stretch(run, still[line]) for line in dead):
        topic = ", ".join(topics[Kind.PRESSURE, line] for line in dead if _stretch(run, still[line])[1] == intervals)
        statement = f"stays constant but for noise{when} while the tracks turn against friction; check sensors, plugs and valves"
        yield _finding("dead_sensor", topic, statement, intervals)


def _there_and_back(values: Array) -> float:
    """How far (n,) values go one way, and at least as far the other."""
    if not values.size:
        return 0.0
    up, down = values - np.minimum.accumulate(values), np.maximum.accumulate(values) - values
    return float(min(up.max(), down.max()))


def _moved_by_noise(run: Run, shown: Array, part: slice) -> float:
    """How far a pressure moves in a part of a run by nothing but its own noise, in whatever unit."""
    noise = white_noise(Signal(run.time[part], shown[part])) if part.stop - part.start > FOURTH.size else 0.0
    return max(IDLE * noise, 1e-9 * float(np.abs(shown).max()))
