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
from lugre_steering.diagnosis.laws.refine import law_of, sized_law
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Candidate, Problem, Values
from lugre_steering.fitting.trial import TRIAL_TOLERANCE
from lugre_steering.recording import Array
from lugre_steering.vehicle import LawEntry

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
    names: Effects = linear.effects if named else ()
    shapes = there.freedoms
    sought = _with_places(there.problem, len(shapes), names).doubted(there.problem.doubt, there.problem.typical)
    laws = _laws(sought, shapes, linear.x[sought.first_bend :])
    start = linear.x[: sought.first_bend]
    inside = fit(sought, there.fitted, [*names, *laws], start, linearisations=LINEARISATIONS, tolerance=TRIAL_TOLERANCE)
    problem = _with_places(done.problem, len(shapes), names)

    def around(weight: Array, x: Array) -> Fit:
        """The baseline recalibrated around names and laws."""
        held = [(replace(candidate, free=()), values) for candidate, values in inside.effects]
        return replace(fit(problem, weight, held, x), effects=inside.effects)

    fitted = around(done.fitted, inside.x)
    judged, better = (verify.judged_once(problem, known, fitted, done.roles, seed) for known in (found.baseline, plain))
    if not better.interval[0] > 0.0:
        return None
    whole = around(done.weight, fitted.x)
    return Formed(problem, fitted, whole, _written(problem, whole, shapes, len(names)), judged, better)


def _with_places(problem: Problem, laws: int, names: Effects) -> Problem:
    """The problem without freedoms, with places for so many laws and for one more that tells where their coordinates went."""
    return Problem(problem.vehicle, problem.runs, problem.calibrations, more_laws=laws + 1, beside_names=bool(names))


def _laws(problem: Problem, shapes: Sequence[Freedom], sizes: Array) -> list[tuple[Candidate, dict[str, float]]]:
    """The freedoms that are kept as laws of free sizes; ``sizes``: of all freedoms, one after the other."""
    kept: list[tuple[Candidate, dict[str, float]]] = []
    for freedom, own in zip(shapes, np.split(sizes, np.cumsum([len(freedom.shapes) for freedom in shapes])), strict=False):
        if freedom.coordinate not in OF_THIS_RECORDING:
            cell = Cell(freedom.channel, Axis(freedom.coordinate), freedom.low, freedom.high)
            kept.append(sized_law(cell, len(problem.vehicle.laws) + len(kept), freedom.shapes, own, problem.typical))
    return kept


def _written(problem: Problem, whole: Fit, shapes: Sequence[Freedom], names: int) -> tuple[LawEntry, ...]:
    """The laws that come after the ``names`` of a fit, over the range of their coordinates that the recordings show."""
    kept = [freedom for freedom in shapes if freedom.coordinate not in OF_THIS_RECORDING]
    axes = list(dict.fromkeys(Axis(freedom.coordinate) for freedom in kept))
    traced = trace(problem, whole, len(problem.vehicle.laws) + len(kept), axes)
    found = []
    for freedom, (candidate, values) in zip(kept, whole.effects[names:], strict=True):
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
