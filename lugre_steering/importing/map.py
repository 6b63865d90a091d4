# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The import map: which column of a table is which channel, in which unit, on which clock."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lugre_steering.errors import MapFileError
from lugre_steering.expression import FUNCTIONS
from lugre_steering.importing.stamps import ORDERS
from lugre_steering.recording import Array
from lugre_steering.schema import Reader, positive, quantity
from lugre_steering.vehicle.check import TOPIC

SCHEMA = "lugre_steering/import/1"

READABLE_UNITS: Mapping[str, tuple[str, float, float]] = {
    "s": ("time", 1.0, 0.0), "ms": ("time", 1e-3, 0.0), "us": ("time", 1e-6, 0.0), "ns": ("time", 1e-9, 0.0),
    "min": ("time", 60.0, 0.0), "h": ("time", 3600.0, 0.0), "d": ("time", 86400.0, 0.0),
    "rad": ("angle", 1.0, 0.0), "mrad": ("angle", 1e-3, 0.0), "deg": ("angle", 0.017453292519943295, 0.0),
    "0.1 deg": ("angle", 0.0017453292519943296, 0.0), "0.01 deg": ("angle", 0.00017453292519943296, 0.0),
    "rev": ("angle", 6.283185307179586, 0.0),
    "m": ("length", 1.0, 0.0), "cm": ("length", 1e-2, 0.0), "mm": ("length", 1e-3, 0.0), "um": ("length", 1e-6, 0.0),
    "in": ("length", 0.0254, 0.0),
    "rad/s": ("angular speed", 1.0, 0.0), "deg/s": ("angular speed", 0.017453292519943295, 0.0),
    "rpm": ("angular speed", 0.10471975511965977, 0.0),
    "m/s": ("speed", 1.0, 0.0), "mm/s": ("speed", 1e-3, 0.0),
    "Pa": ("pressure", 1.0, 0.0), "kPa": ("pressure", 1e3, 0.0), "MPa": ("pressure", 1e6, 0.0),
    "mbar": ("pressure", 1e2, 0.0), "bar": ("pressure", 1e5, 0.0), "psi": ("pressure", 6894.757293168361, 0.0),
    "kg/cm2": ("pressure", 98066.5, 0.0),
    "N": ("force", 1.0, 0.0), "kN": ("force", 1e3, 0.0), "lbf": ("force", 4.4482216152605, 0.0),
    "N m": ("torque", 1.0, 0.0), "kN m": ("torque", 1e3, 0.0), "mN m": ("torque", 1e-3, 0.0),
    "lbf ft": ("torque", 1.3558179483314004, 0.0), "lbf in": ("torque", 0.1129848290276167, 0.0),
    "degC": ("temperature", 1.0, 0.0), "degF": ("temperature", 5.0 / 9.0, -160.0 / 9.0), "K": ("temperature", 1.0, -273.15),
}  # fmt: skip
"""Unit -> dimension, factor and constant that give SI (temperatures: degC)."""

RADIANS = ("rad", "mrad")
"""Units of angles that would hide degrees: these must not turn further than a turn, or than the map says."""

WAYS = ("column", "polynomial", "expression", "cylinder", "pivots")
"""How a channel may come from the table."""
CLOCK_WAYS = ("column", "expression", "rate_Hz")
"""How sampling instants may come from the table."""
ENCODINGS = ("utf-8", "utf-16", "latin-1", "cp1252")
ALLOWANCES: Mapping[str, str] = {
    "short_rows": "rows that end early: the cells they lack count as missing",
    "text_rows": "rows without any number (units, remarks, footers): they are left out",
    "text_cells": "text in a column of numbers: it counts as missing",
}
WHITESPACE = "whitespace"
"""As ``csv.delimiter``: any run of blanks and tabs."""

DIMENSIONS = {
    "angle": ("angle", "length"),
    "rate": ("angular speed", "speed"),
    "pressure": ("pressure",),
    "air_temperature": ("temperature",),
    "measured_torque": ("torque", "force"),
}
"""What a channel may hold. A linear axis counts 1 m as 1 rad and 1 N as 1 N m."""


