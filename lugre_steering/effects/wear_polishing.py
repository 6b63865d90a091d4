# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The contact polishes with slip."""

from __future__ import annotations

from lugre_steering.chain.compiled import exp, law
from lugre_steering.effects.entry import Effect, Parameter


@law
def level(d_theta, amount, slip_scale, slip):
    """1 - amount (1 - exp(-slip / slip_scale))."""
    return 1.0 - amount * (1.0 - exp(-slip / slip_scale)), slip + abs(d_theta)


EFFECT = Effect(
    id="wear_polishing",
    stage="contact",
    tier=1,
    title="The contact polishes with slip",
    equation="Ms, Mc times 1 - amount (1 - exp(-slip / slip_scale))",
    source="Grosch, Rubber Chem. Technol. 69 (1996) 495; transfer films: Tiwari et al. 2021",
    trace="friction falls with accumulated slip and does not recover in pauses",
    coordinate="accumulated slip",
    parameters=(
        Parameter("amount", "1", "relative loss in the end", 0.05, -0.5, 0.8),
        Parameter("slip_scale", "rad", "slip at which 63 % is reached", 1.0, 0.05, 100.0, (0.1, 0.3, 1.0), "slip"),
    ),
    joint_title="Friction changes with the distance run",
    hooks={"level": level},
    memory={"slip": 0.0},  # accumulated |contact angle| [rad]
    counts_from_start=True,
)
