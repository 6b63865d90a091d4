# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether a fit leaves more than noise: slow structure above the doubt about slow noise, or much of any kind."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lugre_steering.fitting.fit import Fit, normalised
from lugre_steering.fitting.noise import Noise, slow_part
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.sensors import beside_sensors
from lugre_steering.recording import Array

OWN_ERROR = 0.05
"""Energy per sample, in noise variances of one as recorded, that simulation and smoothing may leave with nothing hidden (of nulls)."""
SLOW_EXCESS, FAST_EXCESS = 0.25, 1.0
"""Energy left over, in noise variances of a sample as recorded, that is structure: slow and above the doubt about slow noise, or any."""
FORM_LEFT = 0.15
"""Share of the energy that the freedoms of the friction law explain that may be left beside them without being structure, since they too
are of another form than nature."""


class Loudness(NamedTuple):
    """Energy per sample beyond noise, in noise variances: of all kinds, slow alone; and whether that is structure."""

    excess: float
    slow: float
    loud: bool


def loudness(problem: Problem, noise: Noise, result: Fit) -> Loudness:
    """What ``result`` leaves on all valid samples, beside what sound sensors may do."""
    weight = np.where(problem.valid, 1.0 / noise.sigma, 0.0)
    standardised = beside_sensors(
        problem, problem.measured - result.prediction, weight, result.jacobian[:, : problem.nuisances]
    )
    slow = _slow_energy(problem, standardised) - _slow_energy(problem, noise.draws * weight)
    excess = float(np.mean(standardised[weight > 0.0] ** 2)) - 1.0
    doubt = FORM_LEFT * form_energy(problem, result, weight) / max(int(np.count_nonzero(weight)), 1)
    # Slow errors tell physics from ripple and vibration, which standstill does not show as they are in motion.
    slow_most, most = SLOW_EXCESS * problem.mean_of, FAST_EXCESS * problem.mean_of + doubt
    return Loudness(excess, slow, slow > max(slow_most, noise.slow_doubt, doubt) or excess > most)


def excess(problem: Problem, result: Fit, weight: Array) -> float:
    """Energy per sample with weight that a fit leaves beyond noise, in noise variances."""
    return float(np.sum(((problem.measured - result.prediction) * weight) ** 2) / max(int(np.count_nonzero(weight)), 1)) - 1.0


def form_energy(problem: Problem, result: Fit, weight: Array) -> float:
    """Energy, in noise variances, of what the freedoms of the friction law do beyond what a recalibration does as well, on as many
    samples as have a weight: measured where the fit has slopes, which are none of those held out."""
    if not problem.bends.shape[1]:
        return 0.0
    torque = problem.bends @ result.x[problem.first_bend : problem.nuisances]
    done = beyond_calibration(problem, result, torque)
    return done * float(np.count_nonzero(weight)) / max(int(np.count_nonzero(result.weight)), 1)


def beyond_calibration(problem: Problem, result: Fit, torque: Array) -> float:
    """Energy of a torque (n,), in noise variances, beyond what a recalibration does as well; on the samples that were fitted."""
    used = result.weight > 0.0
    columns, values = normalised(result.jacobian[used, : problem.first_bend]), (torque * result.weight)[used]
    return float(np.sum((values - columns @ np.linalg.lstsq(columns, values, rcond=1e-8)[0]) ** 2))


def _slow_energy(problem: Problem, standardised: Array) -> float:
    """Mean square per used sample of the slow part of (..., n) errors in noise standard deviations."""
    pieces = [
        slow_part(standardised[..., a:b], run.time[1] - run.time[0])
        for run, a, b in zip(problem.runs, problem.edges[:-1], problem.edges[1:], strict=True)
    ]
    return float(np.mean(np.concatenate(pieces, axis=-1)[..., problem.valid] ** 2))
