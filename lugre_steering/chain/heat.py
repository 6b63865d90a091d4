# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Friction power heats the tread rubber."""

from __future__ import annotations

from lugre_steering.chain.compiled import exp, law

LONG = 0.1
"""Half the decay exponent of a step beyond which ``heat`` leaves the trapezoidal rule."""


@law
def short_heat(temperature: float, energy: float, dt: float, capacity: float, cooling: float, air: float) -> float:
    """``heat`` over an ordinary step: trapezoidal in the cooling.

    (temperature (1 - k) + 2 k air + energy / capacity) / (1 + k), without dividing what the step before must have made:
    the time of a step is that of its longest chain of operations.
    """
    k = 0.5 * cooling * dt / capacity
    share, warmth = 1.0 / (1.0 + k), 1.0 / capacity
    return temperature * ((1.0 - k) * share) + 2.0 * k * share * air + energy * (warmth * share)


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
