# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How much of each effect one recording shows, with its sign and its error, whether or not that is enough to be named there.

One number per effect and recording, each effect alone: the residual of the recalibrated baseline on that part of the effect's trace
which recalibration cannot imitate (Frisch-Waugh). Unbiased where a name would be missing, so that many weak ones may be added up.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lugre_steering.diagnosis.finished import amplitude_of
from lugre_steering.diagnosis.investigate import NULL_DRAWS, recalibrate
from lugre_steering.fitting.fingerprint import candidates, signature
from lugre_steering.fitting.noise import repeated_motion
from lugre_steering.fitting.problem import Candidate, Problem
from lugre_steering.recording import Array

LEAST_VISIBLE = 1e-4
"""Share of a trace that recalibration must leave for an estimate to mean something."""


@dataclass(frozen=True)
class Signed:
    """Amplitude ``value`` of one effect in ``unit``, standard deviation ``sd``; ``shape``: number of its variant.

    ``sign``: 1 where no other is possible, 0 where both are; ``each_Nm``: largest torque that one ``unit`` of it makes in the recording
    [N m], ``each_share``: the same over the amplitude of the measured torque.
    """

    effect: str
    shape: int
    parameter: str
    unit: str
    value: float
    sd: float
    sign: int
    each_Nm: float
    each_share: float


def signed(problem: Problem, seed: int) -> list[Signed]:
    """Every effect of the catalogue that has the same variants in any recording."""
    noise, roles, baseline = recalibrate(problem, repeated_motion(problem, NULL_DRAWS, seed), seed)
    weight = np.where(roles.fit, 1.0 / noise.sigma, 0.0)
    basis = baseline.basis()
    residuals = np.vstack([problem.measured - baseline.prediction, noise.draws]) * weight
    base = [problem.predict(bag, baseline.x, baseline.effects) for bag in range(len(problem.runs))]
    amplitude = amplitude_of(problem.measured)
    found = []
    for shape, candidate in _numbered(candidates(problem)):
        trace = signature(problem, baseline, base, candidate)[:, 0]
        fitted = _estimate(trace * weight, basis, residuals)
        if fitted is None:
            continue
        parameter, largest = candidate.parameter(candidate.free[0]), float(np.max(np.abs(trace)))
        value, deviation = (parameter.scale * number for number in fitted)
        found.append(Signed(
            candidate.label, shape, parameter.name, parameter.unit, value, deviation, int(parameter.low >= 0.0),
            largest / parameter.scale, largest / amplitude / parameter.scale,
        ))  # fmt: skip
    return found


def _numbered(found: list[Candidate]) -> Iterator[tuple[int, Candidate]]:
    """The candidates with one amplitude at least, and the number of each among those of its label."""
    seen: dict[str, int] = {}
    for candidate in found:
        if candidate.effect.variants is None and candidate.free:
            seen[candidate.label] = seen.get(candidate.label, -1) + 1
            yield seen[candidate.label], candidate


def _estimate(column: Array, basis: Array, residuals: Array) -> tuple[float, float] | None:
    """Least squares on the visible part of a trace; the error is that of draws that hide nothing, never below the noise."""
    visible = column - basis @ (basis.T @ column)
    energy = float(visible @ visible)
    if not energy > LEAST_VISIBLE * float(column @ column):
        return None
    along = residuals @ visible / energy
    return float(along[0]), max(float(np.sqrt(np.mean(along[1:] ** 2))), energy**-0.5)
