# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The recorded examples in ``bags/``: ``python -m lugre_steering.simulate.examples DIR``; equal bytes each time."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from dataclasses import dataclass
from pathlib import Path

from lugre_steering.errors import LugreSteeringError
from lugre_steering.simulate.command import load_vehicle
from lugre_steering.simulate.manoeuvres import BUILT_IN, motion_of
from lugre_steering.simulate.run import sensing_of, simulate
from lugre_steering.simulate.write import write_bag
from lugre_steering.vehicle.tables import limit_device


@dataclass(frozen=True)
class Example:
    """One recording of the test vehicle; ``stop`` hides the elastic end stop in it."""

    name: str
    manoeuvre: str
    storage: str
    stop: bool
    angle_rate_Hz: float
    pressure_rate_Hz: float
    seed: int


EXAMPLES = (
    Example("synthetic_double_cycle", "double-cycle", "mcap", False, 100.0, 50.0, 1),
    Example("synthetic_hidden_stop_a", "double-cycle", "sqlite3", True, 100.0, 50.0, 2),
    Example("synthetic_hidden_stop_b", "varied-rates", "mcap", True, 50.0, 50.0, 3),
)


def write_example(example: Example, folder: Path) -> None:
    """Write one example as ``folder/<name>``."""
    vehicle = load_vehicle(None)
    if example.stop:
        vehicle = vehicle.replace(effects=(limit_device(),))
    sensing = dataclasses.replace(
        sensing_of(vehicle),
        angle_rate_Hz=example.angle_rate_Hz,
        pressure_rate_Hz=example.pressure_rate_Hz,
        jitter_s=2e-4,
        pressure_resolution_Pa=500.0,
        seed=example.seed,
    )
    run = simulate(vehicle, motion_of(BUILT_IN[example.manoeuvre], vehicle), sensing)
    hidden = f"with a hidden elastic end stop {limit_device().parameters}" if example.stop else "nothing hidden"
    write_bag(folder / example.name, run, f"{example.manoeuvre}, config/test_vehicle.yaml, {hidden}", example.storage)


def main() -> int:
    parser = argparse.ArgumentParser(description="write the recorded examples (synthetic)")
    parser.add_argument("folder", type=Path, help="where the bag folders are made; existing ones are not overwritten")
    folder = parser.parse_args().folder
    try:
        for example in EXAMPLES:
            write_example(example, folder)
    except LugreSteeringError as error:
        print(f"examples: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
