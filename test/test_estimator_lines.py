# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One pressure line of several that fails: told by its name, no wrong residual, and the torque goes on. All data are synthetic."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from lugre_steering.estimator import Estimator, doubts
from lugre_steering.recording import Array
from lugre_steering.simulate.manoeuvres import Motion
from lugre_steering.simulate.plant import run
from lugre_steering.vehicle import load
from lugre_steering.vehicle.actuation import line_pressures, total_gains

VEHICLE = load(Path(__file__).resolve().parents[1] / "config" / "test_vehicle.yaml")
T0, SECOND, PERIOD_S = 1_790_000_000_000_000_000, 1_000_000_000, 0.01
FIRST_LINE = len(VEHICLE.sides)
BEGIN, END, SAMPLES = 990, 1070, 1300
"""The fault comes in the middle of a stroke and lasts 0.8 s."""
FRICTION = 2.0 * 27.9e3
NEAR = 0.05 * FRICTION
TOLD = 20
"""Samples of the 0.2 s after which a fault is told."""


@pytest.fixture(scope="module")
def drive() -> Array:
    """Values (channels, samples) of a vehicle that steers to and fro, with the noise of its sheet."""
    fine = np.arange(0.0, SAMPLES * PERIOD_S, 0.002)
    theta = np.array([[0.3], [0.285]]) * np.sin(2.0 * math.pi / 5.0 * fine)
    torque = run(VEHICLE, Motion(fine, theta)).torque
    rng, sensors = np.random.default_rng(3), VEHICLE.sensors
    values = np.concatenate([theta, line_pressures(torque, total_gains(VEHICLE, theta))])[:, ::5]
    noise = np.array([math.radians(sensors.angle_noise_deg)] * 2 + [sensors.pressure_noise_Pa] * 4)
    return values + noise[:, None] * rng.standard_normal(values.shape)


class Came(NamedTuple):
    torque: Array
    residuals: dict[int, float]
    troubles: list[list[str]]
    """After each sample."""
    doubts: list[list[str]]
    counters: Any


Change = Callable[[int, Array], Array]
"""From a sample's number and values (lines,) to what is sent; NaN: nothing."""


def drive_through(values: Array, change: Change) -> Came:
    estimator = Estimator(VEHICLE)
    torque, residuals, troubles, doubted = [], {}, [], []
    for i in range(values.shape[1]):
        stamp_ns = T0 + round(i * PERIOD_S * SECOND)
        sent = values[:, i].copy()
        if BEGIN <= i < END:
            sent[FIRST_LINE:] = change(i, sent[FIRST_LINE:])
        for channel, value in enumerate(sent.tolist()):
            if math.isnan(value):
                continue
            rows, formed = estimator.push(channel, stamp_ns, value)
            torque += [float(row["total"]) for row in rows]
            doubted += [doubts(row) for row in rows]
            residuals |= {round((int(row["stamp_ns"]) - T0) / SECOND / PERIOD_S): float(row["residual"]) for row in formed}
        troubles.append(estimator.line_troubles)
    return Came(np.array(torque), residuals, troubles, doubted, estimator.counters)


def only(line: int, change: Callable[[int, float], float]) -> Change:
    """One line's value changed."""

    def changed(i: int, lines: Array) -> Array:
        lines = lines.copy()
        lines[line] = change(i, float(lines[line]))
        return lines

    return changed


def exchanged(first: int, second: int) -> Change:
    def changed(_: int, lines: Array) -> Array:
        lines = lines.copy()
        lines[[first, second]] = lines[[second, first]]
        return lines

    return changed


def held() -> Callable[[int, float], float]:
    first: list[float] = []
    return lambda _, value: (first.append(value), first[0])[1]


