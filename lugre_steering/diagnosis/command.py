# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The ``diagnose`` command: bags in, a folder of results out."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lugre_steering.diagnosis.engine import MATERIAL_SHARE, diagnose
from lugre_steering.errors import BagError, DataError, LugreSteeringError
from lugre_steering.vehicle import load, save

STEPS = (
    "reading", "checking the data", "estimating the motion", "recalibrating", "fingerprints", "rivals", "verifying",
    "next experiment", "writing the report",
)  # fmt: skip
"""The words with which the steps of a diagnosis announce themselves, in order."""
REPORT_FILES = ("report.html", "before_after_*.png", "residual_*.png", "evidence.png", "heldout.png")
"""What a report may consist of; which of them there are depends on the diagnosis."""


def run(
    bags: Sequence[Path],
    vehicle_file: Path,
    out: Path,
    *,
    seed: int = 1,
    material: float = MATERIAL_SHARE,
    report: bool = True,
    progress: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Diagnose and write DIR/diagnosis.json, augmented.yaml and, if wanted, report.html and pictures; returns the JSON.

    The report of an earlier diagnosis in DIR is taken away: its pictures would not belong to this result.
    """
    vehicle = load(vehicle_file)
    for bag in bags:
        if not bag.exists():
            raise BagError(f"{bag}: no such bag, expected a rosbag2 folder or an .mcap or .db3 file")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LugreSteeringError(
            f"{out}: cannot be made: {error.strerror or error}; expected a writable folder"
        ) from error
    result = diagnose(bags, vehicle, seed=seed, material=material, progress=progress)
    try:
        _take_away_report(out)
        (out / "diagnosis.json").write_text(json.dumps(result.json, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        save(result.vehicle, out / "augmented.yaml")
    except OSError as error:
        raise DataError(f"{error.filename or out}: cannot be written ({error.strerror or error})") from error
    if report:
        progress("writing the report")
        from lugre_steering.report.diagnosis_report import write_report

        note = write_report(result, out).note
        if note:
            print(f"lugre-steering: {note}", file=sys.stderr)
    return result.json


def _take_away_report(out: Path) -> None:
    if (out / "diagnosis.json").is_file():  # else they are no files of ours
        for file in (file for pattern in REPORT_FILES for file in out.glob(pattern)):
            if file.is_file():
                file.unlink()
