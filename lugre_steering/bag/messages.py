# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Raw messages as columns: the common form of every storage format, before and after decoding."""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from lugre_steering.bag.compression import MESSAGE_LIMIT, ZSTD_MAGIC, Allowance, TooLargeError, expand
from lugre_steering.errors import BagError
from lugre_steering.recording import IntArray, Mask

Bytes = NDArray[np.uint8]

BLOCK_BYTES = 64 << 20
_WAITING_BYTES = 192 << 20
"""Of messages that wait for earlier ones; to be sorted, they are held twice."""


@dataclass(frozen=True)
class Connection:
    """One topic with one message type, with all that a copy of it needs."""

    topic: str
    msgtype: str
    encoding: str = "cdr"
    qos: str = ""
    definition: str = ""
    definition_format: str = "ros2msg"


@dataclass(frozen=True)
class Messages:
    """n messages: ``data[start[i]:start[i] + length[i]]`` belongs to the connection with index ``connection[i]``."""

    connection: NDArray[np.int32]
    log_ns: IntArray
    start: IntArray
    length: IntArray
    data: Bytes

    def __len__(self) -> int:
        return len(self.log_ns)

    @property
    def size(self) -> int:
        """Bytes of memory."""
        return sum(array.nbytes for array in (self.connection, self.log_ns, self.start, self.length, self.data))

    def take(self, which: slice | IntArray | Mask) -> Messages:
        """The selected messages over the same bytes."""
        return Messages(self.connection[which], self.log_ns[which], self.start[which], self.length[which], self.data)

    def bytes_of(self, i: int) -> bytes:
        """The serialised message i."""
        return self.data[self.start[i] : self.start[i] + self.length[i]].tobytes()

    def packed(self) -> Messages:
        """The same messages over just their own bytes (a part of a block must not keep the whole block in memory)."""
        start = np.cumsum(self.length) - self.length
        data = np.empty(int(self.length.sum()), np.uint8)
        for length in np.unique(self.length[self.length > 0]):
            alike = np.flatnonzero(self.length == length)
            sliding_window_view(data, length, writeable=True)[start[alike]] = windows(self.data, self.start[alike], length)
        return Messages(self.connection.copy(), self.log_ns.copy(), start, self.length.copy(), data)


def from_rows(
    connection: Sequence[int] | NDArray[np.int32], log_ns: Sequence[int] | IntArray, data: Sequence[bytes]
) -> Messages:
    """Columns from one sequence of serialised messages."""
    length = np.fromiter(map(len, data), np.int64, len(data))
    start = np.cumsum(length) - length
    return Messages(
        np.asarray(connection, np.int32),
        np.asarray(log_ns, np.int64),
        start,
        length,
        np.frombuffer(b"".join(data), np.uint8),
    )


def windows(data: Bytes, start: IntArray, length: int) -> Bytes:
    """Copy the equally long pieces that begin at ``start`` (n,) to rows (n, length)."""
    if len(start) == 0 or length == 0:
        return np.empty((len(start), length), np.uint8)
    rows: Bytes = sliding_window_view(data, length)[start]
    return rows


def join(parts: Sequence[Messages]) -> Messages:
    """One set of columns out of several."""
    if len(parts) == 1:
        return parts[0]
    offset = np.cumsum([0] + [len(p.data) for p in parts[:-1]])
    return Messages(
        np.concatenate([p.connection for p in parts]),
        np.concatenate([p.log_ns for p in parts]),
        np.concatenate([p.start + o for p, o in zip(parts, offset, strict=True)]),
        np.concatenate([p.length for p in parts]),
        np.concatenate([p.data for p in parts]),
    )


def inflated(messages: Messages, allowance: Allowance) -> Iterator[tuple[Messages, Counter[str]]]:
    """Expand messages that were compressed one by one; also tells how many of them were beyond reading, by reason.

    Recognised by content, not by metadata: serialised messages start with 0x00, zstd frames with their magic number.
    """
    long = np.flatnonzero(messages.length >= len(ZSTD_MAGIC))
    magic = windows(messages.data, messages.start[long], len(ZSTD_MAGIC)).view("<u4")[:, 0]
    compressed = set(long[magic == int.from_bytes(ZSTD_MAGIC, "little")].tolist())
    if not compressed:
        yield messages, Counter()
        return
    kept: list[int] = []
    data: list[bytes] = []
    lost: Counter[str] = Counter()
    size = 0
    for i in range(len(messages)):
        raw = messages.bytes_of(i)
        if i in compressed:
            try:
                plain, damage = expand(raw, "zstd", MESSAGE_LIMIT, allowance)
            except TooLargeError as error:
                lost[str(error)] += 1
                continue
            if damage:
                lost["they are damaged"] += 1
                continue
            raw = bytes(plain)
        kept.append(i)
        data.append(raw)
        size += len(raw)
        if size > BLOCK_BYTES:
            yield from_rows(messages.connection[kept], messages.log_ns[kept], data), Counter()
            kept, data, size = [], [], 0
    yield from_rows(messages.connection[kept], messages.log_ns[kept], data), lost


def merged(runs: Sequence[tuple[int, Iterable[Messages]]], per_block: int) -> Iterator[Messages]:
    """Merge runs (not before which log time, ordered pieces) to blocks in log order, in bounded memory.

    A message may leave once no unread piece can hold an earlier one. Runs are opened only when their time comes, so
    memory is bounded by how far runs overlap, not by the length of the recording.
    """
    ahead = [(begin, i, iter(pieces)) for i, (begin, pieces) in enumerate(runs)]
    heapq.heapify(ahead)
    waiting: list[Messages] = []
    count = size = 0  # messages and bytes waiting
    enough, full = per_block, BLOCK_BYTES
    while ahead:
        _, i, pieces = heapq.heappop(ahead)
        piece = next(pieces, None)
        if piece is not None:
            waiting.append(piece)
            count, size = count + len(piece), size + piece.size
            heapq.heappush(ahead, (int(piece.log_ns[-1]), i, pieces))
            if size > _WAITING_BYTES:  # whole chunks are held for the sake of few messages, or too much is
                for k, part in enumerate(waiting):
                    waiting[k] = part.packed()
                size = sum(part.size for part in waiting)
                if size > _WAITING_BYTES:
                    raise BagError(f"more than {size >> 20} MB lie so far out of time order that they cannot be sorted")
        if not waiting or (ahead and count < enough and size < full):
            continue
        block, waiting = join(waiting), []
        block = block.take(np.argsort(block.log_ns, kind="stable"))
        ready = int(np.searchsorted(block.log_ns, ahead[0][0])) if ahead else len(block)
        for begin in range(0, ready, per_block):
            yield block.take(slice(begin, min(begin + per_block, ready)))
        rest = block.take(slice(ready, None)).packed()
        waiting = [rest] if len(rest) else []
        del block  # not to be held beside the next one
        # What is carried over must not be sorted again with every small piece.
        count, size = len(rest), rest.size
        enough, full = max(per_block, 2 * count), max(BLOCK_BYTES, 2 * size)
