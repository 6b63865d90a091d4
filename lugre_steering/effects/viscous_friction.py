# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Viscous adhesion of the rubber."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def viscous(omega, sigma_2, thinning):
    """sigma_2 omega / (1 + thinning |omega|), below zero sigma_2 omega (1 - thinning |omega|), as of air or churned oil [N m]."""
    less = thinning * abs(omega)
    return sigma_2 * omega / (1.0 + less) if less > 0.0 else sigma_2 * omega * (1.0 - less)


EFFECT = Effect(
    id="viscous_friction",
    stage="contact",
    tier=1,
    title="Viscous adhesion of the rubber",
    equation="M += sigma_2 omega / (1 + thinning |omega|), thinning < 0: M += sigma_2 omega (1 - thinning |omega|)",
    source="Canudas de Wit et al., IEEE TAC 40 (1995) 419; dropped by Liang et al. 2022",
    trace="odd in the rate, zero at rest",
    coordinate="steering rate",
    parameters=(
        Parameter("sigma_2", "N m s/rad", "viscous coefficient of one track", 5000.0, 0.0, 5e5),
        Parameter(
            "thinning", "s/rad", "inverse rate at which it has halved, below zero doubled", 3.0, -100.0, 100.0,
            optional=True, signed_on_joints=True,
        ),
    ),
    hooks={"viscous": viscous},
    joint_title="Viscous friction",
    of_every_joint=True,
)
