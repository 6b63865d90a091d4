# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Verification on samples that neither fitting nor selection saw, and intervals that respect coloured errors."""

from __future__ import annotations

import numpy as np

from lugre_steering.diagnosis.problem import Fit, Problem
from lugre_steering.diagnosis.split import Split
from lugre_steering.recording import Array, IntArray

RESAMPLES = 2000


def rmse(problem: Problem, result: Fit, mask: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> float:
    """Root mean square error [N m] over the samples of a mask; NaN without samples."""
    error = (problem.measured - result.prediction)[mask]
    return float(np.sqrt(np.mean(error**2))) if error.size else float("nan")


def improvement(
    problem: Problem, baseline: Fit, augmented: Fit, split: Split, seed: int
) -> tuple[float, tuple[float, float]]:
    """1 - augmented / baseline held-out RMSE, with a 95 % interval from a bootstrap of whole clusters."""
    held = split.held
    if not held.any():
        return float("nan"), (float("nan"), float("nan"))
    before = ((problem.measured - baseline.prediction) ** 2)[held]
    after = ((problem.measured - augmented.prediction) ** 2)[held]
    _, cluster = np.unique(split.cluster[held], return_inverse=True)
    before_sum, after_sum = np.bincount(cluster, before), np.bincount(cluster, after)
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, before_sum.size, (RESAMPLES, before_sum.size))
    gains = 1.0 - np.sqrt(after_sum[drawn].sum(axis=1) / before_sum[drawn].sum(axis=1))
    low, high = np.quantile(gains, [0.025, 0.975])
    return float(1.0 - np.sqrt(after_sum.sum() / before_sum.sum())), (float(low), float(high))


def robust_covariance(problem: Problem, result: Fit, weight: Array, cluster: IntArray) -> Array:
    """Covariance of all fitted values (cluster-robust sandwich; Liang and Zeger 1986), at least the homoscedastic one."""
    scores = result.jacobian * ((problem.measured - result.prediction) * weight**2)[:, None]
    count = int(cluster.max()) + 1
    summed = np.zeros((count, scores.shape[1]))
    np.add.at(summed, cluster, scores)
    bread = result.covariance
    sandwich = bread @ (summed.T @ summed) @ bread
    scale = np.sqrt(np.maximum(np.diag(bread), np.diag(sandwich)) / np.maximum(np.diag(sandwich), 1e-300))
    return np.asarray(sandwich * np.outer(scale, scale))
