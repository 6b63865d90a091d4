# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A simulated recording as a rosbag2 folder, labelled synthetic in its name, its metadata, every header and a topic
of its own."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError
from rosbags.typesys import Stores, get_typestore

from lugre_steering.bag import cdr
from lugre_steering.bag.messages import Bytes
from lugre_steering.errors import BagError, DataError, reason
from lugre_steering.files import new_folder
from lugre_steering.provenance import MADE, Provenance
from lugre_steering.recording import TRUTH, Array, IntArray, Kind
from lugre_steering.simulate.run import Simulated
from lugre_steering.simulate.sensors import nanoseconds
from lugre_steering.vehicle.sensors import true_angle

START_NS = 1_780_000_000 * 10**9
"""Stamp of the first message: fixed, so that equal simulations give equal bytes."""
FRAME = "synthetic"
STRING = "std_msgs/msg/String"

STORAGES = ("mcap", "sqlite3")


def check_storage(storage: str) -> None:
    """Refuse what bags are not written in."""
    if storage not in STORAGES:
        raise DataError(f"storage: got {storage!r}, expected {' or '.join(STORAGES)}")


def write_bag(
    folder: Path, run: Simulated, label: str, storage: str = "mcap", compress: bool = True, made: Provenance | None = None
) -> None:
    """Write all inputs and the truth (at the stamps of the first track's angles) into a new rosbag2 folder,
    zstd-compressed; how it came about (``made``) stands in its metadata."""
    topics = [*_inputs(run), *_truth(run)]
    stamps = np.concatenate([stamp for _, _, stamp, _ in topics])
    topic = np.repeat(np.arange(len(topics)), [stamp.size for _, _, stamp, _ in topics])
    within = np.concatenate([np.arange(stamp.size) for _, _, stamp, _ in topics])
    store = get_typestore(Stores.ROS2_JAZZY)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with new_folder(folder) as filling:  # half a recording would stand in the way of the next attempt
            writer = Writer(filling, version=9, storage_plugin=StoragePlugin[storage.upper()])
            if compress:
                mode = CompressionMode.STORAGE if storage == "mcap" else CompressionMode.FILE
                writer.set_compression(mode, CompressionFormat.ZSTD)
            writer.set_custom_data("synthetic", label)
            if made is not None:
                writer.set_custom_data(MADE, "\n".join(made.lines()))
            with writer:
                text = store.types[STRING](data=f"synthetic: {label}")
                said = writer.add_connection(f"/{TRUTH}/label", STRING, typestore=store)
                writer.write(said, START_NS, store.serialize_cdr(text, STRING))
                # Both joints may share a topic.
                kinds = dict(t[:2] for t in topics)
                by_name = {name: writer.add_connection(name, kind, typestore=store) for name, kind in kinds.items()}
                connections = [by_name[name] for name, _, _, _ in topics]
                for i in np.argsort(stamps, kind="stable"):
                    rows = topics[topic[i]][3]
                    writer.write(connections[topic[i]], int(stamps[i]), rows[within[i]].tobytes())
    except WriterError as error:
        raise BagError(f"{folder}: {error}") from error
    except (OSError, sqlite3.Error) as error:
        raise BagError(f"{folder}: cannot be written ({reason(error)})") from error


_Topic = tuple[str, str, IntArray, Bytes]


def _inputs(run: Simulated) -> list[_Topic]:
    topics: list[_Topic] = []
    for channel, signal in run.signals.items():
        stamp = nanoseconds(signal.time_s, START_NS)
        if channel.kind is Kind.ANGLE:
            kind = cdr.JOINT_STATE
            rows = cdr.encode_joint_state(stamp, FRAME, [channel.joint], signal.value[:, None])
        elif channel.kind is Kind.PRESSURE:
            kind, rows = cdr.FLUID_PRESSURE, cdr.encode_fluid_pressure(stamp, FRAME, signal.value)
        elif channel.kind is Kind.TORQUE:
            kind, rows = cdr.WRENCH_STAMPED, cdr.encode_wrench(stamp, FRAME, signal.value)
        else:
            kind, rows = cdr.TEMPERATURE, cdr.encode_temperature(stamp, FRAME, signal.value)
        topics.append(("/" + channel.topic.lstrip("/"), kind, stamp, rows))
    return topics


def _truth(run: Simulated) -> list[_Topic]:
    """Noise-free torque, temperatures and state of the tracks."""
    vehicle, truth = run.vehicle, run.truth
    angles = [channel for channel in run.signals if channel.kind is Kind.ANGLE]
    at = run.signals[angles[0]].time_s
    stamp = nanoseconds(at, START_NS)

    def seen(rows: Array) -> Array:
        return np.stack([np.interp(at, truth.motion.time, row) for row in rows], axis=-1)

    torque = seen(truth.torque[None, :])[:, 0]
    state = (true_angle(vehicle, truth.motion.theta), truth.motion.rate, truth.tracks["torque"])
    joints = [getattr(vehicle.topics, f"{side}_joint") for side in vehicle.sides]
    topics: list[_Topic] = [
        (f"/{TRUTH}/torque", cdr.WRENCH_STAMPED, stamp, cdr.encode_wrench(stamp, FRAME, torque)),
        (f"/{TRUTH}/state", cdr.JOINT_STATE, stamp, cdr.encode_joint_state(stamp, FRAME, joints, *map(seen, state))),
    ]
    for side, temperature in zip(vehicle.sides, seen(truth.tracks["temperature"]).T, strict=True):
        rows = cdr.encode_temperature(stamp, FRAME, temperature)
        topics.append((f"/{TRUTH}/rubber_temperature/{side}", cdr.TEMPERATURE, stamp, rows))
    return topics
