# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Thermal stage: friction power heats the tread rubber."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import exp, law

LONG = 0.1
"""Half the decay exponent of a step beyond which ``heat`` leaves the trapezoidal rule."""


@law
def short_heat(temperature: float, energy: float, dt: float, capacity: float, cooling: float, air: float) -> float:
    """``heat`` over an ordinary step: trapezoidal in the cooling."""
    k = 0.5 * cooling * dt / capacity
    return (temperature * (1.0 - k) + 2.0 * k * air + energy / capacity) / (1.0 + k)


@law
def heat(temperature: float, energy: float, dt: float, capacity: float, cooling: float, air: float) -> float:
    """Rubber temperature [degC] after ``energy`` [J] over ``dt`` [s]: rho c A h dT/dt = P - lambda A (T - T_air).

    Exact for constant power over a gap so long that the trapezoidal rule would overshoot the air. Reconstructed (R)
    from Liang et al. 2022, eq. 4.
    """
    k = 0.5 * cooling * dt / capacity
    if k <= LONG:
        return short_heat(temperature, energy, dt, capacity, cooling, air)
    decay = exp(-2.0 * k)
    return air + (temperature - air) * decay + energy / capacity * (1.0 - decay) / (2.0 * k)


@law
def advance_heat(p, s, energy, dt, effects):
    """Temperatures after friction released ``energy`` [J] in ``dt`` [s]: tread and, as effects, carcass and flash.

    heat_partition: (1 - ground_share) of it enters the rubber. carcass_heat_sink: a second node of its own capacity
    behind the tread, coupled by a conductance. flash_temperature: a resistance times the low-passed power, which
    beyond saturation_power counts with its root (large Peclet number), is added where friction reads the temperature.
    ambient_drift: the air warms linearly.
    """
    if not effects:
        s.temperature = heat(s.temperature, energy, dt, p.heat_capacity, p.cooling, s.air_temperature)
        return
    energy *= 1.0 - p.heat_partition_ground_share
    air = s.air_temperature + p.ambient_drift_rate * s.time
    s.temperature = heat(s.temperature, energy, dt, p.heat_capacity, p.cooling, air)
    if p.carcass_heat_sink_conductance != 0.0:
        mean = (p.heat_capacity * s.temperature + p.carcass_heat_sink_capacity * s.carcass_temperature) / (
            p.heat_capacity + p.carcass_heat_sink_capacity
        )
        rate = p.carcass_heat_sink_conductance * (1.0 / p.heat_capacity + 1.0 / p.carcass_heat_sink_capacity)
        decay = exp(-rate * dt)
        s.temperature = mean + (s.temperature - mean) * decay
        s.carcass_temperature = mean + (s.carcass_temperature - mean) * decay
    if p.flash_temperature_resistance != 0.0 and dt > 0.0:
        decay = exp(-dt / p.flash_temperature_time_constant)
        power = energy / dt
        power /= math.sqrt(1.0 + power / p.flash_temperature_saturation_power)
        s.flash_power = power + (s.flash_power - power) * decay
