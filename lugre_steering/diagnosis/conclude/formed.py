# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The form of the friction law as laws of a vehicle file, where it is more than noise and holds on held-out data.

Names are compared beside linear freedoms of the law (``diagnosis.form``). Here the same shapes run in the chain, with sizes fitted
there beside what stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lugre_steering.diagnosis import verify
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.freedom import Freedom
from lugre_steering.diagnosis.laws.cells import Axis, Cell, Traces, trace
from lugre_steering.diagnosis.laws.find import MOST_LAWS, FoundLaws
from lugre_steering.diagnosis.laws.refine import law_of, sized_law
from lugre_steering.diagnosis.laws.rival import beside_form
from lugre_steering.diagnosis.loudness import loudness
from lugre_steering.fitting.doubt import doubt
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Candidate, Problem, Values
from lugre_steering.fitting.trial import TRIAL_TOLERANCE
from lugre_steering.recording import Array
from lugre_steering.vehicle import LawEntry
from lugre_steering.vehicle.laws import MOST_IN_FILE

LINEARISATIONS, KNOTS = 4, 257
"""Of the fit in the chain, which begins where the linear freedoms end; knots of a written law, near enough for the presliding."""
OF_THIS_RECORDING = ("slip", "rubber_temperature")
"""Coordinates of freedoms that are not written: no other recording begins with this first sweep, nor is as warm."""

Effects = tuple[tuple[Candidate, Values], ...]


class Formed(NamedTuple):
    """Names that stand and the form of the friction law in one model, ``fitted`` to the samples that may fit and ``whole`` to all; its
    ``laws`` as a file has them; held-out errors ``judged`` against the baseline, and what the form brings (``better``) against the
    names alone."""

    problem: Problem
    fitted: Fit
    whole: Fit
    laws: tuple[LawEntry, ...]
    judged: verify.Judged
    better: verify.Judged


def formed(done: Finished, named: bool, seed: int) -> Formed | None:
    """The form of the friction law beside what is named; None where it is none, or does not hold on held-out data."""
    there, found = done.compared, done.found
    if not done.needs_form or not there.freedoms or any(item.in_place for item in found.found):
        return None
    linear, plain = (there.found.final, found.final) if named else (there.found.baseline, found.baseline)
    return _formed(done, linear, there.problem.first_bend, linear.effects if named else (), (), plain, seed)


def formed_beside(done: Finished, found: FoundLaws, seed: int) -> tuple[FoundLaws, Formed] | None:
    """Laws and the form of the friction law in one model, where laws alone leave more than noise; None as for ``formed``."""
    if not done.compared.freedoms or not loudness(found.problem, done.noise, found.fitted).loud:
        return None
    bent, _, linear = beside_form(done, found)
    names, laws = linear.effects[: found.names], linear.effects[found.names :]
    form = _formed(done, linear, bent.first_bend, names, laws, found.fitted, seed)
    if form is None:
        return None
    own = doubt(form.problem, form.whole, done.weight)
    return replace(found, problem=form.problem, fitted=form.fitted, fit=form.whole, judged=form.judged, doubt=own), form


def _formed(
    done: Finished, linear: Fit, first_bend: int, names: Effects, laws: Effects, plain: Fit, seed: int
) -> Formed | None:
    """The freedoms of a ``linear`` fit, whose sizes begin at ``first_bend``, in the chain between names and found laws; ``plain``: the
    same without them."""
    there, shapes = done.compared, done.compared.freedoms
    before = MOST_LAWS if laws else 0
    sought = _with_places(there.problem, before + len(shapes), names).doubted(there.problem.doubt, there.problem.typical)
    form = _laws(sought, shapes, linear.x[first_bend:], before)
    if len(there.problem.vehicle.laws) + len(laws) + len(form) > MOST_IN_FILE:
        return None
    start = linear.x[:first_bend]
    inside = fit(sought, there.fitted, [*names, *form, *laws], start, linearisations=LINEARISATIONS, tolerance=TRIAL_TOLERANCE)
    problem, free = _with_places(done.problem, before + len(shapes), names), len(names) + len(form)

    def around(weight: Array, x: Array) -> Fit:
        """The baseline and found laws fitted around names and form, which keep their values."""
        held = [(replace(candidate, free=()), values) for candidate, values in inside.effects[:free]]
        fitted = fit(problem, weight, [*held, *inside.effects[free:]], x)
        return fitted if laws else replace(fitted, effects=inside.effects)

    fitted = around(done.fitted, inside.x)
    judged, better = (verify.judged_once(problem, known, fitted, done.roles, seed) for known in (done.found.baseline, plain))
    if not better.interval[0] > 0.0:
        return None
    whole = around(done.weight, fitted.x)
    return Formed(problem, fitted, whole, _written(problem, whole, shapes, len(names)), judged, better)


def _with_places(problem: Problem, laws: int, names: Effects) -> Problem:
    """The problem without freedoms, with places for so many laws and for one more that tells where their coordinates went."""
    return Problem(problem.vehicle, problem.runs, problem.calibrations, more_laws=laws + 1, beside_names=bool(names))


def _laws(problem: Problem, shapes: Sequence[Freedom], sizes: Array, first: int) -> list[tuple[Candidate, dict[str, float]]]:
    """The freedoms that are kept as laws of free sizes, from the place ``first`` on; ``sizes``: of all freedoms, one after the other."""
    kept: list[tuple[Candidate, dict[str, float]]] = []
    for freedom, own in zip(shapes, np.split(sizes, np.cumsum([len(freedom.shapes) for freedom in shapes])), strict=False):
        if freedom.coordinate not in OF_THIS_RECORDING:
            cell = Cell(freedom.channel, Axis(freedom.coordinate), freedom.low, freedom.high)
            place = len(problem.vehicle.laws) + first + len(kept)
            kept.append(sized_law(cell, place, freedom.shapes, own, problem.typical))
    return kept


def _written(problem: Problem, whole: Fit, shapes: Sequence[Freedom], names: int) -> tuple[LawEntry, ...]:
    """The laws that come after the ``names`` of a fit, over the range of their coordinates that the recordings show."""
    kept = [freedom for freedom in shapes if freedom.coordinate not in OF_THIS_RECORDING]
    axes = list(dict.fromkeys(Axis(freedom.coordinate) for freedom in kept))
    traced = trace(problem, whole, problem.last_place, axes)
    found = []
    for freedom, (candidate, values) in zip(kept, whole.effects[names : names + len(kept)], strict=True):
        low, high = _seen(traced, Axis(freedom.coordinate))
        if not low < high:
            continue
        law = law_of(candidate.effect)
        f = law.shape(values)
        places = np.linspace(low, high, KNOTS)
        knots = tuple(float(f"{value:.5g}") for value in np.interp(places, np.linspace(freedom.low, freedom.high, f.size), f))
        said = f"form of the friction: {freedom.words}"
        found.append(LawEntry(freedom.channel, freedom.coordinate, law.form, (low, high), knots=knots, title=said, small=True))
    return tuple(found)


def _seen(traced: Traces, axis: Axis) -> tuple[float, float]:
    values = traced.axes[axis]
    return min(float(bag.min()) for bag in values), max(float(bag.max()) for bag in values)
