# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Diagnosis from bags to verdict: check the data, recalibrate, fingerprint, detect, locate, name, verify, advise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering import units
from lugre_steering.bag import read_recordings
from lugre_steering.data.bursts import set_aside
from lugre_steering.data.dataset import prepare
from lugre_steering.data.quality import Quality, inspect
from lugre_steering.diagnosis.conclude import experiment
from lugre_steering.diagnosis.conclude.conclusion import conclude
from lugre_steering.diagnosis.conclude.finished import Finished
from lugre_steering.diagnosis.investigate import investigate
from lugre_steering.diagnosis.result import SCHEMA, Diagnosis, finite
from lugre_steering.errors import DataError
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.split import split
from lugre_steering.recording import Finding, Recording
from lugre_steering.vehicle import Vehicle

MIN_SLIDING, MIN_SAMPLES = 2.0, 500
"""Travel, in presliding lengths, below which friction level and stiffness cannot be told apart; samples that a fit needs."""
MATERIAL_SHARE = 0.005
"""Default share of the torque amplitude above which an effect is called material; it only labels."""

Progress = Callable[[str], None]


def diagnose(
    bags: Sequence[Path],
    vehicle: Vehicle,
    *,
    seed: int = 1,
    material: float = MATERIAL_SHARE,
    progress: Progress = lambda _: None,
) -> Diagnosis:
    """Read and diagnose bags of one vehicle together; two of one name get numbers."""
    recordings = read_recordings(bags, vehicle.channels, progress)
    return diagnose_recordings(recordings, vehicle, seed=seed, material=material, progress=progress)


def diagnose_recordings(
    recordings: Sequence[Recording],
    vehicle: Vehicle,
    *,
    seed: int = 1,
    material: float = MATERIAL_SHARE,
    progress: Progress = lambda _: None,
) -> Diagnosis:
    """Diagnose recordings of one vehicle together; effects that the vehicle file already has stay in the baseline."""
    progress("checking the data")
    qualities = [inspect(recording, vehicle) for recording in recordings]
    findings = _findings(qualities)
    blocking = [f"{q.recording.name}: {f.statement}" for q in qualities for f in q.blocking]
    if blocking:
        return _insufficient(
            qualities, vehicle, findings, "The data must be put right first. " + " ".join(blocking), None
        )
    progress("estimating the motion")
    try:
        problem = Problem(vehicle, [prepare(quality.recording, vehicle) for quality in qualities])
    except DataError as error:
        return _insufficient(qualities, vehicle, findings, f"The data do not allow a diagnosis: {error}.", None)
    travel = max(float(np.ptp(run.theta, axis=1).max()) for run in problem.runs) / problem.presliding
    roles = split(problem)
    if travel < MIN_SLIDING or roles.fit.sum() < MIN_SAMPLES:
        if travel < MIN_SLIDING:
            lacking = f"the contact turned by {travel:.1f} presliding lengths; at least {MIN_SLIDING:g} are needed"
        else:
            lacking = f"only {roles.fit.sum()} usable samples are left to fit; at least {MIN_SAMPLES} are needed (see data_quality)"
        advice = {
            "manoeuvre": "double-cycle: " + experiment.manoeuvres(problem)["double-cycle"].description,
            "separates": ["friction level", "stiffness"],
            "why": lacking,
        }
        statement = (
            f"The recording of {sum(float(run.time[-1] - run.time[0]) for run in problem.runs):.0f} s does not determine the "
            f"baseline: {lacking}. Nothing can be said about missing physics."
        )
        return _insufficient(qualities, vehicle, findings, statement, advice)
    progress("recalibrating the baseline")
    noise, roles, found = investigate(problem, seed, progress)
    left = problem.measured - found.final.prediction
    runs, disturbed = set_aside(problem.runs, np.split(left, problem.edges[1:-1]))
    if disturbed:
        # Physics is judged on what the motion makes; kicks from outside would hide what is small.
        findings += [_entry(finding, bag) for bag, finding in disturbed.items()]
        problem = Problem(vehicle, runs)
        noise, roles, found = investigate(problem, seed, progress)
    progress("verifying on held-out data")
    done = Finished(problem, noise, roles, found)
    usable = [quality.recording for quality in qualities]
    return conclude(done, findings, usable, seed=seed, material=material, progress=progress)


def _findings(qualities: Sequence[Quality]) -> list[dict[str, Any]]:
    return [_entry(finding, quality.recording.name) for quality in qualities for finding in quality.findings]


def _entry(f: Finding, bag: str) -> dict[str, Any]:
    return {
        "finding": f.finding, "topic": f.topic, "bag": bag,
        "intervals_s": [list(span) for span in f.intervals_s], "statement": f.statement,
    }  # fmt: skip


def _insufficient(
    qualities: Sequence[Quality],
    vehicle: Vehicle,
    findings: list[dict[str, Any]],
    statement: str,
    advice: dict[str, Any] | None,
) -> Diagnosis:
    """The verdict when nothing can be concluded: the vehicle stays as it was."""
    floor = 1.0
    if vehicle.hydraulics is not None:
        floor = max(1.0, vehicle.sensors.pressure_noise_Pa * 5e-3)
    fit_entry: dict[str, Any] = {"rmse_Nm": 0.0, "heldout_rmse_Nm": None}
    json = {
        "schema": SCHEMA, "bags": [quality.recording.name for quality in qualities], "verdict": "insufficient_data",
        "statement": statement, "noise_floor_Nm": floor, "baseline": fit_entry,
        "augmented": {**fit_entry, "improvement": None, "improvement_ci95": None, "causal_rmse_Nm": None}, "effects": [],
        "unexplained": {"structured": False, "description": "not examined", "formula": None, "where": None},
        "detection_limits": {}, "data_quality": findings, "next_experiment": advice,
    }  # fmt: skip
    return Diagnosis(units.in_words(vehicle, finite(json)), vehicle)

