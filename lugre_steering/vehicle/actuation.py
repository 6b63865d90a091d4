# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Actuation: the line pressures with which the cylinders deliver a wanted steering torque."""

from __future__ import annotations

import numpy as np

from lugre_steering.errors import DataError
from lugre_steering.recording import Array
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.cylinders import line_gains
from lugre_steering.vehicle.sensors import arm_factor

RETURN_PRESSURE_PA = 0.7e6


def total_gains(vehicle: Vehicle, theta: Array) -> Array:
    """Torque on the steering axis per pressure of each line [N m/Pa] (lines, n), both tracks together; theta (sides,
    n) [rad].

    The true arms are those of the drawing times what the effects of the vehicle file say.
    """
    factor = arm_factor(vehicle, theta) * np.ones_like(theta)
    gains: Array = (line_gains(vehicle, theta) * factor[:, None, :]).sum(axis=0)
    return gains


def line_pressures(torque: Array, gains: Array, return_Pa: float = RETURN_PRESSURE_PA) -> Array:
    """Gauge pressures (lines, n) [Pa] whose cylinder torque equals ``torque`` (n,) [N m]: sum of gains * pressure.

    Lines that push the wanted way share one supply pressure (main and auxiliary circuit carry the load together); the
    others
    stay at the return pressure.
    """
    missing = torque - gains.sum(axis=0) * return_Pa
    pushing = np.sign(gains) == np.where(missing >= 0.0, 1.0, -1.0)
    gain = np.where(pushing, gains, 0.0).sum(axis=0)
    if not np.all(np.abs(gain) > 0.0):
        raise DataError("hydraulics.cylinders: at some steering angle no line can push the way the torque asks for")
    pressures: Array = return_Pa + np.where(pushing, missing / gain, 0.0)
    return pressures
