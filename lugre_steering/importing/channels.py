# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Channels of a table on their own clocks; what is odd is counted, nothing is repaired."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lugre_steering.bag.load import set_back
from lugre_steering.errors import MapFileError
from lugre_steering.expression import ExpressionError
from lugre_steering.importing.evaluate import Columns, evaluate, same_length, times, unit_of
from lugre_steering.importing.map import ImportMap
from lugre_steering.importing.table import Table
from lugre_steering.recording import Array, IntArray, Mask

GAP_FACTOR = 5.0
"""A pause of so many median sampling intervals counts as a gap."""
OUTLIER_FACTOR = 10.0
"""A sample that departs from both neighbours, the same way, by so many usual steps counts as an outlier."""


@dataclass(frozen=True)
class Imported:
    """One channel on its own clock: ``time_s`` (n,) of the time column, ``value`` (n,) SI, ``rows`` of the table (true
    where used), and the count of rows left out. ``rate`` (n,) of an angle, NaN where the table has none."""

    name: str
    unit: str
    time_s: Array
    value: Array
    rows: Mask
    missing: int
    outside: int
    rate: Array | None = None

    def own_rate(self) -> Imported | None:
        """The rate of an angle as a channel, where the table has it."""
        if self.rate is None:
            return None
        known = np.isfinite(self.rate)
        rows = self.rows.copy()
        rows[rows] = known
        name, missing = self.name.replace("angle/", "rate/"), int(np.sum(~known))
        return Imported(name, f"{self.unit}/s", self.time_s[known], self.rate[known], rows, missing, 0)

    def summary(self) -> dict[str, Any]:
        """Rate, gaps and outliers."""
        step = np.diff(self.time_s)
        usual = float(np.median(step[step > 0.0])) if np.any(step > 0.0) else float("nan")
        gaps = np.flatnonzero(step > GAP_FACTOR * usual)
        return {
            "channel": self.name,
            "samples": int(self.time_s.size),
            "from_s": float(self.time_s[0]),
            "to_s": float(self.time_s[-1]),
            "rate_Hz": 1.0 / usual if usual == usual else None,
            "lowest": float(self.value.min()),
            "highest": float(self.value.max()),
            "unit": self.unit,
            "missing": self.missing,
            "outside_start_stop": self.outside,
            "not_increasing": int(np.sum(step <= 0.0)),
            "unusable": unusable(self.time_s),
            "gaps_s": [[float(self.time_s[i]), float(self.time_s[i + 1])] for i in gaps],
            "outliers_s": [float(t) for t in self.time_s[outliers(self.value)]],
        }


def unusable(time_s: Array) -> int:
    """Samples that a reader of the bag leaves out: their clock was set back, or their time is that of another."""
    stamp = np.round(1e9 * np.clip(time_s - np.median(time_s), -9e9, 9e9)).astype(np.int64)  # as far as 64 bits go
    return int(stamp.size - np.unique(stamp[~set_back(stamp)]).size)


def outliers(value: Array) -> IntArray:
    """Indices of single samples that stick out of both neighbours, the same way, by ``OUTLIER_FACTOR`` usual steps.

    A usual step is the 95 % quantile of the differences between neighbours, and at least 0.1 % of the spread.
    """
    step = np.diff(value)
    if step.size < 2:
        return np.empty(0, np.int64)
    low, high = np.quantile(value, [0.01, 0.99])
    usual = max(float(np.quantile(np.abs(step), 0.95)), 1e-3 * float(high - low))
    with np.errstate(over="ignore"):  # what overflows is farther than any outlier
        found = (step[:-1] * step[1:] < 0.0) & (np.minimum(np.abs(step[:-1]), np.abs(step[1:])) > OUTLIER_FACTOR * usual)
    return np.flatnonzero(found) + 1


def read_channels(table: Table, mapping: ImportMap) -> dict[str, Imported]:
    """All channels of the map; a rate goes with its angle."""
    with _asked_by("signed"):
        columns = Columns(table, mapping)
    found: dict[str, Imported] = {}
    for name in sorted(mapping.channels, key=lambda name: name.startswith("rate/")):  # rates after their angles
        if name.startswith("rate/"):
            angle = f"angle/{name.removeprefix('rate/')}"
            found[angle] = replace(found[angle], rate=_rate(columns, mapping, found[angle], name))
        else:
            found[name] = _channel(columns, mapping, name)
    return found


@contextmanager
def _asked_by(key: str) -> Iterator[None]:
    """Errors of a table name the key of the map that asks for what is not there."""
    try:
        yield
    except MapFileError as error:
        raise MapFileError(f"{error} (key '{key}' of the map)") from None


def _channel(columns: Columns, mapping: ImportMap, name: str) -> Imported:
    table, source, clock = columns.table, mapping.channels[name], mapping.clock(name)
    try:
        with _asked_by(f"channels.{name}"):
            value = evaluate(columns, source)
        with _asked_by("time" if source.time is None else f"channels.{name}.time"):
            time = times(columns, clock, value.size)
    except ExpressionError as error:
        raise MapFileError(f"{table.file}: channel {name}: {error}") from error
    same_length(table, name, f"the {clock}", time, value)
    present = np.isfinite(time) & np.isfinite(value)
    low = -np.inf if mapping.start_s is None else mapping.start_s
    high = np.inf if mapping.stop_s is None else mapping.stop_s
    inside = (time >= low) & (time <= high)
    use, missing = present & inside, int(np.sum(~present))
    if not use.any():
        span = f"{np.nanmin(time):g} to {np.nanmax(time):g} s" if np.isfinite(time).any() else "no times"
        raise MapFileError(
            f"{table.file}: channel {name}: no sample is left ({missing} of {time.size} rows hold no number; "
            f"the {clock} has {span}), expected some between start_s and stop_s"
        )
    return Imported(name, unit_of(source), time[use], value[use], use, missing, int(np.sum(present & ~inside)))


def _rate(columns: Columns, mapping: ImportMap, angle: Imported, name: str) -> Array:
    """Rates (n,) at the rows of the angle."""
    try:
        with _asked_by(f"channels.{name}"):
            value = evaluate(columns, mapping.channels[name])
    except ExpressionError as error:
        raise MapFileError(f"{columns.table.file}: channel {name}: {error}") from error
    if value.size != angle.rows.size:
        raise MapFileError(f"{columns.table.file}: {name}: has {value.size} values, expected {angle.rows.size} as {angle.name}")
    rate = np.where(np.isfinite(value), value, np.nan)[angle.rows]
    if np.isnan(rate).all():
        expected = "expected some, or no such channel in the map"
        raise MapFileError(f"{columns.table.file}: channel {name}: no number in any of the {rate.size} rows of {angle.name}, {expected}")
    return rate
