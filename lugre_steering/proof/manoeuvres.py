# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Steering manoeuvres of the proof simulator: random, smooth, within the limits of the axle."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP_S = 1.0e-3
LIMIT_RAD = float(np.deg2rad(30.1))  # mean angle: the inner track then stands at about 35, the outer at 26 deg


def ackermann(mean: Array, wheelbase_m: float, kingpin_distance_m: float) -> Array:
    """Left and right track angle (2, n) [rad] for a mean (bicycle) angle (n,): cot(left) - cot(right) = -b / L."""
    t = np.tan(mean)
    half = 0.5 * kingpin_distance_m / wheelbase_m * t
    return np.stack([np.arctan2(t, 1.0 - half), np.arctan2(t, 1.0 + half)])


def _sweep_to(targets: Array, rates: Array, holds: Array) -> Array:
    """Piecewise linear angle [rad] from 0 through ``targets`` at ``rates`` [rad/s], resting ``holds`` [s] at each."""
    travel = np.abs(np.diff(targets, prepend=0.0)) / rates
    time = np.concatenate([[0.0], np.cumsum(np.ravel(np.stack([travel, holds], axis=1)))])
    angle = np.concatenate([[0.0], np.repeat(targets, 2)])
    grid = np.arange(0.0, time[-1], STEP_S)
    return np.asarray(np.interp(grid, time, angle))


def _smooth(angle: Array, window_s: float) -> Array:
    """Three running means: continuous acceleration, as a driver and a proportional valve give it."""
    width = max(int(window_s / 3.0 / STEP_S), 1)
    kernel = np.ones(width) / width
    for _ in range(3):
        padded = np.concatenate([np.full(width // 2, angle[0]), angle, np.full(width - 1 - width // 2, angle[-1])])
        angle = np.convolve(padded, kernel, mode="valid")
    return angle


def _rates(rng: np.random.Generator, n: int) -> Array:
    return np.deg2rad(np.exp(rng.uniform(np.log(2.0), np.log(10.0), n)))


def sweeps(rng: np.random.Generator) -> Array:
    """Sweeps between random targets, both limits among them, with a hold after each."""
    n = int(rng.integers(8, 12))
    size = rng.uniform(0.25, 0.95, n)
    size[rng.permutation(n - 2)[:2] + 1] = rng.uniform(0.95, 1.0, 2)
    sign = np.where(np.arange(n) % 2 == 0, 1.0, -1.0) * rng.choice([-1.0, 1.0])
    stay = rng.random(n) < 0.2  # now and then the next target lies on the same side
    targets = LIMIT_RAD * size * np.where(stay, -sign, sign)
    if targets.max() < 0.9 * LIMIT_RAD:
        targets[n // 2] = 0.97 * LIMIT_RAD
    if targets.min() > -0.9 * LIMIT_RAD:
        targets[n // 2 + 1] = -0.97 * LIMIT_RAD
    targets[int(rng.integers(n // 2, n))] = 0.0
    return _sweep_to(targets, _rates(rng, n), rng.uniform(1.0, 8.0, n))


def chirp(rng: np.random.Generator) -> Array:
    """A sinusoid that grows quicker and then shrinks; ends in slow small motion near the middle."""
    duration = rng.uniform(80.0, 130.0)
    t = np.arange(0.0, duration, STEP_S)
    turn = 0.65 * duration
    slow, fast = rng.uniform(0.03, 0.05), rng.uniform(0.08, 0.12)
    frequency = np.where(t < turn, slow + (fast - slow) * t / turn, fast)
    size = np.where(t < turn, 0.97, 0.97 * np.exp(-(t - turn) / rng.uniform(6.0, 10.0)))
    largest = np.deg2rad(10.5) / (2.0 * np.pi * frequency)
    size = np.minimum(size * LIMIT_RAD, largest) * np.minimum(t / 8.0, 1.0)
    return np.asarray(size * np.sin(2.0 * np.pi * np.cumsum(frequency) * STEP_S))


def decaying(rng: np.random.Generator) -> Array:
    """Sweeps of falling amplitude with holds: the amplitude axis of hysteresis, from the limits down to a degree."""
    n = int(rng.integers(12, 17))
    size = 0.97 * (0.035 / 0.97) ** (np.arange(n) / (n - 1.0))
    targets = LIMIT_RAD * size * np.where(np.arange(n) % 2 == 0, 1.0, -1.0) * rng.choice([-1.0, 1.0])
    return _sweep_to(targets, _rates(rng, n), rng.uniform(1.0, 4.0, n))


def cycles(rng: np.random.Generator) -> Array:
    """Many full cycles at nearly one rate, a long pause, and more cycles: heat, wear and recovery."""
    n = 2 * int(rng.integers(5, 8))
    targets = 0.95 * LIMIT_RAD * np.where(np.arange(n) % 2 == 0, 1.0, -1.0) * rng.choice([-1.0, 1.0])
    holds = rng.uniform(0.5, 2.0, n)
    holds[2 * (n // 3)] = rng.uniform(30.0, 60.0)
    return _sweep_to(targets, np.deg2rad(rng.uniform(5.0, 9.0)) * rng.uniform(0.9, 1.1, n), holds)


def loops(rng: np.random.Generator) -> Array:
    """Sweeps with small reversals on the way, and a few shakes: presliding, play and inertia."""
    targets: list[float] = []
    for k in range(int(rng.integers(4, 6))):
        end = LIMIT_RAD * rng.uniform(0.6, 1.0) * (1.0 if k % 2 == 0 else -1.0)
        middle = end * rng.uniform(-0.2, 0.6)
        back = np.deg2rad(rng.uniform(1.0, 8.0)) * np.sign(end)
        targets += [middle, middle - back, middle, end]
    targets += [LIMIT_RAD * 0.97, -LIMIT_RAD * 0.97, 0.0]
    n = len(targets)
    angle = _sweep_to(np.array(targets), _rates(rng, n), rng.uniform(0.5, 3.0, n))
    t = np.arange(0.0, rng.uniform(12.0, 20.0), STEP_S)
    shake = np.deg2rad(rng.uniform(0.8, 1.5)) * np.sin(2.0 * np.pi * rng.uniform(0.4, 0.9) * t)
    return np.concatenate([angle, shake * np.minimum(1.0, np.minimum(t, t[-1] - t))])


KINDS: dict[str, Callable[[np.random.Generator], Array]] = {
    "sweeps": sweeps,
    "chirp": chirp,
    "decaying": decaying,
    "cycles": cycles,
    "loops": loops,
}


def mean_angle(kind: str, rng: np.random.Generator) -> Array:
    """Mean steering angle (n,) [rad] on the STEP_S grid, at rest for a few seconds before and after."""
    angle = KINDS[kind](rng)
    rest = (np.zeros(int(rng.uniform(2.0, 4.0) / STEP_S)), np.full(int(rng.uniform(2.0, 4.0) / STEP_S), angle[-1]))
    return _smooth(np.concatenate([rest[0], angle, rest[1]]), rng.uniform(0.4, 0.9))
