# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Joint fit of calibration, initial bristles and effect parameters: Levenberg-Marquardt within bounds, few linearisations.

A linearisation costs a run of the chain per parameter, a step only one. Between linearisations the Jacobian is kept up to date by
the steps themselves (Broyden, Math. Comp. 19 (1965) 577), as long as they do what it foretells. The calibration is many columns and
nearly linear, so on the way only those of effects are made anew; an end is believed of a whole linearisation alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dposv

from lugre_steering.effects.entry import Parameter
from lugre_steering.fitting.problem import Candidate, Problem, in_threads
from lugre_steering.recording import Array, Mask

ROBUST = 3.0
"""Standard deviations beyond which the robust fit counts an error linearly."""
STEPS, FORETOLD, FAR = 6, 0.5, 0.03
"""Most steps per linearisation, the share of the foretold fall that a step must bring for another one, and the relative fall of the
cost per linearisation from which the next one is of effects alone."""
WORTH, UNDAMPED = 0.5, 1e-5
"""Fall of the cost, in doubts of the problem, that is worth no further step (what decides between models is ten doubts and more), and
damping below which a step is as long as its linearisation would have it."""
MOST_SETS, PATIENCE, ROUNDING = 5, 3, 1e-12
"""Sets of bounds tried per value, exchanges of many that may be in vain, and the share of its terms below which a slope is none."""


@dataclass(frozen=True)
class Fit:
    """Result of a joint fit: nuisance x, effects with their values, prediction (n,) [N m], weighted cost.

    ``slope`` (n, q): change of the prediction per scaled unit of each fitted value, times the weight of each sample; ``gram`` (q, q): its
    square; ``natural`` (q,): what such a unit is; ``prior`` (q,): weight per unit of it. ``pull`` (q,): the same per unit of the value;
    ``pulled`` (q,): the prior's error at the fit. ``weight`` (n,) of the samples; ``settled``: no further fall is to be had.
    """

    x: Array
    effects: tuple[tuple[Candidate, dict[str, float]], ...]
    prediction: Array
    cost: float
    slope: Array
    gram: Array
    natural: Array
    prior: Array
    pulled: Array
    weight: Array
    settled: bool

    @property
    def pull(self) -> Array:
        return np.asarray(self.prior / self.natural)

    @cached_property
    def jacobian(self) -> Array:
        """Change of the prediction (n, q) per unit of each fitted value, times the weight of each sample."""
        return np.asarray(self.slope / self.natural)

    @cached_property
    def covariance(self) -> Array:
        """Of the fitted values (q, q), by their columns: the square of these forgets what the prior alone tells of. Few of many fits are
        asked for it."""
        half = self.natural[:, None] * np.linalg.pinv(np.linalg.qr(np.vstack([self.slope, np.diag(self.prior)]), mode="r"), rcond=1e-12)
        return np.asarray(half @ half.T)

    def basis(self, without: slice | None = None) -> Array:
        """Orthonormal columns (n, k) that span what the fitted values can change, but for those ``without``; weighted too."""
        return self._basis if without is None else _orthonormal(np.delete(self.jacobian, without, axis=1))

    @cached_property
    def _basis(self) -> Array:
        """The whole basis, which many hypotheses about one fit ask for."""
        return _orthonormal(self.jacobian)

    def tangent(self) -> Array:
        """Orthonormal columns (n + q, k): what the fitted values can change, and below it what that costs by their priors."""
        return _orthonormal(np.vstack([self.jacobian, np.diag(self.pull)]))


def normalised(columns: Array) -> Array:
    """Columns (n, k) of unit length; those that do nothing are left out."""
    norms = np.linalg.norm(columns, axis=0)
    return np.asarray(columns[:, norms > 0.0] / norms[norms > 0.0])


def _orthonormal(columns: Array) -> Array:
    """Orthonormal columns (n, j) that span columns (n, k)."""
    return np.asarray(np.linalg.qr(normalised(columns))[0])


