# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From the vehicle description to the flat parameter record of each side."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lugre_steering.chain.compose import Composition
from lugre_steering.chain.step import Records, new_parameters
from lugre_steering.effects.law_entry import law_fields
from lugre_steering.effects.laws import slot
from lugre_steering.effects.registry import composed, effect
from lugre_steering.recording import Array
from lugre_steering.vehicle.loads import load_moment, vertical_load
from lugre_steering.vehicle.rubber import ratio_table
from lugre_steering.vehicle.sections import Vehicle
from lugre_steering.vehicle.size import FRICTION_NM, acceleration_unit, angle_unit, decade


@dataclass(frozen=True)
class Model:
    """What the compiled chain needs of a vehicle: one parameter record per side (alike), one per pressure line, and the
    rubber table."""

    composition: Composition
    parameters: tuple[Records, ...]
    lines: Records
    rubber: Array


def build_model(vehicle: Vehicle, *, lean: bool = False, more_laws: int = 0) -> Model:
    """Parameter records with the vehicle's effects and laws at their values; the others are in place and neutral, or left out
    (``lean``). ``more_laws``: places for laws that the file has not."""
    ids = [entry.id for entry in vehicle.effects] if lean else None
    composition = composed(ids, len(vehicle.laws) + more_laws)
    record = new_parameters(composition)
    lines = np.zeros(len(vehicle.hydraulics.lines) if vehicle.hydraulics is not None else 0, composition.lines)
    values: dict[str, float | Array] = {**baseline_parameters(vehicle)}
    contact = vehicle.friction or vehicle.contact
    assert contact is not None
    rubber, low, step = ratio_table(vehicle.rubber, contact.reference_temperature_degC, contact.temperature_law)
    values |= {"table_low": low, "table_step": step}
    for entry in vehicle.effects:
        known = effect(entry.id)
        if not known.per_line:
            values |= known.fields(entry.parameters)
            continue
        for name, value in entry.parameters.items():
            assert vehicle.hydraulics is not None
            lines[f"{entry.id}_{known.parameters[0].name}"][vehicle.hydraulics.lines.index(name)] = value
    for i, law in enumerate(vehicle.laws):
        values |= slot(i).fields(law_fields(law))
    for field, number in values.items():
        record[field] = number
    return Model(composition, tuple(record.copy() for _ in vehicle.sides), lines, rubber)


def most_friction_of_all(vehicle: Vehicle) -> float:
    """The larger of static and sliding friction torque of all sides together, at the reference temperature [N m]."""
    values = baseline_parameters(vehicle)
    return len(vehicle.sides) * max(values["static_torque"], values["coulomb_torque"])


def baseline_parameters(vehicle: Vehicle) -> dict[str, float]:
    """Baseline fields of the parameter record of one track, SI."""
    values = {"sides": float(len(vehicle.sides)), **_thermal(vehicle)}
    if vehicle.contact is not None:
        joint = vehicle.contact
        sigma_0 = math.degrees(joint.stiffness_Nm_per_deg)
        values |= {
            "static_torque": joint.static_torque_Nm,
            "coulomb_torque": joint.coulomb_torque_Nm,
            "sigma_0": sigma_0,
            "damping_factor": joint.presliding_damping_Nms / math.sqrt(sigma_0),
            "stribeck_speed": math.radians(joint.stribeck_speed_deg_s),
            "stribeck_exponent": joint.stribeck_exponent,
        }
    else:
        axle, track, friction = vehicle.axle, vehicle.track, vehicle.friction
        assert axle is not None
        assert track is not None
        assert friction is not None
        assert friction.static is not None
        assert friction.coulomb is not None
        moment = load_moment(axle, track)
        values |= {
            "static_torque": friction.static * moment,
            "coulomb_torque": friction.coulomb * moment,
            "sigma_0": math.degrees(friction.stiffness_Nm_per_deg),
            "damping_factor": 2.0 * track.damping_ratio * math.sqrt(track.yaw_inertia_kgm2),
            "stribeck_speed": math.radians(friction.stribeck_speed_deg_s),
            "stribeck_exponent": friction.stribeck_exponent,
            "aligning_torque": vertical_load(axle, track)
            * axle.kingpin_lever_arm_m
            * math.sin(math.radians(axle.kingpin_inclination_deg)),
        }
    if vehicle.gravity is not None:
        values["gravity_cos"] = vehicle.gravity.cos_Nm
        values["aligning_torque"] = values.get("aligning_torque", 0.0) + vehicle.gravity.sin_Nm
    values["torque_unit"] = decade(values["coulomb_torque"], FRICTION_NM)
    values["angle_unit"] = angle_unit(vehicle)
    values["acceleration_unit"] = acceleration_unit(vehicle)
    values["angle_noise"] = vehicle.sensors.angle_sigma
    return values


def _thermal(vehicle: Vehicle) -> dict[str, float]:
    """Heat capacity rho c A h [J/K], cooling lambda A [W/K] and temperatures; without rubber nothing ever warms."""
    rubber, initial = vehicle.rubber, vehicle.initial
    if rubber is None:
        return {"heat_capacity": math.inf}
    assert initial is not None
    area = rubber.contact_area_m2
    return {
        "heat_capacity": rubber.density_kg_m3 * rubber.specific_heat_J_kgK * area * rubber.tread_thickness_m,
        "cooling": rubber.heat_transfer_W_m2K * area,
        "air_temperature": initial.air_temperature_degC,
        "rubber_temperature": initial.rubber_temperature_degC,
    }
