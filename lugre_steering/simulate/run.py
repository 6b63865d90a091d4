# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One simulated recording: true motion -> chain -> actuation -> sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lugre_steering.recording import Array, Channel, Kind, Signal
from lugre_steering.simulate import plant
from lugre_steering.simulate.manoeuvres import Motion
from lugre_steering.simulate.sensors import Sensing, sense_angle, sense_pressure, sense_torque
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.actuation import line_pressures, total_gains
from lugre_steering.vehicle.sensors import true_angle

AIR_RATE_HZ = 1.0


@dataclass(frozen=True)
class Simulated:
    """A synthetic recording: what the sensors saw (one signal per input channel of the vehicle) and the truth behind
    it."""

    vehicle: Vehicle
    truth: plant.Truth
    pressures: Array
    signals: Mapping[Channel, Signal]


def sensing_of(vehicle: Vehicle) -> Sensing:
    """Noise and resolution as the vehicle's sensors section says."""
    s = vehicle.sensors
    return Sensing(
        angle_noise_deg=s.angle_noise_deg,
        angle_resolution_deg=s.angle_resolution_deg,
        pressure_noise_Pa=s.pressure_noise_Pa,
    )


def simulate(vehicle: Vehicle, motion: Motion, sensing: Sensing) -> Simulated:
    """Drive the motion with this vehicle and record it; equal arguments give equal numbers."""
    truth = plant.run(vehicle, motion)
    pressures = np.zeros((0, motion.time.size))
    if vehicle.hydraulics is not None:
        pressures = line_pressures(truth.torque, total_gains(vehicle, true_angle(vehicle, motion.theta)))
    rng = np.random.default_rng(sensing.seed)
    signals: dict[Channel, Signal] = {}
    for channel in vehicle.channels:
        if channel.ackermann != 0.0:
            continue  # this track has no sensor of its own
        if channel.kind is Kind.ANGLE:
            theta = motion.theta[vehicle.sides.index(channel.name)]
            signals[channel] = sense_angle(motion.time, theta, sensing, rng)
        elif channel.kind is Kind.PRESSURE:
            assert vehicle.hydraulics is not None
            row = pressures[vehicle.hydraulics.lines.index(channel.name)]
            signals[channel] = sense_pressure(motion.time, row, channel.name, vehicle, sensing, rng)
        elif channel.kind is Kind.TORQUE:
            signals[channel] = sense_torque(motion.time, truth.torque, vehicle, sensing, rng)
        elif vehicle.initial is not None:
            at = np.arange(0.0, motion.time[-1], 1.0 / AIR_RATE_HZ)
            signals[channel] = Signal(at, np.full(at.size, vehicle.initial.air_temperature_degC))
    return Simulated(vehicle, truth, pressures, signals)
