# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The values of what a joint or axis has, where torque and acceleration are seen through one average."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.investigate import NULL_DRAWS
from lugre_steering.diagnosis.laws.find import FoundLaws, with_freedoms
from lugre_steering.diagnosis.search.compare import SURE
from lugre_steering.diagnosis.search.search import Found
from lugre_steering.diagnosis.search.surely import deviations, in_deviations, least_sure_name, least_sure_part
from lugre_steering.diagnosis.verify import Judged, verify
from lugre_steering.fitting import rig
from lugre_steering.fitting.clocks import Offset, beside_clocks, offsets_beside
from lugre_steering.fitting.doubt import in_doubt
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import noise_model, repeated_motion
from lugre_steering.fitting.parallel import as_joint
from lugre_steering.fitting.problem import Effects, Problem, is_rig
from lugre_steering.fitting.split import Split
from lugre_steering.fitting.trial import SURE_SIGMA, without_part
from lugre_steering.recording import Array

ROUNDS = 2
"""Of noise and fit: the noise is that of the acceleration times the inertia, which is not known before."""


class Parallel(NamedTuple):
    """The search with all samples in parallel to compare in, what was found there fitted to all as recorded with the values that names have
    in parallel, the same with these ``held``, what was fitted in parallel, and how ``late`` the torque of each bag is there."""

    done: Finished
    whole: Fit
    held: Fit
    bent: Fit
    late: tuple[Offset, ...]


def in_parallel(done: Finished, final: Fit, seed: int) -> Parallel | None:
    """What was found and ``final`` has, then laws, in parallel; None of a vehicle.

    Names are sought as recorded: an average hides what is short. But smoothed motion is an error in a regressor, of which the residuals
    say nothing (an inertia came out 3 % to 13 % too small, and sure of it).
    """
    problem = as_joint(done.problem)
    if problem is done.problem:
        return None
    repeated, there = repeated_motion(problem, NULL_DRAWS, seed), final
    for _ in range(ROUNDS):
        noise = noise_model(problem, there.x, there.effects, repeated, seed=seed)
        weight = np.where(problem.valid, 1.0 / noise.sigma, 0.0)
        there = rig.fitted(problem, weight, there.effects, there)
    there = fit(problem, weight, there.effects, there, linearisations=20)
    problem = in_doubt(problem, weight, there)
    kept, there = _surely(problem, weight, done.roles, there, done.found.found)
    if (apart := beside_clocks(problem, there)) is not problem:
        there = fit(apart, weight, there.effects, np.append(there.x, np.zeros(apart.shapes)), linearisations=20)
        problem = in_doubt(apart, weight, there)
    done = replace(done, found=replace(done.found, found=kept))
    seen = replace(done, problem=problem, noise=noise, found=replace(done.found, final=there), beside_form=None)
    names, laws = there.effects[: len(kept)], there.effects[len(kept) :]
    known = [(replace(candidate, free=()), values) for candidate, values in names]
    held = fit(done.problem, done.weight, [*known, *laws], there.x[: done.problem.nuisances], linearisations=20)
    whole = replace(held, effects=(*names, *held.effects[len(kept) :]))
    late = offsets_beside(problem, there.x, deviations(problem, weight, done.roles, there))
    return Parallel(replace(done, beside_form=seen, around=False), whole, held, there, late)


def with_terms(done: Finished, laws: FoundLaws) -> Finished | None:
    """The search with what every joint or axis may have and only shows beside the first of ``laws``, whose torque had kept it in doubt: the
    second may have taken its place. None where there is nothing more."""
    there, fitted = done.compared, laws.fitted
    if not is_rig(done.problem.vehicle):
        return None
    problem = with_freedoms(there, beside_names=True)
    x = np.append(fitted.x[: problem.first_bend], np.zeros(problem.bends.shape[1]))
    current, more = fit(problem, there.fitted, fitted.effects[: laws.names + 1], x, linearisations=6), list[Found]()
    for richer, score in rig.wanted(problem, there.noise, there.fitted, current):
        more.insert(0, Found(score, (), (), current.cost - richer.cost, given=True))
        current = richer
    known = in_doubt(problem, there.fitted, current)
    while more:
        sizes = [max(in_deviations(known, there.fitted, there.roles, current, i).values(), default=np.inf) for i in range(len(more))]
        least = int(np.argmin(sizes))
        if sizes[least] >= SURE_SIGMA:
            standing = done if laws.names else done.only(())  # what did not stand does not for being in the way
            return standing.with_more(more, current.effects[: len(more)])
        del more[least]
        current = fit(known, there.fitted, [effect for i, effect in enumerate(current.effects) if i != least], current)
    return None


class BesideLaws(NamedTuple):
    """A joint or axis with laws beside its names, without names that may be nothing there: in ``parallel``, and as it is judged."""

    done: Finished
    lawful: FoundLaws
    judged: Judged
    parallel: Parallel


def beside_laws(done: Finished, lawful: FoundLaws, parallel: Parallel, seed: int) -> BesideLaws | None:
    """Names and laws as they are in ``parallel``; None where the laws are nothing there: they stood for what smoothed motion does not
    know."""
    there, kept, bent = parallel.done.compared, parallel.done.found.found, parallel.bent
    names = bent.effects[: len(kept)]
    if fit(there.problem, there.weight, names, bent.x, linearisations=20).cost - bent.cost < SURE * there.problem.doubt:
        return None
    fitted = fit(lawful.problem, done.fitted, parallel.whole.effects, lawful.fitted.x, linearisations=12)
    judged = verify(lawful.problem, done.weight, done.found.baseline, fitted, done.roles, seed)
    if len(kept) < len(done.found.found):
        done = done.only([i for i, item in enumerate(done.found.found) if any(item is own for own in kept)])
    return BesideLaws(done, replace(lawful, fitted=fitted, fit=parallel.held), judged, parallel)


def _surely(problem: Problem, weight: Array, roles: Split, fitted: Fit, found: Sequence[Found]) -> tuple[tuple[Found, ...], Fit]:
    """What was found, and its fit, without names, parts and refinements of terms of every joint that may be nothing; laws come after
    names."""
    kept = list(found)
    while True:
        terms = [i for i in range(len(kept)) if fitted.effects[i][0].effect.of_every_joint]
        effects: Effects
        if (plainer := _unrefined(problem, weight, fitted, terms)) is not None:
            fitted = plainer
            continue
        if (part := least_sure_part(problem, weight, roles, fitted, terms)) is not None:
            effects = without_part(fitted.effects, *part)
        elif (nothing := least_sure_name(problem, weight, roles, fitted, len(kept))) is not None:
            del kept[nothing]
            effects = [effect for i, effect in enumerate(fitted.effects) if i != nothing]
        else:
            return tuple(kept), fitted
        fitted = fit(problem, weight, effects, fitted.x, linearisations=20)


def _unrefined(problem: Problem, weight: Array, fitted: Fit, terms: Sequence[int]) -> Fit | None:
    """A fit without the refinement of the law of one of these ``terms`` that it can best spare; None where each takes what it must."""
    refined = [
        (i, name) for i in terms for name in fitted.effects[i][0].free
        if fitted.effects[i][0].parameter(name).optional and name not in fitted.effects[i][0].effect.amplitudes
    ]  # fmt: skip
    fits = [fit(problem, weight, without_part(fitted.effects, *each), fitted.x, linearisations=20) for each in refined]
    least = min(fits, key=lambda each: each.cost, default=None)
    return least if least is not None and least.cost - fitted.cost < SURE_SIGMA**2 * problem.doubt else None
