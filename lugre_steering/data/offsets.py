# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Offsets of clocks and of pressure sensors: torque stamped late or early against the angles, zeros that drift."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import correlate
from scipy.stats import theilslopes

from lugre_steering.chain.lag import lagged
from lugre_steering.data.dataset import Run
from lugre_steering.data.nominal import GAIN, GOOD, nominal_torques, topics_of
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.recording import Array, Finding, Kind
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.model import Model, build_model
from lugre_steering.vehicle.sensors import delay_s, lag_s

SKEW_S = 0.12
"""Smaller shifts are the catalogue effects time_delay and pressure_lag, which are fitted; friction may look like 0.1 s."""
SKEW_RANGE_S = 5.0
SKEW_ENERGY = 0.5
SKEW_HELD = 0.8
"""Share of the nominal torque's slope energy that must stay in the stretch that is shifted."""
SKEW_RATE_HZ = 50.0
SOFTER = (0.5, 0.7, 1.0, 1.4)
PLAY = (0.0, 0.1, 0.3, 0.6)
LAG_S = (0.1, 0.2, 0.3, 0.5)
"""Stiffness factors, backlash (in presliding lengths) and lags that may explain a late torque in place of a clock."""
DRIFT_SHARE = 0.02
"""Share of the sensor range; smaller drifts are left to the catalogue effect pressure_drift alone."""
APART = 0.5
"""Share of the deviation of the times that must be left beside the rates: where they mostly rise or fall, a drift is not told from them."""


@dataclass(frozen=True)
class _Shifts:
    """Slope of the measured torque, every ``stride`` samples or ``dt`` seconds, that may be shifted by up to ``reach`` places;
    its ``energy`` in the stretch that each shift leaves."""

    measured: Array
    energy: Array
    reach: int
    stride: int
    dt: float

    def match(self, torque: Array) -> tuple[float, float, float]:
        """Unexplained share at the best shift, that shift [s], and the share unshifted, for one variant of the torque."""
        expected = _slope(torque, self.stride, self.dt)[self.reach : self.measured.size - self.reach]
        power = max(float(np.sum(expected**2)), 1e-30)
        overlap = correlate(self.measured, expected, mode="valid")
        gain = np.clip(overlap / power, 1.0 / GAIN, GAIN)
        left = 1.0 + (gain**2 * power - 2.0 * gain * overlap) / np.maximum(self.energy, 1e-30)
        return float(left.min()), (_lowest(left) - self.reach) * self.dt, float(left[self.reach])


def clock_skew(vehicle: Vehicle, run: Run) -> Iterator[Finding]:
    """Torque stamped late or early against the angles, by more than softer springs, play or a slow sensor could imitate.

    The slope dM/dt of measured and nominal torque is matched over shifts, for every stiffness and play in SOFTER and PLAY, and
    unshifted for the lags in LAG_S too. A clock shifts starts and stops alike at any rate; the others do not, so one of the
    variants fits better there.
    """
    model = build_model(vehicle)
    nominal = _seen(vehicle, run, model)
    shifts = _shifts(run, nominal)
    if shifts is None or abs(shifts.match(nominal)[1]) <= SKEW_S:
        return
    matches, unshifted = [], np.inf
    for torque in (_seen(vehicle, run, variant) for variant in _variants(model)):
        matches.append(shifts.match(torque))
        slow = (shifts.match(lagged(torque, _step(run), lag))[2] for lag in LAG_S)
        unshifted = min(unshifted, matches[-1][2], *slow)
    best, shift, _ = min(matches)
    if abs(shift) > SKEW_S and best < min(SKEW_ENERGY * unshifted, GOOD**2):
        kind = Kind.PRESSURE if vehicle.hydraulics is not None else Kind.TORQUE
        topics = ", ".join(topics_of(vehicle, kind).values())
        late = "late" if shift > 0.0 else "early"
        # The best may lie at the end of the search, or beyond.
        least = "at least " if abs(shift) > (shifts.reach - 1.5) * shifts.dt else ""
        yield Finding(
            "clock_skew", topics,
            f"{topics}: stamped {least}{abs(shift):.2f} s too {late} against the angles (unexplained share of the torque's slope "
            f"{unshifted:.2f} as recorded, {best:.2f} shifted); synchronise the clocks of the devices",
        )  # fmt: skip


def _step(run: Run) -> float:
    return float(run.time[1] - run.time[0])


def _seen(vehicle: Vehicle, run: Run, model: Model) -> Array:
    """Torque of a model as sensors show it whose delay and lag the vehicle file knows."""
    torque = nominal_torques(model, run).sum(axis=0)
    return lagged(np.interp(run.time - delay_s(vehicle), run.time, torque), _step(run), lag_s(vehicle))


