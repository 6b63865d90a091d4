# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Contact strengthens while it rests."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import exp, law
from lugre_steering.effects.entry import Effect, Parameter

SMALL = 0.03
"""Slip below which a series is as good as (1 - exp(-slip)) / slip: that of nearly all steps, which wait for neither of both then."""


@law
def ageing(d_theta, dt, z, stiffness, coulomb_torque, friction_ratio, rate, dwell, slip_scale, age):
    """Extra level as a share of Coulomb friction: rate ln(1 + age / t_c), d age/dt = 1 - age |dtheta/dt| / D.

    Ageing law of resting and sliding contacts (Dieterich 1972; Rice and Ruina 1983), exact for a constant rate in a step.
    Only sliding renews a contact, the share |z| / length of the motion; bristles that merely bend keep theirs.
    """
    slip = abs(d_theta) * (1.0 / slip_scale) * min(1.0, abs(z) * (stiffness / (coulomb_torque * friction_ratio)))
    if slip < SMALL:
        square = slip * slip
        renewed = (1.0 - slip * 0.5) + square * (
            (1.0 / 6.0 - slip * (1.0 / 24.0)) + square * ((1.0 / 120.0 - slip * (1.0 / 720.0)) + square * (1.0 / 5040.0))
        )
        age += renewed * (dt - slip * age)
    else:
        sliding = dt / slip
        age = sliding + (age - sliding) * exp(-slip)
    return rate * math.log(1.0 + age * (1.0 / dwell)), age  # log1p would cost a third of a step more


EFFECT = Effect(
    id="static_ageing",
    stage="contact",
    tier=1,
    title="Contact strengthens while it rests",
    equation="g += Mc rate ln(1 + age / t_c), d age/dt = 1 - age |dtheta/dt| / slip_scale",
    source="Dieterich, J. Geophys. Res. 77 (1972) 3690; Rice and Ruina, J. Appl. Mech. 50 (1983) 343",
    trace="torque peak after a restart that grows with the logarithm of the dwell before it",
    coordinate="dwell",
    parameters=(
        Parameter("rate", "1", "relative gain per e-fold of age", 0.01, 0.0, 0.3),
        Parameter("dwell", "s", "time constant t_c of the ageing", 1.0, 0.01, 100.0, (0.1, 1.0)),
        Parameter("slip_scale", "rad", "slip that renews the contacts", 0.1, 0.005, 2.0, (0.02, 0.06, 0.2)),
    ),
    joint_title="Static friction grows with the time at rest",
    hooks={"ageing": ageing},
    rivals=("stress_relaxation",),
    memory={"age": 0.0},  # mean age of the contacts [s]
    counts_from_start=True,
)
