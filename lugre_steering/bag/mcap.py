# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""MCAP files, whole or damaged, as columns of raw messages (format: mcap.dev/spec, version 0).

Read here rather than through rosbags because its per-message storage layer alone takes about a third of the time of a
full rosbags deserialisation, which is the whole budget of this reader, and because it refuses files without an end.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lugre_steering.bag.compression import CHUNK_LIMIT, Allowance, TooLargeError, expand
from lugre_steering.bag.mcap_records import (
    CHANNEL,
    CHUNK,
    CHUNK_HEAD,
    CHUNK_INDEX,
    FOOTER,
    GAP,
    MESSAGE,
    RECORD,
    SCHEMA,
    STATISTICS,
    Data,
    Record,
    fills,
    records,
)
from lugre_steering.bag.mcap_walk import LEAST_BYTES, walk
from lugre_steering.bag.messages import Connection, Messages, windows
from lugre_steering.counted import counted
from lugre_steering.errors import BagError
from lugre_steering.recording import Finding, IntArray

MAGIC = b"\x89MCAP0\r\n"
MESSAGE_HEAD = np.dtype(
    {
        "names": ["op", "size", "channel", "sequence", "log", "publish"],
        "formats": ["u1", "<u8", "<u2", "<u4", "<i8", "<i8"],
        "offsets": [0, 1, 9, 11, 15, 23],
        "itemsize": 31,
    }
)
_FOOTER_SIZE = RECORD.size + 20
_PIECE = 1 << 20  # bytes of messages outside chunks that are read at a time
_KEPT = 1 << 16  # bytes
_SUMMARY_LIMIT = 256 << 20  # bytes; one of a recording of 100 GB has some 50 MB
_TOPICS_LIMIT = 64 << 20  # bytes of all definitions and descriptions of topics
_MOST_REPORTED = 30  # findings of one file
_NO_HEADS, _NO_STARTS = np.empty(0, MESSAGE_HEAD), np.empty(0, np.int64)


class _Run(NamedTuple):
    """A stretch of the file that is read at once: one chunk record, or consecutive records outside chunks."""

    begin_ns: int
    offset: int
    size: int
    is_chunk: bool
    messages: int | None = None  # how many there are, where the file says
    torn: bool = False


class _DamageError(Exception):
    """Why a chunk cannot be used as it is, and the bytes in which some of its records may still be found.

    Where nothing tells which of them are hurt (not ``located``), they count only if damage is found between them.
    """

    def __init__(self, reason: str, remains: Data = b"", *, located: bool = True) -> None:
        super().__init__(reason)
        self.remains, self.located = remains, located


class _Fields:
    """Reads the fields of one record in order."""

    def __init__(self, data: Data) -> None:
        self.data, self.at = data, 0

    def take(self, size: int) -> Data:
        if self.at + size > len(self.data):
            raise _DamageError("a record ends early")
        self.at += size
        return self.data[self.at - size : self.at]

    def number(self, size: int) -> int:
        return int.from_bytes(self.take(size), "little")

    def blob(self) -> Data:
        return self.take(self.number(4))

    def text(self) -> str:
        return str(self.blob(), "utf-8", "replace")


def _text_map(data: Data) -> dict[str, str]:
    fields, result = _Fields(data), {}
    while fields.at < len(data):
        key = fields.text()
        result[key] = fields.text()
    return result


