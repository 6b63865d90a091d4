# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The banded system of the smoother against SciPy's sparse solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

from lugre_steering.data.smoother import _least


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
