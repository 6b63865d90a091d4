# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The ``calibrate`` command: bags in, a calibrated vehicle file, its record and a picture out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lugre_steering.bag.batch import read_of_machine
from lugre_steering.bag.find import Skipped
from lugre_steering.calibration import result
from lugre_steering.calibration.calibrate import Calibrated, calibrate_recordings, chosen
from lugre_steering.effects.registry import made
from lugre_steering.errors import DataError
from lugre_steering.files import earlier_result, output_folder, write_record
from lugre_steering.report.available import no_pictures
from lugre_steering.vehicle import load

FILES = (result.VEHICLE, "calibration.png")
"""What is written beside the record."""


def calibrate(
    bags: Sequence[Path],
    vehicle_file: Path,
    out: Path,
    *,
    free: Sequence[str] = (),
    fix: Sequence[str] = (),
    prior: Mapping[str, float] | None = None,
    priors: bool = True,
    progress: Callable[[str], None] = lambda _: None,
    skipped: Sequence[Skipped] = (),
) -> dict[str, Any]:
    """Fit the vehicle file to the bags; write calibrated.yaml, calibration.json and calibration.png into ``out``.

    Returns the content of calibration.json. ``free`` adds ``kingpin_arm`` or ``pressure_gain`` to the fitted values,
    ``fix`` keeps some at the sheet, ``prior`` gives relative standard deviations of sheet values.
    ``skipped``: what has been left out before; of several bags, those of other machines are left out too. Both are told among the
    findings about the data.
    """
    vehicle = load(vehicle_file)
    calibrations = chosen(vehicle, free, fix, prior or {})
    options = {"free": free, "fix": fix, "prior": prior or {}, "priors": priors}
    with output_folder(out):
        earlier_result(out, result.RECORD, result.SCHEMA, FILES, vehicle_file)
        recordings, others = read_of_machine(bags, vehicle.channels, progress)
        done = calibrate_recordings(recordings, vehicle, calibrations, priors=priors, progress=progress)
        left = {one.bag for one in others}
        used = [bag for bag in bags if str(bag) not in left]
        found = replace(
            done.calibration,
            bags=tuple(str(bag) for bag in used),
            vehicle=str(vehicle_file),
            vehicle_file=str(vehicle_file),
            data_quality=(*(one.finding() for one in (*skipped, *others)), *done.calibration.data_quality),
            provenance=made("calibrate", options, vehicle_file, used),
        )
        progress("writing")
        try:
            for name in FILES:  # of an earlier run: they would not belong to this record
                (out / name).unlink(missing_ok=True)
            found.write_vehicle(out)
            picture, note = _picture(replace(done, calibration=found), out / "calibration.png")
            found = replace(found, picture=picture, picture_note=note)
            write_record(found.json, out / result.RECORD)
        except OSError as error:
            raise DataError(f"{error.filename or out}: cannot be written ({error.strerror or error})") from error
    return found.json


def _picture(done: Calibrated, file: Path) -> tuple[str | None, str | None]:
    if note := no_pictures():
        return None, note
    from lugre_steering.calibration.figure import draw_calibration

    draw_calibration(done, file)
    return str(file), None
