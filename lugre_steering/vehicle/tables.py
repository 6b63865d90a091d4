# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables that a vehicle file points to: rubber measurements as CSV files, and the shipped pavements."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import yaml

from lugre_steering.files import read_text
from lugre_steering.resources import config_folder
from lugre_steering.schema import Reader
from lugre_steering.vehicle.sections import EffectEntry, Vehicle

LONGEST_TABLE = 1_000_000
"""Bytes. A measured table has some thousand."""
_TABLES = {
    "dma_csv": ("dma", ("temperature_degC", "storage_modulus_Pa", "loss_modulus_Pa")),
    "master_curve_csv": ("master_curve", ("frequency_Hz", "storage_modulus_Pa", "loss_modulus_Pa")),
}


def embed_tables(data: Mapping[str, Any], reader: Reader) -> Mapping[str, Any]:
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
        lines = read_text(path, LONGEST_TABLE).removeprefix("\ufeff").splitlines()  # spreadsheets begin with a byte order mark
    except (OSError, ValueError) as error:  # ValueError: not UTF-8, or a NUL in the name
        raise reader.fail(key, name, f"a readable CSV file ({path}: {error})") from error
    rows = [(i, line) for i, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
    header = [cell.strip() for cell in rows[0][1].split(",")] if rows else []
    if any(column not in header for column in columns):
        # What else the file holds may be nobody's business.
        raise reader.fail(key, name, f"a CSV file whose first line names the columns {', '.join(columns)} (this is {path})")
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


def pavements() -> dict[str, dict[str, Any]]:
    """The shipped pavements: name -> static, coulomb, source."""
    file = config_folder() / "pavements.yaml"
    table = yaml.safe_load(file.read_text(encoding="utf-8"))["pavements"]
    assert isinstance(table, dict)
    return table


def with_pavement(vehicle: Vehicle, reader: Reader) -> Vehicle:
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


def limit_device() -> EffectEntry:
    """The elastic stop of the shipped examples and of the simulated published experiments."""
    entry = yaml.safe_load((config_folder() / "limit_device.yaml").read_text(encoding="utf-8"))
    return EffectEntry(entry["id"], entry["parameters"])
