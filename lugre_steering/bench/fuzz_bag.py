# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Bags to be damaged: every storage and compression, with and without metadata.yaml, index and checksums."""

from __future__ import annotations

import random
import shutil
import struct
import tempfile
from functools import lru_cache
from pathlib import Path

from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from lugre_steering.bag import Bag, read_recording
from lugre_steering.bench.fuzz_bytes import damage_bytes
from lugre_steering.bench.replay import VEHICLE, write_cycle
from lugre_steering.errors import LugreSteeringError
from lugre_steering.recording import Channel, Recording
from lugre_steering.vehicle import load

_SECONDS = 5.0
_FOOTER = struct.Struct("<BQQQI")  # of an MCAP file, before its last eight bytes


@lru_cache(maxsize=1)
def _channels() -> tuple[Channel, ...]:
    return tuple(load(VEHICLE).channels)


def corpus(folder: Path) -> None:
    """Sound bags, one folder each."""
    write_cycle(folder / "mcap", _SECONDS)
    write_cycle(folder / "sqlite3", _SECONDS, "sqlite3")
    for storage, modes in (("MCAP", ("STORAGE", "MESSAGE", "FILE")), ("SQLITE3", ("MESSAGE", "FILE"))):
        for mode in modes:
            writer = Writer(folder / f"{storage}_{mode}".lower(), version=9, storage_plugin=StoragePlugin[storage])
            writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
            _copy(folder / "mcap", writer)
    without_index = folder / "mcap_without_index"
    shutil.copytree(folder / "mcap", without_index)
    file = without_index / "mcap.mcap"
    data = file.read_bytes()
    begin = _FOOTER.unpack_from(data, len(data) - _FOOTER.size - 8)[2]
    file.write_bytes(data[:begin] + _FOOTER.pack(2, 20, 0, 0, 0) + data[-8:])


def _copy(source: Path, writer: Writer) -> None:
    types = get_typestore(Stores.ROS2_JAZZY)
    with Bag(source) as bag, writer:
        topics = [writer.add_connection(c.topic, c.msgtype, typestore=types) for c in bag.connections]
        for block in bag.messages():
            for i, number in enumerate(block.connection):
                writer.write(topics[number], int(block.log_ns[i]), block.bytes_of(i))


def damaged(source: Path, target: Path, dice: random.Random) -> str:
    """Copy a bag and damage one of its files; returns what was done."""
    shutil.copytree(source, target)
    files = sorted(target.iterdir(), key=lambda file: file.name == "metadata.yaml")
    file = files[-1] if dice.random() < 0.1 else files[0]
    done = damage_bytes(file, dice)
    without = "" if dice.random() < 0.7 else ", no metadata.yaml"
    if without:
        (target / "metadata.yaml").unlink()
    return f"{source.name}, {file.name}: {done}{without}"


def _samples(recording: Recording) -> int:
    single = [signal for signal in (recording.air_temperature, recording.measured_torque) if signal is not None]
    return sum(signal.value.size for signal in [*recording.angle.values(), *recording.pressure.values(), *single])


@lru_cache(maxsize=1)
def _whole(source: Path) -> int:
    return _samples(read_recording(source, _channels()))


def attempt(folder: Path, case: int) -> tuple[str, str]:
    """Read a damaged bag; fewer samples than it held without a finding or a rejection are lost in silence."""
    dice = random.Random(case)
    source = dice.choice(sorted(folder.iterdir()))
    with tempfile.TemporaryDirectory(prefix="lugre_steering_fuzz_") as temporary:
        target = Path(temporary) / "bag"
        done = damaged(source, target, dice)
        try:
            recording = read_recording(target, _channels())
        except LugreSteeringError as error:
            return "refused", f"{done}: {error}"
    told = {finding.finding for finding in recording.findings} - {"no_metadata"} or recording.rejected
    lost = _whole(folder / "mcap") - _samples(recording)
    return ("silent loss", f"{done}: {lost} samples") if lost > 0 and not told else ("read", done)
