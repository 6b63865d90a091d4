# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Joint fit of calibration, initial bristles and effect parameters: Levenberg-Marquardt within bounds, few linearisations.

A linearisation costs a run of the chain per parameter, a step only one. Between linearisations the Jacobian is kept up to date by
the steps themselves (Broyden, Math. Comp. 19 (1965) 577), as long as they do what it foretells. The calibration is many columns and
nearly linear, so on the way only those of effects are made anew; an end is believed of a whole linearisation alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import lsq_linear

from lugre_steering.fitting.problem import Candidate, Problem, in_threads
from lugre_steering.recording import Array

ROBUST = 3.0
"""Standard deviations beyond which the robust fit counts an error linearly."""
STEPS, FORETOLD, FAR = 6, 0.5, 0.03
"""Most steps per linearisation, the share of the foretold fall that a step must bring for another one, and the relative fall of the
cost per linearisation from which the next one is of effects alone."""


@dataclass(frozen=True)
class Fit:
    """Result of a joint fit: nuisance x, effects with their values, prediction (n,) [N m], weighted cost, covariance (q, q).

    ``jacobian`` (n, q): change of the prediction per unit of each fitted value, times the weight of each sample.
    """

    x: Array
    effects: tuple[tuple[Candidate, dict[str, float]], ...]
    prediction: Array
    cost: float
    jacobian: Array
    covariance: Array

    def basis(self, without: slice | None = None) -> Array:
        """Orthonormal columns (n, k) that span what the fitted values can change, but for those ``without``; weighted too."""
        columns = self.jacobian if without is None else np.delete(self.jacobian, without, axis=1)
        return np.asarray(np.linalg.qr(normalised(columns))[0])


def normalised(columns: Array) -> Array:
    """Columns (n, k) of unit length; those that do nothing are left out."""
    norms = np.linalg.norm(columns, axis=0)
    return np.asarray(columns[:, norms > 0.0] / norms[norms > 0.0])


def fit(
    problem: Problem,
    weight: Array,
    effects: Sequence[tuple[Candidate, Mapping[str, float]]] = (),
    start: Array | None = None,
    *,
    linearisations: int = 12,
    robust: bool = False,
    priors: bool = True,
    tolerance: float = 1e-6,
    worth: float = np.inf,
) -> Fit:
    """Joint bounded least squares of calibration, initial bristles and the free parameters of all effects.

    ``weight`` (n,) is 1 / sigma, zero where a sample must not be used. Priors of the calibration enter as extra residuals.
    ``tolerance``: relative fall of the cost per step below which the fit ends; ``linearisations``: how often it may linearise
    anew before it ends anyhow; ``worth``: cost that must still be in reach at the present pace. ``robust`` bounds the influence of
    samples beyond ROBUST sigma (soft L1); ``priors`` off leaves it all to the data.
    """
    x0 = problem.start() if start is None else start
    low, high = problem.bounds()
    free = [(i, effects[i][0].parameter(name)) for i, (candidate, _) in enumerate(effects) for name in candidate.free]
    scale = problem.scales()
    values0 = [dict(values) for _, values in effects]
    p0 = np.concatenate([x0 / scale, [parameter.scaled(values0[i].get(parameter.name, 0.0)) for i, parameter in free]])
    low = np.concatenate([low / scale, [parameter.scaled(parameter.low) for _, parameter in free]])
    high = np.concatenate([high / scale, [parameter.scaled(parameter.high) for _, parameter in free]])
    prior = np.concatenate([problem.prior_weights(priors), [parameter.pull for _, parameter in free]])
    n = problem.nuisances

    def unpack(p: Array) -> tuple[Array, list[tuple[Candidate, dict[str, float]]]]:
        values = [dict(v) for v in values0]
        for (i, parameter), number in zip(free, p[n:], strict=True):
            values[i][parameter.name] = parameter.unscaled(float(number))
        return p[:n] * scale, [(candidate, v) for (candidate, _), v in zip(effects, values, strict=True)]

    def prediction(p: Array) -> Array:
        return problem.predict_all(*unpack(p))

    def jacobian(p: Array, base: Array, first: int = 0) -> Array:
        columns = in_threads(lambda j: _column(problem, unpack, p, j, n, high, base), range(first, p.size))
        return np.column_stack(columns) * weight[:, None]

    def cost(p: Array, predicted: Array) -> float:
        return _cost((predicted - problem.measured) * weight, p * prior, robust)

    p = np.clip(p0, low, high)
    base = prediction(p)
    left, slope, settled, whole = cost(p, base), jacobian(p, base), False, True
    damping = 1e-3
    for done in range(linearisations):
        before = left
        for age in range(STEPS):
            error = (base - problem.measured) * weight
            influence = 1.0 / np.sqrt(1.0 + (error / ROBUST) ** 2) if robust else np.ones_like(error)
            normal = slope.T @ (slope * influence[:, None]) + np.diag(prior**2)
            gradient = slope.T @ (error * influence) + prior**2 * p
            while True:
                trial = np.clip(p + _bounded_step(normal, gradient, damping, low - p, high - p), low, high)
                moved = prediction(trial)
                fall = left - cost(trial, moved)
                # Only an exact linearisation is worth ever shorter steps.
                if fall > 0.0 or age > 0 or damping > 1e6:
                    break
                damping *= 8.0
            if not fall > 0.0:
                settled = whole and age == 0
                break
            change, secant = trial - p, (moved - base) * weight
            foretold = -(2.0 * gradient @ change + change @ normal @ change)
            p, base, left, damping = trial, moved, left - fall, max(damping / 6.0, 1e-9)
            settled = whole and age == 0 and fall < tolerance * left
            if fall < max(tolerance * left, FORETOLD * foretold):
                break
            slope += np.outer(secant - slope @ change, change / (change @ change))
        if settled or left - (linearisations - 1 - done) * (before - left) > worth:
            break
        whole = p.size == n or before - left < FAR * left
        if whole:
            slope = jacobian(p, base)
        else:
            slope[:, n:] = jacobian(p, base, n)
    x, fitted = unpack(p)
    natural = np.concatenate([scale, [parameter.slope(float(number)) for (_, parameter), number in zip(free, p[n:], strict=True)]])
    covariance = np.asarray(np.linalg.pinv(slope.T @ slope + np.diag(prior**2), rcond=1e-12) * np.outer(natural, natural), float)
    return Fit(
        x, tuple(fitted), base, _cost((base - problem.measured) * weight, p * prior, False), slope / natural, covariance
    )


