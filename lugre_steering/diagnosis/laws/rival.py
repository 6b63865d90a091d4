# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Names and laws as rivals in one comparison: beside the freedoms of the friction law, by the number that names are compared by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lugre_steering.diagnosis import verify
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.laws.cells import Axis
from lugre_steering.diagnosis.laws.find import MOST_LAWS, FoundLaws, heldout_gains, with_freedoms
from lugre_steering.diagnosis.laws.refine import given_law, law_of
from lugre_steering.diagnosis.loudness import excess
from lugre_steering.diagnosis.search.compare import MARGIN, PER_VALUE, SURE, left, needed, settled
from lugre_steering.diagnosis.search.surely import deviations
from lugre_steering.effects.laws import KNOTS
from lugre_steering.fitting.doubt import doubt
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Effects, Problem
from lugre_steering.fitting.sensors import fitted_with_sensors
from lugre_steering.fitting.sheet import at_bounds
from lugre_steering.recording import Array

OPPOSING = (
    "friction_level", "presliding_stiffness", "coulomb_friction", "load_friction", "viscous_loss", "turbulent_loss", "gain",
)  # fmt: skip
"""Channels whose torque is against the motion, as friction is, or a share of the whole, of which friction is most."""
MOVED, BLURRED = 4.0, 2.0
"""Standard deviations by which laws beside what every joint has may move its values, if they make these as many times as large."""
TRUER, MOSTLY = 0.5, 0.5
"""Share of what another model leaves beyond noise that one must leave at most to be far truer; share of what laws do that names could,
from which they are mostly the same."""


def room_for_laws(done: Finished) -> bool:
    """Whether names leave so much that laws in their place could take clearly more than they do, or recalibration goes beside them as
    far as it may: then it makes up for what they are not."""
    there, named, final = done.compared, done.compared.found, done.freely
    rest = excess(there.problem, named.final, there.fitted)
    return _stuck(done.problem, final) or rest > MARGIN * (excess(there.problem, named.baseline, there.fitted) - rest)


def evident(done: Finished, alone: FoundLaws) -> bool:
    """Whether laws take as much as a name must, beside the same freedoms, and the first is no more of these, nor all of them what sound
    sensors may be: where what is left is not loud, only that tells of them, and friction along what its own law depends on is of that form
    which is not known."""
    first = law_of(alone.fitted.effects[alone.names][0].effect).cell
    if first.channel in OPPOSING and first.axis in {Axis(freedom.coordinate) for freedom in done.compared.freedoms}:
        return False
    problem, weight, fitted = beside_form(done, alone)
    mine, base = _energies(done, [(problem, weight, fitted)])
    there, settled_in = settled(problem, weight, fitted)
    values = _values(fitted.effects[alone.names :])
    clearly = base - mine > needed(there, settled_in, weight, shapes=values)
    return clearly and not _sensors_do_as_well(there, weight, settled_in, alone.names, values)


def _sensors_do_as_well(problem: Problem, weight: Array, laws: Fit, names: int, values: int) -> bool:
    """Whether sound sensors do so much of what laws after so many ``names`` do that these take no more than chance and their values may."""
    there, beside = fitted_with_sensors(problem, weight, laws)
    without = fit(there, weight, beside.effects[:names], beside, linearisations=6)
    return without.cost - beside.cost < (SURE + PER_VALUE * values) * problem.doubt


def _stuck(problem: Problem, result: Fit) -> bool:
    """Whether recalibration goes as far as it may."""
    return bool(at_bounds(problem, result.x, [calibration.name for calibration in problem.calibrations]))


def in_place(done: Finished, alone: FoundLaws, beside: FoundLaws | None) -> bool:
    """Whether laws ``alone`` stand in place of the names: with clearly more evidence beside the freedoms, no worse in a vehicle file, and
    not far worse than the names with laws ``beside`` them."""
    if beside is not None and beside.beyond(done.held) < TRUER * alone.beyond(done.held):
        return False
    return alone.beyond(done.held) < excess(done.problem, done.freely, done.held) and _more_evident(done, alone)


def leaves_names(done: Finished, beside: FoundLaws) -> bool:
    """Whether every name is still needed with laws ``beside`` it, where names are compared; one that is not has a rival there, and no
    companion, or was named for the form of the friction law. What every joint has was not looked for, and may go where laws show that it
    is nothing, but not where they only do the same: unless they are far truer, and mostly something else."""
    problem, weight, fitted = beside_form(done, beside)
    truer = beside.beyond(done.held) < TRUER * excess(done.problem, done.freely, done.held)
    if not (truer and _apart(problem, weight, fitted, beside.names)) and _in_place_of_given(done, problem, weight, fitted):
        return False
    least = SURE * doubt(problem, fitted, weight)
    for index in (i for i, item in enumerate(done.found.found) if not item.given):
        rest = [effect for i, effect in enumerate(fitted.effects) if i != index]
        if fit(problem, weight, rest, fitted, linearisations=6).cost - fitted.cost < least:
            return False
    return True


def _apart(problem: Problem, weight: Array, fitted: Fit, names: int) -> bool:
    """Whether other values of so many ``names`` could do less than half of what the laws after them do, but for the mean of each."""
    values = sum(len(candidate.free) for candidate, _ in fitted.effects[:names])
    columns = fitted.jacobian[:, problem.nuisances : problem.nuisances + values]
    means = []
    for place, (candidate, own) in enumerate(fitted.effects[names:], len(problem.vehicle.laws)):
        law = law_of(candidate.effect)
        means.append(given_law(law.at(own), place, np.full(KNOTS, law.shape(own).mean())))
    torque = (fitted.prediction - problem.predict_all(fitted.x, [*fitted.effects[:names], *means])) * weight
    alike = columns @ np.linalg.lstsq(columns, torque, rcond=None)[0]
    return bool(alike @ alike < MOSTLY * (torque @ torque))


