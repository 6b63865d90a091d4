# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a linear recalibration leaves of stretches that it was not fitted to, alone and beside the pieces of a law.

The recalibration is the same for every law, so it is eliminated once, and each law costs no more than its own pieces.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.linalg.lapack import dtrtri

from lugre_steering.recording import Array, IntArray

FOLDS = 5
"""Folds that are left out in turn; rows of any other number are in none."""
RIDGE = 1e-6
"""Share of the mean square of the columns that keeps the equations solvable where they are alike."""


class Beside:
    """A recalibration (n, m), whose columns have priors of one, beside which errors (n, k) are explained; ``left`` (k,): their energy
    in the folds that are left out."""

    def __init__(self, columns: Array, errors: Array, fold: IntArray) -> None:
        self._order = np.argsort(fold, kind="stable")
        columns, errors = columns[self._order], errors[self._order]
        self._columns, self._errors = columns, errors
        self._rows = [slice(int(a), int(b)) for a, b in pairwise(np.searchsorted(fold[self._order], np.arange(FOLDS + 2)))]
        # For each fold (folds, ...): the normal equations of its own rows, and those of the others solved.
        (self._gram, gram), (own, along) = (self._by_fold(columns, each) for each in (columns, errors))
        others = gram - self._gram + (1.0 + 1e-9) * np.eye(len(gram))
        self._root = np.stack([dtrtri(factor, lower=1)[0] for factor in np.linalg.cholesky(others)])
        self._half = self._root @ (along - own)
        self._sizes = _turned(self._root) @ self._half
        self._against = own - self._gram @ self._sizes
        rest = (errors[rows] - columns[rows] @ sizes for rows, sizes in zip(self._rows, self._sizes, strict=False))
        self.left = np.sum([np.sum(error**2, axis=0) for error in rest], axis=0)

    def left_with(self, pieces: Array, smoothing: Sequence[float]) -> Array:
        """Energy (k,) with ``pieces`` (n, p) of a law beside the recalibration: the least of all weights of their second differences."""
        pieces = pieces[self._order]
        (own, gram), (cross, beside), (mine, along) = (self._by_fold(pieces, each) for each in (pieces, self._columns, self._errors))
        half = self._root @ _turned(beside - cross)
        given = _turned(self._root) @ half  # what recalibration makes of each piece
        normal, right = gram - own - _turned(half) @ half, along - mine - _turned(half) @ self._half
        mixed = cross @ given
        seen = own - mixed - _turned(mixed) + _turned(given) @ self._gram @ given
        against = mine - cross @ self._sizes - _turned(given) @ self._against
        penalties = np.stack([smoothed(gram, share) for share in smoothing])[:, None]
        f = np.linalg.solve(normal + penalties, right)  # (smoothing, folds, p, k)
        return np.asarray((self.left + np.sum(f * (seen @ f - 2.0 * against), axis=(1, 2))).min(axis=0))

    def _by_fold(self, one: Array, other: Array) -> tuple[Array, Array]:
        """Products (folds, p, q) of columns (n, p) and (n, q) over the rows of each fold, and over all rows (p, q)."""
        parts = np.stack([one[rows].T @ other[rows] for rows in self._rows])
        return parts[:FOLDS], parts.sum(axis=0)


def _turned(matrices: Array) -> Array:
    return matrices.swapaxes(-1, -2)


def smoothed(gram: Array, smoothing: float) -> Array:
    """What is added to the normal equations (p, p) of pieces: their second differences, by a share of their energy, and a little ridge."""
    p = len(gram)
    second = np.diff(np.eye(p), 2, axis=0) if p > 2 else np.zeros((0, p))
    return (smoothing * second.T @ second + RIDGE * np.eye(p)) * max(float(np.trace(gram)), 1e-30) / p + 1e-9 * np.eye(p)
