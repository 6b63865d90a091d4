# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The air warms or cools during the recording."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def air(dt, rate, elapsed):
    """rate t [K], t from the beginning of the drift."""
    elapsed += dt
    return rate * elapsed, elapsed


EFFECT = Effect(
    id="ambient_drift",
    stage="thermal",
    tier=2,
    title="The air warms or cools during the recording",
    equation="T_air = T_air0 + rate t",
    source="test conditions",
    trace="slow change of the level with time",
    coordinate="time",
    parameters=(
        Parameter("rate", "K/s", "rate of the air temperature", 0.05, -1.0, 1.0),
    ),
    hooks={"air": air},
    rivals=("carcass_heat_sink",),
    memory={"elapsed": 0.0},  # since it began [s]
    needs=("rubber",),
    counts_from_start=True,
)
