# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""When an effect began that was not there from the start, one instant per recording, and where its window ends; found from the errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize_scalar

from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem, Values
from lugre_steering.recording import Array, Mask

INSTANTS = 16
"""Instants tried in each recording before the best is refined."""
RESOLUTION_S = 1.0
"""To which an instant is told."""
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
    late = _Late(problem, weight, result, index)
    since = list(result.effects[index][0].since)
    for bag, run in enumerate(problem.runs):

        def here(start: float, bag: int = bag) -> float:
            return late.left((*since[:bag], start, *since[bag + 1 :]))

        grid, step = np.linspace(run.time[0], run.time[-1], INSTANTS, endpoint=False, retstep=True)
        sharp = float(run.time[np.argmin(late.at_each(since, bag, float(run.time[0])))])
        best = min([*grid, sharp, since[bag], np.inf], key=here)
        if np.isfinite(best):
            near = minimize_scalar(here, bounds=(best - step, best + step), method="bounded", options={"xatol": 0.1})
            best = min([best, float(near.x)], key=here)
        since[bag] = float(best)
    return tuple(since)


def placed(problem: Problem, weight: Array, result: Fit, index: int, ends: Mapping[str, Sequence[float]]) -> Values:
    """The values of effect ``index`` of a fit with each of the ``ends`` of its window, one after the other, at the place from which it
    explains most: of those given, refined."""
    left, (candidate, found) = _left_by_values(problem, weight, result, index), result.effects[index]
    values = dict(found)
    for name, places in ends.items():

        def here(place: float, name: str = name) -> float:
            tried = {**values, name: place}
            windows = [pair for pair in candidate.effect.places if name in pair and tried.keys() >= {*pair}]
            return left(tried) if all(tried[low] < tried[high] for low, high in windows) else np.inf

        best, step = min([*places, values[name]], key=here), float(np.max(np.diff(places)))
        grid, step = np.linspace(best - step, best + step, INSTANTS + 1, retstep=True)
        best = min([best, *grid], key=here)
        with np.errstate(invalid="ignore"):  # past the other end it is infinite, and no parabola goes through that
            near = minimize_scalar(here, bounds=(best - step, best + step), method="bounded", options={"xatol": 0.1 * step})
        values[name] = min([best, float(near.x)], key=here)
    return values


def undetermined(problem: Problem, weight: Array, result: Fit) -> Mask:
    """Samples (n,) between instants at which a late effect could as well have begun, or a window in time end, for all that weighted
    samples tell."""
    unsure = np.zeros(problem.measured.size, bool)
    for index, (candidate, _) in enumerate(result.effects):
        ends = [name for pair in candidate.effect.places for name in pair if name in candidate.free]
        for name in (end for end in ends if candidate.parameter(end).unit == "s"):
            first, last = _end_alike(problem, weight, result, index, name)
            for bag in (bag for bag in range(len(problem.runs)) if candidate.active_in(bag)):
                unsure[problem.edges[bag] : problem.edges[bag + 1]] |= _between(problem.runs[bag].time, first, last)
        if not candidate.since:
            continue
        left = _Late(problem, weight, result, index).left
        for bag, start in enumerate(candidate.since):
            run = problem.runs[bag]
            alike = _alike(left, candidate.since, bag)
            first, last = _span_of(alike, float(run.time[0]), float(run.time[-1]) + RESOLUTION_S, start)
            part = slice(problem.edges[bag], problem.edges[bag + 1])
            unsure[part] |= _between(run.time, first, last)
    return unsure


def _between(time: Array, first: float, last: float) -> Mask:
    return np.asarray((time > first - RESOLUTION_S) & (time < last + RESOLUTION_S))


