# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A first vehicle file: what a sheet needs is asked for; the values proposed are those of the shipped examples."""

from __future__ import annotations

import dataclasses
import functools
import operator
import os
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from lugre_steering.errors import DataError, VehicleFileError
from lugre_steering.files import comments, read_text, write_text
from lugre_steering.provenance import provenance
from lugre_steering.resources import config_folder
from lugre_steering.schema import Reader, meanings_of, section_in, unit_of
from lugre_steering.vehicle import Vehicle, from_mapping, pavements
from lugre_steering.vehicle.tables import LONGEST_TABLE

Ask = Callable[[str, str], str]
"""The answer to a question, given its text and the answer that holds if nothing is said."""
Say = Callable[[str], None]
Sheet = dict[str, Any]

OF_A_CYLINDER = ("chassis_m", "knuckle_m", "bore_m", "rod_m")
_JOINT = (
    ("name",),
    tuple(f"contact.{key}" for key in ("coulomb_torque_Nm", "static_torque_Nm", "stiffness_Nm_per_deg", "stribeck_speed_deg_s")),
    ("contact.presliding_damping_Nms",),
    ("torque_sensor.topic", "torque_sensor.noise_Nm"),
    ("sensors.angle_noise_deg",),
)
MACHINES: Mapping[str, tuple[str, tuple[tuple[str, ...], ...]]] = {
    "tracks": ("test_vehicle.yaml", (
        ("name",),
        ("axle.load_N", "axle.wheelbase_m", "axle.kingpin_distance_m", "axle.kingpin_inclination_deg", "axle.kingpin_lever_arm_m"),
        ("track.weight_N", "track.width_m", "track.hinge_offset_m", "track.yaw_inertia_kgm2"),
        ("track.rollers.x_m", "track.rollers.load_share"),
        ("friction.pavement", "friction.static", "friction.coulomb"),
        ("friction.stiffness_Nm_per_deg", "friction.stribeck_speed_deg_s", "friction.reference_temperature_degC"),
        ("rubber.dma_csv", "rubber.dma_frequency_Hz", "rubber.tread_thickness_m", "rubber.contact_area_m2"),
        *(tuple(f"hydraulics.cylinders.left_{name}.{key}" for key in OF_A_CYLINDER) for name in ("main", "aux")),
        ("sensors.angle_noise_deg", "sensors.angle_resolution_deg"),
        ("sensors.pressure_reference", "sensors.pressure_range_Pa", "sensors.pressure_noise_Pa"),
    )),
    "joint": ("single_joint_example.yaml", (*_JOINT, ("gravity.cos_Nm", "gravity.sin_Nm"))),
    "axis": ("linear_axis_example.yaml", _JOINT),
}  # fmt: skip
"""Kinds of machines: the shipped example whose values are proposed, and the keys asked for; each group is checked as a whole."""
ALONG_AN_AXIS = {"N m": "N", "N m s": "N s/m", "N m/deg": "N per 0.01745 m", "deg/s": "0.01745 m/s", "deg": "0.01745 m"}
"""What the units of a vehicle file mean for a linear axis, where 1 m counts as 1 rad."""


def begin_sheet(file: Path, ask: Ask, say: Say) -> list[Path]:
    """Ask for what a sheet needs and write ``file``, its rubber table beside it; the files written. ``DataError`` if there is one."""
    table = file.with_name(f"{file.stem}_rubber.csv")
    for path in (file, table):
        if os.path.lexists(path):
            raise DataError(f"{path}: exists already; expected the name of a new vehicle file")
    if not file.parent.is_dir():
        raise DataError(f"{file.parent}: is no folder; expected one for the vehicle file")
    kind = _one_of(MACHINES, "kind of machine", "tracks", ask, say)
    sheet, groups = _begin(kind)
    if kind == "tracks" and _one_of(("1", "2"), "cylinders that turn each track", "2", ask, say) == "1":
        sheet["hydraulics"]["lines"] = ["main_a", "main_b"]
        sheet["hydraulics"]["cylinders"] = {name: c for name, c in sheet["hydraulics"]["cylinders"].items() if name.endswith("main")}
        groups = tuple(group for group in groups if "left_aux" not in group[0])
    for group in groups:
        _ask_group(sheet, group, file, ask, say, ALONG_AN_AXIS if kind == "axis" else {})
    if kind == "tracks":
        write_text(read_text(Path(sheet["rubber"]["dma_csv"]), LONGEST_TABLE), table)
        sheet["rubber"]["dma_csv"] = table.name
    begun = comments([
        "Vehicle sheet, begun by 'lugre-steering vehicle --new'; check it with 'lugre-steering vehicle FILE'.",
        *provenance("vehicle --new", {}).lines(),
    ])  # fmt: skip
    write_text(begun + "\n".join([*_lines(sheet, Vehicle), ""]), file)
    return [file, table] if kind == "tracks" else [file]


