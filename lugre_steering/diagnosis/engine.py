# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Diagnosis from bags to verdict: check the data, recalibrate, fingerprint, detect, locate, name, verify, advise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lugre_steering.bag import read_recordings
from lugre_steering.data.bursts import set_aside
from lugre_steering.data.pieces import in_pieces
from lugre_steering.data.quality import Quality, inspect
from lugre_steering.diagnosis.conclude import experiment
from lugre_steering.diagnosis.conclude.conclusion import conclude
from lugre_steering.diagnosis.conclude.finished import Finished
from lugre_steering.diagnosis.conclude.left_out import left_out
from lugre_steering.diagnosis.investigate import investigate
from lugre_steering.diagnosis.loudness import excess
from lugre_steering.diagnosis.result import SCHEMA, Augmented, Diagnosis, Errors, Experiment, Unexplained
from lugre_steering.errors import DataError
from lugre_steering.fitting.clocks import WORTH_SAYING_S, Synchronised, slows, synchronised
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.sheet import Suspect, WrongSheet, physics_instead, wrong_entry, wrong_sheet
from lugre_steering.fitting.split import split
from lugre_steering.fitting.weather import weather_findings
from lugre_steering.recording import BagFinding, Finding, Recording
from lugre_steering.vehicle import Vehicle

MIN_SLIDING, MIN_SAMPLES = 2.0, 300
"""Travel, in presliding lengths, below which friction level and stiffness cannot be told apart; samples that a fit needs."""
MATERIAL_SHARE = 0.005
"""Default share of the torque amplitude above which an effect is called material; it only labels."""

MISPLACED_RAD = 0.05
"""Error of an angle's zero (3 deg) that is no small misalignment."""
WORTH_A_SHEET = 0.5
"""Energy that the baseline leaves, in noise variances, from which single entries of the vehicle file are tried against it."""

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
    if not recordings:
        raise DataError("no recording is given, expected at least one")
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
        pieces, cut = in_pieces([quality.recording for quality in qualities])
        findings += _by_bag(cut)
        clocks = synchronised(pieces, vehicle)
    except DataError as error:
        return _insufficient(qualities, vehicle, findings, f"The data do not allow a diagnosis: {error}.", None)
    problem, roles = clocks.problem, split(clocks.problem)
    progress("comparing with the vehicle file")
    suspected = wrong_sheet(problem) if roles.fit.sum() >= MIN_SAMPLES else None
    if suspected is not None and suspected.certain:
        return _wrong_sheet(qualities, vehicle, [*findings, *_by_bag(clocks.findings)], suspected)
    if lacking := _lacking(problem, int(roles.fit.sum())):
        return _undetermined(qualities, vehicle, findings, problem, lacking)
    progress("recalibrating the baseline")
    done = investigate(problem, seed, progress)
    if suspected is not None and not physics_instead(problem, done.found.final.effects, suspected):
        return _wrong_sheet(qualities, vehicle, [*findings, *_by_bag(clocks.findings)], suspected)
    if (again := _other_clocks(pieces, clocks, done.found.final)) is not None:
        clocks = again
        done = investigate(clocks.problem, seed, progress)
    findings += _by_bag(clocks.findings)
    problem = done.problem
    left = problem.measured - done.found.final.prediction
    runs, disturbed = set_aside(problem.runs, np.split(left, problem.edges[1:-1]))
    if disturbed:
        # Physics is judged on what the motion makes; kicks from outside would hide what is small.
        findings += _by_bag(disturbed)
        done = investigate(Problem(vehicle, runs), seed, progress)
    if (wrong := _misplaced(done) or _wrong_entry(done)) is not None:
        return _wrong_sheet(qualities, vehicle, findings, wrong)
    findings += _by_bag(weather_findings(done.problem, done.found.final))
    progress("verifying on held-out data")
    result = conclude(done, findings, pieces, seed=seed, material=material, progress=progress)
    if cut:
        return result
    unused = left_out(done, done.found.final.effects if result.effects else (), recordings, pieces, clocks.late)
    return replace(result, data_quality=(*result.data_quality, *_by_bag(unused)))


