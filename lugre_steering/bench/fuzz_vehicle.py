# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Vehicle files to be damaged, and the rubber table that one of them points to."""

from __future__ import annotations

from pathlib import Path

from lugre_steering.bench import fuzz_text
from lugre_steering.vehicle import load
from lugre_steering.vehicle.model import build_model

_TABLE = "rubber_dma_10hz.csv"
_FILES = ["test_vehicle.yaml", "single_joint_example.yaml", "linear_axis_example.yaml", "one_angle_sensor_example.yaml"]


def corpus(folder: Path) -> None:
    """The shipped vehicle files."""
    fuzz_text.copied([*_FILES, _TABLE], folder)


def attempt(folder: Path, case: int) -> tuple[str, str]:
    """Load a damaged vehicle file and build its model."""

    def use(place: Path) -> None:
        for name in _FILES:
            build_model(load(place / name))

    return fuzz_text.tried(folder, case, [*_FILES, _TABLE], use)
