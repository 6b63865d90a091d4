# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The ramp of the unstamped feed-forward commands."""

import pytest

pytest.importorskip("rclpy")

from lugre_steering.estimator.commands import CommandRamp, Fade

MS = 1_000_000


def test_first_commands_rise_from_zero() -> None:
    ramp = CommandRamp(0.2, 1.0, 1)
    values = [ramp(i * 100 * MS, [50.0])[0] for i in range(12)]
    assert values == pytest.approx([0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 50.0])


def test_after_silence_commands_continue_where_they_stopped() -> None:
    ramp = CommandRamp(0.2, 0.4, 2)
    for i in range(20):
        ramp(i * 50 * MS, [100.0, -100.0])
    begin = 2000 * MS
    assert ramp(begin, [-300.0, 300.0]) == [100.0, -100.0]
    assert ramp(begin + 200 * MS, [-300.0, 300.0]) == pytest.approx([-100.0, 100.0])
    assert ramp(begin + 400 * MS, [-300.0, 300.0]) == [-300.0, 300.0]


def test_a_clock_set_back_counts_as_silence() -> None:
    ramp = CommandRamp(0.2, 0.1, 1)
    for i in range(20):
        ramp(i * 50 * MS, [10.0])
    assert ramp(0, [90.0]) == [10.0]
    assert ramp(100 * MS, [90.0]) == [90.0]


def test_a_restart_ramps_without_any_silence() -> None:
    ramp = CommandRamp(5.0, 0.1, 1)
    for i in range(20):
        ramp(i * 10 * MS, [10.0])
    ramp.restart()
    assert ramp(200 * MS, [90.0]) == [10.0]
    assert ramp(250 * MS, [90.0]) == pytest.approx([50.0])
    assert ramp(300 * MS, [90.0]) == [90.0]


def test_a_fade_reaches_zero_and_makes_no_large_step_after_a_pause() -> None:
    fade = Fade(0, [100.0, -50.0], 0.2)
    assert fade(20 * MS) == pytest.approx([90.0, -45.0])
    assert fade(10 * MS) == pytest.approx([90.0, -45.0])
    assert fade(5000 * MS) == pytest.approx([65.0, -32.5])
    assert [fade(5000 * MS + i * 50 * MS)[0] for i in range(1, 4)] == pytest.approx([40.0, 15.0, 0.0])
    assert Fade(0, [7.0], 0.0)(1) == [0.0]


def test_no_ramp_wanted() -> None:
    assert CommandRamp(0.2, 0.0, 1)(5, [7.0]) == [7.0]
