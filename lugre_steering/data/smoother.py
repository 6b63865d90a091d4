# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Angles over a whole record: a smoother that keeps corners, standstill and fast shakes.

Maximum a-posteriori angle under Gaussian sensor noise, a heavy-tailed (Cauchy) prior on the third difference and another on
the first: jerk is small except now and then, and a parked vehicle does not move at all. Solved by iteratively reweighted
least squares on a banded system (Whittaker 1923 for the quadratic case; Geman and Reynolds 1992 for the half-quadratic form).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from lugre_steering.chain.compiled import njit
from lugre_steering.recording import Array

_DIFFERENCE = {1: (-1.0, 1.0), 3: (-1.0, 3.0, -3.0, 1.0)}
_WEIGHT = {1: 0.1, 3: 0.3}
_WIDTH_SIGMA = {1: 1e-3, 3: 3e-3}
ITERATIONS = 15
SETTLE_SIGMA = 0.02
"""Half width of the final dead band in units of the sensor noise."""
PARKED_SIGMA = 0.25
"""The same while parked: friction near its limit is a ratchet that turns any wander of the angle into a drift of torque."""
PARKED_SAMPLES = 100
"""Parked is where the smoothed angle spans less than the parked dead band over so many samples."""


def smooth_angle(angle: Array, sigma: float) -> Array:
    """Smoothed angle [rad] (n,) of uniformly sampled ``angle`` with noise ``sigma`` [rad] (quantisation included).

    With sigma = 0 the angle is returned as it is.
    """
    if sigma == 0.0 or angle.size < 5:
        return angle.copy()
    data = 1.0 / sigma**2
    estimate = angle
    weights = {1: np.zeros(angle.size - 1), 3: np.full(angle.size - 3, _WEIGHT[3] / (_WIDTH_SIGMA[3] * sigma) ** 2)}
    for _ in range(ITERATIONS):
        band = np.zeros((4, angle.size))
        band[3] = data
        for order, weight in weights.items():
            _add_penalty(band, weight, _DIFFERENCE[order])
        estimate = solveh_banded(band, angle * data, check_finite=False)
        for order in weights:
            step = np.diff(estimate, n=order)
            weights[order] = _WEIGHT[order] / ((_WIDTH_SIGMA[order] * sigma) ** 2 + step**2)
    span = maximum_filter1d(estimate, PARKED_SAMPLES) - minimum_filter1d(estimate, PARKED_SAMPLES)
    half_width = sigma * np.where(span < 2.0 * PARKED_SIGMA * sigma, PARKED_SIGMA, SETTLE_SIGMA)
    return _settled(np.asarray(estimate), half_width)


@njit(cache=True)
def _settled(angle: Array, half_width: Array) -> Array:
    """Play operator against the last traces of noise: what moves less than ``half_width`` [rad] (n,) does not move."""
    out = np.empty_like(angle)
    center = angle[0]
    for i in range(angle.size):
        center = min(max(center, angle[i] - half_width[i]), angle[i] + half_width[i])
        out[i] = center
    return out


def _add_penalty(band: Array, weight: Array, coefficients: tuple[float, ...]) -> None:
    """Add the normal matrix of a weighted difference penalty to an upper-banded symmetric matrix (4, n)."""
    for a, first in enumerate(coefficients):
        for b in range(a, len(coefficients)):
            band[3 - (b - a), b : b + weight.size] += weight * (first * coefficients[b])
