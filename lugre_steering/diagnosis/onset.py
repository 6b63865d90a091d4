# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""When an effect began that was not there from the start: one instant per recording, found from the errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from lugre_steering.diagnosis.fit import Fit
from lugre_steering.diagnosis.problem import Problem
from lugre_steering.diagnosis.split import Mask
from lugre_steering.recording import Array

INSTANTS = 16
"""Instants tried in each recording before the best is refined."""
RESOLUTION_S = 1.0
ALIKE = 10.0
"""Energy, in noise variances, within which two instants fit alike."""


def suggested(problem: Problem, error: Array) -> tuple[float, ...]:
    """The instant in each bag after which standardised errors (n,) are the largest against before (cumulative sum; Page 1954)."""
    starts = []
    for run, part in zip(problem.runs, np.split(error, problem.edges[1:-1]), strict=True):
        used = part != 0.0
        above = np.where(used, part**2 - np.mean(part[used] ** 2), 0.0) if used.any() else part
        starts.append(float(run.time[int(np.argmin(np.cumsum(above)))]))
    return tuple(starts)


def timed(problem: Problem, weight: Array, result: Fit, index: int) -> tuple[float, ...]:
    """The instants from which effect ``index`` of a fit explains most, one per bag; infinity where it never does."""
    since = list(result.effects[index][0].since)
    for bag, run in enumerate(problem.runs):
        left = _left(problem, weight, result, index, since, bag)
        grid, step = np.linspace(run.time[0], run.time[-1], INSTANTS, endpoint=False, retstep=True)
        best = min([*grid, since[bag], np.inf], key=left)
        if np.isfinite(best):
            near = minimize_scalar(left, bounds=(best - step, best + step), method="bounded", options={"xatol": 0.1})
            best = min([best, float(near.x)], key=left)
        since[bag] = float(best)
    return tuple(since)


def undetermined(problem: Problem, weight: Array, result: Fit) -> Mask:
    """Samples (n,) between instants at which a late effect could as well have begun, for all that weighted samples tell."""
    unsure = np.zeros(problem.measured.size, bool)
    for index, (candidate, _) in enumerate(result.effects):
        for bag, start in enumerate(candidate.since):
            run = problem.runs[bag]
            if not run.time[0] < start <= run.time[-1]:
                continue
            left = _left(problem, weight, result, index, candidate.since, bag)
            instants = np.append(np.arange(run.time[0], run.time[-1], RESOLUTION_S), start)
            energy = np.array([left(instant) for instant in instants])
            alike = instants[energy < energy[-1] + ALIKE]
            part = slice(problem.edges[bag], problem.edges[bag + 1])
            unsure[part] |= (run.time > alike.min() - RESOLUTION_S) & (run.time < alike.max() + RESOLUTION_S)
    return unsure


def _left(
    problem: Problem, weight: Array, result: Fit, index: int, since: Sequence[float], bag: int
) -> Callable[[float], float]:
    """Energy left over as a function of the instant in one bag, once the size of the effect and all else fitted have followed it.

    To first order: errors without the effect, projected off the other columns of the Jacobian and its own trace from the instant.
    """
    candidate, values = result.effects[index]
    others = [effect for i, effect in enumerate(result.effects) if i != index]
    first = problem.nuisances + sum(len(effect.free) for effect, _ in result.effects[:index])
    rest = np.delete(result.jacobian, np.s_[first : first + len(candidate.free)], axis=1)
    norms = np.linalg.norm(rest, axis=0)
    basis, _ = np.linalg.qr(rest[:, norms > 0.0] / norms[norms > 0.0])
    without = [problem.predict(i, result.x, others) for i in range(len(problem.runs))]
    bare = _projected(basis, (problem.measured - np.concatenate(without)) * weight)

    def trace(of: int, start: float) -> Array:
        instants = tuple(start if i == of else instant for i, instant in enumerate(since))
        effects = [*result.effects]
        effects[index] = (replace(candidate, since=instants), values)
        part = slice(problem.edges[of], problem.edges[of + 1])
        return np.asarray((problem.predict(of, result.x, effects) - without[of]) * weight[part])

    traces = [trace(i, start) for i, start in enumerate(since)]

    def left(start: float) -> float:
        own = _projected(basis, np.concatenate([trace(bag, start) if i == bag else known for i, known in enumerate(traces)]))
        along = max(float(own @ bare), 0.0) / max(float(np.sqrt(own @ own)), 1e-9)
        return float(bare @ bare) - along**2

    return left


def _projected(basis: Array, values: Array) -> Array:
    return np.asarray(values - basis @ (basis.T @ values))
