# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What is possible in a vehicle file and yet unlike any real vehicle: most often a unit or a decimal point gone wrong.

Only vehicles on tracks are judged. A single joint or a linear axis may be of any size; for those, and for all, the ranges in
``sections.py`` refuse what no matter and no machine can be.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from lugre_steering.vehicle.loads import load_moment, vertical_load
from lugre_steering.vehicle.rubber import moduli
from lugre_steering.vehicle.sections import Axle, Friction, Hydraulics, Rubber, Track, Vehicle

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class Doubt:
    """A value that no real vehicle is known to have: the key that most likely is wrong, the value judged, and why."""

    key: str
    value: float
    statement: str


@dataclass(frozen=True)
class Usual:
    """Where the values of a key lie in real vehicles."""

    key: str
    low: float
    high: float
    unit: str
    why: str
    of: str = ""
    """What the key amounts to, where that is judged and not its own value."""

    def doubts(self, value: float | None) -> Iterator[Doubt]:
        """One if the value lies elsewhere; None, a value not given, raises none."""
        if value is not None and not self.low <= value <= self.high:
            got, span = (f"{numbers} {self.unit}".strip() for numbers in (f"{value:.4g}", f"{self.low:g} to {self.high:g}"))
            of = f"{self.of} of " if self.of else ""
            yield Doubt(self.key, value, f"{self.key}: {of}{got} is unlike any real vehicle, expected {span}: {self.why}")


KEYS = (
    Usual("axle.load_N", 2e3, 5e5, "N", "steered axles on rubber tracks carry between 0.2 and 50 t"),
    Usual("axle.wheelbase_m", 0.5, 10.0, "m", "from the smallest carrier to the longest tractor"),
    Usual("axle.kingpin_distance_m", 0.3, 5.0, "m", "the hinges stand within the width of the vehicle"),
    Usual("axle.kingpin_inclination_deg", 0.0, 20.0, "deg", "kingpins lean by up to about 15 deg"),
    Usual("axle.kingpin_lever_arm_m", -0.4, 0.4, "m", "it is a fraction of the hinge offset"),
    Usual("track.weight_N", 200.0, 6e4, "N", "one assembly weighs between 20 kg and 6 t"),
    Usual("track.width_m", 0.1, 1.2, "m", "rubber tracks are made 0.15 to 1 m wide"),
    Usual("track.hinge_offset_m", -1.5, 1.5, "m", "the hinge stands beside the track"),
    Usual("track.damping_ratio", 0.01, 3.0, "", "the presliding of a track neither rings nor creeps"),
    Usual("friction.static", 0.05, 1.5, "", "rubber on wet ice 0.05, on dry concrete up to 1.2"),
    Usual("friction.coulomb", 0.03, 1.4, "", "rubber on wet ice 0.05, on dry concrete up to 1.2"),
    Usual("friction.stribeck_speed_deg_s", 0.02, 60.0, "deg/s", "rubber passes from sticking to sliding at 0.1 mm/s to 0.5 m/s"),
    Usual("friction.stribeck_exponent", 0.3, 4.0, "", "published values are 0.5 to 2"),
    Usual("friction.reference_temperature_degC", -40.0, 80.0, "degC", "pavements are no colder or hotter"),
    Usual("rubber.dma_frequency_Hz", 0.01, 1e3, "Hz", "analysers work at 0.1 to 200 Hz"),
    Usual("rubber.density_kg_m3", 850.0, 1700.0, "kg/m3", "rubber has 900, with its fillers up to 1500 kg/m3"),
    Usual("rubber.specific_heat_J_kgK", 1000.0, 2500.0, "J/(kg K)", "filled rubber has 1300 to 2100 J/(kg K)"),
    Usual("rubber.tread_thickness_m", 0.003, 0.15, "m", "treads are 5 to 100 mm thick"),
    Usual("rubber.heat_transfer_W_m2K", 0.0, 250.0, "W/(m2 K)", "still air takes 5, fast air 100 W/(m2 K)"),
    Usual("rubber.wlf.c1", 3.0, 50.0, "", "for polymers 8 to 20"),
    Usual("rubber.wlf.c2_K", 10.0, 400.0, "K", "for polymers 40 to 200 K"),
    Usual("initial.rubber_temperature_degC", -40.0, 100.0, "degC", "rubber is not driven colder, and fails hotter"),
    Usual("initial.air_temperature_degC", -50.0, 60.0, "degC", "no outdoor air is colder or hotter"),
    Usual("sensors.angle_resolution_deg", 0.0, 0.5, "deg", "angle sensors resolve 0.001 to 0.1 deg"),
    Usual("sensors.angle_noise_deg", 0.0, 0.5, "deg", "angle sensors scatter by 0.001 to 0.1 deg"),
)
MODULUS = Usual("rubber", 2e5, 5e8, "Pa", "that of tread rubber at work is 1 to 50 MPa", "a storage modulus")
LOSS = Usual("rubber", 0.005, 3.0, "", "that of tread rubber at work is 0.05 to 1", "a loss over storage modulus")
GYRATION = Usual("track.yaw_inertia_kgm2", 0.05, 1.5, "m", "the mass of a track lies within it", "a radius of gyration")
REACH = Usual("track.rollers.x_m", 0.1, 4.0, "m", "tracks are 0.4 to 6 m long", "an outermost roller at a distance")
PRESSURE = Usual("rubber.contact_area_m2", 5e3, 1e6, "Pa", "rubber tracks press with 10 to 500 kPa", "a mean ground pressure")
YIELDING = Usual(
    "friction.stiffness_Nm_per_deg", 1e-3, 0.3, "m", "tread and carcass give by millimetres before rubber slides", "a presliding distance"
)
RATIO = Usual("friction.static", 1.0, 2.0, "times sliding friction", "rubber sticks little better than it slides", "a level")
SENSED = Usual("sensors.pressure_range_Pa", 1e6, 1e8, "Pa", "steering hydraulics work at 5 to 35 MPa")
NOISE = Usual("sensors.pressure_noise_Pa", 0.0, 0.05, "times the range", "pressure sensors scatter by 0.01 to 1 % of it", "a scatter")
CAPACITY = Usual(
    "hydraulics.cylinders", 0.1, 100.0, "times the friction", "cylinders are made to turn the tracks", "a torque at full range"
)
BORE = Usual("bore_m", 0.015, 0.4, "m", "steering cylinders are 25 to 200 mm wide")
ARM = Usual("knuckle_m", 0.01, 1.5, "m", "cylinders act at 0.05 to 0.5 m from the hinge", "an arm at zero angle")


