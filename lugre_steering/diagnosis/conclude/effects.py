# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The named effects as the contract wants them: values with intervals, places, size, share, ties."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from lugre_steering import units
from lugre_steering.diagnosis.conclude.headline import inside
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.loudness import FORM_LEFT
from lugre_steering.diagnosis.result import FittedValue, NamedEffect, Place, Stage
from lugre_steering.diagnosis.search import locate
from lugre_steering.diagnosis.search.compare import tied
from lugre_steering.diagnosis.search.search import Found
from lugre_steering.diagnosis.search.surely import deviations, moved_by_form
from lugre_steering.fitting.doubt import NORMAL
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Candidate
from lugre_steering.fitting.trial import Trial, cost
from lugre_steering.recording import Array
from lugre_steering.report import words

BOTH_SIDES = 0.5
"""Share of its largest angle below which an effect that acts to both sides must be silent to be called one of |angle|."""
IN_PLACE = "small changes of the form of the friction law, all of them together, would explain as much"
"""Said of a name beside the freedoms of the friction law."""


def named_effects(done: Finished, whole: Fit, bent: Fit, material: float, nearest: bool) -> list[NamedEffect]:
    """Entries of the named effects in ``whole`` (fitted to all data; laws come after them), largest share first; ``bent``: the same
    beside all freedoms, which says how sure their values are; ``material``: see ``_statement``; ``nearest``: they are only that."""
    problem, found = done.problem, done.found
    intervals = _intervals(done, whole, bent)
    start = cost(problem, found.baseline, done.fitted)
    removed = start - cost(problem, found.final, done.fitted)
    total = sum(item.gain for item in found.found)
    entries = []
    for index, ((candidate, _), item) in enumerate(zip(whole.effects, found.found, strict=False)):
        part = locate.contribution(problem, whole, index)
        size = float(np.max(np.abs(part)))
        rivals = [rival for rival in item.rivals if rival != candidate.effect.id]
        entries.append(NamedEffect(
            id=candidate.effect.id, stage=cast(Stage, candidate.effect.stage),
            statement=_statement(done, whole, bent, index, item, size, rivals, material),
            p_value=item.score.p_value, parameters=intervals[index], where=tuple(_where(done, candidate, part)),
            energy_share=float(np.clip(removed / max(start, 1e-9) * item.gain / max(total, 1e-9), 0.0, 1.0)),
            masked_share=float(np.clip(item.score.masked_share, 0.0, 1.0)), indistinguishable_from=tuple(rivals),
            largest_Nm=size, largest_share=size / done.amplitude, bends=nearest,
        ))  # fmt: skip
    return sorted(entries, key=lambda entry: -entry.energy_share)


def _intervals(done: Finished, whole: Fit, bent: Fit) -> list[dict[str, FittedValue]]:
    """Value, 95 % interval and unit of each free parameter, effect by effect.

    As sure as beside all freedoms; and a value that these shift is as unsure as that, or where it was found beside them, as the share of
    their torque that they may have wrong, as they too are of another form than nature. So is the law of a name itself: a value may
    be off by what makes so much of its torque, but for inertia, viscous friction and the like of a single joint.
    """
    there = done.compared
    deviation = deviations(there.problem, there.weight, there.roles, bent)[there.problem.nuisances :]
    position = 0
    found: list[dict[str, FittedValue]] = []
    share = float(np.sqrt(FORM_LEFT)) if done.around else 1.0
    without, beside = (done.freely, there.found.final) if done.around else (whole, bent)
    those = zip(whole.effects, without.effects, beside.effects, done.found.found, strict=False)
    for index, ((candidate, values), (_, freely), (_, shifted), item) in enumerate(those):
        parameters: dict[str, FittedValue] = {}
        form = moved_by_form(there.problem, there.weight, bent, index)
        for key in candidate.free:
            known = NORMAL * float(np.hypot(deviation[position], share * (freely[key] - shifted[key])))
            half = float(np.hypot(known, 0.0 if item.given else form[key]))
            parameters[candidate.line if candidate.effect.per_line else key] = FittedValue(
                values[key], (values[key] - half, values[key] + half), done.unit(candidate.parameter(key).unit)
            )
            position += 1
        found.append(parameters)
    return found


