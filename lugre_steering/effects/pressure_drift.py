# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A pressure sensor drifts."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def line(elapsed, drift):
    """Error of the reading that grows with time [Pa]."""
    return drift * elapsed


EFFECT = Effect(
    id="pressure_drift",
    stage="measurement",
    tier=1,
    title="A pressure sensor drifts",
    equation="p_line += rate t",
    source="sensor data sheets",
    trace="grows with time, at rest too",
    coordinate="time",
    parameters=(
        Parameter("drift", "Pa/s", "rate of the reading's error", 1000.0, -1e5, 1e5),
    ),
    hooks={"line": line},
    rivals=("pressure_offset", "slope_bias"),
    needs=("hydraulics",),
    per_line=True,
    counts_from_start=True,
)
