# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""MCAP files, whole or damaged, as columns of raw messages (format: mcap.dev/spec, version 0).

Read here rather than through rosbags because its per-message storage layer alone takes about a third of the time of a
full rosbags deserialisation, which is the whole budget of this reader, and because it refuses files without an end.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lugre_steering.bag.compression import expand
from lugre_steering.bag.messages import Connection, Messages, windows
from lugre_steering.errors import BagError
from lugre_steering.recording import Finding

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, SUMMARY_OFFSET, DATA_END = 11, 14, 15

RECORD = struct.Struct("<BQ")
MESSAGE_HEAD = np.dtype(
    {
        "names": ["op", "size", "channel", "sequence", "log", "publish"],
        "formats": ["u1", "<u8", "<u2", "<u4", "<i8", "<i8"],
        "offsets": [0, 1, 9, 11, 15, 23],
        "itemsize": 31,
    }
)
_CHUNK_HEAD = struct.Struct("<QQQI")
_FOOTER_SIZE = RECORD.size + 20
_PIECE = 1 << 20  # bytes of messages outside chunks that are read at a time


class _Run(NamedTuple):
    """A stretch of the file that is read at once: one chunk record, or consecutive records outside chunks."""

    begin_ns: int
    offset: int
    size: int
    is_chunk: bool
    messages: int | None = None  # how many there are, where the file says
    torn: bool = False


class _DamageError(Exception):
    """Why a chunk cannot be used."""


