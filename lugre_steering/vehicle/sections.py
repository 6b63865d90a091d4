# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The sections of a vehicle file, each a frozen dataclass whose fields carry their ranges, and the vehicle made of them.

The ranges end where no matter and no machine can be (a solid of 1 kg/m3, a tread of a few wavelengths of light). What is
possible and yet unlike any real vehicle is the business of ``plausible.py``.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from lugre_steering.effects.law_entry import LawEntry
from lugre_steering.recording import Channel, Kind
from lugre_steering.schema import positive, quantity

SIDES = ("left", "right")


@dataclass(frozen=True)
class Axle:
    """The steered axle; ``load_N`` without the track assemblies."""

    load_N: float = quantity(1.0, 1e7)
    kingpin_inclination_deg: float = quantity(0.0, 45.0)
    kingpin_lever_arm_m: float = quantity(-1.0, 1.0)
    wheelbase_m: float = quantity(0.01, 50.0)
    kingpin_distance_m: float = quantity(0.01, 20.0)


@dataclass(frozen=True)
class Levers:
    """Distances of the two levels of balance levers [m]: each pair is (to the front member, to the rear member).

    ``axle_m`` from the point where the axle load enters, ``weight_m`` from the assembly's centre of gravity to the two
    balance shafts; ``front_m`` and ``rear_m`` from each balance shaft to its two rollers.
    """

    axle_m: tuple[float, ...] = quantity(0.0, 10.0)
    weight_m: tuple[float, ...] = quantity(0.0, 10.0)
    front_m: tuple[float, ...] = quantity(0.0, 10.0)
    rear_m: tuple[float, ...] = quantity(0.0, 10.0)


@dataclass(frozen=True)
class Rollers:
    """Road rollers along the track, from the hinge, forward positive; loads as shares or by levers (four rollers)."""

    x_m: tuple[float, ...] = quantity(-10.0, 10.0)
    load_share: tuple[float, ...] | None = quantity(0.0, 1.0, default=None)
    levers: Levers | None = None


@dataclass(frozen=True)
class Track:
    """One track assembly; left and right are mirror images."""

    rollers: Rollers
    weight_N: float = quantity(0.0, 1e6)
    width_m: float = quantity(1e-3, 5.0)
    hinge_offset_m: float = quantity(-5.0, 5.0)
    yaw_inertia_kgm2: float = quantity(1e-6, 1e5)
    ground_pressure_exponent: float = quantity(2.0, 4.0, default=3.0)
    damping_ratio: float = quantity(0.0, 10.0, default=0.5)


@dataclass(frozen=True)
class Friction:
    """Rubber on the pavement at ``reference_temperature_degC``; levels left out are those of the named pavement."""

    stiffness_Nm_per_deg: float = quantity(1e-3, 1e7)
    stribeck_speed_deg_s: float = quantity(1e-6, 1e3)
    reference_temperature_degC: float = quantity(-80.0, 150.0)
    pavement: str = "unnamed"
    static: float | None = quantity(1e-3, 3.0, default=None)
    coulomb: float | None = quantity(1e-3, 3.0, default=None)
    stribeck_exponent: float = positive(10.0, default=2.0)
    temperature_law: str = "loss_over_modulus"


@dataclass(frozen=True)
class Contact:
    """Friction of a single joint given directly as torques (in place of axle, track and friction)."""

    static_torque_Nm: float = quantity(1e-12, 1e8)
    coulomb_torque_Nm: float = quantity(1e-12, 1e8)
    stiffness_Nm_per_deg: float = quantity(1e-12, 1e9)
    stribeck_speed_deg_s: float = quantity(1e-9, 1e3)
    stribeck_exponent: float = positive(10.0, default=2.0)
    presliding_damping_Nms: float = quantity(0.0, 1e8, default=0.0)
    reference_temperature_degC: float = quantity(-80.0, 150.0, default=15.0)
    temperature_law: str = "loss_over_modulus"


@dataclass(frozen=True)
class Wlf:
    """Williams-Landel-Ferry shift log10 aT = -c1 (T - Tr) / (c2 + T - Tr)."""

    c1: float = quantity(0.1, 100.0)
    c2_K: float = quantity(0.1, 1000.0)
    reference_degC: float = quantity(-150.0, 300.0)


@dataclass(frozen=True)
class DmaTable:
    """Dynamic mechanical analysis at one frequency: temperature [degC], storage and loss modulus [Pa]."""

    temperature_degC: tuple[float, ...] = quantity(-200.0, 400.0)
    storage_modulus_Pa: tuple[float, ...] = quantity(100.0, 1e13)
    loss_modulus_Pa: tuple[float, ...] = quantity(0.01, 1e13)


@dataclass(frozen=True)
class MasterCurve:
    """Master curve at the WLF reference temperature: frequency [Hz], storage and loss modulus [Pa]."""

    frequency_Hz: tuple[float, ...] = quantity(1e-40, 1e40)
    storage_modulus_Pa: tuple[float, ...] = quantity(100.0, 1e13)
    loss_modulus_Pa: tuple[float, ...] = quantity(0.01, 1e13)


