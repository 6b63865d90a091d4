# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Slow pressure sensors or filters."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def lag(tau):
    """Time constant of the sensors [s]; the lag itself is ``chain.lag``."""
    return tau


EFFECT = Effect(
    id="pressure_lag",
    stage="measurement",
    tier=1,
    title="Slow pressure sensors or filters",
    equation="tau dp_m/dt + p_m = p",
    source="first-order lag",
    trace="proportional to dM/dt, in transients",
    coordinate="torque rate",
    parameters=(
        Parameter("tau", "s", "time constant", 0.01, 0.0, 2.0),
    ),
    hooks={"lag": lag},
    rivals=("time_delay", "yaw_inertia"),
    joint_title="Slow torque sensor or filter",
)
