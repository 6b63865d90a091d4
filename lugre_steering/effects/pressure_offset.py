# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A pressure sensor reads a constant too much."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def line(offset):
    """Constant error of the reading [Pa]."""
    return offset


EFFECT = Effect(
    id="pressure_offset",
    stage="measurement",
    tier=1,
    title="A pressure sensor reads a constant too much",
    equation="p_line += offset",
    source="sensor data sheets",
    trace="at rest too, follows the moment arm of that line",
    coordinate="line",
    parameters=(
        Parameter("offset", "Pa", "reading minus true pressure", 5e4, -5e6, 5e6),
    ),
    hooks={"line": line},
    rivals=("slope_bias",),
    needs=("hydraulics",),
    per_line=True,
)
