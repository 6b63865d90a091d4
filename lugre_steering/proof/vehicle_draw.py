# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the proof simulator knows about a vehicle: the sheet's geometry, and true values drawn around its nominal ones.

The simulator reads the sheet by itself, so that a mistake in the estimator's reader cannot hide in both.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from lugre_steering.errors import VehicleFileError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cylinder:
    """One steering cylinder: pivots [x, y] in m from its own hinge, piston areas in m2, the lines that feed it."""

    side: int
    chassis_m: tuple[float, float]
    knuckle_m: tuple[float, float]
    cap_area_m2: float
    rod_area_m2: float
    cap_line: str
    rod_line: str


@dataclass(frozen=True)
class Sheet:
    """The parts of a vehicle file that the simulator uses (SI); ``files`` are what a case must carry along."""

    files: tuple[Path, ...]
    wheelbase_m: float
    kingpin_distance_m: float
    lines: tuple[str, ...]
    cylinders: tuple[Cylinder, ...]
    angle_resolution_rad: float
    angle_noise_rad: float
    pressure_range_Pa: float
    pressure_noise_Pa: float
    roller_x_m: Array
    roller_load_N: Array
    hinge_offset_m: float
    track_width_m: float
    pressure_exponent: float
    nominal: TrueVehicle


class TrueVehicle(NamedTuple):
    """Physics of one drawn vehicle, per track (SI, temperatures in degC): what the compiled contact needs."""

    static_torque_Nm: float
    coulomb_torque_Nm: float
    stiffness_Nm_rad: float
    damping_Nms_rad: float
    stribeck_speed_rad_s: float
    stribeck_exponent: float
    heat_capacity_J_K: float
    heat_loss_W_K: float
    aligning_torque_Nm: float
    reference_degC: float
    rubber_degC: float
    air_degC: float


def load_sheet(path: Path) -> Sheet:
    """Read a vehicle file of the reference kind (four-line hydraulics, two sides, rubber table beside the file)."""
    try:
        return _sheet(Path(path), _numbers(yaml.safe_load(Path(path).read_text(encoding="utf-8"))))
    except (OSError, KeyError, TypeError, ValueError, yaml.YAMLError) as error:
        raise VehicleFileError(
            f"{path}: the proof simulator cannot use this vehicle file ({type(error).__name__}: {error}); "
            "expected the kind of the reference vehicle"
        ) from error


def _numbers(entry: Any) -> Any:
    """The same tree with numbers such as 25.0e6, which YAML 1.1 takes for text, as floats."""
    if isinstance(entry, dict):
        return {key: _numbers(value) for key, value in entry.items()}
    if isinstance(entry, list):
        return [_numbers(value) for value in entry]
    if isinstance(entry, str):
        try:
            return float(entry)
        except ValueError:
            return entry
    return entry


def _sheet(path: Path, data: dict[str, Any]) -> Sheet:
    axle, track, friction, rubber = data["axle"], data["track"], data["friction"], data["rubber"]
    rollers, sensors = track["rollers"], data["sensors"]
    load = 0.5 * axle["load_N"] + track["weight_N"]
    roller_x = np.asarray(rollers["x_m"], dtype=float)
    roller_load = load * np.asarray(rollers["load_share"], dtype=float)
    lever = float(np.sum(roller_load * np.hypot(roller_x, track["hinge_offset_m"])))
    stiffness = float(np.rad2deg(friction["stiffness_Nm_per_deg"]))
    area = rubber["contact_area_m2"]
    inclined = float(np.sin(np.deg2rad(axle["kingpin_inclination_deg"])))
    nominal = TrueVehicle(
        static_torque_Nm=friction["static"] * lever,
        coulomb_torque_Nm=friction["coulomb"] * lever,
        stiffness_Nm_rad=stiffness,
        damping_Nms_rad=2.0 * track["damping_ratio"] * float(np.sqrt(stiffness * track["yaw_inertia_kgm2"])),
        stribeck_speed_rad_s=float(np.deg2rad(friction["stribeck_speed_deg_s"])),
        stribeck_exponent=friction["stribeck_exponent"],
        heat_capacity_J_K=rubber["density_kg_m3"] * rubber["specific_heat_J_kgK"] * area * rubber["tread_thickness_m"],
        heat_loss_W_K=rubber["heat_transfer_W_m2K"] * area,
        aligning_torque_Nm=load * axle["kingpin_lever_arm_m"] * inclined,
        reference_degC=friction["reference_temperature_degC"],
        rubber_degC=data["initial"]["rubber_temperature_degC"],
        air_degC=data["initial"]["air_temperature_degC"],
    )
    return Sheet(
        files=(path, path.parent / rubber["dma_csv"]),
        wheelbase_m=axle["wheelbase_m"],
        kingpin_distance_m=axle["kingpin_distance_m"],
        lines=tuple(data["hydraulics"]["lines"]),
        cylinders=tuple(_cylinder(entry) for entry in data["hydraulics"]["cylinders"].values()),
        angle_resolution_rad=float(np.deg2rad(sensors["angle_resolution_deg"])),
        angle_noise_rad=float(np.deg2rad(sensors["angle_noise_deg"])),
        pressure_range_Pa=sensors["pressure_range_Pa"],
        pressure_noise_Pa=sensors["pressure_noise_Pa"],
        roller_x_m=roller_x,
        roller_load_N=roller_load,
        hinge_offset_m=track["hinge_offset_m"],
        track_width_m=track["width_m"],
        pressure_exponent=track["ground_pressure_exponent"],
        nominal=nominal,
    )


def _cylinder(entry: dict[str, Any]) -> Cylinder:
    bore, rod = entry["bore_m"], entry["rod_m"]
    (chassis_x, chassis_y), (knuckle_x, knuckle_y) = entry["chassis_m"], entry["knuckle_m"]
    return Cylinder(
        side=("left", "right").index(entry["side"]),
        chassis_m=(chassis_x, chassis_y),
        knuckle_m=(knuckle_x, knuckle_y),
        cap_area_m2=0.25 * np.pi * bore**2,
        rod_area_m2=0.25 * np.pi * (bore**2 - rod**2),
        cap_line=entry["cap"],
        rod_line=entry["rod"],
    )


def draw_vehicle(sheet: Sheet, rng: np.random.Generator, spread: float) -> TrueVehicle:
    """A vehicle whose friction, stiffness and thermal values differ from the sheet by up to ``spread`` each.

    Static and Coulomb friction move together (same rubber, same road) with a smaller change of their ratio, so that the
    static level never falls below the Coulomb level. Geometry and loads, so the aligning torque, are as the sheet
    measured them. Damping follows the stiffness: sigma1 ~ sqrt(sigma0).
    """
    level, stiffness, stribeck, capacity, loss = 1.0 + rng.uniform(-spread, spread, 5)
    ratio = 1.0 + rng.uniform(-0.2, 0.2) * spread
    n = sheet.nominal
    return n._replace(
        static_torque_Nm=n.static_torque_Nm * level * ratio,
        coulomb_torque_Nm=n.coulomb_torque_Nm * level,
        stiffness_Nm_rad=n.stiffness_Nm_rad * stiffness,
        damping_Nms_rad=n.damping_Nms_rad * float(np.sqrt(stiffness)),
        stribeck_speed_rad_s=n.stribeck_speed_rad_s * stribeck,
        heat_capacity_J_K=n.heat_capacity_J_K * capacity,
        heat_loss_W_K=n.heat_loss_W_K * loss,
    )
