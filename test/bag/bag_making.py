# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Small synthetic bags, written by rosbags (not by the code under test)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from lugre_steering.recording import Channel, Kind

if TYPE_CHECKING:
    from lugre_steering.proof.sensors import Samples
    from lugre_steering.proof.simulator import CaseData

T0 = 1_790_000_000_000_000_000
TYPES = get_typestore(Stores.ROS2_JAZZY)
JOINT_STATE = "sensor_msgs/msg/JointState"
FLUID_PRESSURE = "sensor_msgs/msg/FluidPressure"
TEMPERATURE = "sensor_msgs/msg/Temperature"
WRENCH = "geometry_msgs/msg/WrenchStamped"

LEFT = Channel(Kind.ANGLE, "left", "steering/left/joint_state", "left_track_steer_joint")
RIGHT = Channel(Kind.ANGLE, "right", "steering/right/joint_state", "right_track_steer_joint")
MAIN_A = Channel(Kind.PRESSURE, "main_a", "steering/pressure/main_a")
AIR = Channel(Kind.AIR_TEMPERATURE, "air", "steering/ambient_temperature")
SENSOR = Channel(Kind.TORQUE, "sensor", "steering/measured_torque")
CHANNELS = (LEFT, RIGHT, MAIN_A, AIR, SENSOR)

Message = tuple[str, str, int, bytes]  # topic, type, log time, serialised
STRIDE = 5
"""Bags of 100 Hz thinned by it have 20 Hz, as slow field recordings have."""
SLOWEST = 8
"""Of 100 Hz leaves 12.5 Hz, with which most effects are found as well."""


def header(stamp_ns: int, frame: str = "axle") -> Any:
    time = TYPES.types["builtin_interfaces/msg/Time"](stamp_ns // 10**9, stamp_ns % 10**9)
    return TYPES.types["std_msgs/msg/Header"](time, frame)


def pack(message: Any, *, little_endian: bool = True) -> bytes:
    return bytes(TYPES.serialize_cdr(message, message.__msgtype__, little_endian=little_endian))


def joint_state(
    stamp_ns: int, names: Iterable[str], position=(), velocity=(), effort=(), frame="axle", **how: bool
) -> bytes:
    arrays = (np.array(list(a), float) for a in (position, velocity, effort))
    return pack(TYPES.types[JOINT_STATE](header(stamp_ns, frame), list(names), *arrays), **how)


def pressure(stamp_ns: int, value: float, frame: str = "axle", **how: bool) -> bytes:
    return pack(TYPES.types[FLUID_PRESSURE](header(stamp_ns, frame), value, 0.0), **how)


def temperature(stamp_ns: int, value: float, **how: bool) -> bytes:
    return pack(TYPES.types[TEMPERATURE](header(stamp_ns), value, 0.0), **how)


def wrench(stamp_ns: int, value: float, frame: str = "axle", **how: bool) -> bytes:
    vector = TYPES.types["geometry_msgs/msg/Vector3"]
    message = TYPES.types["geometry_msgs/msg/Wrench"](vector(1.0, 2.0, 3.0), vector(4.0, 5.0, value))
    return pack(TYPES.types[WRENCH](header(stamp_ns, frame), message), **how)


def angle(t_s: float) -> float:
    return 0.5 * float(np.sin(t_s))


def steering(duration_s: float = 20.0, rate_Hz: int = 100) -> list[Message]:
    """All five quantities: different rates, jittered log times, temperature starting late. Synthetic."""
    return list(_steering(duration_s, rate_Hz))


@cache
def _steering(duration_s: float, rate_Hz: int) -> tuple[Message, ...]:
    rng = np.random.default_rng(7)
    messages: list[Message] = []
    for i in range(int(duration_s * rate_Hz)):
        t = T0 + i * 10**9 // rate_Hz
        late = [int(d) for d in rng.integers(50_000, 900_000, 5)]
        x = angle((t - T0) * 1e-9)
        messages.append(("/" + LEFT.topic, JOINT_STATE, t + late[0], joint_state(t, [LEFT.joint], [x], [0.1 * x])))
        messages.append(("/" + RIGHT.topic, JOINT_STATE, t + late[1], joint_state(t, [RIGHT.joint], [-x])))
        messages.append(("/" + MAIN_A.topic, FLUID_PRESSURE, t + late[2], pressure(t, 7e5 + 1e5 * x)))
        if i % 2 == 0:
            messages.append(("/" + SENSOR.topic, WRENCH, t + late[3], wrench(t, 1e4 * x)))
        if i % rate_Hz == 0 and i >= 5 * rate_Hz:
            messages.append(("/" + AIR.topic, TEMPERATURE, t + late[4], temperature(t, 20.0 + x)))
    return tuple(messages)


def write(
    folder: Path,
    messages: Iterable[Message],
    storage: str = "mcap",
    compression: str = "none",
    topics: Iterable[tuple[str, str]] = (),
) -> Path:
    """A rosbag2 folder made by rosbags; ``compression`` is none, file, message or storage."""
    with_topics = Writer(folder, version=9, storage_plugin=StoragePlugin[storage.upper()])
    if compression != "none":
        with_topics.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with with_topics as bag:
        connections: dict[tuple[str, str], Any] = {}
        for key in topics:
            connections[key] = bag.add_connection(*key, typestore=TYPES)
        for topic, msgtype, log_ns, data in messages:
            if (topic, msgtype) not in connections:
                connections[topic, msgtype] = bag.add_connection(topic, msgtype, typestore=TYPES)
            bag.write(connections[topic, msgtype], log_ns, data)
    return folder


def file_of(folder: Path) -> Path:
    """The storage file in a folder."""
    (file,) = (f for f in folder.iterdir() if f.name != "metadata.yaml")
    return file


def thinned_bag(bag: Path, folder: Path, seconds: float = np.inf) -> Path:
    """A bag with one message of STRIDE of each topic, or its first seconds of them."""
    seen: Counter[str] = Counter()
    kept: list[Message] = []
    with Reader(bag) as reader:
        for connection, log_ns, raw in reader.messages():
            if seen[connection.topic] % STRIDE == 0 and log_ns < reader.start_time + seconds * 1e9:
                kept.append((connection.topic, connection.msgtype, log_ns, bytes(raw)))
            seen[connection.topic] += 1
    return write(folder / bag.name, kept)


def slowly_sampled(data: CaseData, seconds: float = np.inf, stride: int = STRIDE) -> CaseData:
    """A case of the second simulator with one sample of ``stride`` of each sensor, or the first seconds of it, before it is written."""

    def every(samples: tuple[Samples, ...]) -> tuple[Samples, ...]:
        kept = [np.flatnonzero(one.time < seconds)[::stride] for one in samples]
        return tuple(one._replace(time=one.time[at], value=one.value[at]) for one, at in zip(samples, kept, strict=True))

    return replace(data, bags=tuple(replace(bag, angles=every(bag.angles), pressures=every(bag.pressures)) for bag in data.bags))
