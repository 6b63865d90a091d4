# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Fewer samples on which to compare names, each the mean of those of its step: their noise is less, and none is thrown away.

Not of a joint or axis, whose friction law has no freedoms: what is left of that counts the more the less noise there is, and laws that
follow it take the place of what the joint has.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import correlate1d, minimum_filter1d

from lugre_steering.data.dataset import Run
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.sheet import thinned
from lugre_steering.fitting.split import Split
from lugre_steering.recording import Array, Mask


class _Steps:
    """The steps of a recording of which ``few`` samples are kept, each as long as these are apart and about one of them; its samples
    begin at ``first``."""

    def __init__(self, few: Run, run: Run, first: int, means: bool) -> None:
        stride = round((few.time[1] - few.time[0]) / (run.time[1] - run.time[0]))
        self.part, self.kept = slice(first, first + run.time.size), slice(None, None, stride)
        width = stride if means else 1
        self.share = np.ones(width + 1 - width % 2) / width
        if width % 2 == 0:  # symmetric all the same: half a sample of delay would look like physics
            self.share[[0, -1]] *= 0.5

    def mean(self, values: Array) -> Array:
        """Means (..., m) of those of values (..., n) that are of this recording."""
        return np.asarray(correlate1d(values[..., self.part], self.share, mode="nearest")[..., self.kept])

    def whole(self, mask: Mask) -> Mask:
        """Steps (m,) of which all samples are in a mask (n,)."""
        return np.asarray(minimum_filter1d(mask[self.part].astype(np.uint8), self.share.size, mode="nearest")[self.kept] > 0)

    def noise_left(self, draws: Array) -> float:
        """Noise of a mean in that of a sample, as draws (k, n) have it."""
        return float(np.std(self.mean(draws)) / np.std(draws[:, self.part])) if self.share.size > 1 else 1.0


def fewer(
    problem: Problem, noise: Noise, roles: Split, baseline: Fit, most: int, fastest_Hz: float, *, means: bool
) -> tuple[Problem, Noise, Split]:
    """At most so many samples, no more often than that; what longer steps change of the baseline's torque is no error of the model."""
    thin, kept = thinned(problem, most, fastest_Hz)
    bags = [_Steps(*each, means) for each in zip(thin.runs, problem.runs, problem.edges[:-1].tolist(), strict=True)]
    draws, error = noise.draws / noise.sigma, problem.measured - baseline.prediction
    noise_left = [bag.noise_left(draws) for bag in bags]
    runs = [
        replace(few, mean_of=left**-2 if bag.share.size > 1 else None, sigma=few.sigma * left, valid=bag.whole(problem.valid))
        for few, left, bag in zip(thin.runs, noise_left, bags, strict=True)
    ]  # fmt: skip
    expected = np.split(thin.over(runs).predict_all(baseline.x), thin.edges[1:-1])
    runs = [replace(run, measured=torque + bag.mean(error)) for run, torque, bag in zip(runs, expected, bags, strict=True)]
    seen, sigma = thin.over(runs), noise.sigma[kept]
    drawn = np.concatenate([bag.mean(draws) for bag in bags], axis=1) * sigma
    quiet = Noise(sigma * np.repeat(noise_left, np.diff(seen.edges)), drawn, noise.slow_doubt * seen.mean_of)
    fitted, held = (np.concatenate([bag.whole(role) for bag in bags]) for role in (roles.fit, roles.held))
    return seen, quiet, Split(fitted, held, roles.cluster[kept])
