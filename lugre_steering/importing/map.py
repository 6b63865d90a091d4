# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The import map: which column of a table is which channel, in which unit, on which clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lugre_steering.errors import MapFileError
from lugre_steering.recording import Array
from lugre_steering.schema import Reader, positive, quantity
from lugre_steering.vehicle.check import TOPIC

SCHEMA = "lugre_steering/import/1"

UNITS: Mapping[str, tuple[str, float, float]] = {
    "s": ("time", 1.0, 0.0), "ms": ("time", 1e-3, 0.0), "us": ("time", 1e-6, 0.0), "ns": ("time", 1e-9, 0.0),
    "min": ("time", 60.0, 0.0),
    "rad": ("angle", 1.0, 0.0), "mrad": ("angle", 1e-3, 0.0), "deg": ("angle", 0.017453292519943295, 0.0),
    "m": ("length", 1.0, 0.0), "cm": ("length", 1e-2, 0.0), "mm": ("length", 1e-3, 0.0),
    "rad/s": ("angular speed", 1.0, 0.0), "deg/s": ("angular speed", 0.017453292519943295, 0.0),
    "rpm": ("angular speed", 0.10471975511965977, 0.0),
    "m/s": ("speed", 1.0, 0.0), "mm/s": ("speed", 1e-3, 0.0),
    "Pa": ("pressure", 1.0, 0.0), "kPa": ("pressure", 1e3, 0.0), "MPa": ("pressure", 1e6, 0.0),
    "mbar": ("pressure", 1e2, 0.0), "bar": ("pressure", 1e5, 0.0), "psi": ("pressure", 6894.757293168361, 0.0),
    "N": ("force", 1.0, 0.0), "kN": ("force", 1e3, 0.0),
    "N m": ("torque", 1.0, 0.0), "kN m": ("torque", 1e3, 0.0),
    "degC": ("temperature", 1.0, 0.0), "K": ("temperature", 1.0, -273.15),
}  # fmt: skip
"""Unit -> dimension, factor and constant that give SI (temperatures: degC)."""

_DIMENSIONS = {
    "angle": ("angle", "length"),
    "rate": ("angular speed", "speed"),
    "pressure": ("pressure",),
    "air_temperature": ("temperature",),
    "measured_torque": ("torque", "force"),
}
"""What a channel may hold. A linear axis counts 1 m as 1 rad and 1 N as 1 N m."""


def to_si(value: Array, unit: str) -> Array:
    """``value`` (n,) in ``unit`` -> SI (temperatures: degC)."""
    _, factor, constant = UNITS[unit]
    return value * factor + constant


@dataclass(frozen=True)
class Clock:
    """Column of the sampling instants."""

    column: str
    unit: str = "s"


@dataclass(frozen=True)
class Chamber:
    """Pressure of one cylinder chamber and the piston area it acts on."""

    column: str
    unit: str
    area_m2: float = positive(10.0)


@dataclass(frozen=True)
class CylinderForce:
    """p_cap A_cap - p_rod A_rod [N], times ``arm_m`` [N m] where one is given. Pressures without rod chamber: tank."""

    cap: Chamber
    rod: Chamber | None = None
    arm_m: float | None = quantity(-10.0, 10.0, default=None)


@dataclass(frozen=True)
class Source:
    """How one channel comes from the table: exactly one of ``column``, ``polynomial`` (of a column), ``cylinder``.

    column: value = scale * (scalar named by scale_by) * column + offset, in ``unit``;
    polynomial: value = c0 + c1 x + c2 x**2 + ... in ``unit``, x the column ``of`` as recorded.
    """

    unit: str | None = None
    column: str | None = None
    scale: float = quantity(default=1.0)
    scale_by: str | None = None
    offset: float = quantity(default=0.0)
    of: str | None = None
    polynomial: tuple[float, ...] | None = quantity(default=None)
    cylinder: CylinderForce | None = None
    time: Clock | None = None


@dataclass(frozen=True)
class Csv:
    """How a CSV file is written; the first row that is kept holds the column names."""

    delimiter: str = ","
    decimal: str = "."
    comment: str = "#"
    skip_rows: float = quantity(0.0, 1e6, default=0.0)


@dataclass(frozen=True)
class ImportMap:
    """Channels by name (angle/<side>, rate/<side>, pressure/<line>, air_temperature, measured_torque) and their clocks.

    ``start_s``, ``stop_s``: what to keep, in seconds of the time columns. ``epoch_s``: Unix time of time zero.
    """

    schema: str
    channels: dict[str, Source]
    time: Clock | None = None
    start_s: float | None = quantity(default=None)
    stop_s: float | None = quantity(default=None)
    epoch_s: float = quantity(0.0, 2.0**31, default=1e9)
    csv: Csv = field(default_factory=Csv)

    def clock(self, channel: str) -> Clock:
        """The time column of a channel."""
        clock = self.channels[channel].time or self.time
        assert clock is not None  # load_map has checked it
        return clock


