# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The search: screen, refit the leading cells in the chain, simplify, and prove on what neither has seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lugre_steering.diagnosis import verify
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.laws.cells import Axis, Cell, Traces, axes_of, nearer, trace
from lugre_steering.diagnosis.laws.refine import FITTED, NUMBER_COSTS, Law, free_law, law_of, simplified, with_law
from lugre_steering.diagnosis.laws.screen import Screen, Screened, bar
from lugre_steering.diagnosis.loudness import OWN_ERROR, excess
from lugre_steering.diagnosis.search.compare import PER_VALUE, SURE
from lugre_steering.effects import laws
from lugre_steering.fitting.doubt import doubt
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Effects, Problem, is_rig
from lugre_steering.recording import Array
from lugre_steering.vehicle.laws import MOST_IN_FILE

MOST_LAWS = 2
"""One, and a second that earns its place."""
SHORTLIST, CLOSE, SIMPLIFIED, TRIED = 8, 0.75, 3, 16
"""Cells refitted in the chain, share of the best gain that brings them there, how many of them are put into closed forms, and the most
that are refitted if some do not settle."""
FORETOLD = 0.5
"""Share of the gain foretold by the screen below which a fit that began with its pieces begins with none once more: in the chain a law of
the torque acts on itself."""
SECOND = 0.1
"""Share of the first law's gain that a second one must have."""
TIED = 0.03
"""Share of the gain within which two laws cannot be told apart."""
LOOP = 0.3
"""Share of a change of the torque that a law may add to it in the mean: elsewhere it is more, and from one on nothing settles."""
FED_BACK = ("torque", "abs_torque", "power", "opposing_torque")
"""Coordinates that a law's own torque changes."""
ONCE = ("time", "slip", "work", "passes", "air_temperature")
"""Coordinates that only go on: what lies along them happened once, so that of two laws that tie the other one is likelier to hold again."""


@dataclass(frozen=True)
class Tried:
    """A cell refitted in the chain: its screen and its fit, which ends with its law."""

    screened: Screened
    fit: Fit

    @property
    def law(self) -> Law:
        return law_of(self.fit.effects[-1][0].effect)

    @property
    def values(self) -> int:
        """How many numbers the law has, with the width of a play or relay, which is chosen and not fitted."""
        return len(self.fit.effects[-1][0].free) + (self.law.cell.axis.memory not in ("none", *FITTED))


@dataclass(frozen=True)
class FoundLaws:
    """Laws that stand, in ``fit`` (all valid data) of ``problem``, which has places for them, after the names that they stand beside;
    ``judged`` on samples held out, against these alone.

    ``heldout``: share of what is missing of held-out data without it that each foretells; ``gains``: energy that each took away when it
    was added; ``ties``: laws that fit as well as the first; ``bar``: the largest gain
    in errors that hide nothing; ``foretold``: energy of blocks left out that they take together; ``ceiling``: that which a smooth function
    of all coordinates takes in their place, if it is more.
    """

    problem: Problem
    fitted: Fit
    fit: Fit
    judged: verify.Judged
    heldout: tuple[float, ...]
    gains: tuple[float, ...]
    ties: tuple[Tried, ...]
    bar: float
    foretold: float
    ceiling: float
    doubt: float
    """Energy, in noise variances, that counts as one independent error of ``fit``."""

    @property
    def spread(self) -> Array:
        """Covariance of all that ``fit`` has: as little is known as its errors are large and last."""
        return np.asarray(self.fit.covariance * max(self.doubt, 1.0))

    @property
    def names(self) -> int:
        """How many named effects come before the laws in the fits."""
        return len(self.fit.effects) - len(self.gains)

    def beyond(self, held: Array) -> float:
        """Energy per sample held out (weights) beyond noise, at least what a simulation's own error may leave."""
        return max(excess(self.problem, self.fitted, held), OWN_ERROR)


