# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The ``diagnose`` command: bags in, a folder of results out."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lugre_steering.bag.batch import read_of_machine
from lugre_steering.bag.find import Skipped
from lugre_steering.bag.load import distinct
from lugre_steering.bag.reader import must_exist
from lugre_steering.diagnosis.engine import MATERIAL_SHARE, diagnose_recordings
from lugre_steering.diagnosis.result import AUGMENTED, FORMED, SCHEMA, Diagnosis, picture_names
from lugre_steering.effects.registry import leaving_out, made
from lugre_steering.errors import DataError
from lugre_steering.files import earlier_result, is_ours, not_ours, output_folder
from lugre_steering.vehicle import load
from lugre_steering.watch.window import read_window

STEPS = (
    "reading", "checking the data", "estimating the motion", "recalibrating", "fingerprints", "rivals", "verifying",
    "next experiment", "writing the report",
)  # fmt: skip
"""The words with which the steps of a diagnosis announce themselves, in order."""


PICTURES = ("before_after_*.png", "residual_*.png", "law_*.png", "evidence.png", "heldout.png")
"""What an earlier report may have left in the folder."""


def run(
    bags: Sequence[Path],
    vehicle_file: Path,
    out: Path,
    *,
    seed: int = 1,
    material: float = MATERIAL_SHARE,
    report: bool = True,
    windows: Sequence[Path] = (),
    without: Sequence[str] = (),
    progress: Callable[[str], None] = lambda _: None,
    skipped: Sequence[Skipped] = (),
) -> Diagnosis:
    """Diagnose bags, and windows that the live node has written; returns the result.

    Written are DIR/diagnosis.json, augmented.yaml, formed.yaml (see ``FrictionForm``) and, if wanted, report.html and pictures.
    ``skipped``: what has been left out before; of several bags, those of other machines are left out too. Both are told among the
    findings about the data. ``without``: names that are not considered, to see what takes their place. The report of an earlier
    diagnosis in DIR is taken away: its pictures would not belong to this result.
    """
    vehicle = load(vehicle_file)
    _check_given(bags, windows, material)
    with output_folder(out):
        pictures = [file.name for pattern in PICTURES for file in out.glob(pattern)] if report else []
        old = earlier_result(out, "diagnosis.json", SCHEMA, (AUGMENTED, FORMED, "report.html", *pictures), vehicle_file)
        seen = [(str(file), read_window(file, vehicle.channels).recording) for file in windows]
        recordings, others = read_of_machine(bags, vehicle.channels, progress) if bags else ([], ())
        left = {one.bag for one in others}
        used = [bag for bag in bags if str(bag) not in left]
        recordings = distinct([*zip(map(str, used), recordings, strict=True), *seen])
        with leaving_out(without):
            found = diagnose_recordings(recordings, vehicle, seed=seed, material=material, progress=progress)
        result = replace(
            found,
            data_quality=(*(one.finding() for one in (*skipped, *others)), *found.data_quality),
            provenance=made("diagnose", {"seed": seed, "material": material, "without": list(without)}, vehicle_file, [*used, *windows]),
        )
        try:
            if old is not None:
                _take_away_report(out, old)
            result.write(out)
        except OSError as error:
            raise DataError(f"{error.filename or out}: cannot be written ({error.strerror or error})") from error
        if report:
            progress("writing the report")
            _write_report(result, out)
    return result


def _check_given(bags: Sequence[Path], windows: Sequence[Path], material: float) -> None:
    if not 0.0 <= material <= 1.0:
        raise DataError(f"--material: got {material:g}, expected a share from 0 to 1")
    if not bags and not windows:
        raise DataError("no recording is given, expected a BAG or --window FILE")
    for bag in bags:
        must_exist(bag)


def _write_report(result: Diagnosis, out: Path) -> None:
    """Page and pictures, and a line on stderr where something of them had to be left out."""
    from lugre_steering.diagnosis.report.page import write_report

    note = write_report(result, out).note
    if note:
        print(f"lugre-steering: {note}", file=sys.stderr)


def _take_away_report(out: Path, old: Mapping[str, Any]) -> None:
    """Delete the report of the diagnosis whose result ``old`` lies in ``out``, file by file as it was written."""
    try:
        names = [*(f"before_after_{bag}" for bag in old["bags"]), *(f"residual_{effect['id']}" for effect in old["effects"])]
        names += [f"law_{law['id']}" for law in old.get("laws", ())]
    except (KeyError, TypeError):
        raise not_ours(out / "diagnosis.json") from None
    for name in ("report.html", *picture_names([*names, "evidence", "heldout"])):
        if is_ours(out / name):  # somebody may have put another there since
            (out / name).unlink()
