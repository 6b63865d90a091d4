# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Elastic end stop of the steering."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter, Seen, Variant

BEGINS = (0.55, 0.65, 0.75, 0.82, 0.88, 0.94)
"""Where a stop may begin, as shares of the largest angle."""
TRAVEL_RAD = 0.002
"""Travel over which it changes between its loading and unloading branch."""


@law
def torque(theta, turned, omega, stiffness, engage_angle, cubic_stiffness, loss, damping, shift, loading, angle_unit):
    """sgn(theta) (k1 x + k3 x**3 + c x') [N m], x = |theta| - engage_angle > 0; less by ``loss`` on unloading.

    The damping c acts while the stop is driven in (x' > 0). ``shift`` moves the knee of negative angles only.
    Compare the translational hard stop of multibody libraries; hysteresis as a share of the loading branch (rubber
    buffers: 0.15 ... 0.4).
    """
    x = abs(theta) - (engage_angle + (shift if theta < 0.0 else 0.0))
    if x <= 0.0:
        return 0.0, 1.0
    travel = turned if theta > 0.0 else -turned
    loading = max(0.0, min(1.0, loading + travel / (TRAVEL_RAD * angle_unit)))
    push = stiffness * x + cubic_stiffness * x * x * x
    push *= 1.0 - loss * (1.0 - loading)
    push += damping * max(0.0, math.copysign(omega, omega * theta))
    return math.copysign(push, theta), loading


def knees(seen: Seen) -> list[Variant]:
    """Stops on both sides, and on one alone: the other one's knee is then as far as was ever visited."""
    largest = max(abs(seen.lowest), abs(seen.highest))
    places = [share * largest for share in BEGINS]
    return [
        *({"engage_angle": place} for place in places),
        *({"engage_angle": place, "shift": -seen.lowest - place} for place in places if place < min(-seen.lowest, seen.highest)),
        *({"engage_angle": seen.highest, "shift": place - seen.highest} for place in places if place < min(-seen.lowest, seen.highest)),
    ]


EFFECT = Effect(
    id="end_stop",
    stage="parallel_torque",
    tier=1,
    title="Elastic end stop of the steering",
    equation="M = sgn(theta) (k1 x + k3 x^3 + c x'), x = |theta| - engage_angle > 0; unloading branch lower by loss",
    source=(
        "limit device named by Liang et al. 2022; Hunt and Crossley, J. Appl. Mech. 42 (1975) 440 for contact"
        " with loss"
    ),
    trace="torque beyond a knee in the angle, holds included",
    coordinate="steering angle",
    parameters=(
        Parameter("stiffness", "N m/rad", "stiffness k1 of one track where the stop begins", 5e4, 0.0, 1e7),
        Parameter(
            "engage_angle", "rad", "track angle at which the stop begins", 0.02, 0.02, 1.5,
            BEGINS, "max_angle", example=0.3, place=True,
        ),
        Parameter("cubic_stiffness", "N m/rad^3", "how it stiffens, k3, of one track", 1e7, 0.0, 1e10, optional=True),
        Parameter("loss", "1", "share of the torque lost on unloading", 0.2, 0.0, 0.95, optional=True),
        Parameter("damping", "N m s/rad", "damping while the stop is driven in", 1e4, 0.0, 1e6, optional=True),
        Parameter("shift", "rad", "later engagement of negative angles", 0.01, -0.3, 0.3, optional=True, place=True),
    ),
    hooks={"torque": torque},
    acts_by=("stiffness", "cubic_stiffness", "damping"),
    rivals=("moment_arm_error", "relief_saturation", "soil_shear"),
    variants=knees,
    memory={"loading": 1.0},  # 1 loading ... 0 unloading
    joint_title="Elastic end stop",
    one_sided=True,
)