def find(
    done: Finished, before: Fit, seed: int, progress: Callable[[str], None] = lambda _: None, *, freely: bool = False
) -> FoundLaws | None:
    """Laws in what a fit leaves over, with or without named effects; None where none stands. Sought on the samples on which names are
    compared, fitted and judged on all; ``freely``: sought beside the freedoms with which these are compared, too."""
    there, problem = done.compared, _with_places(done.problem, before)
    sought = with_freedoms(there, beside_names=bool(before.effects)) if freely else _with_places(there.problem, before)
    roles, weight = there.roles, there.fitted
    samples = float(roles.fit.sum())
    gains, foretold, steps = list[float](), list[float](), list[Fit]()
    ties: tuple[Tried, ...] = ()
    x = np.append(before.x, np.zeros(sought.nuisances - before.x.size))
    current, first_bar, ceiling = fit(sought, weight, before.effects, x), 0.0, 0.0
    for index in range(min(MOST_LAWS, MOST_IN_FILE - len(problem.vehicle.laws))):
        place = len(problem.vehicle.laws) + index
        progress("screening laws" if not index else "screening for a second law")
        screen = Screen(sought, current, weight, roles, there.noise.draws, trace(sought, current, place, axes_of(sought)), seed)
        screened = screen.search()
        least = max(bar(screened), OWN_ERROR * sought.mean_of * samples, SECOND * gains[0] if gains else 0.0)
        first_bar = first_bar or bar(screened)
        if screened[0].gain < least:
            break
        tried = _tried(sought, weight, current, screen, screened, place, progress)
        known = _unseen(there, current)
        better = (each for each in tried if current.cost - each.fit.cost >= least and _unseen(there, each.fit) < known)
        if (best := next((each for each in better if _carries_over(sought, weight, current, each.fit)), None)) is None:
            break
        gain = current.cost - best.fit.cost
        if not index:
            ceiling = screen.black_box(seed)
            ties = tuple(each for each in tried if each is not best and each.fit.cost < best.fit.cost + TIED * gain)
        gains.append(gain)
        foretold.append(best.screened.gain)
        steps.append(best.fit)
        current = best.fit
    progress("proving the law")
    while steps and not _sure(there, steps[-1], len(before.effects)):  # a second one of many values may put both in doubt
        steps, gains, foretold = steps[:-1], gains[:-1], foretold[:-1]
    if not steps:
        return None
    current = steps[-1]
    fitted, whole = (fit(problem, w, current.effects, current.x[: problem.nuisances], linearisations=6) for w in (done.fitted, done.weight))
    judged = verify.verify(problem, done.weight, before, fitted, done.roles, seed)
    if not judged.interval[0] > 0.0:  # nor if nothing was held out
        return None
    own, held = doubt(problem, whole, done.weight), heldout_gains(done, problem, fitted, len(before.effects), judged, seed)
    return FoundLaws(problem, fitted, whole, judged, held, tuple(gains), ties, first_bar, sum(foretold), max(ceiling, sum(foretold)), own)


def heldout_gains(done: Finished, problem: Problem, fitted: Fit, names: int, judged: verify.Judged, seed: int) -> tuple[float, ...]:
    """Share of the energy that is missing on held-out data without it that each law foretells, of a fit with laws after so many ``names``;
    ``judged``: with all of them against none."""
    laws = len(fitted.effects) - names
    if laws == 1:
        return (_foretold(judged),)
    gains = []
    for index in range(names, names + laws):
        rest = [effect for i, effect in enumerate(fitted.effects) if i != index]
        without = fit(problem, done.fitted, rest, fitted.x, linearisations=6)
        gains.append(_foretold(verify.judged_once(problem, without, fitted, done.roles, seed)))
    return tuple(gains)


def _foretold(judged: verify.Judged) -> float:
    return 1.0 - (judged.after / judged.before) ** 2


def _sure(there: Finished, found: Fit, names: int) -> bool:
    """Whether the laws of a fit, after so many names, take as much together as a name must, and what their values cost, beside the freedoms
    of the friction law: what is left may be so large and last so long that they are no more than one more of such errors."""
    problem = with_freedoms(there, beside_names=names > 0)
    x = np.append(found.x[: problem.first_bend], np.zeros(problem.bends.shape[1]))
    fitted = fit(problem, there.fitted, found.effects, x, linearisations=6)
    taken = fit(problem, there.fitted, found.effects[:names], fitted.x, linearisations=6).cost - fitted.cost
    values = sum(len(candidate.free) for candidate, _ in found.effects[names:])
    return taken > (SURE + PER_VALUE * values) * doubt(problem, fitted, there.fitted)


def _carries_over(problem: Problem, weight: Array, before: Fit, found: Fit) -> bool:
    """Whether laws of a joint or axis leave less of recordings that they were not fitted to; rubber is of another temperature in each."""
    if len(problem.runs) < 2 or not is_rig(problem.vehicle):
        return True
    return _left_elsewhere(problem, weight, found.effects, found.x) < _left_elsewhere(problem, weight, before.effects, found.x)


def _left_elsewhere(problem: Problem, weight: Array, effects: Effects, x: Array) -> float:
    """Energy that effects leave of each recording when they are fitted to the others; its bristles begin as in x."""
    left = 0.0
    for bag in range(len(problem.runs)):
        own = problem.bag == bag
        rest, start = fit(problem, np.where(own, 0.0, weight), effects, x, linearisations=6), len(problem.calibrations) + bag
        known = rest.x.copy()
        known[start] = x[start]
        error = problem.measured[own] - problem.predict(bag, known, rest.effects)
        left += float(np.sum(np.square(error * weight[own])))
    return left


