# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Angles over a whole record: a smoother that keeps corners, standstill and fast shakes.

Maximum a-posteriori angle under Gaussian sensor noise, a heavy-tailed (Cauchy) prior on the third difference and another on
the first: jerk is small except now and then, and a parked vehicle does not move at all. Solved by iteratively reweighted
least squares on a banded system (Whittaker 1923 for the quadratic case; Geman and Reynolds 1992 for the half-quadratic form).

The most probable angle puts all jerk into a few samples, so that its acceleration is one of steps. Where inertia acts, the variance of the
third difference is spread over neighbours.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d, minimum_filter1d

from lugre_steering.chain.compiled import njit
from lugre_steering.recording import Array

REACH, _THIRD = 3, (-1.0, 3.0, -3.0, 1.0)
"""Samples over which the third difference reaches, and its coefficients."""
_WEIGHT = {1: 0.1, 3: 0.3}
_WIDTH_SIGMA = {1: 1e-3, 3: 3e-3}
ITERATIONS = 15
SETTLE_SIGMA = 0.02
"""Half width of the final dead band in units of the sensor noise."""
PARKED_SIGMA = 0.25
"""The same while parked: friction near its limit is a ratchet that turns any wander of the angle into a drift of torque."""
PARKED_SAMPLES = 100
"""Parked is where the smoothed angle spans less than the parked dead band over so many samples."""
NEIGHBOURS, SPREADS = 8.0, 4
"""Standard deviation [samples] of the average by which jerk is spread, and how often it is."""


def smooth_angle(angle: Array, sigma: float, *, inert: bool = False) -> Array:
    """Smoothed angle [rad] (n,) of uniformly sampled ``angle`` with noise ``sigma`` [rad] (quantisation included).

    ``inert``: of a joint, whose acceleration counts. With sigma = 0 the angle is returned as it is.
    """
    if sigma == 0.0 or angle.size < 5:
        return angle.copy()
    data = 1.0 / sigma**2
    estimate = angle
    weights = {1: np.zeros(angle.size - 1), 3: np.full(angle.size - 3, _WEIGHT[3] / (_WIDTH_SIGMA[3] * sigma) ** 2)}
    for _ in range(ITERATIONS):
        estimate = _least(angle, data, weights[1], weights[3])
        for order in weights:
            step = np.diff(estimate, n=order)
            weights[order] = _weight(order, sigma, step**2)
    for _ in range(SPREADS if inert else 0):
        spread = gaussian_filter1d(np.diff(estimate, n=3) ** 2, NEIGHBOURS, mode="nearest")
        estimate = _least(angle, data, weights[1], 1.0 / (spread + (_WIDTH_SIGMA[3] * sigma) ** 2 / _WEIGHT[3]))
        weights[1] = _weight(1, sigma, np.diff(estimate) ** 2)
    span = maximum_filter1d(estimate, PARKED_SAMPLES) - minimum_filter1d(estimate, PARKED_SAMPLES)
    half_width = sigma * np.where(span < 2.0 * PARKED_SIGMA * sigma, PARKED_SIGMA, SETTLE_SIGMA)
    return _settled(np.asarray(estimate), half_width)


def _weight(order: int, sigma: float, squares: Array) -> Array:
    """Of differences of an order by their squares: the heavy tail as a normal law of its own width for each."""
    return np.asarray(_WEIGHT[order] / ((_WIDTH_SIGMA[order] * sigma) ** 2 + squares))


@njit(cache=True)
def _settled(angle: Array, half_width: Array) -> Array:
    """Play operator against the last traces of noise: what moves less than ``half_width`` [rad] (n,) does not move."""
    out = np.empty_like(angle)
    center = angle[0]
    for i in range(angle.size):
        center = min(max(center, angle[i] - half_width[i]), angle[i] + half_width[i])
        out[i] = center
    return out


@njit(cache=True)
def _least(angle: Array, data: float, first: Array, third: Array) -> Array:
    """Angles x (n,) where data |x - angle|^2 + sum first (D x)^2 + sum third (D^3 x)^2 is least; ``first`` (n - 1,), ``third`` (n - 3,).

    By L D L' of the normal matrix, whose rows reach three samples back (Golub and Van Loan, Matrix Computations, 4.3): LAPACK's band solver
    takes five times as long for so narrow a band.
    """
    n = angle.size
    row = np.zeros((n, REACH + 1))  # row[i, k]: element (i, i - k) of the matrix, then of L; the diagonal becomes D
    for i in range(n):
        row[i, 0] = data
    for i in range(n - 1):
        row[i, 0] += first[i]
        row[i + 1, 0] += first[i]
        row[i + 1, 1] -= first[i]
    for i in range(n - REACH):
        for a in range(REACH + 1):
            for b in range(a + 1):
                row[i + a, a - b] += third[i] * _THIRD[a] * _THIRD[b]
    x = data * angle
    for i in range(n):
        back = min(i, REACH)
        for k in range(back, 0, -1):
            for m in range(k + 1, back + 1):
                row[i, k] -= row[i, m] * row[i - k, m - k]
        for k in range(1, back + 1):
            share = row[i, k] / row[i - k, 0]
            row[i, 0] -= share * row[i, k]
            row[i, k] = share
            x[i] -= share * x[i - k]
    for i in range(n):
        x[i] /= row[i, 0]
    for i in range(n - 1, -1, -1):
        for k in range(1, min(n - 1 - i, REACH) + 1):
            x[i] -= row[i + k, k] * x[i + k]
    return x
