# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Filled rubber is stiffer for small strains."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def tangent(d_theta, sign, direction, amplitude, angle, since_reversal):
    """a / (1 + (angle since reversal / angle)**2): stiffer for small amplitudes (Payne 1962, Kraus 1984)."""
    if sign != 0.0 and sign != direction:
        since_reversal = 0.0
    strain = (since_reversal + 0.5 * abs(d_theta)) / angle
    return amplitude / (1.0 + strain * strain), since_reversal + abs(d_theta)


EFFECT = Effect(
    id="payne_softening",
    stage="contact",
    tier=2,
    title="Filled rubber is stiffer for small strains",
    equation="dz/dtheta times 1 + a / (1 + (angle since reversal / angle)^2)",
    source="Payne, J. Appl. Polym. Sci. 6 (1962) 57; Kraus, J. Appl. Polym. Sci. Symp. 39 (1984) 75",
    trace="small reversals and minor loops stiffer than the slow load test",
    coordinate="angle since reversal",
    parameters=(
        Parameter("amplitude", "1", "relative stiffening at zero strain", 0.3, 0.0, 5.0),
        Parameter("angle", "rad", "angle since reversal at which half of it is lost", 0.02, 0.002, 0.3, (0.01, 0.03)),
    ),
    hooks={"tangent": tangent},
    memory={"since_reversal": 0.0},  # contact angle since the last reversal [rad]
)
