# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Laminar pressure loss in the lines."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def loss(omega, b):
    """b omega [N m]."""
    return b * omega


EFFECT = Effect(
    id="line_loss_linear",
    stage="measurement",
    tier=1,
    title="Laminar pressure loss in the lines",
    equation="M = b omega",
    source="Hagen-Poiseuille; Merritt 1967",
    trace="odd in the rate, zero at rest",
    coordinate="steering rate",
    parameters=(
        Parameter("b", "N m s/rad", "loss per rate, of one track", 5000.0, 0.0, 5e5),
    ),
    hooks={"loss": loss},
    rivals=("line_loss_quadratic", "viscous_friction"),
    needs=("hydraulics",),
)
