# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A small problem whose answer is known: a run of about a minute, twice, whose torque is the model's plus white noise."""

from dataclasses import replace

import numpy as np

from lugre_steering.calibration import coverage
from lugre_steering.data.dataset import prepare
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fitting.problem import Candidate, Problem
from lugre_steering.simulate.command import load_vehicle
from lugre_steering.simulate.manoeuvres import Hold, Manoeuvre, Sweep

SIGMA = 80.0
DRIVE = Manoeuvre(
    "drive",
    "",
    tuple(
        part
        for _ in range(3)
        for part in (Hold(1.5), Sweep(18.0, 6.0, 1.0), Sweep(-14.0, 3.0, 1.0), Sweep(3.0, 9.0, 0.5))
    ),
)


def small_problem(rate_Hz: float = 100.0, drive: Manoeuvre = DRIVE) -> Problem:
    sheet = load_vehicle(None)
    runs = [prepare(recording, sheet) for recording in coverage.record(sheet, [drive, replace(drive, name="again")], 5, rate_Hz)]
    made = Problem(sheet, runs)
    return with_torque(made, made.predict_all(made.start()))


def with_torque(problem: Problem, torque: np.ndarray) -> Problem:
    """The same motion with another measured torque, white noise of SIGMA added."""
    measured = torque + SIGMA * np.random.default_rng(3).standard_normal(torque.size)
    pieces = np.split(measured, problem.edges[1:-1])
    return Problem(
        problem.vehicle, [replace(run, measured=part) for run, part in zip(problem.runs, pieces, strict=True)]
    )


def effect(id_: str, **values: float) -> tuple[Candidate, dict[str, float]]:
    free = tuple(p.name for p in CATALOGUE[id_].parameters if p.name in values)
    return Candidate(CATALOGUE[id_], free=free), values


def weight(problem: Problem) -> np.ndarray:
    return np.where(problem.valid, 1.0 / SIGMA, 0.0)
