# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The ramp of the unstamped feed-forward commands."""

import itertools

import pytest

pytest.importorskip("rclpy")

from lugre_steering.estimator.commands import CommandRamp, Fade

MS = 1_000_000
FAST = 1e9
"""A limit of rate [N m/s] that nothing here comes to."""


def test_first_commands_rise_from_zero() -> None:
    ramp = CommandRamp(0.2, 1.0, FAST, 1)
    values = [ramp(i * 100 * MS, [50.0])[0] for i in range(12)]
    assert values == pytest.approx([0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 50.0])


def test_after_silence_commands_continue_where_they_stopped() -> None:
    ramp = CommandRamp(0.2, 0.4, FAST, 2)
    for i in range(20):
        ramp(i * 50 * MS, [100.0, -100.0])
    begin = 2000 * MS
    assert ramp(begin, [-300.0, 300.0]) == [100.0, -100.0]
    assert ramp(begin + 200 * MS, [-300.0, 300.0]) == pytest.approx([-100.0, 100.0])
    assert ramp(begin + 400 * MS, [-300.0, 300.0]) == [-300.0, 300.0]


def test_a_clock_set_back_counts_as_silence() -> None:
    ramp = CommandRamp(0.2, 0.1, FAST, 1)
    for i in range(20):
        ramp(i * 50 * MS, [10.0])
    assert ramp(0, [90.0]) == [10.0]
    assert ramp(100 * MS, [90.0]) == [90.0]


def test_a_restart_ramps_without_any_silence() -> None:
    ramp = CommandRamp(5.0, 0.1, FAST, 1)
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


def test_without_a_ramp_the_limit_of_rate_leads_there() -> None:
    ramp = CommandRamp(0.2, 0.0, 100.0, 1)
    assert [ramp(i * 10 * MS, [7.0])[0] for i in range(9)] == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 7.0])


def test_commands_go_nowhere_faster_than_the_limit_of_rate() -> None:
    """On the ramp, after it, and after a pause, which gives no more time than 0.05 s."""
    ramp = CommandRamp(0.5, 0.1, 200.0, 2)
    times = [*range(0, 300, 10), *range(600, 900, 10), *range(2000, 2300, 10)]
    values = [ramp(i * MS, [100.0, -100.0] if i < 1000 else [-100.0, 100.0]) for i in times]
    for (sooner, a), (later, b) in itertools.pairwise(zip(times, values, strict=True)):
        assert all(abs(y - x) <= 200.0 * min(0.05, (later - sooner) * 1e-3) + 1e-9 for x, y in zip(a, b, strict=True))
    assert values[59] == [100.0, -100.0]
    assert values[-1] == pytest.approx([42.0, -42.0])