def _contents(data: bytes) -> Iterator[tuple[int, bytes]]:
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
    """One MCAP file; ``number`` gives the index of a topic among those of all files of the bag."""

    def __init__(
        self, path: Path, number: Callable[[Connection], int], findings: list[Finding], *, packed: int = 0
    ) -> None:
        """``packed``: bytes of the compressed file that this one comes from, where it does."""
        self.path, self._number, self.findings = path, number, findings
        self._unpacked = packed > 0  # from a compressed file, where damage has no edges
        self._schemas: dict[int, tuple[str, str, str]] = {}
        self._index = np.full(1 << 16, -1, np.int32)  # MCAP channel number -> index of the connection
        self._known = np.zeros(1 << 16, np.bool_)
        self._wanted = self._index
        self._runs: list[_Run] = []
        self._gaps: list[Record] = []
        self._cut: int | None = None  # where a file without its proper end stops making sense
        self._promised: int | None = None  # messages, as the file says
        self._kept, self._kept_at = b"", 0
        self._reported: set[str] = set()
        self._learned = 0  # bytes of topics and schemas
        self._file = path.open("rb")
        self._size = path.stat().st_size
        self._recorded = packed / self._size if packed else 1.0  # of each byte
        self._allowance = Allowance()
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
        self._allowance = Allowance()
        # Not generators: one that is suspended would hold on to what it has given.
        return [(run.begin_ns, filter(len, map(self._load, (run,)))) for run in self._runs]

    def _load(self, run: _Run) -> Messages:
        self._allowance.earn(int(run.size * self._recorded))
        reason, whole, believed = "its records are damaged", True, True
        try:
            data = self._open_chunk(run) if run.is_chunk else self._read(run.offset, run.size)
        except _DamageError as damage:
            reason, whole, believed, data = str(damage), False, damage.located, damage.remains
        try:
            starts, broken = self._find(data, torn=run.torn, in_chunk=run.is_chunk)
            self._allowance.spend_messages(len(starts))
        except TooLargeError as error:
            reason, starts, broken, whole = str(error), _NO_STARTS, False, False
        if not believed and not broken:
            starts = _NO_STARTS
        messages, foreign = self._messages(data, starts)
        seen = len(starts)
        where = f"the chunk at byte {run.offset}" if run.is_chunk else f"the records from byte {run.offset} on"
        since = "" if run.messages is None else f" from t={self._seconds(run):.3f} s on"
        if run.messages is not None and seen < run.messages:
            lost = f"{run.messages - seen} of {run.messages} messages of {where}{since} are lost: {reason}"
            self._report(lost)
        elif not whole or broken:
            kept = f"; {counted(seen, 'message')} that can still be told apart kept" if seen else ""
            self._report(f"{where} cannot be read in full: {reason}{kept}")
        if foreign:
            self._report(f"{counted(foreign, 'message')} of {where} left out: topic or log time damaged or missing")
        return messages

    @property
    def begin_ns(self) -> int:
        """Log time of the first message; 0 for an empty file."""
        return min((run.begin_ns for run in self._runs), default=0)

    def _seconds(self, run: _Run) -> float:
        return (run.begin_ns - self.begin_ns) / 1e9

    def _report(self, statement: str) -> None:
        if statement not in self._reported:  # a bag may be read more than once
            self._reported.add(statement)
            if len(self._reported) == _MOST_REPORTED:
                statement = "there is more damage like this"
            if len(self._reported) <= _MOST_REPORTED:
                self.findings.append(Finding("damaged_bag", "", f"{self.path.name}: {statement}"))

    def _read(self, offset: int, size: int) -> bytes:
        self._file.seek(offset)
        return self._file.read(size)

    def _open_chunk(self, run: _Run) -> Data:
        """Uncompressed records of a chunk record, checked; of a torn one whatever is left."""
        if run.size > CHUNK_LIMIT:
            raise _DamageError(f"it has {run.size >> 20} MB, more than the {CHUNK_LIMIT >> 20} MB that are read at once")
        record = memoryview(self._read(run.offset, run.size))
        op, size = RECORD.unpack_from(record) if len(record) >= RECORD.size else (GAP, 0)
        if op != CHUNK or (size != len(record) - RECORD.size and not run.torn):
            raise _DamageError("its chunk header is overwritten", record)
        fields = _Fields(record[RECORD.size :])
        _, _, plain_size, crc = CHUNK_HEAD.unpack(fields.take(CHUNK_HEAD.size))
        compression = fields.text()
        fields.number(8)
        data: Data = fields.data[fields.at :]
        if compression:
            if plain_size > CHUNK_LIMIT:
                raise _DamageError(f"it says to unpack to {plain_size >> 20} MB, expected at most {CHUNK_LIMIT >> 20}")
            try:
                unpacked, damage = expand(data, compression, plain_size, self._allowance)
            except TooLargeError as error:
                raise _DamageError(f"its {compression} data are no recording ({error})") from error
            if damage and not run.torn:
                raise _DamageError(f"its {compression} data are damaged ({damage})", unpacked)
            data = unpacked
        # Of what damaged data unpack to, nothing can be believed.
        remains = b"" if compression or self._unpacked else data
        if not run.torn and len(data) != plain_size:
            raise _DamageError(f"it holds {len(data)} bytes instead of {plain_size}", remains, located=False)
        if not run.torn and crc and zlib.crc32(data) != crc:
            raise _DamageError("its checksum does not match", remains, located=False)
        return data

    def _find(self, data: Data, *, torn: bool, in_chunk: bool) -> tuple[IntArray, bool]:
        """Where the messages begin, and whether there is damage between them. Learns topics on the way.

        In unpacked ``data`` (a bytearray) nothing behind the damage is worth a search.
        """
        raw, at, end, head = np.frombuffer(data, np.uint8), 0, len(data), RECORD.size
        raw.flags.writeable = False  # of one type for the compiler, whatever holds the data
        most, count = self._allowance.chunk_messages + 1, 0
        starts = np.empty(min(most, end // LEAST_BYTES), np.int64)

        def read(at: int, size: int) -> Data:
            return data[at : at + size]

        for _ in range(most):
            count, at = walk(raw, at, starts, count)
            if count == most:
                self._allowance.spend_messages(most)
            if at + head > end:
                break
            op, size = RECORD.unpack_from(data, at)
            after = at + head + size
            if after > end or op not in (SCHEMA, CHANNEL) or not fills(read, at, after, end):
                break
            self._register(op, data[at + head : after])
            at = after
        else:
            self._allowance.spend_messages(count + 1)
        starts = starts[:count]
        if at == end:
            return starts, False
        if isinstance(data, bytearray):
            return starts if torn else starts[:-1], not torn
        found, broken = array("q"), False
        for record in records(read, 0, end, self._known, in_chunk=in_chunk):
            broken |= record.op == GAP or (record.after > end and not torn)
            if record.op == MESSAGE and record.after <= end:
                found.append(record.at)
            elif record.op in (SCHEMA, CHANNEL):
                self._register(record.op, data[record.at + head : record.after])
        return np.array(found, np.int64), broken

    def _messages(self, data: Data, start: IntArray) -> tuple[Messages, int]:
        """Wanted messages in log order, and how many have no known topic or no possible log time."""
        raw = np.frombuffer(data, np.uint8)
        heads = windows(raw, start, MESSAGE_HEAD.itemsize).view(MESSAGE_HEAD)[:, 0] if start.size else _NO_HEADS
        connection = self._wanted[heads["channel"]]
        possible = heads["log"] >= 0  # a larger one than 2**63 is negative here
        order = np.argsort(heads["log"], kind="stable")
        order = order[(connection[order] >= 0) & possible[order]]
        messages = Messages(
            connection[order],
            heads["log"][order],
            start[order] + MESSAGE_HEAD.itemsize,
            heads["size"][order].astype(np.int64) - (MESSAGE_HEAD.itemsize - RECORD.size),
            raw,
        )
        return messages, int((~self._known[heads["channel"]] | ~possible).sum())

    def _register(self, op: int, content: Data) -> None:
        """Learn a schema or a channel."""
        try:
            fields = _Fields(content)
            number = fields.number(2)
            if self._known[number] if op == CHANNEL else number in self._schemas:
                return
            self._learned += len(content)
            if self._learned > _TOPICS_LIMIT:
                raise _DamageError(f"all descriptions together have more than {_TOPICS_LIMIT >> 20} MB")
            if op == SCHEMA:
                self._schemas[number] = (fields.text(), fields.text(), fields.text())
                return
            msgtype, definition_format, definition = self._schemas.get(fields.number(2), ("", "", ""))
            topic, encoding = fields.text(), fields.text()
            qos = _text_map(fields.blob()).get("offered_qos_profiles", "")
            self._index[number] = self._number(Connection(topic, msgtype, encoding, qos, definition, definition_format))
            self._known[number] = True
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
        if not len(MAGIC) < begin <= footer or footer - begin > _SUMMARY_LIMIT:
            return False
        summary = self._read(begin, footer - begin)
        if crc and zlib.crc32(summary + tail[: RECORD.size + 16]) != crc:
            return False
        chunks, channels, total = [], 0, None
        try:
            for op, content in _contents(summary):
                if op in (SCHEMA, CHANNEL):
                    self._register(op, content)
                    channels += op == CHANNEL
                elif op == CHUNK_INDEX:
                    fields = _Fields(content)
                    first, _, offset, size = (fields.number(8) for _ in range(4))
                    entries = len(fields.blob()) // 10
                    # A message index record is 15 bytes and 16 more per message.
                    count = (fields.number(8) - 15 * entries) // 16 if entries else None
                    chunks.append(_Run(first, offset, size, True, count))
                elif op == STATISTICS:
                    total = _Fields(content).number(8)
        except _DamageError:
            return False
        if not chunks or not channels:
            return total == 0 and not chunks
        chunks.sort(key=lambda run: run.offset)
        following = [*(run.offset for run in chunks[1:]), begin]
        if chunks[0].offset < len(MAGIC) or any(r.offset + r.size > n for r, n in zip(chunks, following, strict=True)):
            return False  # one chunk given many times would be unpacked as often
        counts = [run.messages for run in chunks]
        if total is not None and None not in counts and sum(c for c in counts if c is not None) != total:
            return False  # messages outside chunks, or a damaged index
        self._runs = chunks
        return True

    def _scan(self) -> None:
        """Learn topics and stretches from the records themselves, beyond damage and as far as they go."""
        total, last_ns = 0, 0
        for run in self._stretches():
            if len(messages := self._load(run)):
                self._runs.append(run._replace(begin_ns=int(messages.log_ns[0])))
                total, last_ns = total + len(messages), max(last_ns, int(messages.log_ns[-1]))
        upto = f"; kept {counted(total, 'message')}" + (f" up to t={(last_ns - self.begin_ns) / 1e9:.3f} s" if total else "")
        if self._gaps:
            lost = sum(gap.after - gap.at for gap in self._gaps)
            places = "" if len(self._gaps) == 1 else f" in {len(self._gaps)} places"
            self._report(f"{lost} bytes from byte {self._gaps[0].at} on{places} are damaged and left out{upto}")
        if self._cut is not None:
            statement = f"{self.path.name}: cut off or damaged at byte {self._cut}{upto}"
            self.findings.append(Finding("truncated_bag", "", statement))
        if self._promised is not None and self._promised != total and not self._gaps:
            self._report(f"its statistics promise {self._promised} messages, {total} could be read")

    def _stretches(self) -> Iterator[_Run]:
        """Chunks and pieces outside chunks, in file order; the last one may be torn."""
        end = self._size
        if self._read(max(end - len(MAGIC), 0), len(MAGIC)) == MAGIC:
            end -= len(MAGIC)
        else:
            self._cut = end
        yield from self._between(len(MAGIC), end)

    def _between(self, begin: int, end: int) -> Iterator[_Run]:
        loose = begin
        for op, at, after in records(self._window, begin, end, self._known):
            whole = after <= end
            apart = op in (CHUNK, GAP) or not whole or (op != MESSAGE and after - at > _PIECE)
            if (apart or after - loose > _PIECE) and at > loose:
                yield _Run(0, loose, at - loose, False)
                loose = at
            if apart:
                loose = after
            if not whole or (op == GAP and after == end):
                self._cut = at
            elif op == GAP:
                self._gaps.append(Record(op, at, after))
            if op == CHUNK and after - at > CHUNK_LIMIT and (inside := self._plain_chunk(at)):
                yield from self._between(inside, min(after, end))
            elif op == CHUNK:
                yield _Run(0, at, min(after, end) - at, True, torn=not whole)
            elif op in (SCHEMA, CHANNEL) and whole:
                self._register(op, self._window(at, after - at)[RECORD.size :])
            elif op == STATISTICS and whole:
                self._promised = _Fields(self._window(at, after - at)[RECORD.size :]).number(8)
        if end > loose:
            yield _Run(0, loose, end - loose, False)

    def _plain_chunk(self, at: int) -> int:
        """Where the records of an uncompressed chunk begin; 0 for a compressed one."""
        begin = at + RECORD.size + CHUNK_HEAD.size
        return 0 if any(self._read(begin, 4)) else begin + 12

    def _window(self, offset: int, size: int) -> bytes:
        """Bytes of the file out of a stretch that is kept, for many small reads one after the other."""
        at = offset - self._kept_at
        if at < 0 or at + size > len(self._kept):
            at, self._kept_at, self._kept = 0, offset, self._read(offset, max(size, _KEPT))
        return self._kept[at : at + size]
