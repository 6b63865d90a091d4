# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Generated laws: drawn in the promised shares, neutral at zero, and each does what its cell says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lugre_steering.proof.generator import (
    CHANNELS,
    COORDINATES,
    OUTSIDE,
    RATE,
    SHAPES,
    Law,
    Scene,
    draw_law,
    modulate,
    remembered,
)

TIME = np.arange(0.0, 60.0, 4e-3)
ANGLE = np.stack([0.4 * np.tanh(3.0 * np.sin(0.4 * TIME)) * (0.7 + 0.3 * np.cos(0.11 * TIME))] * 2)
"""Strokes of changing size with rests at their ends."""
SCENE = Scene(
    TIME, ANGLE, np.gradient(ANGLE, 4e-3, axis=1), np.gradient(np.gradient(ANGLE, 4e-3, axis=1), 4e-3, axis=1),
    1.9e4 * np.tanh(np.cos(0.4 * TIME) * 5.0) * np.ones((2, 1)), 15.0 + 0.1 * TIME * np.ones((2, 1)), 0.4, 4e4,
)  # fmt: skip
PLAIN = Law("conservative", "angle", "none", "linear", "", 0.5, 0.5, 0.5, 2.0, 0.2, 1.0, 0.03)
DRAWN = [draw_law(np.random.default_rng(seed)) for seed in range(600)]


def test_a_third_is_outside_the_grammar_and_half_remember() -> None:
    outside = np.mean([bool(law.outside) for law in DRAWN])
    inside = [law for law in DRAWN if not law.outside]
    assert outside == pytest.approx(1.0 / 3.0, abs=0.06)
    assert np.mean([law.memory != "none" for law in inside]) == pytest.approx(0.5, abs=0.07)
    assert {law.channel for law in DRAWN} == set(CHANNELS)
    assert {law.coordinate for law in DRAWN} == set(COORDINATES)
    assert {law.shape for law in inside} == set(SHAPES)
    assert {law.outside for law in DRAWN} == {"", *OUTSIDE}


def test_every_law_acts_and_is_neutral_without_strength() -> None:
    for law in DRAWN[:150]:
        off, on = modulate(law, 0.0, SCENE), modulate(law, 1.0, SCENE)
        assert (off.level == 1.0).all()
        assert (off.stiffness == 1.0).all()
        assert (off.torque == 0.0).all()
        assert all(np.isfinite(part).all() and part.shape == ANGLE.shape for part in on)
        change = np.abs(on.level - 1.0).max() + np.abs(on.stiffness - 1.0).max() + np.abs(on.torque).max() / 4e4
        assert change > 1e-4 or law.shape in ("window", "bump")  # a narrow one may lie where this scene never goes


def test_channels_are_what_they_say() -> None:
    """A cell by hand: 3 % of the sliding torque of a track at the steering limit, or at RATE."""
    np.testing.assert_allclose(modulate(PLAIN, 1.0, SCENE).torque, 0.03 * 2e4 * ANGLE / 0.4)
    viscous = modulate(replace(PLAIN, channel="viscous", coordinate="abs angle"), 1.0, SCENE).torque
    np.testing.assert_allclose(viscous, 0.03 * np.abs(ANGLE) / 0.4 * 2e4 * SCENE.rate / RATE)
    np.testing.assert_allclose(modulate(replace(PLAIN, channel="level"), 1.0, SCENE).level, 1.0 + 0.03 * ANGLE / 0.4)


def test_memories_are_a_lag_and_a_play() -> None:
    step = np.where(TIME > 10.0, 1.0, 0.0) * np.ones((2, 1))
    lagged = remembered(replace(PLAIN, memory="lag", memory_s=2.0), step, 4e-3)
    assert np.interp(12.0, TIME, lagged[0]) == pytest.approx(1.0 - np.exp(-1.0), abs=2e-3)
    wave = np.sin(0.4 * TIME)
    played = remembered(replace(PLAIN, memory="play", play=0.2), np.stack([wave, wave]), 4e-3)[0]
    assert played.max() == pytest.approx(0.8, abs=1e-3)
    assert played[np.argmax(wave) + 100] == played[np.argmax(wave)]  # stays after a reversal until the play is used up


def test_outside_laws_are_no_function_of_one_coordinate() -> None:
    """The same angle and rate give two values: within cells of a fortieth of both a smooth function varies by some percent only."""
    for name in ("alternating", "wiping", "latched"):
        f = modulate(replace(PLAIN, outside=name, coordinate="time" if name == "latched" else "angle"), 1.0, SCENE).torque[0]
        key = np.round(ANGLE[0] / 0.02).astype(int) * 1000 + np.round(SCENE.rate[0] / 0.02).astype(int)
        spread = [np.ptp(f[key == k]) for k in np.unique(key[2000:])]
        assert max(spread) > 0.15 * np.ptp(f)
