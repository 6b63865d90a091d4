# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Trapped oil leaks away at standstill."""

from __future__ import annotations

from lugre_steering.chain.compiled import exp, law
from lugre_steering.effects.entry import Effect, Parameter


@law
def limit(torque, dt, resting, share, time_constant, refill_time, leaked):
    """torque (1 - share leaked): leaked goes to 1 with tau at rest and back to 0 with ``refill_time`` in motion."""
    if resting:
        leaked += (1.0 - leaked) * (1.0 - exp(-dt / time_constant))
    elif refill_time > 0.0:
        leaked *= exp(-dt / refill_time)
    else:
        leaked = 0.0
    return torque * (1.0 - share * leaked), leaked


EFFECT = Effect(
    id="trapped_pressure",
    stage="measurement",
    tier=2,
    title="Trapped oil leaks away at standstill",
    equation="M (1 - share (1 - exp(-dwell / tau))), refilled in motion",
    source="Merritt 1967 (leakage of a blocked cylinder)",
    trace="exponential decay in holds",
    coordinate="dwell",
    parameters=(
        Parameter("share", "1", "share of the torque lost in the end", 0.05, 0.0, 1.0),
        Parameter("time_constant", "s", "time constant of the leak", 5.0, 0.2, 500.0, (1.0, 4.0, 15.0)),
        Parameter("refill_time", "s", "time until the torque is back in motion", 0.1, 0.0, 2.0, optional=True),
    ),
    hooks={"limit": limit},
    memory={"leaked": 0.0},  # how far trapped oil has leaked away, 0 ... 1
    needs=("hydraulics",),
)
