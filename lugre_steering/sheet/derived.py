# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle file amounts to: loads, friction, stiffness, heat and inputs, before anything is recorded."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from lugre_steering import units
from lugre_steering.recording import Kind
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.footprint import contact_lengths, peak_pressure
from lugre_steering.vehicle.loads import load_moment, roller_loads, vertical_load
from lugre_steering.vehicle.model import baseline_parameters
from lugre_steering.vehicle.plausible import plausibility


def derive(vehicle: Vehicle) -> dict[str, Any]:
    """Quantities (name, value or values, unit) of one track or joint, the topics it listens to, its effects, and what in it is
    unlike any real vehicle."""
    quantities = [
        {"quantity": units.words(vehicle, name), "value": value, "unit": units.label(vehicle, unit)}
        for name, value, unit in (*_loads(vehicle), *_friction(vehicle), *_heat(vehicle))
    ]
    inputs = [
        {"channel": channel.name, "topic": channel.topic, "joint": channel.joint or None, "optional": channel.kind is Kind.AIR_TEMPERATURE}
        for channel in vehicle.channels
    ]
    effects = [{"id": entry.id, "parameters": entry.parameters} for entry in vehicle.effects]
    warnings = [asdict(doubt) for doubt in plausibility(vehicle)]
    return {"vehicle": vehicle.name, "quantities": quantities, "inputs": inputs, "effects": effects, "warnings": warnings}


Quantity = tuple[str, float | list[float], str]


def _loads(vehicle: Vehicle) -> Iterator[Quantity]:
    if vehicle.axle is None or vehicle.track is None:
        return
    axle, track = vehicle.axle, vehicle.track
    yield "load on the ground", vertical_load(axle, track), "N"
    yield "load of each roller", roller_loads(axle, track).tolist(), "N"
    yield "sum of load times distance from the hinge", load_moment(axle, track), "N m"
    if vehicle.rubber is not None:
        area = vehicle.rubber.contact_area_m2
        yield "contact length under each roller", contact_lengths(axle, track, area).tolist(), "m"
        yield "ground pressure, mean", vertical_load(axle, track) / area, "Pa"
        yield "ground pressure, peak", peak_pressure(axle, track, area), "Pa"


def _friction(vehicle: Vehicle) -> Iterator[Quantity]:
    values = baseline_parameters(vehicle)
    sigma_0 = values["sigma_0"]
    yield "static friction torque at reference temperature", values["static_torque"], "N m"
    yield "sliding friction torque at reference temperature", values["coulomb_torque"], "N m"
    yield "presliding stiffness", sigma_0, "N m/rad"
    yield "presliding length", values["coulomb_torque"] / sigma_0, "rad"
    yield "presliding damping", values["damping_factor"] * math.sqrt(sigma_0), "N m s/rad"
    yield "Stribeck speed", values["stribeck_speed"], "rad/s"
    if values.get("aligning_torque"):
        yield "aligning torque per sine of the angle", values["aligning_torque"], "N m"


def _heat(vehicle: Vehicle) -> Iterator[Quantity]:
    if vehicle.rubber is None:
        return
    values = baseline_parameters(vehicle)
    yield "heat capacity of the tread", values["heat_capacity"], "J/K"
    yield "warming while sliding, without cooling", values["coulomb_torque"] / values["heat_capacity"], "K/rad"
    if values["cooling"] > 0.0 and math.isfinite(time := values["heat_capacity"] / values["cooling"]):
        yield "time constant of cooling", time, "s"
