# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A patch of other ground, or ground that changes."""

from __future__ import annotations

import itertools

import numpy as np

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter, Seen, Variant

EDGE_RAD = 0.01
EDGE_S = 0.2
WINDOW_EDGES = 9


@law
def inside(x, low, high, edge):
    """1 inside [low, high], 0 outside, linear over ``edge`` at each end."""
    return max(0.0, min(1.0, min((x - low) / edge + 0.5, (high - x) / edge + 0.5)))


@law
def level(theta, time, change, angle_low, angle_high, time_start, time_end):
    """1 + change inside the angle window and the time window; a window that is not given is everywhere."""
    here = 1.0
    if angle_high > angle_low:
        here *= inside(theta, angle_low, angle_high, EDGE_RAD)
    if time_end > time_start:
        here *= inside(time, time_start, time_end, EDGE_S)
    return 1.0 + change * here


def windows(seen: Seen) -> list[Variant]:
    """Angle windows and time windows over what was visited, each from one edge to another.

    A window up to an end of what was visited is what lies outside it, with the other sign: of the two, the smaller one of angle and the
    later one of time are told.
    """
    angles = np.linspace(seen.lowest - 0.01, seen.highest + 0.01, WINDOW_EDGES)
    times = np.linspace(-1.0, seen.longest + 1.0, WINDOW_EDGES)
    last = WINDOW_EDGES - 1
    pairs = [(i, j) for i, j in itertools.combinations(range(WINDOW_EDGES), 2) if j - i < last]
    return [
        *({"angle_low": float(angles[i]), "angle_high": float(angles[j])} for i, j in pairs if (i > 0 and j < last) or 2 * (j - i) <= last),
        *({"time_start": float(times[i]), "time_end": float(times[j])} for i, j in pairs if i > 0),
    ]


EFFECT = Effect(
    id="surface_patch",
    stage="contact",
    tier=1,
    title="A patch of other ground, or ground that changes",
    equation="Ms, Mc times (1 + change) inside an angle window or a time window; sigma_0 kept",
    source="friction of pavements: Wong, Theory of Ground Vehicles",
    trace="plateau steps at fixed angles (or from a time on), presliding slope kept",
    coordinate="steering angle",
    parameters=(
        Parameter("change", "1", "relative change of the friction level", 0.05, -0.9, 2.0),
        Parameter("angle_low", "rad", "start of the angle window of each track", 0.05, -1.2, 1.2, example=0.0, place=True),
        Parameter("angle_high", "rad", "end of the angle window", 0.05, -1.2, 1.2, example=0.2, place=True),
        Parameter("time_start", "s", "start of the time window", 2.0, -10.0, 1e5, example=5.0),
        Parameter("time_end", "s", "end of the time window", 2.0, -10.0, 1e5, example=30.0),
    ),
    hooks={"level": level},
    rivals=("wear_polishing",),
    places=(("angle_low", "angle_high"), ("time_start", "time_end")),
    never_late=True,
    variants=windows,
    joint_title="Friction differs within a range or from a time on",
    one_sided=True,
)
