# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The sections of a vehicle file, each a frozen dataclass whose fields carry their ranges, and the vehicle made of them.

The ranges end where no matter and no machine can be (a solid of 1 kg/m3, a tread of a few wavelengths of light). What is
possible and yet unlike any real vehicle is the business of ``plausible.py``.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from lugre_steering.chain.rates import RATE_TIME_CONSTANT_S
from lugre_steering.effects.law_entry import LawEntry
from lugre_steering.recording import FARTHEST, Channel, Kind
from lugre_steering.result import html
from lugre_steering.schema import positive, quantity

SIDES = ("left", "right")
FARTHEST_OF_JOINT = 4.0 * math.pi
"""Largest magnitude [rad] that the angle of a single joint can have: two turns either way, as of most robots."""


@dataclass(frozen=True)
class Axle:
    """The steered axle."""

    load_N: float = quantity(1.0, 1e7)
    """Vertical load on the steered axle, without the track assemblies."""
    kingpin_inclination_deg: float = quantity(0.0, 45.0)
    """Lean of the kingpin, seen from the front."""
    kingpin_lever_arm_m: float = quantity(-1.0, 1.0)
    """Lever arm of the aligning torque about the kingpin."""
    wheelbase_m: float = quantity(0.01, 50.0)
    """Distance of the axles."""
    kingpin_distance_m: float = quantity(0.01, 20.0)
    """Between left and right steering hinge."""


@dataclass(frozen=True)
class Levers:
    """Distances of the two levels of balance levers: each pair is (to the front member, to the rear member)."""

    axle_m: tuple[float, ...] = quantity(0.0, 10.0)
    """From the point where the axle load enters."""
    weight_m: tuple[float, ...] = quantity(0.0, 10.0)
    """From the assembly's centre of gravity to the two balance shafts."""
    front_m: tuple[float, ...] = quantity(0.0, 10.0)
    """From the front balance shaft to its two rollers."""
    rear_m: tuple[float, ...] = quantity(0.0, 10.0)
    """From the rear balance shaft to its two rollers."""


@dataclass(frozen=True)
class Rollers:
    """Road rollers along the track, from the hinge, forward positive; loads as shares or by levers (four rollers)."""

    x_m: tuple[float, ...] = quantity(-10.0, 10.0)
    """Place of each road roller along the track, from the hinge, forward positive."""
    load_share: tuple[float, ...] | None = quantity(0.0, 1.0, default=None)
    """Share of the load that each roller carries; they sum to 1."""
    levers: Levers | None = None
    """Balance levers in place of the shares."""


@dataclass(frozen=True)
class Track:
    """One track assembly; left and right are mirror images."""

    rollers: Rollers
    """Road rollers."""
    weight_N: float = quantity(0.0, 1e6)
    """Weight of one assembly."""
    width_m: float = quantity(1e-3, 5.0)
    """Width of the track."""
    hinge_offset_m: float = quantity(-5.0, 5.0)
    """Lateral distance, steering hinge to track centreline."""
    yaw_inertia_kgm2: float = quantity(1e-6, 1e5)
    """Of one assembly about the hinge; sets the presliding damping."""
    ground_pressure_exponent: float = quantity(2.0, 4.0, default=3.0)
    """Shape of the pressure under a roller: 2 soft ground to 4 hard ground."""
    damping_ratio: float = quantity(0.0, 10.0, default=0.5)
    """Of the presliding motion."""


@dataclass(frozen=True)
class Friction:
    """Rubber on the pavement at ``reference_temperature_degC``; levels left out are those of the named pavement."""

    stiffness_Nm_per_deg: float = quantity(1e-3, 1e7)
    """Presliding stiffness of one track."""
    stribeck_speed_deg_s: float = quantity(1e-6, 1e3)
    """Steering rate at which sticking gives way to sliding."""
    reference_temperature_degC: float = quantity(-80.0, 150.0)
    """Rubber temperature at which the friction levels and the stiffness hold."""
    pavement: str = "unnamed"
    """Name of a shipped pavement, or any name where both levels are given."""
    static: float | None = quantity(1e-3, 3.0, default=None)
    """Static friction coefficient."""
    coulomb: float | None = quantity(1e-3, 3.0, default=None)
    """Sliding friction coefficient."""
    stribeck_exponent: float = positive(10.0, default=2.0)
    """Shape of the passage from static to sliding friction."""
    temperature_law: str = "loss_over_modulus"
    """How friction follows the rubber: `loss_over_modulus`, `loss_tangent` or `loss_modulus`."""


