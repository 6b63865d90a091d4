# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How large each effect is made: a wanted effect-to-noise ratio after recalibration, found by simulation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lugre_steering.proof.campaign import Hiding
from lugre_steering.proof.made import Made, Wanted, pooled_noise, recalibrated
from lugre_steering.proof.worlds import Maker, maker

STRONGEST = 4.0
"""Times its typical size that an effect may be enlarged to reach the wanted ratio; beyond, it would not be the same physics.

What recalibration masks nearly wholly then stays below the wanted ratio and is counted where it arrives."""


def make(hiding: Hiding, sheet_file: Path) -> tuple[Made, Sequence[Wanted]]:
    """Simulate a case with each effect at the strength that gives it the wanted ratio; the case and the strengths."""
    making = maker(hiding, sheet_file)
    effects = [_sized(wanted, hiding, making) for wanted in _wanted(hiding)]
    return making(effects), effects


def _wanted(hiding: Hiding) -> list[Wanted]:
    rng = np.random.default_rng((hiding.seed, 99))
    bag, start = int(rng.integers(2)), float(rng.uniform(35.0, 55.0))
    return [
        Wanted(
            effect,
            only_bag=bag if hiding.disguise == "one-bag" else None,
            from_time_s=start if hiding.disguise == "late" else None,
            barely=hiding.disguise == "barely",
        )
        for effect in hiding.effects
    ]


def _sized(wanted: Wanted, hiding: Hiding, making: Maker) -> Wanted:
    """Secant steps in the logarithms, from "amplitude goes with the root of the variance": nature is not linear in strength."""
    strength, power, tried = 1.0, 2.0, list[tuple[float, float]]()
    for _ in range(6):
        sized = wanted._replace(strength=strength)
        made = making([sized])
        off = float(np.log(max(recalibrated(made) / pooled_noise(made), 1e-12) / hiding.ratio))
        if abs(off) < np.log(1.25) or (off < 0.0 and strength == STRONGEST):
            break
        tried.append((np.log(strength), off))
        if len(tried) > 1 and tried[-1][0] != tried[-2][0]:
            power = float(np.clip((tried[-1][1] - tried[-2][1]) / (tried[-1][0] - tried[-2][0]), 1.0, 6.0))
        strength = min(strength * float(np.exp(-off / power)), STRONGEST)
    return sized
