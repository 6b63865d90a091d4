# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Keys of the vehicle file that calibration values decide about."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lugre_steering.vehicle import Vehicle


@dataclass(frozen=True)
class Key:
    """One key of the vehicle file: what people call it, how to read it and which calibration value decides about it."""

    calibration: str
    key: str
    title: str
    unit: str
    read: Callable[[Vehicle], float | None]

    @property
    def beginning(self) -> str:
        """The title as a sentence begins with it."""
        return self.title[:1].upper() + self.title[1:]


def _of(section: str, name: str) -> Callable[[Vehicle], float | None]:
    return lambda vehicle: getattr(getattr(vehicle, section), name, None)


KEYS = tuple(
    Key(calibration, f"{section}.{name}", title, unit, _of(section, name))
    for calibration, section, name, title, unit in (
        ("friction_level", "friction", "coulomb", "sliding friction", "1"),
        ("static_ratio", "friction", "static", "static friction", "1"),
        ("friction_level", "contact", "coulomb_torque_Nm", "sliding friction torque", "N m"),
        ("static_ratio", "contact", "static_torque_Nm", "static friction torque", "N m"),
        *(("stiffness", section, "stiffness_Nm_per_deg", "presliding stiffness", "N m/deg") for section in ("friction", "contact")),
        *(("stribeck_speed", section, "stribeck_speed_deg_s", "Stribeck speed", "deg/s") for section in ("friction", "contact")),
        ("heat_capacity", "rubber", "specific_heat_J_kgK", "specific heat of the rubber", "J/(kg K)"),
        ("cooling", "rubber", "heat_transfer_W_m2K", "heat transfer to the air", "W/(m2 K)"),
        ("kingpin_arm", "axle", "kingpin_lever_arm_m", "kingpin lever arm", "m"),
        ("pressure_gain", "sensors", "pressure_gain", "gain of the pressure sensors", "1"),
    )
)