def _cost(error: Array, prior_error: Array, robust: bool) -> float:
    """Sum of squares, or its soft L1 form beyond ROBUST."""
    if robust:
        return float(2.0 * ROBUST**2 * np.sum(np.sqrt(1.0 + (error / ROBUST) ** 2) - 1.0) + prior_error @ prior_error)
    return float(error @ error + prior_error @ prior_error)


def _bounded_step(normal: Array, gradient: Array, damping: float, low: Array, high: Array) -> Array:
    """Levenberg-Marquardt step that respects bounds: min 1/2 d'(A + damping diag A) d + g'd, low <= d <= high.

    The small normal equations keep the cost of a step independent of the number of samples.
    """
    diagonal = np.diag(normal)
    # A column that does nothing has no scale of its own.
    damped = normal + np.diag(damping * diagonal + 1e-9 * np.where(diagonal > 0.0, diagonal, max(float(diagonal.max()), 1e-30)))
    factor = np.linalg.cholesky(damped)
    span = np.maximum(high - low, 1e-12)
    target = solve_triangular(factor, -gradient, lower=True)
    return np.asarray(lsq_linear(factor.T, target, (low, low + span), method="bvls").x)


def _column(
    problem: Problem,
    unpack: Callable[[Array], tuple[Array, list[tuple[Candidate, dict[str, float]]]]],
    p: Array,
    j: int,
    nuisances: int,
    high: Array,
    base: Array,
) -> Array:
    """One Jacobian column by a forward (or, at the upper bound, backward) difference of 2 % of the parameter's scale."""
    step = 0.02 if p[j] + 0.02 <= high[j] else -0.02
    moved = p.copy()
    moved[j] += step
    x, effects = unpack(moved)
    if len(problem.calibrations) <= j < nuisances:
        bag = (j - len(problem.calibrations)) % len(problem.runs)
        column = np.zeros_like(base)
        part = slice(problem.edges[bag], problem.edges[bag + 1])
        column[part] = (problem.predict(bag, x, effects) - base[part]) / step
        return column
    moved_prediction = np.concatenate([problem.predict(i, x, effects) for i in range(len(problem.runs))])
    return (moved_prediction - base) / step
