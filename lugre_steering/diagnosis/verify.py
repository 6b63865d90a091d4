# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Verification on samples that neither fitting nor selection saw."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lugre_steering.fitting import onset
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.split import CYCLE, Split, split
from lugre_steering.recording import Array, IntArray, Mask

RESAMPLES = 2000
"""Bootstraps of an interval: its ends are sure to a few hundredths of its width."""
ENOUGH = 5
"""Stretches of CLUSTER_S that must be left to judge by."""


def rmse(problem: Problem, result: Fit, mask: Mask) -> float:
    """Root mean square error [N m] over the samples of a mask; NaN without samples."""
    error = (problem.measured - result.prediction)[mask]
    return float(np.sqrt(np.mean(error**2))) if error.size else float("nan")


@dataclass(frozen=True)
class Judged:
    """Held-out errors [N m] of the baseline and with the named physics, 1 - their ratio, and its 95 % interval."""

    before: float
    after: float
    gain: float
    interval: tuple[float, float]
    rotated: bool = False
    """Whether every third was held out in turn, because the first alone hardly sees the effect."""


def verify(
    problem: Problem, weight: Array, baseline: Fit, augmented: Fit, roles: Split, seed: int,
    refitted: Callable[[int], Fit] | None = None,
) -> Judged:
    """Errors on the held-out third; if that does not settle the gain, on each third in turn, the rest refitted without it.

    ``weight`` (n,) is 1 / sigma where samples are valid. Selection has seen the other thirds, their numbers have not. ``refitted``: how
    the augmented model is fitted without a third, if its values are not just those that fit best.
    """
    before, after = (_held_errors(problem, roles, each) for each in (baseline, augmented))
    # Where the fitted data cannot tell when an effect began, the held-out data must not be judged by a guess.
    sure = ~onset.undetermined(problem, np.where(roles.fit, weight, 0.0), augmented)
    if np.unique(roles.cluster[roles.held & sure]).size < ENOUGH:
        sure[:] = True
    first = _judge(before, after, roles.held & sure, roles.cluster, seed)
    if not augmented.effects or first.interval[0] > 0.0 or not roles.held.any():
        return first
    seen = np.zeros(problem.valid.size, bool)
    for phase in range(CYCLE):
        other = split(problem, phase)
        fitted = np.where(other.fit, weight, 0.0)
        plain = fit(problem, fitted, baseline.effects, baseline.x, linearisations=8)
        richer = refitted(phase) if refitted else fit(problem, fitted, augmented.effects, augmented.x, linearisations=8)
        for errors, model in ((before, plain), (after, richer)):
            errors[other.held] = (problem.measured - model.prediction)[other.held] ** 2
        seen |= other.held & sure
    return replace(_judge(before, after, seen, roles.cluster, seed), rotated=True)


def judged_once(problem: Problem, baseline: Fit, augmented: Fit, roles: Split, seed: int) -> Judged:
    """Errors of two fits on the held-out third."""
    before, after = (_held_errors(problem, roles, each) for each in (baseline, augmented))
    return _judge(before, after, roles.held, roles.cluster, seed)


def _held_errors(problem: Problem, roles: Split, result: Fit) -> Array:
    """Squared errors (n,) of a fit on the samples held out, none elsewhere."""
    return np.where(roles.held, problem.measured - result.prediction, 0.0) ** 2


def _judge(before: Array, after: Array, held: Mask, clusters: IntArray, seed: int) -> Judged:
    """From squared errors (n,) of two models; the interval is a bootstrap of whole clusters."""
    if not held.any():
        nan = float("nan")
        return Judged(nan, nan, nan, (nan, nan))
    _, cluster = np.unique(clusters[held], return_inverse=True)
    before_sum, after_sum = np.bincount(cluster, before[held]), np.bincount(cluster, after[held])
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, before_sum.size, (RESAMPLES, before_sum.size))
    gains = 1.0 - np.sqrt(after_sum[drawn].sum(axis=1) / before_sum[drawn].sum(axis=1))
    low, high = np.quantile(gains, [0.025, 0.975])
    rms = [float(np.sqrt(total.sum() / held.sum())) for total in (before_sum, after_sum)]
    return Judged(rms[0], rms[1], 1.0 - rms[1] / rms[0], (float(low), float(high)))
