# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A recorded bag, in any of the forms rosbag2 leaves it in, as blocks of columns."""

from __future__ import annotations

import difflib
import os
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from lugre_steering.ackermann import other_track
from lugre_steering.bag import cdr, mcap, sqlite
from lugre_steering.bag.compression import ZSTD_MAGIC, Allowance, expand_file
from lugre_steering.bag.messages import Connection, Messages, inflated, merged, windows
from lugre_steering.bag.metadata import read_metadata
from lugre_steering.counted import counted
from lugre_steering.errors import BagError
from lugre_steering.recording import NODE, TRUTH, Array, Channel, Finding, IntArray, Kind

MESSAGE_TYPE = {
    Kind.ANGLE: cdr.JOINT_STATE,
    Kind.PRESSURE: cdr.FLUID_PRESSURE,
    Kind.AIR_TEMPERATURE: cdr.TEMPERATURE,
    Kind.TORQUE: cdr.WRENCH_STAMPED,
}
SUFFIXES = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd", ".mcap.zst", ".db3.zst")
_TOPICS_LIMIT = 5_000  # no vehicle has as many; each costs time and memory with every block
_LONGEST = 1 << 20  # bytes of a message of one of these types, with thousands of joints
_HOLES_FROM = 1 << 30
_PEEK = 500_000  # messages looked at to find which topic carries a joint


@dataclass(frozen=True)
class Block:
    """Consecutive messages of a bag in recorded (log time) order; one row per message and wanted channel it carries."""

    channel: NDArray[np.int32]  # index into the channels given to the reader
    message: IntArray  # index into ``messages``
    stamp_ns: IntArray  # header stamp
    log_ns: IntArray
    value: Array  # position, pressure, temperature or torque.z in SI units; NaN where the message gives none
    rate: Array  # velocity of that joint; NaN where there is none
    messages: Messages  # the serialised messages of this block: the wanted ones, or all


