# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How much the errors of a fit say: they are larger than those of the sensors and last, so that many samples count as one."""

from __future__ import annotations

import numpy as np
from scipy import stats

from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Array

NORMAL = float(stats.norm.ppf(0.975))
"""Half width of a 95 % interval in standard deviations."""
MEMORY_S, FORGOTTEN = 3.0, 0.05
"""Longest memory of errors looked for, and the correlation at which it has ended."""


def doubt(problem: Problem, result: Fit, weight: Array) -> float:
    """Energy, in noise variances, that counts as one independent error of a fit."""
    return doubt_of(problem, (problem.measured - result.prediction) * weight, weight)


def doubt_of(problem: Problem, error: Array, weight: Array) -> float:
    """The same of errors (n,) in noise standard deviations: their mean square times the samples that they last.

    How long they last is one time for all recordings, in steps of the slowest; a faster one has more samples in it.
    """
    used = (weight > 0.0).astype(float)
    steps = [float(run.time[1] - run.time[0]) for run in problem.runs]
    slowest = max(steps)
    longest = 1 + round(MEMORY_S / slowest)
    together, pairs, seconds = np.zeros(longest), np.zeros(longest), 0.0
    for step, a, b in zip(steps, problem.edges[:-1], problem.edges[1:], strict=True):
        stride = round(slowest / step)
        seconds += step * float(used[a:b].sum())
        for lag in range(min(longest, 1 + (b - a - 1) // stride)):
            apart = lag * stride
            together[lag] += float(error[a : b - apart] @ error[a + apart : b])
            pairs[lag] += float(used[a : b - apart] @ used[a + apart : b])
    covariance = together / np.maximum(pairs, 1.0)
    correlation = covariance / max(covariance[0], 1e-300)
    ended = np.flatnonzero(correlation < FORGOTTEN)
    lasting_s = slowest * (1.0 + 2.0 * float(correlation[1 : ended[0] if ended.size else longest].sum()))
    return float(max(covariance[0], 1.0) * lasting_s * pairs[0] / max(seconds, 1e-300))


def in_doubt(problem: Problem, weight: Array, result: Fit) -> Problem:
    """The problem with the doubt that a fit leaves, by which the sheet and the weather weigh, and all that is known of it."""
    return problem.doubted(doubt(problem, result, weight), problem.typical)
