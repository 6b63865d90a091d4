# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A whole bag in memory, cleaned: what may be used of it, and a count of what may not, per topic and reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lugre_steering.bag.reader import Bag, Block, damage_words, shortened
from lugre_steering.counted import counted
from lugre_steering.errors import BagError
from lugre_steering.recording import (
    AIR_LIMIT_DEGC,
    RATE_LIMIT,
    Array,
    Channel,
    Finding,
    IntArray,
    Kind,
    Mask,
    Recording,
    Signal,
    unused_name,
)

LIMITS = {
    Kind.PRESSURE: (-1e9, 1e9),
    Kind.AIR_TEMPERATURE: (-AIR_LIMIT_DEGC, AIR_LIMIT_DEGC),
    Kind.TORQUE: (-1e9, 1e9),
}
SET_BACK_RUN = 5  # messages in a row between others: no mere lateness
LATE_NS = 1_000_000_000  # a message this much behind its topic is late; further behind, the clock was set back
REMEDY = "leave the bag out if another machine made it, else give its topics and joints their names under 'topics' of the vehicle file"
"""What to do about a bag that has nothing of what the vehicle file names."""
STRAY_NS = 86_400 * 1_000_000_000  # a stamp this far from where the log clock puts it is no stamp of this recording

_Samples = tuple[IntArray, Array, Array]  # stamp, value, rate of what is usable; no rates where none is given


