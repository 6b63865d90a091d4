# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A jump of the level of friction, on made-up torques of a joint that swings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lugre_steering.diagnosis.level_jump import jumped

TIME = np.arange(0.0, 80.0, 0.02)
FRICTION = 30.0 * np.sign(np.sin(2.0 * np.pi * TIME / 5.0))


def error(level: np.ndarray, seed: int) -> np.ndarray:
    """What a recalibrated level leaves of a friction times ``level`` (n,), with errors that last."""
    noise = np.random.default_rng(seed).standard_normal(TIME.size)
    lasting = np.convolve(noise, np.ones(25) / 5.0, mode="same")
    return FRICTION * (level - level.mean()) + lasting


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("at_s", "share"), [(32.0, 0.3), (15.0, -0.2), (60.0, 0.5)])
def test_a_jump_is_told_with_its_time_and_size(at_s: float, share: float, seed: int) -> None:
    level = 1.0 + share * (at_s < TIME)
    found = jumped(TIME, FRICTION * level.mean(), error(level, seed), np.ones(TIME.size))
    assert found is not None
    assert found.at_s == pytest.approx(at_s, abs=1.0)
    assert found.share == pytest.approx(share, rel=0.15)
    assert found.torque == pytest.approx(30.0 * abs(share), rel=0.15)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "level",
    [
        lambda t: 1.0 + 0.0 * t, lambda t: 1.0 + 0.005 * t, lambda t: 1.0 + 0.3 * np.exp(-t / 15.0), lambda t: 1.0 + 0.1 * np.sin(t / 6.0),
        lambda t: 1.0 + 0.3 * (t > 20.0) * (t < 50.0),
    ],
)  # fmt: skip
def test_noise_and_changes_that_are_not_at_once_or_do_not_stay_are_no_jump(level: Callable[[np.ndarray], np.ndarray], seed: int) -> None:
    assert jumped(TIME, FRICTION, error(level(TIME), seed), np.ones(TIME.size)) is None


def test_nothing_is_told_of_nothing() -> None:
    assert jumped(TIME, 0.0 * TIME, 0.0 * TIME, np.ones(TIME.size)) is None
    assert jumped(TIME, FRICTION, 0.0 * TIME, np.zeros(TIME.size)) is None
