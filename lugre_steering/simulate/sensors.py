# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Sensors: sampling with jitter, white noise, quantisation, and the sensor effects of the vehicle file."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lugre_steering.chain.lag import lagged
from lugre_steering.errors import DataError
from lugre_steering.given_number import check_number
from lugre_steering.recording import Array, IntArray, Signal
from lugre_steering.simulate.manoeuvres import STEP_S
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.cylinders import gauge_offset
from lugre_steering.vehicle.sensors import delay_s, lag_s, line_error

_RANGES = {
    "angle_rate_Hz": (1.0, 1000.0),
    "pressure_rate_Hz": (1.0, 1000.0),
    "jitter_s": (0.0, 0.1),
    "angle_noise_deg": (0.0, 10.0),
    "angle_resolution_deg": (0.0, 10.0),
    "pressure_noise_Pa": (0.0, 1e8),
    "pressure_resolution_Pa": (0.0, 1e8),
}


@dataclass(frozen=True)
class Sensing:
    """How the recording is made; noise as one standard deviation, 0 resolution = no quantisation."""

    angle_rate_Hz: float = 100.0
    pressure_rate_Hz: float = 100.0
    jitter_s: float = 0.0
    angle_noise_deg: float = 0.01
    angle_resolution_deg: float = 0.0
    pressure_noise_Pa: float = 1.5e4
    pressure_resolution_Pa: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            check_number(name, getattr(self, name), low, high)
        check_number("seed", self.seed, 0, whole=True)


def instants(duration_s: float, rate_Hz: float, jitter_s: float, rng: np.random.Generator) -> Array:
    """Sampling instants (m,) [s]: uniform with Gaussian jitter, clipped to 0.4 periods so that they stay in order."""
    grid = np.arange(0.0, duration_s, 1.0 / rate_Hz)
    shift = np.clip(rng.normal(0.0, jitter_s, grid.size), -0.4 / rate_Hz, 0.4 / rate_Hz) if jitter_s > 0.0 else 0.0
    return np.maximum(grid + shift, 0.0)


def quantised(value: Array, resolution: float) -> Array:
    """Rounded to whole steps of ``resolution`` (0: as it is)."""
    return np.round(value / resolution) * resolution if resolution > 0.0 else value


def sense_angle(time: Array, theta: Array, sensing: Sensing, rng: np.random.Generator) -> Signal:
    """What an encoder records of true angles ``theta`` (n,) [rad]."""
    at = instants(float(time[-1]), sensing.angle_rate_Hz, sensing.jitter_s, rng)
    value = np.interp(at, time, theta) + math.radians(sensing.angle_noise_deg) * rng.standard_normal(at.size)
    return Signal(at, quantised(value, math.radians(sensing.angle_resolution_deg)))


def sense_pressure(
    time: Array, pressure: Array, line: str, vehicle: Vehicle, sensing: Sensing, rng: np.random.Generator
) -> Signal:
    """What the sensor of one line records of true gauge pressures (n,) [Pa]: lag, late stamps, offset and drift if
    the vehicle
    has these effects, then noise and quantisation."""
    seen = lagged(pressure, STEP_S, lag_s(vehicle))
    at = instants(float(time[-1]), sensing.pressure_rate_Hz, sensing.jitter_s, rng)
    value = np.interp(at - delay_s(vehicle), time, seen) + gauge_offset(vehicle)
    value += line_error(vehicle, line, at)
    value += sensing.pressure_noise_Pa * rng.standard_normal(at.size)
    limit = vehicle.sensors.pressure_range_Pa
    if float(value.max()) > limit:
        raise DataError(
            f"line '{line}': the manoeuvre needs {value.max() / 1e6:.1f} MPa, beyond sensors.pressure_range_Pa "
            f"({limit / 1e6:.1f} MPa)"
        )
    return Signal(at, quantised(value, sensing.pressure_resolution_Pa))


def sense_torque(time: Array, torque: Array, vehicle: Vehicle, sensing: Sensing, rng: np.random.Generator) -> Signal:
    """What the torque sensor records of the true torque (n,) [N m]: lag and late stamps if the vehicle has them, noise."""
    assert vehicle.torque_sensor is not None
    seen = lagged(torque, STEP_S, lag_s(vehicle))
    at = instants(float(time[-1]), sensing.pressure_rate_Hz, sensing.jitter_s, rng)
    value = np.interp(at - delay_s(vehicle), time, seen)
    return Signal(at, value + vehicle.torque_sensor.noise_Nm * rng.standard_normal(at.size))


def nanoseconds(time_s: Array, start_ns: int) -> IntArray:
    """Header stamps (m,) [ns] of times since the start."""
    return start_ns + np.round(time_s * 1e9).astype(np.int64)
