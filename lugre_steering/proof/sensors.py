# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Sensors of the proof simulator: sampling with jitter, noise of several kinds, quantisation, lost messages."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from lugre_steering.proof.vehicle_draw import Sheet

Array = NDArray[np.float64]
NoiseKind = Literal["white", "coloured", "ripple"]

PERIOD_S = 0.01
PRESSURE_BITS = 15


class Samples(NamedTuple):
    """What one sensor recorded: stamps (m,) [s], strictly increasing, and values (m,) [rad or Pa]."""

    time: Array
    value: Array


class Habits(NamedTuple):
    """How the data logger of one case behaves: jitter [s], share of messages lost."""

    jitter_s: float
    lost_share: float


def draw_habits(rng: np.random.Generator) -> Habits:
    """Half of the loggers lose a few messages in a thousand; all of them jitter by some tenth of a millisecond."""
    return Habits(rng.uniform(0.0, 4e-4), rng.uniform(0.001, 0.004) if rng.random() < 0.5 else 0.0)


def sampling(duration_s: float, habits: Habits, rng: np.random.Generator) -> tuple[Array, Array]:
    """Instants at which a sensor samples (m,) [s] and the stamps (m,) [s] its messages carry."""
    grid = np.arange(0.0, duration_s - PERIOD_S, PERIOD_S)
    jitter = np.clip(rng.normal(0.0, habits.jitter_s, grid.size), -2e-3, 2e-3)
    instants = grid + rng.uniform(0.0, 0.1 * PERIOD_S) + jitter
    kept = rng.random(grid.size) >= habits.lost_share
    instants = np.maximum(instants[kept], 0.0)
    return instants, instants + rng.uniform(0.0, 5e-5, instants.size)


def sense_angle(sheet: Sheet, time: Array, angle: Array, habits: Habits, rng: np.random.Generator) -> Samples:
    """Encoder: white noise, then steps of its resolution."""
    instants, stamps = sampling(float(time[-1]), habits, rng)
    value = np.interp(instants, time, angle) + rng.normal(0.0, sheet.angle_noise_rad, instants.size)
    return Samples(stamps, np.round(value / sheet.angle_resolution_rad) * sheet.angle_resolution_rad)


def sense_pressures(
    sheet: Sheet, time: Array, pressures: Array, noise: NoiseKind, habits: Habits, rng: np.random.Generator
) -> list[Samples]:
    """All line sensors: white noise always; a coloured disturbance or an aliased pump ripple on top; quantised."""
    ripple = _ripple(time, rng) if noise == "ripple" else None
    colour_s, colour_Pa = rng.uniform(0.1, 0.6), rng.uniform(8e3, 1.5e4)
    quantum = sheet.pressure_range_Pa / 2**PRESSURE_BITS
    out = []
    for line in pressures:
        instants, stamps = sampling(float(time[-1]), habits, rng)
        value = np.interp(instants, time, line)
        value = value + rng.normal(0.0, sheet.pressure_noise_Pa, instants.size)
        if noise == "coloured":
            value = value + colour_Pa * _ar1(instants.size, colour_s, rng)
        if ripple is not None:
            value = value + np.interp(instants, time, ripple * (0.2 + line / 1e7))
        out.append(Samples(stamps, np.round(value / quantum) * quantum))
    return out


def _ar1(n: int, tau_s: float, rng: np.random.Generator) -> Array:
    """Unit-variance first-order autoregression with correlation time ``tau_s`` at the sampling period."""
    keep = np.exp(-PERIOD_S / tau_s)
    return np.asarray(lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(size=n), zi=[keep * rng.normal()])[0])


def _ripple(time: Array, rng: np.random.Generator) -> Array:
    """Pump ripple as sampling folds it: a few hertz, phase wandering with engine speed; (n,) [Pa] at 10 MPa of load."""
    step = float(time[1] - time[0])
    wander = np.cumsum(rng.normal(0.0, 0.3 * np.sqrt(step), time.size))
    return np.asarray(rng.uniform(1.5e4, 4e4) * np.sin(2.0 * np.pi * rng.uniform(3.0, 15.0) * time + wander))
