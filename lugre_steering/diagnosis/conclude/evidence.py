# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""For the report: what speaks for and against each candidate, and the traces of each bag."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.result import BagTrace, Evidence, NamedEffect
from lugre_steering.diagnosis.search import locate
from lugre_steering.diagnosis.search.propose import FALSE_DISCOVERY_RATE
from lugre_steering.diagnosis.verify import rmse
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fitting.fingerprint import Score
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.trial import Trial, cost


def evidence(done: Finished, effects: Sequence[NamedEffect]) -> tuple[Evidence, ...]:
    """One row per candidate that was screened, from its best variant; ``effects``: the entries that are named."""
    problem, found = done.problem, done.found
    before = cost(problem, found.baseline, done.held)
    named = {
        f"{effect.id}[{line}]" for effect in effects for line in effect.parameters if CATALOGUE[effect.id].per_line
    } | {effect.id for effect in effects if not CATALOGUE[effect.id].per_line}
    ties = {rival for effect in effects for rival in effect.indistinguishable_from}
    trials: dict[str, Trial] = {}
    alone = len(found.baseline.effects) + 1
    for trial in found.trials:
        # Beside an effect found before, a gain would not be the candidate's own.
        if len(trial.fit.effects) == alone:
            trials.setdefault(trial.candidate.label, trial)
    first: dict[str, Score] = {}
    for score in found.first_scores:
        first.setdefault(score.candidate.label, score)
    rows = []
    for label, score in first.items():
        tried = trials.get(label)
        gain = None
        if tried is not None and before > 0.0:
            gain = 1.0 - float(np.sqrt(cost(problem, tried.fit, done.held) / before))
        effect_id = score.candidate.effect.id
        if label in named:
            verdict = "named"
        elif effect_id in ties:
            verdict = "cannot be told from the named effect"
        elif tried is not None:
            verdict = "fits worse than the named effect" if named else "explains too little of what is left over"
        elif score.p_value > FALSE_DISCOVERY_RATE:
            verdict = "not significant"
        else:
            verdict = "explains too little to be tried"
        rows.append(
            Evidence(label, done.title(effect_id), score.share, score.masked_share, score.p_value, gain, verdict)
        )
    return tuple(rows)


def traces(done: Finished, whole: Fit, final: Fit, judged: Fit | None) -> tuple[BagTrace, ...]:
    """Torques of each bag: measured, recalibrated, by ``final``, and what each effect of ``whole`` contributes.

    ``judged``: the fit whose held-out errors were judged; None where no single one was.
    """
    problem = done.problem
    parts = {
        candidate.effect.id: locate.contribution(problem, whole, i) for i, (candidate, _) in enumerate(whole.effects)
    }
    found = []
    for bag, run in enumerate(problem.runs):
        piece = slice(problem.edges[bag], problem.edges[bag + 1])
        held = done.roles.held & (problem.bag == bag)
        errors = None
        if judged is not None and held.any():
            errors = rmse(problem, done.found.baseline, held), rmse(problem, judged, held)
        found.append(BagTrace(
            run.name, run.time, run.measured, done.found.baseline.prediction[piece], final.prediction[piece],
            done.roles.held[piece].astype(float), {key: part[piece] for key, part in parts.items()},
            {key: locate.intervals(run.time, part[piece]) for key, part in parts.items()}, locate.coordinates(run, run.measured),
            errors,
        ))  # fmt: skip
    return tuple(found)