class Bag:
    """A rosbag2 folder (with or without metadata.yaml) or a single .mcap or .db3 file, compressed or not.

    Damage is no error: what is readable is read, and ``findings`` says what was lost. Findings about the inside of a
    file come while it is read. Use as a context manager.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.name = bag_name(self.path)
        self.findings: list[Finding] = []
        self.connections: list[Connection] = []
        self._numbers: dict[Connection, int] = {}
        self.malformed: Counter[str] = Counter()  # messages per topic that do not decode as their type
        self._foreign: Counter[int] = Counter()  # messages per connection that speak of no wanted joint
        self.message_count: int | None = None  # as the metadata say; None where there are none
        self._promised: Counter[str] = Counter()  # messages of each topic, as far as the metadata say
        self._files: list[mcap.McapFile | sqlite.SqliteFile] = []
        self._size = 0  # bytes of all files
        self._stack = ExitStack()
        try:
            for file in self._locate():
                self._open(file)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Bag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close all files and remove temporary ones."""
        self._stack.close()

    @property
    def topics(self) -> Mapping[str, str]:
        """Topic -> message type, as recorded."""
        return {c.topic: c.msgtype for c in self.connections}

    def _say(self, finding: str, statement: str, topic: str = "") -> None:
        found = Finding(finding, topic, statement)
        if found not in self.findings:  # a bag may be read more than once
            self.findings.append(found)

    # ---------------------------------------------------------------- files

    def _locate(self) -> list[Path]:
        """The storage files of the bag."""
        must_exist(self.path)
        if not self.path.is_dir():
            if not self.path.is_file():
                raise BagError(f"{self.path}: neither a file nor a folder (a pipe or device?)")
            return [self.path]
        found = sorted(f for f in self.path.iterdir() if f.is_file() and f.name.endswith(SUFFIXES))
        listed: list[Path] = []
        file = self.path / "metadata.yaml"
        if os.path.isfile(file):
            try:
                metadata = read_metadata(file)
                listed = list(dict.fromkeys(self.path / Path(name).name for name in metadata.files))
                self.message_count, self._promised = metadata.messages, metadata.of_topic
            except (ValueError, OSError) as error:
                self._say("damaged_metadata", f"metadata.yaml is not readable ({error}); the files themselves were read")
        else:
            self._say("no_metadata", "the folder has no metadata.yaml (interrupted recording?); its files were read")
        # Anything but a file (a named pipe, say) may never end, or never begin.
        if missing := [f.name for f in listed if not os.path.isfile(f)]:
            names = shortened(missing)
            self._say("missing_file", f"{names}, listed in metadata.yaml, missing or no file: the messages are lost")
        files = [f for f in listed if os.path.isfile(f)] or found
        if not files:
            raise BagError(f"{self.path}: holds no .mcap or .db3 file, so it is not a rosbag2 folder")
        return files

    def _open(self, path: Path) -> None:
        """Open one file by its content, not by its name."""
        shown, reason, packed = path, "", 0
        try:
            _refuse_holes(path)
            with path.open("rb") as file:
                head = file.read(16)
            if head.startswith(ZSTD_MAGIC):
                folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="lugre_steering_")))
                plain = folder / path.name.removesuffix(path.suffix)
                if reason := expand_file(path, plain):
                    reason = f"{reason}; "
                    self._say("truncated_bag", f"{path.name}: {reason}what came before was read")
                path, packed = plain, path.stat().st_size
                with path.open("rb") as file:
                    head = file.read(16)
            if not head:
                raise BagError(f"{shown}: {reason}the file is empty")
            if head.startswith(mcap.MAGIC):
                opened: mcap.McapFile | sqlite.SqliteFile = mcap.McapFile(path, self._number, self.findings, packed=packed)
            elif head.startswith(sqlite.MAGIC):
                opened = sqlite.SqliteFile(path, self._number, self.findings)
            else:
                raise BagError(f"{shown}: {reason}not a recording (neither MCAP nor sqlite3 by its first bytes)")
            self._stack.callback(opened.close)
            self._size += packed or path.stat().st_size
            self._files.append(opened)
        except OSError as error:
            raise BagError(f"{shown}: cannot be read ({error.strerror or error})") from error
        except BagError as error:
            if not self.path.is_dir():
                raise
            self._say("lost_file", f"{error}; its messages are lost")

    def _number(self, connection: Connection) -> int:
        """The index of a connection among all of the bag."""
        if connection not in self._numbers:
            if len(self.connections) == _TOPICS_LIMIT:
                raise BagError(f"{self.path}: more than {_TOPICS_LIMIT} topics, expected the recording of a vehicle")
            self._numbers[connection] = len(self.connections)
            self.connections.append(connection)
        return self._numbers[connection]

    # ------------------------------------------------------------- messages

    def messages(self, wanted: set[int] | None = None, messages_per_block: int = 50_000) -> Iterator[Messages]:
        """Serialised messages in log order; ``wanted`` limits them to some of ``connections``."""
        counts = np.zeros(_TOPICS_LIMIT, np.int64)
        left_out: Counter[str] = Counter()  # compressed messages, by reason
        allowance = Allowance(self._size)
        try:
            runs = [run for file in self._files for run in file.runs(wanted)]
            for block in merged(runs, messages_per_block):
                for messages, lost in inflated(block, allowance):
                    counts += np.bincount(messages.connection, minlength=_TOPICS_LIMIT)
                    left_out.update(lost)
                    yield messages
        except (OSError, sqlite3.Error, BagError) as error:
            raise BagError(f"{self.path}: reading stopped ({error})") from error
        for reason, number in left_out.items():
            self._say("damaged_bag", f"{number} compressed messages are left out: {reason}")
        self._compare(range(len(self.connections)) if wanted is None else wanted, counts)

    def _compare(self, read: Collection[int], counts: IntArray) -> None:
        """Hold how many messages of each connection were read against what the metadata promise."""
        # One byte of a topic's name makes its messages those of another topic.
        for topic in sorted(self._promised.keys() - {connection.topic for connection in self.connections}):
            if self._promised[topic]:
                self._say("message_count", f"metadata.yaml promises {counted(self._promised[topic], 'message')}, 0 could be read", topic)
        total, promised = int(counts.sum()), self.message_count
        if len(read) == len(self.connections) and promised is not None and total != promised:
            self._say("message_count", f"metadata.yaml promises {counted(promised, 'message')}, {total} could be read")
            return
        for topic in {self.connections[k].topic for k in read}:
            of_topic = {k for k, connection in enumerate(self.connections) if connection.topic == topic}
            count, promised = int(counts[list(of_topic)].sum()), self._promised.get(topic)
            if of_topic <= set(read) and promised is not None and count != promised:
                self._say("message_count", f"metadata.yaml promises {counted(promised, 'message')}, {count} could be read", topic)

    def blocks(
        self, channels: Sequence[Channel], messages_per_block: int = 50_000, *, all_messages: bool = False
    ) -> Iterator[Block]:
        """Decode the wanted channels. With ``all_messages`` each block also holds every other message, to be copied."""
        topics = self.match(channels)
        readers: dict[int, list[int]] = {}  # connection -> the channels it carries
        for i, channel in enumerate(channels):
            for k, connection in enumerate(self.connections):
                if connection.topic == topics.get(channel):
                    readers.setdefault(k, []).append(i)
        seen: Counter[int] = Counter()
        self.malformed.clear()
        self._foreign.clear()
        for messages in self.messages(None if all_messages else set(readers), messages_per_block):
            block = self._decode(messages, channels, readers)
            seen.update(dict(enumerate(np.bincount(block.channel, minlength=len(channels)).tolist())))
            yield block
        for topic, count in self.malformed.items():
            self._say("malformed_messages", f"{counted(count, 'message')} left out: no valid CDR of the type", topic)
        for i, channel in enumerate(channels):
            if channel in topics and not seen[i] and channel.joint:
                self._say("no_data", f"no message speaks of joint {channel.joint!r}", topics[channel])
        for k, count in self._foreign.items():
            if count and len(readers[k]) == 1 and seen[readers[k][0]]:  # a topic that several share has others by right
                statement = f"{counted(count, 'message')} with other joints only, not with {channels[readers[k][0]].joint!r}"
                self._say("foreign_joint", statement, self.connections[k].topic)

    def _decode(self, messages: Messages, channels: Sequence[Channel], readers: Mapping[int, Sequence[int]]) -> Block:
        rows: list[tuple[IntArray, NDArray[np.int32], IntArray, Array, Array]] = []
        for k, wanted in readers.items():
            msgtype = MESSAGE_TYPE[channels[wanted[0]].kind]
            joints = [channels[i].joint for i in wanted]
            of_topic = np.flatnonzero(messages.connection == k)
            length = messages.length[of_topic]
            for size in np.unique(length):
                alike = of_topic[length == size]
                if size > _LONGEST:
                    self.malformed[self.connections[k].topic] += alike.size
                    continue
                decoded = cdr.decode(windows(messages.data, messages.start[alike], int(size)), msgtype, joints)
                if bad := int((~decoded.valid).sum()):
                    self.malformed[self.connections[k].topic] += bad
                self._foreign[k] += int((decoded.valid & ~decoded.carried.any(axis=0)).sum())
                for j, i in enumerate(wanted):
                    use = decoded.valid & decoded.carried[j]
                    value, rate = decoded.value[j, use], decoded.rate[j, use]
                    if channels[i].ackermann != 0.0:
                        value, rate = other_track(value, rate, channels[i].ackermann)
                    number = np.full(value.size, i, np.int32)
                    rows.append((alike[use], number, decoded.stamp_ns[use], value, rate))
        if not rows:
            none = np.empty(0, np.int64)
            empty = none.astype(np.float64)
            return Block(none.astype(np.int32), none, none, none, empty, empty, messages)
        message, channel, stamp, value, rate = (np.concatenate(column) for column in zip(*rows, strict=True))
        order = np.lexsort((channel, message))
        channel, message, stamp, value, rate = (column[order] for column in (channel, message, stamp, value, rate))
        return Block(channel, message, stamp, messages.log_ns[message], value, rate, messages)

    # --------------------------------------------------------------- topics

    def match(self, channels: Sequence[Channel]) -> dict[Channel, str]:
        """The recorded topic of each wanted channel; channels that the bag lacks are left out.

        A relative name also matches with one namespace before it. A joint whose own topic is missing or empty is looked
        for in the other JointState topics (a shared ``/joint_states``).
        """
        result: dict[Channel, str] = {}
        for channel in channels:
            topic = self.find_topic(channel.topic)
            if topic is not None:
                self._check_type(topic, MESSAGE_TYPE[channel.kind])
                result[channel] = topic
        joints = [c for c in channels if c.kind is Kind.ANGLE and c.joint]
        empty = self._empty_topics({result[c] for c in joints if c in result})
        missing = [c for c in joints if result.get(c) is None or result[c] in empty]
        for channel, topic in self._shared_topics(missing).items():
            state = "empty" if channel in result else "missing"
            statement = f"topic {channel.topic!r} is {state}; joint {channel.joint!r} is read from {topic!r} instead"
            self._say("shared_topic", statement, topic)
            result[channel] = topic
        return result

    def find_topic(self, name: str) -> str | None:
        """The recorded topic that a relative name means; None if there is none."""
        relative = name.lstrip("/")
        topics = list(self.topics)
        candidates = [t for t in topics if t.lstrip("/") == relative] or [
            t for t in topics if t.endswith("/" + relative)
        ]
        if len(candidates) > 1:
            raise BagError(f"{self.path}: topic {name!r} fits {', '.join(candidates)}; expected exactly one of them")
        return candidates[0] if candidates else None

    def _check_type(self, topic: str, expected: str) -> None:
        for connection in self.connections:
            if connection.topic != topic:
                continue
            if _full_name(connection.msgtype) != expected:
                raise BagError(f"{self.path}: topic {topic!r} has type {connection.msgtype!r}, expected {expected!r}")
            if connection.encoding != "cdr":
                raise BagError(f"{self.path}: topic {topic!r} is encoded as {connection.encoding!r}, expected 'cdr'")

    def _joint_states(self) -> dict[int, str]:
        """Connections that carry measured joint states, and their topics; what this package wrote is no measurement."""
        return {
            k: c.topic
            for k, c in enumerate(self.connections)
            if _full_name(c.msgtype) == cdr.JOINT_STATE and c.encoding == "cdr"
            and not {NODE, TRUTH} & set(c.topic.split("/"))
        }  # fmt: skip

    def _empty_topics(self, topics: set[str]) -> set[str]:
        """Those of some JointState topics without a message; looked for only if another topic could replace them."""
        states = self._joint_states()
        own = {k for k, topic in states.items() if topic in topics}
        empty = set(topics)
        if not own or len(own) == len(states):
            return set()
        for messages in self.messages(own):
            empty -= {states[int(k)] for k in np.unique(messages.connection)}
            if not empty:
                break
        return empty

    def _shared_topics(self, missing: Sequence[Channel]) -> dict[Channel, str]:
        """Topics that carry joints whose own topic is missing or empty, found by looking into the messages."""
        states = self._joint_states()
        if not missing or not states:
            return {}
        carriers: dict[str, set[str]] = {}
        looked = 0
        for messages in self.messages(set(states)):
            for k, topic in states.items():
                # A few of each length: publishers that share a topic differ in their joint names, hence in length.
                for size in np.unique(messages.length[messages.connection == k]):
                    alike = np.flatnonzero((messages.connection == k) & (messages.length == size))
                    for i in alike[:10]:
                        for joint in cdr.joint_names(messages.bytes_of(int(i))):
                            carriers.setdefault(joint, set()).add(topic)
            looked += len(messages)
            if looked > _PEEK:
                break
        result = {}
        for channel in missing:
            topics = sorted(carriers.get(channel.joint, ()))
            if len(topics) > 1:
                raise BagError(
                    f"{self.path}: topic {channel.topic!r} is missing or empty and joint {channel.joint!r} is in "
                    f"{', '.join(topics)}; expected exactly one topic with it"
                )
            if topics:
                result[channel] = topics[0]
        return result


