# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings per hour of a fleet against the number of workers, the share that is not work, and what 100 000 recordings would take.

Overhead is what the workers' time, summed over their recordings, lacks of the time for which they were there; starting them counts
apart, as it does not grow with the fleet.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lugre_steering.bench.replay import VEHICLE
from lugre_steering.fleet.run import run as run_fleet
from lugre_steering.fleet.work import FleetOptions
from lugre_steering.pool import in_processes, processors
from lugre_steering.serialise import as_json
from lugre_steering.simulate.command import load_vehicle, run_manoeuvre

MANY = 100_000
PRICE = 0.05
"""Of a processor for an hour, in the currency of the reader."""


def recordings(folder: Path, count: int) -> list[Path]:
    """Synthetic ones of a minute, each with noise of its own."""
    vehicle = load_vehicle(None)
    return [Path(run_manoeuvre("double-cycle", vehicle, folder / str(seed), {"seed": seed})["bag"]) for seed in range(count)]


def start_s(workers: int) -> float:
    """Time [s] until so many workers have imported and loaded what they need; the compiled code is cached by then."""
    begun = time.perf_counter()
    list(in_processes(_ready, [0] * workers, workers))
    return time.perf_counter() - begun


def _ready(number: int) -> int:
    import lugre_steering.fleet.work  # noqa: F401  all that a worker needs

    return number


def measure(bags: Sequence[Path], workers: int, diagnose: bool) -> dict[str, Any]:
    """One fleet from nothing to its report, and again with all of it known."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        options = FleetOptions(diagnose=diagnose)
        starting = start_s(workers)
        begun = time.perf_counter()
        fleet = run_fleet(bags, VEHICLE, out, options=options, jobs=workers)
        whole = time.perf_counter() - begun
        begun = time.perf_counter()
        run_fleet(bags, VEHICLE, out, options=options, jobs=workers)
        again = time.perf_counter() - begun
        kept = sum(file.stat().st_size for file in out.rglob("*") if file.is_file())
    going = max(whole - starting, 1e-9)
    return {
        "workers": workers,
        "recordings": len(bags),
        "seconds": whole,
        "start_s": starting,
        "work_s_per_recording": fleet.work_seconds / len(bags),
        "recordings_per_hour": 3600.0 * len(bags) / going,
        "overhead": max(0.0, 1.0 - fleet.work_seconds / (going * min(workers, len(bags)))),
        "known_again_s": again,
        "bytes_per_recording": kept / len(bags),
    }


def estimate(measured: dict[str, Any]) -> dict[str, float]:
    """100 000 recordings like these at the rate of one measurement."""
    hours = MANY / measured["recordings_per_hour"]
    return {
        "hours": hours, "processor_hours": hours * measured["workers"], "cost": hours * measured["workers"] * PRICE,
        "records_GB": MANY * measured["bytes_per_recording"] * 1e-9,
    }  # fmt: skip


def run(argv: Sequence[str]) -> None:
    """Command line of this benchmark."""
    parser = argparse.ArgumentParser(prog="python -m lugre_steering.bench fleet", description=__doc__)
    parser.add_argument("--recordings", type=int, default=8, help="how many synthetic recordings of a minute [8]")
    parser.add_argument("--no-diagnose", dest="diagnose", action="store_false", help="check and replay only")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    options = parser.parse_args(argv)
    counts = sorted({1, 2, processors()} & set(range(1, processors() + 1)))
    with tempfile.TemporaryDirectory() as folder:
        bags = recordings(Path(folder), options.recordings)
        run_fleet(bags[:1], VEHICLE, Path(folder) / "warm", options=FleetOptions(diagnose=options.diagnose), jobs=1)
        rows = [measure(bags, workers, options.diagnose) for workers in counts]
    result = {"diagnose": options.diagnose, "measured": rows, "hundred_thousand": estimate(rows[-1])}
    if options.json:
        print(as_json(result))
        return
    print("| workers | recordings per hour | work on each | overhead | start | all known, again |\n|---|---|---|---|---|---|")
    for row in rows:
        overhead = f"{100.0 * row['overhead']:.1f} %"
        print(
            f"| {row['workers']} | {row['recordings_per_hour']:,.0f} | {row['work_s_per_recording']:.2f} s | {overhead} | "
            f"{row['start_s']:.1f} s | {row['known_again_s']:.2f} s |"
        )
    whole = result["hundred_thousand"]
    print(
        f"{MANY:,} such recordings at that rate: {whole['hours']:,.0f} h here, {whole['processor_hours']:,.0f} processor hours "
        f"({whole['cost']:,.0f} at {PRICE:g} each), {whole['records_GB']:.1f} GB of records"
    )
