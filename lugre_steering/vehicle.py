# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The vehicle file: one frozen, typed, validated description of a vehicle and its model.

``load`` refuses unknown keys, missing keys, wrong types and impossible values with file, key, value and expectation;
``save`` writes a file that stands alone (tables embedded) and loads back equal.
"""

from __future__ import annotations

import dataclasses
import math
import re
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lugre_steering.effects.catalogue import CATALOGUE
from lugre_steering.errors import LugreSteeringError, VehicleFileError
from lugre_steering.recording import Channel, Kind
from lugre_steering.resources import config_folder
from lugre_steering.schema import Reader, positive, quantity, suggestion

SCHEMA = "lugre_steering/vehicle/1"
SIDES = ("left", "right")
UNITS = {"rad": "N m", "m": "N"}
"""Units of the coordinate, each with that of its force: the program counts in these, so others would only mislabel."""
_TOPIC = re.compile(r"(~?/)?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
"""Topic names that ROS accepts."""


@dataclass(frozen=True)
class Axle:
    """The steered axle; ``load_N`` without the track assemblies."""

    load_N: float = positive(1e7)
    kingpin_inclination_deg: float = quantity(0.0, 45.0)
    kingpin_lever_arm_m: float = quantity(-1.0, 1.0)
    wheelbase_m: float = positive(50.0)
    kingpin_distance_m: float = positive(20.0)


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
    width_m: float = positive(5.0)
    hinge_offset_m: float = quantity(-5.0, 5.0)
    yaw_inertia_kgm2: float = positive(1e5)
    ground_pressure_exponent: float = quantity(2.0, 4.0, default=3.0)
    damping_ratio: float = quantity(0.0, 10.0, default=0.5)


@dataclass(frozen=True)
class Friction:
    """Rubber on the pavement at ``reference_temperature_degC``; levels left out are those of the named pavement."""

    stiffness_Nm_per_deg: float = positive(1e7)
    stribeck_speed_deg_s: float = positive(1e3)
    reference_temperature_degC: float = quantity(-80.0, 150.0)
    pavement: str = "unnamed"
    static: float | None = positive(3.0, default=None)
    coulomb: float | None = positive(3.0, default=None)
    stribeck_exponent: float = positive(10.0, default=2.0)
    temperature_law: str = "loss_over_modulus"


@dataclass(frozen=True)
class Contact:
    """Friction of a single joint given directly as torques (in place of axle, track and friction)."""

    static_torque_Nm: float = positive(1e8)
    coulomb_torque_Nm: float = positive(1e8)
    stiffness_Nm_per_deg: float = positive(1e9)
    stribeck_speed_deg_s: float = positive(1e3)
    stribeck_exponent: float = positive(10.0, default=2.0)
    presliding_damping_Nms: float = quantity(0.0, 1e8, default=0.0)
    reference_temperature_degC: float = quantity(-80.0, 150.0, default=15.0)
    temperature_law: str = "loss_over_modulus"


@dataclass(frozen=True)
class Wlf:
    """Williams-Landel-Ferry shift log10 aT = -c1 (T - Tr) / (c2 + T - Tr)."""

    c1: float = positive(100.0)
    c2_K: float = positive(1000.0)
    reference_degC: float = quantity(-150.0, 300.0)


@dataclass(frozen=True)
class DmaTable:
    """Dynamic mechanical analysis at one frequency: temperature [degC], storage and loss modulus [Pa]."""

    temperature_degC: tuple[float, ...] = quantity(-200.0, 400.0)
    storage_modulus_Pa: tuple[float, ...] = positive(1e13)
    loss_modulus_Pa: tuple[float, ...] = positive(1e13)


@dataclass(frozen=True)
class MasterCurve:
    """Master curve at the WLF reference temperature: frequency [Hz], storage and loss modulus [Pa]."""

    frequency_Hz: tuple[float, ...] = positive(1e30)
    storage_modulus_Pa: tuple[float, ...] = positive(1e13)
    loss_modulus_Pa: tuple[float, ...] = positive(1e13)


@dataclass(frozen=True)
class Rubber:
    """Tread rubber: a DMA table (or a master curve) and the heat balance of the tread layer."""

    dma_frequency_Hz: float = positive(1e6)
    density_kg_m3: float = positive(1e5)
    specific_heat_J_kgK: float = positive(1e5)
    tread_thickness_m: float = positive(1.0)
    contact_area_m2: float = positive(100.0)
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
    bore_m: float = positive(2.0)
    rod_m: float = quantity(0.0, 2.0)


@dataclass(frozen=True)
class Hydraulics:
    lines: tuple[str, ...]
    cylinders: dict[str, Cylinder]


@dataclass(frozen=True)
class TorqueSensor:
    topic: str = "steering/measured_torque"
    noise_Nm: float = positive(1e6, default=1.0)


@dataclass(frozen=True)
class Sensors:
    """What the data sheets say; noise as one standard deviation.

    ``angle_from`` names the only side with an angle sensor; the other side then follows from Ackermann geometry.
    """

    angle_resolution_deg: float = quantity(0.0, 10.0, default=0.0)
    angle_noise_deg: float = quantity(0.0, 10.0, default=0.01)
    pressure_reference: str = "gauge"
    pressure_range_Pa: float = positive(1e9, default=40.0e6)
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


def load(path: str | Path) -> Vehicle:
    """Read and check a vehicle file; relative paths in it are relative to the file."""
    file = Path(path)
    return from_mapping(Reader(file, VehicleFileError).load(), file)


def from_mapping(data: object, file: Path) -> Vehicle:
    """Build a vehicle from plain data as read from ``file`` (named in errors, base of relative paths)."""
    reader = Reader(file, VehicleFileError)
    if not isinstance(data, Mapping):
        raise reader.fail("(top level)", data, "a mapping with the keys of a vehicle file")
    if data.get("schema") != SCHEMA:
        raise reader.fail("schema", data.get("schema"), f"'{SCHEMA}'")
    vehicle = reader.build(Vehicle, _embed_tables(data, reader), "")
    _check(vehicle, reader)
    return _with_pavement(_with_effects(vehicle, reader), reader)


def save(vehicle: Vehicle, path: str | Path) -> None:
    """Write a vehicle file that stands alone; keys left at None and empty defaults are not written."""
    Path(path).write_text(
        yaml.safe_dump(to_mapping(vehicle), sort_keys=False, allow_unicode=True, width=120), encoding="utf-8"
    )


def to_mapping(vehicle: Vehicle) -> dict[str, Any]:
    """Plain data of a vehicle, ready for YAML or JSON."""
    plain = _plain(vehicle.replace(effects=each_once(vehicle.effects)))
    assert isinstance(plain, dict)
    plain.setdefault("effects", [])
    return plain


def each_once(effects: Iterable[EffectEntry]) -> tuple[EffectEntry, ...]:
    """Effects found again stand once, as a file must have them: later values replace earlier ones, other lines join."""
    joined: dict[str, dict[str, float]] = {}
    for entry in effects:
        joined.setdefault(entry.id, {}).update(entry.parameters)
    return tuple(EffectEntry(name, values) for name, values in joined.items())


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        items = ((item.name, _plain(getattr(value, item.name))) for item in dataclasses.fields(value))
        return {name: inner for name, inner in items if inner is not None and inner != {} and inner != []}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value


_TABLES = {
    "dma_csv": ("dma", ("temperature_degC", "storage_modulus_Pa", "loss_modulus_Pa")),
    "master_curve_csv": ("master_curve", ("frequency_Hz", "storage_modulus_Pa", "loss_modulus_Pa")),
}


def _embed_tables(data: Mapping[str, Any], reader: Reader) -> Mapping[str, Any]:
    """Replace ``rubber.dma_csv`` and ``rubber.master_curve_csv`` by the tables they point to."""
    rubber = data.get("rubber")
    if not isinstance(rubber, Mapping):
        return data
    rubber = dict(rubber)
    for key, (target, columns) in _TABLES.items():
        if key in rubber:
            if target in rubber:
                raise reader.fail(f"rubber.{key}", rubber[key], f"either {key} or {target}, not both")
            rubber[target] = _read_table(reader, f"rubber.{key}", rubber.pop(key), columns)
    return {**data, "rubber": rubber}


def _read_table(reader: Reader, key: str, name: object, columns: tuple[str, ...]) -> dict[str, list[float]]:
    if not isinstance(name, str):
        raise reader.fail(key, name, "the path of a CSV file")
    path = reader.file.parent / name
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()  # spreadsheets begin with a byte order mark
    except (OSError, ValueError) as error:  # ValueError: not UTF-8, or a NUL in the name
        raise reader.fail(key, name, f"a readable CSV file ({path}: {error})") from error
    rows = [(i, line) for i, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
    header = [cell.strip() for cell in rows[0][1].split(",")] if rows else []
    if any(column not in header for column in columns):
        raise reader.fail(key, ",".join(header), f"{path} to have the columns {', '.join(columns)}")
    table: dict[str, list[float]] = {column: [] for column in columns}
    for number, line in rows[1:]:
        cells = line.split(",")
        for column in columns:
            table[column].append(_cell(reader, key, cells, header.index(column), f"{path}, line {number}"))
    return table


def _cell(reader: Reader, key: str, cells: list[str], index: int, place: str) -> float:
    try:
        return float(cells[index])
    except (ValueError, IndexError) as error:
        raise reader.fail(key, ",".join(cells), f"a number in column {index + 1} of {place}") from error


def _check(vehicle: Vehicle, reader: Reader) -> None:
    """What single fields cannot say: sections that belong together, sums, orders, names that must exist."""
    fail = reader.fail
    if (
        not vehicle.sides
        or any(side not in SIDES for side in vehicle.sides)
        or len(set(vehicle.sides)) != len(vehicle.sides)
    ):
        raise fail("sides", list(vehicle.sides), "a list out of left, right")
    if vehicle.contact is not None:
        for section in ("axle", "track", "friction"):
            if getattr(vehicle, section) is not None:
                raise fail(section, "a section", "no such section beside 'contact' (a single joint)")
        if vehicle.contact.static_torque_Nm < vehicle.contact.coulomb_torque_Nm:
            raise fail("contact.static_torque_Nm", vehicle.contact.static_torque_Nm, "at least coulomb_torque_Nm")
    else:
        for section in ("axle", "track", "friction"):
            if getattr(vehicle, section) is None:
                raise fail(section, None, "this section (or 'contact' for a single joint)")
        _check_track(vehicle, reader)
    if (vehicle.hydraulics is None) == (vehicle.torque_sensor is None):
        raise fail("hydraulics", None, "exactly one of 'hydraulics' and 'torque_sensor'")
    if vehicle.rubber is not None:
        _check_rubber(vehicle, vehicle.rubber, reader)
    law = vehicle.friction or vehicle.contact
    if law is not None and law.temperature_law not in ("loss_over_modulus", "loss_tangent", "loss_modulus"):
        key = "friction" if vehicle.friction else "contact"
        raise fail(f"{key}.temperature_law", law.temperature_law, "loss_over_modulus, loss_tangent or loss_modulus")
    if vehicle.sensors.angle_from is not None and (
        vehicle.sensors.angle_from not in vehicle.sides or len(vehicle.sides) < 2 or vehicle.axle is None
    ):
        expected = "left or right, for a vehicle with both sides and an axle (Ackermann geometry)"
        raise fail("sensors.angle_from", vehicle.sensors.angle_from, expected)
    if vehicle.sensors.pressure_reference not in ("gauge", "absolute"):
        raise fail("sensors.pressure_reference", vehicle.sensors.pressure_reference, "gauge or absolute")
    force_unit = UNITS.get(vehicle.coordinate.unit)
    if force_unit is None:
        raise fail("coordinate.unit", vehicle.coordinate.unit, " or ".join(UNITS))
    if vehicle.coordinate.force_unit != force_unit:
        expected = f"'{force_unit}', as the coordinate is in {vehicle.coordinate.unit}"
        raise fail("coordinate.force_unit", vehicle.coordinate.force_unit, expected)
    if vehicle.hydraulics is not None:
        _check_hydraulics(vehicle, vehicle.hydraulics, reader)
    _check_topics(vehicle, reader)


def _check_topics(vehicle: Vehicle, reader: Reader) -> None:
    topics = vehicle.topics
    names = {f"topics.{key}": getattr(topics, key) for key in ("left", "right", "ambient_temperature")}
    names["topics.pressure_prefix"] = topics.pressure_prefix + "line"
    if vehicle.torque_sensor is not None:
        names["torque_sensor.topic"] = vehicle.torque_sensor.topic
    for i, line in enumerate(vehicle.hydraulics.lines if vehicle.hydraulics else ()):
        names[f"hydraulics.lines[{i}]"] = topics.pressure_prefix + line
    for key, name in names.items():
        if not _TOPIC.fullmatch(name):
            expected = "the name of a ROS topic: letters, digits, _ and /, no digit first in any part"
            raise reader.fail(key, name.removesuffix("line") if key.endswith("prefix") else name, expected)
    if (
        set(vehicle.sides) == set(SIDES)
        and vehicle.sensors.angle_from is None
        and (topics.left, topics.left_joint) == (topics.right, topics.right_joint)
    ):
        raise reader.fail("topics.right_joint", topics.right_joint, "another joint than the left one on the same topic")


def _check_track(vehicle: Vehicle, reader: Reader) -> None:
    assert vehicle.axle is not None
    assert vehicle.track is not None
    assert vehicle.friction is not None
    rollers, fail = vehicle.track.rollers, reader.fail
    if not rollers.x_m:
        raise fail("track.rollers.x_m", [], "at least one roller")
    if (rollers.load_share is None) == (rollers.levers is None):
        raise fail("track.rollers", list(rollers.x_m), "exactly one of load_share and levers")
    if rollers.load_share is not None:
        if len(rollers.load_share) != len(rollers.x_m):
            raise fail(
                "track.rollers.load_share", list(rollers.load_share), f"{len(rollers.x_m)} shares, one per roller"
            )
        if abs(sum(rollers.load_share) - 1.0) > 1e-6:
            raise fail("track.rollers.load_share", sum(rollers.load_share), "shares that sum to 1")
    if rollers.levers is not None:
        if len(rollers.x_m) != 4:
            raise fail("track.rollers.levers", list(rollers.x_m), "four rollers (two levels of balance levers)")
        for item in dataclasses.fields(rollers.levers):
            pair = getattr(rollers.levers, item.name)
            if len(pair) != 2 or sum(pair) <= 0.0:
                raise fail(f"track.rollers.levers.{item.name}", list(pair), "two distances that are not both zero")
    # Imported late because the loads are those of a vehicle.
    from lugre_steering.chain.loads import load_moment

    if load_moment(vehicle.axle, vehicle.track) <= 0.0:
        expected = "a loaded roller away from the hinge (or track.hinge_offset_m other than 0), else friction has no arm"
        raise fail("track.rollers.x_m", list(rollers.x_m), expected)
    static, coulomb = vehicle.friction.static, vehicle.friction.coulomb
    if static is not None and coulomb is not None and static < coulomb:
        raise fail("friction.static", static, f"at least friction.coulomb ({coulomb:g})")


def _check_rubber(vehicle: Vehicle, rubber: Rubber, reader: Reader) -> None:
    fail = reader.fail
    if (rubber.dma is None) == (rubber.master_curve is None):
        raise fail("rubber", None, "exactly one of dma_csv, dma, master_curve_csv, master_curve")
    if rubber.master_curve is not None and rubber.wlf is None:
        raise fail("rubber.wlf", None, "this section (a master curve needs the WLF shift)")
    table: DmaTable | MasterCurve = rubber.dma or typing.cast(MasterCurve, rubber.master_curve)
    section = "rubber.dma" if rubber.dma else "rubber.master_curve"
    columns = [getattr(table, item.name) for item in dataclasses.fields(table)]
    axis = dataclasses.fields(table)[0].name
    if len(columns[0]) < 3 or len({len(column) for column in columns}) != 1:
        raise fail(section, [len(column) for column in columns], "three columns of equal length, at least 3 rows")
    if not all(a < b for a, b in zip(columns[0], columns[0][1:], strict=False)):
        raise fail(f"{section}.{axis}", list(columns[0]), "strictly increasing values")
    if vehicle.initial is None:
        raise fail("initial", None, "this section (rubber needs its temperature at the start)")
    law = vehicle.friction or vehicle.contact
    law_section = "friction" if vehicle.friction else "contact"
    for key, value in (
        ("initial.rubber_temperature_degC", vehicle.initial.rubber_temperature_degC),
        (f"{law_section}.reference_temperature_degC", law.reference_temperature_degC if law else math.nan),
    ):
        if rubber.dma is not None and not columns[0][0] <= value <= columns[0][-1]:
            raise fail(
                key, value, f"a temperature inside the rubber table ({columns[0][0]:g} to {columns[0][-1]:g} degC)"
            )


def _check_hydraulics(vehicle: Vehicle, hydraulics: Hydraulics, reader: Reader) -> None:
    fail = reader.fail
    if not hydraulics.lines or len(set(hydraulics.lines)) != len(hydraulics.lines):
        raise fail("hydraulics.lines", list(hydraulics.lines), "a list of distinct line names")
    if "tank" in hydraulics.lines:
        raise fail("hydraulics.lines", list(hydraulics.lines), "no line called tank: that is the chamber without pressure")
    if not hydraulics.cylinders:
        raise fail("hydraulics.cylinders", {}, "at least one cylinder")
    for name, cylinder in hydraulics.cylinders.items():
        key = f"hydraulics.cylinders.{name}"
        if cylinder.side not in vehicle.sides:
            raise fail(f"{key}.side", cylinder.side, f"one of {', '.join(vehicle.sides)}")
        for chamber in ("cap", "rod"):
            line = getattr(cylinder, chamber)
            if line not in hydraulics.lines and line != "tank":
                raise fail(f"{key}.{chamber}", line, f"one of hydraulics.lines ({', '.join(hydraulics.lines)}) or tank")
        if cylinder.rod_m >= cylinder.bore_m:
            raise fail(f"{key}.rod_m", cylinder.rod_m, f"less than bore_m ({cylinder.bore_m:g})")
        for pivot in ("chassis_m", "knuckle_m"):
            if len(getattr(cylinder, pivot)) != 2:
                raise fail(f"{key}.{pivot}", list(getattr(cylinder, pivot)), "two coordinates [x, y]")
        if math.hypot(*cylinder.knuckle_m) == 0.0 or cylinder.knuckle_m == cylinder.chassis_m:
            raise fail(f"{key}.knuckle_m", list(cylinder.knuckle_m), "a pivot away from the hinge and from chassis_m")


def add_effect(
    vehicle: Vehicle, added: EffectEntry, fail: Callable[[str, object, str], LugreSteeringError]
) -> Vehicle:
    """The vehicle with one more effect, checked against the catalogue; ``fail`` makes errors of key, value, expectation.

    An effect stands once; one that acts per line may be given line by line.
    """
    effect = CATALOGUE.get(added.id)
    if effect is None:
        raise fail("id", added.id, f"an effect of the catalogue; {suggestion(added.id, list(CATALOGUE))}")
    if effect.needs:
        raise fail("id", added.id, f"an effect that the standard topics can show; this one needs {effect.needs}")
    if effect.stage == "thermal" and vehicle.rubber is None:
        raise fail("id", added.id, "a vehicle with the section 'rubber' for a thermal effect")
    before = next((entry for entry in vehicle.effects if entry.id == added.id), None)
    ranges = {p.name: (p.low, p.high) for p in effect.parameters}
    if effect.per_line:
        ranges = dict.fromkeys(vehicle.hydraulics.lines if vehicle.hydraulics else (), next(iter(ranges.values())))
    if before is not None and (not effect.per_line or before.parameters.keys() & added.parameters.keys()):
        raise fail("id", added.id, f"each effect{' and line' if effect.per_line else ''} once")
    for name, value in added.parameters.items():
        if name not in ranges:
            what = "line" if effect.per_line else "parameter"
            raise fail(f"parameters.{name}", value, f"no such {what}; {suggestion(name, list(ranges))}")
        low, high = ranges[name]
        # Fits work on scaled numbers, so a value at its bound comes back with a rounding error.
        if not math.isclose(value, min(max(value, low), high), rel_tol=1e-9):
            raise fail(f"parameters.{name}", value, f"a number from {low:g} to {high:g}")
    # What may not be zero has no neutral value, so it cannot be left out.
    missing = [key for key, (low, high) in ranges.items() if key not in added.parameters and not low <= 0.0 <= high]
    if missing or not added.parameters:
        raise fail("parameters", added.parameters, f"values of {', '.join(missing or ranges) or 'a pressure line'}")
    if before is None:
        return vehicle.replace(effects=(*vehicle.effects, added))
    joined = EffectEntry(added.id, {**before.parameters, **added.parameters})
    return vehicle.replace(effects=tuple(joined if entry is before else entry for entry in vehicle.effects))


def _with_effects(vehicle: Vehicle, reader: Reader) -> Vehicle:
    """The vehicle with its effects checked, each standing once."""
    checked = vehicle.replace(effects=())
    for i, entry in enumerate(vehicle.effects):
        checked = add_effect(checked, entry, partial(_fail_in, reader, f"effects[{i}]"))
    return checked


def _fail_in(reader: Reader, section: str, key: str, value: object, expected: str) -> LugreSteeringError:
    return reader.fail(f"{section}.{key}", value, expected)


def pavements() -> dict[str, dict[str, Any]]:
    """The shipped pavements: name -> static, coulomb, source."""
    file = config_folder() / "pavements.yaml"
    table = yaml.safe_load(file.read_text(encoding="utf-8"))["pavements"]
    assert isinstance(table, dict)
    return table


def _with_pavement(vehicle: Vehicle, reader: Reader) -> Vehicle:
    """Fill friction levels that the file leaves to the named pavement."""
    friction = vehicle.friction
    if friction is None or (friction.static is not None and friction.coulomb is not None):
        return vehicle
    table = pavements()
    if friction.pavement not in table:
        raise reader.fail(
            "friction.pavement",
            friction.pavement,
            f"friction.static and friction.coulomb, or one of {', '.join(table)}",
        )
    row = table[friction.pavement]
    static = row["static"] if friction.static is None else friction.static
    coulomb = row["coulomb"] if friction.coulomb is None else friction.coulomb
    if static < coulomb:
        raise reader.fail("friction.static", static, f"at least friction.coulomb ({coulomb:g})")
    return vehicle.replace(friction=dataclasses.replace(friction, static=static, coulomb=coulomb))
