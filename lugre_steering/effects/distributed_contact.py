# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The contact saturates patch after patch."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import exp, law
from lugre_steering.effects.entry import Effect, Parameter

ELEMENTS = 6
NORMAL_QUANTILES = (-1.38299413, -0.67448975, -0.21042839, 0.21042839, 0.67448975, 1.38299413)


@law
def contact(z, drawn, stiffness, g, spread, elements, shares):
    """Parallel elements of log-normally graded stiffness, each carrying an equal share of g (Maxwell slip; Iwan 1966).

    Returns elastic torque [N m], its mean deflection [rad] and what sliding dissipates [J]. At first the elements are as
    deflected as the one bristle.
    """
    if shares[0] == 0.0:
        total = 0.0
        for i in range(ELEMENTS):
            elements[i] = z
            shares[i] = exp(spread * NORMAL_QUANTILES[i])
            total += shares[i]
        for i in range(ELEMENTS):
            shares[i] /= total
    way = abs(drawn) * ELEMENTS * stiffness / g
    softest = math.copysign(g / ELEMENTS / stiffness, drawn)
    before, stored = 0.0, 0.0
    for i in range(ELEMENTS):
        before += elements[i]
        stored -= shares[i] * elements[i] * elements[i]
    for i in range(ELEMENTS):
        steady = softest * (1.0 / shares[i])
        elements[i] = steady + (elements[i] - steady) * exp(-way * shares[i])
    after, mean = 0.0, 0.0
    for i in range(ELEMENTS):
        after += elements[i]
        mean += shares[i] * elements[i]
        stored += shares[i] * elements[i] * elements[i]
    work = g * (abs(drawn) + math.copysign(1.0 / ELEMENTS, drawn) * (before - after))
    return stiffness * mean, mean, work - 0.5 * stiffness * stored


EFFECT = Effect(
    id="distributed_contact",
    stage="contact",
    tier=1,
    title="The contact saturates patch after patch",
    equation="parallel bristles of log-normally graded stiffness, equal shares of g",
    source="Iwan, J. Appl. Mech. 33 (1966) 893; generalised Maxwell slip: Al-Bender et al., IEEE TAC 50 (2005) 1883",
    trace="presliding curve sharper at first and rounder later; minor loops",
    coordinate="angle since reversal",
    parameters=(
        Parameter("spread", "1", "standard deviation of the logarithm of the stiffness", 0.4, 0.0, 2.0),
    ),
    joint_title="Parts of the contact slip one after another",
    hooks={"contact": contact},
    rivals=("linkage_compliance", "payne_softening"),
    memory={"elements": (0.0,) * ELEMENTS, "shares": (0.0,) * ELEMENTS},  # deflections [rad], shares of the stiffness
)