@dataclass(frozen=True)
class Contact:
    """Friction of a single joint given directly as torques (in place of axle, track and friction)."""

    static_torque_Nm: float = quantity(1e-12, 1e8)
    """Static friction torque."""
    coulomb_torque_Nm: float = quantity(1e-12, 1e8)
    """Sliding friction torque."""
    stiffness_Nm_per_deg: float = quantity(1e-12, 1e14)
    """Presliding stiffness."""
    stribeck_speed_deg_s: float = quantity(1e-9, 1e3)
    """Rate at which sticking gives way to sliding."""
    stribeck_exponent: float = positive(10.0, default=2.0)
    """Shape of the passage from static to sliding friction."""
    presliding_damping_Nms: float = quantity(0.0, 1e12, default=0.0)
    """Damping of the bristles, per rad/s."""
    reference_temperature_degC: float = quantity(-80.0, 150.0, default=15.0)
    """Rubber temperature at which the torques hold."""
    temperature_law: str = "loss_over_modulus"
    """As in `friction`."""


@dataclass(frozen=True)
class Wlf:
    """Williams-Landel-Ferry shift log10 aT = -c1 (T - Tr) / (c2 + T - Tr)."""

    c1: float = quantity(0.1, 100.0)
    """First constant, of the logarithm to base 10."""
    c2_K: float = quantity(0.1, 1000.0)
    """Second constant."""
    reference_degC: float = quantity(-150.0, 300.0)
    """Reference temperature of the constants."""


@dataclass(frozen=True)
class DmaTable:
    """Dynamic mechanical analysis at one frequency: temperature [degC], storage and loss modulus [Pa]."""

    temperature_degC: tuple[float, ...] = quantity(-200.0, 400.0)
    """Increasing; at least 3 rows."""
    storage_modulus_Pa: tuple[float, ...] = quantity(100.0, 1e13)
    """E' at these temperatures."""
    loss_modulus_Pa: tuple[float, ...] = quantity(0.01, 1e13)
    """E'' at these temperatures."""


@dataclass(frozen=True)
class MasterCurve:
    """Master curve at the WLF reference temperature: frequency [Hz], storage and loss modulus [Pa]."""

    frequency_Hz: tuple[float, ...] = quantity(1e-40, 1e40)
    """Increasing; at least 3 rows."""
    storage_modulus_Pa: tuple[float, ...] = quantity(100.0, 1e13)
    """E' at these frequencies."""
    loss_modulus_Pa: tuple[float, ...] = quantity(0.01, 1e13)
    """E'' at these frequencies."""


@dataclass(frozen=True)
class Rubber:
    """Tread rubber: a DMA table (or a master curve) and the heat balance of the tread layer."""

    dma_frequency_Hz: float = quantity(1e-6, 1e6)
    """Frequency of the rubber measurement."""
    density_kg_m3: float = quantity(100.0, 1e4)
    """Of the tread rubber."""
    specific_heat_J_kgK: float = quantity(100.0, 2e4)
    """Of the tread rubber."""
    tread_thickness_m: float = quantity(1e-4, 1.0)
    """Of the layer that takes the friction heat."""
    contact_area_m2: float = quantity(1e-6, 100.0)
    """Of one track on the ground."""
    heat_transfer_W_m2K: float = quantity(0.0, 1e5)
    """From the tread to the air."""
    wlf: Wlf | None = None
    """Shift between temperature and frequency; a master curve needs it."""
    dma: DmaTable | None = None
    """Table in the file itself; `dma_csv: FILE` reads the same columns from a CSV file."""
    master_curve: MasterCurve | None = None
    """Table in the file itself; `master_curve_csv: FILE` reads the same columns from a CSV file."""


