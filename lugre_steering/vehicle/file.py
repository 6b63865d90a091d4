# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Reading and writing vehicle files."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lugre_steering.errors import VehicleFileError
from lugre_steering.schema import Reader
from lugre_steering.vehicle.check import check
from lugre_steering.vehicle.effects import each_once, with_effects
from lugre_steering.vehicle.sections import Initial, Vehicle
from lugre_steering.vehicle.tables import embed_tables, with_pavement

SCHEMA = "lugre_steering/vehicle/1"


def load(path: str | Path) -> Vehicle:
    """Read and check a vehicle file; relative paths in it are relative to the file."""
    file = Path(path)
    return from_mapping(Reader(file, VehicleFileError).load(), file)


def vehicle_of(vehicle: Vehicle | str | Path) -> Vehicle:
    """The vehicle itself, or the one of that file."""
    return vehicle if isinstance(vehicle, Vehicle) else load(vehicle)


def from_mapping(data: object, file: Path) -> Vehicle:
    """Build a vehicle from plain data as read from ``file`` (named in errors, base of relative paths)."""
    reader = Reader(file, VehicleFileError)
    if not isinstance(data, Mapping):
        raise reader.fail("(top level)", data, "a mapping with the keys of a vehicle file")
    if data.get("schema") != SCHEMA:
        raise reader.fail("schema", data.get("schema"), f"'{SCHEMA}'")
    vehicle = _with_initial(reader.build(Vehicle, embed_tables(data, reader), ""))
    check(vehicle, reader)
    return with_pavement(with_effects(vehicle, reader), reader)


def _with_initial(vehicle: Vehicle) -> Vehicle:
    """Rubber and air start at the reference temperature of friction where the file says nothing."""
    law = vehicle.friction or vehicle.contact
    if vehicle.initial is not None or vehicle.rubber is None or law is None:
        return vehicle
    return vehicle.replace(initial=Initial(law.reference_temperature_degC, law.reference_temperature_degC))


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
