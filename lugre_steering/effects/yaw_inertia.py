# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Yaw inertia of the track assemblies."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def torque(alpha, inertia):
    """J alpha [N m]."""
    return inertia * alpha


EFFECT = Effect(
    id="yaw_inertia",
    stage="parallel_torque",
    tier=1,
    title="Yaw inertia of the track assemblies",
    equation="M = J alpha",
    source="Newton-Euler",
    trace="starts, stops and shakes",
    coordinate="steering acceleration",
    parameters=(
        Parameter("inertia", "kg m2", "inertia of one track about its hinge", 200.0, 0.0, 1e5),
    ),
    hooks={"torque": torque},
    joint_title="Inertia of the moving parts",
    of_every_joint=True,
)
