# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Held rubber relaxes with the logarithm of time."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import exp, law
from lugre_steering.effects.entry import Effect, Parameter


@law
def elastic(d_theta, dwell, resting, per_decade, onset, recovery_angle, relaxed):
    """1 - lost share, R log10(1 + hold / t_0) while held, recovered over an angle (Gent 1962)."""
    if resting:
        relaxed = max(relaxed, per_decade * math.log10(1.0 + dwell / onset))
    else:
        relaxed *= exp(-abs(d_theta) / recovery_angle)
    return 1.0 - min(relaxed, 0.9), relaxed


EFFECT = Effect(
    id="stress_relaxation",
    stage="contact",
    tier=1,
    title="Held rubber relaxes with the logarithm of time",
    equation="M = sigma_0 z (1 - per_decade log10(1 + hold / onset)), recovered over recovery_angle",
    source="Gent, J. Appl. Polym. Sci. 6 (1962) 433",
    trace="torque decays while the angle is held and comes back after the restart",
    coordinate="dwell",
    parameters=(
        Parameter("per_decade", "1", "share of the elastic torque lost per decade of time", 0.03, 0.0, 0.4),
        Parameter("onset", "s", "time at which the decay begins", 0.3, 0.02, 20.0, (0.1, 1.0)),
        Parameter("recovery_angle", "rad", "motion that brings the torque back", 0.02, 0.001, 0.5, (0.015, 0.08)),
    ),
    hooks={"elastic": elastic},
    rivals=("trapped_pressure",),
    memory={"relaxed": 0.0},  # lost share of the elastic torque
)