def plausibility(vehicle: Vehicle) -> tuple[Doubt, ...]:
    """Every doubt about a vehicle on tracks; none about other rigs."""
    if vehicle.axle is None or vehicle.track is None or vehicle.friction is None:
        return ()
    doubts = [doubt for usual in KEYS for doubt in usual.doubts(_value(vehicle, usual.key))]
    doubts += _of_tracks(vehicle.axle, vehicle.track, vehicle.friction)
    if vehicle.rubber is not None:
        doubts += _of_rubber(vehicle.rubber, vehicle.friction.reference_temperature_degC)
        doubts += PRESSURE.doubts(vertical_load(vehicle.axle, vehicle.track) / vehicle.rubber.contact_area_m2)
    if vehicle.hydraulics is not None:
        doubts += _of_cylinders(vehicle, vehicle.hydraulics)
    return tuple(doubts)


def _value(vehicle: Vehicle, key: str) -> float | None:
    """None where the section, or the key in it, is not given."""
    *sections, name = key.split(".")
    place: object = vehicle
    for section in sections:
        place = getattr(place, section, None)
    value: float | None = getattr(place, name, None)
    return value


def _of_tracks(axle: Axle, track: Track, friction: Friction) -> Iterator[Doubt]:
    if track.weight_N >= 1.0:  # else there is nothing to give a radius to
        yield from GYRATION.doubts(math.sqrt(track.yaw_inertia_kgm2 * GRAVITY_M_S2 / track.weight_N))
    yield from REACH.doubts(max(abs(x) for x in track.rollers.x_m))
    if friction.coulomb is not None:
        # How far the mean roller moves before the stiffness reaches the sliding torque.
        radius = load_moment(axle, track) / vertical_load(axle, track)
        sliding = friction.coulomb * load_moment(axle, track)
        yield from YIELDING.doubts(math.radians(sliding / friction.stiffness_Nm_per_deg) * radius)
        if friction.static is not None:
            yield from RATIO.doubts(friction.static / friction.coulomb)


def _of_rubber(rubber: Rubber, at_degC: float) -> Iterator[Doubt]:
    modulus = complex(moduli(rubber, np.array([at_degC]))[0])
    yield from MODULUS.doubts(modulus.real)
    yield from LOSS.doubts(modulus.imag / modulus.real)


def _of_cylinders(vehicle: Vehicle, hydraulics: Hydraulics) -> Iterator[Doubt]:
    range_Pa, able = vehicle.sensors.pressure_range_Pa, 0.0
    yield from SENSED.doubts(range_Pa)
    yield from NOISE.doubts(vehicle.sensors.pressure_noise_Pa / range_Pa)
    for name, cylinder in hydraulics.cylinders.items():
        (chassis_x, chassis_y), (x, y) = cylinder.chassis_m, cylinder.knuckle_m
        arm = abs(chassis_x * y - chassis_y * x) / math.hypot(x - chassis_x, y - chassis_y)
        able += range_Pa * 0.25 * math.pi * cylinder.bore_m**2 * arm
        for usual, value in ((BORE, cylinder.bore_m), (ARM, arm)):
            yield from replace(usual, key=f"hydraulics.cylinders.{name}.{usual.key}").doubts(value)
    assert vehicle.axle is not None
    assert vehicle.track is not None
    assert vehicle.friction is not None
    level = vehicle.friction.static or 1.0
    yield from CAPACITY.doubts(able / (len(vehicle.sides) * level * load_moment(vehicle.axle, vehicle.track)))
