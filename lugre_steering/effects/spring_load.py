# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A spring that an axis works against."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def torque(theta, stiffness, cubic_stiffness):
    """k theta + k3 theta**3 [N m]; where a linear one's zero is elsewhere, the rest is a constant."""
    return stiffness * theta + cubic_stiffness * theta * theta * theta


EFFECT = Effect(
    id="spring_load",
    stage="parallel_torque",
    tier=1,
    title="A spring against the motion",
    equation="M = k theta + k3 theta^3",
    source=(
        "Hooke; Duffing, Erzwungene Schwingungen (1918); the return spring of valves and single-acting cylinders: Merritt, Hydraulic"
        " Control Systems (1967)"
    ),
    trace="the mean of both sweep branches rises with the angle, all along it",
    coordinate="steering angle",
    parameters=(
        Parameter("stiffness", "N m/rad", "stiffness where the position is zero", 1000.0, -5e5, 5e5),
        Parameter("cubic_stiffness", "N m/rad^3", "how it stiffens, k3, below zero softens", 1e5, -1e10, 1e10, optional=True),
    ),
    hooks={"torque": torque},
    acts_by=("stiffness", "cubic_stiffness"),
    rivals=("end_stop", "soil_shear"),
    needs=("contact",),
    joint_title="Spring, or another force in proportion to the position",
    of_every_joint=True,
    of_line=True,
)
