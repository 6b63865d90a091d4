# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Write rosbag2 folders from columns of serialised messages; equal input gives equal bytes.

rosbags writes 0.16 to 0.26 million messages per second one by one; sorting, framing and indexing whole columns here is
about ten times faster, which keeps a replay from spending most of its time on its output.
"""

from __future__ import annotations

import shutil
import sqlite3
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Literal, Protocol

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import yaml
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from rosbags.rosbag2.metadata import dump_qos_v9, parse_qos
from rosbags.typesys import Stores, TypesysError, get_typestore
from rosbags.typesys.store import Typestore

from lugre_steering.bag import mcap, mcap_records
from lugre_steering.bag.messages import Bytes, Connection, Messages, windows
from lugre_steering.errors import BagError, reason
from lugre_steering.recording import IntArray

VERSION = 9  # of metadata.yaml, ROS 2 Jazzy
_CHUNK_BYTES = 1 << 20
_LEVEL = 3  # of LZ4: a quarter in place of a third of the size, for three times the time; more gains nothing
_TOPICS_LIMIT = (1 << 16) - 1  # MCAP numbers them from 1 with 16 bits


@dataclass(frozen=True)
class Part:
    """n equally long serialised messages: ``rows`` (n, length), of one topic or of one topic each."""

    topic: int | NDArray[np.int32]  # as numbered by BagWriter
    log_ns: IntArray
    rows: Bytes


@lru_cache(maxsize=1)
def stock_types() -> Typestore:
    """The message types of ROS 2 Jazzy, made once."""
    return get_typestore(Stores.ROS2_JAZZY)


def _type_hash(msgtype: str) -> str:
    try:
        return stock_types().hash_rihs01(msgtype)
    except (TypesysError, KeyError):
        return ""  # not a stock type


class _Ordered:
    """Messages of several parts in log order, one after the other in one buffer, ``head`` bytes before each."""

    def __init__(self, parts: Sequence[Part], head: int) -> None:
        count = [len(part.log_ns) for part in parts]
        log_ns = np.concatenate([np.asarray(part.log_ns, np.int64) for part in parts])
        order = np.argsort(log_ns, kind="stable")
        topic = np.concatenate(
            [np.broadcast_to(np.asarray(p.topic, np.int32), n) for p, n in zip(parts, count, strict=True)]
        )
        size = np.repeat([head + part.rows.shape[1] for part in parts], count)
        self.log_ns, self.topic, self.size = log_ns[order], topic[order], size[order]
        self.end = np.cumsum(self.size)
        self.data = np.empty(int(self.end[-1]), np.uint8)
        begin = np.empty(len(order), np.int64)
        begin[order] = self.end - self.size
        for part, first, n in zip(parts, np.cumsum([0, *count]), count, strict=False):
            if n and part.rows.shape[1]:
                target = sliding_window_view(self.data, part.rows.shape[1], writeable=True)
                target[begin[first : first + n] + head] = part.rows


class _Storage(Protocol):
    head: int

    def add_topic(self, number: int, connection: Connection, type_hash: str) -> None: ...
    def write(self, messages: _Ordered) -> None: ...
    def close(self) -> None: ...
    def abort(self) -> None: ...


class BagWriter:
    """Writes one rosbag2 folder with metadata.yaml; use as a context manager, which leaves nothing behind if it fails.

    ``final``: the path that the folder takes when it is whole, if it is another; errors name that.
    """

    def __init__(
        self,
        folder: str | Path,
        storage: Literal["mcap", "sqlite3"] = "mcap",
        custom_data: Mapping[str, str] | None = None,
        *,
        compressed: bool = False,
        final: Path | None = None,
    ) -> None:
        self.folder = Path(folder)
        self._final = final or self.folder
        self._custom_data = dict(custom_data or {})
        self._numbers: dict[Connection, int] = {}
        self._counts: list[int] = []
        self._first_ns, self._last_ns = 2**63 - 1, 0
        self._kind = storage
        try:
            self.folder.mkdir(parents=True)
        except FileExistsError:
            raise BagError(f"{self._final}: exists already; recordings are never overwritten") from None
        except OSError as error:
            raise self._unwritable(error) from error
        try:
            self._file = self.folder / f"{self.folder.name}.{'mcap' if storage == 'mcap' else 'db3'}"
            self._storage: _Storage = _McapStorage(self._file, compressed) if storage == "mcap" else _SqliteStorage(self._file)
        except (OSError, sqlite3.Error) as error:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise self._unwritable(error) from error

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self._discard()

    def _unwritable(self, error: OSError | sqlite3.Error) -> BagError:
        return BagError(f"{self._final}: cannot be written ({reason(error)})")

    def _discard(self) -> None:
        """Half a recording would stand in the way of the next attempt."""
        with suppress(OSError, sqlite3.Error):  # a full disk refuses the rest as well
            self._storage.abort()
        shutil.rmtree(self.folder, ignore_errors=True)

    def add_topic(self, topic: str, msgtype: str) -> int:
        """Announce a topic of a stock type; returns its number."""
        definition, _ = stock_types().generate_msgdef(msgtype, ros_version=2)
        return self.add_connection(Connection(topic, msgtype, definition=definition))

    def add_connection(self, connection: Connection) -> int:
        """Announce a topic as another bag had it, to copy its messages; returns its number."""
        connection = replace(connection, qos=_clear(connection.qos))
        if connection not in self._numbers:
            if len(self._numbers) == _TOPICS_LIMIT:
                raise BagError(f"{self._final}: more than {_TOPICS_LIMIT} topics, which no recording can hold")
            self._numbers[connection] = len(self._numbers)
            self._counts.append(0)
            self._storage.add_topic(len(self._numbers), connection, _type_hash(connection.msgtype))
        return self._numbers[connection]

    def write(self, parts: Sequence[Part]) -> None:
        """Write the messages of one stretch of time, sorted by log time (ties keep the order of the parts)."""
        parts = [part for part in parts if len(part.log_ns)]
        if not parts:
            return
        messages = _Ordered(parts, self._storage.head)
        if messages.log_ns[0] < 0:
            raise BagError(f"{self._final}: log time {messages.log_ns[0]} ns, expected 0 or more (no format holds another)")
        try:
            self._storage.write(messages)
        except (OSError, sqlite3.Error) as error:
            raise self._unwritable(error) from error
        for number, count in enumerate(np.bincount(messages.topic, minlength=len(self._numbers))):
            self._counts[number] += int(count)
        self._first_ns = min(self._first_ns, int(messages.log_ns[0]))
        self._last_ns = max(self._last_ns, int(messages.log_ns[-1]))

    def close(self) -> None:
        """Finish the file and write metadata.yaml."""
        try:
            self._storage.close()
            (self.folder / "metadata.yaml").write_text(self._metadata(), encoding="utf-8")
        except BaseException as error:
            self._discard()
            if isinstance(error, (OSError, sqlite3.Error)):
                raise self._unwritable(error) from error
            raise

    def _metadata(self) -> str:
        count = sum(self._counts)

        def span() -> dict[str, Any]:  # a new one each time: YAML would write a shared one as an anchor
            return {
                "duration": {"nanoseconds": self._last_ns - self._first_ns if count else 0},
                "starting_time": {"nanoseconds_since_epoch": self._first_ns if count else 0},
                "message_count": count,
            }

        topics = [
            {
                "topic_metadata": {
                    "name": c.topic,
                    "type": c.msgtype,
                    "serialization_format": c.encoding,
                    "offered_qos_profiles": dump_qos_v9(parse_qos(c.qos)),
                    "type_description_hash": _type_hash(c.msgtype),
                },
                "message_count": n,
            }
            for c, n in zip(self._numbers, self._counts, strict=True)
        ]
        content = {
            "version": VERSION,
            "storage_identifier": self._kind,
            **span(),
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self._file.name],
            "files": [{"path": self._file.name, **span()}],
            "custom_data": self._custom_data or None,
            "ros_distro": "jazzy",
        }
        return yaml.safe_dump({"rosbag2_bagfile_information": content}, sort_keys=False)


@lru_cache
def _clear(qos: str) -> str:
    """Offered qualities of service as recorded; none where the text says nothing clear, which no reader would open."""
    try:
        parse_qos(qos)
    except Exception:  # flipped bytes may raise anything
        return ""
    return qos


def copied(messages: Messages, topic: NDArray[np.int32]) -> Iterator[Part]:
    """Verbatim messages as parts; ``topic`` maps their connections to the numbers of the writer, -1 drops them."""
    number = topic[messages.connection]
    kept = number >= 0
    for length in np.unique(messages.length[kept]):
        alike = np.flatnonzero(kept & (messages.length == length))
        yield Part(number[alike], messages.log_ns[alike], windows(messages.data, messages.start[alike], int(length)))


_SQLITE_LAYOUT = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL,
  offered_qos_profiles TEXT NOT NULL, type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
  encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
  data BLOB NOT NULL);
INSERT INTO schema VALUES (4, 'jazzy');
"""


