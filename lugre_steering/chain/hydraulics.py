# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Cylinders: from line pressures to torque on the steering axis, through the exact pivot geometry."""

from __future__ import annotations

import numpy as np

from lugre_steering.chain.compiled import law
from lugre_steering.recording import Array
from lugre_steering.vehicle import Hydraulics, Vehicle

ATMOSPHERE_PA = 101_325.0


def cylinder_length(theta: Array, chassis_m: tuple[float, ...], knuckle_m: tuple[float, ...]) -> Array:
    """Pin-to-pin length [m] (n,) of a cylinder whose knuckle pivot turned by ``theta`` [rad] about the hinge."""
    x = knuckle_m[0] * np.cos(theta) - knuckle_m[1] * np.sin(theta)
    y = knuckle_m[0] * np.sin(theta) + knuckle_m[1] * np.cos(theta)
    return np.hypot(x - chassis_m[0], y - chassis_m[1])


@law
def moment_arm(theta, chassis_x, chassis_y, knuckle_x, knuckle_y):
    """dL/dtheta [m], exact: (chassis x knuckle(theta)) / L, from L**2 = |knuckle(theta) - chassis|**2."""
    c, s = np.cos(theta), np.sin(theta)
    x = knuckle_x * c - knuckle_y * s
    y = knuckle_x * s + knuckle_y * c
    return (chassis_x * y - chassis_y * x) / np.sqrt((x - chassis_x) ** 2 + (y - chassis_y) ** 2)


class CylinderTable:
    """Cylinder geometry as arrays for the compiled loop: one row per cylinder.

    ``geometry`` (n, 5): side index, chassis x, y, knuckle x, y; ``areas`` (n, 2): cap, rod [m2];
    ``lines`` (n, 2): line index of each chamber, -1 for tank.
    """

    def __init__(self, hydraulics: Hydraulics, sides: tuple[str, ...]) -> None:
        cylinders = list(hydraulics.cylinders.values())
        self.geometry = np.array([[sides.index(c.side), *c.chassis_m, *c.knuckle_m] for c in cylinders], float)
        cap = np.array([0.25 * np.pi * c.bore_m**2 for c in cylinders])
        rod = np.array([0.25 * np.pi * (c.bore_m**2 - c.rod_m**2) for c in cylinders])
        self.areas = np.column_stack([cap, rod])
        index = {line: i for i, line in enumerate(hydraulics.lines)} | {"tank": -1}
        self.lines = np.array([[index[c.cap], index[c.rod]] for c in cylinders], np.int64)


def line_gains(vehicle: Vehicle, theta: Array) -> Array:
    """Torque per pressure of each line [N m/Pa]: (sides, lines, n) at ``theta`` [rad] (sides, n).

    Cylinder torque = sum of gain x gauge pressure. Force of a cylinder = p_cap A_cap - p_rod A_rod, torque = force *
    dL/dtheta (virtual work).
    """
    assert vehicle.hydraulics is not None
    table = CylinderTable(vehicle.hydraulics, vehicle.sides)
    gains = np.zeros((len(vehicle.sides), len(vehicle.hydraulics.lines), theta.shape[1]))
    for row, areas, lines in zip(table.geometry, table.areas, table.lines, strict=True):
        side = int(row[0])
        # The plain NumPy form: compiling this law for arrays would take longer than any record needs.
        arm = moment_arm.py_func(theta[side], row[1], row[2], row[3], row[4])
        for area, line in ((areas[0], lines[0]), (-areas[1], lines[1])):
            if line >= 0:
                gains[side, line] += vehicle.sensors.pressure_gain * area * arm
    return gains


def gauge_offset(vehicle: Vehicle) -> float:
    """What to subtract from a measured pressure to get gauge pressure [Pa]."""
    return ATMOSPHERE_PA if vehicle.sensors.pressure_reference == "absolute" else 0.0
