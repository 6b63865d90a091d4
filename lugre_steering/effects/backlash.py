# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Free play between angle sensor and track."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter

FLANK_TORQUE_NM = 100.0
"""Torque over which a gap changes flanks, on machines of the size of a vehicle; ``softness`` adds to it."""

SATURATED = 20.0
"""From here on tanh is one in double precision."""


@law
def wind_up(torque, width, softness, torque_unit):
    """Angle lost [rad] = width / 2 tanh(M / flank torque), and its slope [rad/(N m)]: the flank changes where M changes sign."""
    flank = FLANK_TORQUE_NM * torque_unit + softness
    ratio = torque / flank
    if ratio > SATURATED:  # as tanh says, to the last bit; branches are foretold, so that no step waits for its torque
        return 0.5 * width, 0.0
    if ratio < -SATURATED:
        return -0.5 * width, 0.0
    side = math.tanh(ratio)
    return 0.5 * width * side, 0.5 * width / flank * (1.0 - side * side)


EFFECT = Effect(
    id="backlash",
    stage="motion",
    tier=1,
    title="Free play between angle sensor and track",
    equation=(
        "contact angle = theta_m - width / 2 tanh(M / (flank + softness)); the gap opens where the torque "
        "changes sign"
    ),
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities (1996)",
    trace="flat, near-zero torque after each sign change of the torque, then a delayed build-up",
    coordinate="torque sign change",
    parameters=(
        Parameter("width", "rad", "full width of the gap", 0.006, 0.0, 0.1),
        Parameter(
            "softness", "N m", "torque over which a flank gives, beyond 100 N m at a vehicle", 500.0, 0.0, 2e4, optional=True,
        ),
    ),
    hooks={"wind_up": wind_up},
    rivals=("linkage_compliance",),
    counts_from_start=True,
    play="width",
    joint_title="Free play between sensor and joint",
)
