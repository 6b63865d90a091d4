# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Friction of cylinder seals and steering joints."""

from __future__ import annotations

from lugre_steering.chain.compiled import exp, law, tanh
from lugre_steering.effects.entry import Effect, Parameter
from lugre_steering.effects.signs import SIGN_RATE_RAD_S

SEAL_TRAVEL_RAD = 2e-3
"""Travel in which a cylinder seal changes sides."""
STRIBECK_RAD_S = 0.02


@law
def loss(load, omega, turned, sides, coulomb, load_share, viscous, holding, breakaway, rate_scale, seal, angle_unit):
    """(coulomb + load_share |M|) times a direction function, plus viscous omega [N m].

    The share ``holding`` of it is kept at rest by the seals; ``breakaway`` raises it at low rate (Stribeck); the sign
    changes over ``rate_scale``.
    """
    moving = tanh(omega / (SIGN_RATE_RAD_S * angle_unit + rate_scale))
    seal = max(-1.0, min(1.0, seal + turned / (SEAL_TRAVEL_RAD * angle_unit)))
    level = (coulomb / sides + load_share * abs(load)) * (1.0 + breakaway * exp(-((omega / STRIBECK_RAD_S) ** 2)))
    return viscous * omega + level * (holding * seal + (1.0 - holding) * moving), seal


EFFECT = Effect(
    id="cylinder_friction",
    stage="measurement",
    tier=1,
    title="Friction of cylinder seals and steering joints",
    equation=(
        "M = (coulomb + load_share |M|) (holding seal(theta) + (1 - holding) sgn(omega)) (1 + breakaway ...) "
        "+ viscous omega"
    ),
    source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083",
    trace="step at each reversal, grows with pressure",
    coordinate="direction",
    parameters=(
        Parameter("coulomb", "N m", "friction of the vehicle against the motion", 300.0, 0.0, 3e4),
        Parameter("load_share", "1", "friction as a share of the torque", 0.01, 0.0, 0.4),
        Parameter("viscous", "N m s/rad", "viscous friction of one track", 1000.0, 0.0, 2e5, optional=True),
        Parameter("holding", "1", "share kept at standstill by the seals", 0.5, 0.0, 1.0, (0.0, 1.0)),
        Parameter("breakaway", "1", "raise at low rate (Stribeck)", 0.3, 0.0, 3.0, optional=True),
        Parameter("rate_scale", "rad/s", "rate over which the sign changes", 0.01, 0.0, 0.05, optional=True),
    ),
    hooks={"loss": loss},
    acts_by=("coulomb", "load_share", "viscous"),
    rivals=("line_loss_linear",),
    memory={"seal": 0.0},  # deflection of the seals, -1 ... 1
    needs=("hydraulics",),
    joint_title="Friction of seals and bearings",
)