class _SqliteStorage:
    """rosbag2's sqlite3 layout, version 4 (Jazzy)."""

    head = 0

    def __init__(self, path: Path) -> None:
        self._db = sqlite3.connect(path, isolation_level=None)
        self._db.executescript(_SQLITE_LAYOUT)
        self._db.execute("BEGIN")
        self._types: set[str] = set()

    def add_topic(self, number: int, connection: Connection, type_hash: str) -> None:
        c = connection
        if c.msgtype not in self._types:
            self._types.add(c.msgtype)
            row = (c.msgtype, c.definition_format, c.definition, type_hash)
            self._db.execute("INSERT INTO message_definitions VALUES(NULL, ?, ?, ?, ?)", row)
        row6 = (number, c.topic, c.msgtype, c.encoding, c.qos, type_hash)
        self._db.execute("INSERT INTO topics VALUES(?, ?, ?, ?, ?, ?)", row6)

    def write(self, messages: _Ordered) -> None:
        data = memoryview(messages.data.data)
        rows = (
            (topic + 1, log_ns, data[end - size : end])
            for topic, log_ns, end, size in zip(
                messages.topic.tolist(),
                messages.log_ns.tolist(),
                messages.end.tolist(),
                messages.size.tolist(),
                strict=True,
            )
        )
        self._db.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", rows)

    def close(self) -> None:
        self._db.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")  # faster than growing it row by row
        self._db.execute("COMMIT")
        self._db.close()

    def abort(self) -> None:
        self._db.close()


