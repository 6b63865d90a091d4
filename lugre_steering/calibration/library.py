# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""``lugre_steering.calibrate``: baseline parameters fitted to recordings, from a program."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from lugre_steering.bag.given import Given, each, files, given_recordings
from lugre_steering.calibration.calibrate import calibrate_recordings, chosen
from lugre_steering.calibration.result import Calibration
from lugre_steering.effects.registry import made
from lugre_steering.errors import DataError
from lugre_steering.given_number import check_number
from lugre_steering.given_several import texts
from lugre_steering.pool import one_blas_thread
from lugre_steering.vehicle import Vehicle, vehicle_of


def calibrate(
    data: Given | Sequence[Given],
    vehicle: Vehicle | str | Path,
    *,
    free: str | Sequence[str] = (),
    fix: str | Sequence[str] = (),
    prior: Mapping[str, float] | None = None,
    priors: bool = True,
    progress: Callable[[str], None] = lambda _: None,
) -> Calibration:
    """Fit the baseline of a vehicle to bags (paths) or recordings, all together; ``.calibrated`` is the new vehicle.

    ``data``: one or several paths of rosbag2 folders or files, or recordings; ``vehicle``: a vehicle or the path of its file;
    ``free`` adds ``kingpin_arm`` or ``pressure_gain`` to the fitted values, ``fix`` keeps some at the sheet, ``prior`` gives
    relative standard deviations of sheet values, ``priors=False`` lets the data alone decide.
    """
    model = vehicle_of(vehicle)
    items = each(data)
    recordings = given_recordings(items, model.channels, progress)
    freed, fixed = texts("free", free), texts("fix", fix)
    if prior is not None and not isinstance(prior, Mapping):
        raise DataError(f"prior: got {prior!r}, expected a mapping {{name: share}}")
    for name, share in (prior or {}).items():
        check_number(f"prior of {name}", share, 0.0)
    wanted = chosen(model, freed, fixed, prior)
    with one_blas_thread():
        found = calibrate_recordings(recordings, model, wanted, priors=priors, progress=progress).calibration
    sheet = None if isinstance(vehicle, Vehicle) else Path(vehicle)
    options = {"free": freed, "fix": fixed, "prior": prior or {}, "priors": priors}
    file = None if sheet is None else str(vehicle)
    return replace(found, provenance=made("calibrate", options, sheet, files(items)), vehicle_file=file)
