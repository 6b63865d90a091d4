# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Which samples may fit, and which are kept to judge: alternating blocks with gaps longer than the friction memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Array, Mask

BLOCK_S = 8.0
"""Long against the memory of errors, short against a recording."""
SPARED_S = 1.0
"""Between blocks, so that errors that last are in one of them only."""
CYCLE = 3
"""One block in so many is held out."""
CLEARLY = 1.5
"""Times as much that another cut must hold out to be taken."""
CLUSTER_S = 2.0
"""Errors closer than this count as one for intervals and tests."""


@dataclass(frozen=True)
class Split:
    """``fit``, ``held`` (n,): disjoint, with gaps between; ``cluster`` (n,) numbers stretches of CLUSTER_S."""

    fit: Mask
    held: Mask
    cluster: NDArray[np.int64]


def split(problem: Problem, phase: int = 0) -> Split:
    """Blocks of 8 s (shorter in short bags), every third held out, gaps of 1 s at both sides of each change of role.

    ``phase`` 0 ... CYCLE - 1 shifts which third it is; together they hold out everything once but the first blocks.
    """
    fit, held = np.zeros(problem.valid.size, bool), np.zeros(problem.valid.size, bool)
    cluster = np.zeros(problem.valid.size, np.int64)
    first = 0
    for bag, run in enumerate(problem.runs):
        part = slice(problem.edges[bag], problem.edges[bag + 1])
        elapsed = run.time - run.time[0]
        block = min(BLOCK_S, max(2.0, elapsed[-1] / 9.0))
        gap = min(SPARED_S, 0.15 * block)
        index = (elapsed / block).astype(int)
        role = _held(index, bag + phase)
        within = elapsed - index * block
        edge = np.zeros(run.time.size, bool)
        for step in (-1, 1):
            neighbour = _held(index + step, bag + phase)
            near = within < gap if step < 0 else within > block - gap
            edge |= near & (neighbour != role)
        held[part] = role & ~edge & run.valid
        fit[part] = ~role & ~edge & run.valid
        cluster[part] = first + (elapsed / CLUSTER_S).astype(int)
        first = int(cluster[part][-1]) + 1
    return Split(fit, held, cluster)


def balanced(problem: Problem, excess: Array) -> Split:
    """The split whose two parts both see what the baseline leaves over: ``excess`` (n,) is its energy above noise.

    What happens in a few blocks only would else be held out altogether, or never judged. The first split stands unless
    another is clearly better.
    """
    candidates = [split(problem, phase) for phase in range(CYCLE)]
    seen = [
        (max(float(excess[roles.fit].sum()), 0.0), max(float(excess[roles.held].sum()), 0.0)) for roles in candidates
    ]
    worth = [min(fit, (CYCLE - 1) * held) + 0.25 * fit for fit, held in seen]
    best = int(np.argmax(worth))
    return candidates[best] if worth[best] > CLEARLY * worth[0] else candidates[0]


def _held(index: NDArray[np.int64], shift: int) -> Mask:
    """Whether blocks are held out; never the first, which alone shows the bristles that a bag starts with."""
    held: Mask = (index > 0) & ((index + shift) % CYCLE == CYCLE - 1)
    return held
