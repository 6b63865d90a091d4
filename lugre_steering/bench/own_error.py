# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How well the recalibrated baseline fits the second simulator with nothing hidden, and what the rest comes from.

Each row adds one difference between the two simulators to the recording and recalibrates again: first a contact of one patch (own
integrator, own rubber law, finer steps), then a patch for each quarter of a roller with its own sliding and heat, then cylinders and
lines, then the motion as the sensors show it. The torque itself is free of noise in every row.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.bag import read_recording
from lugre_steering.data.dataset import Run, motion, prepare
from lugre_steering.diagnosis.loudness import OWN_ERROR
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.proof.blind import noise_of
from lugre_steering.proof.contact import HiddenContact, Patches, run_track
from lugre_steering.proof.rubber import rubber_table
from lugre_steering.proof.sensors import PERIOD_S
from lugre_steering.proof.simulator import BagData, Case, CaseData, load_sheet, simulate_case, write_case
from lugre_steering.recording import Array
from lugre_steering.resources import config_folder
from lugre_steering.serialise import as_json
from lugre_steering.vehicle import Vehicle, load

ROWS = ("one patch", "patches", "cylinders and lines", "measured motion")


def measure(seed: int, sheet_file: Path) -> dict[str, float]:
    """Mean square that recalibration leaves [N2 m2] in each row, and the noise that the pressures of the case would add."""
    data, vehicle = simulate_case(Case(seed), load_sheet(sheet_file)), load(sheet_file)
    torques = {
        "one patch": [_contact(data, bag, [_lumped()] * len(data.patches)) for bag in data.bags],
        "patches": [_contact(data, bag, data.patches) for bag in data.bags],
        "cylinders and lines": [bag.torque for bag in data.bags],
    }
    left = {row: _left(vehicle, [_run(vehicle, *each) for each in zip(data.bags, torque, strict=True)]) for row, torque in torques.items()}
    with tempfile.TemporaryDirectory() as folder:
        bags = write_case(data, Path(folder) / "seen", Path(folder) / "unseen")
        runs = [prepare(read_recording(bag, vehicle.channels), vehicle) for bag in bags]
    seen = [replace(run, measured=np.interp(run.time, bag.time, bag.torque)) for run, bag in zip(runs, data.bags, strict=True)]
    return {**left, "measured motion": _left(vehicle, seen), "noise": noise_of(data)}


def _lumped() -> Patches:
    return Patches(np.ones(1), np.zeros(1), np.zeros(1))


def _contact(data: CaseData, bag: BagData, cells: Sequence[Patches]) -> Array:
    """Torque of both contacts on the true motion (n,) [N m], as cylinders without any loss would deliver it."""
    rubber, total = rubber_table(data.vehicle.reference_degC), np.zeros(bag.time.size)
    for angle, patches in zip(bag.clean_angles, cells, strict=True):
        track = run_track(np.ascontiguousarray(angle), PERIOD_S, data.vehicle, rubber, patches, HiddenContact())
        total += track.friction + track.aligning
    return total


def _run(vehicle: Vehicle, bag: BagData, torque: Array) -> Run:
    """The true motion with a torque that no sensor has touched."""
    omega, alpha = motion(bag.time, bag.clean_angles)
    sides, lines = len(vehicle.sides), len(vehicle.hydraulics.lines if vehicle.hydraulics is not None else ())
    still = np.zeros((sides, bag.time.size))
    return Run(
        name=bag.manoeuvre, time=bag.time, theta=bag.clean_angles, omega=omega, alpha=alpha,
        gains=np.zeros((sides, lines, bag.time.size)), pressure=np.zeros((lines, bag.time.size)), side_torque=still, side_slope=still,
        measured=torque, sigma=np.ones(bag.time.size), valid=np.ones(bag.time.size, bool),
    )  # fmt: skip


def _left(vehicle: Vehicle, runs: Sequence[Run]) -> float:
    problem = Problem(vehicle, runs)
    weight = np.where(problem.valid, 1.0 / 80.0, 0.0)  # about the usual noise, so that the sheet counts as it does in diagnosis
    fitted = fit(problem, weight, linearisations=25)
    return float(np.mean((problem.measured - fitted.prediction)[problem.valid] ** 2))


def run(argv: Sequence[str]) -> None:
    """Command line of this benchmark."""
    parser = argparse.ArgumentParser(prog="python -m lugre_steering.bench own_error", description=__doc__)
    parser.add_argument("--vehicles", type=int, default=24, help="vehicles drawn, two recordings each [24]")
    parser.add_argument("--seed", type=int, default=1, help="of the first vehicle [1]")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    options = parser.parse_args(argv)
    found = [measure(options.seed + i, config_folder() / "test_vehicle.yaml") for i in range(options.vehicles)]
    table: dict[str, Any] = {}
    for row in ROWS:
        shares = [case[row] / case["noise"] for case in found]
        table[row] = {
            "rms_Nm": float(np.median([np.sqrt(case[row]) for case in found])), "of_noise": float(np.median(shares)), "worst": max(shares),
        }  # fmt: skip
    if options.json:
        print(as_json({"vehicles": options.vehicles, "allowed": OWN_ERROR, "rows": table}))
        return
    print(f"left over by recalibration with nothing hidden, {options.vehicles} vehicles; the engine allows itself {OWN_ERROR} of the noise")
    print(f"{'torque of':22s}{'median rms N m':>16s}{'over noise (mean square): median, worst':>42s}")
    for row, entry in table.items():
        print(f"{row:22s}{entry['rms_Nm']:16.1f}{entry['of_noise']:32.4f}{entry['worst']:10.4f}")