def must_exist(path: Path) -> None:
    """Refuse a bag that is not there; what is named almost like it, there, is told."""
    if os.path.exists(path):
        return
    near: list[str] = []
    with suppress(OSError):
        near = difflib.get_close_matches(path.name, os.listdir(path.parent), n=1, cutoff=0.8)
    raise BagError(f"{path}: no such file or folder" + (f"; did you mean '{near[0]}'?" if near else ""))


def _refuse_holes(path: Path) -> None:
    """A file of which the disk holds next to nothing has no messages where the rest should be, and takes for ever to look through."""
    known = path.stat()
    if known.st_size > _HOLES_FROM and known.st_blocks * 512 < known.st_size // 100:
        raise BagError(f"{path}: has {known.st_size >> 20} MB, of which the disk holds {known.st_blocks >> 11} MB (a sparse file)")


def bag_name(path: Path) -> str:
    """The name of a folder, or of a file without its extension; ``.`` is the folder it stands for."""
    absolute = Path(os.path.abspath(path))  # not resolved: a link is known by its own name
    if absolute.is_dir():
        return absolute.name
    endings = [ending for ending in SUFFIXES if absolute.name.endswith(ending)]
    return absolute.name.removesuffix(endings[0]) if endings else absolute.stem


def shortened(names: Sequence[str], most: int = 20) -> str:
    """Names for a message that a person is to read, however many there are."""
    rest = f" and {len(names) - most} others" if len(names) > most else ""
    return ", ".join(names[:most]) + rest


def damage_words(findings: Sequence[Finding]) -> str:
    """What an error about a bag says of the damage that was found in it; nothing where none was."""
    return f"; damage: {shortened([f.statement for f in findings], 3)}" if findings else ""


def _full_name(msgtype: str) -> str:
    """``pkg/Type`` and ``pkg/msg/Type`` name the same type."""
    package, _, name = msgtype.partition("/")
    return msgtype if name.startswith("msg/") else f"{package}/msg/{name}"