def _misplaced(done: Finished) -> WrongSheet | None:
    """An angle sensor so far from its zero that it was put on, or written down, wrongly: no physics is to be read from its angles."""
    for candidate, values in done.found.final.effects:
        zero = values.get("offset", 0.0)
        if "angle" in candidate.effect.hooks and done.problem.vehicle.coordinate.unit == "rad" and abs(zero) > MISPLACED_RAD:
            problem, final = done.problem, done.found.final
            left = float(np.linalg.norm((problem.measured - final.prediction)[problem.valid]))
            share = left / max(float(np.linalg.norm(problem.measured[problem.valid])), 1e-30)
            said = f"both angles stand about {np.degrees(zero):.1f} deg from their zero"
            return WrongSheet(1.0, (Suspect("zero of the angle sensors", None, share, final.cost),), said)
    return None


def _wrong_entry(done: Finished) -> WrongSheet | None:
    """An entry of the sheet that explains what recalibration leaves, better than names and the form of the friction law."""
    left = excess(done.problem, done.found.baseline, done.fitted)
    if not left > WORTH_A_SHEET:
        return None
    form = done.beside_form
    rival = 1.0 if form is None else max(excess(form.problem, form.found.baseline, form.fitted), 0.0) / left
    return wrong_entry(done.problem, done.found.final.effects, rival)


def _other_clocks(pieces: Sequence[Recording], clocks: Synchronised, final: Fit) -> Synchronised | None:
    """Clocks set anew beside what was found, where physics had passed for an offset or an offset for physics."""
    beside = [entry for entry in final.effects if not slows(entry[0].effect)]
    if not final.effects or (not clocks.late.any() and len(beside) == len(final.effects)):
        return None
    again = synchronised(pieces, clocks.problem.vehicle, effects=beside)
    return again if np.abs(again.late - clocks.late).max() > WORTH_SAYING_S else None


def _findings(qualities: Sequence[Quality]) -> list[BagFinding]:
    return [finding.in_bag(quality.recording.name) for quality in qualities for finding in quality.findings]


def _by_bag(findings: Mapping[str, Finding]) -> list[BagFinding]:
    return [finding.in_bag(bag) for bag, finding in findings.items()]


def _lacking(problem: Problem, samples: int) -> str:
    """What the recordings lack to determine the baseline, if anything; ``samples`` are left to fit."""
    travel = max(float(np.ptp(run.theta, axis=1).max()) for run in problem.runs) / problem.presliding
    if travel < MIN_SLIDING:
        return f"the contact turned by {travel:.1f} presliding lengths; at least {MIN_SLIDING:g} are needed"
    if samples < MIN_SAMPLES:
        return f"only {samples} usable samples are left to fit; at least {MIN_SAMPLES} are needed (see data_quality)"
    return ""


def _undetermined(
    qualities: Sequence[Quality], vehicle: Vehicle, findings: Sequence[BagFinding], problem: Problem, lacking: str
) -> Diagnosis:
    drive = "double-cycle: " + experiment.manoeuvres(problem)["double-cycle"].description
    advice = Experiment(drive, ("friction level", "stiffness"), lacking)
    statement = (
        f"The recording of {sum(float(run.time[-1] - run.time[0]) for run in problem.runs):.0f} s does not determine the "
        f"baseline: {lacking}. Nothing can be said about missing physics."
    )
    return _insufficient(qualities, vehicle, findings, statement, advice)


def _wrong_sheet(
    qualities: Sequence[Quality], vehicle: Vehicle, findings: Sequence[BagFinding], wrong: WrongSheet
) -> Diagnosis:
    statement = (
        f"The vehicle file is not that of this vehicle, or not of these sensors: {wrong.statement}. "
        "No physics is named before that is put right."
    )
    return _insufficient(qualities, vehicle, [*findings, wrong.finding()], statement, None)


def _insufficient(
    qualities: Sequence[Quality],
    vehicle: Vehicle,
    findings: Sequence[BagFinding],
    statement: str,
    advice: Experiment | None,
) -> Diagnosis:
    """The verdict when nothing can be concluded: the vehicle stays as it was."""
    floor = 1.0
    if vehicle.hydraulics is not None:
        floor = max(1.0, vehicle.sensors.pressure_noise_Pa * 5e-3)
    return Diagnosis(
        schema=SCHEMA, bags=tuple(quality.recording.name for quality in qualities), verdict="insufficient_data",
        statement=statement, noise_floor_Nm=floor, baseline=Errors(0.0, None),
        augmented=Augmented(0.0, None, None, None, vehicle), effects=(), unexplained=Unexplained(False, "not examined"),
        detection_limits={}, data_quality=tuple(findings), next_experiment=advice,
    ).in_words()  # fmt: skip

