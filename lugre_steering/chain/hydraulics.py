# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Exact pivot geometry of a cylinder."""

from __future__ import annotations

from typing import Any

import numpy as np

from lugre_steering.chain.compiled import law


@law
def moment_arm(theta: Any, chassis_x: float, chassis_y: float, knuckle_x: float, knuckle_y: float) -> Any:
    """dL/dtheta [m], exact: (chassis x knuckle(theta)) / L, from L**2 = |knuckle(theta) - chassis|**2."""
    c, s = np.cos(theta), np.sin(theta)
    x = knuckle_x * c - knuckle_y * s
    y = knuckle_x * s + knuckle_y * c
    return (chassis_x * y - chassis_y * x) / np.sqrt((x - chassis_x) ** 2 + (y - chassis_y) ** 2)
