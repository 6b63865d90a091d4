# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The causal motion estimate survives encoder noise; numbers of the trap that it has to avoid."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from chain_support import baseline, double_cycle, encoder, vehicle

from lugre_steering.chain.step import run_side, torque_side
from lugre_steering.estimator import Estimator, Options
from lugre_steering.recording import Array
from lugre_steering.vehicle import TorqueSensor

EPOCH_NS = 1_790_000_000_000_000_000


def estimated_torque(time: Array, measured: Array, resolution_deg: float = 0.0055) -> Array:
    """Total torque of the estimator for angles (n, 2)."""
    v = vehicle()
    v = v.replace(sensors=dataclasses.replace(v.sensors, angle_resolution_deg=resolution_deg))
    n = time.size
    stamps = EPOCH_NS + np.round(time * 1e9).astype(np.int64)
    estimates, _ = Estimator(v, Options(max_rate_rad_s=50.0)).push_block(
        np.tile([0, 1], n), np.repeat(stamps, 2), measured.ravel(), np.full(2 * n, np.nan)
    )
    assert estimates.size == n
    return np.array(estimates["total"])


def true_torque(time: Array, theta: Array) -> Array:
    """Total torque for clean angles (n, 2) with their true rate."""
    p, rubber = baseline()
    still = np.zeros(time.size)
    return sum(
        torque_side(p, rubber, time, np.ascontiguousarray(side), np.gradient(side, time), still) for side in theta.T
    )


def both(theta: Array) -> Array:
    return np.column_stack([theta, 0.95 * theta])


@pytest.mark.parametrize("rate_Hz", [50.0, 100.0, 500.0])
@pytest.mark.parametrize("speed_deg_s", [2.0, 6.0, 10.0])
def test_double_cycle_torque_error_below_half_a_percent(rate_Hz: float, speed_deg_s: float) -> None:
    time, theta = double_cycle(rate_Hz, speed_deg_s)
    truth = true_torque(time, both(theta))
    for seed in range(3):
        error = estimated_torque(time, encoder(both(theta), seed)) - truth
        assert np.sqrt(np.mean(error**2)) < 0.005 * np.abs(truth).max()


def test_raw_noisy_angles_destroy_the_torque() -> None:
    time, theta = double_cycle(100.0)
    measured = encoder(both(theta), 1)
    error = true_torque(time, measured) - true_torque(time, both(theta))
    assert np.sqrt(np.mean(error**2)) > 5000.0


@pytest.mark.parametrize("rate_Hz", [50.0, 100.0, 500.0])
@pytest.mark.parametrize("seed", range(3))
def test_parked_vehicle_holds_its_torque_for_three_minutes(rate_Hz: float, seed: int) -> None:
    move = np.arange(0.0, 6.0, 1.0 / rate_Hz)
    time = np.arange(0.0, 190.0, 1.0 / rate_Hz)
    theta = np.full(time.size, np.radians(20.0))
    theta[: move.size] = np.radians(20.0) * 0.5 * (1.0 - np.cos(np.pi * move / 6.0))
    # Without cooling, so that only the motion estimate can make the torque drift.
    v = vehicle()
    v = v.replace(rubber=dataclasses.replace(v.rubber, heat_transfer_W_m2K=0.0))
    stamps = EPOCH_NS + np.round(time * 1e9).astype(np.int64)
    estimates, _ = Estimator(v).push_block(
        np.tile([0, 1], time.size),
        np.repeat(stamps, 2),
        encoder(both(theta), seed).ravel(),
        np.full(2 * time.size, np.nan),
    )
    total = np.array(estimates["total"])
    parked = total[time > 10.0]
    assert abs(parked[0]) > 20_000.0
    drift = np.abs(parked - parked[0]).max() / abs(parked[0])
    assert drift < 0.001 * 3.0


@pytest.mark.parametrize("rate_Hz", [50.0, 100.0, 500.0])
def test_creep_is_followed(rate_Hz: float) -> None:
    time = np.arange(0.0, 60.0, 1.0 / rate_Hz)
    theta = np.radians(0.05) * np.maximum(time - 5.0, 0.0)
    truth = true_torque(time, both(theta))
    total = estimated_torque(time, encoder(both(theta), 4))
    late = time > 25.0  # a degree of travel
    assert np.abs(total - truth)[late].max() < 0.015 * truth.max()
    slope = np.polyfit(time[late], total[late], 1)[0] / np.polyfit(time[late], truth[late], 1)[0]
    assert slope == pytest.approx(1.0, abs=0.03)


def test_coarse_encoder_stays_sane() -> None:
    time, theta = double_cycle(100.0)
    truth = true_torque(time, both(theta))
    measured = encoder(both(theta), 5, noise_deg=0.0, resolution_deg=0.1)
    error = estimated_torque(time, measured, resolution_deg=0.1) - truth
    assert np.sqrt(np.mean(error**2)) < 0.03 * np.abs(truth).max()


def test_clean_angles_without_noise_are_passed_through() -> None:
    time, theta = double_cycle(100.0)
    v = vehicle()
    v = v.replace(sensors=dataclasses.replace(v.sensors, angle_noise_deg=0.0, angle_resolution_deg=0.0))
    estimator = Estimator(v)
    stamps = EPOCH_NS + np.round(time * 1e9).astype(np.int64)
    estimates, _ = estimator.push_block(
        np.tile([0, 1], time.size), np.repeat(stamps, 2), both(theta).ravel(), np.full(2 * time.size, np.nan)
    )
    np.testing.assert_allclose(estimates["theta"], both(theta), rtol=0, atol=1e-12)


def test_measured_rate_is_used_when_given() -> None:
    time, theta = double_cycle(100.0)
    rate = np.gradient(theta, time)
    stamps = EPOCH_NS + np.round(time * 1e9).astype(np.int64)
    v = vehicle().replace(sides=("left",), hydraulics=None, torque_sensor=TorqueSensor())
    channel = np.zeros(time.size, np.int64)
    estimates, _ = Estimator(v).push_block(channel, stamps, encoder(theta, 6), rate)
    np.testing.assert_allclose(estimates["omega"][200:, 0], rate[200:], atol=0.02)


def test_whole_record_and_estimator_share_the_step() -> None:
    p, rubber = baseline()
    time, theta = double_cycle(100.0)
    v = vehicle()
    v = v.replace(sensors=dataclasses.replace(v.sensors, angle_noise_deg=0.0, angle_resolution_deg=0.0))
    stamps = EPOCH_NS + np.round(time * 1e9).astype(np.int64)
    estimates, _ = Estimator(v).push_block(
        np.tile([0, 1], time.size), np.repeat(stamps, 2), both(theta).ravel(), np.full(2 * time.size, np.nan)
    )
    omega, angle = np.ascontiguousarray(estimates["omega"][:, 0]), np.ascontiguousarray(estimates["theta"][:, 0])
    out = run_side(p, rubber, (stamps - stamps[0]) * 1e-9, angle, omega, np.zeros(time.size))
    np.testing.assert_allclose(estimates["torque"][:, 0], out["torque"], rtol=1e-9, atol=1e-6)
