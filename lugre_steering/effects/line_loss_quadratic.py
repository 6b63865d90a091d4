# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Turbulent or orifice loss in lines and valves."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def loss(omega, c):
    """c omega |omega| [N m]."""
    return c * omega * abs(omega)


EFFECT = Effect(
    id="line_loss_quadratic",
    stage="measurement",
    tier=1,
    title="Turbulent or orifice loss in lines and valves",
    equation="M = c omega |omega|",
    source="Merritt, Hydraulic Control Systems (1967)",
    trace="odd and quadratic in the rate, zero at rest",
    coordinate="steering rate",
    parameters=(
        Parameter("c", "N m s2/rad2", "loss per squared rate, of one track", 5e4, 0.0, 1e7),
    ),
    hooks={"loss": loss},
    rivals=("viscous_friction",),
    needs=("hydraulics",),
)
