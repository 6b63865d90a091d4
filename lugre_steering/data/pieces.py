# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Long recordings: the pieces that are examined, so that time and memory do not grow with length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lugre_steering.counted import counted
from lugre_steering.recording import Finding, Recording, Signal
from lugre_steering.report.words import percent

LONGEST_S = 900.0
"""Duration of all recordings together up to which everything is examined."""
PIECE_S, PIECES = 150.0, 5
LOOK_S = 0.5
"""Spacing at which travel is summed: noise adds little to it."""


def in_pieces(recordings: Sequence[Recording]) -> tuple[list[Recording], dict[str, Finding]]:
    """The recordings, or of long ones a few pieces spread over them where the tracks turn most, and a finding for each cut one."""
    durations = [_span(recording)[1] - _span(recording)[0] for recording in recordings]
    if sum(durations) <= LONGEST_S:
        return list(recordings), {}
    used: list[Recording] = []
    findings: dict[str, Finding] = {}
    for recording, duration in zip(recordings, durations, strict=True):
        count = max(1, round(PIECES * duration / sum(durations)))
        if duration <= 1.2 * count * PIECE_S:
            used.append(recording)
            continue
        starts = _busiest(recording, count)
        used += [_cut(recording, start, f"{recording.name}_at_{start:.0f}s") for start in starts]
        examined = tuple((start, start + PIECE_S) for start in starts)
        findings[recording.name] = Finding(
            "long_recording", "",
            f"{duration:.0f} s long; examined: {counted(count, 'piece')} of {PIECE_S:.0f} s, spread over it where the tracks turn most; "
            f"{percent(1.0 - count * PIECE_S / duration)} of it is not; what changes over hours is seen between pieces only",
            examined,
        )  # fmt: skip
    return used, findings


def _span(recording: Recording) -> tuple[float, float]:
    ends = [(float(s.time_s[0]), float(s.time_s[-1])) for s in recording.angle.values() if s.time_s.size]
    return (min(start for start, _ in ends), max(end for _, end in ends)) if ends else (0.0, 0.0)


def _busiest(recording: Recording, count: int) -> list[float]:
    """Start [s] of the piece with most travel in each of so many equal parts."""
    begin, end = _span(recording)
    time = np.arange(begin, end, LOOK_S)
    travel = np.zeros(time.size)
    for signal in recording.angle.values():
        if signal.time_s.size:
            travel[1:] += np.abs(np.diff(np.interp(time, signal.time_s, signal.value)))
    total = np.cumsum(travel)
    starts = []
    width = round(PIECE_S / LOOK_S)
    for part in np.array_split(np.arange(time.size), count):
        possible = part[: max(1, part.size - width)]
        turned = total[np.minimum(possible + width, time.size - 1)] - total[possible]
        starts.append(float(time[possible[int(turned.argmax())]]))
    return starts


def _cut(recording: Recording, start: float, name: str) -> Recording:
    def part(signal: Signal) -> Signal:
        keep = (signal.time_s >= start) & (signal.time_s < start + PIECE_S)
        return Signal(signal.time_s[keep], signal.value[keep])

    torque, air = recording.measured_torque, recording.air_temperature
    return replace(
        recording, name=name, angle={side: part(s) for side, s in recording.angle.items()},
        pressure={line: part(s) for line, s in recording.pressure.items()}, rate={side: part(s) for side, s in recording.rate.items()},
        measured_torque=None if torque is None else part(torque), air_temperature=None if air is None else part(air),
    )  # fmt: skip
