# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Friction differs between left and right turns."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def level(sign, asymmetry):
    """1 + a sgn(omega)."""
    return 1.0 + asymmetry * sign


EFFECT = Effect(
    id="direction_asymmetry",
    stage="contact",
    tier=1,
    title="Friction differs between left and right turns",
    equation="Ms, Mc times (1 + a sgn(omega))",
    source="Ackermann geometry and uneven ground; Liang et al. 2022, alternating extremes",
    trace="plateaus differ by direction",
    coordinate="direction",
    parameters=(
        Parameter("asymmetry", "1", "relative half difference, positive: left turns harder", 0.01, -0.3, 0.3),
    ),
    hooks={"level": level},
    rivals=("slope_bias", "surface_patch"),
    joint_title="Friction differs between the two directions",
    one_sided=True,
)
