# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Vehicles, manoeuvres and encoders shared by the tests of the chain. All data are synthetic."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from lugre_steering.chain.step import Records, new_state, run_side
from lugre_steering.recording import Array
from lugre_steering.vehicle import Vehicle, load
from lugre_steering.vehicle.model import Model, build_model

VEHICLE_FILE = Path(__file__).resolve().parents[2] / "config" / "test_vehicle.yaml"


@cache
def vehicle() -> Vehicle:
    return load(VEHICLE_FILE)


@cache
def model() -> Model:
    return build_model(vehicle())


def baseline() -> tuple[Records, Array]:
    """Parameter record and rubber table of one track of the test vehicle."""
    return model().parameters[0].copy(), model().rubber.copy()


def frozen() -> tuple[Records, Array]:
    """The same with a temperature that never changes."""
    parameters, rubber = baseline()
    parameters["heat_capacity"] = np.inf
    return parameters, rubber


def swing(
    duration: float, dt: float, amplitude: float = 0.45, period: float = 12.0
) -> tuple[Array, Array, Array, Array]:
    """Smooth manoeuvre: time, angle, rate, acceleration (n,) of amplitude (1 - cos) / 2 style starts at rest."""
    time = np.arange(round(duration / dt) + 1) * dt
    w = 2.0 * np.pi / period
    return (
        time,
        amplitude * np.sin(w * time) ** 2 * np.sin(0.37 * w * time),
        amplitude
        * w
        * (np.sin(2 * w * time) * np.sin(0.37 * w * time) + 0.37 * np.sin(w * time) ** 2 * np.cos(0.37 * w * time)),
        np.zeros_like(time),
    )


def double_cycle(
    rate_Hz: float, speed_deg_s: float = 6.0, limit_deg: float = 26.0, hold_s: float = 2.0
) -> tuple[Array, Array]:
    """Double steering cycle 0, +limit, -limit, +limit, -limit, 0 with holds: time [s], angle [rad]."""
    fine = 1e-3
    rate = [np.zeros(2000)]
    angle = 0.0
    for target in (limit_deg, -limit_deg, limit_deg, -limit_deg, 0.0):
        steps = round(abs(target - angle) / speed_deg_s / fine)
        rate += [np.full(steps, np.sign(target - angle) * speed_deg_s), np.zeros(round(hold_s / fine))]
        angle = target
    ramped = np.convolve(np.concatenate(rate), np.full(300, 1 / 300))
    theta = np.radians(np.cumsum(ramped) * fine)
    time = np.arange(theta.size) * fine
    grid = np.arange(0.0, time[-1], 1.0 / rate_Hz)
    return grid, np.interp(grid, time, theta)


def encoder(theta: Array, seed: int, noise_deg: float = 0.01, resolution_deg: float = 0.0055) -> Array:
    """What a noisy, quantised encoder shows of an angle [rad]."""
    noisy = np.degrees(theta) + noise_deg * np.random.default_rng(seed).standard_normal(theta.shape)
    return np.radians(np.round(noisy / resolution_deg) * resolution_deg)


def final_state(parameters: Records, rubber: Array, *motion: Array) -> Records:
    """State after a run."""
    state = new_state(parameters)
    run_side(parameters, rubber, *motion, state)
    return state