def to_si(value: Array, unit: str) -> Array:
    """``value`` (n,) in ``unit`` -> SI (temperatures: degC)."""
    _, factor, constant = READABLE_UNITS[unit]
    return value * factor + constant


@dataclass(frozen=True)
class Clock:
    """Sampling instants: exactly one of a ``column`` or an ``expression`` of columns in ``unit``, or rows at ``rate_Hz``."""

    column: str | None = None
    unit: str = "s"
    expression: str | None = None
    rate_Hz: float | None = positive(1e9, default=None)

    def __str__(self) -> str:
        """As messages call it."""
        return next(f"{way} '{value:g}'" if isinstance(value, float) else f"{way} '{value}'"
                    for way in CLOCK_WAYS if (value := getattr(self, way)) is not None)  # fmt: skip


@dataclass(frozen=True)
class Chamber:
    """Pressure of one cylinder chamber and the piston area it acts on."""

    column: str
    unit: str
    area_m2: float = positive(10.0)


@dataclass(frozen=True)
class Arm:
    """Moment arm c0 + c1 x + c2 x**2 + ... [m], x the column ``of`` as recorded."""

    of: str
    polynomial_m: tuple[float, ...] = quantity(-1e6, 1e6)


@dataclass(frozen=True)
class CylinderForce:
    """p_cap A_cap - p_rod A_rod [N], times ``arm_m`` or ``arm`` [N m] where one is given. Without rod chamber: tank."""

    cap: Chamber
    rod: Chamber | None = None
    arm_m: float | None = quantity(-10.0, 10.0, default=None)
    arm: Arm | None = None


@dataclass(frozen=True)
class Pivots:
    """Angle of a joint from the stroke of a cylinder across it: pivots [x, y] [m] from the hinge, ``knuckle_m`` (which
    turns) at zero angle.

    ``zero_length_m``: pivot to pivot where the column reads zero; left out: the column counts from zero angle.
    """

    column: str
    unit: str
    chassis_m: tuple[float, ...] = quantity(-100.0, 100.0)
    knuckle_m: tuple[float, ...] = quantity(-100.0, 100.0)
    zero_length_m: float | None = quantity(0.0, 100.0, default=None)


@dataclass(frozen=True)
class Source:
    """How one channel comes from the table: exactly one of the ``WAYS``.

    column: value = scale * (scalar named by scale_by) * column + offset, in ``unit``;
    polynomial: value = c0 + c1 x + c2 x**2 + ... in ``unit``, x the column ``of`` as recorded;
    expression: a formula of columns and single numbers as recorded, in ``unit``;
    cylinder: torque from pressures; pivots: angle from a stroke. ``farthest``: largest magnitude of an angle [rad] in rad or mrad whose
    joint turns further than a turn.
    """

    unit: str | None = None
    column: str | None = None
    scale: float = quantity(default=1.0)
    scale_by: str | None = None
    offset: float = quantity(default=0.0)
    of: str | None = None
    polynomial: tuple[float, ...] | None = quantity(default=None)
    expression: str | None = None
    cylinder: CylinderForce | None = None
    pivots: Pivots | None = None
    farthest: float | None = positive(1e6, default=None)
    time: Clock | None = None


@dataclass(frozen=True)
class Csv:
    """How a CSV file is written.

    Below ``skip_rows`` lines come ``header_rows``, of which ``name_row`` (from 1) holds the column names; ``columns``
    names them here instead. ``dates``: of dates by slashes or dashes, ``dmy`` or ``mdy``. ``allow``: what is otherwise refused, of
    ``ALLOWANCES``.
    """

    delimiter: str = ","
    decimal: str = "."
    comment: str = "#"
    skip_rows: float = quantity(0.0, 1e6, default=0.0)
    header_rows: float = quantity(0.0, 100.0, default=1.0)
    name_row: float = quantity(1.0, 100.0, default=1.0)
    columns: tuple[str, ...] | None = quantity(default=None)
    allow: tuple[str, ...] = ()
    encoding: str = "utf-8"
    dates: str | None = None


