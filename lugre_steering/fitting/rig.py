# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What every joint or axis may have beside friction, fitted together before anything is looked for: inertia, viscous friction,
an offset, gravity.

Each hides the others while it is missing, so one after another they would be judged wrongly; those stay that the data carry.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lugre_steering.fitting.doubt import doubt
from lugre_steering.fitting.fingerprint import Score, candidates, screen
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import Candidate, Problem, Values
from lugre_steering.fitting.trial import TRIAL_TOLERANCE, Trial, cost, refine
from lugre_steering.recording import Array

LEAST, SHARE, SURE = 0.05, 0.02, 0.3
"""Energy by which what is left must rise without a term: in noise variances per sample, and a share of what all leave, unless it is
so large against the noise."""


def carried(problem: Problem, noise: Noise, weight: Array, baseline: Fit) -> list[tuple[Fit, Score]]:
    """The terms without which clearly more would be left over, what matters most first.

    Each with the fit that has it and those before it, and its score against what the others leave.
    """
    samples = float(np.count_nonzero(weight))
    least = max(LEAST * samples, min(SHARE * (cost(problem, baseline, weight) - samples), SURE * samples))
    known = {candidate.effect.id for candidate, _ in problem.standing}
    terms = [c for c in candidates(problem, sorted(known)) if c.effect.of_every_joint]
    full = _fitted(problem, weight, [(c, dict.fromkeys(c.free, 0.0)) for c in terms], baseline)
    problem = problem.doubted(doubt(problem, full, weight), problem.typical)
    order: list[Candidate] = []  # what can be spared first comes last
    while full.effects:
        rests = [[e for i, e in enumerate(full.effects) if i != index] for index in range(len(full.effects))]
        leaner = [_fitted(problem, weight, rest, full) for rest in rests]
        index = min(range(len(leaner)), key=lambda i: cost(problem, leaner[i], weight))
        if order or cost(problem, leaner[index], weight) - cost(problem, full, weight) > least:
            order.insert(0, full.effects[index][0])
        full = leaner[index]
    found: list[tuple[Fit, Score]] = []
    current = baseline
    for candidate in order:
        (score,) = (s for s in screen(problem, current, weight, noise.draws, among=[candidate]) if s.candidate == candidate)
        current = _fitted(problem, weight, [*current.effects, (candidate, score.values)], current)
        current = refine(problem, weight, Trial(score, current, cost(problem, current, weight))).fit
        found.append((current, score))
    return found


def _fitted(problem: Problem, weight: Array, effects: Sequence[tuple[Candidate, Values]], near: Fit) -> Fit:
    """The better of the fits that begin at ``near`` and at the vehicle file: friction stretched into a soft spring passes for gravity,
    and from there the way back may be closed."""
    begun = (fit(problem, weight, effects, x, tolerance=TRIAL_TOLERANCE) for x in (near, problem.start()))
    return min(begun, key=lambda each: each.cost)
