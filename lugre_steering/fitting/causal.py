# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The error of the written model as the live node has it: motion from past samples only, bristles that the first torque tells of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lugre_steering.chain.compiled import njit
from lugre_steering.chain.rates import MOTION, RATE_TIME_CONSTANT_S, follow
from lugre_steering.data.dataset import Run, as_recorded
from lugre_steering.estimator.unseen import AGREED_SHARE
from lugre_steering.fitting.problem import Problem, is_rig
from lugre_steering.recording import Array, Recording
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.model import most_friction_of_all
from lugre_steering.vehicle.size import acceleration_unit

FILTERS_S = tuple(RATE_TIME_CONSTANT_S * 0.5 ** (0.5 * k) for k in range(-4, 16))
"""Filters of the motion that are tried."""


@njit(cache=True)
def _follow_all(s: Any, time: Array, angle: Array, rate: Array, sigma: float, unit: float, accelerates: bool, out: Array) -> None:
    """Angle, rate and acceleration (3, n) after each sample."""
    for i in range(time.size):
        follow(s, time[i] - time[max(i - 1, 0)], angle[i], rate[i], sigma, unit, accelerates)
        out[0, i], out[1, i], out[2, i] = s.theta, s.omega, s.alpha


def causal_rmse(vehicle: Vehicle, recordings: Sequence[Recording], runs: Sequence[Run]) -> float:
    """Root mean square error [N m] over the valid samples of ``runs``, which were made from the recordings."""
    problem = Problem(vehicle, [_seen_live(vehicle, *pair) for pair in zip(recordings, runs, strict=True)])
    error = problem.measured - problem.predict_all(_begun(problem))
    return float(np.sqrt(np.mean(error[problem.valid] ** 2)))


def _begun(problem: Problem) -> Array:
    """Nuisances as the vehicle file has them, with the bristles of each bag as the estimator has them after the first torque: relaxed if
    that agrees, else deflected as far as it says, at most as far as they go (see ``estimator.unseen``)."""
    x, most = problem.start(), most_friction_of_all(problem.vehicle)
    for bag in range(len(problem.runs)):
        own = slice(problem.edges[bag], problem.edges[bag + 1])
        first = int(problem.edges[bag] + np.argmax(problem.valid[own]))
        relaxed = problem.predict(bag, x)
        missing = float(problem.measured[first] - relaxed[first - problem.edges[bag]])
        if abs(missing) > AGREED_SHARE * most:
            full = x.copy()
            full[len(problem.calibrations) + bag] = np.sign(missing)
            holds = abs(float(problem.predict(bag, full)[first - problem.edges[bag]] - relaxed[first - problem.edges[bag]]))
            x[len(problem.calibrations) + bag] = np.sign(missing) * min(1.0, abs(missing) / holds) if holds > 0.0 else 0.0
    return x


def filtered(vehicle: Vehicle, recordings: Sequence[Recording], runs: Sequence[Run]) -> tuple[Vehicle, float]:
    """A joint or axis with the filter of its motion with which it errs least live, and that error [N m]; any other as it is.

    How fast its accelerations change no sheet says: a long filter comes late to them, a short one shows the noise of the angle as inertia.
    One that is shorter than the way from sample to sample filters nothing, unless rates are recorded; the next recording may be noisier.
    """
    tried = [vehicle]
    if is_rig(vehicle) and vehicle.sensors.angle_sigma > 0.0:
        differenced = [angle.time_s for each in recordings for side, angle in each.angle.items() if side not in each.rate]
        spacing = max((float(np.median(np.diff(time))) for time in differenced), default=0.0)
        filters = [each for each in FILTERS_S if each >= spacing]
        tried += [vehicle.replace(sensors=replace(vehicle.sensors, rate_filter_s=each)) for each in filters]
    errors = [causal_rmse(each, recordings, runs) for each in tried]
    least = int(np.argmin(errors))
    return tried[least], errors[least]


def _seen_live(vehicle: Vehicle, recording: Recording, run: Run) -> Run:
    """The run with the motion that a causal filter makes of the recorded angles, and rates where they were recorded, in steps of whole
    samples as the node takes them."""
    motion = np.array([_causal(vehicle, recording, side, run.time) for side in vehicle.sides])
    return replace(as_recorded(run), midway=False, theta=motion[:, 0], omega=motion[:, 1], alpha=motion[:, 2])


def _causal(vehicle: Vehicle, recording: Recording, side: str, time: Array) -> Array:
    """Angle, rate and acceleration (3, n) known at the instants (n,)."""
    angle, rate = recording.angle[side], recording.rate.get(side)
    given = np.full(angle.time_s.size, np.nan) if rate is None else np.interp(angle.time_s, rate.time_s, rate.value)
    state, motion = np.zeros(1, MOTION), np.zeros((3, angle.time_s.size))
    sigma, accelerates = vehicle.sensors.angle_sigma, vehicle.sensors.rate_filter_s is not None
    _follow_all(state[0], angle.time_s, angle.value, given, sigma, acceleration_unit(vehicle), accelerates, motion)
    return np.array([np.interp(time, angle.time_s, row) for row in motion])  # an average of several samples would look ahead
