# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Every cell by projected least squares beside a linear recalibration, judged by what it foretells of blocks left out.

Errors are averaged over stretches first: laws are slow. Errors that hide nothing go through the very same search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy import stats
from scipy.linalg import block_diag

from lugre_steering.diagnosis.laws.cells import HATS, Cell, Traces
from lugre_steering.diagnosis.laws.folds import FOLDS, Beside, smoothed
from lugre_steering.fitting.fit import Fit, normalised
from lugre_steering.fitting.problem import Problem, in_threads
from lugre_steering.fitting.split import Split
from lugre_steering.recording import Array, IntArray

RATE_HZ, MOST_ROWS = 20.0, 8000
"""To which the screen thins a recording, and rows that it has at most: enough to rank cells in seconds."""
FOLD_CLUSTERS = 2
"""Clusters (``fitting.split``) of a stretch that is left out as a whole."""
SMOOTHING = (1e-4, 1e-2, 1.0)
"""Weights of the second differences of a free f, as shares of its own energy."""
FREE = 30.0
"""Length of the columns of what is named, in noise standard deviations: so long that priors of one leave it free."""
ALIKE = 0.01
"""Share of what a constant law does that names leave of it at most, if they do the same."""
PERMUTED = 16
"""Permutations of the errors: the largest gain in them is part of the bar."""
STATE = ("angle", "rate", "torque")
"""Coordinates in which a black box sees fine waves, that it cannot among many."""
FEATURES, REACHES, SIZES, TOLD = 300, (0.5, 1.0, 2.0), (0.3, 3.0), 0.01
"""Of the black box: random features; how far they reach, in the spread of its coordinates, and their size, in root mean squares of the
errors, of which the best count; and the share of their variance from which combinations of coordinates are told apart."""


