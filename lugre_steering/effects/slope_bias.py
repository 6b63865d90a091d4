# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Constant torque from standing on a slope."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def bias(torque, sides):
    """Constant torque [N m], shared by the tracks."""
    return torque / sides


EFFECT = Effect(
    id="slope_bias",
    stage="parallel_torque",
    tier=1,
    title="Constant torque from standing on a slope",
    equation="M = torque",
    source="gravity through the kingpin offset",
    trace="constant, at rest too",
    coordinate="none (constant)",
    parameters=(
        Parameter("torque", "N m", "torque of the vehicle", 200.0, -3e4, 3e4),
    ),
    hooks={"torque": bias},
    joint_title="Constant offset",
    one_sided=True,
    of_every_joint=True,
)
