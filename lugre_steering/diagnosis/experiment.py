# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The next experiment: which manoeuvre would tell rivals apart, or make a weak effect visible."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lugre_steering.diagnosis.dataset import Run
from lugre_steering.diagnosis.problem import Candidate, Fit, Problem
from lugre_steering.recording import Array
from lugre_steering.simulate.manoeuvres import BUILT_IN, Manoeuvre, motion_of

SAMPLE_S = 0.02
Named = tuple[Candidate, Mapping[str, float]]


def _run(problem: Problem, manoeuvre: Manoeuvre, sigma: float) -> Run:
    """The manoeuvre as a run with ideal sensors (nothing measured yet)."""
    motion = motion_of(manoeuvre, problem.vehicle)
    keep = slice(None, None, max(1, round(SAMPLE_S / (motion.time[1] - motion.time[0]))))
    time, theta = motion.time[keep], motion.theta[:, keep]
    omega = np.gradient(theta, time, axis=1)
    sides, lines = problem.runs[0].gains.shape[:2]
    empty = np.zeros((sides, time.size))
    return Run(
        name=manoeuvre.name, time=time, theta=theta, omega=omega, alpha=np.gradient(omega, time, axis=1),
        gains=np.zeros((sides, lines, time.size)), pressure=np.zeros((lines, time.size)), side_torque=empty, side_slope=empty,
        measured=np.zeros(time.size), sigma=np.full(time.size, sigma), valid=np.ones(time.size, bool),
    )  # fmt: skip


def separation(
    problem: Problem, fit: Fit, first: Sequence[Named], second: Sequence[Named], sigma: float
) -> dict[str, float]:
    """Energy per manoeuvre by which two explanations would differ there, after recalibration, in noise variances."""
    found = {}
    for manoeuvre in BUILT_IN.values():
        trial = Problem(problem.vehicle, [_run(problem, manoeuvre, sigma)], problem.calibrations)
        x = np.append(fit.x[: len(problem.calibrations)], 0.0)
        difference = trial.predict(0, x, first) - trial.predict(0, x, second)
        base = trial.predict(0, x, first)
        tangent = np.column_stack([_moved(trial, x, j, first) - base for j in range(len(problem.calibrations))])
        kept = tangent[:, np.linalg.norm(tangent, axis=0) > 0.0]
        visible = difference - kept @ np.linalg.lstsq(kept, difference, rcond=None)[0]
        found[manoeuvre.name] = float(visible @ visible) / sigma**2
    return found


def _moved(problem: Problem, x: Array, j: int, effects: Sequence[Named]) -> Array:
    moved = x.copy()
    moved[j] += 0.02
    return problem.predict(0, moved, effects)


def recommend(energies: Mapping[str, float]) -> tuple[str, str, float]:
    """Name, description and separation of the manoeuvre that tells most."""
    best = max(energies, key=lambda name: energies[name])
    return best, BUILT_IN[best].description, energies[best]
