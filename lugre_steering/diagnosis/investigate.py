# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From prepared runs to what they hide: recalibrate, measure the noise, search; again where physics had passed for noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lugre_steering.data.dataset import Run
from lugre_steering.diagnosis.search.build_up import Search, search
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import Noise, noise_model, repeated_motion
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.split import Split, balanced, split

NULL_DRAWS = 16
NOISE_ROUNDS, QUIETER = 2, 0.8
"""Searches repeated, and the fall of the noise floor, once physics is found, that asks for it."""


def investigate(
    problem: Problem, seed: int, progress: Callable[[str], None] = lambda _: None
) -> tuple[Noise, Split, Search]:
    """Recalibrate and search; again if what was found shows that part of the noise had been physics."""
    repeated = repeated_motion(problem, NULL_DRAWS, seed)
    noise, roles, baseline = recalibrate(problem, repeated, seed)
    found = search(problem, noise, roles, baseline, progress)
    for _ in range(NOISE_ROUNDS if found.found else 0):
        quieter = noise_model(problem, found.final.x, found.final.effects, repeated, seed=seed)
        if quieter.floor > QUIETER * noise.floor:
            break
        noise = quieter
        baseline = fit(problem, np.where(roles.fit, 1.0 / noise.sigma, 0.0), start=found.baseline.x)
        found = search(problem, noise, roles, baseline, progress)
    return noise, roles, found


def recalibrate(problem: Problem, repeated: Sequence[Sequence[Run]], seed: int) -> tuple[Noise, Split, Fit]:
    """Baseline fitted with sheet noise first, then with the noise measured at that fit, on the split that suits its errors."""
    sheet = np.concatenate([run.sigma for run in problem.runs])
    weight = np.where(split(problem).fit, 1.0 / sheet, 0.0)
    starts = [fit(problem, weight, linearisations=25), fit(problem, weight, robust=True, linearisations=25)]
    first = min((fit(problem, weight, start=start.x, linearisations=10) for start in starts), key=lambda f: f.cost)
    noise = noise_model(problem, first.x, (), repeated, seed=seed)
    roles = balanced(problem, ((problem.measured - first.prediction) / noise.sigma) ** 2 - 1.0)
    return noise, roles, fit(problem, np.where(roles.fit, 1.0 / noise.sigma, 0.0), start=first.x)