class _Fields:
    """Reads the fields of one record in order."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def take(self, size: int) -> bytes:
        if self.at + size > len(self.data):
            raise _DamageError("a record ends early")
        self.at += size
        return self.data[self.at - size : self.at]

    def number(self, size: int) -> int:
        return int.from_bytes(self.take(size), "little")

    def blob(self) -> bytes:
        return self.take(self.number(4))

    def text(self) -> str:
        return self.blob().decode("utf-8", "replace")


def _text_map(data: bytes) -> dict[str, str]:
    fields, result = _Fields(data), {}
    while fields.at < len(data):
        key = fields.text()
        result[key] = fields.text()
    return result


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """(op, content) of every whole record."""
    at = 0
    while at + RECORD.size <= len(data):
        op, size = RECORD.unpack_from(data, at)
        at += RECORD.size
        if at + size > len(data):
            return
        yield op, data[at : at + size]
        at += size


class McapFile:
    """One MCAP file. Channels of all files of a bag share the list ``connections``."""

    def __init__(self, path: Path, connections: list[Connection], findings: list[Finding]) -> None:
        self.path, self.connections, self.findings = path, connections, findings
        self._schemas: dict[int, tuple[str, str, str]] = {}
        self._index = np.full(1 << 16, -1, np.int32)  # MCAP channel number -> index of the connection
        self._wanted = self._index
        self._runs: list[_Run] = []
        self._complete = False
        self._file = path.open("rb")
        if self._file.read(len(MAGIC)) != MAGIC:
            self._file.close()
            raise BagError(f"{path}: not an MCAP file (it does not begin with the MCAP magic bytes)")
        if not self._read_summary():
            self._scan()

    def close(self) -> None:
        self._file.close()

    def runs(self, wanted: set[int] | None) -> list[tuple[int, Iterator[Messages]]]:
        """(first log time, its messages) of each stretch; ``wanted`` limits them to some connections."""
        self._wanted = self._index
        if wanted is not None:
            self._wanted = np.where(np.isin(self._index, list(wanted)), self._index, -1)
        return [(run.begin_ns, self._load(run)) for run in self._runs]

    def _load(self, run: _Run) -> Iterator[Messages]:
        raw = self._read(run.offset, run.size)
        try:
            data = self._open_chunk(raw, torn=run.torn) if run.is_chunk else raw
        except _DamageError as damage:
            lost = "" if run.messages is None else f" with {run.messages} messages from t={self._seconds(run):.3f} s on"
            self._report(f"the chunk at byte {run.offset}{lost} is lost: {damage}")
            return
        messages, seen = self._messages(data)
        if run.messages is not None and seen < run.messages:
            self._report(
                f"{run.messages - seen} of {run.messages} messages of the chunk at byte {run.offset} "
                f"from t={self._seconds(run):.3f} s on are lost: its records are damaged"
            )
        if len(messages):
            yield messages

    @property
    def begin_ns(self) -> int:
        """Log time of the first message; 0 for an empty file."""
        return min((run.begin_ns for run in self._runs), default=0)

    def _seconds(self, run: _Run) -> float:
        return (run.begin_ns - self.begin_ns) / 1e9

    def _report(self, statement: str) -> None:
        finding = Finding("damaged_bag", "", f"{self.path.name}: {statement}")
        if finding not in self.findings:  # a bag may be read more than once
            self.findings.append(finding)

    def _read(self, offset: int, size: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(size)

    def _open_chunk(self, record: bytes, *, torn: bool) -> bytes:
        """Uncompressed records of a chunk record, checked; of a ``torn`` one whatever is left."""
        op, size = RECORD.unpack_from(record) if len(record) >= RECORD.size else (0, 0)
        if op != CHUNK or (size != len(record) - RECORD.size and not torn):
            raise _DamageError("its chunk header is overwritten")
        fields = _Fields(record[RECORD.size :])
        _, _, plain_size, crc = _CHUNK_HEAD.unpack(fields.take(_CHUNK_HEAD.size))
        compression = fields.text()
        fields.number(8)
        try:
            data = expand(fields.data[fields.at :], compression)
        except Exception as error:  # whatever a codec raises on damaged bytes
            raise _DamageError(f"its {compression} data are damaged ({error})") from error
        if not torn and len(data) != plain_size:
            raise _DamageError(f"it holds {len(data)} bytes instead of {plain_size}")
        if not torn and crc and zlib.crc32(data) != crc:
            raise _DamageError("its checksum does not match")
        return data

    def _messages(self, data: bytes) -> tuple[Messages, int]:
        """Wanted messages among whole records, in log order, and how many messages of known topics there were."""
        positions: list[int] = []
        at, end = 0, len(data)
        unpack, head = RECORD.unpack_from, RECORD.size
        while at + head <= end:
            op, size = unpack(data, at)
            if at + head + size > end:
                break
            if op == MESSAGE and size >= MESSAGE_HEAD.itemsize - head:
                positions.append(at)
            elif op in (SCHEMA, CHANNEL):
                self._register(op, data[at + head : at + head + size])
            at += head + size
        raw = np.frombuffer(data, np.uint8)
        start = np.array(positions, np.int64)
        heads = (
            windows(raw, start, MESSAGE_HEAD.itemsize).view(MESSAGE_HEAD)[:, 0]
            if positions
            else np.empty(0, MESSAGE_HEAD)
        )
        connection = self._wanted[heads["channel"]]
        order = np.argsort(heads["log"], kind="stable")
        order = order[connection[order] >= 0]
        messages = Messages(
            connection[order],
            heads["log"][order],
            start[order] + MESSAGE_HEAD.itemsize,
            heads["size"][order].astype(np.int64) - (MESSAGE_HEAD.itemsize - head),
            raw,
        )
        return messages, int((self._index[heads["channel"]] >= 0).sum())

    def _register(self, op: int, content: bytes) -> None:
        """Learn a schema or a channel."""
        try:
            fields = _Fields(content)
            number = fields.number(2)
            if op == SCHEMA:
                self._schemas[number] = (fields.text(), fields.text(), fields.text())
            elif self._index[number] < 0:
                msgtype, definition_format, definition = self._schemas.get(fields.number(2), ("", "", ""))
                topic, encoding = fields.text(), fields.text()
                qos = _text_map(fields.blob()).get("offered_qos_profiles", "")
                connection = Connection(topic, msgtype, encoding, qos, definition, definition_format)
                if connection not in self.connections:
                    self.connections.append(connection)
                self._index[number] = self.connections.index(connection)
        except _DamageError as damage:
            self._report(f"a topic cannot be read: {damage}")

    def _read_summary(self) -> bool:
        """Learn topics and chunks from the index at the end; False where it is missing, damaged or incomplete."""
        end = self._file.seek(0, 2)
        tail = self._read(max(end - _FOOTER_SIZE - len(MAGIC), 0), _FOOTER_SIZE + len(MAGIC))
        if len(tail) < _FOOTER_SIZE + len(MAGIC) or tail[-len(MAGIC) :] != MAGIC or tail[:9] != RECORD.pack(FOOTER, 20):
            return False
        begin, _, crc = struct.unpack_from("<QQI", tail, RECORD.size)
        footer = end - len(MAGIC) - _FOOTER_SIZE
        if not len(MAGIC) < begin <= footer:
            return False
        summary = self._read(begin, footer - begin)
        if crc and zlib.crc32(summary + tail[: RECORD.size + 16]) != crc:
            return False
        chunks, channels, total = [], 0, None
        try:
            for op, content in _records(summary):
                if op in (SCHEMA, CHANNEL):
                    self._register(op, content)
                    channels += op == CHANNEL
                elif op == CHUNK_INDEX:
                    fields = _Fields(content)
                    first, _, offset, size = (fields.number(8) for _ in range(4))
                    entries = len(fields.blob()) // 10
                    # A message index record is 15 bytes and 16 more per message.
                    if offset + size > begin:
                        return False
                    count = (fields.number(8) - 15 * entries) // 16 if entries else None
                    chunks.append(_Run(first, offset, size, True, count))
                elif op == STATISTICS:
                    total = _Fields(content).number(8)
        except _DamageError:
            return False
        if not chunks or not channels:
            return total == 0 and not chunks
        counts = [run.messages for run in chunks]
        if total is not None and None not in counts and sum(c for c in counts if c is not None) != total:
            return False  # messages outside chunks, or a damaged index
        self._runs = chunks
        return True

    def _scan(self) -> None:
        """Learn topics and stretches from the records themselves, as far as they go."""
        total, last_ns = 0, 0
        for run in self._stretches():
            for messages in self._load(run):
                self._runs.append(run._replace(begin_ns=int(messages.log_ns[0])))
                total, last_ns = total + len(messages), max(last_ns, int(messages.log_ns[-1]))
        if not self._complete:
            upto = f" up to t={(last_ns - self.begin_ns) / 1e9:.3f} s" if total else ""
            statement = (
                f"{self.path.name}: cut off or damaged at byte {self._file.seek(0, 1)}; kept {total} messages{upto}"
            )
            self.findings.append(Finding("truncated_bag", "", statement))

    def _stretches(self) -> Iterator[_Run]:
        """Chunks and pieces outside chunks, in file order; the last one may be torn."""
        at = loose = len(MAGIC)
        end = self._file.seek(0, 2)
        while at + RECORD.size <= end:
            op, size = RECORD.unpack(self._read(at, RECORD.size))
            if op in (0, DATA_END, FOOTER):
                self._complete = op != 0 and self._read(end - len(MAGIC), len(MAGIC)) == MAGIC
                break
            after = at + RECORD.size + size
            if (op == CHUNK or after > end or at - loose > _PIECE) and at > loose:
                yield _Run(0, loose, at - loose, False)
                loose = at
            if op == CHUNK:
                yield _Run(0, at, min(after, end) - at, True, torn=after > end)
                loose = after
            if after > end:
                return
            at = after
        if at > loose:
            yield _Run(0, loose, at - loose, False)
