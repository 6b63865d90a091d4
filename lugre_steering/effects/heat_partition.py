# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Part of the friction heat enters the ground."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def heat_in(ground_share):
    """1 - ground_share of the friction heat enters the rubber."""
    return 1.0 - ground_share


EFFECT = Effect(
    id="heat_partition",
    stage="thermal",
    tier=1,
    title="Part of the friction heat enters the ground",
    equation="power into the rubber = (1 - ground_share) P",
    source="Carslaw and Jaeger 1959 (effusivities); Liang et al. 2022 assume zero",
    trace="slope of the decline per work; exactly that of a larger heat capacity with larger cooling",
    coordinate="accumulated work",
    parameters=(
        Parameter("ground_share", "1", "share of the friction power that the ground takes", 0.2, 0.0, 0.95),
    ),
    hooks={"heat_in": heat_in},
    needs=("rubber",),
    counts_from_start=True,
)
