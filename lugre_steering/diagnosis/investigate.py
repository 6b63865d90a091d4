# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From prepared runs to what they hide: recalibrate, measure the noise, search; again where physics had passed for noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from lugre_steering.data.dataset import Run
from lugre_steering.diagnosis.fewer import fewer
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.form import Bent, bent
from lugre_steering.diagnosis.search.search import search
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import Noise, noise_model, repeated_motion
from lugre_steering.fitting.problem import SMOOTH, Problem, is_rig, smooth_calibrations
from lugre_steering.fitting.split import Split, balanced, split
from lugre_steering.fitting.trial import TRIAL_TOLERANCE
from lugre_steering.recording import Array

NULL_DRAWS = 16
"""Errors that hide nothing, by which chance is judged."""
MUCH_LESS = 2.0 / 3.0
"""Share of what is left, at most, with which another friction law takes the place of that of the vehicle file."""
RISE = 1.0
"""Stribeck exponent with which a friction rises from standstill in proportion to the rate, as that of a lubricated contact does."""
SAMPLES, FASTEST_HZ, ALONE = 3000, 200.0, 10
"""Samples on which names are compared, unless the recording is slow; the rate beyond which there is nothing to be seen; and how many
times as many are as quick without freedoms."""
NOISE_ROUNDS, QUIETER = 2, 0.8
"""Searches repeated, and the fall of the noise floor, once physics is found, that asks for it."""


def investigate(problem: Problem, seed: int, progress: Callable[[str], None] = lambda _: None) -> Finished:
    """Recalibrate and search; on joints and axes also for a friction that rises smoothly from standstill, where that of the vehicle file
    leaves much more: than it or, which nothing can fall below, than noise."""
    done = _investigated(problem, seed, progress)
    if not is_rig(problem.vehicle) or problem.calibrations == SMOOTH or MUCH_LESS * _left(done) < done.noise.floor**2:
        return done
    progress("searching beside a friction that rises smoothly from standstill")
    contact = problem.vehicle.contact
    assert contact is not None
    vehicle = problem.vehicle.replace(contact=replace(contact, stribeck_exponent=RISE))
    smooth = _investigated(Problem(vehicle, problem.runs, smooth_calibrations(vehicle, problem.runs)), seed, progress)
    return smooth if _left(smooth) < MUCH_LESS * _left(done) else done


def _left(done: Finished) -> float:
    """Mean square of what is left on samples held out [N2 m2]."""
    return float(np.mean(np.square((done.problem.measured - done.found.final.prediction)[done.roles.held])))


def _investigated(problem: Problem, seed: int, progress: Callable[[str], None]) -> Finished:
    """Recalibrate and search beside the friction law's own freedoms; a vehicle file can hold names, not the freedoms."""
    repeated = repeated_motion(problem, NULL_DRAWS, seed)
    noise, roles, baseline = recalibrate(problem, repeated, seed)
    done = _searched(problem, noise, roles, baseline, progress)
    for _ in range(NOISE_ROUNDS if done.found.found else 0):
        final = done.found.final
        quieter = noise_model(problem, final.x, final.effects, repeated, seed=seed)
        if quieter.floor > QUIETER * noise.floor:
            break
        noise = quieter
        baseline = fit(problem, np.where(roles.fit, 1.0 / noise.sigma, 0.0), start=baseline.x)
        done = _searched(problem, noise, roles, baseline, progress)
    return done


def _searched(problem: Problem, noise: Noise, roles: Split, baseline: Fit, progress: Callable[[str], None]) -> Finished:
    """What the search comes to, with names fitted as a vehicle file holds them: without the freedoms."""
    # What else joints and axes may do is found by name: their sheets know little of their friction anyhow.
    alone = is_rig(problem.vehicle)
    most = ALONE * SAMPLES if alone else SAMPLES
    thin, less, used = fewer(problem, noise, roles, baseline, most, FASTEST_HZ, means=not alone)
    freer, words, freedoms = Bent(thin, (), ()) if alone else bent(thin, baseline)
    there, found = search(freer, less, used, _unbent(freer, np.where(used.fit, 1.0 / less.sigma, 0.0), baseline), progress)
    beside = Finished(there, less, used, found, form=(*words, *[""] * (there.bends.shape[1] - len(words))), freedoms=freedoms)
    done = Finished(problem, noise, roles, replace(found, baseline=baseline), beside_form=beside)
    done = _with_final(done, found.final)
    # The values of a joint are found anew in parallel at the end (``conclude.joint``), and those beside bends of a name's own law, all the
    # freedoms that it has, are no better.
    if alone or not there.bends.shape[1] or not found.found or any(item.in_place for item in found.found) or not done.needs_form:
        return done
    return _with_final(replace(done, around=True), found.final)


def _with_final(done: Finished, beside: Fit) -> Finished:
    """The search with its names as a vehicle file holds them; ``beside``: they and the freedoms."""
    return replace(done, found=replace(done.found, final=done.in_file(done.fitted, beside.effects, beside.x)))


def _unbent(problem: Problem, weight: Array, baseline: Fit) -> Fit:
    """The baseline with its freedoms; recalibration was bent to imitate what is missing, and from there the way back may be closed."""
    starts = [np.append(baseline.x, np.zeros(problem.bends.shape[1])), problem.start()]
    fits = (fit(problem, weight, start=start, linearisations=20, tolerance=TRIAL_TOLERANCE) for start in starts)
    return min(fits, key=lambda each: each.cost)


def recalibrate(problem: Problem, repeated: Sequence[Sequence[Run]], seed: int) -> tuple[Noise, Split, Fit]:
    """Baseline fitted with sheet noise first, then with the noise measured at that fit, on the split that suits its errors."""
    weight = np.where(split(problem).fit, 1.0 / problem.sigma, 0.0)
    starts = [fit(problem, weight, linearisations=25, robust=robust, tolerance=TRIAL_TOLERANCE) for robust in (False, True)]
    first = min((fit(problem, weight, start=start, linearisations=10) for start in starts), key=lambda f: f.cost)
    noise = noise_model(problem, first.x, (), repeated, seed=seed)
    # A single event that is fitted leaves its error elsewhere.
    unbent = fit(problem, np.where(problem.valid, 1.0 / noise.sigma, 0.0), start=first.x, robust=True)
    roles = balanced(problem, ((problem.measured - unbent.prediction) / noise.sigma) ** 2 - 1.0)
    return noise, roles, fit(problem, np.where(roles.fit, 1.0 / noise.sigma, 0.0), start=first.x)