def _in_place_of_given(done: Finished, problem: Problem, weight: Array, beside: Fit) -> bool:
    """Whether a value of what every joint has is another in a fit ``beside`` laws than it may be without them, and is known far less well
    there: the laws do the same."""
    there, final = done.compared, done.compared.found.final
    before = deviations(there.problem, there.fitted, there.roles, final)[there.problem.nuisances :]
    after = deviations(problem, weight, there.roles, beside)[problem.nuisances :]
    position = 0
    for item, (candidate, was), (_, now) in zip(done.found.found, final.effects, beside.effects, strict=False):
        for place, name in enumerate(candidate.free, position):
            moved = abs(now[name] - was[name]) > MOVED * before[place]
            if item.given and moved and after[place] > BLURRED * before[place]:
                return True
        position += len(candidate.free)
    return False


def keeps_names(done: Finished, beside: FoundLaws, alone: FoundLaws) -> bool:
    """Whether names stand though laws ``alone`` explain more than they do: with laws ``beside`` them each name is needed, and held-out data
    are explained no worse by no more parts than without them, or far better; not where only a recalibration as far as it may go does so."""
    if _stuck(beside.problem, beside.fitted) and not _stuck(alone.problem, alone.fitted):
        return False
    parts, rest, other = beside.names + len(beside.gains), beside.beyond(done.held), alone.beyond(done.held)
    rivals = alone.names + len(alone.gains)
    better = rest < TRUER * other or (rest <= other and parts <= rivals)
    return better and leaves_names(done, beside)


def in_place_of_one(done: Finished, alone: FoundLaws, seed: int) -> FoundLaws | None:
    """The names in place of one of the laws ``alone``, with the others beside them, if that is no less evident: then what the names do not
    explain is what another law is there for. None where no law can be spared, or where there is no other."""
    best, energy, form = None, np.inf, beside_form(done, alone)
    for index in range(len(alone.gains) if len(alone.gains) > 1 else 0):
        swapped = _swapped(done, alone, index, seed)
        mine, laws, base = _energies(done, [beside_form(done, swapped, bent=True), form])
        if mine < laws + MARGIN * (base - laws) and mine < energy and leaves_names(done, swapped):
            best, energy = swapped, mine
    return best


def _swapped(done: Finished, alone: FoundLaws, index: int, seed: int) -> FoundLaws:
    """Laws without one of them, beside the names."""
    names, rest = done.freely, [effect for i, effect in enumerate(alone.fitted.effects[alone.names :]) if i != index]
    problem = Problem(done.problem.vehicle, done.problem.runs, done.problem.calibrations, more_laws=MOST_LAWS, beside_names=True)
    effects, x = [*names.effects, *rest], alone.fitted.x[: problem.nuisances]
    fitted, whole = (fit(problem, weight, effects, x, linearisations=12) for weight in (done.fitted, done.weight))
    judged = verify.verify(problem, done.weight, names, fitted, done.roles, seed)
    gains = tuple(gain for i, gain in enumerate(alone.gains) if i != index)
    ties, own = alone.ties if index else (), doubt(problem, whole, done.weight)
    held = heldout_gains(done, problem, fitted, len(names.effects), judged, seed)
    return replace(alone, problem=problem, fitted=fitted, fit=whole, judged=judged, heldout=held, gains=gains, ties=ties, doubt=own)


def _more_evident(done: Finished, laws: FoundLaws) -> bool:
    """Names win a draw, unless they are more and have more free values: several may fill in for one thing."""
    there, count = done.compared, sum(not item.given for item in done.found.found)
    final = there.found.final
    mine, names, base = _energies(done, [beside_form(done, laws), (there.problem, there.fitted, final)])
    plainer = count <= len(laws.gains) or _values(final.effects[-count:]) < _values(laws.fitted.effects[laws.names :])
    return mine < names - MARGIN * (base - names) * plainer


def _values(effects: Effects) -> int:
    return sum(len(candidate.free) for candidate, _ in effects)


def _energies(done: Finished, models: Sequence[tuple[Problem, Array, Fit]]) -> list[float]:
    """What models leave, with what their values cost, and what the baseline does, with what every joint has: by the doubt of the one that
    leaves least in doubt."""
    there, weight = done.compared, done.compared.fitted
    known = [settled(*model) for model in models]
    least = min(problem.doubt for problem, _ in known)
    bare, energies = there.of_every_joint, list[float]()
    for problem, result in (*known, (there.problem, there.found.baseline if bare is there else bare.found.final)):
        problem, result = settled(problem, weight, fit(problem, weight, result.effects, result.x), least)
        energies.append(left(problem, result) + PER_VALUE * least * _values(result.effects))
    return energies


def beside_form(done: Finished, laws: FoundLaws, *, bent: bool = False) -> tuple[Problem, Array, Fit]:
    """Laws where names are compared, beside the freedoms of the friction law but those of the names, unless these are ``bent``: problem,
    weight and fit."""
    problem = with_freedoms(done.compared, beside_names=laws.names > 0, bent=bent)
    x = np.append(laws.fitted.x[: problem.first_bend], np.zeros(problem.bends.shape[1]))
    return problem, done.compared.fitted, fit(problem, done.compared.fitted, laws.fitted.effects, x)
