# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Verification on samples that neither fitting nor selection saw, and intervals that respect coloured errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from lugre_steering.diagnosis.search import flexible, onset
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.split import CYCLE, Mask, Split, split
from lugre_steering.recording import Array, IntArray

RESAMPLES = 2000
STRETCHES = 6
ENOUGH = 5
"""Stretches of CLUSTER_S that must be left to judge by."""
BEND = 0.03
"""Standard deviation of what a law is off its own torque at any place: a few per cent, by judgement; laws fit no better."""
NORMAL = float(stats.norm.ppf(0.975))
WIDTH = float(stats.t.ppf(0.975, STRETCHES - 1))
"""Half width of a 95 % interval in standard deviations known from STRETCHES estimates."""


def rmse(problem: Problem, result: Fit, mask: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> float:
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


def verify(problem: Problem, weight: Array, baseline: Fit, augmented: Fit, roles: Split, seed: int) -> Judged:
    """Errors on the held-out third; if that does not settle the gain, on each third in turn, the rest refitted without it.

    ``weight`` (n,) is 1 / sigma where samples are valid. Selection has seen the other thirds, their numbers have not.
    """
    before, after = (np.where(roles.held, problem.measured - r.prediction, 0.0) ** 2 for r in (baseline, augmented))
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
        for errors, model in ((before, baseline), (after, augmented)):
            refitted = fit(problem, fitted, model.effects, model.x, linearisations=8)
            errors[other.held] = (problem.measured - refitted.prediction)[other.held] ** 2
        seen |= other.held & sure
    return replace(_judge(before, after, seen, roles.cluster, seed), rotated=True)


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


def jackknife(problem: Problem, result: Fit, weight: Array) -> Array:
    """Standard deviations (q,) of the free effect parameters: the fit repeated without each of some long stretches in turn.

    Errors of the laws themselves differ from stretch to stretch, so they widen it as they should (Quenouille 1949).
    """
    parts = max(2, round(STRETCHES / len(problem.runs)))
    stretch = np.concatenate([
        bag * parts + np.arange(run.time.size) * parts // run.time.size for bag, run in enumerate(problem.runs)
    ])  # fmt: skip
    estimates = []
    for left_out in range(int(stretch[-1]) + 1):
        kept = np.where(stretch == left_out, 0.0, weight)
        fitted = fit(problem, kept, result.effects, result.x, linearisations=4)
        estimates.append([values[key] for candidate, values in fitted.effects for key in candidate.free])
    spread = np.array(estimates)
    return np.asarray(np.sqrt((len(spread) - 1.0) * np.var(spread, axis=0)))


def robust_covariance(problem: Problem, result: Fit, weight: Array, cluster: IntArray) -> Array:
    """Covariance of all fitted values (cluster-robust sandwich; Liang and Zeger 1986), at least the homoscedastic one."""
    scores = result.jacobian * ((problem.measured - result.prediction) * weight)[:, None]
    count = int(cluster.max()) + 1
    summed = np.zeros((count, scores.shape[1]))
    np.add.at(summed, cluster, scores)
    bread = result.covariance
    sandwich = bread @ (summed.T @ summed) @ bread
    own = np.maximum(np.diag(sandwich), 1e-300)
    scale = np.sqrt(np.maximum(np.diag(bread), own) / own)
    return np.asarray(sandwich * np.outer(scale, scale))


def form_spread(problem: Problem, result: Fit, weight: Array) -> Array:
    """Standard deviations (q,) of all fitted values from the form of the laws: each bends by BEND of its torque, independently at
    some places along its own coordinate.

    Nature's law is not the one that is fitted, and no length of recording mends that (Kennedy and O'Hagan 2001).
    """
    shifts = np.hstack([
        result.covariance @ (result.jacobian.T @ flexible.bends(problem, result, weight, index)) for index in range(len(result.effects))
    ])  # fmt: skip
    return np.asarray(BEND * np.sqrt(np.sum(shifts**2, axis=1)))
