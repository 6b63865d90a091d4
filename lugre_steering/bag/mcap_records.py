# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The records of an MCAP file or chunk one after the other, and beyond damage (format: mcap.dev/spec, version 0).

A record gives only its own length, so one wrong length hides all that follow. A record is therefore believed only if
its own fields fill it, and if one that may come next, or the end, follows where it ends; after any other the search goes on
at the next byte from which records follow on each other again. So what lies next to damage, and may be hurt inside, is left
out as well.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from typing import NamedTuple

import numpy as np

from lugre_steering.bag.compression import MESSAGE_LIMIT
from lugre_steering.recording import Mask

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(9, 16)
GAP = 0  # no record: a damaged stretch

RECORD = struct.Struct("<BQ")
CHUNK_HEAD = struct.Struct("<QQQI")
MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel, sequence, log time, time of publication [ns]
_PRIVATE = 0x80  # records of other programs begin here
_HEAD = RECORD.size + MESSAGE_HEAD.size

# Where a record is neither a message nor private: (bytes, width of a length that follows them) of each part, bytes at its end.
_PARTS: dict[int, tuple[tuple[tuple[int, int], ...], int]] = {
    HEADER: (((0, 4), (0, 4)), 0),
    FOOTER: ((), 20),
    SCHEMA: (((2, 4), (0, 4), (0, 4)), 0),
    CHANNEL: (((4, 4), (0, 4), (0, 4)), 0),
    CHUNK: (((28, 4), (0, 8)), 0),
    MESSAGE_INDEX: (((2, 4),), 0),
    CHUNK_INDEX: (((32, 4), (8, 4)), 16),
    ATTACHMENT: (((16, 4), (0, 4), (0, 8)), 4),
    ATTACHMENT_INDEX: (((40, 4), (0, 4)), 0),
    STATISTICS: (((42, 4),), 0),
    METADATA: (((0, 4), (0, 4)), 0),
    METADATA_INDEX: (((16, 4),), 0),
    SUMMARY_OFFSET: ((), 17),
    DATA_END: ((), 4),
}

_CHUNK = frozenset({SCHEMA, CHANNEL, MESSAGE})
_PRIVATE_ONES = frozenset(range(_PRIVATE, 256))
_DATA = _CHUNK | {CHUNK, ATTACHMENT, METADATA, DATA_END} | _PRIVATE_ONES
_SUMMARY = {SCHEMA, CHANNEL, CHUNK_INDEX, ATTACHMENT_INDEX, METADATA_INDEX, STATISTICS, SUMMARY_OFFSET, FOOTER} | _PRIVATE_ONES
_ANY = frozenset({*_PARTS, MESSAGE}) | _PRIVATE_ONES
# What may follow a record of each kind, and a gap.
_NEXT = dict.fromkeys(_ANY, _ANY) | dict.fromkeys(_SUMMARY - _CHUNK - _PRIVATE_ONES, _SUMMARY) | {GAP: _ANY}
_NEXT |= dict.fromkeys((HEADER, MESSAGE, ATTACHMENT, METADATA), _DATA) | dict.fromkeys((SCHEMA, CHANNEL), _DATA | _SUMMARY)
_NEXT |= dict.fromkeys((CHUNK, MESSAGE_INDEX), _DATA | {MESSAGE_INDEX}) | {DATA_END: _SUMMARY, FOOTER: frozenset()}
_NEXT_IN_CHUNK = dict.fromkeys((*_CHUNK, GAP), _CHUNK)
_MOST = 1 << 32  # bytes of a record that is searched for
_WINDOW = 1 << 20
_NEAR = 1 << 13  # damage is mostly small
_NEAR_NS = 86_400 * 10**9  # a message is recorded within a day of its publication
_TRIES = 200_000  # places looked at; bytes made to look like records must not hold the search up

Data = bytes | bytearray | memoryview
Read = Callable[[int, int], Data]  # offset and size -> bytes, fewer at the end


class Record(NamedTuple):
    """Where a record begins and where the next one does (beyond the end for a torn one)."""

    op: int
    at: int
    after: int


