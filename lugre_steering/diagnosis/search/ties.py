# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Rivals that a recording cannot tell apart, and which of them stands for the group."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lugre_steering.diagnosis.search.trial import Trial, rank
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.split import Split
from lugre_steering.recording import Array

TIE_T = 2.5
TIE_MISFIT, TIE_ENERGY = 0.5, 0.02
"""A tied rival may leave more than the best by so much of what the best itself leaves, and of the noise energy."""
LAW = 0.01


def tied(
    problem: Problem, weight: Array, split: Split, best: Trial, others: Sequence[Trial], before: float, samples: float,
    law: float = LAW,
) -> list[Trial]:
    """Rivals that this data cannot tell from the best.

    Either no clear difference block by block (Vuong 1989), or one smaller than a tenth of what even the best leaves over and the
    share ``law`` of what it explains.
    """
    found = []
    error = ((problem.measured - best.fit.prediction) * weight) ** 2
    misfit = max(best.cost - samples, 0.0)
    for other in others:
        if other.candidate.label == best.candidate.label or before - other.cost < 0.5 * (before - best.cost):
            continue
        difference = np.bincount(split.cluster, ((problem.measured - other.fit.prediction) * weight) ** 2 - error)
        t = difference.sum() / max(np.sqrt(np.sum(difference**2)), 1e-9)
        close = other.cost - best.cost < TIE_MISFIT * misfit + TIE_ENERGY * samples
        if (close and t < TIE_T) or other.cost - best.cost < 0.1 * misfit + law * (before - best.cost) + 10.0:
            found.append(other)
    return found


def simplest(best: Trial, rivals: list[Trial], before: float) -> tuple[Trial, list[Trial]]:
    """Of effects that fit equally well the one with the fewest free parameters stands for the group."""
    group = [best, *rivals]
    chosen = min(group, key=lambda trial: rank(trial, before) + 10.0 * len(trial.candidate.free))
    return chosen, [trial for trial in group if trial is not chosen]
