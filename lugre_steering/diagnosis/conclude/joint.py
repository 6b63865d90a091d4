# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The values of what a joint or axis has, where torque and acceleration are seen through one average."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.investigate import NULL_DRAWS
from lugre_steering.diagnosis.search.surely import least_sure_part, without_part
from lugre_steering.fitting.doubt import in_doubt
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import noise_model, repeated_motion
from lugre_steering.fitting.parallel import as_joint
from lugre_steering.fitting.rig import fitted

ROUNDS = 2
"""Of noise and fit: the noise is that of the acceleration times the inertia, which is not known before."""


def in_parallel(done: Finished, final: Fit, seed: int) -> tuple[Finished, Fit, Fit] | None:
    """The search with all samples in parallel to compare in, what was found there fitted to all as recorded with the values that it has in
    parallel, and fitted in parallel; None of a vehicle.

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
        there = fitted(problem, weight, there.effects, there)
    there = fit(problem, weight, there.effects, there, linearisations=20)
    problem = in_doubt(problem, weight, there)
    terms = [i for i, (candidate, _) in enumerate(there.effects) if candidate.effect.of_every_joint]
    while (part := least_sure_part(problem, weight, done.roles, there, terms)) is not None:
        there = fit(problem, weight, without_part(there.effects, *part), there.x, linearisations=20)
    seen = replace(done, problem=problem, noise=noise, found=replace(done.found, final=there), beside_form=None)
    held = [(replace(candidate, free=()), values) for candidate, values in there.effects]
    whole = fit(done.problem, done.weight, held, there.x, linearisations=20)
    return replace(done, beside_form=seen), replace(whole, effects=there.effects), there
