# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From fitted calibration values back to the keys of the vehicle file."""

from __future__ import annotations

import math
from dataclasses import replace

from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Array
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.loads import vertical_load


def apply_calibration(vehicle: Vehicle, problem: Problem, x: Array) -> Vehicle:
    """``vehicle`` (that of ``problem``, perhaps with effects added) with the calibration part of ``x`` in its keys.

    A model built from the result has the parameters that ``problem.fields(x)`` names; only a static friction fitted
    below the sliding one, which a vehicle file refuses, is raised to it. The initial bristles in ``x`` have no key.
    """
    record = problem.model.parameters[0][0]
    ratio = {field: value / float(record[field]) for field, value in problem.fields(x).items() if record[field] != 0.0}
    coulomb, static = ratio.get("coulomb_torque", 1.0), ratio.get("static_torque", 1.0)
    stiffness, stribeck = ratio.get("sigma_0", 1.0), ratio.get("stribeck_speed", 1.0)
    sensors = replace(vehicle.sensors, pressure_gain=problem.gain(x) * vehicle.sensors.pressure_gain)
    changed = vehicle.replace(sensors=sensors)
    if (friction := vehicle.friction) is not None:
        assert friction.coulomb is not None
        assert friction.static is not None
        friction = replace(
            friction,
            coulomb=coulomb * friction.coulomb,
            static=max(static * friction.static, coulomb * friction.coulomb),
            stiffness_Nm_per_deg=stiffness * friction.stiffness_Nm_per_deg,
            stribeck_speed_deg_s=stribeck * friction.stribeck_speed_deg_s,
        )
        changed = changed.replace(friction=friction)
    if (contact := vehicle.contact) is not None:
        contact = replace(
            contact,
            coulomb_torque_Nm=coulomb * contact.coulomb_torque_Nm,
            static_torque_Nm=static * contact.static_torque_Nm,
            stiffness_Nm_per_deg=stiffness * contact.stiffness_Nm_per_deg,
            stribeck_speed_deg_s=stribeck * contact.stribeck_speed_deg_s,
            # The chain keeps sigma_1 / sqrt(sigma_0).
            presliding_damping_Nms=math.sqrt(stiffness) * contact.presliding_damping_Nms,
        )
        changed = changed.replace(contact=contact)
    if (rubber := vehicle.rubber) is not None:
        rubber = replace(
            rubber,
            specific_heat_J_kgK=ratio.get("heat_capacity", 1.0) * rubber.specific_heat_J_kgK,
            heat_transfer_W_m2K=ratio.get("cooling", 1.0) * rubber.heat_transfer_W_m2K,
        )
        changed = changed.replace(rubber=rubber)
    if vehicle.axle is not None and vehicle.track is not None and "aligning_torque" in ratio:
        per_metre = vertical_load(vehicle.axle, vehicle.track) * math.sin(
            math.radians(vehicle.axle.kingpin_inclination_deg)
        )
        added = (ratio["aligning_torque"] - 1.0) * float(record["aligning_torque"]) / per_metre
        arm = vehicle.axle.kingpin_lever_arm_m + added
        changed = changed.replace(axle=replace(vehicle.axle, kingpin_lever_arm_m=arm))
    return changed