def fit(
    problem: Problem,
    weight: Array,
    effects: Sequence[tuple[Candidate, Mapping[str, float]]] = (),
    start: Array | Fit | None = None,
    *,
    linearisations: int = 12,
    robust: bool = False,
    priors: bool = True,
    tolerance: float = 1e-6,
    worth: float = np.inf,
) -> Fit:
    """Joint bounded least squares of calibration, initial bristles and the free parameters of all effects.

    ``weight`` (n,) is 1 / sigma, zero where a sample must not be used. Priors of the calibration enter as extra residuals.
    ``start``: nuisances to begin at, or a fit whose nuisances and, as far as the same is fitted, linearisation are gone on with.
    ``tolerance``: relative fall of the cost per step below which the fit ends, or WORTH; ``linearisations``: how often it may linearise
    anew before it ends anyhow; ``worth``: cost that must still be in reach at the present pace. ``robust`` bounds the influence of
    samples beyond ROBUST sigma (soft L1); ``priors`` off leaves it all to the data.
    """
    vector = _Vector.of(problem, effects, priors)
    x = problem.start() if start is None else start.x if isinstance(start, Fit) else start
    descent = _Descent(vector, weight, robust, vector.begin(x), start if isinstance(start, Fit) else None)
    for done in range(linearisations):
        before = descent.left
        descent.advance(tolerance)
        if descent.settled or descent.left - (linearisations - 1 - done) * (before - descent.left) > worth:
            break
        descent.linearise(whole=before - descent.left < FAR * descent.left)
    x, fitted = vector.values(descent.p)
    error, pulled = (descent.base - problem.measured) * weight, descent.p * vector.prior
    cost, natural = _cost(error, pulled, False), vector.natural(descent.p)
    return Fit(x, tuple(fitted), descent.base, cost, descent.slope, descent.gram, natural, vector.prior, pulled, weight, descent.settled)


@dataclass(frozen=True)
class _Vector:
    """What a fit sets free, each value counted in its own scale: nuisances first, then free parameters of effects.

    ``low``, ``high`` (q,): bounds; ``prior`` (q,): weight with which each is pulled to zero.
    """

    problem: Problem
    effects: Sequence[tuple[Candidate, Mapping[str, float]]]
    free: Sequence[tuple[int, Parameter]]
    scale: Array
    low: Array
    high: Array
    prior: Array

    @staticmethod
    def of(problem: Problem, effects: Sequence[tuple[Candidate, Mapping[str, float]]], priors: bool) -> _Vector:
        low, high = problem.bounds()
        free = [(i, effects[i][0].parameter(name)) for i, (candidate, _) in enumerate(effects) for name in candidate.free]
        scale = problem.scales()
        return _Vector(
            problem, effects, free, scale,
            np.concatenate([low / scale, [parameter.scaled(parameter.low) for _, parameter in free]]),
            np.concatenate([high / scale, [parameter.scaled(parameter.high) for _, parameter in free]]),
            np.concatenate([problem.prior_weights(priors), [parameter.pull * problem.doubt**0.5 for _, parameter in free]]),
        )  # fmt: skip

    @property
    def nuisances(self) -> int:
        return int(self.scale.size)

    def begin(self, x: Array) -> Array:
        """The vector at some nuisances and the given values of the effects, within bounds."""
        given = [parameter.scaled(self.effects[i][1].get(parameter.name, 0.0)) for i, parameter in self.free]
        return np.asarray(np.clip(np.concatenate([x / self.scale, given]), self.low, self.high))

    def values(self, p: Array) -> tuple[Array, list[tuple[Candidate, dict[str, float]]]]:
        """Nuisances and effects in their own units."""
        values = [dict(v) for _, v in self.effects]
        for (i, parameter), number in zip(self.free, p[self.nuisances :], strict=True):
            values[i][parameter.name] = parameter.unscaled(float(number))
        return p[: self.nuisances] * self.scale, [(candidate, v) for (candidate, _), v in zip(self.effects, values, strict=True)]

    def natural(self, p: Array) -> Array:
        """Change of each value in its own unit per unit of the vector."""
        slopes = [parameter.slope(float(number)) for (_, parameter), number in zip(self.free, p[self.nuisances :], strict=True)]
        return np.concatenate([self.scale, slopes])

    def known(self, earlier: Fit, weight: Array) -> int:
        """How many of the values, from the first on, an earlier fit with the same weight has a linearisation of; none if bends that it
        knows nothing of have joined its nuisances since."""
        linearised = earlier.natural.size - sum(len(candidate.free) for candidate, _ in earlier.effects)
        if not earlier.x.size == linearised == self.nuisances or not np.array_equal(earlier.weight, weight):
            return 0
        shared = self.nuisances
        for (old, _), (new, _) in zip(earlier.effects, self.effects, strict=False):
            if old != new:
                break
            shared += len(new.free)
        return shared

    def predict(self, p: Array) -> Array:
        return self.problem.predict_all(*self.values(p))

    @property
    def bends(self) -> slice:
        """Values in which the prediction is linear."""
        return slice(self.problem.first_bend, self.nuisances)

    def linearise(self, p: Array, base: Array, weight: Array, columns: Sequence[int], slope: Array) -> None:
        """Put into ``columns`` of ``slope`` (n, q) the change of the prediction per unit, at p where it is ``base``, times the weight."""

        def fill(j: int) -> None:
            np.multiply(self._column(p, j, base), weight, out=slope[:, j])

        in_threads(fill, columns)

    def _column(self, p: Array, j: int, base: Array) -> Array:
        """One column by a forward (or, at the upper bound, backward) difference of 2 % of the scale."""
        problem, step = self.problem, 0.02 if p[j] + 0.02 <= self.high[j] else -0.02
        moved = p.copy()
        moved[j] += step
        x, effects = self.values(moved)
        column = np.zeros_like(base)
        for bag in self._acts_in(j):
            part = slice(problem.edges[bag], problem.edges[bag + 1])
            column[part] = (problem.predict(bag, x, effects) - base[part]) / step
        return column

    def _acts_in(self, j: int) -> Sequence[int]:
        """Bags whose prediction a value changes: its own of a bristle or weather, those in which its effect acts."""
        first, bags = len(self.problem.calibrations), range(len(self.problem.runs))
        if j < first:
            return bags
        if j < self.nuisances:
            return [(j - first) % len(bags)]
        candidate = self.effects[self.free[j - self.nuisances][0]][0]
        return [bag for bag in bags if candidate.active_in(bag)]


