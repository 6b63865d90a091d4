# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Pressures stamped late or early."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def late(delay):
    """Pressures stamped ``delay`` [s] late."""
    return delay


EFFECT = Effect(
    id="time_delay",
    stage="motion",
    tier=1,
    title="Pressures stamped late or early",
    equation="p(t) recorded at t + delay",
    source="clock skew of acquisition devices",
    trace="proportional to dM/dt, both signs",
    coordinate="torque rate",
    parameters=(
        Parameter("delay", "s", "how late the pressures are stamped", 0.01, -0.5, 0.5),
    ),
    hooks={"delay": late},
    rivals=("yaw_inertia",),
    joint_title="Torque stamped late or early",
)
