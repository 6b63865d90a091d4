# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Many bags of one machine in memory: those of others are left out, and said to be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from lugre_steering.bag.find import Skipped
from lugre_steering.bag.load import REMEDY, distinct, read_recording
from lugre_steering.bag.reader import shortened
from lugre_steering.errors import BagError
from lugre_steering.recording import Channel, Kind, Recording


def read_of_machine(
    bags: Sequence[Path], channels: Sequence[Channel], progress: Callable[[str], None] = lambda _: None
) -> tuple[list[Recording], list[Skipped]]:
    """The recordings with these ``channels``, each by a name of its own, and the bags that are none, with the reason.

    One bag alone is read as it is. ``BagError`` if none of several is of use, or two are the same recording.
    """
    read: list[tuple[str, Recording]] = []
    skipped: list[Skipped] = []
    for bag in bags:
        progress(f"reading {bag.name}")
        try:
            recording = read_recording(bag, channels)
        except BagError as error:
            if len(bags) == 1:
                raise
            skipped.append(Skipped(str(bag), str(error).removeprefix(f"{bag}: ")))
            continue
        lacking = missing(recording, channels) if len(bags) > 1 else ""
        if lacking:
            skipped.append(Skipped(str(bag), lacking))
        else:
            read.append((str(bag), recording))
    if not read:
        reasons = shortened([f"{one.bag}: {one.reason}" for one in skipped], 3)
        raise BagError(f"none of {len(bags)} bags is a recording of this machine: {reasons}")
    return distinct(read), skipped


def missing(recording: Recording, channels: Sequence[Channel]) -> str:
    """What a recording lacks to be one of this machine, in words; empty if it has all angles and some torque."""
    lost = [c.topic for c in channels if c.kind is Kind.ANGLE and c.name not in recording.angle]
    if lost:
        return f"no recording of this machine: nothing usable on {', '.join(dict.fromkeys(lost))}; {REMEDY}"
    torque = [c.topic for c in channels if c.kind in (Kind.PRESSURE, Kind.TORQUE)]
    if torque and not recording.pressure and recording.measured_torque is None:
        return f"no torque to compare with: nothing usable on {', '.join(torque)}; {REMEDY}"
    return ""