class _Descent:
    """Where a fit stands: vector ``p``, prediction ``base`` (n,), cost ``left``, weighted Jacobian ``slope`` (n, q).

    Bends are linear: their columns, and their part of the normal matrix, stay. ``settled``: no further fall is to be had, as a whole
    linearisation says from which steps have hardly brought any.
    """

    def __init__(self, vector: _Vector, weight: Array, robust: bool, p: Array, earlier: Fit | None) -> None:
        self.vector, self.weight, self.robust, self.p = vector, weight, robust, p
        self.base, self.damping, self.settled = vector.predict(p), 1e-3, False
        self.left = self._cost(p, self.base)
        self.slope = np.empty((self.base.size, p.size), order="F")
        bends = vector.bends
        np.multiply(vector.problem.bends, weight[:, None], out=self.slope[:, bends])
        self._parts = slice(0, bends.start), slice(bends.stop, p.size)
        self.gram = np.empty((p.size, p.size))
        self.gram[bends, bends] = self.slope[:, bends].T @ self.slope[:, bends]
        known = 0 if earlier is None else vector.known(earlier, weight)
        if earlier is None or not known:
            self.linearise(whole=True)
            return
        ratio = vector.natural(p)[:known] / earlier.natural[:known]
        for part in (slice(0, bends.start), slice(bends.stop, known)):
            np.multiply(earlier.slope[:, part], ratio[part], out=self.slope[:, part])
        same = [dict(values) for _, values in vector.effects] == [values for _, values in earlier.effects]
        self._whole = earlier.settled and known == p.size and same
        self._linearise(range(known, p.size))

    def _cost(self, p: Array, predicted: Array) -> float:
        return _cost((predicted - self.vector.problem.measured) * self.weight, p * self.vector.prior, self.robust)

    def linearise(self, whole: bool) -> None:
        """The Jacobian anew, or only its columns of effects."""
        bends = self.vector.bends
        self._whole = whole or self.p.size == self.vector.nuisances
        self._linearise([*range(bends.start if self._whole else 0), *range(bends.stop, self.p.size)])

    def _linearise(self, columns: Sequence[int]) -> None:
        self.vector.linearise(self.p, self.base, self.weight, columns, self.slope)
        for part in self._parts:
            self.gram[part] = self.slope[:, part].T @ self.slope
            self.gram[:, part] = self.gram[part].T

    def advance(self, tolerance: float) -> None:
        """Steps as long as they do what the linearisation foretells, by more than ``tolerance`` of the cost."""
        prior, before = self.vector.prior, self.left
        enough = max(tolerance * before, WORTH * self.vector.problem.doubt)
        for age in range(STEPS):
            error = (self.base - self.vector.problem.measured) * self.weight
            gram = self.gram
            if self.robust:
                influence = 1.0 / np.sqrt(1.0 + (error / ROBUST) ** 2)
                gram, error = self.slope.T @ (self.slope * influence[:, None]), error * influence
            normal, gradient = _stiffened(gram, prior**2), self.slope.T @ error + prior**2 * self.p
            trial, moved, fall = self._step(normal, gradient, exact=age == 0)
            if not fall > 0.0:
                self.settled = self._whole and before - self.left < enough
                return
            change, secant = trial - self.p, (moved - self.base) * self.weight
            foretold = -(2.0 * gradient @ change + change @ normal @ change)
            self.p, self.base, self.left, self.damping = trial, moved, self.left - fall, max(self.damping / 6.0, 1e-9)
            self.settled = self._whole and before - self.left < enough
            if fall < FORETOLD * foretold or (fall < enough and self.damping < UNDAMPED):
                return
            self._correct(secant - self.slope @ change, change)

    def _correct(self, missed: Array, change: Array) -> None:
        """Broyden's correction for what a step (q,) has missed (n,), of all that is not linear; the normal matrix follows."""
        along = change.copy()
        along[self.vector.bends] = 0.0
        power = float(along @ along)
        if not power > 0.0:
            return
        along /= power
        cross = np.outer(self.slope.T @ missed, along)
        self.gram = self.gram + cross + cross.T + (missed @ missed) * np.outer(along, along)
        for part in self._parts:
            self.slope[:, part] += np.outer(missed, along[part])

    def _step(self, normal: Array, gradient: Array, exact: bool) -> tuple[Array, Array, float]:
        """A step within bounds, the prediction there and the fall of the cost; an ``exact`` linearisation is worth ever shorter ones."""
        low, high = self.vector.low, self.vector.high
        while True:
            trial = np.clip(self.p + _bounded_step(normal, gradient, self.damping, low - self.p, high - self.p), low, high)
            moved = self.vector.predict(trial)
            fall = self.left - self._cost(trial, moved)
            if fall > 0.0 or not exact or self.damping > 1e6:
                return trial, moved, fall
            self.damping *= 8.0


