# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Diagnosis from bags to verdict: check the data, recalibrate, fingerprint, detect, locate, name, verify, advise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lugre_steering.bag import read_recordings
from lugre_steering.data.bursts import set_aside
from lugre_steering.data.pieces import in_pieces
from lugre_steering.data.quality import inspect
from lugre_steering.diagnosis.case import Case, by_bag
from lugre_steering.diagnosis.conclude.conclusion import conclude
from lugre_steering.diagnosis.conclude.left_out import left_out
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.investigate import investigate
from lugre_steering.diagnosis.level_jump import level_jumps
from lugre_steering.diagnosis.loudness import excess
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.errors import DataError
from lugre_steering.fitting.clocks import WORTH_SAYING_S, Synchronised, slows, synchronised
from lugre_steering.fitting.doubt import in_doubt
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.sheet import (
    EXPLAINED,
    Suspect,
    WrongSheet,
    form_instead,
    physics_beside,
    physics_instead,
    wrong_entry,
    wrong_sheet,
)
from lugre_steering.fitting.split import split
from lugre_steering.fitting.weather import weather_findings
from lugre_steering.recording import Recording
from lugre_steering.vehicle import Vehicle

MIN_SLIDING, MIN_SAMPLES = 2.0, 300
"""Travel, in presliding lengths, below which friction level and stiffness cannot be told apart; samples that a fit needs."""
MATERIAL_SHARE = 0.005
"""Default share of the torque amplitude above which an effect is called material; it only labels."""

MISPLACED_RAD = 0.05
"""Error of an angle's zero (3 deg) that is no small misalignment."""
UNLIKE_SHEET = {"wiring_suspect", "noisy_sensor", "dead_sensor"}
"""Findings of the check by comparison with the vehicle file, which may be what is wrong."""
WORTH_A_SHEET = 0.5
"""Energy that the baseline leaves, in noise variances, from which single entries of the vehicle file are tried against it."""


