# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Window files: the samples around an instant at which the model was found not to match, as ``diagnose --window`` reads them."""

from __future__ import annotations

import json
import tokenize
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lugre_steering.chain.step import Records
from lugre_steering.errors import DataError
from lugre_steering.files import refuse_irregular, replacing
from lugre_steering.provenance import Provenance
from lugre_steering.recording import Array, Channel, IntArray, Kind, Recording, Signal
from lugre_steering.serialise import plain
from lugre_steering.vehicle import Vehicle

SCHEMA = "lugre_steering/window/1"
CAPACITY = 1 << 19
LARGEST_BYTES = 64 * CAPACITY
SAMPLE = np.dtype([("channel", np.int64), ("stamp_ns", np.int64), ("value", np.float64), ("rate", np.float64)])


class SampleRing:
    """The latest ``CAPACITY`` samples of all channels, in a ring."""

    def __init__(self) -> None:
        self._ring: Records = np.full(CAPACITY, np.zeros(1, SAMPLE)[0])  # written once now, so that memory does not grow as it fills
        self._count = 0

    def add(self, channel: int, stamp_ns: int, value: float, rate: float) -> None:
        self._ring[self._count % CAPACITY] = channel, stamp_ns, value, rate
        self._count += 1

    def copy(self) -> Records:
        """A copy of them, in order of arrival: as quick as memory allows, since torques wait for it."""
        kept, next_ = min(self._count, CAPACITY), self._count % CAPACITY
        rows: Records = np.concatenate([self._ring[next_:kept], self._ring[:next_]])
        return rows


@dataclass(frozen=True)
class Window:
    """What was written, and why."""

    reason: str
    recording: Recording


class Part(NamedTuple):
    """Samples of a window: how much time [s] they hold, and how much of what they are to show had gone from the ring before."""

    samples: Records
    seconds: float
    missed_s: float

    @property
    def missing(self) -> str:
        """What is missing, in words; "" if nothing is."""
        return f"its samples begin {self.missed_s:.1f} s after that did: no more are kept" if self.missed_s else ""


def part_since(samples: Records, since_ns: int, onset_ns: int) -> Part:
    """The samples of a ring from a stamp on; at ``onset_ns`` (0: at no instant) began what they are to show."""
    kept = samples[(samples["stamp_ns"] >= since_ns) & (samples["stamp_ns"] > 0)]
    if not kept.size:
        return Part(kept, 0.0, 0.0)
    missed_ns = int(kept["stamp_ns"].min()) - onset_ns if onset_ns else 0
    return Part(kept, float(np.ptp(kept["stamp_ns"])) * 1e-9, max(0, missed_ns) * 1e-9)


def _label(channel: Channel) -> str:
    return f"{channel.kind.name.lower()}/{channel.name}"


def write_window(file: Path, vehicle: Vehicle, reason: str, samples: Records, made: Provenance) -> None:
    """Write samples, reason and how the window came about; ``OSError`` if that is not possible."""
    about = {
        "schema": SCHEMA, "vehicle": vehicle.name, "reason": reason, "channels": [_label(channel) for channel in vehicle.channels],
        "provenance": plain(made),
    }  # fmt: skip
    with replacing(file) as stream:
        np.savez_compressed(stream, about=np.array(json.dumps(about)), samples=samples)


def read_window(file: Path, channels: Sequence[Channel]) -> Window:
    """A window as a recording; ``DataError`` if it is none, damaged, or of a vehicle with other channels."""
    try:
        refuse_irregular(file)
        with zipfile.ZipFile(file) as archive:
            if sum(item.file_size for item in archive.infolist()) > LARGEST_BYTES:
                raise DataError(f"{file}: larger than any window, expected at most {LARGEST_BYTES} bytes")
        with np.load(file, allow_pickle=False) as content:
            about, samples = json.loads(str(content["about"])), content["samples"]
        known = about["schema"] == SCHEMA and samples.dtype == SAMPLE and samples.ndim == 1
        reason, labels = str(about["reason"]), [str(label) for label in about["channels"]]
    except OSError as error:
        raise DataError(f"{file}: cannot be read ({error.strerror or error})") from error
    except (
        ValueError, KeyError, TypeError, EOFError, NotImplementedError, RuntimeError, MemoryError, zipfile.BadZipFile, zlib.error,
        SyntaxError, tokenize.TokenError,  # NumPy reads headers as text of Python
    ) as error:  # fmt: skip
        raise DataError(f"{file}: is damaged or no window file, expected one that the live node wrote") from error
    if not known:
        raise DataError(f"{file}: is of another version, expected {SCHEMA}")
    wanted = [_label(channel) for channel in channels]
    if labels != wanted:
        raise DataError(f"{file}: holds {', '.join(labels)}, expected {', '.join(wanted)} as the vehicle file says")
    return Window(reason, _recording(file, channels, samples))


def _recording(file: Path, channels: Sequence[Channel], samples: Records) -> Recording:
    kept = samples[(samples["stamp_ns"] > 0) & np.isfinite(samples["value"])]
    if not kept.size:
        raise DataError(f"{file}: holds no sample, expected some")
    start_ns = int(kept["stamp_ns"].min())
    angle: dict[str, Signal] = {}
    rate: dict[str, Signal] = {}
    pressure: dict[str, Signal] = {}
    others: dict[Kind, Signal] = {}
    for number, channel in enumerate(channels):
        rows = kept[kept["channel"] == number]
        stamps, first = np.unique(rows["stamp_ns"], return_index=True)
        if not stamps.size:
            continue
        signal = _signal(stamps, rows["value"][first], start_ns)
        if channel.kind is Kind.ANGLE:
            angle[channel.name] = signal
            given = np.isfinite(rows["rate"][first])
            if given.any():
                rate[channel.name] = _signal(stamps[given], rows["rate"][first][given], start_ns)
        elif channel.kind is Kind.PRESSURE:
            pressure[channel.name] = signal
        else:
            others[channel.kind] = signal
    return Recording(
        name=file.stem, start_ns=start_ns, angle=angle, pressure=pressure, rate=rate,
        air_temperature=others.get(Kind.AIR_TEMPERATURE), measured_torque=others.get(Kind.TORQUE),
    )  # fmt: skip


def _signal(stamps: IntArray, value: Array, start_ns: int) -> Signal:
    return Signal(np.asarray((stamps - start_ns) * 1e-9, np.float64), np.asarray(value, np.float64))
