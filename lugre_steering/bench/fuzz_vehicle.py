# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Vehicle files to be damaged, one with laws that nobody listed, and the rubber table that one of them points to."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from lugre_steering.bench import fuzz_text
from lugre_steering.vehicle import load
from lugre_steering.vehicle.model import build_model

_TABLE = "rubber_dma_10hz.csv"
_FILES = ["test_vehicle.yaml", "single_joint_example.yaml", "linear_axis_example.yaml", "one_angle_sensor_example.yaml"]
_WITH_LAWS = "with_laws.yaml"
_LAWS = """laws:
- {channel: conservative_torque, coordinate: rate, form: step, range: [-1.0, 1.0], memory: lag, memory_size: 2.0, heldout_gain: 0.9,
  values: {before: 0.0, after: 3.0, at: 0.2, width: 0.05}, title: a drag that remembers the rate, intervals: {after: [2.5, 3.5]}}
- {channel: gain, coordinate: angle, form: table, range: [-1.0, 1.0], knots: [0.0, 0.1, 0.0]}
- {channel: conservative_torque, coordinate: torque, form: linear, range: [-3.0, 3.0], memory: ring, memory_size: 0.8,
  values: {value: 0.0, slope: 0.1}}
"""


def corpus(folder: Path) -> None:
    """The shipped vehicle files, and a joint with laws."""
    fuzz_text.copied([*_FILES, _TABLE], folder)
    (folder / _WITH_LAWS).write_text((folder / "single_joint_example.yaml").read_text(encoding="utf-8") + _LAWS, encoding="utf-8")


def _use(name: str, place: Path) -> None:
    build_model(load(place / name))


def attempt(folder: Path, case: int) -> tuple[str, str]:
    """Load a damaged vehicle file and build its model."""
    uses = {name: partial(_use, name) for name in [*_FILES, _WITH_LAWS]}
    return fuzz_text.tried(folder, case, uses | {_TABLE: partial(_use, "test_vehicle.yaml")})
