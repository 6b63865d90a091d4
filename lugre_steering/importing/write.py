# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A table and its map become a bag with the standard topics; what is odd is counted, nothing is repaired."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lugre_steering.bag import BagWriter, Part, cdr
from lugre_steering.bag.load import confirmed
from lugre_steering.bag.messages import Bytes
from lugre_steering.errors import MapFileError
from lugre_steering.importing.map import UNITS, Chamber, Clock, ImportMap, Source, load_map, to_si
from lugre_steering.importing.table import Table, read_table
from lugre_steering.recording import Array, IntArray
from lugre_steering.vehicle import Topics, TorqueSensor

FRAME = "base_link"
GAP_FACTOR = 5.0
"""A pause of so many median sampling intervals counts as a gap."""
OUTLIER_FACTOR = 10.0
"""A sample that departs from both neighbours, the same way, by so many usual steps counts as an outlier."""


@dataclass(frozen=True)
class Imported:
    """One channel on its own clock: ``time_s`` (n,) of the time column, ``value`` (n,) SI, ``rows`` of the table (true
    where used), and the count of rows left out."""

    name: str
    unit: str
    time_s: Array
    value: Array
    rows: NDArray[np.bool_]
    missing: int
    outside: int

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
            "gaps_s": [[float(self.time_s[i]), float(self.time_s[i + 1])] for i in gaps],
            "outliers_s": [float(t) for t in self.time_s[outliers(self.value)]],
        }


def outliers(value: Array) -> IntArray:
    """Indices of single samples that stick out of both neighbours, the same way, by ``OUTLIER_FACTOR`` usual steps.

    A usual step is the 95 % quantile of the differences between neighbours, and at least 0.1 % of the spread.
    """
    step = np.diff(value)
    if step.size < 2:
        return np.empty(0, np.int64)
    low, high = np.quantile(value, [0.01, 0.99])
    usual = max(float(np.quantile(np.abs(step), 0.95)), 1e-3 * float(high - low))
    found = (step[:-1] * step[1:] < 0.0) & (np.minimum(np.abs(step[:-1]), np.abs(step[1:])) > OUTLIER_FACTOR * usual)
    return np.flatnonzero(found) + 1


def import_table(file: Path, map_file: Path, out: Path, storage: str = "mcap") -> dict[str, Any]:
    """Turn one table into the bag ``out``; returns the summary of all channels."""
    mapping = load_map(map_file)
    if storage not in ("mcap", "sqlite3"):
        raise MapFileError(f"storage: got '{storage}', expected mcap or sqlite3")
    table = read_table(file, mapping.csv)
    channels = {name: _channel(table, mapping, name) for name in mapping.channels if not name.startswith("rate/")}
    stamps = {name: _stamps(file, map_file, mapping, channel) for name, channel in channels.items()}
    messages = {name: _messages(table, mapping, channel, stamps[name]) for name, channel in channels.items()}
    logged = _log_times(mapping, channels, stamps)
    marks = {"imported_from": file.name, "import_map": map_file.name}
    with BagWriter(out, "sqlite3" if storage == "sqlite3" else "mcap", marks) as writer:
        writer.write(
            [
                Part(writer.add_topic(topic, msgtype), logged[name], rows)
                for name, (topic, msgtype, rows) in messages.items()
            ]
        )
    summaries = [channel.summary() for channel in channels.values()]
    return {"bag": str(out), "table": str(file), "map": str(map_file), "channels": summaries}


def _stamps(file: Path, map_file: Path, mapping: ImportMap, channel: Imported) -> IntArray:
    """Header stamps (n,) [ns]; rounding the two parts apart keeps nanoseconds."""
    low, high = float(channel.time_s.min()), float(channel.time_s.max())
    if not 0.0 < mapping.epoch_s + low <= mapping.epoch_s + high < 2.0**31:
        raise MapFileError(
            f"{map_file}: key 'epoch_s': got {mapping.epoch_s:g} with times from {low:g} to {high:g} s in {file}, "
            "expected Unix times after 1970 and before 2038"
        )
    return round(mapping.epoch_s * 1e9) + np.round(channel.time_s * 1e9).astype(np.int64)


def _log_times(mapping: ImportMap, channels: Mapping[str, Imported], stamps: Mapping[str, IntArray]) -> dict[str, IntArray]:
    """Log times (n,) [ns] of each channel: the stamps, but in the order of the table's rows.

    So readers see where its time runs back. Channels of one clock are taken together, and stay beside each other.
    """
    clocks: dict[Clock, IntArray] = {}
    for name, channel in channels.items():
        known = clocks.setdefault(mapping.clock(name), np.zeros(channel.rows.size, np.int64))
        known[channel.rows] = stamps[name]
    for known in clocks.values():
        row = np.flatnonzero(known)
        known[row] = np.maximum.accumulate(confirmed(known[row]) - row) + row
    return {name: clocks[mapping.clock(name)][channel.rows] for name, channel in channels.items()}