def _slope(torque: Array, stride: int, dt: float) -> Array:
    return np.asarray(np.gradient(uniform_filter1d(torque, max(3, round(0.1 / dt) * stride))[::stride]))


def _shifts(run: Run, nominal: Array) -> _Shifts | None:
    """The shifts that can be tried; none where the nominal torque moves too little for it."""
    stride = max(1, round(1.0 / SKEW_RATE_HZ / _step(run)))
    dt = stride * _step(run)
    held = np.concatenate([[0.0], np.cumsum(_slope(nominal, stride, dt) ** 2)])
    ends = np.arange(int(min(SKEW_RANGE_S, (run.time[-1] - run.time[0]) / 6.0) / dt) + 1)
    # Without the strongest slopes in what is shifted, weak ones that hidden physics changes would decide.
    reach = int(np.flatnonzero(held[held.size - 1 - ends] - held[ends] >= SKEW_HELD * held[-1])[-1])
    if reach * dt < 2.0 * SKEW_S:
        return None
    measured = _slope(run.measured, stride, dt)
    energy = np.convolve(measured**2, np.ones(measured.size - 2 * reach), mode="valid")
    return _Shifts(measured, energy, reach, stride, dt)


def _variants(model: Model) -> Iterator[Model]:
    """The model with every stiffness in SOFTER and every play in PLAY."""
    presliding = float(model.parameters[0]["coulomb_torque"][0] / model.parameters[0]["sigma_0"][0])
    gaps = [f"{effect.id}_{effect.play}" for effect in CATALOGUE.values() if effect.play]
    for softer, play in product(SOFTER, PLAY):
        variant = replace(model, parameters=tuple(p.copy() for p in model.parameters))
        for record in variant.parameters:
            record["sigma_0"] *= softer
            for gap in gaps:
                record[gap] += play * presliding
        yield variant


def _lowest(values: Array) -> float:
    """Place of the lowest of ``values`` (n,), between samples by a parabola through it and its neighbours."""
    at = int(values.argmin())
    if not 0 < at < values.size - 1:
        return float(at)
    before, here, after = (float(value) for value in values[at - 1 : at + 2])
    return at + 0.5 * (before - after) / max(before - 2.0 * here + after, 1e-30)


def zero_drifts(vehicle: Vehicle, runs: Sequence[Run]) -> Iterator[Finding]:
    """Lines whose level drifts over the runs, one after the other, while the other side of their cylinders does the work.

    Oil that returns is under pressure that rises with the rate: what follows the rate is no zero, so it is taken out of level and time
    alike (Frisch and Waugh 1933).
    """
    if vehicle.hydraulics is None or not runs:
        return
    model = build_model(vehicle)
    expected = np.concatenate([nominal_torques(model, run).sum(axis=0) for run in runs])
    time, valid = (np.concatenate([getattr(run, name) for run in runs]) for name in ("time", "valid"))
    rate = np.concatenate([np.abs(run.omega).mean(axis=0) for run in runs])
    pressures, gains = (np.concatenate([getattr(run, name) for run in runs], axis=1) for name in ("pressure", "torque_per_line"))
    limit = max(DRIFT_SHARE * vehicle.sensors.pressure_range_Pa, 10.0 * vehicle.sensors.pressure_noise_Pa)
    idle = np.abs(expected) > 0.2 * np.abs(expected).max()
    duration = float(time[-1] - time[0])
    for (line, topic), gain, pressure in zip(topics_of(vehicle, Kind.PRESSURE).items(), gains, pressures, strict=True):
        at = np.flatnonzero(idle & valid & (gain * expected < 0.0))
        if at.size < 100 or time[at[-1]] - time[at[0]] < 0.5 * duration:
            continue
        flow = np.column_stack([np.ones(at.size), rate[at], rate[at] ** 2]) / [1.0, rate.max(), rate.max() ** 2]
        seen = np.column_stack([pressure[at], time[at]])
        own = seen - flow @ np.linalg.lstsq(flow, seen, rcond=1e-10)[0]
        parts = np.array_split(np.arange(at.size), 20)
        level = np.array([np.median(own[part, 0]) for part in parts])
        when, at_all = (np.array([times[part].mean() for part in parts]) for times in (own[:, 1], seen[:, 1]))
        if np.std(when) < APART * np.std(at_all):
            continue
        slope, _, low, high = theilslopes(level, when)
        if abs(slope) * duration > limit and low * high > 0.0 and high - low < abs(slope):
            yield Finding(
                "zero_drift", topic,
                f"{topic}: the unloaded level of line '{line}' drifts by {slope * duration / 1e5:+.1f} bar over the run; check the "
                "sensor's zero (the catalogue effect pressure_drift describes the same and may be named for it)",
            )  # fmt: skip
