# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Elastic linkage between angle sensor and track."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def wind_up(torque, compliance, stiffening):
    """Angle lost [rad] = compliance M / (1 + stiffening |M|), and its slope [rad/(N m)]."""
    stiffer = 1.0 + stiffening * abs(torque)
    return compliance * torque / stiffer, compliance / (stiffer * stiffer)


EFFECT = Effect(
    id="linkage_compliance",
    stage="motion",
    tier=1,
    title="Elastic linkage between angle sensor and track",
    equation="contact angle = theta_m - compliance M / (1 + stiffening |M|)",
    source="series spring; Merritt, Hydraulic Control Systems (1967) for the hydraulic share",
    trace="presliding slope and its curvature; nothing on plateaus",
    coordinate="angle since reversal",
    parameters=(
        Parameter("compliance", "rad/(N m)", "inverse stiffness at small torque", 3e-07, 0.0, 5e-06),
        Parameter(
            "stiffening", "1/(N m)", "inverse torque at which the compliance has halved",
            4e-05, 0.0, 0.001, optional=True,
        ),
    ),
    hooks={"wind_up": wind_up},
    rivals=("payne_softening",),
    counts_from_start=True,
    joint_title="Elastic transmission between sensor and joint",
)
