# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Rows of an sqlite3 file straight from its pages, for files that SQLite itself gives up on.

SQLite finds rows through a tree whose inner pages may lie beyond the point where a file was cut off, so it often
reaches nothing. The leaf pages describe themselves: every whole one still gives its rows (sqlite.org/fileformat2).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from lugre_steering.bag.compression import MESSAGE_LIMIT

_TABLE_LEAF = 0x0D
_LONGEST = MESSAGE_LIMIT + 100  # bytes of a row
_INTEGER_BYTES = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}

Value = int | bytes | None


def leaf_rows(path: Path) -> Iterator[tuple[int, list[Value]]]:
    """(row number, columns) of every row of every table that can be read; a float or a damaged column ends it."""
    used = bytearray(path.stat().st_size // 512 // 8 + 1)  # overflow pages, a bit each: none belongs to two rows
    with path.open("rb") as file:
        header = file.read(100)
        size = int.from_bytes(header[16:18], "big")
        size = 65536 if size == 1 else size
        usable = size - header[20]
        if size < 512 or size & (size - 1) or usable < 480:
            return
        number = 1  # the first page holds the file header and only describes the tables
        while True:
            file.seek(number * size)
            page = file.read(size)
            if len(page) < size:
                return
            if page[0] == _TABLE_LEAF:
                yield from _rows_of_page(page, file, size, usable, used)
            number += 1


def _rows_of_page(
    page: bytes, file: BinaryIO, size: int, usable: int, used: bytearray
) -> Iterator[tuple[int, list[Value]]]:
    cells = int.from_bytes(page[3:5], "big")
    for i in range(min(cells, (usable - 8) // 2)):
        at = int.from_bytes(page[8 + 2 * i : 10 + 2 * i], "big")
        length, at = _varint(page, at)
        row, at = _varint(page, at)
        payload = _payload(page, at, length, file, size, usable, used)
        if payload is not None:
            yield row - (row >> 63 << 64), _columns(payload)  # row numbers may be negative


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """(value, end) of SQLite's variable-length big-endian integer; zeros beyond the end of damaged data."""
    value = 0
    for i in range(8):
        byte = data[at + i] if at + i < len(data) else 0
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, at + i + 1
    byte = data[at + 8] if at + 8 < len(data) else 0
    return value << 8 | byte, at + 9


def _payload(
    page: bytes, at: int, length: int, file: BinaryIO, size: int, usable: int, used: bytearray
) -> bytes | None:
    """The whole content of a row, following its overflow pages; None where a part of it is missing."""
    if length > _LONGEST:
        return None
    if length <= usable - 35:
        return page[at : at + length] if at + length <= usable else None
    least = (usable - 12) * 32 // 255 - 23
    local = least + (length - least) % (usable - 4)
    local = local if local <= usable - 35 else least
    if at + local + 4 > usable:
        return None
    parts, missing = [page[at : at + local]], length - local
    following = int.from_bytes(page[at + local : at + local + 4], "big")
    while missing > 0:
        file.seek((following - 1) * size if following else 0)
        overflow = file.read(size)
        byte, bit = divmod(following, 8)
        if not following or len(overflow) < size or used[byte] >> bit & 1:
            return None
        used[byte] |= 1 << bit
        following = int.from_bytes(overflow[:4], "big")
        parts.append(overflow[4 : 4 + min(missing, usable - 4)])
        missing -= usable - 4
    return b"".join(parts)


def _columns(payload: bytes) -> list[Value]:
    end, at = _varint(payload, 0)
    body = end
    columns: list[Value] = []
    while at < end <= len(payload):
        kind, at = _varint(payload, at)
        if kind in _INTEGER_BYTES:
            width = _INTEGER_BYTES[kind]
            columns.append(int.from_bytes(payload[body : body + width], "big", signed=True))
        elif kind >= 12:
            width = (kind - 12) // 2
            columns.append(payload[body : body + width])
        elif kind in (0, 8, 9):
            width = 0
            columns.append(None if kind == 0 else kind - 8)
        else:
            break
        body += width
        if body > len(payload):
            columns.pop()
            break
    return columns
