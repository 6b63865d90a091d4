# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Kicks from outside are told from events that the motion makes, on made-up residuals with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from lugre_steering.data.bursts import all_bursts, find_bursts, set_aside
from lugre_steering.data.dataset import Run, motion

STEP_S = 0.01


def run(period_s: float = 7.3, duration_s: float = 60.0) -> Run:
    """A joint that swings to and fro, so that every state is visited again and again."""
    time = np.arange(0.0, duration_s, STEP_S)
    theta = 0.4 * np.sin(2.0 * np.pi * time / period_s)[None, :]
    omega, alpha = motion(time, theta)
    none = np.zeros((1, 1, time.size))
    return Run(
        "made up", time, theta, omega, alpha, none, none[0], none[0], none[0], none[0, 0], none[0, 0] + 1.0,
        np.ones(time.size, bool),
    )  # fmt: skip


def noise(size: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(size)


def kicks(time: np.ndarray, times: np.ndarray, signs: np.ndarray, size: float) -> np.ndarray:
    return size * sum(s * np.exp(-(((time - t) / 0.02) ** 2)) for t, s in zip(times, signs, strict=True))


def test_a_regular_series_of_kicks_is_found_where_it_is() -> None:
    joint = run()
    times = np.arange(1.0, 59.0, 1.7)
    signs = (-1.0) ** np.arange(times.size)
    found = find_bursts(joint, noise(joint.time.size) + kicks(joint.time, times, signs, 30.0))
    assert found is not None
    assert found.matter
    assert found.period_s == pytest.approx(1.7, abs=0.02)
    middle = np.array([0.5 * (a + b) for a, b in found.intervals])
    assert np.abs(middle[:, None] - times).min(axis=1).max() < 0.05  # nothing but kicks
    assert np.mean(np.abs(times[:, None] - middle).min(axis=1) < 0.05) > 0.85  # nearly all of them
    assert found.covers(joint.time)[np.rint(middle / STEP_S).astype(int)].all()
    assert np.mean(found.covers(joint.time)) < 0.2
    assert "every 1.70 s" in found.statement
    residual = noise(joint.time.size) + kicks(joint.time, times, signs, 30.0)
    (cleaned, calm), findings = set_aside([joint, joint], [residual, noise(joint.time.size)])
    assert not (cleaned.valid & found.covers(joint.time)).any()
    assert calm is joint
    assert [finding.intervals_s for finding in findings.values()] == [found.intervals]


def test_irregular_kicks_have_no_period() -> None:
    joint = run()
    times = np.sort(np.random.default_rng(3).uniform(2.0, 58.0, 14))
    found = find_bursts(joint, noise(joint.time.size) + kicks(joint.time, times, np.ones(times.size), 40.0))
    assert found is not None
    assert found.matter
    assert found.period_s is None


def test_spikes_at_every_reversal_belong_to_the_motion() -> None:
    joint = run()
    times = np.arange(7.3 / 4.0, 59.0, 7.3 / 2.0)
    signs = (-1.0) ** np.arange(times.size)
    found = find_bursts(joint, noise(joint.time.size) + kicks(joint.time, times, signs, 30.0))
    assert found is None or not found.matter


@pytest.mark.parametrize("seed", range(5))
def test_noise_and_slow_structure_hold_no_bursts(seed: int) -> None:
    joint = run()
    slow = 20.0 * np.sign(joint.omega[0]) + 10.0 * np.sin(joint.time)
    for residual in (noise(joint.time.size, seed), noise(joint.time.size, seed) + slow, np.zeros(joint.time.size)):
        assert all_bursts([joint], [residual]) == [None]


def test_a_joint_that_never_comes_back_gives_no_verdict() -> None:
    """One long sweep: whether an event belongs to its state cannot be known."""
    joint = run(period_s=400.0)
    times = np.arange(3.0, 57.0, 2.0)
    found = find_bursts(joint, noise(joint.time.size) + kicks(joint.time, times, np.ones(times.size), 40.0))
    assert found is None or not found.matter


def trapezoids(seed: int) -> Run:
    """A joint that goes from rest to rest, each time elsewhere and at another speed: no state comes again."""
    rng, rate = np.random.default_rng(seed), []
    for way in rng.uniform(0.2, 1.0, 40) * (-1.0) ** np.arange(40):
        up = np.linspace(0.0, way, round(rng.uniform(5, 40)), endpoint=False)
        rate += [*up, *np.full(round(rng.uniform(20, 120)), way), *up[::-1], *np.zeros(round(rng.uniform(20, 100)))]
    time = np.arange(len(rate)) * STEP_S
    theta = np.cumsum(rate)[None, :] * STEP_S
    omega, alpha = motion(time, theta)
    none = np.zeros((1, 1, time.size))
    return Run(
        "made up", time, theta, omega, alpha, none, none[0], none[0], none[0], none[0, 0], none[0, 0] + 1.0, np.ones(time.size, bool),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("own", [True, False])
def test_bursts_at_starts_are_of_the_motion_and_others_are_not(own: bool, seed: int) -> None:
    """Each start lets go a little later, and by another size; the same bursts at any time come from outside."""
    joint, rng = trapezoids(seed), np.random.default_rng(seed + 100)
    moves = np.abs(joint.omega[0]) > 0.02
    starts = joint.time[1:][moves[1:] & ~moves[:-1]]
    times = starts + rng.uniform(0.0, 0.15, starts.size) if own else np.sort(rng.uniform(0.0, joint.time[-1], starts.size))
    sizes = rng.uniform(20.0, 60.0, times.size) * np.where(rng.random(times.size) < 0.5, -1.0, 1.0)
    found = find_bursts(joint, noise(joint.time.size, seed) + kicks(joint.time, times, sizes, 1.0))
    assert (found is not None and found.matter) == (not own)