def records(read: Read, at: int, end: int, known: Mask, *, in_chunk: bool = False) -> Iterator[Record]:
    """Every record from ``at`` to ``end`` that can be believed, and a ``GAP`` for each damaged stretch between them.

    ``known[channel]`` tells which channels messages may be of; only those are searched for. The last record may be torn.
    """
    search = _Search(read, end, known, _NEXT_IN_CHUNK if in_chunk else _NEXT)
    here = search.header(at)
    while at < end:
        following = None
        if here is not None and here.after < end:
            following = search.header(here.after, here.op)
        if here is not None and (here.after == end or following is not None):
            yield here
            at, here = here.after, following
            continue
        torn = here is not None and here.after > end
        # Both lengths of a chunk agree; one alone may be wrong.
        resumed = end if torn and here is not None and here.op == CHUNK else search.after(at)
        yield here if torn and here is not None and resumed == end else Record(GAP, at, resumed)
        at, here = resumed, search.header(resumed)


def fills(read: Read, at: int, after: int, end: int) -> bool:
    """Whether a record, but for a message, is as long as its fields, as far as they lie before the end."""
    parts, rest = _PARTS[read(at, 1)[0] % _PRIVATE]
    field = at + RECORD.size
    for skipped, width in parts:
        field += skipped + width
        if field > min(after, end):
            return field <= after
        field += int.from_bytes(read(field - width, width), "little")
    return field + rest == after


class _Search:
    """Finds where records follow on each other again."""

    def __init__(self, read: Read, end: int, known: Mask, allowed: Mapping[int, AbstractSet[int]]) -> None:
        """``allowed``: the kinds of record that may follow each kind."""
        self._read, self._end, self._known, self._tries, self._allowed = read, end, known, _TRIES, allowed

    def header(self, at: int, before: int = GAP) -> Record | None:
        """The record that begins here, as far as its own bytes and the kind before tell; None where they contradict."""
        head = self._read(at, min(_HEAD, self._end - at))
        if not head or head[0] not in self._allowed[before]:
            return None
        op = head[0]
        if len(head) < RECORD.size:
            return Record(op, at, self._end + 1) if op < _PRIVATE else None
        _, size = RECORD.unpack_from(head)
        record = Record(op, at, at + RECORD.size + size)
        if op == MESSAGE:
            return record if MESSAGE_HEAD.size <= size <= MESSAGE_LIMIT else None
        if op >= _PRIVATE:
            return record if record.after <= self._end and not self._was_ours(record, head) else None
        return record if size < _MOST and fills(self._read, at, record.after, self._end) else None

    def _was_ours(self, record: Record, head: Data) -> bool:
        """Whether a wrong operation code made this a private record: it is a message or a chunk but for that."""
        if len(head) == _HEAD:
            channel, _, log_ns, published_ns = MESSAGE_HEAD.unpack_from(head, RECORD.size)
            if self._known[channel] and 0 < log_ns < published_ns + _NEAR_NS and published_ns < log_ns + _NEAR_NS:
                return True
        return record.op == _PRIVATE + CHUNK and fills(self._read, record.at, record.after, self._end)

    def after(self, at: int) -> int:
        """The first place behind ``at`` where a record begins that another follows; the end if there is none."""
        at, window = at + 1, _NEAR
        while at < self._end and self._tries > 0:
            stop = min(at + window, self._end)
            for place in self._candidates(at, stop):
                self._tries -= 1
                record = self.header(place)
                if record is None or record.after > self._end:
                    continue
                if record.after == self._end or self.header(record.after, record.op) is not None:
                    return place
            at, window = stop, _WINDOW
        return self._end

    def _candidates(self, begin: int, stop: int) -> list[int]:
        """Places where operation code, length and channel could be those of a record."""
        raw = np.frombuffer(self._read(begin, min(stop + RECORD.size + 1, self._end) - begin), np.uint8)
        n = min(stop - begin, len(raw) - RECORD.size - 1)
        if n <= 0:
            return []
        fits = (raw[:n] > 0) & (raw[:n] <= DATA_END)
        for byte in range(5, RECORD.size):  # lengths below _MOST
            fits &= raw[byte : byte + n] == 0
        channel = raw[RECORD.size :][:n] + raw[RECORD.size + 1 :][:n].astype(np.uint16) * 256
        fits &= (raw[:n] != MESSAGE) | self._known[channel]
        places: list[int] = (np.flatnonzero(fits)[: self._tries] + begin).tolist()
        return places