def _end_alike(problem: Problem, weight: Array, result: Fit, index: int, name: str) -> tuple[float, float]:
    """First and last instant at which a window in time could as well end."""
    left, values = _left_by_values(problem, weight, result, index), result.effects[index][1]
    most = left(values) + ALIKE
    low, high = min(float(run.time[0]) for run in problem.runs), max(float(run.time[-1]) for run in problem.runs)
    return _span_of(lambda instant: left({**values, name: instant}) < most, low, high, values[name])


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


class _Late:
    """Energy left over as a function of the instants from which an effect of a fit acts, once its size and all else have followed them.

    To first order: errors without the effect, projected off the other columns of the Jacobian and its own trace from the instant.
    """

    def __init__(self, problem: Problem, weight: Array, result: Fit, index: int) -> None:
        basis, without, bare = _bare(problem, weight, result, index)
        candidate, values = result.effects[index]
        parts = [slice(a, b) for a, b in pairwise(problem.edges)]

        @lru_cache(maxsize=64)
        def trace(bag: int, start: float) -> Array:
            instants = (start,) * len(problem.runs)  # those of other bags do not matter here
            effects = [*result.effects]
            effects[index] = (replace(candidate, since=instants), values)
            return np.asarray((problem.predict(bag, result.x, effects) - without[bag]) * weight[parts[bag]])

        self._basis, self._bare, self._parts, self._trace = basis, bare, parts, trace

    def left(self, since: Sequence[float]) -> float:
        own = np.concatenate([self._trace(bag, start) for bag, start in enumerate(since)])
        return _beyond(self._bare, _projected(self._basis, own))

    def at_each(self, since: Sequence[float], bag: int, first: float) -> Array:
        """The same with each sample of a bag as its instant, of what acts there as it does if it is there from the ``first`` one."""
        others = [self._trace(i, start) if i != bag else np.zeros_like(self._bare[self._parts[bag]]) for i, start in enumerate(since)]
        rest, own, part = np.concatenate(others), self._trace(bag, first), self._parts[bag]

        def from_each(values: Array) -> Array:
            return np.asarray(np.cumsum(values[::-1], axis=0)[::-1])

        along = rest @ self._bare + from_each(own * self._bare[part])
        known = rest @ self._basis + from_each(own[:, None] * self._basis[part])
        size = rest @ rest + from_each(own**2) - np.sum(known**2, axis=1)
        return np.asarray(self._bare @ self._bare - np.maximum(along, 0.0) ** 2 / np.maximum(size, 1e-18))


def _left_by_values(problem: Problem, weight: Array, result: Fit, index: int) -> Callable[[Values], float]:
    """The same as a function of other values of the effect."""
    candidate, _ = result.effects[index]
    basis, without, bare = _bare(problem, weight, result, index)

    def left(values: Values) -> float:
        effects = [(candidate, values) if i == index else own for i, own in enumerate(result.effects)]
        trace = [problem.predict(bag, result.x, effects) - without[bag] for bag in range(len(problem.runs))]
        return _beyond(bare, _projected(basis, np.concatenate(trace) * weight))

    return left


def _bare(problem: Problem, weight: Array, result: Fit, index: int) -> tuple[Array, list[Array], Array]:
    """Of a fit without one of its effects: the basis of the other columns, torque by bag, and weighted errors off that basis."""
    candidate, _ = result.effects[index]
    others = [effect for i, effect in enumerate(result.effects) if i != index]
    first = problem.nuisances + sum(len(effect.free) for effect, _ in result.effects[:index])
    basis = result.basis(without=slice(first, first + len(candidate.free)))
    without = [problem.predict(bag, result.x, others) for bag in range(len(problem.runs))]
    return basis, without, _projected(basis, (problem.measured - np.concatenate(without)) * weight)


def _beyond(bare: Array, own: Array) -> float:
    """Energy of errors that a trace of the best positive size leaves."""
    along = max(float(own @ bare), 0.0) / max(float(np.sqrt(own @ own)), 1e-9)
    return float(bare @ bare) - along**2


def _projected(basis: Array, values: Array) -> Array:
    return np.asarray(values - basis @ (basis.T @ values))
