# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The test bench of the published experiments: the vehicle calibrated to the four extremes, and runs of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from lugre_steering.errors import DataError
from lugre_steering.recording import Array
from lugre_steering.simulate import plant
from lugre_steering.simulate.manoeuvres import BUILT_IN, LIMIT_DEG, Manoeuvre, Motion, cycles, motion_of
from lugre_steering.vehicle import Initial, Vehicle

PUBLISHED_EXTREMES_NM = (49_980.0, 48_740.0, 48_580.0, 46_510.0)
"""Liang et al. 2022, section 4.2: largest torque at tc, tf, ti, tl."""
RATES_DEG_S = (2.0, 4.0, 6.0, 8.0, 10.0)
MOVING_RAD_S = 1e-3


@dataclass(frozen=True)
class Bench:
    """A vehicle whose friction level and heat capacity were fitted to the published extremes, with the fitted
    values."""

    vehicle: Vehicle
    calibrated: Mapping[str, float]


def original(vehicle: Vehicle) -> Vehicle:
    """The original LuGre model: without rubber data, stiffness and friction stay at the reference temperature."""
    return vehicle.replace(rubber=None)


def at_temperature(vehicle: Vehicle, temperature_degC: float) -> Vehicle:
    """The vehicle with rubber and air at this temperature at the start."""
    return vehicle.replace(initial=Initial(temperature_degC, temperature_degC))


def scaled(vehicle: Vehicle, friction_level: float, heat_capacity: float) -> Vehicle:
    """Both friction coefficients, and the heat capacity (through the specific heat), times a factor."""
    friction, rubber = vehicle.friction, vehicle.rubber
    if friction is None or friction.static is None or friction.coulomb is None or rubber is None:
        raise DataError(
            f"vehicle '{vehicle.name}': the published experiments need axle, track, friction and rubber sections"
        )
    return vehicle.replace(
        friction=dataclasses.replace(
            friction, static=friction.static * friction_level, coulomb=friction.coulomb * friction_level
        ),
        rubber=dataclasses.replace(rubber, specific_heat_J_kgK=rubber.specific_heat_J_kgK * heat_capacity),
    )


def build(vehicle: Vehicle) -> Bench:
    """Least-squares fit of friction level and heat capacity, the only two parameters that the acceptance lets move."""
    if vehicle.effects:
        names = ", ".join(effect.id for effect in vehicle.effects)
        raise DataError(
            f"effects: got {names}, expected none: the published experiments show the model without additions"
        )
    scaled(vehicle, 1.0, 1.0)  # refuses a vehicle without the sections that the fit moves
    motion = motion_of(BUILT_IN["double-cycle"], vehicle)
    published = np.array(PUBLISHED_EXTREMES_NM)

    def misfit(factors: Array) -> Array:
        return np.asarray(extremes(plant.run(scaled(vehicle, *factors), motion)) / published - 1.0)

    fit = least_squares(misfit, [1.0, 1.0], bounds=([0.2, 0.1], [5.0, 10.0]))
    level, capacity = map(float, fit.x)
    fitted = scaled(vehicle, level, capacity)
    assert fitted.friction is not None
    assert fitted.rubber is not None
    values = {
        "friction level factor": level,
        "static friction": float(fitted.friction.static or 0.0),
        "Coulomb friction": float(fitted.friction.coulomb or 0.0),
        "heat capacity factor": capacity,
        "specific heat (J/kgK)": fitted.rubber.specific_heat_J_kgK,
    }
    return Bench(fitted, values)


def full_cycles(vehicle: Vehicle, rate_deg_s: float, count: int) -> Motion:
    """``count`` cycles between the limits at one rate, held at each limit as in the double steering cycle."""
    return motion_of(Manoeuvre("cycles", "", cycles(LIMIT_DEG, rate_deg_s, count)), vehicle)


def sweeps(motion: Motion) -> list[slice]:
    """The stretches in which the tracks move."""
    moving = np.abs(motion.rate[0]) > MOVING_RAD_S
    edges = np.flatnonzero(np.diff(moving.astype(int), prepend=0, append=0))
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def moving(motion: Motion) -> slice | Array:
    """Indices of all samples in motion."""
    return np.concatenate([np.arange(s.start, s.stop) for s in sweeps(motion)])


def extremes(truth: plant.Truth) -> Array:
    """Largest torque [N m] in the direction of travel of each of the first four sweeps (4,)."""
    return largest(truth)[:4]


def largest(truth: plant.Truth) -> Array:
    """Largest torque [N m] in the direction of travel of each sweep; what is left of the last sweep's does not
    count."""
    return np.array([(direction(truth.motion, s) * truth.torque[s]).max() for s in sweeps(truth.motion)])


def direction(motion: Motion, sweep: slice) -> float:
    """+1 for a sweep to the left, -1 to the right."""
    return float(np.sign(motion.theta[0, sweep.stop - 1] - motion.theta[0, sweep.start]))


def arrivals(truth: plant.Truth) -> Array:
    """Size of the torque [N m] on arrival at the end of each sweep."""
    return np.array([abs(truth.torque[s.stop - 1]) for s in sweeps(truth.motion)])
