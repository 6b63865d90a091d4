# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""When an effect began that was not there from the start: one instant per recording, found from the errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.optimize import minimize_scalar

from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Array, Mask

INSTANTS = 16
"""Instants tried in each recording before the best is refined."""
RESOLUTION_S = 1.0
Start = tuple[float, ...]
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
    left = _left(problem, weight, result, index)
    since = list(result.effects[index][0].since)
    for bag, run in enumerate(problem.runs):

        def here(start: float, bag: int = bag) -> float:
            return left((*since[:bag], start, *since[bag + 1 :]))

        grid, step = np.linspace(run.time[0], run.time[-1], INSTANTS, endpoint=False, retstep=True)
        best = min([*grid, since[bag], np.inf], key=here)
        if np.isfinite(best):
            near = minimize_scalar(here, bounds=(best - step, best + step), method="bounded", options={"xatol": 0.1})
            best = min([best, float(near.x)], key=here)
        since[bag] = float(best)
    return tuple(since)


def undetermined(problem: Problem, weight: Array, result: Fit) -> Mask:
    """Samples (n,) between instants at which a late effect could as well have begun, for all that weighted samples tell."""
    unsure = np.zeros(problem.measured.size, bool)
    for index, (candidate, _) in enumerate(result.effects):
        if not candidate.since:
            continue
        left = _left(problem, weight, result, index)
        for bag, start in enumerate(candidate.since):
            run = problem.runs[bag]
            alike = _alike(left, candidate.since, bag)
            first, last = _span_of(alike, float(run.time[0]), float(run.time[-1]) + RESOLUTION_S, start)
            part = slice(problem.edges[bag], problem.edges[bag + 1])
            unsure[part] |= (run.time > first - RESOLUTION_S) & (run.time < last + RESOLUTION_S)
    return unsure


def _alike(left: Callable[[Start], float], since: Start, bag: int) -> Callable[[float], bool]:
    """Whether another instant in a bag fits as well as that of ``since``."""

    def energy(instant: float) -> float:
        return left((*since[:bag], instant, *since[bag + 1 :]))

    most = energy(since[bag]) + ALIKE
    return lambda instant: energy(instant) < most


def _span_of(alike: Callable[[float], bool], low: float, high: float, start: float) -> tuple[float, float]:
    """First and last instant that is alike, to RESOLUTION_S: before ``low`` it was always there, after ``high`` never."""
    instants = np.linspace(low, high, 2 * INSTANTS)
    found = [float(t) for t in instants if alike(float(t))] + [float(np.clip(start, low, high))]
    ends = []
    for inside, step in ((min(found), instants[0] - instants[1]), (max(found), instants[1] - instants[0])):
        outside = float(np.clip(inside + step, low, high))
        while abs(outside - inside) > RESOLUTION_S:
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if alike(middle) else (inside, middle)
        ends.append(inside)
    return ends[0], ends[1]


def _left(problem: Problem, weight: Array, result: Fit, index: int) -> Callable[[Sequence[float]], float]:
    """Energy left over as a function of the instants, once the size of the effect and all else fitted have followed them.

    To first order: errors without the effect, projected off the other columns of the Jacobian and its own trace from the instant.
    """
    candidate, values = result.effects[index]
    others = [effect for i, effect in enumerate(result.effects) if i != index]
    first = problem.nuisances + sum(len(effect.free) for effect, _ in result.effects[:index])
    basis = result.basis(without=slice(first, first + len(candidate.free)))
    without = [problem.predict(bag, result.x, others) for bag in range(len(problem.runs))]
    bare = _projected(basis, (problem.measured - np.concatenate(without)) * weight)

    @lru_cache(maxsize=64)
    def trace(bag: int, start: float) -> Array:
        instants = (start,) * len(problem.runs)  # those of other bags do not matter here
        effects = [*result.effects]
        effects[index] = (replace(candidate, since=instants), values)
        part = slice(problem.edges[bag], problem.edges[bag + 1])
        return np.asarray((problem.predict(bag, result.x, effects) - without[bag]) * weight[part])

    def left(since: Sequence[float]) -> float:
        own = _projected(basis, np.concatenate([trace(bag, start) for bag, start in enumerate(since)]))
        along = max(float(own @ bare), 0.0) / max(float(np.sqrt(own @ own)), 1e-9)
        return float(bare @ bare) - along**2

    return left


def _projected(basis: Array, values: Array) -> Array:
    return np.asarray(values - basis @ (basis.T @ values))
