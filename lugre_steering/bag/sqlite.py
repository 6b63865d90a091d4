# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""sqlite3 recordings (rosbag2 .db3), whole or damaged, as columns of raw messages.

The standard library does the reading; rosbags counts every message of every topic before it starts and gives up on
damaged files.
"""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from lugre_steering.bag.messages import Connection, Messages, from_rows
from lugre_steering.bag.sqlite_pages import leaf_rows
from lugre_steering.errors import BagError
from lugre_steering.recording import Finding

MAGIC = b"SQLite format 3\0"
_PIECE_BYTES = 8 << 20
_PIECE_ROWS = 1_000  # twice as fast as 20 000: rows die before the garbage collector looks at them

Row = tuple[Any, ...]


class SqliteFile:
    """One .db3 file. Topics of all files of a bag share the list ``connections``."""

    def __init__(self, path: Path, connections: list[Connection], findings: list[Finding]) -> None:
        self.path, self.connections, self.findings = path, connections, findings
        self._stack = ExitStack()
        try:
            self._open()
        except sqlite3.Error as error:
            self.close()
            raise BagError(f"{path}: not a readable sqlite3 recording ({_text(error)})") from error
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        self._stack.close()

    def _open(self) -> None:
        with self.path.open("rb") as file:
            header = file.read(100)
        if header[: len(MAGIC)] != MAGIC:
            raise BagError(f"{self.path}: not an sqlite3 file (it does not begin with the SQLite magic bytes)")
        page = int.from_bytes(header[16:18], "big")
        page = 65536 if page == 1 else page
        size, expected = self.path.stat().st_size, int.from_bytes(header[28:32], "big") * page
        log = self.path.with_name(self.path.name + "-wal")
        self._opened = self.path
        if log.exists() and log.stat().st_size:  # an interrupted recording: its last messages are in the log
            self._opened = self._temporary() / self.path.name
            shutil.copyfile(self.path, self._opened)
            shutil.copyfile(log, self._opened.with_name(log.name))
        self._db = self._connect(self._opened, "mode=ro&immutable=1" if self._opened == self.path else "mode=rw")
        # Lets SQLite open a file that is shorter than its header says; nothing is ever written to it.
        self._db.execute("PRAGMA writable_schema=ON")
        self._index = self._read_topics()
        if page and size < expected and self._opened == self.path:
            self._salvage(f"cut off after {size} of {expected} bytes", "truncated_bag")

    def _connect(self, path: Path, how: str) -> sqlite3.Connection:
        db = sqlite3.connect(f"{path.resolve().as_uri()}?{how}", uri=True)
        db.text_factory = bytes  # damaged text must not raise
        self._stack.callback(db.close)
        return db

    def _temporary(self) -> Path:
        return Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="lugre_steering_")))

    def _read_topics(self) -> dict[int, int]:
        """Topic number of the file -> index of the connection."""
        columns = {_text(row[1]) for row in self._db.execute("PRAGMA table_info(topics)")}
        if not columns or not self._db.execute("PRAGMA table_info(messages)").fetchall():
            raise BagError(f"{self.path}: an sqlite3 file but not a rosbag2 recording (no tables topics and messages)")
        definitions: dict[str, tuple[str, str]] = {}
        if self._db.execute("PRAGMA table_info(message_definitions)").fetchall():
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            definitions = {_text(row[0]): (_text(row[1]), _text(row[2])) for row in self._db.execute(query)}
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        index: dict[int, int] = {}
        for row in self._db.execute(f"SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id"):
            topic, msgtype, encoding, profiles = map(_text, row[1:])
            definition_format, definition = definitions.get(msgtype, ("", ""))
            connection = Connection(topic, msgtype, encoding, profiles, definition, definition_format)
            if connection not in self.connections:
                self.connections.append(connection)
            index[row[0]] = self.connections.index(connection)
        return index

    def runs(self, wanted: set[int] | None) -> list[tuple[int, Iterator[Messages]]]:
        """(first log time, its messages in log order); ``wanted`` limits them to some connections."""
        topics = [number for number, index in self._index.items() if wanted is None or index in wanted]
        try:
            (begin,) = self._db.execute("SELECT MIN(timestamp) FROM messages").fetchone()
        except sqlite3.DatabaseError:
            begin = 0  # unknown: reading will tell
        return [(begin if isinstance(begin, int) else 0, self._pieces(topics))]

    def _pieces(self, topics: Sequence[int]) -> Iterator[Messages]:
        after: tuple[int, int] | None = None
        while True:
            try:
                cursor = self._select(topics, after)
                size = 100
                while rows := cursor.fetchmany(size):
                    messages = self._columns(rows)
                    size = min(max(_PIECE_BYTES * len(rows) // (len(messages.data) + 1), 1), _PIECE_ROWS)
                    after = (rows[-1][2], rows[-1][0])
                    if len(messages):
                        yield messages
                return
            except sqlite3.DatabaseError as error:  # noqa: PERF203
                self._salvage(f"damaged: {_text(error)}", "damaged_bag")

    def _select(self, topics: Sequence[int], after: tuple[int, int] | None) -> sqlite3.Cursor:
        """Rows in log order, ``after`` some (timestamp, id)."""
        conditions, values = [], list(topics)
        if len(topics) < len(self._index):
            conditions.append(f"topic_id IN ({','.join('?' * len(topics))})")
        else:
            values.clear()
        if after is not None:
            conditions.append("(timestamp, id) > (?, ?)")
            values += after
        where = f"WHERE {' AND '.join(conditions)}" if conditions else ""
        query = f"SELECT id, topic_id, timestamp, data FROM messages {where} ORDER BY timestamp, id"
        return self._db.execute(query, values)

    def _columns(self, rows: list[Row]) -> Messages:
        _, topic, log_ns, data = zip(*rows, strict=True)
        try:
            return from_rows([self._index[number] for number in topic], log_ns, data)
        except (KeyError, TypeError, ValueError, OverflowError):
            sound = [row for row in rows if self._is_message(row)]
            self.findings.append(
                Finding(
                    "damaged_bag",
                    "",
                    f"{self.path.name}: {len(rows) - len(sound)} rows are no messages and are left out",
                )
            )
            return from_rows([self._index[r[1]] for r in sound], [r[2] for r in sound], [r[3] for r in sound])

    def _is_message(self, row: Row) -> bool:
        return row[1] in self._index and isinstance(row[2], int) and isinstance(row[3], bytes)

    def _salvage(self, why: str, finding: str) -> None:
        """Copy every row that can be reached to a new database and read on from that one."""
        copy = sqlite3.connect(self._temporary() / "salvaged.db3", isolation_level=None)
        self._stack.callback(copy.close)
        copy.executescript(
            "PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF;"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB); BEGIN;"
        )
        copy.executemany("INSERT OR IGNORE INTO messages VALUES(?, ?, ?, ?)", self._reachable_rows())
        copy.execute("COMMIT")
        copy.execute("CREATE INDEX timestamp_idx ON messages(timestamp)")
        count, first, last = copy.execute("SELECT COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages").fetchone()
        upto = f" up to t={(last - first) / 1e9:.3f} s" if count else ""
        self._db = copy
        self.findings.append(Finding(finding, "", f"{self.path.name}: {why}; kept {count} messages{upto}"))

    def _reachable_rows(self) -> Iterator[Row]:
        for number, columns in leaf_rows(self._opened):
            row = (number, *columns[1:])
            if len(row) == 4 and self._is_message(row):
                yield row


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
