# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Angle sensor with a scale error."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def angle(theta, scale):
    """theta = theta_m / (1 + scale)."""
    return theta / (1.0 + scale)


EFFECT = Effect(
    id="angle_scale",
    stage="motion",
    tier=2,
    title="Angle sensor with a scale error",
    equation="theta = theta_m / (1 + scale)",
    source="sensor calibration",
    trace="presliding slope and aligning torque scaled together",
    coordinate="steering angle",
    parameters=(
        Parameter("scale", "1", "relative error of the measured angle", 0.02, -0.2, 0.2),
    ),
    hooks={"angle": angle},
    rivals=("kingpin_jacking", "linkage_compliance"),
    counts_from_start=True,
)
