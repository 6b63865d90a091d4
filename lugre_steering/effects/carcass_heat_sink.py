# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The tread gives heat to the carcass behind it."""

from __future__ import annotations

from lugre_steering.chain.compiled import exp, law
from lugre_steering.effects.entry import Effect, Parameter


@law
def heat_out(temperature, heat_capacity, dt, conductance, capacity, carcass_temperature):
    """Exact exchange of two lumps over ``dt``: both tend to their mean temperature with k (1/C + 1/C_b)."""
    mean = (heat_capacity * temperature + capacity * carcass_temperature) / (heat_capacity + capacity)
    rate = conductance * (1.0 / heat_capacity + 1.0 / capacity)
    decay = exp(-rate * dt)
    return mean + (temperature - mean) * decay, mean + (carcass_temperature - mean) * decay


EFFECT = Effect(
    id="carcass_heat_sink",
    stage="thermal",
    tier=1,
    title="The tread gives heat to the carcass behind it",
    equation="C dT/dt = P - ... - k (T - T_b), C_b dT_b/dt = k (T - T_b)",
    source="two-node heat balance; Carslaw and Jaeger, Conduction of Heat in Solids (1959)",
    trace="friction recovers in pauses, the decline bends",
    coordinate="rubber temperature",
    parameters=(
        Parameter("conductance", "W/K", "heat conductance between tread and carcass", 200.0, 0.0, 1e5),
        Parameter("capacity", "J/K", "heat capacity of the carcass node", 2e4, 500.0, 1e7, (5000.0, 2e4, 1e5)),
    ),
    hooks={"heat_out": heat_out},
    rivals=("flash_temperature", "heat_partition", "stress_relaxation", "wear_polishing"),
    memory={"carcass_temperature": "rubber_temperature"},  # second thermal node [degC]
    needs=("rubber",),
    counts_from_start=True,
)
