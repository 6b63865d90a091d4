# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A spring that an axis works against."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def torque(theta, stiffness):
    """k theta [N m]; where its zero is elsewhere, the rest is a constant."""
    return stiffness * theta


EFFECT = Effect(
    id="spring_load",
    stage="parallel_torque",
    tier=1,
    title="A spring against the motion",
    equation="M = k theta",
    source="Hooke; the return spring of valves and single-acting cylinders: Merritt, Hydraulic Control Systems (1967)",
    trace="the mean of both sweep branches rises with the angle, evenly",
    coordinate="steering angle",
    parameters=(
        Parameter("stiffness", "N m/rad", "stiffness", 1000.0, -5e5, 5e5),
    ),
    hooks={"torque": torque},
    rivals=("end_stop", "soil_shear"),
    needs=("contact",),
    joint_title="Spring, or another force in proportion to the position",
    of_every_joint=True,
    of_line=True,
)