def _statement(
    done: Finished, whole: Fit, bent: Fit, index: int, item: Found, size: float, rivals: list[str], material: float
) -> str:
    """One sentence; an effect of ``size`` [N m] is material above the share ``material`` of the torque amplitude."""
    candidate, _ = whole.effects[index]
    law = units.law(done.problem.vehicle, candidate.effect.equation)
    label = "material" if size > material * done.amplitude else "small"
    return (
        f"{done.title(candidate.effect.id)}: {law}. Up to {done.torque(size)} "
        f"({words.percent(size / done.amplitude)} of the torque amplitude, {label}){_since(done, candidate)}"
        + _lines(done, bent, index, item)
        + (f"; the data cannot tell it from {' or '.join(inside(done.title(rival)) for rival in rivals)}" if rivals else "")
        + (f"; {IN_PLACE}." if item.in_place else ".")
    )


def _lines(done: Finished, bent: Fit, index: int, item: Found) -> str:
    """Other pressure lines on which the same error would fit as well, with its size there."""
    problem, hydraulics, weight = done.compared.problem, done.problem.vehicle.hydraulics, done.compared.weight
    candidate, values = bent.effects[index]
    if not candidate.effect.per_line or hydraulics is None:
        return ""
    rest = [effect for i, effect in enumerate(bent.effects) if i != index]

    def with_line(line: str) -> Trial:
        fitted = fit(problem, weight, [*rest, (replace(candidate, line=line), values)], bent, linearisations=6)
        return Trial(item.score, fitted, fitted.cost)

    own = with_line(candidate.line)
    others = [with_line(line) for line in hydraulics.lines if line != candidate.line]
    before = fit(problem, weight, rest, bent, linearisations=6).cost
    equal = tied(problem, weight, done.compared.roles, own, others, before, exact=True)
    key = candidate.free[0]
    unit = done.unit(candidate.parameter(key).unit)
    named = [f"{trial.candidate.line} ({words.quantity(trial.fit.effects[-1][1][key], unit)})" for trial in equal]
    return f"; line {candidate.line} cannot be told from {', '.join(named)}" if named else ""


def _since(done: Finished, candidate: Candidate) -> str:
    """When an effect began that was not there from the start."""
    begun = [
        f"{run.name} from {since:.0f} s on" if since <= run.time[-1] else f"not in {run.name}"
        for run, since in zip(done.problem.runs, candidate.since, strict=False)
        if since > run.time[0]
    ]
    return f", {', '.join(begun)}" if begun else ""


def _where(done: Finished, candidate: Candidate, part: Array) -> list[Place]:
    """Bags, stretches and range of the telling coordinate in which its torque ``part`` (n,) [N m] acts."""
    entries = []
    for bag, run in enumerate(done.problem.runs):
        piece = part[done.problem.edges[bag] : done.problem.edges[bag + 1]]
        spans = locate.intervals(run.time, piece)
        if not candidate.active_in(bag) or not spans:
            continue
        axes = locate.coordinates(run, run.measured)
        axis = candidate.effect.coordinate if candidate.effect.coordinate in axes else "time"
        low, high = locate.active_range(axes[axis], piece)
        if axis == "steering angle" and low < 0.0 < high:
            # Beyond some angle to both sides says more than nearly everything between.
            low_size, high_size = locate.active_range(axes["|steering angle|"], piece)
            if low_size > BOTH_SIDES * high_size:
                axis, low, high = "|steering angle|", low_size, high_size
        entries.append(Place(run.name, tuple(spans), axis, (low, high), done.unit(units.COORDINATE_UNITS[axis])))
    return entries