def _cost(error: Array, prior_error: Array, robust: bool) -> float:
    """Sum of squares, or its soft L1 form beyond ROBUST."""
    if robust:
        return float(2.0 * ROBUST**2 * np.sum(np.sqrt(1.0 + (error / ROBUST) ** 2) - 1.0) + prior_error @ prior_error)
    return float(error @ error + prior_error @ prior_error)


def _bounded_step(normal: Array, gradient: Array, damping: float, low: Array, high: Array) -> Array:
    """Levenberg-Marquardt step that respects bounds."""
    diagonal = np.diag(normal)
    # A column that does nothing has no scale of its own.
    least = 1e-9 * np.where(diagonal > 0.0, diagonal, max(float(diagonal.max()), 1e-30))
    return bounded_minimum(_stiffened(normal, damping * diagonal + least), gradient, low, high)


def _stiffened(matrix: Array, more: Array) -> Array:
    """A matrix (q, q) with more (q,) on its diagonal."""
    stiffer = matrix.copy()
    stiffer.flat[:: len(more) + 1] += more
    return stiffer


def bounded_minimum(normal: Array, gradient: Array, low: Array, high: Array) -> Array:
    """Where 1/2 d'A d + g'd is least within low <= d <= high, for positive definite A (q, q), by block principal pivoting.

    It begins with those bounds held that zero stands at. All values on the wrong side of their bound, or held at one that they would
    leave, are exchanged at once; where that does not make them fewer, one by one, which always ends (Judice and Pires, Computers Oper.
    Res. 21 (1994) 587). On normal equations its cost is independent of the number of samples. After MOST_SETS sets of bounds the last
    one is returned.
    """
    at_low, at_high = low >= 0.0, high <= 0.0
    sizes, least = np.abs(normal), np.abs(gradient)
    fewest, patience = gradient.size + 1, PATIENCE
    step = _with_bounds(normal, gradient, low, high, at_low, at_high)
    for _ in range(MOST_SETS * gradient.size):
        held = at_low | at_high
        below, above = ~held & (step < low), ~held & (step > high)
        exchanged = below | above
        if held.any():
            slope = normal @ step + gradient
            certain = ROUNDING * (sizes @ np.abs(step) + least)
            exchanged |= (at_low & (slope < -certain)) | (at_high & (slope > certain))
        wrong = np.flatnonzero(exchanged)
        if wrong.size == 0:
            break
        patience = PATIENCE if wrong.size < fewest else patience - 1
        fewest = min(fewest, wrong.size)
        if patience < 0:
            wrong = wrong[-1:]
        at_low[wrong], at_high[wrong] = below[wrong], above[wrong]
        step = _with_bounds(normal, gradient, low, high, at_low, at_high)
    return np.asarray(np.clip(step, low, high))


def _with_bounds(normal: Array, gradient: Array, low: Array, high: Array, at_low: Mask, at_high: Mask) -> Array:
    """The least point where some values are held at their bounds and the others have none."""
    free = ~(at_low | at_high)
    if free.all():
        return _solved(normal, -gradient)
    step = np.where(at_low, low, np.where(at_high, high, 0.0))
    if free.any():
        step[free] = _solved(normal[free][:, free], -(gradient + normal @ step)[free])
    return step


def _solved(matrix: Array, right: Array) -> Array:
    """Solution of a positive definite system by LAPACK itself: SciPy's own checks take longer than such a small system."""
    _, solution, wrong = dposv(matrix, right)
    if wrong:
        raise np.linalg.LinAlgError("the normal equations are not positive definite")
    return np.asarray(solution)
