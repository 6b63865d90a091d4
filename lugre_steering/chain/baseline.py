# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the baseline step needs beside bristle and heat: the rubber table, and torques of the angle."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import law

REST_RATE_RAD_S = 3e-4
"""Below this rate a track counts as standing (memories of dwell); noise-free creep of 0.05 deg/s is motion."""


@law
def ratios(rubber, low, step, temperature):
    """Stiffness and friction ratios at a temperature [degC], linear between rows, clamped (and told) outside."""
    position = (temperature - low) * (1.0 / step)
    last = rubber.shape[0] - 2
    index = int(position) if position > 0.0 else 0
    if index > last:
        index = last
    weight = position - index
    outside = weight < 0.0 or weight > 1.0
    weight = max(0.0, min(1.0, weight))
    stiffness = rubber[index, 0] + weight * (rubber[index + 1, 0] - rubber[index, 0])
    friction = rubber[index, 1] + weight * (rubber[index + 1, 1] - rubber[index, 1])
    return stiffness, friction, outside


@law
def most_friction(p):
    """The larger of static and sliding friction torque at the reference temperature [N m]."""
    return max(p.static_torque, p.coulomb_torque)


@law
def aligning(theta: float, amplitude: float, gravity_cos: float) -> float:
    """Conservative torque of the angle [N m]: M_a = F_z e sin(theta_k) sin(theta) (Reimpell; R), plus gravity."""
    return amplitude * math.sin(theta) + gravity_cos * math.cos(theta)
