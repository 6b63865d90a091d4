# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The cylinder arms differ from the drawing."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def arm(theta, linear, quadratic):
    """True arm over that of the drawing: 1 + linear theta + quadratic theta**2."""
    return 1.0 + linear * theta + quadratic * theta * theta


EFFECT = Effect(
    id="moment_arm_error",
    stage="measurement",
    tier=1,
    title="The cylinder arms differ from the drawing",
    equation="true arm = arm (1 + linear theta + quadratic theta^2)",
    source="linkage geometry; Sharp and Granger 2003",
    trace="multiplies the torque by an even function of the angle",
    coordinate="steering angle",
    parameters=(
        Parameter("linear", "1/rad", "odd part of the arm error", 0.05, -2.0, 2.0),
        Parameter("quadratic", "1/rad^2", "even part of the arm error", 0.1, -5.0, 5.0),
    ),
    hooks={"arm": arm},
    needs=("hydraulics",),
)
