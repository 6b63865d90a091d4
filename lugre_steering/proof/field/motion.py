# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Strokes of the third simulator: minimum-jerk moves between random places, holds, small reversals and shakes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP_S = 2e-3
DEG = float(np.pi / 180.0)


def strokes(targets: Array, rates: Array, holds: Array) -> Array:
    """Angle on the STEP_S grid from 0 through the targets: each move starts and stops smoothly and then rests.

    A move is a constant rate with minimum-jerk starts and stops of 0.5 s where it is long enough for them.
    """
    parts, at = [np.zeros(round(2.0 / STEP_S))], 0.0
    for target, rate, hold in zip(targets, rates, holds, strict=True):
        span, ramp = abs(target - at), min(0.5, 0.9 * abs(target - at) / rate)
        duration = span / rate + ramp
        t = np.arange(0.0, duration, STEP_S)
        profile = np.minimum(_risen(t / ramp), _risen((duration - t) / ramp))
        travelled = np.cumsum(profile)
        parts += [at + (target - at) * travelled / travelled[-1], np.full(round(hold / STEP_S), target)]
        at = target
    return np.concatenate(parts)


def _risen(x: Array) -> Array:
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x**2))


def draw_mean(limit: float, duration_s: float, rng: np.random.Generator) -> Array:
    """Mean angle of one recording of about ``duration_s``: three of four moves are wide, the others small reversals."""
    targets: list[float] = []
    rates: list[float] = []
    holds: list[float] = []
    style, pause = rng.uniform(0.2, 1.0), rng.uniform(0.3, 6.0)
    pace = np.exp(rng.uniform(np.log(2.5), np.log(7.0))) * DEG
    at, spent, side = 0.0, 2.0, rng.choice([-1.0, 1.0])
    while spent < duration_s:
        small = rng.random() < 0.25 * style
        target = at - side * rng.uniform(1.0, 6.0) * DEG if small else side * limit * rng.uniform(0.3, 1.0) ** 0.5
        target = float(np.clip(target, -limit, limit))
        if abs(target - at) < 0.5 * DEG:
            side = -side
            continue
        rate = float(np.clip(pace * np.exp(rng.normal(0.0, 0.5)), 0.7 * DEG, 11.0 * DEG))
        hold = float(rng.exponential(pause)) if rng.random() < 0.7 else 0.1
        hold = min(hold + (rng.uniform(10.0, 30.0) if rng.random() < 0.05 else 0.0), 0.3 * duration_s)
        spent += abs(target - at) / rate + 0.5 + hold
        targets.append(target)
        rates.append(rate)
        holds.append(hold)
        at, side = target, side if small else -side
    return strokes(np.array(targets), np.array(rates), np.array(holds))


def hurried(mean: Array, faster: float, further: float) -> Array:
    """The same motion, quicker and wider: what a law must foretell though nobody recorded it."""
    grid = np.arange(0.0, mean.size - 1.0, faster)
    return np.asarray(further * np.interp(grid, np.arange(mean.size), mean))
