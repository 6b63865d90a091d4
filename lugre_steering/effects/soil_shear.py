# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Berms of soft ground pushed outward."""

from __future__ import annotations

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def berm(theta, torque, span, growth, left, right):
    """torque (1 + growth b) (1 - (b - x) / span) within ``span`` of the farthest push b, full at fresh ground (Wong).

    Pushed outward when the track goes farther than before on that side; slack between the berms.
    """
    left, right = max(left, theta), max(right, -theta)
    on_left = max(0.0, 1.0 - (left - theta) / span) * (1.0 + growth * left)
    on_right = max(0.0, 1.0 - (right + theta) / span) * (1.0 + growth * right)
    push = torque * (on_left * min(1.0, left / span) - on_right * min(1.0, right / span))
    return push, left, right


EFFECT = Effect(
    id="soil_shear",
    stage="parallel_torque",
    tier=1,
    title="Berms of soft ground pushed outward",
    equation="M = torque (1 + growth b) (1 - (b - |theta|) / span) near the farthest push b, slack between",
    source="Wong, Theory of Ground Vehicles, ch. 2 (bulldozing)",
    trace="rises only into fresh ground",
    coordinate="steering angle",
    parameters=(
        Parameter("torque", "N m", "torque of one track at fresh ground", 1000.0, 0.0, 1e5),
        Parameter("span", "rad", "way over which the berm is compressed", 0.05, 0.005, 0.5, (0.03, 0.1, 0.25)),
        Parameter("growth", "1/rad", "growth of the berm with its distance", 1.0, 0.0, 20.0, optional=True),
    ),
    hooks={"torque": berm},
    memory={"left": 0.0, "right": 0.0},  # farthest push to either side [rad]
    counts_from_start=True,
)
