# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings as a program gives them: paths of bags, recordings in memory, or both."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lugre_steering.ackermann import other_track
from lugre_steering.bag.load import distinct, read_recording
from lugre_steering.errors import DataError
from lugre_steering.recording import Array, Channel, IntArray, Kind, Recording, Signal

Given = str | Path | Recording


def each(data: Given | Sequence[Given]) -> list[Given]:
    """One thing or several as a list, of which none may be missing or something else."""
    items: list[Given] = list(data) if isinstance(data, Iterable) and not isinstance(data, (str, bytes)) else [data]
    if not items:
        raise DataError("no recording is given, expected at least one")
    for item in items:
        if not isinstance(item, (str, Path, Recording)):
            raise DataError(f"recordings: got {item!r}, expected paths of bags, or recordings")
    return items


def files(items: Sequence[Given]) -> list[Path]:
    """The paths among them."""
    return [Path(item) for item in items if not isinstance(item, Recording)]


def given_recordings(
    items: Sequence[Given], channels: Sequence[Channel], progress: Callable[[str], None] = lambda _: None
) -> list[Recording]:
    """All of them in memory, each by a name of its own; the same recording twice is refused."""
    found = []
    for item in items:
        if isinstance(item, Recording):
            found.append((item.name, with_both_tracks(item, channels)))
        else:
            progress(f"reading {Path(item).name}")
            found.append((str(item), read_recording(item, channels)))
    return distinct(found)


def with_both_tracks(recording: Recording, channels: Sequence[Channel]) -> Recording:
    """With the angle of a track without a sensor of its own, which follows from the other by the steering geometry; ``DataError`` where
    pressures are given and none by the name of a line."""
    lines = [channel.name for channel in channels if channel.kind is Kind.PRESSURE]
    if recording.pressure and lines and not recording.pressure.keys() & set(lines):
        raise DataError(f"{recording.name}: pressure: got the lines {', '.join(recording.pressure)}, expected {', '.join(lines)}")
    angle = dict(recording.angle)
    for channel in channels:
        if channel.kind is Kind.ANGLE and channel.ackermann != 0.0 and channel.name not in angle:
            for sensed in recording.angle.values():
                value, _ = other_track(sensed.value, np.zeros_like(sensed.value), channel.ackermann)
                angle[channel.name] = Signal(sensed.time_s, value)
    return replace(recording, angle=angle)


def in_stamp_order(recording: Recording, channels: Sequence[Channel]) -> tuple[IntArray, IntArray, Array, Array]:
    """Number of the channel, stamp [ns], value and rate (NaN: not given) of every sample (n,), by increasing stamp."""
    signals = {(Kind.ANGLE, side): signal for side, signal in recording.angle.items()}
    signals |= {(Kind.PRESSURE, line): signal for line, signal in recording.pressure.items()}
    numbers, stamps, values, rates = [], [], [], []
    for number, channel in enumerate(channels):
        signal = signals.get((channel.kind, channel.name))
        if channel.kind is Kind.TORQUE:
            signal = recording.measured_torque
        elif channel.kind is Kind.AIR_TEMPERATURE:
            signal = recording.air_temperature
        if signal is None:
            continue
        rate = np.full(signal.time_s.size, np.nan)
        if channel.kind is Kind.ANGLE and (given := recording.rate.get(channel.name)) is not None:
            _, at, of = np.intersect1d(signal.time_s, given.time_s, assume_unique=True, return_indices=True)
            rate[at] = given.value[of]
        numbers.append(np.full(signal.time_s.size, number, np.int64))
        stamps.append(recording.start_ns + np.round(signal.time_s * 1e9).astype(np.int64))
        values.append(signal.value)
        rates.append(rate)
    if not stamps:
        wanted = ", ".join(f"{channel.kind.name.lower()} '{channel.name}'" for channel in channels)
        raise DataError(f"{recording.name}: holds no input of the vehicle, expected {wanted}")
    stamp = np.concatenate(stamps)
    order = np.argsort(stamp, kind="stable")
    return np.concatenate(numbers)[order], stamp[order], np.concatenate(values)[order], np.concatenate(rates)[order]
