# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of half an hour are inspected piece by piece. What is computed is kept by no fixture, as its memory is measured."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from functools import cache

import numpy as np

from lugre_steering.calibration.coverage import QUICK, record
from lugre_steering.data.quality import inspect
from lugre_steering.recording import Recording, Signal
from lugre_steering.simulate.command import load_vehicle

VEHICLE = load_vehicle(None)


@cache
def half_hour() -> Recording:
    """The first quick recording at 20 Hz over and over; it begins and ends straight ahead."""
    (first,) = record(VEHICLE, QUICK[:1], 5, 20.0)
    lasts = max(float(s.time_s[-1]) for s in first.angle.values()) + 0.01
    times = int(np.ceil(1800.0 / lasts))

    def over(signal: Signal) -> Signal:
        again = [signal.time_s + i * lasts for i in range(times)]
        return Signal(np.concatenate(again), np.tile(signal.value, times))

    return replace(
        first, angle={side: over(s) for side, s in first.angle.items()}, pressure={line: over(s) for line, s in first.pressure.items()},
        rate={}, air_temperature=None,
    )  # fmt: skip


def test_half_an_hour_is_inspected_in_little_more_than_its_own_memory() -> None:
    recording = half_hour()
    signals = [*recording.angle.values(), *recording.pressure.values()]
    held = sum(s.time_s.nbytes + s.value.nbytes for s in signals)
    tracemalloc.start()
    try:
        quality = inspect(recording, VEHICLE)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert quality.blocking == ()
    # Its noise, and a dozen columns of one channel at a time; all of it against the model at once took 5.5 times as much.
    assert peak < 3.5 * held
    # What is sound is not copied.
    assert all(np.shares_memory(quality.recording.pressure[line].value, s.value) for line, s in recording.pressure.items())


def test_wiring_and_drift_of_half_an_hour_are_told() -> None:
    recording = half_hour()
    turned = {side: Signal(s.time_s, -s.value) for side, s in recording.angle.items()}
    flipped = inspect(replace(recording, angle=turned), VEHICLE)
    assert {f.finding for f in flipped.blocking} == {"sign_flipped"}
    line = "main_a"
    signal = recording.pressure[line]
    # 1 bar in each piece of 150 s would be nothing; 25 bar from the first to the last is a sensor to look at.
    drifting = Signal(signal.time_s, signal.value + 25e5 * signal.time_s / signal.time_s[-1])
    found = inspect(replace(recording, pressure={**recording.pressure, line: drifting}), VEHICLE)
    (drift,) = [f for f in found.findings if f.finding == "zero_drift"]
    assert line in drift.topic
    assert len(drift.intervals_s) == 5
