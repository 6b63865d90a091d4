# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Channels from columns, as the map says."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from lugre_steering.errors import MapFileError
from lugre_steering.expression import ExpressionError, parse
from lugre_steering.importing.map import (
    READABLE_UNITS,
    Arm,
    Chamber,
    Clock,
    CylinderForce,
    ImportMap,
    Pivots,
    Source,
    to_si,
)
from lugre_steering.importing.table import Table
from lugre_steering.recording import Array

_GLITCHES = 0.01
"""A larger share of strokes that no angle has means wrong pivots; fewer are glitches, and missing."""


class Columns:
    """The columns of a table as the map calls and reads them: by short names, and as signed integers."""

    def __init__(self, table: Table, mapping: ImportMap) -> None:
        self.table, self.names = table, mapping.names
        self.bits = {self.recorded(name): int(bits) for name, bits in mapping.signed.items()}
        for name in self.bits:
            table.column(name)  # a mistyped name would leave numbers unsigned in silence

    def recorded(self, name: str) -> str:
        """The name of a column in the file."""
        return self.names.get(name, name)

    def column(self, name: str) -> Array:
        name = self.recorded(name)
        values = self.table.column(name)
        return signed(values, self.bits[name], f"{self.table.file}: column '{name}'") if name in self.bits else values

    def expression(self, text: str) -> Array:
        """A formula of columns, all equally long, and of single numbers."""
        table = self.table
        known = {*self.names, *table.columns, *table.scalars, *table.unusable}
        formula = parse(text, sorted(known))
        values: dict[str, Array | float] = {}
        columns: dict[str, Array] = {}
        for name in formula.names:
            if self.recorded(name) in table.scalars:
                values[name] = table.scalar(self.recorded(name))
            else:
                values[name] = columns[name] = self.column(name)
        if not columns:
            raise ExpressionError(f"expression '{text}': holds no column; expected at least one")
        first = next(iter(columns))
        for name, value in columns.items():
            same_length(table, name, f"the column '{first}'", columns[first], value)
        return formula.evaluate(values)


def signed(values: Array, bits: int, where: str) -> Array:
    """Two's complement of ``bits``: 2**bits - 1 means -1. What is signed already stays."""
    known = values[np.isfinite(values)]
    half, full = 2.0 ** (bits - 1), 2.0**bits
    wrong = known[(known != np.round(known)) | (known < -half) | (known >= full)]
    if wrong.size:
        raise MapFileError(f"{where}: got {wrong[0]:g}, expected whole numbers of {bits} bits, as 'signed' says")
    return np.where(values >= half, values - full, values)


def times(columns: Columns, clock: Clock, count: int) -> Array:
    """Sampling instants (n,) [s] of a channel of ``count`` samples."""
    if clock.rate_Hz is not None:
        return np.arange(count) / clock.rate_Hz
    value = columns.column(clock.column) if clock.column is not None else columns.expression(clock.expression or "")
    return to_si(value, clock.unit)


def evaluate(columns: Columns, source: Source) -> Array:
    """The channel (n,) in SI."""
    if source.cylinder is not None:
        return _cylinder(columns, source.cylinder)
    if source.pivots is not None:
        return _angle_of_stroke(columns, source.pivots)
    assert source.unit is not None
    if source.expression is not None:
        return to_si(columns.expression(source.expression), source.unit)
    if source.polynomial is not None:
        assert source.of is not None
        return to_si(polynomial(source.polynomial, columns.column(source.of)), source.unit)
    assert source.column is not None
    scale = source.scale * (1.0 if source.scale_by is None else columns.table.scalar(columns.recorded(source.scale_by)))
    return to_si(scale * columns.column(source.column) + source.offset, source.unit)


def polynomial(coefficients: tuple[float, ...], x: Array) -> Array:
    """c0 + c1 x + c2 x**2 + ..."""
    return np.asarray(np.polynomial.polynomial.polyval(x, np.array(coefficients)), np.float64)


def _cylinder(columns: Columns, cylinder: CylinderForce) -> Array:
    force, cap = _chamber_force(columns, cylinder.cap), f"the column '{cylinder.cap.column}'"
    if cylinder.rod is not None:
        against = _chamber_force(columns, cylinder.rod)
        same_length(columns.table, cylinder.rod.column, cap, force, against)
        force = force - against
    if cylinder.arm is not None:
        arm = _arm(columns, cylinder.arm)
        same_length(columns.table, cylinder.arm.of, cap, force, arm)
        return force * arm
    return force if cylinder.arm_m is None else force * cylinder.arm_m


def _arm(columns: Columns, arm: Arm) -> Array:
    return polynomial(arm.polynomial_m, columns.column(arm.of))


def _chamber_force(columns: Columns, chamber: Chamber) -> Array:
    return to_si(columns.column(chamber.column), chamber.unit) * chamber.area_m2


def _angle_of_stroke(columns: Columns, pivots: Pivots) -> Array:
    """Angle [rad] by the law of cosines in the triangle of the hinge and both pivots."""
    (x, y), (u, v) = pivots.chassis_m, pivots.knuckle_m
    chassis, knuckle = math.hypot(x, y), math.hypot(u, v)
    zero = math.hypot(u - x, v - y) if pivots.zero_length_m is None else pivots.zero_length_m
    stroke = columns.column(pivots.column)
    length = zero + to_si(stroke, pivots.unit)
    cosine = (chassis**2 + knuckle**2 - length**2) / (2.0 * chassis * knuckle)
    impossible = np.flatnonzero(np.abs(cosine) > 1.0)
    if impossible.size > _GLITCHES * length.size:
        first = impossible[0]
        raise MapFileError(
            f"{columns.table.file}: column '{pivots.column}': {impossible.size} of {length.size} values can be no stroke: "
            f"{stroke[first]:g} puts the pivots {length[first]:.4g} m apart, "
            f"expected {abs(chassis - knuckle):.4g} to {chassis + knuckle:.4g} m"
        )
    cosine[impossible] = np.nan
    opening = math.atan2(x * v - y * u, x * u + y * v)  # from the chassis pivot to the knuckle pivot at zero angle
    return np.asarray(math.copysign(1.0, opening) * np.arccos(cosine) - opening, np.float64)


def unit_of(source: Source) -> str:
    """SI unit of a channel."""
    if source.cylinder is not None:
        return "N" if source.cylinder.arm_m is None and source.cylinder.arm is None else "N m"
    if source.pivots is not None:
        return "rad"
    assert source.unit is not None
    return _SI[READABLE_UNITS[source.unit][0]]


_SI: Mapping[str, str] = {
    "angle": "rad", "length": "m", "angular speed": "rad/s", "speed": "m/s", "pressure": "Pa", "force": "N", "torque": "N m",
    "temperature": "degC",
}  # fmt: skip


def same_length(table: Table, name: str, reference: str, expected: Array, value: Array) -> None:
    """Refuse columns that do not belong together row by row."""
    if expected.size != value.size:
        raise MapFileError(f"{table.file}: {name}: has {value.size} values, expected {expected.size} as in {reference}")