def _channel(table: Table, mapping: ImportMap, name: str) -> Imported:
    source, clock = mapping.channels[name], mapping.clock(name)
    time = to_si(table.column(clock.column), clock.unit)
    value = evaluate(table, source)
    _same_length(table, name, clock.column, time, value)
    present = np.isfinite(time) & np.isfinite(value)
    low = -np.inf if mapping.start_s is None else mapping.start_s
    high = np.inf if mapping.stop_s is None else mapping.stop_s
    inside = (time >= low) & (time <= high)
    use, missing = present & inside, int(np.sum(~present))
    if not use.any():
        span = f"{np.nanmin(time):g} to {np.nanmax(time):g} s" if np.isfinite(time).any() else "no times"
        raise MapFileError(
            f"{table.file}: channel {name}: no sample is left ({missing} of {time.size} rows hold no number; "
            f"the column '{clock.column}' has {span}), expected some between start_s and stop_s"
        )
    return Imported(name, _unit(source), time[use], value[use], use, missing, int(np.sum(present & ~inside)))


def evaluate(table: Table, source: Source) -> Array:
    """The channel (n,) in SI from the columns of the table."""
    if source.cylinder is not None:
        force = _chamber_force(table, source.cylinder.cap)
        if source.cylinder.rod is not None:
            against = _chamber_force(table, source.cylinder.rod)
            _same_length(table, source.cylinder.rod.column, source.cylinder.cap.column, force, against)
            force = force - against
        return force if source.cylinder.arm_m is None else force * source.cylinder.arm_m
    assert source.unit is not None
    if source.polynomial is not None:
        assert source.of is not None
        values = np.polynomial.polynomial.polyval(table.column(source.of), np.array(source.polynomial))
        return to_si(np.asarray(values, np.float64), source.unit)
    assert source.column is not None
    scale = source.scale * (1.0 if source.scale_by is None else table.scalar(source.scale_by))
    return to_si(scale * table.column(source.column) + source.offset, source.unit)


def _chamber_force(table: Table, chamber: Chamber) -> Array:
    return to_si(table.column(chamber.column), chamber.unit) * chamber.area_m2


def _unit(source: Source) -> str:
    """SI unit of a channel."""
    if source.cylinder is not None:
        return "N" if source.cylinder.arm_m is None else "N m"
    assert source.unit is not None
    return {"angle": "rad", "length": "m", "pressure": "Pa", "force": "N", "torque": "N m", "temperature": "degC"}[
        UNITS[source.unit][0]
    ]


def _same_length(table: Table, name: str, reference: str, expected: Array, value: Array) -> None:
    if expected.size != value.size:
        raise MapFileError(
            f"{table.file}: {name}: has {value.size} values, expected {expected.size} as in the column '{reference}'"
        )


def _messages(table: Table, mapping: ImportMap, channel: Imported, stamp: IntArray) -> tuple[str, str, Bytes]:
    """(topic, type, rows) of one channel."""
    kind, _, rest = channel.name.partition("/")
    topics = Topics()
    if kind == "angle":
        rate = _rate(table, mapping, channel, f"rate/{rest}")
        joint = getattr(topics, f"{rest}_joint")
        rows = cdr.encode_joint_state(stamp, FRAME, [joint], channel.value[:, None], rate)
        return f"/{getattr(topics, rest)}", cdr.JOINT_STATE, rows
    if kind == "pressure":
        rows = cdr.encode_fluid_pressure(stamp, FRAME, channel.value)
        return f"/{topics.pressure_prefix}{rest}", cdr.FLUID_PRESSURE, rows
    if kind == "measured_torque":
        return f"/{TorqueSensor().topic}", cdr.WRENCH_STAMPED, cdr.encode_wrench(stamp, FRAME, channel.value)
    return f"/{topics.ambient_temperature}", cdr.TEMPERATURE, cdr.encode_temperature(stamp, FRAME, channel.value)


def _rate(table: Table, mapping: ImportMap, angle: Imported, rate: str) -> Array | None:
    """Rates (n, 1) at the rows of the angle, NaN where the table has none."""
    if rate not in mapping.channels:
        return None
    value = evaluate(table, mapping.channels[rate])
    if value.size != angle.rows.size:
        raise MapFileError(f"{table.file}: {rate}: has {value.size} values, expected {angle.rows.size} as {angle.name}")
    return value[angle.rows][:, None]
