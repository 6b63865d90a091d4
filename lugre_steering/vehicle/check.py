# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What single fields cannot say: sections that belong together, sums, orders, names that must exist."""

from __future__ import annotations

import dataclasses
import math
import re
import typing

from lugre_steering.schema import Reader
from lugre_steering.vehicle.loads import load_moment
from lugre_steering.vehicle.rubber import known_range
from lugre_steering.vehicle.sections import SIDES, DmaTable, Hydraulics, MasterCurve, Rubber, Vehicle

FORCE_UNITS = {"rad": "N m", "m": "N"}
"""Units of the coordinate, each with that of its force: the program counts in these, so others would only mislabel."""
TOPIC = re.compile(r"(~?/)?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
"""Topic names that ROS accepts."""


def check(vehicle: Vehicle, reader: Reader) -> None:
    """Refuse a vehicle whose sections contradict each other."""
    sides = vehicle.sides
    if not sides or any(side not in SIDES for side in sides) or len(set(sides)) != len(sides):
        raise reader.fail("sides", list(sides), "a list out of left, right")
    _check_friction(vehicle, reader)
    if vehicle.rubber is not None:
        _check_rubber(vehicle, vehicle.rubber, reader)
    _check_sensors(vehicle, reader)
    _check_gravity(vehicle, reader)
    if vehicle.hydraulics is not None:
        _check_hydraulics(vehicle, vehicle.hydraulics, reader)
    _check_topics(vehicle, reader)


def _check_friction(vehicle: Vehicle, reader: Reader) -> None:
    """Either an axle on tracks or a single joint."""
    fail = reader.fail
    if vehicle.contact is not None:
        for section in ("axle", "track", "friction"):
            if getattr(vehicle, section) is not None:
                raise fail(section, "a section", "no such section beside 'contact' (a single joint)")
    else:
        for section in ("axle", "track", "friction"):
            if getattr(vehicle, section) is None:
                raise fail(section, None, "this section (or 'contact' for a single joint)")
        _check_track(vehicle, reader)
    law = vehicle.friction or vehicle.contact
    if law is not None and law.temperature_law not in ("loss_over_modulus", "loss_tangent", "loss_modulus"):
        key = "friction" if vehicle.friction else "contact"
        raise fail(f"{key}.temperature_law", law.temperature_law, "loss_over_modulus, loss_tangent or loss_modulus")


def _check_sensors(vehicle: Vehicle, reader: Reader) -> None:
    fail, sensors, coordinate = reader.fail, vehicle.sensors, vehicle.coordinate
    if (vehicle.hydraulics is None) == (vehicle.torque_sensor is None):
        raise fail("hydraulics", None, "exactly one of 'hydraulics' and 'torque_sensor'")
    if sensors.rate_filter_s is not None and sensors.angle_sigma == 0.0:
        expected = "angle_noise_deg or angle_resolution_deg above zero beside it: without noise of the angle nothing is filtered"
        raise fail("sensors.rate_filter_s", sensors.rate_filter_s, expected)
    if sensors.angle_from is not None and (
        sensors.angle_from not in vehicle.sides or len(vehicle.sides) < 2 or vehicle.axle is None
    ):
        expected = "left or right, for a vehicle with both sides and an axle (Ackermann geometry)"
        raise fail("sensors.angle_from", sensors.angle_from, expected)
    if sensors.pressure_reference not in ("gauge", "absolute"):
        raise fail("sensors.pressure_reference", sensors.pressure_reference, "gauge or absolute")
    if coordinate.unit not in FORCE_UNITS:
        raise fail("coordinate.unit", coordinate.unit, " or ".join(FORCE_UNITS))
    if coordinate.force_unit != FORCE_UNITS[coordinate.unit]:
        expected = f"'{FORCE_UNITS[coordinate.unit]}', as the coordinate is in {coordinate.unit}"
        raise fail("coordinate.force_unit", coordinate.force_unit, expected)


def _check_gravity(vehicle: Vehicle, reader: Reader) -> None:
    if vehicle.gravity is not None and vehicle.coordinate.unit != "rad":
        expected = "no such section for a linear axis, along which a weight is constant (effect slope_bias)"
        raise reader.fail("gravity", "a section", expected)


def _check_topics(vehicle: Vehicle, reader: Reader) -> None:
    topics = vehicle.topics
    names = {f"topics.{key}": getattr(topics, key) for key in ("left", "right", "ambient_temperature")}
    names["topics.pressure_prefix"] = topics.pressure_prefix + "line"
    if vehicle.torque_sensor is not None:
        names["torque_sensor.topic"] = vehicle.torque_sensor.topic
    for i, line in enumerate(vehicle.hydraulics.lines if vehicle.hydraulics else ()):
        names[f"hydraulics.lines[{i}]"] = topics.pressure_prefix + line
    for key, name in names.items():
        if not TOPIC.fullmatch(name):
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
    low, high = known_range(rubber)
    law = vehicle.friction or vehicle.contact
    law_section = "friction" if vehicle.friction else "contact"
    assert vehicle.initial is not None
    for key, value in (
        ("initial.rubber_temperature_degC", vehicle.initial.rubber_temperature_degC),
        (f"{law_section}.reference_temperature_degC", law.reference_temperature_degC if law else math.nan),
    ):
        if not low <= value <= high:
            raise fail(key, value, f"a temperature inside the rubber table ({low:.4g} to {high:.4g} degC)")


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
