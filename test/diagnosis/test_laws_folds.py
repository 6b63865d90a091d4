# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Laws beside a recalibration, against the whole normal equations of every fold solved at once."""

from __future__ import annotations

import numpy as np
import pytest

from lugre_steering.diagnosis.laws.folds import FOLDS, RIDGE, Beside
from lugre_steering.recording import Array, IntArray


def left(columns: Array, pieces: Array, errors: Array, fold: IntArray, smoothing: float) -> Array:
    """What ridge regression on both, with priors of one on recalibration, leaves of each fold that it is not fitted to."""
    both, m, p = np.column_stack([columns, pieces]), columns.shape[1], pieces.shape[1]
    second = np.diff(np.eye(p), 2, axis=0)
    penalty = np.zeros((m + p, m + p))
    penalty[:m, :m] = np.eye(m)
    penalty[m:, m:] = (smoothing * second.T @ second + RIDGE * np.eye(p)) * np.sum(pieces**2) / p
    total = np.zeros(errors.shape[1])
    for k in range(FOLDS):
        others = fold != k
        sizes = np.linalg.solve(both[others].T @ both[others] + penalty, both[others].T @ errors[others])
        total += np.sum((errors[~others] - both[~others] @ sizes) ** 2, axis=0)
    return total


def _left_out(columns: Array, errors: Array, fold: IntArray, k: int) -> Array:
    """Errors of one fold that recalibration alone, with its priors as further rows, leaves when fitted to the others."""
    others, m = fold != k, columns.shape[1]
    rows, right = np.vstack([columns[others], np.eye(m)]), np.vstack([errors[others], np.zeros((m, errors.shape[1]))])
    return np.asarray(errors[~others] - columns[~others] @ np.linalg.lstsq(rows, right, rcond=None)[0])


@pytest.mark.parametrize("pieces", [3, 10])
def test_what_is_left_is_that_of_the_whole_normal_equations(pieces: int) -> None:
    rng = np.random.default_rng(5)
    fold = rng.permutation(np.repeat(np.arange(FOLDS + 1), 40))
    columns, errors = 5.0 * rng.standard_normal((fold.size, 4)), rng.standard_normal((fold.size, 6))
    law = rng.standard_normal((fold.size, pieces)) + columns[:, :1]
    errors[:, 0] += columns @ np.ones(4) + law @ np.linspace(-1.0, 1.0, pieces)
    beside = Beside(columns, errors, fold)
    each = [left(columns, law, errors, fold, share) for share in (1e-4, 1.0)]
    np.testing.assert_allclose(beside.left_with(law, (1e-4, 1.0)), np.minimum(*each), rtol=1e-6)
    alone = sum(np.sum(_left_out(columns, errors, fold, k) ** 2, axis=0) for k in range(FOLDS))
    np.testing.assert_allclose(beside.left, alone, rtol=1e-6)
    assert beside.left_with(law, (1e-4,))[0] < 0.5 * beside.left[0], "the law takes what recalibration cannot"