def load_map(path: str | Path) -> ImportMap:
    """Read and check an import map."""
    reader = Reader(Path(path), MapFileError)
    data = reader.load()
    if not isinstance(data, Mapping):
        raise reader.fail("(top level)", data, "a mapping with the keys of an import map")
    if data.get("schema") != SCHEMA:
        raise reader.fail("schema", data.get("schema"), f"'{SCHEMA}'")
    found = reader.build(ImportMap, data, "")
    if not found.channels:
        raise reader.fail("channels", {}, "at least one channel")
    for name, source in found.channels.items():
        if source.time is None and found.time is None:
            raise reader.fail("time", None, f"this section, or channels.{name}.time")
    for name, source in found.channels.items():
        _check_channel(found, reader, name, source)
    if found.time is not None:
        _check_unit(reader, "time.unit", found.time.unit, ("time",))
    if found.start_s is not None and found.stop_s is not None and found.stop_s <= found.start_s:
        raise reader.fail("stop_s", found.stop_s, f"more than start_s ({found.start_s:g})")
    if found.csv.skip_rows != int(found.csv.skip_rows):
        raise reader.fail("csv.skip_rows", found.csv.skip_rows, "a whole number")
    for key in ("delimiter", "decimal", "comment"):
        if len(getattr(found.csv, key)) != 1:
            raise reader.fail(f"csv.{key}", getattr(found.csv, key), "one character")
    if found.csv.delimiter == found.csv.decimal:
        raise reader.fail("csv.delimiter", found.csv.delimiter, "another character than csv.decimal")
    return found


def _check_channel(found: ImportMap, reader: Reader, name: str, source: Source) -> None:
    key = f"channels.{name}"
    kind, _, rest = name.partition("/")
    sided = kind in ("angle", "rate")
    known = (sided and rest in ("left", "right")) or (kind == "pressure" and rest) or (kind in _DIMENSIONS and not rest)
    if not known or (not rest and (sided or kind == "pressure")) or not TOPIC.fullmatch(name):
        expected = "angle/left, angle/right, rate/left, rate/right, pressure/<line>, air_temperature or measured_torque"
        raise reader.fail("channels", name, expected)
    ways = [way for way in ("column", "polynomial", "cylinder") if getattr(source, way) is not None]
    if len(ways) != 1:
        raise reader.fail(key, ways or None, "exactly one of column, polynomial, cylinder")
    if source.cylinder is None:
        _check_unit(reader, f"{key}.unit", source.unit, _DIMENSIONS[kind])
    else:
        if source.unit is not None:
            raise reader.fail(f"{key}.unit", source.unit, "no unit: a cylinder gives N, or N m with arm_m")
        if kind != "measured_torque":
            raise reader.fail(f"{key}.cylinder", "a section", "a cylinder for measured_torque only")
        for chamber in ("cap", "rod"):
            pressure = getattr(source.cylinder, chamber)
            if pressure is not None:
                _check_unit(reader, f"{key}.cylinder.{chamber}.unit", pressure.unit, ("pressure",))
    if (source.polynomial is None) != (source.of is None):
        raise reader.fail(f"{key}.of", source.of, "the column of a polynomial, together with 'polynomial'")
    if source.polynomial is not None and not source.polynomial:
        raise reader.fail(f"{key}.polynomial", [], "at least one coefficient")
    if source.column is None and (source.scale, source.scale_by, source.offset) != (1.0, None, 0.0):
        raise reader.fail(f"{key}.scale", source.scale, "scale, scale_by and offset beside 'column' only")
    if source.time is not None:
        _check_unit(reader, f"{key}.time.unit", source.time.unit, ("time",))
    if kind == "rate":
        angle = f"angle/{rest}"
        if angle not in found.channels or found.clock(angle) != found.clock(name):
            raise reader.fail(key, name, f"{angle} beside it, on the same time column (both go into one message)")
        dimension = UNITS.get(found.channels[angle].unit or "", ("angle",))[0]
        _check_unit(reader, f"{key}.unit", source.unit, ("speed",) if dimension == "length" else ("angular speed",))


def _check_unit(reader: Reader, key: str, unit: str | None, dimensions: tuple[str, ...]) -> None:
    fitting = [name for name, (dimension, _, _) in UNITS.items() if dimension in dimensions]
    if unit not in fitting:
        raise reader.fail(key, unit, f"one of {', '.join(fitting)}")