@dataclass(frozen=True)
class Rows:
    """Means of weighted samples over short stretches: ``take`` (n,) gives the row of a sample (-1: not used), ``fold`` (rows,).

    The beginning of a bag is in no fold that is left out: it alone shows the bristles that the bag starts with.
    """

    take: IntArray
    weight: Array
    fold: IntArray

    @staticmethod
    def of(problem: Problem, weight: Array, roles: Split) -> Rows:
        rates = [1.0 / float(run.time[1] - run.time[0]) for run in problem.runs]
        size = max(1, round(min(rates) / RATE_HZ), int(np.ceil(np.count_nonzero(weight) / MOST_ROWS)))
        row, first = np.zeros(problem.valid.size, np.int64), 0
        for a, b in zip(problem.edges[:-1], problem.edges[1:], strict=True):
            row[a:b] = first + np.arange(b - a) // size
            first = int(row[b - 1]) + 1
        used = weight > 0.0
        _, take = np.unique(row[used], return_inverse=True)
        whole = np.full(row.size, -1)
        whole[used] = take
        count = np.bincount(take)
        fold = np.zeros(count.size, np.int64)
        stretch = roles.cluster[used] // FOLD_CLUSTERS
        first_one = np.isin(stretch, roles.cluster[problem.edges[:-1]] // FOLD_CLUSTERS)
        fold[take] = np.where(first_one, FOLDS, stretch % FOLDS)
        return Rows(whole, np.where(used, weight / np.sqrt(count[np.maximum(whole, 0)]), 0.0), fold)

    def plain_mean(self, column: Array) -> Array:
        """Rows (rows,) of a column (n,) in its own unit."""
        used = self.take >= 0
        return np.asarray(np.bincount(self.take[used], column[used]) / np.bincount(self.take[used]))

    def mean(self, columns: Array) -> Array:
        """Rows of columns (n, k) in noise standard deviations of the row."""
        used = self.take >= 0
        summed = np.zeros((self.fold.size, columns.shape[1]))
        order = self.take[used]
        starts = np.flatnonzero(np.diff(order, prepend=-1))
        summed[:] = np.add.reduceat(columns[used] * self.weight[used, None], starts, axis=0)
        return summed


@dataclass(frozen=True)
class Screened:
    """A cell (or the second of a pair) with the energy that it foretells of blocks left out, in noise variances; ``null`` (draws,)
    of errors that hide nothing."""

    cell: Cell
    gain: float
    null: Array


class Screen:
    """The search of cells on the samples of a weight: ``errors`` (n, k), the first column the residual, the others nulls."""

    def __init__(self, problem: Problem, fitted: Fit, weight: Array, roles: Split, draws: Array, traces: Traces, seed: int) -> None:
        self.problem, self.traces = problem, traces
        self.rows = Rows.of(problem, weight, roles)
        residual = problem.measured - fitted.prediction
        slopes = fitted.jacobian / np.where(weight > 0.0, weight, 1.0)[:, None]
        named = FREE * normalised(self.rows.mean(slopes[:, problem.nuisances :]))
        self.named_columns = named.shape[1]
        far = problem.scales()
        far[problem.first_bend :] /= problem.prior_weights(True)[problem.first_bend :]  # no further than where names are compared
        self.nuisance = np.column_stack([self.rows.mean(slopes[:, : problem.nuisances] * far), named])
        own = self.rows.mean(residual[:, None])
        self.errors = np.column_stack([own, self.rows.mean(draws.T), _permuted(own[:, 0], self.rows.fold, seed)])

    @cached_property
    def beside(self) -> Beside:
        """The linear recalibration beside which cells are judged on stretches left out."""
        return Beside(self.nuisance, self.errors, self.rows.fold)

    def pieces(self, traces: Traces, cell: Cell) -> Array:
        """Pieces of f (pieces,) that all rows suggest, beside a linear recalibration."""
        columns, m = self.rows.mean(traces.columns(cell, traces.pieces(cell))), self.nuisance.shape[1]
        both = np.column_stack([self.nuisance, columns])
        prior = block_diag((1.0 + 1e-9) * np.eye(m), smoothed(columns.T @ columns, SMOOTHING[0]))
        return np.asarray(np.linalg.solve(both.T @ both + prior, both.T @ self.errors[:, 0])[m:])

    def is_named(self, traces: Traces, cell: Cell) -> bool:
        """Whether a constant f does what a name does already."""
        named = self.nuisance[:, self.nuisance.shape[1] - self.named_columns :]
        constant = self.rows.mean(traces.columns(cell, traces.pieces(cell))).sum(axis=1)
        rest = constant - named @ np.linalg.lstsq(named, constant, rcond=None)[0]
        return bool(np.linalg.norm(rest) < ALIKE * np.linalg.norm(constant))

    def black_box(self, seed: int) -> float:
        """Energy that any smooth function of all coordinates together, or of the few of STATE, foretells of blocks left out, whatever it
        means.

        Ridge regression on random Fourier features, which draws near a Gaussian process (Rahimi and Recht, NIPS 2007).
        """
        state = [bags for axis, bags in self.traces.axes.items() if axis.memory == "none" and axis.coordinate in STATE]
        slow = [bags for axis, bags in self.traces.axes.items() if axis.memory != "ring"]  # so many alike would hide the others
        return max(self._smooth(along, seed) for along in (slow, state) if along)

    def _smooth(self, along: Sequence[list[Array]], seed: int) -> float:
        """The same of some axes, each by bag (sides, n)."""
        places = [np.concatenate(bags, axis=1) for bags in along]
        rows = np.array([self.rows.plain_mean(place) for axis in places for place in (axis.mean(axis=0), np.ptp(axis, axis=0))]).T
        moved = rows[:, rows.std(axis=0) > 1e-9 * np.abs(rows).max(axis=0)]
        turned, extent, _ = np.linalg.svd(stats.zscore(moved), full_matrices=False)
        apart = turned[:, extent**2 > TOLD * float(np.sum(extent**2))] * np.sqrt(len(rows))
        own = self.errors[:, :1]
        unit = self.rows.mean(np.ones((self.rows.take.size, 1)))
        amplitude = float(np.sqrt(np.mean(own**2) / np.mean(unit**2)))
        rng = np.random.default_rng(seed)
        waves, phase = rng.standard_normal((apart.shape[1], FEATURES)), rng.uniform(0.0, 2.0 * np.pi, FEATURES)

        def left(reach: float, size: float) -> float:
            drawn = np.cos(apart @ waves / (reach * np.sqrt(apart.shape[1])) + phase) * np.sqrt(2.0 / FEATURES)
            both = np.column_stack([self.nuisance, size * amplitude * unit * drawn])
            return float(Beside(both, own, self.rows.fold).left[0])

        least = min(in_threads(lambda one: left(*one), list(product(REACHES, SIZES))))
        return max(float(self.beside.left[0]) - least, 0.0)

    def search(self, near: Traces | None = None, like: Cell | None = None) -> list[Screened]:
        """All cells, best first; or of other traces at the same fit those of the channel and the pieces of one."""
        traces, beside = near or self.traces, self.beside
        cells = [cell for cell in traces.cells() if like is None or _alike(cell, like)]

        def one(cell: Cell, pieces: Sequence[Array]) -> Screened:
            columns = self.rows.mean(traces.columns(cell, pieces))
            norm = float(np.sqrt(np.mean(np.sum(columns**2, axis=0))))
            if norm < 1e-12:
                return Screened(cell, 0.0, np.zeros(self.errors.shape[1] - 1))
            smoothing = SMOOTHING if cell.pieces > HATS else SMOOTHING[:1]
            gains = beside.left - beside.left_with(columns / norm, smoothing)
            return Screened(cell, float(gains[0]), gains[1:])

        def of_one_basis(alike: Sequence[Cell]) -> list[Screened]:
            pieces = traces.pieces(alike[0])
            return [one(cell, pieces) for cell in alike]

        by_basis: dict[Cell, list[Cell]] = {}
        for cell in cells:
            by_basis.setdefault(replace(cell, channel=""), []).append(cell)
        found = [screened for group in in_threads(of_one_basis, list(by_basis.values())) for screened in group]
        return sorted(found, key=lambda screened: -screened.gain)


def _alike(one: Cell, other: Cell) -> bool:
    return (one.channel, one.pieces, one.period) == (other.channel, other.pieces, other.period)


def _permuted(errors: Array, fold: IntArray, seed: int) -> Array:
    """Errors (n,) whose stretches have changed places and signs (n, PERMUTED): as large and as slow, and they mean nothing."""
    rng = np.random.default_rng(seed)
    stretches = np.split(errors, np.flatnonzero(np.diff(fold)) + 1)
    drawn = []
    for _ in range(PERMUTED):
        order = rng.permutation(len(stretches))
        drawn.append(np.concatenate([stretches[i] * rng.choice((-1.0, 1.0)) for i in order]))
    return np.column_stack(drawn)


def bar(found: Sequence[Screened]) -> float:
    """The largest gain that the same search finds in any of the errors that hide nothing."""
    return float(max(np.max([one.null for one in found]), 0.0))
