# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Angle sensor mounted with an offset."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def angle(theta, offset):
    """theta = theta_m - offset."""
    return theta - offset


EFFECT = Effect(
    id="angle_offset",
    stage="motion",
    tier=2,
    title="Angle sensor mounted with an offset",
    equation="theta = theta_m - offset",
    source="sensor geometry; no friction effect, shifts aligning torque and moment arms",
    trace="a slow function of the angle, the same on both sweep directions",
    coordinate="steering angle",
    parameters=(
        Parameter("offset", "rad", "constant added by both angle sensors", 0.02, -0.15, 0.15),
    ),
    hooks={"angle": angle},
    rivals=("kingpin_jacking", "pressure_offset", "slope_bias"),
    counts_from_start=True,
    one_sided=True,
)
