# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Detection limits: how large each effect would have to be for a recording to reveal it."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from lugre_steering.diagnosis.fingerprint import Score, signature
from lugre_steering.diagnosis.fit import Fit
from lugre_steering.diagnosis.problem import Problem
from lugre_steering.effects.entry import Parameter
from lugre_steering.recording import Array

REVEALED = 0.3
"""Energy after recalibration, in noise variances per sample, from which effects are mostly named (the scoreboard counts how many)."""
SECANTS, UNCERTAIN = 6, 0.1
"""Steps to its size at most, and the logarithm of the energy that is close enough."""


def smallest(
    problem: Problem, baseline: Fit, weight: Array, scores: Sequence[Score], without: Collection[str]
) -> dict[str, tuple[Parameter, float | None]]:
    """Per effect its best seen variant, acting everywhere and always, and the amplitude of its first free parameter that it takes.

    The size is found on the effect itself, by secants in the logarithms: few grow in proportion to their parameter. None: no
    size that the parameter may have would do.
    """
    best: dict[str, tuple[Score, float]] = {}
    for score in scores:
        candidate = score.candidate
        if candidate.effect.id in without or not candidate.free or candidate.since or candidate.bags is not None:
            continue
        needed = max(REVEALED * float(np.count_nonzero(weight)), 2.0 * float(np.max(score.null_explained)))
        if score.visible > 0.0:
            share = float(np.sqrt(needed / score.visible))
            if candidate.effect.id not in best or share < best[candidate.effect.id][1]:
                best[candidate.effect.id] = score, share
    basis = baseline.basis()
    base = [problem.predict(bag, baseline.x, baseline.effects) for bag in range(len(problem.runs))]
    found: dict[str, tuple[Parameter, float | None]] = {}
    for effect, (score, share) in sorted(best.items()):
        needed = share**2 * score.visible
        parameter = score.candidate.parameter(score.candidate.free[0])
        value, power = min(share * parameter.scale, parameter.high), 2.0
        tried: list[tuple[float, float]] = []
        for _ in range(SECANTS):
            column = signature(problem, baseline, base, score.candidate, value)[:, 0] * weight
            seen = column - basis @ (basis.T @ column)
            off = float(np.log(max(float(seen @ seen), 1e-12) / needed))
            hidden = off < -UNCERTAIN and value >= parameter.high
            if hidden or abs(off) < UNCERTAIN:
                break
            tried.append((float(np.log(value)), off))
            if len(tried) > 1 and tried[-1][0] != tried[-2][0]:
                slope = (tried[-1][1] - tried[-2][1]) / (tried[-1][0] - tried[-2][0])
                power = float(np.clip(slope, 0.5, 6.0))
            value = min(value * float(np.exp(np.clip(-off / power, -2.0, 2.0))), parameter.high)
        found[effect] = parameter, None if hidden else value
    return found
