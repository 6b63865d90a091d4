# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The banded system of the smoother against SciPy's sparse solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

from lugre_steering.data.smoother import _least, smooth_angle


@pytest.mark.parametrize("size", [5, 6, 400])
def test_smoothest_angles_solve_the_normal_equations(size: int) -> None:
    rng = np.random.default_rng(size)
    angle, first, third = rng.standard_normal(size), *(10.0 ** rng.uniform(-2.0, 6.0, size - order) for order in (1, 3))
    normal = 7.0 * sparse.eye_array(size)
    for order, weight in ((1, first), (3, third)):
        difference = sparse.csr_array(np.diff(np.eye(size), n=order, axis=0))
        normal = normal + difference.T @ sparse.diags_array(weight) @ difference

    found = _least(angle, 7.0, first, third)

    np.testing.assert_allclose(found, spsolve(normal.tocsc(), 7.0 * angle), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(("fastest_Hz", "rate_Hz"), [(0.3, 100.0), (0.8, 200.0)])
def test_the_acceleration_of_a_joint_is_no_staircase(fastest_Hz: float, rate_Hz: float) -> None:
    """Of a path of swings that is known: with jerk spread over neighbours the error is two thirds of that without, at most."""
    rng, time, sigma = np.random.default_rng(3), np.arange(0.0, 40.0, 1.0 / rate_Hz), 1e-4
    pulsation = 2.0 * np.pi * fastest_Hz * np.array([1.0, 0.6, 0.23])
    path = 0.3 * np.sin(np.outer(pulsation, time) + np.array([[0.3], [1.2], [2.0]]))
    noisy, known = path.sum(axis=0) + sigma * rng.standard_normal(time.size), -(pulsation**2) @ path

    def error(inert: bool) -> float:
        found = np.diff(smooth_angle(noisy, sigma, inert=inert), 2) * rate_Hz**2
        return float(np.std((found - known[1:-1])[50:-50]))

    assert error(inert=True) < 0.67 * error(inert=False)