def diagnose(
    bags: Sequence[Path],
    vehicle: Vehicle,
    *,
    seed: int = 1,
    material: float = MATERIAL_SHARE,
    progress: Callable[[str], None] = lambda _: None,
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
    progress: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Diagnose recordings of one vehicle together; effects that the vehicle file already has stay in the baseline."""
    if not recordings:
        raise DataError("no recording is given, expected at least one")
    progress("checking the data")
    case = Case(vehicle, [inspect(recording, vehicle) for recording in recordings])
    if case.blocking:
        if (wrong := _sheet_of_another(case)) is not None:
            return case.wrong_sheet(wrong)
        return case.insufficient("The data must be put right first. " + " ".join(case.blocking), more=case.miswired())
    progress("estimating the motion")
    try:
        pieces, cut = in_pieces(case.usable)
        case.found(cut)
        clocks = synchronised(pieces, vehicle)
    except DataError as error:
        return case.unusable(error)
    searched = _searched(case, pieces, clocks, seed, progress)
    if isinstance(searched, Diagnosis):
        return searched
    done, clocks = searched
    case.found(level_jumps(done))
    case.found(weather_findings(in_doubt(done.problem, done.fitted, done.found.final), done.found.final))
    progress("verifying on held-out data")
    result = conclude(done, case.findings, pieces, seed=seed, material=material, progress=progress)
    named, late = done.found.final.effects if result.effects else (), None if cut else clocks.late
    unused = left_out(done, named, recordings, case.usable, late, seed)
    return replace(result, data_quality=(*result.data_quality, *by_bag(unused)))


def _searched(
    case: Case, pieces: Sequence[Recording], clocks: Synchronised, seed: int, progress: Callable[[str], None]
) -> tuple[Finished, Synchronised] | Diagnosis:
    """The finished search and the clocks that it was made with; or the answer where the sheet or the recordings do not allow one."""
    problem, samples = clocks.problem, int(split(clocks.problem).fit.sum())
    progress("comparing with the vehicle file")
    suspected = wrong_sheet(problem) if samples >= MIN_SAMPLES else None
    if suspected is not None and suspected.certain:
        case.found(clocks.findings)
        return case.wrong_sheet(suspected)
    if lacking := _lacking(problem, samples):
        wrong = _put_right(problem) if samples >= MIN_SAMPLES else None
        return case.undetermined(problem, lacking) if wrong is None else case.wrong_sheet(wrong)
    progress("recalibrating the baseline")
    done = investigate(problem, seed, progress)
    if suspected is not None and not (_of_form(done, suspected) or physics_instead(problem, done.found.final.effects, suspected)):
        if not physics_beside(problem, done.found.final.effects, suspected):
            case.found(clocks.findings)
            return case.wrong_sheet(suspected)
        case.doubted(suspected)
    if (again := _other_clocks(pieces, clocks, done.found.final)) is not None:
        clocks = again
        done = investigate(clocks.problem, seed, progress)
    case.found(clocks.findings)
    problem = done.problem
    left = problem.measured - done.found.final.prediction
    runs, disturbed = set_aside(problem.runs, np.split(left, problem.edges[1:-1]))
    if disturbed:
        # Physics is judged on what the motion makes; kicks from outside would hide what is small.
        case.found(disturbed)
        done = investigate(Problem(case.vehicle, runs), seed, progress)
    wrong = _wrong_entry(done) or _misplaced(done)  # an entry must do better than any name, a zero too
    return (done, clocks) if wrong is None else case.wrong_sheet(wrong)


def _sheet_of_another(case: Case) -> WrongSheet | None:
    """A mistake in the vehicle file that explains the recordings, where they had only been held to be none of this machine for being unlike
    it: as wires, as a contact that never slides, or as angles too noisy for a contact so stiff."""
    if not {finding.finding for quality in case.qualities for finding in quality.blocking} <= UNLIKE_SHEET:
        return None
    try:
        problem = synchronised(in_pieces(case.usable)[0], case.vehicle).problem
    except DataError:
        return None
    return _put_right(problem) if int(split(problem).fit.sum()) >= MIN_SAMPLES else None


def _put_right(problem: Problem) -> WrongSheet | None:
    """An entry of the vehicle file with which, put right, next to nothing is left."""
    wrong = wrong_entry(problem)
    return wrong if wrong is not None and wrong.suspects[0].puts_right else None


def _misplaced(done: Finished) -> WrongSheet | None:
    """An angle sensor so far from its zero that it was put on, or written down, wrongly: no physics is to be read from its angles. Like any
    wrong entry it explains most of what recalibration leaves; what does not only resembles it."""
    if not excess(done.problem, done.found.final, done.fitted) < (1.0 - EXPLAINED) * excess(done.problem, done.found.baseline, done.fitted):
        return None
    for candidate, values in done.found.final.effects:
        zero = values.get("offset", 0.0)
        if "angle" in candidate.effect.hooks and done.problem.vehicle.coordinate.unit == "rad" and abs(zero) > MISPLACED_RAD:
            problem, final = done.problem, done.found.final
            left = float(np.linalg.norm((problem.measured - final.prediction)[problem.valid]))
            share = left / max(float(np.linalg.norm(problem.measured[problem.valid])), 1e-30)
            said = f"both angles stand about {np.degrees(zero):.1f} deg from their zero"
            return WrongSheet(1.0, (Suspect("zero of the angle sensors", None, share, final.cost),), said)
    return None


def _of_form(done: Finished, suspected: WrongSheet) -> bool:
    """Whether friction of another form had passed for a wrong sheet."""
    form = done.beside_form
    return form is not None and done.needs_form and form_instead(form.found.baseline, form.problem, suspected)


def _wrong_entry(done: Finished) -> WrongSheet | None:
    """An entry of the sheet that explains what recalibration leaves, better than names and the form of the friction law."""
    left = excess(done.problem, done.found.baseline, done.fitted)
    if not left > WORTH_A_SHEET or not (done.found.found or done.needs_form):  # nothing is left that any entry had to explain
        return None
    form = done.beside_form
    rival = 1.0 if form is None else max(excess(form.problem, form.found.baseline, form.fitted), 0.0) / left
    wrong = wrong_entry(done.problem, done.found.final.effects, rival)
    if wrong is not None or form is None or not (left := excess(form.problem, form.found.baseline, form.fitted)) > WORTH_A_SHEET:
        return wrong
    # Where friction is of another form than the model's, what that makes is no error of any entry; nor what names begin late or bend.
    names = max(excess(form.problem, form.found.final, form.fitted), 0.0) / left
    return wrong_entry(form.problem.unshaped(), form.found.final.effects, names if form.found.found else 1.0)


def _other_clocks(pieces: Sequence[Recording], clocks: Synchronised, final: Fit) -> Synchronised | None:
    """Clocks set anew beside what was found, where physics had passed for an offset or an offset for physics."""
    beside = [entry for entry in final.effects if not slows(entry[0].effect)]
    if not final.effects or (not clocks.late.any() and len(beside) == len(final.effects)):
        return None
    again = synchronised(pieces, clocks.problem.vehicle, effects=beside)
    return again if np.abs(again.late - clocks.late).max() > WORTH_SAYING_S else None


def _lacking(problem: Problem, samples: int) -> str:
    """What the recordings lack to determine the baseline, if anything; ``samples`` are left to fit."""
    travel = max(float(np.ptp(run.theta, axis=1).max()) for run in problem.runs) / problem.presliding
    if travel < MIN_SLIDING:
        return f"the contact turned by {travel:.1f} presliding lengths; at least {MIN_SLIDING:g} are needed"
    if samples < MIN_SAMPLES:
        return f"only {samples} usable samples are left to fit; at least {MIN_SAMPLES} are needed (see data_quality)"
    return ""
