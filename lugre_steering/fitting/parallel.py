# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A joint or axis as its inertia must be fitted: torque and acceleration through one average, friction midway between samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lugre_steering.data.dataset import Run, acceleration, averaged, impulse, in_parallel
from lugre_steering.fitting.fingerprint import candidates
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.problem import Problem, is_rig

BIAS = 0.2
"""Most that the noise of the acceleration may move an inertia, in its standard deviation by the noise of the torque."""
LEFT = 0.3
"""Share of the samples that an average must leave: it needs all samples in its reach."""
AVERAGES_S = tuple(0.01 * 2.0 ** (0.5 * k) for k in range(11))
"""Averages tried."""


def as_joint(problem: Problem) -> Problem:
    """The same in parallel, with the shortest average that leaves the inertia next to no bias; of a vehicle, as it is; without
    inertia, or where too many samples are missing, only midway.

    Friction at the rate of a sample's end would lag, which passed for viscous friction (2 % to 5 % of it at 40 to 100 Hz).
    """
    if not is_rig(problem.vehicle):
        return problem
    plain = problem.over([replace(run, midway=True) for run in problem.runs])
    if not (inertia := _inertia(plain)):
        return plain
    for average_s in AVERAGES_S:
        seen = plain.over([in_parallel(run, average_s) for run in plain.runs])
        if seen.valid.sum() < LEFT * plain.valid.sum():
            return plain
        inertia = _inertia(seen)
        if _bias(seen.runs, plain.runs, inertia) < BIAS:
            break
    return seen


def _inertia(problem: Problem) -> float:
    """Of a fit with all that every joint may have [kg m2]; zero where an inertia is not considered."""
    known = [candidate.effect.id for candidate, _ in problem.standing]
    terms = [c for c in candidates(problem, known) if c.effect.of_every_joint]
    fitted = fit(problem, problem.sensor_weight, [(c, dict.fromkeys(c.free, 0.0)) for c in terms])
    every = [effect for effect in (*problem.standing, *fitted.effects) if effect[0].effect.of_every_joint]
    return next((own[c.effect.amplitudes[0]] for c, own in every if c.effect.coordinate == "steering acceleration"), 0.0)


def _bias(seen: Sequence[Run], plain: Sequence[Run], inertia: float) -> float:
    """What the noise of the accelerations takes from an inertia [kg m2], in the standard deviation that the noise of the torque leaves it:
    a share of the noise in the energy of the acceleration (W. Fuller, Measurement Error Models, 1987)."""
    energy = noise = 0.0
    for run, before in zip(seen, plain, strict=True):
        weight = run.valid / before.sigma
        alone = averaged(run, acceleration(run.time, impulse(run.time.size)[None])[0])
        noise += float((run.angle.sigma() * np.linalg.norm(alone) * np.linalg.norm(weight)) ** 2)
        energy += float(np.sum((weight * averaged(run, run.alpha[0])) ** 2))
    return inertia * noise / float(np.sqrt(energy - noise)) if energy > noise else np.inf
