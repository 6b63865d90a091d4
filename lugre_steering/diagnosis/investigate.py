# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From prepared runs to what they hide: recalibrate, measure the noise, search; again where physics had passed for noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lugre_steering.data.dataset import Run
from lugre_steering.diagnosis.conclude.finished import Finished
from lugre_steering.diagnosis.conclude.left_over import structured
from lugre_steering.diagnosis.form import bent
from lugre_steering.diagnosis.loudness import FORM_LEFT, excess, form_energy, loudness
from lugre_steering.diagnosis.search.build_up import search
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import Noise, noise_model, repeated_motion
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.sheet import thinned
from lugre_steering.fitting.split import Split, balanced, split

NULL_DRAWS = 16
BETTER = 0.5
"""Share of the excess left by all freedoms of the friction law together that names alone may leave to be believed without them."""
FORM_SAMPLES = 8000
"""Samples on which names compete beside the form of the friction law, which is slow."""
NOISE_ROUNDS, QUIETER = 2, 0.8
"""Searches repeated, and the fall of the noise floor, once physics is found, that asks for it."""


def investigate(problem: Problem, seed: int, progress: Callable[[str], None] = lambda _: None) -> Finished:
    """Recalibrate and search; beside the friction law's own freedoms where names do not explain all to the noise.

    Few values that explain everything need no further freedom; else the law is of another form somewhere, and names that only
    make up for that are none.
    """
    repeated = repeated_motion(problem, NULL_DRAWS, seed)
    noise, roles, baseline = recalibrate(problem, repeated, seed)
    form = _Form.of(problem, noise, roles, baseline) if loudness(problem, noise, baseline).loud else None
    enough = form.left if form is not None and form.explains_most else None
    found = search(problem, noise, roles, baseline, progress, enough=enough)
    for _ in range(NOISE_ROUNDS if found.found else 0):
        quieter = noise_model(problem, found.final.x, found.final.effects, repeated, seed=seed)
        if quieter.floor > QUIETER * noise.floor:
            break
        noise = quieter
        baseline = fit(problem, np.where(roles.fit, 1.0 / noise.sigma, 0.0), start=found.baseline.x)
        found = search(problem, noise, roles, baseline, progress, enough=enough)
    done = Finished(problem, noise, roles, found)
    if not structured(done, found.final):
        return done
    progress("beside the friction law's own form")
    form = _Form.of(problem, noise, roles, found.baseline)
    there = search(form.problem, form.noise, form.roles, form.baseline, progress)
    if found.found and not there.found and excess(problem, found.final, done.fitted) < BETTER * form.left:
        return done  # all freedoms together do not what these names do
    beside = Finished(form.problem, form.noise, form.roles, there, form=form.words)
    # A vehicle file can hold names, not the freedoms.
    final = fit(problem, done.fitted, there.final.effects, there.final.x[: problem.nuisances])
    return replace(done, found=replace(there, baseline=found.baseline, final=final), beside_form=beside)


@dataclass(frozen=True)
class _Form:
    """A problem with the freedoms of the friction law (``words`` for each), of few samples, and its recalibrated baseline."""

    problem: Problem
    words: tuple[str, ...]
    noise: Noise
    roles: Split
    baseline: Fit

    @staticmethod
    def of(problem: Problem, noise: Noise, roles: Split, baseline: Fit) -> _Form:
        thin, kept = thinned(problem, FORM_SAMPLES)
        freer, words = bent(thin, baseline)
        noise = Noise(noise.sigma[kept], noise.draws[:, kept], noise.slow_doubt)
        roles = Split(roles.fit[kept], roles.held[kept], roles.cluster[kept])
        weight, every = (np.where(used, 1.0 / noise.sigma, 0.0) for used in (roles.fit, freer.valid))
        plain = fit(thin, weight, start=baseline.x)
        # Recalibration was bent to imitate what is missing; from there the way back may be closed.
        starts = [np.concatenate([plain.x, np.zeros(freer.bends.shape[1])]), freer.start()]
        free = min((fit(freer, weight, start=start, linearisations=20) for start in starts), key=lambda each: each.cost)
        freer.bends_explain = max(excess(thin, plain, every) - excess(freer, free, every), 0.0)
        return _Form(freer, words, noise, roles, free)

    @property
    def left(self) -> float:
        """Excess beside these freedoms."""
        return excess(self.problem, self.baseline, np.where(self.roles.fit, 1.0 / self.noise.sigma, 0.0))

    @property
    def explains_most(self) -> bool:
        """Whether there is hardly more than these freedoms."""
        weight = np.where(self.roles.fit, 1.0 / self.noise.sigma, 0.0)
        return self.left * float(self.roles.fit.sum()) < FORM_LEFT * form_energy(self.problem, self.baseline, weight)


def recalibrate(problem: Problem, repeated: Sequence[Sequence[Run]], seed: int) -> tuple[Noise, Split, Fit]:
    """Baseline fitted with sheet noise first, then with the noise measured at that fit, on the split that suits its errors."""
    sheet = np.concatenate([run.sigma for run in problem.runs])
    weight = np.where(split(problem).fit, 1.0 / sheet, 0.0)
    starts = [fit(problem, weight, linearisations=25), fit(problem, weight, robust=True, linearisations=25)]
    first = min((fit(problem, weight, start=start.x, linearisations=10) for start in starts), key=lambda f: f.cost)
    noise = noise_model(problem, first.x, (), repeated, seed=seed)
    roles = balanced(problem, ((problem.measured - first.prediction) / noise.sigma) ** 2 - 1.0)
    return noise, roles, fit(problem, np.where(roles.fit, 1.0 / noise.sigma, 0.0), start=first.x)
