# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Hot spots at the asperities while sliding."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import exp, law
from lugre_steering.effects.entry import Effect, Parameter


@law
def friction_temperature(resistance, power):
    """R times the low-passed friction power [K]."""
    return resistance * power, power


@law
def heat_out(temperature, energy, dt, time_constant, saturation_power, power):
    """The low-passed power P / sqrt(1 + P / saturation_power) for the next step; the rubber itself is not changed."""
    if dt > 0.0:
        decay = exp(-dt / time_constant)
        now = energy * (1.0 / dt)  # no division waits for another: the energy is known last
        growth = 1.0 + now * (1.0 / saturation_power)
        now *= math.sqrt(growth) * (1.0 / growth)
        power = now + (power - now) * decay
    return temperature, power


EFFECT = Effect(
    id="flash_temperature",
    stage="thermal",
    tier=2,
    title="Hot spots at the asperities while sliding",
    equation="friction reads T + R P / sqrt(1 + P / saturation_power), low-passed with tau",
    source="Persson, J. Phys.: Condens. Matter 18 (2006) 7789; Greenwood, Wear 150 (1991) 153",
    trace="plateaus fall with the power, within a second, and recover at once",
    coordinate="friction power",
    parameters=(
        Parameter("resistance", "K/W", "temperature rise per friction power of one track", 0.001, 0.0, 0.1),
        Parameter("time_constant", "s", "time constant of the flash", 0.5, 0.05, 20.0, (0.3, 3.0)),
        Parameter(
            "saturation_power", "W", "power beyond which it grows with the root (large Peclet number)",
            500.0, 10.0, 1e7, (100.0, 1e5),
        ),
    ),
    hooks={"friction_temperature": friction_temperature, "heat_out": heat_out},
    rivals=("wear_polishing",),
    memory={"power": 0.0},  # low-passed friction power [W]
    needs=("rubber",),
    counts_from_start=True,
)
