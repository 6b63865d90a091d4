# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Jacking torque of the inclined kingpin."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def torque(theta, amplitude, cosine, second_harmonic, even):
    """amplitude sin(theta) + cosine cos(theta) + second_harmonic sin(2 theta) + even sin(theta)**2 [N m]."""
    sine, cos = math.sin(theta), math.cos(theta)
    return sine * (amplitude + 2.0 * second_harmonic * cos) + cosine * cos + sine * sine * even


EFFECT = Effect(
    id="kingpin_jacking",
    stage="parallel_torque",
    tier=1,
    title="Jacking torque of the inclined kingpin",
    equation="M = amplitude sin(theta) + cosine cos(theta) + second_harmonic sin(2 theta) + even sin(theta)^2",
    source="Reimpell, Stoll, Betzler, The Automotive Chassis (2001); Pacejka, Tire and Vehicle Dynamics, ch. 9",
    trace="the mean of both sweep branches is a function of the angle",
    coordinate="steering angle",
    parameters=(
        Parameter("amplitude", "N m", "amplitude of one track", 500.0, -5e4, 5e4),
        Parameter("cosine", "N m", "weight of a joint whose zero is level", 300.0, -5e4, 5e4, far_turning=True),
        Parameter("second_harmonic", "N m", "second harmonic of one track", 300.0, -5e4, 5e4, optional=True),
        Parameter("even", "N m", "caster part of one track", 300.0, -5e4, 5e4, optional=True),
    ),
    hooks={"torque": torque},
    acts_by=("amplitude", "cosine", "second_harmonic", "even"),
    rivals=("moment_arm_error", "soil_shear"),
    joint_title="Gravity or another conservative torque of the angle",
    one_sided=True,
    of_angle=True,
    of_every_joint=True,
)
