# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""sqlite3 recordings (rosbag2 .db3), whole or damaged, as columns of raw messages.

The standard library does the reading; rosbags counts every message of every topic before it starts and gives up on
damaged files.

A file is not trusted: only its two tables are read, as tables and not as views or computed columns, in no more steps
than its bytes could need; and whatever SQLite would have to write happens in a private copy.
"""

from __future__ import annotations

import os
import shutil
import sqlite3
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from lugre_steering.bag.compression import MESSAGE_LIMIT
from lugre_steering.bag.messages import Connection, Messages, from_rows
from lugre_steering.bag.sqlite_pages import leaf_rows
from lugre_steering.counted import counted
from lugre_steering.errors import BagError
from lugre_steering.recording import Finding

MAGIC = b"SQLite format 3\0"
_JOURNAL_MAGIC = b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7"  # begins a journal, and ends one that names another file
_STEPS, _STEPS_PER_BYTE = 10_000_000, 4  # of SQLite's machine for one query; a message takes some 15 and 60 bytes
_STEPS_APART = 100_000
_TEXT_LIMIT = 64 << 20  # bytes of all names, types and definitions
_INDEX = "timestamp_idx"  # as rosbag2 names it
_PIECE_BYTES = 8 << 20
_PIECE_ROWS = 1_000  # twice as fast as 20 000: rows die before the garbage collector looks at them

Row = tuple[Any, ...]


class SqliteFile:
    """One .db3 file; ``number`` gives the index of a topic among those of all files of the bag."""

    def __init__(self, path: Path, number: Callable[[Connection], int], findings: list[Finding]) -> None:
        self.path, self._number, self.findings = path, number, findings
        self._salvaged = self._checked = False
        self._order = "NOT INDEXED"  # how rows are found
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
        expected = int.from_bytes(header[28:32], "big") * page
        self._opened = self._recovered() or self.path
        size = self._opened.stat().st_size
        self._most_steps = _STEPS + _STEPS_PER_BYTE * size
        self._db = self._connect(self._opened, "mode=ro&immutable=1" if self._opened == self.path else "mode=rw")
        # Lets SQLite open a file that is shorter than its header says; nothing is ever written to it.
        self._db.execute("PRAGMA writable_schema=ON")
        self._index = self._read_topics()
        if any(_text(row[1]) == _INDEX for row in self._execute("PRAGMA index_list(messages)")):
            self._order = f"INDEXED BY {_INDEX}"
        if page and size < expected and self._opened == self.path:
            self._salvage(f"cut off after {size} of {expected} bytes", "truncated_bag")

    def _recovered(self) -> Path | None:
        """A private copy with what an interrupted recording left beside the file; None where there is nothing."""
        beside = [self.path.with_name(self.path.name + ending) for ending in ("-wal", "-journal")]
        beside = [file for file in beside if os.path.isfile(file) and file.stat().st_size and _is_log(file)]
        if not beside:
            return None
        copy = self._temporary() / self.path.name
        for file in (self.path, *beside):
            shutil.copyfile(file, copy.with_name(file.name))
        journal = copy.with_name(f"{copy.name}-journal")
        if journal.exists():
            with journal.open("r+b") as stream:  # SQLite would follow the name at its end, and delete that file
                stream.seek(-min(len(_JOURNAL_MAGIC), journal.stat().st_size), os.SEEK_END)
                stream.write(bytes(len(_JOURNAL_MAGIC)))
        most = sum(file.stat().st_size for file in (self.path, *beside))
        names = " and ".join(file.name for file in beside)
        try:
            db = sqlite3.connect(copy)
            db.execute("SELECT COUNT(*) FROM sqlite_master").fetchall()
            db.close()
            if copy.stat().st_size > most:
                raise sqlite3.DatabaseError("it makes the file larger than both together")
        except sqlite3.Error as error:
            statement = f"{names} beside {self.path.name} cannot be used ({_text(error)}); read without"
            self.findings.append(Finding("damaged_bag", "", statement))
            return None
        statement = f"{self.path.name}: an interrupted recording, completed from {names} in a private copy"
        self.findings.append(Finding("interrupted_recording", "", statement))
        return copy

    def _connect(self, path: Path, how: str) -> sqlite3.Connection:
        db = sqlite3.connect(f"{path.resolve().as_uri()}?{how}", uri=True)
        self._stack.callback(db.close)
        db.text_factory = bytes  # damaged text must not raise
        db.executescript("PRAGMA trusted_schema=OFF; PRAGMA cell_size_check=ON; PRAGMA query_only=ON;")
        if sys.version_info >= (3, 11):
            db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _TEXT_LIMIT + MESSAGE_LIMIT)
        db.set_authorizer(_authorise)
        db.set_progress_handler(self._count_steps, _STEPS_APART)
        return db

    def _count_steps(self) -> bool:
        """Stops a query that takes more steps than a file of this size can need."""
        self._steps += _STEPS_APART
        return self._steps > self._most_steps

    def _execute(self, query: str, values: Sequence[object] = ()) -> sqlite3.Cursor:
        self._steps = 0
        return self._db.execute(query, values)

    def _temporary(self) -> Path:
        return Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="lugre_steering_")))

    def _columns_of(self, table: str) -> set[str]:
        """Stored columns: views have other names here, computed columns none."""
        return {_text(row[1]) for row in self._execute(f"PRAGMA table_info({table})")}

    def _read_topics(self) -> dict[int, int]:
        """Topic number of the file -> index of the connection."""
        columns = self._columns_of("topics")
        missing = {"id", "name", "type", "serialization_format"} - columns
        missing |= {"id", "topic_id", "timestamp", "data"} - self._columns_of("messages")
        if missing:
            raise BagError(
                f"{self.path}: an sqlite3 file but not a rosbag2 recording "
                f"(no tables topics and messages with {', '.join(sorted(missing))})"
            )
        definitions: dict[str, tuple[str, str]] = {}
        if {"topic_type", "encoding", "encoded_message_definition"} <= self._columns_of("message_definitions"):
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            definitions = {row[0]: (row[1], row[2]) for row in self._texts(query, 0)}
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        index: dict[int, int] = {}
        for number, topic, msgtype, encoding, profiles in self._texts(
            f"SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id", 1
        ):
            definition_format, definition = definitions.get(msgtype, ("", ""))
            index[number] = self._number(Connection(topic, msgtype, encoding, profiles, definition, definition_format))
        return index

    def _texts(self, query: str, first: int) -> Iterator[Row]:
        """Rows whose columns from ``first`` on are text."""
        size = 0
        for row in self._execute(query):
            texts = [_text(column) for column in row[first:]]
            size += sum(map(len, texts))
            if size > _TEXT_LIMIT:
                raise BagError(f"{self.path}: more than {_TEXT_LIMIT >> 20} MB describe its topics")
            yield (*row[:first], *texts)

    def runs(self, wanted: set[int] | None) -> list[tuple[int, Iterator[Messages]]]:
        """(first log time, its messages in log order); ``wanted`` limits them to some connections."""
        numbers = [number for number, index in self._index.items() if wanted is None or index in wanted]
        self._check()
        try:
            (begin,) = self._execute("SELECT MIN(timestamp) FROM messages").fetchone()
        except sqlite3.DatabaseError:
            begin = 0  # unknown: reading will tell
        return [(begin if isinstance(begin, int) else 0, self._pieces(numbers))]

    def _check(self) -> None:
        """Salvage what SQLite would leave out without an error: a damaged page of the tree hides those below it.

        Rows are found by their log time in an index, so it has to lead to the rows that the table has: a sum over both tells, in half
        the time of SQLite's own comparison.
        """
        if self._checked or self._salvaged:
            return
        self._checked = True
        try:
            if self._order == "NOT INDEXED":
                (faults,) = self._execute("PRAGMA quick_check(1)").fetchone()
                statement = "" if faults == b"ok" else _text(faults).removeprefix("*** in database main ***\n")
            else:
                # COUNT(*) would go through a tree whose branches meet again without counting steps.
                query = "SELECT COUNT(1), SUM(timestamp % 65521 * (id & 65535)) FROM messages "
                held, found = (self._execute(query + how).fetchone() for how in ("NOT INDEXED", self._order))
                statement = "" if held == found else "its index leads to other rows than its table has"
                if held[0] != found[0]:
                    statement = f"{found[0]} of {held[0]} rows can be found by their log time"
        except sqlite3.DatabaseError as error:
            statement = _text(error)
        if statement:
            self._salvage(f"damaged: {statement}", "damaged_bag")

    def _pieces(self, numbers: Sequence[int]) -> Iterator[Messages]:
        after: tuple[int, int] | None = None
        self._left_out = 0
        while True:
            try:
                cursor = self._select(numbers, after)
                size = 100
                while rows := cursor.fetchmany(size):
                    messages = self._columns(rows)
                    size = min(max(_PIECE_BYTES * len(rows) // (len(messages.data) + 1), 1), _PIECE_ROWS)
                    after = (rows[-1][2], rows[-1][0])
                    if len(messages):
                        yield messages
                break
            except sqlite3.DatabaseError as error:
                if self._salvaged:
                    raise
                self._salvage(f"damaged: {_text(error)}", "damaged_bag")

        if self._left_out:
            statement = f"{counted(self._left_out, 'row is no message', 'rows are no messages')} (topic, log time or content), left out"
            finding = Finding("damaged_bag", "", f"{self.path.name}: {statement}")
            if finding not in self.findings:  # a bag may be read more than once
                self.findings.append(finding)

    def _select(self, numbers: Sequence[int], after: tuple[int, int] | None) -> sqlite3.Cursor:
        """Rows of some topics in log order, ``after`` some (timestamp, id); without content that is larger than any message.

        Rows of topics that are not known come as well, to be told.
        """
        conditions: list[str] = []
        known = sorted(self._index)
        if len(numbers) < len(known):
            gaps = known[-1] - known[0] >= len(known)  # a range takes half the time of a list
            others = f"NOT IN ({_listed(known)})" if gaps else f"NOT BETWEEN {known[0]} AND {known[-1]}"
            conditions.append(f"(topic_id IN ({_listed(numbers)}) OR topic_id {others})")
        if after is not None:
            conditions.append("(timestamp, id) > (?, ?)")
        where = f"WHERE {' AND '.join(conditions)}" if conditions else ""
        data = f"CASE WHEN typeof(data) = 'blob' AND length(data) <= {MESSAGE_LIMIT} THEN data END"
        query = f"SELECT id, topic_id, timestamp, {data} FROM messages {self._order} {where} ORDER BY timestamp, id"
        return self._execute(query, after or ())

    def _columns(self, rows: list[Row]) -> Messages:
        _, topic, log_ns, data = zip(*rows, strict=True)
        try:
            if log_ns[0] >= 0:  # the first is the earliest
                return from_rows([self._index[number] for number in topic], log_ns, data)
        except (KeyError, TypeError, ValueError, OverflowError):
            pass
        sound = [row for row in rows if self._is_message(row)]
        self._left_out += len(rows) - len(sound)
        return from_rows([self._index[r[1]] for r in sound], [r[2] for r in sound], [r[3] for r in sound])

    def _is_message(self, row: Row) -> bool:
        _, topic, log_ns, data = row
        return topic in self._index and isinstance(log_ns, int) and log_ns >= 0 and isinstance(data, bytes)

    def _salvage(self, why: str, finding: str) -> None:
        """Copy every row that can be reached to a new database and read on from that one."""
        self._salvaged = True
        copy = sqlite3.connect(self._temporary() / "salvaged.db3", isolation_level=None)
        self._stack.callback(copy.close)
        copy.executescript(
            "PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF;"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB); BEGIN;"
        )
        copy.executemany("INSERT OR IGNORE INTO messages VALUES(?, ?, ?, ?)", self._reachable_rows())
        copy.execute("COMMIT")
        copy.execute(f"CREATE INDEX {_INDEX} ON messages(timestamp)")
        self._order = f"INDEXED BY {_INDEX}"
        count, first, last = copy.execute("SELECT COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages").fetchone()
        upto = f" up to t={(last - first) / 1e9:.3f} s" if count else ""
        copy.set_progress_handler(self._count_steps, _STEPS_APART)
        self._db = copy
        self.findings.append(Finding(finding, "", f"{self.path.name}: {why}; kept {counted(count, 'message')}{upto}"))

    def _reachable_rows(self) -> Iterator[Row]:
        for number, columns in leaf_rows(self._opened):
            row = (number, *columns[1:])
            if len(row) == 4 and self._is_message(row):
                yield row


def _is_log(file: Path) -> bool:
    """Whether this holds something to add or to roll back; a journal that was done with begins with zeros."""
    with file.open("rb") as stream:
        head = stream.read(len(_JOURNAL_MAGIC))
    return file.name.endswith("-wal") or head == _JOURNAL_MAGIC


_ALLOWED = {sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ, sqlite3.SQLITE_PRAGMA}
_FUNCTIONS = {"count", "min", "sum", "length", "typeof"}


def _authorise(action: int, _: str | None, name: str | None, __: str | None, view: str | None) -> int:
    """Nothing but reading tables: what a view or a computed column would do is up to whoever made the file."""
    allowed = action in _ALLOWED or (action == sqlite3.SQLITE_FUNCTION and name in _FUNCTIONS)
    return sqlite3.SQLITE_OK if allowed and view is None else sqlite3.SQLITE_DENY


def _listed(numbers: Sequence[int]) -> str:
    return ",".join(map(str, numbers))


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
