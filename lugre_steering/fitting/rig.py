# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What every joint or axis may have beside friction, fitted together before anything is looked for: inertia, viscous friction,
an offset, gravity of a joint, the spring of an axis that works against one.

Each hides the others while it is missing, so one after another they would be judged wrongly; those stay that the data carry.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from lugre_steering.fitting.doubt import doubt
from lugre_steering.fitting.fingerprint import Score, candidates, screen
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import Candidate, Effects, Problem, Values
from lugre_steering.fitting.trial import TRIAL_TOLERANCE, Trial, cost, refine, without_part
from lugre_steering.recording import Array

LEAST, SHARE, PLENTY = 0.05, 0.02, 0.3
"""Energy by which what is left must rise without a term: in noise variances per sample, and a share of what all leave, unless it is
so large against the noise."""
MUCH = 2.0
"""Times what is left with a spring, which few axes have, that must be left without it; a smaller one is looked for like any name."""


def carried(problem: Problem, noise: Noise, weight: Array, baseline: Fit) -> list[tuple[Fit, Score]]:
    """The terms without which clearly more would be left over, what matters most first.

    Each with the fit that has it and those before it, and its score against what the others leave.
    """
    least, terms = _least(problem, baseline, weight), _terms(problem, baseline)
    full = _with_all(problem, weight, terms, baseline)
    if any(term.effect.of_line for term in terms):
        sprung, terms = full, [term for term in terms if not term.effect.of_line]
        full = _with_all(problem, weight, terms, baseline)
        full = sprung if cost(problem, full, weight) > MUCH * cost(problem, sprung, weight) else full
    problem = problem.doubted(doubt(problem, full, weight), problem.typical)
    while full.effects:
        rests = [*_fewer(full.effects).values(), *_less(full.effects)]
        leaner = min((fitted(problem, weight, rest, full) for rest in rests), key=lambda each: cost(problem, each, weight))
        if cost(problem, leaner, weight) - cost(problem, full, weight) > least:
            break
        full = leaner
    order: list[Candidate] = []  # what can be spared first comes last
    while full.effects:
        rest = {index: fitted(problem, weight, others, full) for index, others in _fewer(full.effects).items()}
        index = min(rest, key=lambda i: cost(problem, rest[i], weight))
        order.insert(0, full.effects[index][0])
        full = rest[index]
    found: list[tuple[Fit, Score]] = []
    current = baseline
    for candidate in order:
        (score,) = (s for s in screen(problem, current, weight, noise.draws, among=[candidate]) if s.candidate == candidate)
        current = fitted(problem, weight, [*current.effects, (candidate, score.values)], current)
        current = refine(problem, weight, Trial(score, current, cost(problem, current, weight))).fit
        found.append((current, score))
    return found


def _with_all(problem: Problem, weight: Array, terms: Sequence[Candidate], baseline: Fit) -> Fit:
    return fitted(problem, weight, [(term, dict.fromkeys(term.free, 0.0)) for term in terms], baseline)


def spared(problem: Problem, weight: Array, current: Fit, terms: int) -> Iterator[tuple[int, Fit]]:
    """Those of the first ``terms`` effects of a fit that had only stood for what follows them, last first, each with the fit without it."""
    least = _least(problem, current, weight)
    for index in range(terms - 1, -1, -1):
        rest = [effect for i, effect in enumerate(current.effects) if i != index]
        leaner = fit(problem, weight, rest, current, tolerance=TRIAL_TOLERANCE)
        if cost(problem, leaner, weight) - cost(problem, current, weight) < least:
            current = leaner
            yield index, leaner


def wanted(problem: Problem, noise: Noise, weight: Array, current: Fit) -> Iterator[tuple[Fit, Score]]:
    """Terms that a fit lacks beside all that it has, each with the fit that has it first, and its score."""
    least = _least(problem, current, weight)
    for candidate in (term for term in _terms(problem, current) if not term.effect.of_line):
        score = next(s for s in screen(problem, current, weight, noise.draws, among=[candidate]) if s.candidate == candidate)
        richer = fit(problem, weight, [(candidate, score.values), *current.effects], current.x, tolerance=TRIAL_TOLERANCE)
        if cost(problem, current, weight) - cost(problem, richer, weight) > least:
            current = richer
            yield richer, score


def _fewer(effects: Effects) -> dict[int, Effects]:
    """The effects without one of them, by which that is."""
    return {index: [effect for i, effect in enumerate(effects) if i != index] for index in range(len(effects))}


def _less(effects: Effects) -> Iterator[Effects]:
    """The effects, one of which lacks one of several parts: a constant torque does for the cosine of angles that hardly change it."""
    for index, (candidate, _) in enumerate(effects):
        parts = [name for name in candidate.free if name in candidate.effect.amplitudes]
        yield from (without_part(effects, index, part) for part in parts if len(parts) > 1)


def _terms(problem: Problem, current: Fit) -> list[Candidate]:
    """What every joint or axis may have and neither the vehicle file nor a fit has."""
    known = {candidate.effect.id for candidate, _ in (*problem.standing, *current.effects)}
    return [c for c in candidates(problem, sorted(known)) if c.effect.of_every_joint]


def _least(problem: Problem, current: Fit, weight: Array) -> float:
    samples = float(np.count_nonzero(weight))
    return max(LEAST * samples, min(SHARE * (cost(problem, current, weight) - samples), PLENTY * samples))


def fitted(problem: Problem, weight: Array, effects: Sequence[tuple[Candidate, Values]], near: Fit) -> Fit:
    """The better of the fits that begin at ``near`` and at the vehicle file: friction stretched into a soft spring passes for gravity,
    and from there the way back may be closed."""
    begun = (fit(problem, weight, effects, x, tolerance=TRIAL_TOLERANCE) for x in (near, problem.start()))
    return min(begun, key=lambda each: each.cost)
