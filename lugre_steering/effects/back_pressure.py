# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Back pressure of the return line."""

from __future__ import annotations

from lugre_steering.chain.compiled import law, tanh
from lugre_steering.effects.entry import Effect, Parameter
from lugre_steering.effects.signs import SIGN_RATE_RAD_S


@law
def loss(omega, sides, torque, flow, rate_scale, angle_unit):
    """torque (1 + flow |omega|) sgn(omega) [N m]: opposes motion, vanishes at rest, grows with the return flow."""
    return torque / sides * tanh(omega / (SIGN_RATE_RAD_S * angle_unit + rate_scale)) * (1.0 + flow * abs(omega))


EFFECT = Effect(
    id="back_pressure",
    stage="measurement",
    tier=2,
    title="Back pressure of the return line",
    equation="M = torque (1 + flow |omega|) sgn(omega)",
    source="Merritt 1967",
    trace="opposes motion, vanishes at rest",
    coordinate="direction",
    parameters=(
        Parameter("torque", "N m", "torque of the vehicle", 300.0, 0.0, 2e4),
        Parameter("flow", "s/rad", "growth with the return flow", 3.0, 0.0, 100.0, optional=True),
        Parameter("rate_scale", "rad/s", "rate over which the sign changes", 0.01, 0.0, 0.05, optional=True),
    ),
    hooks={"loss": loss},
    rivals=("cylinder_friction",),
    needs=("hydraulics",),
)