def _begin(kind: str) -> tuple[Sheet, tuple[tuple[str, ...], ...]]:
    """The example of a kind of machine, complete for every key that is asked for, and these keys."""
    example, groups = MACHINES[kind]
    sheet = typing.cast(Sheet, Reader(config_folder() / example, VehicleFileError).load())
    sheet.pop("initial", None)  # as the reference temperature, which is asked for
    if kind == "tracks":
        sheet["rubber"]["dma_csv"] = str(config_folder() / sheet["rubber"]["dma_csv"])
    else:
        sheet["contact"].setdefault("presliding_damping_Nms", 0.0)
        sheet["torque_sensor"].setdefault("topic", "steering/measured_torque")
    if kind == "joint":
        sheet["gravity"] = {"cos_Nm": 0.0, "sin_Nm": 0.0}
    return sheet, groups


def _one_of(known: Iterable[str], text: str, default: str, ask: Ask, say: Say) -> str:
    expected = ", ".join(known)
    while (answer := ask(f"{text} ({expected})", default)) not in known:
        say(f"got '{answer}', expected one of {expected}")
    return answer


def _ask_group(sheet: Sheet, group: tuple[str, ...], file: Path, ask: Ask, say: Say, units: Mapping[str, str]) -> None:
    """Ask for keys that belong together, until the sheet is sound with the answers."""
    while True:
        for key in group:
            _ask_key(sheet, key, file, ask, say, units)
        try:
            from_mapping(sheet, file)
            return
        except VehicleFileError as error:
            say(str(error))


def _ask_key(sheet: Sheet, key: str, file: Path, ask: Ask, say: Say, units: Mapping[str, str]) -> None:
    *path, name = key.split(".")
    place = functools.reduce(operator.getitem, path, sheet)
    cls = _section(path)
    unit = unit_of(name)
    text = f"{key}: {_meaning(cls, name)}" + (f" [{units.get(unit, unit)}]" if unit else "")
    reader, proposed = Reader(file, VehicleFileError), _proposed(sheet, key, place[name])
    while True:
        answer = ask(text, proposed if isinstance(proposed, str) else _flow(proposed))
        try:
            place[name] = _value(reader, cls, key, answer)
            break
        except VehicleFileError as error:
            say(str(error))
    if path[:2] == ["hydraulics", "cylinders"]:  # left and right are mirror images
        other = sheet["hydraulics"]["cylinders"][path[2].replace("left", "right")]
        other[name] = [place[name][0], -place[name][1]] if name.endswith("_m") and isinstance(place[name], list) else place[name]


def _section(path: Sequence[str]) -> type:
    """Of a vehicle, what stands at a path; the name of a cylinder in it is no key."""
    cls: type = Vehicle
    for name in path:
        cls = section_in(typing.get_type_hints(cls).get(name)) or cls
    return cls


def _meaning(cls: type, name: str) -> str:
    if name == "dma_csv":
        return "CSV file of temperature_degC, storage_modulus_Pa, loss_modulus_Pa"
    return meanings_of(cls).get(name, "").rstrip(".").replace("`", "")


def _proposed(sheet: Sheet, key: str, value: Any) -> Any:
    """What is proposed for a key: the value there, unless the answers so far say better."""
    if key == "track.rollers.load_share" and len(value) != (count := len(sheet["track"]["rollers"]["x_m"])):
        return [1.0 / count] * count
    section, _, name = key.partition(".")
    if section == "friction" and name in ("static", "coulomb"):
        return pavements().get(sheet["friction"]["pavement"], {}).get(name, value)
    return value


def _value(reader: Reader, cls: type, key: str, answer: str) -> Any:
    """The answer as the value of a key of a section, checked by its range."""
    name = key.split(".")[-1]
    if name == "dma_csv":
        return str(Path(answer).expanduser().resolve())
    item = next(item for item in dataclasses.fields(cls) if item.name == name)
    hint = typing.get_type_hints(cls)[name]
    if hint is str:
        return reader.convert(hint, answer.strip(), key, item.metadata)
    listed = "tuple" in str(hint)
    given = reader.parse(f"[{answer.strip().strip('[]')}]" if listed else answer)
    value = reader.convert(hint, given, key, item.metadata)
    return list(value) if listed else value


# ---------------------------------------------------------------- the file


def _lines(data: Mapping[str, Any], cls: type, indent: str = "") -> Iterator[str]:
    """A section as lines of YAML, each key with what it means."""
    hints = typing.get_type_hints(cls)
    for name, value in data.items():
        inner = section_in(hints.get(name))
        if isinstance(value, Mapping) and name == "cylinders":
            yield f"{indent}{name}:"
            yield from (f"{indent}  {cylinder}: {_flow(entry)}" for cylinder, entry in value.items())
        elif isinstance(value, Mapping) and inner is not None and name != "wlf":
            yield from ([""] if not indent else [])
            yield f"{indent}{name}:"
            yield from _lines(value, inner, indent + "  ")
        else:
            yield f"{indent}{name}: {_flow(value)}".ljust(44) + f"  # {_meaning(cls, name)}"


def _flow(value: Any) -> str:
    """A value in one line of YAML."""
    return yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=10_000, allow_unicode=True).removesuffix("...\n").strip()