@dataclass(frozen=True)
class Rubber:
    """Tread rubber: a DMA table (or a master curve) and the heat balance of the tread layer."""

    dma_frequency_Hz: float = quantity(1e-6, 1e6)
    density_kg_m3: float = quantity(100.0, 1e4)
    specific_heat_J_kgK: float = quantity(100.0, 2e4)
    tread_thickness_m: float = quantity(1e-4, 1.0)
    contact_area_m2: float = quantity(1e-6, 100.0)
    heat_transfer_W_m2K: float = quantity(0.0, 1e5)
    wlf: Wlf | None = None
    dma: DmaTable | None = None
    master_curve: MasterCurve | None = None


@dataclass(frozen=True)
class Initial:
    """State at the start of each recording."""

    rubber_temperature_degC: float = quantity(-80.0, 200.0)
    air_temperature_degC: float = quantity(-80.0, 80.0)


@dataclass(frozen=True)
class Cylinder:
    """Pivots [x, y] [m] from that side's hinge, knuckle pivot at zero angle; lines of its chambers."""

    side: str
    cap: str
    rod: str
    chassis_m: tuple[float, ...] = quantity(-10.0, 10.0)
    knuckle_m: tuple[float, ...] = quantity(-10.0, 10.0)
    bore_m: float = quantity(1e-4, 2.0)
    rod_m: float = quantity(0.0, 2.0)


@dataclass(frozen=True)
class Hydraulics:
    lines: tuple[str, ...]
    cylinders: dict[str, Cylinder]


@dataclass(frozen=True)
class TorqueSensor:
    topic: str = "steering/measured_torque"
    noise_Nm: float = quantity(1e-15, 1e6, default=1.0)


@dataclass(frozen=True)
class Sensors:
    """What the data sheets say; noise as one standard deviation.

    ``angle_from`` names the only side with an angle sensor; the other side then follows from Ackermann geometry.
    """

    angle_resolution_deg: float = quantity(0.0, 10.0, default=0.0)
    angle_noise_deg: float = quantity(0.0, 10.0, default=0.01)
    pressure_reference: str = "gauge"
    pressure_range_Pa: float = quantity(1.0, 1e9, default=40.0e6)
    pressure_noise_Pa: float = quantity(0.0, 1e8, default=1.5e4)
    pressure_gain: float = quantity(0.5, 2.0, default=1.0)
    angle_from: str | None = None


@dataclass(frozen=True)
class Gravity:
    """Known conservative torque cos_Nm cos(theta) + sin_Nm sin(theta)."""

    cos_Nm: float = quantity(-1e8, 1e8, default=0.0)
    sin_Nm: float = quantity(-1e8, 1e8, default=0.0)


@dataclass(frozen=True)
class Coordinate:
    """Labels of a linear axis (1 m counts as 1 rad internally, 1 N as 1 N m)."""

    name: str = "steering angle"
    unit: str = "rad"
    force_unit: str = "N m"


@dataclass(frozen=True)
class EffectEntry:
    """One piece of physics added to the baseline: catalogue id and its parameters."""

    id: str
    parameters: dict[str, float] = field(default_factory=dict)
    source: str | None = None
    """File or package that holds an effect which is not shipped."""
    sha256: str | None = None
    """Of that file, or of the laws of the package: another law under the same name is refused."""


@dataclass(frozen=True)
class Topics:
    """Names of the input topics where they differ from the standard ones."""

    left: str = "steering/left/joint_state"
    right: str = "steering/right/joint_state"
    left_joint: str = "left_track_steer_joint"
    right_joint: str = "right_track_steer_joint"
    pressure_prefix: str = "steering/pressure/"
    ambient_temperature: str = "steering/ambient_temperature"


@dataclass(frozen=True)
class Vehicle:
    """A vehicle (axle, track, friction) or a single joint (contact), with what is measured and what was added."""

    schema: str
    name: str
    axle: Axle | None = None
    track: Track | None = None
    friction: Friction | None = None
    contact: Contact | None = None
    rubber: Rubber | None = None
    initial: Initial | None = None
    hydraulics: Hydraulics | None = None
    torque_sensor: TorqueSensor | None = None
    sensors: Sensors = field(default_factory=Sensors)
    gravity: Gravity | None = None
    coordinate: Coordinate = field(default_factory=Coordinate)
    topics: Topics = field(default_factory=Topics)
    sides: tuple[str, ...] = SIDES
    effects: tuple[EffectEntry, ...] = ()
    laws: tuple[LawEntry, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """Every input this vehicle listens to, in the order the compiled loop numbers them."""
        found = [self._angle_channel(side) for side in self.sides]
        if self.hydraulics is not None:
            found += [
                Channel(Kind.PRESSURE, line, self.topics.pressure_prefix + line) for line in self.hydraulics.lines
            ]
        if self.torque_sensor is not None:
            found.append(Channel(Kind.TORQUE, "torque", self.torque_sensor.topic))
        found.append(Channel(Kind.AIR_TEMPERATURE, "air", self.topics.ambient_temperature))
        return tuple(found)

    def _angle_channel(self, side: str) -> Channel:
        sensor, ratio = self.sensors.angle_from or side, 0.0
        if sensor != side:
            assert self.axle is not None  # checked when the file was read
            ratio = self.axle.kingpin_distance_m / self.axle.wheelbase_m * (1.0 if sensor == "left" else -1.0)
        return Channel(Kind.ANGLE, side, getattr(self.topics, sensor), getattr(self.topics, f"{sensor}_joint"), ratio)

    def replace(self, **changes: Any) -> Vehicle:
        """A copy with some sections changed."""
        return dataclasses.replace(self, **changes)
