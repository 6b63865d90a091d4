# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From prepared runs to what they hide: recalibrate, measure the noise, search; again where physics had passed for noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from lugre_steering.data.dataset import Run
from lugre_steering.diagnosis.conclude.finished import Finished
from lugre_steering.diagnosis.conclude.left_over import structured
from lugre_steering.diagnosis.form import bent
from lugre_steering.diagnosis.search.build_up import search
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import Noise, noise_model, repeated_motion
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.split import Split, balanced, split

NULL_DRAWS = 16
NOISE_ROUNDS, QUIETER = 2, 0.8
"""Searches repeated, and the fall of the noise floor, once physics is found, that asks for it."""


def investigate(problem: Problem, seed: int, progress: Callable[[str], None] = lambda _: None) -> Finished:
    """Recalibrate and search; beside the friction law's own freedoms where names do not explain all to the noise.

    Few values that explain everything need no further freedom; else the law is of another form somewhere, and names that only
    make up for that are none.
    """
    repeated = repeated_motion(problem, NULL_DRAWS, seed)
    done = _searched(problem, *recalibrate(problem, repeated, seed), repeated, seed, progress)
    if not structured(done, done.found.final):
        return done
    progress("beside the friction law's own form")
    return _beside_form(done, repeated, seed, progress)


def _searched(
    problem: Problem, noise: Noise, roles: Split, baseline: Fit, repeated: Sequence[Sequence[Run]], seed: int,
    progress: Callable[[str], None],
) -> Finished:
    """Search; again if what was found shows that part of the noise had been physics."""
    found = search(problem, noise, roles, baseline, progress)
    for _ in range(NOISE_ROUNDS if found.found else 0):
        quieter = noise_model(problem, found.final.x, found.final.effects, repeated, seed=seed)
        if quieter.floor > QUIETER * noise.floor:
            break
        noise = quieter
        baseline = fit(problem, np.where(roles.fit, 1.0 / noise.sigma, 0.0), start=found.baseline.x)
        found = search(problem, noise, roles, baseline, progress)
    return Finished(problem, noise, roles, found)


def _beside_form(
    done: Finished, repeated: Sequence[Sequence[Run]], seed: int, progress: Callable[[str], None]
) -> Finished:
    """What is found beside the freedoms of the friction law, fitted without them, as a vehicle file can hold it."""
    alone, roles = done.found, done.roles
    freer = bent(done.problem, alone.baseline)
    start = np.concatenate([alone.baseline.x, np.zeros(freer.bends.shape[1])])
    baseline = fit(freer, done.fitted, start=start)
    noise = noise_model(freer, baseline.x, (), repeated, seed=seed)
    baseline = fit(freer, np.where(roles.fit, 1.0 / noise.sigma, 0.0), start=baseline.x)
    beside = _searched(freer, noise, roles, baseline, repeated, seed, progress)
    final = fit(done.problem, done.fitted, beside.found.final.effects, beside.found.final.x[: done.problem.nuisances])
    return replace(done, found=replace(beside.found, baseline=alone.baseline, final=final), beside_form=beside)


def recalibrate(problem: Problem, repeated: Sequence[Sequence[Run]], seed: int) -> tuple[Noise, Split, Fit]:
    """Baseline fitted with sheet noise first, then with the noise measured at that fit, on the split that suits its errors."""
    sheet = np.concatenate([run.sigma for run in problem.runs])
    weight = np.where(split(problem).fit, 1.0 / sheet, 0.0)
    starts = [fit(problem, weight, linearisations=25), fit(problem, weight, robust=True, linearisations=25)]
    first = min((fit(problem, weight, start=start.x, linearisations=10) for start in starts), key=lambda f: f.cost)
    noise = noise_model(problem, first.x, (), repeated, seed=seed)
    roles = balanced(problem, ((problem.measured - first.prediction) / noise.sigma) ** 2 - 1.0)
    return noise, roles, fit(problem, np.where(roles.fit, 1.0 / noise.sigma, 0.0), start=first.x)
