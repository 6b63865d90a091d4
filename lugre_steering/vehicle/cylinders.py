# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Cylinders of a vehicle: from line pressures to torque on the steering axis."""

from __future__ import annotations

import numpy as np

from lugre_steering.chain.hydraulics import moment_arm
from lugre_steering.recording import Array
from lugre_steering.vehicle.sections import Hydraulics, Vehicle

ATMOSPHERE_PA = 101_325.0


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
        arm = moment_arm.py_func(theta[side], row[1], row[2], row[3], row[4])  # type: ignore[attr-defined]
        for area, line in ((areas[0], lines[0]), (-areas[1], lines[1])):
            if line >= 0:
                gains[side, line] += vehicle.sensors.pressure_gain * area * arm
    return gains


def gauge_offset(vehicle: Vehicle) -> float:
    """What to subtract from a measured pressure to get gauge pressure [Pa]."""
    return ATMOSPHERE_PA if vehicle.sensors.pressure_reference == "absolute" else 0.0