class _Column:
    """Numbers that arrive in pieces, in one growing array: thousands of small ones would leave holes in the memory."""

    def __init__(self, dtype: type[np.generic]) -> None:
        self._values: NDArray[Any] = np.empty(0, dtype)
        self._count = 0

    def append(self, piece: NDArray[Any]) -> None:
        end = self._count + piece.size
        if end > self._values.size:
            self._values.resize(end + end // 8, refcheck=False)
        self._values[self._count : end] = piece
        self._count = end

    def __len__(self) -> int:
        return self._count

    def taken(self) -> NDArray[Any]:
        """All of them, for good: nothing may be added afterwards."""
        self._values.resize(self._count, refcheck=False)
        return self._values


class _Gathered:
    """One channel of a bag: stamp [ns], its distance from the log time [ns] (to minutes; ``STRAY_NS`` is a day), value, and
    rates from the first that is given."""

    def __init__(self) -> None:
        self.stamp, self.offset, self.value, self.rate = (_Column(t) for t in (np.int64, np.float32, np.float64, np.float64))
        self.rated = False

    def append(self, block: Block, i: int) -> None:
        """The rows of channel ``i``."""
        rows = block.channel == i
        stamp, rate = block.stamp_ns[rows], block.rate[rows]
        if not self.rated and np.isfinite(rate).any():
            self.rated = True
            self.rate.append(np.full(len(self.value), np.nan))
        self.stamp.append(stamp)
        self.offset.append((stamp - block.log_ns[rows]).astype(np.float32))
        self.value.append(block.value[rows])
        if self.rated:
            self.rate.append(rate)


def read_recording(path: str | Path, channels: Sequence[Channel]) -> Recording:
    """Read, check and sort all wanted channels; see ``Recording.rejected`` for what was left out and why."""
    with Bag(path) as bag:
        topics = bag.match(channels)
        # Only columns are kept: the serialised messages of a long recording would fill the memory.
        gathered = [_Gathered() for _ in channels]
        for block in bag.blocks(channels):
            for i, columns in enumerate(gathered):
                columns.append(block, i)
        name, malformed = bag.name, bag.malformed
        findings = list(bag.findings)
        found = shortened(sorted(bag.topics)) or "none"
    rejected: dict[str, Counter[str]] = {topic: Counter(malformed=count) for topic, count in malformed.items()}
    clean: dict[Channel, _Samples] = {}
    gathered.reverse()
    for channel in channels:
        columns = gathered.pop()  # its memory goes with it
        if channel in topics:
            stamp, value, rate = columns.stamp.taken(), columns.value.taken(), columns.rate.taken()
            use, reasons, reordered = _usable(channel, stamp, columns.offset.taken(), value)
            # Both joints may come in one message, which is lost once.
            rejected[topics[channel]] = rejected.get(topics[channel], Counter()) | Counter(reasons)
            if reordered:
                statement = f"{counted(reordered, 'message was', 'messages were')} recorded out of order and put back in order"
                findings.append(Finding("out_of_order", topics[channel], statement))
            if len(use):
                clean[channel] = stamp[use], value[use], rate[use] if columns.rated else rate
    if not clean:
        raise _nothing_usable(path, channels, found, rejected, findings)
    return _recording(name, clean, rejected, findings)


def _nothing_usable(
    path: str | Path,
    channels: Sequence[Channel],
    found: str,
    rejected: Mapping[str, Mapping[str, int]],
    findings: Sequence[Finding],
) -> BagError:
    """What to say of a bag without a usable message; ``found``: the topics in it."""
    wanted = ", ".join(sorted({channel.topic for channel in channels}))
    counts = (f"{n} {reason} on {topic}" for topic, reasons in rejected.items() for reason, n in reasons.items())
    left_out = f"; left out: {text}" if (text := ", ".join(counts)) else ""
    damage = damage_words(findings)
    remedy = "" if left_out or damage else f"; {REMEDY}"
    return BagError(
        f"{path}: no usable message on any wanted topic ({wanted}); topics in the bag: {found}{left_out}{damage}{remedy}"
    )


def _recording(
    name: str,
    clean: dict[Channel, _Samples],
    rejected: Mapping[str, Mapping[str, int]],
    findings: Sequence[Finding],
) -> Recording:
    """The usable samples in seconds since the first of them; ``clean`` is used up, so that no sample stands in memory twice."""
    start_ns = min(int(stamp[0]) for stamp, _, _ in clean.values())
    signals: dict[Kind, dict[str, Signal]] = {kind: {} for kind in Kind}
    rates: dict[str, Signal] = {}
    for channel in list(clean):
        stamp, value, rate = clean.pop(channel)
        time_s: Array = (stamp - start_ns) * np.float64(1e-9)
        signals[channel.kind][channel.name] = Signal(time_s, value)
        given = np.abs(rate) < RATE_LIMIT  # False for NaN
        if given.any():
            rates[channel.name] = Signal(time_s[given], rate[given])
    return Recording(
        name,
        start_ns,
        signals[Kind.ANGLE],
        signals[Kind.PRESSURE],
        rates,
        next(iter(signals[Kind.AIR_TEMPERATURE].values()), None),
        next(iter(signals[Kind.TORQUE].values()), None),
        {topic: dict(sorted(reasons.items())) for topic, reasons in rejected.items() if reasons},
        tuple(findings),
    )


def read_recordings(
    bags: Sequence[Path], channels: Sequence[Channel], progress: Callable[[str], None] = lambda _: None
) -> list[Recording]:
    """Several bags, each by a name of its own (two of one name get numbers); the same recording twice is refused.

    A copy would count as new evidence, whatever its file is called.
    """

    def read(bag: Path) -> Recording:
        progress(f"reading {bag.name}")
        return read_recording(bag, channels)

    return distinct((str(bag), read(bag)) for bag in bags)


def distinct(sources: Iterable[tuple[str, Recording]]) -> list[Recording]:
    """Recordings, each with where it comes from, by names of their own; ``BagError`` for the same one twice."""
    found: list[tuple[str, Recording]] = []
    for source, recording in sources:
        for path, other in found:
            if _same(recording, other):
                raise BagError(f"{source}: holds the same recording as {path}; a copy proves nothing, give each recording once")
        name = unused_name(recording.name, [other.name for _, other in found])
        found.append((source, replace(recording, name=name)))
    return [recording for _, recording in found]


def _same(first: Recording, second: Recording) -> bool:
    """Whether both hold the same samples."""
    one, other = _signals(first), _signals(second)
    return first.start_ns == second.start_ns and one.keys() == other.keys() and all(
        np.array_equal(signal.time_s, other[key].time_s) and np.array_equal(signal.value, other[key].value)
        for key, signal in one.items()
    )


def _signals(recording: Recording) -> dict[tuple[Kind, str], Signal]:
    """Angles and what the torque comes from."""
    found = {(Kind.ANGLE, side): signal for side, signal in recording.angle.items()}
    found |= {(Kind.PRESSURE, line): signal for line, signal in recording.pressure.items()}
    return found if recording.measured_torque is None else {**found, (Kind.TORQUE, ""): recording.measured_torque}


def _usable(
    channel: Channel, stamp: IntArray, offset: NDArray[np.float32], value: Array
) -> tuple[IntArray, Counter[str], int]:
    """Indices of usable messages by increasing stamp, the count of each reason for the others, how many were late.

    ``offset``: stamp less log time [ns].
    """
    reasons: Counter[str] = Counter()
    use: IntArray = np.arange(len(stamp))

    def reject(reason: str, bad: Mask) -> None:
        nonlocal use
        if bad.any():
            reasons[reason] += int(bad.sum())
            use = use[~bad]

    low, high = (-channel.farthest, channel.farthest) if channel.kind is Kind.ANGLE else LIMITS[channel.kind]
    reject("zero_stamp", stamp[use] <= 0)
    reject("not_finite", ~np.isfinite(value[use]))
    reject("absurd", (value[use] < low) | (value[use] > high))
    if len(use):
        # The offset of a real message: halfway between two clocks, as a plain median may lie, there is none.
        usual = np.percentile(offset[use], 50.0, method="lower")
        reject("time_jump", np.abs(offset[use] - usual) > STRAY_NS)
    if len(use):
        reject("backward", set_back(stamp[use]))
    reordered = int(_late(stamp[use]).sum()) if len(use) else 0
    use = use[np.argsort(stamp[use], kind="stable")]
    reject("duplicate", np.diff(stamp[use], prepend=np.int64(-1)) == 0)
    return use, reasons, reordered


def confirmed(stamp: IntArray) -> IntArray:
    """How far (n,) each stamp is believed: until one of the next two has come as far. One wild stamp must not outdate the rest."""
    following = np.maximum(np.append(stamp[1:], stamp[-1:]), np.append(stamp[2:], stamp[-2:]))
    return np.asarray(np.minimum(stamp, following))


def set_back(stamp: IntArray) -> Mask:
    """Which messages, as sent, come from a clock that was set back, or run ahead of all that follow."""
    believed = confirmed(stamp)
    found = np.asarray((stamp > believed + LATE_NS) | (stamp < np.maximum.accumulate(believed) - LATE_NS))
    found[~found] = _doubled(stamp[~found])
    return found


def _late(stamp: IntArray) -> Mask:
    return np.asarray(stamp < np.maximum.accumulate(stamp))


def _doubled(stamp: IntArray) -> Mask:
    """Which messages came after a clock was set back by less than ``LATE_NS``, between stamps that were there already.

    Late ones fill holes, or are few or mixed among others; these run on, one after the other.
    """
    late, step = _late(stamp), np.diff(stamp)
    if not late.any() or not (step > 0).any():
        return np.zeros(stamp.size, np.bool_)
    on_time = stamp[~late]
    after = np.clip(np.searchsorted(on_time, stamp), 1, on_time.size - 1)
    apart = np.minimum(np.abs(stamp - on_time[after - 1]), np.abs(on_time[after] - stamp))
    # As sent, or, where hardly any came in order, as they lie.
    period = min(float(np.median(step[step > 0])), float(np.percentile(np.diff(np.unique(stamp)), 90.0)))
    near = late & (apart < 0.6 * period)
    run = np.cumsum(np.append(True, ~(near[1:] & near[:-1] & (step > 0))))
    between = near & (apart > 0)
    return np.asarray(between & (np.bincount(run, weights=between)[run] >= SET_BACK_RUN))
