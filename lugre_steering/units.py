# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Unit labels in the generalised coordinate and force of a vehicle: a linear axis counts 1 m as 1 rad, 1 N as 1 N m."""

from __future__ import annotations

import re

from lugre_steering.vehicle import Vehicle

_MASS = {("m", "N"): "kg"}
"""Unit of force over acceleration where it has a name of its own; kg m2 for joints."""


def label(vehicle: Vehicle, unit: str) -> str:
    """A catalogue unit as this vehicle's reports must write it: for a linear axis 'N m s/rad' -> 'N s/m'.

    Replaces the torque 'N m' and the angle 'rad' by the force and coordinate unit of ``vehicle.coordinate``; everything
    else (s, 1, W, K, Pa) stays.
    """
    coordinate, force = vehicle.coordinate.unit, vehicle.coordinate.force_unit
    if (coordinate, force) == ("rad", "N m"):
        return unit
    if unit == "kg m2":
        return _MASS.get((coordinate, force), f"{force} s2/{coordinate}")
    text = re.sub(r"\(N m\)|\bN m\b", force, unit)
    return re.sub(r"\brad(?=\b|\d)", coordinate, text)


def coordinate_label(vehicle: Vehicle) -> str:
    """'steering angle [rad]', 'position [m]'."""
    return f"{vehicle.coordinate.name} [{vehicle.coordinate.unit}]"
