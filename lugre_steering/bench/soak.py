# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The live node for a long time, and very many samples in compressed time.

Over real DDS: latency of the first and the last fifth, updates lost, and how the memory of the node's process grows after the first
fifth. In compressed time: samples of a vehicle that steers to and fro, in blocks as replay pushes them; memory, finite numbers, and
that a push of single samples (as the live node does) gives the same.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.bench.live import eight_lines, observe, serve
from lugre_steering.bench.neighbour import SECOND, STEP_S, Strokes, use_own_domain
from lugre_steering.estimator import Estimator
from lugre_steering.recording import Array, IntArray, Kind
from lugre_steering.vehicle import save

SAMPLE_S = 1.0
BLOCK = 120_000


def resident_mb(pid: int) -> float:
    """Memory of a process [MB]; NaN when it is gone."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    except (OSError, IndexError):
        return math.nan
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def growth(times_s: Array, memory_mb: Array) -> float:
    """Slope [MB/h] after the first fifth."""
    late = times_s > times_s[0] + 0.2 * (times_s[-1] - times_s[0])
    return float(np.polyfit(times_s[late], memory_mb[late], 1)[0] * 3600.0)


def live(rate_hz: float, seconds: float) -> dict[str, Any]:
    """The node over DDS, its memory looked at now and then."""
    memory: list[tuple[float, float]] = []
    on = True

    def look() -> None:
        while on:
            children = sorted(process.pid for process in multiprocessing.active_children() if process.pid is not None)
            if len(children) == 2:  # the node is started first
                memory.append((time.monotonic(), resident_mb(children[0])))
            time.sleep(SAMPLE_S)

    looking = threading.Thread(target=look, daemon=True)
    looking.start()
    with tempfile.TemporaryDirectory() as folder:
        vehicle_file = str(Path(folder) / "vehicle.yaml")
        save(eight_lines(), vehicle_file)
        got = observe(serve, vehicle_file, "events", rate_hz, seconds)
    on = False
    looking.join()
    latency_ms = got["latency_ns"] * 1e-6
    fifth = max(1, latency_ms.size // 5)
    times, sizes = np.array([row for row in memory if math.isfinite(row[1])]).T
    return {
        "rate_Hz": got["pairs"] / got["seconds"], "seconds": got["seconds"], "updates": got["pairs"],
        "lost_updates": got["pairs"] - latency_ms.size, "exceptions": got["exceptions"],
        "p99_first_fifth_ms": float(np.percentile(latency_ms[:fifth], 99.0)),
        "p99_last_fifth_ms": float(np.percentile(latency_ms[-fifth:], 99.0)),
        "memory_MB": float(sizes[-1]), "memory_growth_MB_per_h": growth(times, sizes),
    }  # fmt: skip


def block(strokes: Strokes, first: int, count: int, rng: np.random.Generator) -> tuple[IntArray, IntArray, Array, Array]:
    """``count`` instants at 500 Hz from the ``first`` one: channels, stamps, values, rates of all samples in order."""
    channels = [i for i, channel in enumerate(strokes.vehicle.channels) if channel.kind is not Kind.AIR_TEMPERATURE]
    instants = np.arange(first, first + count)
    values = np.array([strokes.at(float(i) * STEP_S) for i in instants])[:, channels]
    sensors = strokes.vehicle.sensors
    kinds = [strokes.vehicle.channels[i].kind for i in channels]
    noise = np.array([math.radians(sensors.angle_noise_deg) if kind is Kind.ANGLE else sensors.pressure_noise_Pa for kind in kinds])
    values = values + noise * rng.standard_normal(values.shape)
    stamps = np.repeat(1_700_000_000 * SECOND + instants * 2_000_000, len(channels))
    return np.tile(np.array(channels, np.int64), count), stamps, values.ravel(), np.full(stamps.size, np.nan)


def compressed(samples: int, seed: int) -> dict[str, Any]:
    """Many samples through the chain."""
    strokes, rng = Strokes(eight_lines()), np.random.default_rng(seed)
    per_instant = len(strokes.vehicle.channels) - 1
    single, blocks = Estimator(strokes.vehicle), Estimator(strokes.vehicle)
    small = block(strokes, 0, 2000, rng)
    one = [row["total"] for sample in zip(*small, strict=True) for row in single.push(*map(_plain, sample))[0].copy()]
    together = blocks.push_block(*small)[0]["total"]
    off = float(np.abs(np.array(one) - together).max())
    done, finite, begin, memory = small[0].size, True, time.monotonic(), []
    while done < samples:
        part = block(strokes, done // per_instant, BLOCK // per_instant, rng)
        estimates, residuals = blocks.push_block(*part)
        finite = finite and bool(np.isfinite(estimates["total"]).all() and np.isfinite(residuals["residual"]).all())
        done += part[0].size
        memory.append(resident_mb(os.getpid()))
    late = memory[len(memory) // 5 :]
    return {
        "samples": done, "seconds": time.monotonic() - begin, "simulated_h": done / per_instant * 0.002 / 3600.0, "finite": finite,
        "live_minus_replay_Nm": off, "memory_growth_MB": late[-1] - late[0],
    }  # fmt: skip


def _plain(value: Any) -> Any:
    return value.item()


def run(argv: list[str]) -> None:
    """``python -m lugre_steering.bench soak``: a few lines, or JSON."""
    parser = argparse.ArgumentParser(prog="bench soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0, help="of the live node")
    parser.add_argument("--rate", type=float, default=500.0, help="of each topic [Hz]")
    parser.add_argument("--samples", type=int, default=10_000_000, help="in compressed time")
    parser.add_argument("--json", action="store_true", help="print JSON instead of the lines")
    options = parser.parse_args(argv)
    use_own_domain()
    result = {"compressed": compressed(options.samples, 1), "live": live(options.rate, 60.0 * options.minutes)}
    if options.json:
        json.dump(result, sys.stdout, indent=2)
        print()
        return
    for name, part in result.items():
        words = (f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}" for key, value in part.items())
        print(f"{name}: {', '.join(words)}")
