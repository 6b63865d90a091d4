# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A centring detent: a spring-loaded ball that holds the steering in the middle. Example of an effect in a package."""

import math

from lugre_steering.effects import Effect, Parameter, law


@law
def torque(theta, hold, width):
    """hold x exp((1 - x^2) / 2), x = theta / width: largest, ``hold`` [N m], at the angle ``width`` [rad]."""
    x = theta / width
    return hold * x * math.exp(0.5 * (1.0 - x * x))


EFFECT = Effect(
    id="centre_detent",
    stage="parallel_torque",
    tier=2,
    title="Centring detent",
    equation="M = hold x exp((1 - x^2) / 2), x = theta / width",
    source="example",
    trace="pulls toward the middle close to it, nothing farther out",
    coordinate="steering angle",
    parameters=(
        Parameter("hold", "N m", "largest torque of one track", 500.0, 0.0, 2e4),
        Parameter("width", "rad", "angle of the largest torque", 0.03, 0.005, 0.3, (0.015, 0.03, 0.06)),
    ),
    hooks={"torque": torque},
    rivals=("kingpin_jacking",),
)
