# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""``lugre_steering.diagnose``: which physics the model leaves out, from a program."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from lugre_steering.bag.given import Given, each, files, given_recordings
from lugre_steering.diagnosis.engine import MATERIAL_SHARE, diagnose_recordings
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.effects.registry import leaving_out, made
from lugre_steering.errors import DataError
from lugre_steering.given_number import check_number
from lugre_steering.given_several import texts
from lugre_steering.pool import one_blas_thread
from lugre_steering.result import writing_into
from lugre_steering.vehicle import Vehicle, vehicle_of


def diagnose(
    data: Given | Sequence[Given],
    vehicle: Vehicle | str | Path,
    *,
    seed: int = 1,
    material: float = MATERIAL_SHARE,
    without: str | Sequence[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Say which physics the vehicle file leaves out of bags (paths) or recordings of one vehicle, all together.

    ``data``: one or several paths of rosbag2 folders or files, or recordings; ``vehicle``: a vehicle or the path of its file;
    ``seed``: of noise draws and bootstraps; ``material``: share of the torque amplitude from which an effect is called material;
    ``without``: names of the catalogue that are not considered, to see what takes their place; ``progress`` is called with what is
    being done.
    """
    check_number("seed", seed, 0, whole=True)
    check_number("material", material, 0.0, 1.0)
    model = vehicle_of(vehicle)
    unsought = texts("without", without)
    with leaving_out(unsought), one_blas_thread():
        items = each(data)
        recordings = given_recordings(items, model.channels, progress)
        found = diagnose_recordings(recordings, model, seed=seed, material=material, progress=progress)
    sheet = None if isinstance(vehicle, Vehicle) else Path(vehicle)
    return replace(found, provenance=made("diagnose", {"seed": seed, "material": material, "without": unsought}, sheet, files(items)))


def write_report(diagnosis: Diagnosis, out: str | Path) -> Path:
    """Write report.html and its pictures into a folder (which ``Diagnosis.save`` may have filled); the page."""
    from lugre_steering.diagnosis.report import page

    if not isinstance(diagnosis, Diagnosis):
        raise DataError(f"diagnosis: got {reprlib.repr(diagnosis)}, expected what diagnose gives")
    with writing_into(out) as folder:
        page.write_report(diagnosis, folder)
    return folder / "report.html"
