# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Noise with a memory: what the sensors and the motion estimate can put into a residual without any missing physics.

Two sources, both measured on the recording itself: the torque noise of standstill stretches (white sensor noise, pump ripple,
slow wander, as an autoregressive process), and the error that angle noise causes through smoother and chain (by repeating
both with fresh angle noise).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from lugre_steering.chain.step import REST_RATE_RAD_S
from lugre_steering.diagnosis.dataset import Run, angle_noise, motion
from lugre_steering.diagnosis.problem import Candidate, Problem, Values, in_threads
from lugre_steering.diagnosis.smoother import smooth_angle
from lugre_steering.recording import Array

AR_ORDER_S = 0.3
MIN_QUIET_S = 3.0
MOTION_PROFILE_S = 0.5


@dataclass(frozen=True)
class QuietNoise:
    """Torque noise seen at standstill: level relative to the sheet, and AR coefficients of the standardised noise."""

    level: float
    coefficients: Array
    innovation: float

    def draw(self, size: int, rng: np.random.Generator) -> Array:
        """Standardised noise (size,) with unit variance times ``level``."""
        warm = 200
        white = rng.standard_normal(size + warm) * self.innovation
        coloured: Array = lfilter([1.0], np.concatenate([[1.0], -self.coefficients]), white)[warm:]
        return coloured * self.level


def standstill(run: Run, minimum_s: float = 1.0) -> list[slice]:
    """Stretches in which no side moves, at least ``minimum_s`` long, without the first 0.3 s."""
    dt = run.time[1] - run.time[0]
    still = (np.abs(run.omega).max(axis=0) < REST_RATE_RAD_S) & run.valid
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    skip = round(0.3 / dt)
    return [
        slice(a + skip, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if (b - a - skip) * dt >= minimum_s
    ]


def quiet_noise(runs: Sequence[Run]) -> QuietNoise:
    """Level and memory of the standardised torque noise from all standstill stretches (sheet values if they are too short).

    Each stretch is freed of offset and drift first, which real holds may show.
    """
    pieces = []
    for run in runs:
        for part in standstill(run):
            t = run.time[part] - run.time[part][0]
            trend = np.column_stack([np.ones_like(t), t])
            y = run.measured[part] / run.sigma[part]
            pieces.append(y - trend @ np.linalg.lstsq(trend, y, rcond=None)[0])
    dt = runs[0].time[1] - runs[0].time[0]
    order = max(2, round(AR_ORDER_S / dt))
    samples = sum(piece.size for piece in pieces)
    if samples * dt < MIN_QUIET_S or samples < 8 * order:
        return QuietNoise(1.0, np.zeros(1), 1.0)
    covariance = np.zeros(order + 1)
    for lag in range(order + 1):
        covariance[lag] = sum(float(p[: p.size - lag] @ p[lag:]) for p in pieces if p.size > lag)
    covariance /= samples
    # Taper: beyond the noise of its own estimate a lag says nothing.
    significance = covariance / covariance[0]
    significance[1:] = np.where(np.abs(significance[1:]) > 3.0 / np.sqrt(samples), significance[1:], 0.0)
    significance *= 1.0 - np.arange(order + 1) / (order + 1)
    coefficients = solve_toeplitz(significance[:-1], significance[1:])
    innovation = float(np.sqrt(max(1.0 - coefficients @ significance[1:], 0.02)))
    return QuietNoise(float(np.sqrt(covariance[0])), coefficients, innovation)


@dataclass(frozen=True)
class Noise:
    """Standard deviation of the residual that nothing hidden would leave (n,), and draws of such residuals (draws, n)."""

    sigma: Array
    draws: Array

    @property
    def floor(self) -> float:
        """One number: root mean square of sigma [N m]."""
        return float(np.sqrt(np.mean(self.sigma**2)))


def noise_model(
    problem: Problem, x: Array, effects: Sequence[tuple[Candidate, Values]], *, draws: int, seed: int
) -> Noise:
    """Noise of the residual at a fitted model, from ``draws`` repetitions."""
    quiet = quiet_noise(problem.runs)
    sheet = angle_noise(problem.vehicle)

    def repeat(bag: int) -> tuple[Array, Array]:
        rng = np.random.default_rng([seed, bag])
        run = problem.runs[bag]
        base = problem.predict(bag, x, effects)
        errors = np.empty((draws, run.time.size))
        for i in range(draws):
            # One sensor for both tracks makes one error.
            sensors = 1 if problem.vehicle.sensors.angle_from else len(run.theta)
            noisy = run.theta + sheet * rng.standard_normal((sensors, run.time.size))
            theta = np.array([smooth_angle(row, sheet) for row in noisy])
            omega, alpha = motion(run.time, theta)
            errors[i] = problem.predict(bag, x, effects, replace(run, theta=theta, omega=omega, alpha=alpha)) - base
        dt = run.time[1] - run.time[0]
        variance = uniform_filter1d(np.mean(errors**2, axis=0), max(1, round(MOTION_PROFILE_S / dt)))
        torque_noise = np.array([quiet.draw(run.time.size, rng) for _ in range(draws)]) * run.sigma
        sigma: Array = np.sqrt((quiet.level * run.sigma) ** 2 + variance)
        return sigma, torque_noise - errors

    parts = in_threads(repeat, range(len(problem.runs)))
    return Noise(np.concatenate([sigma for sigma, _ in parts]), np.concatenate([draw for _, draw in parts], axis=1))
