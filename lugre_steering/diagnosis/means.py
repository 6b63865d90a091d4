# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Fewer samples on which to compare names, each the mean of those of its step: their noise is less, and none is thrown away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import correlate1d, minimum_filter1d

from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.sheet import thinned
from lugre_steering.fitting.split import Split
from lugre_steering.recording import Array, Mask


class _Steps:
    """Every ``stride``-th sample of a recording, and the step about each, which is as long as they are apart."""

    def __init__(self, stride: int) -> None:
        self.kept = slice(None, None, stride)
        self.share = np.ones(stride + 1 - stride % 2) / stride
        if stride % 2 == 0:  # symmetric all the same: half a sample of delay would look like physics
            self.share[[0, -1]] *= 0.5

    def mean(self, values: Array) -> Array:
        """Means (..., m) of values (..., n)."""
        return np.asarray(correlate1d(values, self.share, mode="nearest")[..., self.kept])

    def whole(self, mask: Mask) -> Mask:
        """Steps (m,) of which all samples are in a mask (n,)."""
        return np.asarray(minimum_filter1d(mask.astype(np.uint8), self.share.size, mode="nearest")[self.kept] > 0)


def means(
    problem: Problem, noise: Noise, roles: Split, baseline: Fit, most: int, fastest_Hz: float
) -> tuple[Problem, Noise, Split]:
    """At most so many means, no more often than that; what longer steps change of the baseline's torque is no error of the model."""
    thin, kept = thinned(problem, most, fastest_Hz)
    parts = [slice(a, b) for a, b in zip(problem.edges[:-1], problem.edges[1:], strict=True)]
    bags = [
        (few, _Steps(round((few.time[1] - few.time[0]) / (run.time[1] - run.time[0]))), part)
        for few, run, part in zip(thin.runs, problem.runs, parts, strict=True)
    ]
    draws, error = noise.draws / noise.sigma, problem.measured - baseline.prediction
    drawn = [steps.mean(draws[:, part]) for _, steps, part in bags]
    quieter = [float(np.std(draws[:, part]) / np.std(mean)) for (_, _, part), mean in zip(bags, drawn, strict=True)]
    runs = [
        replace(few, mean_of=factor**2 if steps.share.size > 1 else None, sigma=few.sigma / factor, valid=steps.whole(problem.valid[part]))
        for (few, steps, part), factor in zip(bags, quieter, strict=True)
    ]  # fmt: skip
    expected = np.split(thin.over(runs).predict_all(baseline.x), thin.edges[1:-1])
    runs = [
        replace(run, measured=torque + steps.mean(error[part]))
        for run, torque, (_, steps, part) in zip(runs, expected, bags, strict=True)
    ]
    sigma = noise.sigma[kept]
    less = Noise(
        sigma / np.repeat(quieter, np.diff(thin.edges)), np.concatenate(drawn, axis=1) * sigma,
        noise.slow_doubt * float(np.mean(np.repeat(quieter, np.diff(thin.edges)) ** 2)),
    )  # fmt: skip
    fitted, held = (np.concatenate([steps.whole(role[part]) for _, steps, part in bags]) for role in (roles.fit, roles.held))
    return thin.over(runs), less, Split(fitted, held, roles.cluster[kept])