@dataclass(frozen=True)
class Initial:
    """State at the start of each recording."""

    rubber_temperature_degC: float = quantity(-80.0, 200.0)
    """Of the tread; the reference temperature of friction where the section is left out."""
    air_temperature_degC: float = quantity(-80.0, 80.0)
    """Of the air, until a recorded one comes."""


@dataclass(frozen=True)
class Cylinder:
    """One steering cylinder: its pivots, and the lines of its chambers."""

    side: str
    """`left` or `right`: the track it turns."""
    cap: str
    """Line of the chamber on the piston's full side; `tank`: no pressure."""
    rod: str
    """Line of the chamber with the rod; `tank`: no pressure."""
    chassis_m: tuple[float, ...] = quantity(-10.0, 10.0)
    """Pivot [x, y] on the chassis, from that side's hinge, x forward, y left."""
    knuckle_m: tuple[float, ...] = quantity(-10.0, 10.0)
    """Pivot [x, y] on the knuckle at zero angle, from that side's hinge."""
    bore_m: float = quantity(1e-4, 2.0)
    """Diameter of the piston."""
    rod_m: float = quantity(0.0, 2.0)
    """Diameter of the rod."""


@dataclass(frozen=True)
class Hydraulics:
    """What turns the tracks, and the sensors of its pressures."""

    lines: tuple[str, ...]
    """Names of the lines that have a pressure sensor."""
    cylinders: dict[str, Cylinder]
    """Cylinders by name."""


@dataclass(frozen=True)
class TorqueSensor:
    """A torque (or, for a linear axis, force) that is measured itself."""

    topic: str = "steering/measured_torque"
    """Topic of the measured torque."""
    noise_Nm: float = quantity(1e-15, 1e6, default=1.0)
    """Noise of the sensor, one standard deviation."""


@dataclass(frozen=True)
class Sensors:
    """What the data sheets say of the sensors."""

    angle_resolution_deg: float = quantity(0.0, 10.0, default=0.0)
    """Resolution: one step of the angle sensors."""
    angle_noise_deg: float = quantity(0.0, 10.0, default=0.01)
    """Noise of the angle sensors, one standard deviation."""
    rate_filter_s: float | None = quantity(1e-5, 4.0 * RATE_TIME_CONSTANT_S, default=None)
    """Time constant of the causal filter of rate and acceleration [s], where the angle has noise; left out: by that noise. `diagnose` and
    `calibrate` write what suits the inertia of a joint or axis."""
    pressure_reference: str = "gauge"
    """`gauge` or `absolute`."""
    pressure_range_Pa: float = quantity(1.0, 1e9, default=40.0e6)
    """End of the range of the pressure sensors."""
    pressure_noise_Pa: float = quantity(0.0, 1e8, default=1.5e4)
    """Noise of the pressure sensors, one standard deviation."""
    pressure_gain: float = quantity(0.5, 2.0, default=1.0)
    """True over shown pressure; fitted by `calibrate --free pressure_gain`."""
    angle_from: str | None = None
    """The only side with an angle sensor; the other follows from Ackermann geometry."""

    @property
    def angle_sigma(self) -> float:
        """Standard deviation of one angle sample [rad], quantisation included."""
        return math.radians(math.hypot(self.angle_noise_deg, self.angle_resolution_deg / math.sqrt(12.0)))


@dataclass(frozen=True)
class Gravity:
    """Known conservative torque cos_Nm cos(theta) + sin_Nm sin(theta)."""

    cos_Nm: float = quantity(-1e8, 1e8, default=0.0)
    """Torque times the cosine of the angle."""
    sin_Nm: float = quantity(-1e8, 1e8, default=0.0)
    """Torque times the sine of the angle."""


@dataclass(frozen=True)
class Coordinate:
    """Labels of a linear axis (1 m counts as 1 rad internally, 1 N as 1 N m)."""

    name: str = "steering angle"
    """What results call the coordinate."""
    unit: str = "rad"
    """`rad`, or `m` for a linear axis."""
    force_unit: str = "N m"
    """`N m`, or `N` for a linear axis."""
    farthest: float | None = positive(1e6, default=None)
    """Largest magnitude of angle [rad] or position [m]; left out: half a turn of a track, two of a joint, 100 m."""


