# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Messages per second of a whole replay against bare rosbags deserialisation of the same bag, in one run.

The replay reads, estimates, writes the output bag (inputs and results), the summary and the picture; the comparison
only reads and deserialises. Both have run once before they are timed.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from lugre_steering.bag import BagWriter, Part, cdr
from lugre_steering.recording import Kind
from lugre_steering.replay.run import replay
from lugre_steering.resources import config_folder
from lugre_steering.serialise import as_json
from lugre_steering.vehicle import load

VEHICLE = config_folder() / "test_vehicle.yaml"
START_NS = 1_780_000_000 * 10**9
Storage = Literal["mcap", "sqlite3"]


def write_cycle(folder: Path, seconds: float, storage: Storage = "mcap", rate_Hz: float = 100.0) -> None:
    """A synthetic bag of the test vehicle: sinusoidal angles, pressures of matching sign, all topics staggered."""
    channels = [channel for channel in load(VEHICLE).channels if channel.kind is not Kind.AIR_TEMPERATURE]
    step_ns = round(1e9 / rate_Hz)
    tick = np.arange(int(seconds * rate_Hz), dtype=np.int64)
    angle = 0.4 * np.sin(2.0 * np.pi * tick / rate_Hz / 20.0)
    with BagWriter(folder, storage, {"synthetic": "benchmark"}) as writer:
        parts = []
        for i, channel in enumerate(channels):
            # Both angles share their stamps; what arrives is staggered.
            stamp = START_NS + tick * step_ns + (0 if channel.kind is Kind.ANGLE else i * step_ns // 10)
            if channel.kind is Kind.ANGLE:
                kind = cdr.JOINT_STATE
                rows = cdr.encode_joint_state(stamp, "synthetic", [channel.joint], angle[:, None])
            else:
                kind = cdr.FLUID_PRESSURE
                rows = cdr.encode_fluid_pressure(stamp, "synthetic", 1e6 + 5e5 * (-1) ** i * np.sign(angle))
            number = writer.add_topic("/" + channel.topic, kind)
            parts.append(Part(number, stamp + i * step_ns // 20, rows))
        writer.write(parts)


def deserialise(folder: Path) -> int:
    """Every message of the bag through rosbags; returns their number."""
    count = 0
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            count += 1
    return count


def measure(bag: Path, vehicle: Path, rounds: int) -> dict[str, Any]:
    """Median times [s] of both over one bag, taken in turns."""
    with tempfile.TemporaryDirectory() as folder:
        tasks: dict[str, Callable[[], Any]] = {
            "rosbags": lambda: deserialise(bag),
            "replay": lambda: replay([bag], vehicle, Path(folder)),
        }
        count = int(tasks["rosbags"]())
        tasks["replay"]()  # compiles, or loads the compiled code
        seconds: dict[str, list[float]] = {name: [] for name in tasks}
        for _ in range(rounds):
            for name, task in tasks.items():
                begin = time.perf_counter()
                task()
                seconds[name].append(time.perf_counter() - begin)
    median = {name: statistics.median(times) for name, times in seconds.items()}
    return {
        "messages": count,
        "rosbags_s": median["rosbags"],
        "replay_s": median["replay"],
        "rosbags_messages_per_s": count / median["rosbags"],
        "replay_messages_per_s": count / median["replay"],
        "replay_over_rosbags": median["replay"] / median["rosbags"],
    }


def run(argv: Sequence[str]) -> None:
    """Command line of this benchmark."""
    parser = argparse.ArgumentParser(prog="python -m lugre_steering.bench replay", description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="length of the synthetic bag [600]")
    parser.add_argument("--rounds", type=int, default=3, help="timings of each, of which the median counts [3]")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    options = parser.parse_args(argv)
    results = {}
    for storage in ("mcap", "sqlite3"):
        with tempfile.TemporaryDirectory() as folder:
            bag = Path(folder) / f"synthetic_{storage}"
            write_cycle(bag, options.seconds, storage)
            results[storage] = measure(bag, VEHICLE, options.rounds)
    if options.json:
        print(as_json(results))
        return
    for storage, result in results.items():
        print(
            f"replay, {storage}: {result['replay_messages_per_s']:,.0f} messages/s; bare rosbags reading: "
            f"{result['rosbags_messages_per_s']:,.0f} messages/s; time ratio {result['replay_over_rosbags']:.2f}"
        )
