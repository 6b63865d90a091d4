# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Detection limits: how large each effect would have to be for a recording to reveal it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import partial

import numpy as np

from lugre_steering.diagnosis.search.compare import needed as least_needed
from lugre_steering.effects.entry import Parameter
from lugre_steering.fitting.fingerprint import Score, candidates, signature
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem, in_threads
from lugre_steering.recording import Array

REVEALED = 0.3
"""Energy after recalibration, in noise variances per sample, from which effects are mostly named (the scoreboard counts how many)."""
SHAPES = 3
"""Best seen shapes of an effect that are followed to their size; the best at one size need not be so at another."""
SECANTS, UNCERTAIN = 8, 0.1
"""Steps to a size at most, and the logarithm of the energy that is close enough."""


def smallest(
    problem: Problem, baseline: Fit, weight: Array, scores: Sequence[Score], without: Collection[str]
) -> dict[str, tuple[Parameter, float | None]]:
    """Per effect, acting everywhere and always, its first free parameter and the magnitude of it that would show.

    Beside freedoms of the friction law it must show more than their own form may. The size is found on the effect itself: few grow
    in proportion to their parameter. None: no size that the parameter may have would do.
    """
    least_energy = least_needed(problem, baseline, weight)
    variants: dict[str, list[tuple[float, float, Score]]] = {}
    for score in scores:
        candidate = score.candidate
        if candidate.effect.id in without or not candidate.free or candidate.since or candidate.bags is not None:
            continue
        needed = max(REVEALED * float(np.count_nonzero(weight)), 2.0 * float(np.max(score.null_explained)), least_energy)
        if score.visible > 0.0:
            variants.setdefault(candidate.effect.id, []).append((float(np.sqrt(needed / score.visible)), needed, score))
    basis = baseline.tangent()
    base = [problem.predict(bag, baseline.x, baseline.effects) for bag in range(len(problem.runs))]

    def shown(score: Score, needed: float, sign: float, size: float) -> float:
        """Logarithm of what shows of an effect of this size over what must."""
        column = signature(problem, baseline, base, score.candidate, sign * size)[:, 0] * weight
        column = np.append(column, np.zeros(basis.shape[0] - weight.size))
        seen = column - basis @ (basis.T @ column)
        return float(np.log(max(float(seen @ seen), 1e-12) / needed))

    def least(effect: str) -> tuple[Parameter, float | None]:
        sizes = []
        for share, needed, score in sorted(variants[effect], key=lambda variant: variant[0])[:SHAPES]:
            parameter = score.candidate.parameter(score.candidate.free[0])
            for sign, bound in ((1.0, parameter.high), (-1.0, -parameter.low)):
                if bound > 0.0:
                    sizes.append(_size(partial(shown, score, needed, sign), share * parameter.scale, bound))
        return parameter, min((size for size in sizes if size is not None), default=None)

    names = sorted(variants)
    found = dict(zip(names, in_threads(least, names), strict=True))
    # What leaves no trace in this recording at all has no score either.
    known = {*without, *(candidate.effect.id for candidate, _ in baseline.effects)}
    for candidate in candidates(problem, sorted(known)):
        if candidate.free:
            found.setdefault(candidate.effect.id, (candidate.parameter(candidate.free[0]), None))
    return found


def _size(shown: Callable[[float], float], guess: float, bound: float) -> float | None:
    """Smallest of the sizes tried that shows, by secants in the logarithms from ``guess``; None if none up to ``bound`` does."""
    size, power = min(guess, bound), 2.0
    tried: list[tuple[float, float]] = []
    enough = []
    for _ in range(SECANTS):
        off = shown(size)
        if off >= -UNCERTAIN:
            enough.append(size)
        if abs(off) < UNCERTAIN or not np.isfinite(off) or (off < 0.0 and size >= bound):
            break
        tried.append((float(np.log(size)), off))
        if len(tried) > 1:
            power = float(np.clip((tried[-1][1] - tried[-2][1]) / (tried[-1][0] - tried[-2][0]), 0.5, 6.0))
        size = min(size * float(np.exp(np.clip(-off / power, -2.0, 2.0))), bound)
    return min(enough, default=None)
