# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Friction of gears and screws, which grows with the torque that they transmit."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def loss(load, elastic, damping, viscous, coulomb_torque, share):
    """share |M_load| M_f / M_c [N m]: friction M_f of the contact, its presliding included, that is more by a share of the load M_load.

    The load is what ``load`` [N m] has beside friction; one that stays the same is another friction level, and shows no share. That a
    gear loses another share of it where the load drives is a factor on the load, so that no torque tells it from a heavier one.
    """
    return share * abs(load - elastic - damping - viscous) * elastic / coulomb_torque


EFFECT = Effect(
    id="gear_friction",
    stage="measurement",
    tier=1,
    title="Friction grows with the torque that is transmitted",
    equation="M = M_f (1 + share |M_load| / M_c)",
    source="Hamon, Gautier, Garrec, IROS 2010, 6187; Bittencourt, Gunnarsson, J. Dyn. Sys. Meas. Control 134 (2012) 051013",
    trace="the two branches of a sweep are wide apart where the load is large",
    coordinate="torque",
    parameters=(
        Parameter("share", "1", "friction as a share of the transmitted torque", 0.05, 0.0, 1.0),
    ),
    hooks={"loss": loss},
    rivals=("surface_patch", "direction_asymmetry", "cylinder_friction"),
    needs=("contact",),
    never_late=True,
    joint_title="Friction of gears or screws, which grows with the torque that they transmit",
)
