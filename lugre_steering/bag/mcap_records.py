# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The records of an MCAP file or chunk one after the other, and beyond damage (format: mcap.dev/spec, version 0).

A record gives only its own length, so one wrong length hides all that follow. A record is therefore believed only if
another one, or the end, follows where it ends; after any other the search goes on at the next byte from which records
follow on each other again. So what lies next to damage, and may be hurt inside, is left out as well.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from lugre_steering.bag.compression import MESSAGE_LIMIT
from lugre_steering.recording import Mask

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, SUMMARY_OFFSET, DATA_END = 11, 14, 15
GAP = 0  # no record: a damaged stretch

RECORD = struct.Struct("<BQ")
CHUNK_HEAD = struct.Struct("<QQQI")
_COMPRESSION_AT = RECORD.size + CHUNK_HEAD.size
_LONGEST_NAME = 16  # of a compression
_HEAD = _COMPRESSION_AT + 4 + _LONGEST_NAME + 8
_PRIVATE = 0x80  # records of other programs begin here
_LEAST = {HEADER: 8, FOOTER: 20, SCHEMA: 14, CHANNEL: 16, MESSAGE: 22, CHUNK: 40, MESSAGE_INDEX: 6, CHUNK_INDEX: 64}
_LEAST |= {9: 32, 10: 52, STATISTICS: 46, 12: 8, 13: 20, SUMMARY_OFFSET: 17, DATA_END: 4}
CODES = frozenset({*_LEAST, *range(_PRIVATE, 256)})
_EXACT = {FOOTER: 20, SUMMARY_OFFSET: 17, DATA_END: 4}
_MOST = 1 << 32  # bytes of a record that is searched for
_WINDOW = 1 << 20
_NEAR = 1 << 13  # damage is mostly small
_TRIES = 200_000  # places looked at; bytes made to look like records must not hold the search up

Read = Callable[[int, int], "bytes | bytearray | memoryview"]  # offset and size -> bytes, fewer at the end


class Record(NamedTuple):
    """Where a record begins and where the next one does (beyond the end for a torn one)."""

    op: int
    at: int
    after: int


def records(read: Read, at: int, end: int, known: Mask) -> Iterator[Record]:
    """Every record from ``at`` to ``end`` that can be believed, and a ``GAP`` for each damaged stretch between them.

    ``known[channel]`` tells which channels messages may be of; only those are searched for. The last record may be torn.
    """
    search = _Search(read, end, known)
    here = _header(read, at, end)
    while at < end:
        following = None
        if here is not None and here.after < end:
            following = _header(read, here.after, end)
        if here is not None and (here.after == end or following is not None):
            yield here
            at, here = here.after, following
            continue
        torn = here is not None and here.after > end
        # Both lengths of a chunk agree; one alone may be wrong.
        resumed = end if torn and here is not None and here.op == CHUNK else search.after(at)
        yield here if torn and here is not None and resumed == end else Record(GAP, at, resumed)
        at, here = resumed, _header(read, resumed, end)


def _header(read: Read, at: int, end: int) -> Record | None:
    """The record that begins here, as far as its own bytes tell; None where they contradict each other."""
    head = read(at, min(_HEAD, end - at))
    if len(head) < RECORD.size:
        return Record(head[0], at, end + 1) if len(head) and head[0] in _LEAST else None
    op, size = RECORD.unpack_from(head)
    if op >= _PRIVATE:
        return Record(op, at, at + RECORD.size + size) if at + RECORD.size + size <= end else None
    if size < _LEAST.get(op, _MOST) or size >= _MOST or size != _EXACT.get(op, size):
        return None
    if op == MESSAGE and size > MESSAGE_LIMIT:
        return None
    if op == MESSAGE_INDEX and len(head) >= 15 and struct.unpack_from("<I", head, 11)[0] != size - 6:
        return None
    if op == CHUNK and len(head) == _HEAD:
        (name,) = struct.unpack_from("<I", head, _COMPRESSION_AT)
        packed = _COMPRESSION_AT + 4 + name
        if name > _LONGEST_NAME or struct.unpack_from("<Q", head, packed)[0] != size + RECORD.size - packed - 8:
            return None
    return Record(op, at, at + RECORD.size + size)


class _Search:
    """Finds where records follow on each other again."""

    def __init__(self, read: Read, end: int, known: Mask) -> None:
        self._read, self._end, self._known, self._tries = read, end, known, _TRIES

    def after(self, at: int) -> int:
        """The first place behind ``at`` where a record begins that another follows; the end if there is none."""
        at, window = at + 1, _NEAR
        while at < self._end and self._tries > 0:
            stop = min(at + window, self._end)
            for place in self._candidates(at, stop):
                self._tries -= 1
                record = _header(self._read, place, self._end)
                if record is None or record.after > self._end:
                    continue
                if record.after == self._end or _header(self._read, record.after, self._end) is not None:
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
