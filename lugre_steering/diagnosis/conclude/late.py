# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Names that began within the recordings, and when: what was fitted may have no occasion near the instant, or none at all, to see it."""

from __future__ import annotations

from dataclasses import replace

from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.search.compare import SURE
from lugre_steering.fitting import onset
from lugre_steering.fitting.doubt import doubt
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.trial import RETIMED
from lugre_steering.recording import Array


def begun_late(done: Finished) -> Finished:
    """The search with the instants from which its names act, where all data leave far less with them than without."""
    problem, weight = done.problem, done.weight
    begun = fit(problem, weight, done.found.final.effects, done.found.final.x, linearisations=8)
    for index, (candidate, _) in enumerate(begun.effects):
        if candidate.since or candidate.bags is not None or candidate.effect.never_late:
            continue
        late = _since(begun, index, tuple(float(run.time[0]) for run in problem.runs))
        for _ in range(RETIMED):  # the values of one that was always there are no good to time it by
            late = _fitted(problem, weight, _since(late, index, onset.timed(problem, weight, late, index)))
        if late.cost < begun.cost - SURE * doubt(problem, late, weight):
            begun = late
    if all(candidate.since == own.since for (candidate, _), (own, _) in zip(begun.effects, done.found.final.effects, strict=True)):
        return done
    return _with_instants(done, begun)


def timed_by_all(done: Finished) -> Finished:
    """The search with the instants of its late names as all data have them: what was fitted may have had no occasion near them."""
    final = done.compared.found.final
    if not any(candidate.since for candidate, _ in final.effects):
        return done
    return _with_instants(done, fitted_to_all(done.compared))


def fitted_to_all(there: Finished) -> Fit:
    """What was found fitted to all data; what began late is timed anew."""
    fitted = fit(there.problem, there.weight, there.found.final.effects, there.found.final)
    late = [index for index, (candidate, _) in enumerate(fitted.effects) if candidate.since]
    for index in late * RETIMED:  # values of what was timed wrongly are no good to time it by
        since = onset.timed(there.problem, there.weight, fitted, index)
        again = fit(there.problem, there.weight, _since(fitted, index, since).effects, fitted)
        fitted = again if again.cost < fitted.cost else fitted
    return fitted


def _with_instants(done: Finished, begun: Fit) -> Finished:
    """The search with the instants of another fit."""
    there = done.compared
    compared = _at(there, begun)
    final = done.in_file(done.fitted, compared.effects, compared.x) if done.around else _at(done, begun)
    beside = replace(there, found=replace(there.found, final=compared))
    return replace(done, found=replace(done.found, final=final), beside_form=beside if done.beside_form else None)


def _since(result: Fit, index: int, since: tuple[float, ...]) -> Fit:
    effects = list(result.effects)
    effects[index] = (replace(effects[index][0], since=since), effects[index][1])
    return replace(result, effects=tuple(effects))


def _fitted(problem: Problem, weight: Array, result: Fit) -> Fit:
    return fit(problem, weight, result.effects, result.x, linearisations=8)


def _at(done: Finished, begun: Fit) -> Fit:
    """The final fit of a search, to its own data, with other instants."""
    final = done.found.final
    for index, (candidate, _) in enumerate(begun.effects):
        final = _since(final, index, candidate.since)
    return _fitted(done.problem, done.fitted, final)