@dataclass(frozen=True)
class ImportMap:
    """Channels by name (angle/<side>, rate/<side>, pressure/<line>, air_temperature, measured_torque) and their clocks.

    ``start_s``, ``stop_s``: what to keep, in seconds of the time columns. ``epoch_s``: Unix time of time zero.
    ``names``: short names of columns, for expressions. ``signed``: columns of unsigned numbers that mean signed integers
    (two's complement) of so many bits.
    """

    schema: str
    channels: dict[str, Source]
    time: Clock | None = None
    start_s: float | None = quantity(default=None)
    stop_s: float | None = quantity(default=None)
    epoch_s: float = quantity(0.0, 2.0**31, default=1e9)
    csv: Csv = field(default_factory=Csv)
    names: dict[str, str] = field(default_factory=dict)
    signed: dict[str, float] = field(default_factory=dict, metadata={"low": 2.0, "high": 32.0, "open_low": False})

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
        _check_clock(reader, "time", found.time)
    if found.start_s is not None and found.stop_s is not None and found.stop_s <= found.start_s:
        raise reader.fail("stop_s", found.stop_s, f"more than start_s ({found.start_s:g})")
    for column, bits in found.signed.items():
        _check_whole(reader, f"signed.{column}", bits)
    for name in found.names:
        if not name.isidentifier() or name in FUNCTIONS:
            raise reader.fail("names", name, "letters, digits and _ that begin with a letter, and no function")
    _check_csv(reader, found.csv)
    return found


def _check_csv(reader: Reader, options: Csv) -> None:
    for key in ("skip_rows", "header_rows", "name_row"):
        _check_whole(reader, f"csv.{key}", getattr(options, key))
    if options.header_rows and options.name_row > options.header_rows:
        raise reader.fail("csv.name_row", options.name_row, f"one of the {options.header_rows:g} header rows")
    if len(options.decimal) != 1:
        raise reader.fail("csv.decimal", options.decimal, "one character")
    if len(options.delimiter) != 1 and options.delimiter != WHITESPACE:
        raise reader.fail("csv.delimiter", options.delimiter, f"one character, or '{WHITESPACE}'")
    for what in options.allow:
        if what not in ALLOWANCES:
            raise reader.fail("csv.allow", what, f"one of {', '.join(ALLOWANCES)}")
    if options.columns is not None and len(set(options.columns)) != len(options.columns):
        raise reader.fail("csv.columns", list(options.columns), "distinct names")
    if options.dates is not None and options.dates not in ORDERS:
        raise reader.fail("csv.dates", options.dates, f"one of {', '.join(ORDERS)}")
    if options.encoding not in ENCODINGS:
        raise reader.fail("csv.encoding", options.encoding, f"one of {', '.join(ENCODINGS)}")


def _check_whole(reader: Reader, key: str, value: float) -> None:
    if value != int(value):
        raise reader.fail(key, value, "a whole number")


def _check_clock(reader: Reader, key: str, clock: Clock) -> None:
    ways = [way for way in CLOCK_WAYS if getattr(clock, way) is not None]
    if len(ways) != 1:
        raise reader.fail(key, ways or None, f"exactly one of {', '.join(CLOCK_WAYS)}")
    _check_unit(reader, f"{key}.unit", clock.unit, ("time",))


