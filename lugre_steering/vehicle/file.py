# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Reading and writing vehicle files."""

from __future__ import annotations

import dataclasses
import reprlib
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lugre_steering.errors import ImplausibleWarning, VehicleFileError, reason
from lugre_steering.files import COMMENT_MARK, MAKER, comments, write_text
from lugre_steering.schema import Reader
from lugre_steering.vehicle.check import check
from lugre_steering.vehicle.effects import each_once, with_effects
from lugre_steering.vehicle.laws import check_laws
from lugre_steering.vehicle.plausible import plausibility
from lugre_steering.vehicle.sections import Initial, Vehicle
from lugre_steering.vehicle.tables import embed_tables, with_pavement

SCHEMA = "lugre_steering/vehicle/1"
END = "..."
"""YAML's own sign for the end of a document."""


def load(path: str | Path) -> Vehicle:
    """Read and check a vehicle file; relative paths in it are relative to the file.

    What is possible and unlike any real vehicle is warned of (``ImplausibleWarning``).
    """
    if not isinstance(path, (str, Path)):
        raise VehicleFileError(f"vehicle: got {reprlib.repr(path)}, expected a vehicle or the path of its file")
    file = Path(path)
    reader = Reader(file, VehicleFileError)
    text = reader.text()
    if text.startswith(COMMENT_MARK) and text.split()[-1] != END:
        raise VehicleFileError(f"{file}: is cut off: a file that {MAKER} has written ends with the line '{END}'")
    vehicle = from_mapping(reader.parse(text), file)
    for doubt in plausibility(vehicle):
        warnings.warn(f"{file}: {doubt.statement}", ImplausibleWarning, stacklevel=2)
    return vehicle


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
    check_laws(vehicle, reader)
    return with_effects(with_pavement(vehicle, reader), reader)


def _with_initial(vehicle: Vehicle) -> Vehicle:
    """Rubber and air start at the reference temperature of friction where the file says nothing."""
    law = vehicle.friction or vehicle.contact
    if vehicle.initial is not None or vehicle.rubber is None or law is None:
        return vehicle
    return vehicle.replace(initial=Initial(law.reference_temperature_degC, law.reference_temperature_degC))


def save(vehicle: Vehicle, path: str | Path, notes: Sequence[str] = ()) -> None:
    """Write a vehicle file that stands alone; keys left at None and empty defaults are not written. ``notes`` become comments.

    Its first and last lines tell who wrote it and that nothing is missing: most of its beginnings would be valid vehicles.
    """
    if not isinstance(vehicle, Vehicle):
        raise VehicleFileError(f"vehicle: got {reprlib.repr(vehicle)}, expected a vehicle, as load_vehicle gives it")
    if not isinstance(path, (str, Path)):
        raise VehicleFileError(f"path: got {reprlib.repr(path)}, expected that of a file")
    content = yaml.safe_dump(to_mapping(vehicle), sort_keys=False, allow_unicode=True, width=120)
    first = f"{COMMENT_MARK}; not whole without the three dots of its last line\n"
    try:
        write_text(f"{first}{comments(notes)}{content}{END}\n", Path(path))
    except OSError as error:
        raise VehicleFileError(f"{path}: cannot be written: {reason(error)}; expected a file in a writable folder") from error


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
