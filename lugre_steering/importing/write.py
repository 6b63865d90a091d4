# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A table and its map become a bag with the standard topics."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.bag import BagWriter, Part, cdr
from lugre_steering.bag.load import confirmed
from lugre_steering.bag.messages import Bytes
from lugre_steering.errors import BagError, MapFileError
from lugre_steering.importing.channels import Imported, read_channels
from lugre_steering.importing.map import Clock, ImportMap, load_map
from lugre_steering.importing.plausible import check_units, doubts
from lugre_steering.importing.read import read_table
from lugre_steering.provenance import MADE, hashed, provenance
from lugre_steering.recording import IntArray
from lugre_steering.vehicle import Topics, TorqueSensor

FRAME = "base_link"
TOGETHER = 1 << 14
"""Messages of a channel that are in memory at once; each takes far more than its numbers."""


def import_table(file: Path, map_file: Path, out: Path, storage: str = "mcap") -> dict[str, Any]:
    """Turn one table into the bag ``out``; returns the summary of all channels."""
    mapping = load_map(map_file)
    if storage not in ("mcap", "sqlite3"):
        raise MapFileError(f"storage: got '{storage}', expected mcap or sqlite3")
    table = read_table(file, mapping.csv)
    channels = read_channels(table, mapping)
    check_units(file, mapping, channels)
    stamps = {name: header_stamps(file, map_file, mapping, channel) for name, channel in channels.items()}
    logged = _log_times(mapping, channels, stamps)
    origin = provenance("import", {"table": hashed(file), "map": hashed(map_file), "storage": storage})
    marks = {"imported_from": file.name, "import_map": map_file.name, MADE: "\n".join(origin.lines())}
    with (
        staged(out) as folder,
        BagWriter(folder, "sqlite3" if storage == "sqlite3" else "mcap", marks, final=out) as writer,
    ):
        numbers = {name: writer.add_topic(*_topic(name)) for name in channels}
        for stretch in _stretches(logged):
            writer.write([
                Part(numbers[name], logged[name][part], _messages(channels[name], stamps[name], part)) for name, part in stretch.items()
            ])
    told = [each for channel in channels.values() for each in (channel, channel.own_rate()) if each is not None]
    summaries = [{**channel.summary(), "doubts": doubts(mapping, channel, channels.values())} for channel in told]
    left_out = dict(table.left_out)
    return {"bag": str(out), "table": str(file), "map": str(map_file), "left_out": left_out, "channels": summaries}


@contextmanager
def staged(out: Path) -> Iterator[Path]:
    """Where to write the bag ``out``: in a hidden folder beside it, from where it takes its name at once, when whole.

    What a killed import left there is replaced; an import that still runs holds a lock on it.
    """
    if os.path.lexists(out):
        raise BagError(f"{out}: exists already; recordings are never overwritten")
    stage = out.parent / f".{out.name}.importing"
    try:
        stage.mkdir(parents=True, exist_ok=True)
        lock = os.open(stage, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError as error:
        raise BagError(f"{out}: cannot be written ({error})") from error
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise BagError(f"{out}: another import writes it just now") from None
        strangers = [path.name for path in stage.iterdir() if path.name != out.name or path.is_symlink()]
        if strangers:
            raise BagError(f"{stage}: holds '{strangers[0]}', which no import left there; move it away")
        try:
            shutil.rmtree(stage / out.name, ignore_errors=True)
            yield stage / out.name
            (stage / out.name).rename(out)
        except OSError as error:
            raise BagError(f"{out}: cannot be written ({error})") from error
        finally:
            shutil.rmtree(stage / out.name, ignore_errors=True)
            with suppress(OSError):
                stage.rmdir()
    finally:
        os.close(lock)


def header_stamps(file: Path, map_file: Path, mapping: ImportMap, channel: Imported) -> IntArray:
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
    clocks: dict[tuple[Clock, int], IntArray] = {}  # rows at a given rate may be of different number
    keys = {name: (mapping.clock(name), channel.rows.size) for name, channel in channels.items()}
    for name, channel in channels.items():
        known = clocks.setdefault(keys[name], np.zeros(channel.rows.size, np.int64))
        known[channel.rows] = stamps[name]
    for known in clocks.values():
        row = np.flatnonzero(known)
        known[row] = np.maximum.accumulate(confirmed(known[row]) - row) + row
    return {name: clocks[keys[name]][channel.rows] for name, channel in channels.items()}


def _stretches(logged: Mapping[str, IntArray]) -> Iterator[dict[str, slice]]:
    """Stretches of log time, in order, with at most ``TOGETHER`` messages of each channel."""
    begin = dict.fromkeys(logged, 0)
    while True:
        beyond = [log[begin[name] + TOGETHER] for name, log in logged.items() if begin[name] + TOGETHER < log.size]
        end = {name: int(np.searchsorted(log, min(beyond))) if beyond else log.size for name, log in logged.items()}
        yield {name: slice(begin[name], end[name]) for name in logged}
        if not beyond:
            return
        begin = end


def _topic(channel: str) -> tuple[str, str]:
    """Topic and type of a channel."""
    kind, _, rest = channel.partition("/")
    topics = Topics()
    if kind == "angle":
        return f"/{getattr(topics, rest)}", cdr.JOINT_STATE
    if kind == "pressure":
        return f"/{topics.pressure_prefix}{rest}", cdr.FLUID_PRESSURE
    if kind == "measured_torque":
        return f"/{TorqueSensor().topic}", cdr.WRENCH_STAMPED
    return f"/{topics.ambient_temperature}", cdr.TEMPERATURE


def _messages(channel: Imported, stamps: IntArray, part: slice) -> Bytes:
    """Some messages of a channel as rows (n, length)."""
    kind, _, rest = channel.name.partition("/")
    stamp, value = stamps[part], channel.value[part]
    if kind == "angle":
        rate = None if channel.rate is None else channel.rate[part, None]
        return cdr.encode_joint_state(stamp, FRAME, [getattr(Topics(), f"{rest}_joint")], value[:, None], rate)
    if kind == "pressure":
        return cdr.encode_fluid_pressure(stamp, FRAME, value)
    if kind == "measured_torque":
        return cdr.encode_wrench(stamp, FRAME, value)
    return cdr.encode_temperature(stamp, FRAME, value)