def _check_channel(found: ImportMap, reader: Reader, name: str, source: Source) -> None:
    key = f"channels.{name}"
    kind, _, rest = name.partition("/")
    sided = kind in ("angle", "rate")
    known = (sided and rest in ("left", "right")) or (kind == "pressure" and rest) or (kind in DIMENSIONS and not rest)
    if not known or (not rest and (sided or kind == "pressure")) or not TOPIC.fullmatch(name):
        expected = "angle/left, angle/right, rate/left, rate/right, pressure/<line>, air_temperature or measured_torque"
        raise reader.fail("channels", name, expected)
    ways = [way for way in WAYS if getattr(source, way) is not None]
    if len(ways) != 1:
        raise reader.fail(key, ways or None, f"exactly one of {', '.join(WAYS)}")
    if source.cylinder is not None:
        _check_cylinder(reader, key, kind, source, source.cylinder)
    elif source.pivots is not None:
        _check_pivots(reader, key, kind, source, source.pivots)
    else:
        _check_unit(reader, f"{key}.unit", source.unit, DIMENSIONS[kind])
    if (source.polynomial is None) != (source.of is None):
        raise reader.fail(f"{key}.of", source.of, "the column of a polynomial, together with 'polynomial'")
    if source.polynomial is not None and not source.polynomial:
        raise reader.fail(f"{key}.polynomial", [], "at least one coefficient")
    if source.column is None and (source.scale, source.scale_by, source.offset) != (1.0, None, 0.0):
        raise reader.fail(f"{key}.scale", source.scale, "scale, scale_by and offset beside 'column' only")
    if source.farthest is not None and (kind != "angle" or source.unit not in RADIANS):
        raise reader.fail(f"{key}.farthest", source.farthest, f"an angle in {' or '.join(RADIANS)}")
    if source.time is not None:
        _check_clock(reader, f"{key}.time", source.time)
    if kind == "rate":
        angle = f"angle/{rest}"
        if angle not in found.channels or found.clock(angle) != found.clock(name):
            raise reader.fail(key, name, f"{angle} beside it, on the same time column (both go into one message)")
        dimension = READABLE_UNITS.get(found.channels[angle].unit or "", ("angle",))[0]  # pivots: no unit, an angle
        _check_unit(reader, f"{key}.unit", source.unit, ("speed",) if dimension == "length" else ("angular speed",))


def _check_cylinder(reader: Reader, key: str, kind: str, source: Source, cylinder: CylinderForce) -> None:
    if source.unit is not None:
        raise reader.fail(f"{key}.unit", source.unit, "no unit: a cylinder gives N, or N m with an arm")
    if kind != "measured_torque":
        raise reader.fail(f"{key}.cylinder", "a section", "a cylinder for measured_torque only")
    for chamber in ("cap", "rod"):
        pressure = getattr(cylinder, chamber)
        if pressure is not None:
            _check_unit(reader, f"{key}.cylinder.{chamber}.unit", pressure.unit, ("pressure",))
    if cylinder.arm is not None and cylinder.arm_m is not None:
        raise reader.fail(f"{key}.cylinder.arm", "a section", "either arm or arm_m")
    if cylinder.arm is not None and not cylinder.arm.polynomial_m:
        raise reader.fail(f"{key}.cylinder.arm.polynomial_m", [], "at least one coefficient")


def _check_pivots(reader: Reader, key: str, kind: str, source: Source, pivots: Pivots) -> None:
    if source.unit is not None:
        raise reader.fail(f"{key}.unit", source.unit, "no unit: pivots give rad")
    if kind != "angle":
        raise reader.fail(f"{key}.pivots", "a section", "pivots for an angle only")
    _check_unit(reader, f"{key}.pivots.unit", pivots.unit, ("length",))
    for pivot in ("chassis_m", "knuckle_m"):
        if len(getattr(pivots, pivot)) != 2:
            raise reader.fail(f"{key}.pivots.{pivot}", list(getattr(pivots, pivot)), "two coordinates [x, y]")
    (x, y), (u, v) = pivots.chassis_m, pivots.knuckle_m
    if abs(x * v - y * u) <= 1e-3 * math.hypot(x, y) * math.hypot(u, v):
        expected = "pivots and hinge as a triangle: in one line a stroke tells no direction"
        raise reader.fail(f"{key}.pivots.knuckle_m", list(pivots.knuckle_m), expected)


def _check_unit(reader: Reader, key: str, unit: str | None, dimensions: tuple[str, ...]) -> None:
    fitting = [name for name, (dimension, _, _) in READABLE_UNITS.items() if dimension in dimensions]
    if unit not in fitting:
        raise reader.fail(key, unit, f"one of {', '.join(fitting)}")