def _with_places(problem: Problem, before: Fit) -> Problem:
    """The problem with places for laws, beside names if there are any; without freedoms, which a vehicle file cannot hold."""
    return Problem(problem.vehicle, problem.runs, problem.calibrations, more_laws=MOST_LAWS, beside_names=bool(before.effects))


def with_freedoms(there: Finished, *, beside_names: bool, bent: bool = False) -> Problem:
    """The problem on which names are compared, with places for laws; of the freedoms those of the friction law, and those of names only
    if they are ``bent``."""
    compared, of_names = there.problem, 0 if bent else there.form.count("")
    columns = compared.bends[:, : compared.bends.shape[1] - of_names]
    problem = Problem(
        compared.vehicle, compared.runs, compared.calibrations, more_laws=MOST_LAWS, beside_names=beside_names, bends=columns
    )
    problem.shapes = compared.shapes - of_names
    return problem.doubted(compared.doubt, compared.typical)


def _unseen(there: Finished, result: Fit) -> float:
    """Energy left of all valid samples that were not fitted, in noise variances: laws that cancel each other show there."""
    unseen = there.problem.valid & ~there.roles.fit
    return float(np.sum(((there.problem.measured - result.prediction)[unseen] / there.noise.sigma[unseen]) ** 2))


def _tried(
    problem: Problem, weight: Array, current: Fit, screen: Screen, screened: Sequence[Screened], place: int,
    progress: Callable[[str], None],
) -> list[Tried]:
    """The leading cells fitted in the chain, the best of them simplified; best first."""
    tried: list[Tried] = []
    for one in leading(screened)[:TRIED]:
        if len(tried) == SHORTLIST or (tried and one.gain < CLOSE * tried[0].screened.gain):
            break
        progress(f"fitting a law: {one.cell.channel} over {one.cell.axis.coordinate}")
        traces = trace(problem, current, place, [one.cell.axis, *nearer(one.cell.axis)])
        best = screen.search(traces, one.cell)[0]
        centred = best.cell.pieces > 1 and screen.is_named(traces, best.cell)
        law, start = free_law(problem, best.cell, place, screen.pieces(traces, best.cell), centred=centred)
        fitted = with_law(problem, weight, current, (law, start))
        if current.cost - fitted.cost < FORETOLD * best.gain:
            small = {name: 0.0 if name.startswith("piece_") else value for name, value in start.items()}
            fitted = min(fitted, with_law(problem, weight, current, (law, small)), key=lambda each: each.cost)
        if _loop_gain(problem, traces, best.cell.axis, fitted) < LOOP:
            tried.append(Tried(best, fitted))
    if not tried:
        return []
    tried.sort(key=lambda each: each.fit.cost)
    tried = [
        replace(each, fit=simplified(problem, weight, current, each.fit, place)) if i < SIMPLIFIED else each for i, each in enumerate(tried)
    ]
    return preferred(tried, current.cost)


def _loop_gain(problem: Problem, traces: Traces, axis: Axis, fitted: Fit) -> float:
    """How much of a change of the torque the last law of a fit, along an axis, adds to it in the mean, where it depends on that."""
    candidate, values = fitted.effects[-1]
    cell = law_of(candidate.effect).cell
    if axis.coordinate not in FED_BACK or axis.memory == "relay":
        return 0.0
    f, knot = law_of(candidate.effect).shape(values), (cell.high - cell.low) / (laws.KNOTS - 1)
    slopes = np.abs(np.gradient(f, knot))
    gains = []
    for run, signal, places in zip(problem.runs, traces.signals[cell.channel], traces.axes[axis], strict=True):
        along = np.interp(places, np.linspace(cell.low, cell.high, laws.KNOTS), slopes)
        gains.append(np.abs(signal) * along * (np.abs(run.omega) if axis.coordinate == "power" else 1.0))
    return float(np.mean(np.concatenate(gains, axis=1)))


def preferred(tried: Sequence[Tried], before: float) -> list[Tried]:
    """Best first: what is left of the energy ``before``; a value more must pay, and so must what happens only once."""
    gain = before - min(each.fit.cost for each in tried)

    def price(each: Tried) -> float:
        return NUMBER_COSTS * each.values + TIED * (cell_of(each).axis.coordinate in ONCE)

    return sorted(tried, key=lambda each: each.fit.cost + gain * price(each))


def leading(screened: Sequence[Screened]) -> list[Screened]:
    """The best cell of each channel, coordinate and kind of memory, free and periodic, best first."""
    chosen: dict[tuple[str, str, str, bool], Screened] = {}
    for one in screened:
        cell = one.cell
        chosen.setdefault((cell.channel, cell.axis.coordinate, cell.axis.memory, cell.period > 0.0), one)
    return list(chosen.values())


def cell_of(tried: Tried) -> Cell:
    """The cell with the memory that was fitted."""
    return tried.law.at(tried.fit.effects[-1][1])