def _record(op: int, *content: bytes) -> bytes:
    return mcap_records.RECORD.pack(op, sum(map(len, content))) + b"".join(content)


def _text(text: str) -> bytes:
    raw = text.encode()
    return struct.pack("<I", len(raw)) + raw


class _McapStorage:
    """MCAP with the ros2 profile, chunked, indexed, with checksums; plain (rosbag2's own default) or with chunks packed by LZ4."""

    head = mcap.MESSAGE_HEAD.itemsize

    def __init__(self, path: Path, compressed: bool) -> None:
        self._codec = "lz4" if compressed else ""
        self._file: BinaryIO = path.open("xb")
        self._schemas: dict[str, tuple[int, bytes]] = {}
        self._channels: dict[int, bytes] = {}
        self._counts: dict[int, int] = {}
        self._chunks: list[bytes] = []
        self._span = (2**64 - 1, 0)
        self._file.write(mcap.MAGIC + _record(mcap_records.HEADER, _text("ros2"), _text("lugre_steering")))

    def add_topic(self, number: int, connection: Connection, type_hash: str) -> None:
        c = connection
        if c.msgtype not in self._schemas:
            content = (
                struct.pack("<H", len(self._schemas) + 1)
                + _text(c.msgtype)
                + _text(c.definition_format)
                + _text(c.definition)
            )
            self._schemas[c.msgtype] = len(self._schemas) + 1, _record(mcap_records.SCHEMA, content)
            self._file.write(self._schemas[c.msgtype][1])
        schema, _ = self._schemas[c.msgtype]
        metadata = b"".join(map(_text, ("offered_qos_profiles", c.qos, "topic_type_hash", type_hash)))
        content = struct.pack("<HH", number, schema) + _text(c.topic) + _text(c.encoding)
        self._channels[number] = _record(mcap_records.CHANNEL, content, struct.pack("<I", len(metadata)), metadata)
        self._counts[number] = 0
        self._file.write(self._channels[number])

    def write(self, messages: _Ordered) -> None:
        heads = np.zeros(len(messages.log_ns), mcap.MESSAGE_HEAD)
        heads["op"] = mcap_records.MESSAGE
        heads["size"] = messages.size - mcap_records.RECORD.size
        heads["channel"] = messages.topic + 1
        heads["log"] = heads["publish"] = messages.log_ns
        begin = messages.end - messages.size
        sliding_window_view(messages.data, self.head, writeable=True)[begin] = heads[:, None].view(np.uint8)
        chunk = begin // _CHUNK_BYTES
        for number in np.unique(chunk):
            first, last = np.searchsorted(chunk, [number, number + 1])
            self._write_chunk(
                messages.data[begin[first] : messages.end[last - 1]],
                heads["channel"][first:last],
                messages.log_ns[first:last],
                begin[first:last] - begin[first],
            )

    def _write_chunk(self, data: Bytes, channel: NDArray[np.uint16], log_ns: IntArray, offset: IntArray) -> None:
        first, last = int(log_ns[0]), int(log_ns[-1])
        raw = data.tobytes()
        packed = lz4.frame.compress(raw, compression_level=_LEVEL, block_size=lz4.frame.BLOCKSIZE_MAX1MB) if self._codec else raw
        position = self._file.tell()
        head = struct.pack("<QQQI", first, last, len(raw), zlib.crc32(raw)) + _text(self._codec) + struct.pack("<Q", len(packed))
        length = self._file.write(_record(mcap_records.CHUNK, head, packed))
        index, places = [], []
        at = position + length
        for number in np.unique(channel).tolist():
            of_channel = channel == number
            entries = np.column_stack([log_ns[of_channel], offset[of_channel]]).astype("<i8").tobytes()
            index.append(_record(mcap_records.MESSAGE_INDEX, struct.pack("<HI", number, len(entries)), entries))
            places.append(struct.pack("<HQ", number, at))
            at += len(index[-1])
            self._counts[number] += int(of_channel.sum())
        self._file.write(b"".join(index))
        content = struct.pack("<QQQQI", first, last, position, length, 10 * len(places)) + b"".join(places)
        content += struct.pack("<Q", at - position - length) + _text(self._codec) + struct.pack("<QQ", len(packed), len(raw))
        self._chunks.append(_record(mcap_records.CHUNK_INDEX, content))
        self._span = (min(self._span[0], first), max(self._span[1], last))

    def close(self) -> None:
        self._file.write(_record(mcap_records.DATA_END, struct.pack("<I", 0)))
        total = sum(self._counts.values())
        counts = b"".join(struct.pack("<HQ", *item) for item in self._counts.items())
        statistics = struct.pack(
            "<QHIIIIQQI",
            total,
            len(self._schemas),
            len(self._channels),
            0,  # attachments
            0,  # metadata records
            len(self._chunks),
            *(self._span if total else (0, 0)),
            len(counts),
        )
        groups = {
            mcap_records.SCHEMA: [record for _, record in self._schemas.values()],
            mcap_records.CHANNEL: list(self._channels.values()),
            mcap_records.CHUNK_INDEX: self._chunks,
            mcap_records.STATISTICS: [_record(mcap_records.STATISTICS, statistics, counts)],
        }
        begin = at = self._file.tell()
        summary, offsets = b"", b""
        for op, records in groups.items():
            if group := b"".join(records):
                summary += group
                offsets += _record(mcap_records.SUMMARY_OFFSET, struct.pack("<BQQ", op, at, len(group)))
                at += len(group)
        footer = mcap_records.RECORD.pack(mcap_records.FOOTER, 20) + struct.pack("<QQ", begin, at)
        crc = zlib.crc32(summary + offsets + footer)
        self._file.write(summary + offsets + footer + struct.pack("<I", crc) + mcap.MAGIC)
        self._file.close()

    def abort(self) -> None:
        self._file.close()