FAULTS: dict[str, tuple[Callable[[], Change], str]] = {
    "silent": (lambda: only(0, lambda *_: math.nan), ""),
    "frozen": (lambda: only(0, held()), "pressure/main_a frozen"),
    "frozen return line": (lambda: only(1, held()), "pressure/main_b frozen"),
    "one spike in five samples": (lambda: only(0, lambda i, p: p + (1e7 if i % 5 == 0 else 0.0)), "spike"),
    "spikes of two samples": (lambda: only(0, lambda i, p: p + (1e7 if i % 20 < 2 else 0.0)), "spike"),
    "stuck at zero": (lambda: only(0, lambda *_: 0.0), "pressure/main_a frozen"),
    "below range": (lambda: only(0, lambda *_: -6.25e6), "below_range"),
    "below range, with noise": (lambda: only(1, lambda i, _: -6.25e6 + 1e4 * math.sin(7.0 * i)), "below_range"),
    "main plugs exchanged": (lambda: exchanged(0, 1), "pressure/main_a and pressure/main_b exchanged"),
    "plugs of two circuits exchanged": (lambda: exchanged(0, 3), "pressure/main_a and pressure/aux_b exchanged"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_line_that_fails_is_told_and_no_wrong_residual_is_formed(drive: Array, name: str) -> None:
    make, told = FAULTS[name]
    sound, came = drive_through(drive, lambda _, lines: lines), drive_through(drive, make())
    assert not any(sound.troubles)
    assert not any(sound.doubts[300:])
    np.testing.assert_array_equal(came.torque, sound.torque)  # is of the angles
    if told in ("spike", "below_range"):
        line = "main_b" if "noise" in name else "main_a"
        assert came.counters[f"pressure/{line}"][told] > 0
        assert all(told not in counts for label, counts in came.counters.items() if label != f"pressure/{line}")
    elif told:
        assert any(told in words for words in came.troubles[BEGIN + TOLD - 1])
    wrong = [i for i, residual in came.residuals.items() if abs(residual - sound.residuals[i]) > NEAR and i >= BEGIN + TOLD]
    assert not wrong
    # Afterwards as if nothing had been.
    assert not any(came.troubles[END + 40 :])
    assert not any(came.doubts[END + 50 :])
    after = {i: residual for i, residual in came.residuals.items() if i >= END + 50}
    assert after == {i: residual for i, residual in sound.residuals.items() if i >= END + 50}
    assert len(after) > 100


def test_lines_that_never_explained_the_torque_are_not_exchanged_but_wrong(drive: Array) -> None:
    """Plugs that were exchanged before the start are for ``diagnose``: the residual is shown, and tells that it is implausible."""
    wrong = drive.copy()
    wrong[[FIRST_LINE, FIRST_LINE + 1]] = wrong[[FIRST_LINE + 1, FIRST_LINE]]
    came = drive_through(wrong, lambda _, lines: lines)
    assert not any("exchanged" in " ".join(words) for words in came.troubles)
    assert len(came.residuals) > SAMPLES - 50
    assert any("residual implausible" in words for words in came.doubts)


def test_a_line_that_never_changed_is_shown_as_it_is(drive: Array) -> None:
    """Of a bag without noise, or of a sensor that was dead from the start: only the feed-forward is withheld."""
    still = drive.copy()
    still[FIRST_LINE:] = 1e6
    came = drive_through(still, lambda _, lines: lines)
    assert not any(came.troubles)
    assert len(came.residuals) > SAMPLES - 50
    assert "pressure frozen" in came.doubts[-1]


def test_a_line_that_comes_below_its_range_step_by_step_shows_a_difference() -> None:
    estimator = Estimator(VEHICLE)
    for i in range(400):
        estimator.push(FIRST_LINE, T0 + i * 10_000_000, -5e6 * math.sin(0.02 * i))
    assert estimator.counters["pressure/main_a"] == {"accepted": 400}


def test_a_line_that_was_negative_for_a_while_is_broken_below_its_range_afterwards() -> None:
    """A low pressure with the wrong sign goes below the range step by step."""
    estimator = Estimator(VEHICLE)
    for i in range(400):
        pressure = -1e6 * math.sin(0.02 * i) if i < 200 else (0.5e6 + 1e4 * (i % 7) if i < 300 else -6.25e6)
        estimator.push(FIRST_LINE, T0 + i * 10_000_000, pressure)
    assert estimator.counters["pressure/main_a"] == {"accepted": 300, "below_range": 100}
    assert estimator.line_troubles == ["pressure/main_a below its range"]


def test_a_pressure_that_steps_costs_one_sample_and_a_fifth_of_a_second(drive: Array) -> None:
    """As at a stop: it is believed as soon as the next sample agrees."""
    came = drive_through(drive, only(0, lambda _, p: p + 8e6))
    assert came.counters["pressure/main_a"]["spike"] == 2  # up, and down again
    missing = [i for i in range(BEGIN - 5, END + 30) if i not in came.residuals]
    assert missing == [*range(BEGIN, BEGIN + 21), *range(END, END + 21)]