@dataclass(frozen=True)
class EffectEntry:
    """One piece of physics added to the baseline: catalogue id and its parameters."""

    id: str
    """Identifier in the catalogue (`lugre-steering effects`)."""
    parameters: dict[str, float] = field(default_factory=dict)
    """Values by name, in SI units; ranges: `lugre-steering effects ID`."""
    source: str | None = None
    """File or package that holds an effect which is not shipped."""
    sha256: str | None = None
    """Of its entry in that file (YAML), of the file (Python) or of the laws of the package: another law under the same name is refused."""


@dataclass(frozen=True)
class Topics:
    """Names of the input topics where they differ from the standard ones."""

    left: str = "steering/left/joint_state"
    """Angle of the left track."""
    right: str = "steering/right/joint_state"
    """Angle of the right track."""
    left_joint: str = "left_track_steer_joint"
    """Name of the left joint in the messages."""
    right_joint: str = "right_track_steer_joint"
    """Name of the right joint in the messages."""
    pressure_prefix: str = "steering/pressure/"
    """Before the name of each pressure line."""
    ambient_temperature: str = "steering/ambient_temperature"
    """Air temperature."""


@dataclass(frozen=True)
class Vehicle:
    """A vehicle (axle, track, friction) or a single joint (contact), with what is measured and what was added."""

    schema: str
    """Kind and version of the file: `lugre_steering/vehicle/1`."""
    name: str
    """What results call the machine."""
    axle: Axle | None = None
    """The steered axle."""
    track: Track | None = None
    """One track assembly; left and right are mirror images."""
    friction: Friction | None = None
    """Rubber on the pavement."""
    contact: Contact | None = None
    """Friction of a single joint or axis, in place of `axle`, `track` and `friction`."""
    rubber: Rubber | None = None
    """Tread rubber and its heat; without it friction knows no temperature."""
    initial: Initial | None = None
    """Temperatures at the start of each recording."""
    hydraulics: Hydraulics | None = None
    """Cylinders and pressure lines; or `torque_sensor`."""
    torque_sensor: TorqueSensor | None = None
    """A measured torque or force, in place of `hydraulics`."""
    sensors: Sensors = field(default_factory=Sensors)
    """What the data sheets say."""
    gravity: Gravity | None = None
    """A known conservative torque of a single joint."""
    coordinate: Coordinate = field(default_factory=Coordinate)
    """Labels of a linear axis."""
    topics: Topics = field(default_factory=Topics)
    """Names of the inputs."""
    sides: tuple[str, ...] = SIDES
    """Out of `left`, `right`."""
    effects: tuple[EffectEntry, ...] = ()
    """Physics beyond the baseline."""
    laws: tuple[LawEntry, ...] = ()
    """Laws that `diagnose` found and no name fits."""
    provenance: dict[str, Any] = field(default_factory=dict)
    """Where a written file comes from; not read."""

    @property
    def farthest(self) -> float:
        """Largest magnitude of an angle [rad] or position [m]: what is beyond comes in another unit."""
        usual = FARTHEST_OF_JOINT if self.contact is not None and self.coordinate.unit == "rad" else FARTHEST[self.coordinate.unit]
        return usual if self.coordinate.farthest is None else self.coordinate.farthest

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
        return Channel(Kind.ANGLE, side, getattr(self.topics, sensor), getattr(self.topics, f"{sensor}_joint"), ratio, self.farthest)

    def __repr__(self) -> str:
        about = "; ".join(f"{row['what']}: {row['is']}" for row in self._rows())
        return f"Vehicle({about})"

    def _repr_html_(self) -> str:
        return html("Vehicle", self.name, self._rows())

    def _rows(self) -> list[dict[str, str]]:
        """What it is in a few lines; the whole is its file."""
        about = {
            "name": self.name,
            "sides": ", ".join(self.sides),
            "inputs": ", ".join(channel.topic for channel in self.channels),
            "effects": ", ".join(effect.id for effect in self.effects) or "none",
            "laws": str(len(self.laws)),
        }
        return [{"what": what, "is": text} for what, text in about.items()]

    def replace(self, **changes: Any) -> Vehicle:
        """A copy with some sections changed."""
        return dataclasses.replace(self, **changes)
