# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Unit labels in the generalised coordinate and force of a vehicle: a linear axis counts 1 m as 1 rad, 1 N as 1 N m."""

from __future__ import annotations

import re

from lugre_steering.effects.entry import Effect
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


_JOINT_TITLES = {
    "yaw_inertia": "Inertia of the moving parts",
    "viscous_friction": "Viscous friction",
    "slope_bias": "Constant offset",
    "direction_asymmetry": "Friction differs between the two directions",
    "kingpin_jacking": "Gravity or another conservative torque of the angle",
    "time_delay": "Torque stamped late or early",
    "pressure_lag": "Slow torque sensor or filter",
    "linkage_compliance": "Elastic transmission between sensor and joint",
    "backlash": "Free play between sensor and joint",
    "surface_patch": "Friction differs within a range or from a time on",
    "cylinder_friction": "Friction of seals and bearings",
    "end_stop": "Elastic end stop",
}


def title(vehicle: Vehicle, effect: Effect) -> str:
    """The title of a catalogue entry in words that fit this vehicle: a single joint has no tracks and no kingpin."""
    return effect.title if vehicle.contact is None else _JOINT_TITLES.get(effect.id, effect.title)


def coordinate_label(vehicle: Vehicle) -> str:
    """'steering angle [rad]', 'position [m]'."""
    return f"{vehicle.coordinate.name} [{vehicle.coordinate.unit}]"
