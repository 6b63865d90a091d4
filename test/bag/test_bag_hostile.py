# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Bags made to harm, and damage that hides: limits hold, nothing is lost without a word, no input is touched."""

from __future__ import annotations

import os
import re
import shutil
import sqlite3
import struct
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import bag_making as make
import lz4.frame
import numpy as np
import pytest
import zstandard
from bag_making import CHANNELS, LEFT, MAIN_A, T0
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from lugre_steering.bag import Bag, BagWriter, Part, cdr, read_recording
from lugre_steering.bag import messages as columns
from lugre_steering.bag.compression import zstd_decompressor
from lugre_steering.bag.mcap_records import records
from lugre_steering.errors import BagError

LINE = ("/" + MAIN_A.topic, make.FLUID_PRESSURE)
TABLES = {
    "topics": "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)",
    "messages": "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)",
}
ENDLESS = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x AS"


def mcap(file: Path, messages: list[make.Message], *, chunked: bool = True, whole: bool = True) -> Path:
    """By the reference writer; not ``whole``: without checksums and index."""
    with file.open("wb") as stream:
        writer = McapWriter(stream, compression=CompressionType.NONE, use_chunking=chunked, enable_crcs=whole)
        writer.start(profile="ros2")
        channels: dict[str, int] = {}
        for topic, msgtype, log_ns, data in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", writer.register_schema(msgtype, "ros2msg", b""))
            writer.add_message(channels[topic], log_ns, data, log_ns)
        writer.finish()
    if not whole:
        data = file.read_bytes()
        (begin,) = struct.unpack_from("<Q", data, len(data) - 28)
        file.write_bytes(data[:begin] + struct.pack("<BQQQI", 2, 20, 0, 0, 0) + data[-8:])
    return file


def values(file: Path) -> tuple[int, str]:
    """How many values are read, all of them true, and what is said about it."""
    with Bag(file) as bag:
        count = 0
        for block in bag.blocks(CHANNELS):
            t = (block.stamp_ns - T0) * 1e-9
            left, line = block.channel == 0, block.channel == 2
            np.testing.assert_allclose(block.value[left], 0.5 * np.sin(t[left]), atol=1e-8)
            np.testing.assert_allclose(block.value[line], 7e5 + 5e4 * np.sin(t[line]), atol=1e-2)
            count += len(t)
        return count, "; ".join(f.statement for f in bag.findings)


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("whole", [True, False])
@pytest.mark.parametrize("place", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_a_zeroed_sector_costs_the_messages_in_it(tmp_path: Path, chunked: bool, whole: bool, place: float) -> None:
    messages = make.steering(10.0)
    file = mcap(tmp_path / "run.mcap", messages, chunked=chunked, whole=whole)
    data = bytearray(file.read_bytes())
    area = sum(31 + len(m[3]) for m in messages)
    begin = int(area * place)
    data[begin : begin + 4096] = bytes(4096)
    file.write_bytes(data)
    count, said = values(file)
    shortest = 31 + min(len(m[3]) for m in messages)
    assert len(messages) - 4096 // shortest - 3 <= count < len(messages) - 25
    assert re.search("lost|left out|cannot be read in full", said)


@pytest.mark.parametrize("chunked", [True, False])
@pytest.mark.parametrize("bit", [0, 6, 15, 20, 30])
def test_one_wrong_length_costs_its_message_and_is_told(tmp_path: Path, chunked: bool, bit: int) -> None:
    """Without checksum and index nothing but the next record tells that a length is wrong."""
    messages = make.steering(5.0)
    file = mcap(tmp_path / "run.mcap", messages, chunked=chunked, whole=False)
    data = bytearray(file.read_bytes())
    at = data.index(struct.pack("<Q", messages[300][2]), 200) - 15  # log time behind code, length, channel, sequence
    assert data[at] == 5
    data[at + 1 + bit // 8] ^= 1 << bit % 8
    file.write_bytes(data)
    count, said = values(file)
    assert len(messages) - 2 <= count < len(messages)
    assert "damaged" in said


@pytest.mark.parametrize("chunked", [True, False])
def test_a_wrong_operation_code_costs_its_message_and_is_told(tmp_path: Path, chunked: bool) -> None:
    """Every kind of record, one that is unknown, and one of another program."""
    messages = make.steering(1.0)
    file = mcap(tmp_path / "run.mcap", messages, chunked=chunked, whole=False)
    data = bytearray(file.read_bytes())
    at = data.index(struct.pack("<Q", messages[200][2]), 200) - 15
    for code in (*range(1, 5), *range(6, 17), 0x80, 0x85, 0xFF):
        data[at] = code
        file.write_bytes(data)
        count, said = values(file)
        assert len(messages) - 2 <= count < len(messages), code
        assert "damaged" in said, code


def chunk(kind: str, packed: bytes, plain: int) -> bytes:
    head = struct.pack("<QQQI", T0, T0 + 10**9, plain, 0) + struct.pack("<I", len(kind)) + kind.encode()
    content = head + struct.pack("<Q", len(packed)) + packed
    return struct.pack("<BQ", 6, len(content)) + content


def zeros(kind: str, megabytes: int) -> bytes:
    if kind == "lz4":
        codec = lz4.frame.LZ4FrameCompressor()
        return b"".join([codec.begin(), *(codec.compress(bytes(1 << 20)) for _ in range(megabytes)), codec.flush()])
    # One zstd frame of repeated bytes: blocks of 128 kB of one byte each (RFC 8878, 3.1.1.2).
    block = (131072 << 3 | 1 << 1).to_bytes(3, "little") + b"\0"
    last = (131072 << 3 | 1 << 1 | 1).to_bytes(3, "little") + b"\0"
    return b"\x28\xb5\x2f\xfd" + b"\x00\x38" + block * (megabytes * 8 - 1) + last


def test_the_zstd_bomb_is_a_sound_frame() -> None:
    assert zstd_decompressor().decompress(zeros("zstd", 1), 2 << 20) == bytes(1 << 20)


@pytest.mark.parametrize("kind", ["zstd", "lz4"])
@pytest.mark.parametrize("declared", [1000, 100 << 20, 10 << 30])
def test_a_chunk_that_unpacks_without_end(tmp_path: Path, kind: str, declared: int) -> None:
    file = mcap(tmp_path / "run.mcap", make.steering(1.0), whole=False)
    data = file.read_bytes()
    end = data.rindex(b"\x0f" + struct.pack("<Q", 4))
    file.write_bytes(data[:end] + chunk(kind, zeros(kind, 1000), declared) * 5 + data[end:])
    begin = time.process_time()
    count, said = values(file)
    assert count == len(make.steering(1.0))
    assert "unpack" in said
    assert time.process_time() - begin < 10.0  # other programs may have the processors


def test_a_compressed_file_that_unpacks_without_end(tmp_path: Path) -> None:
    (tmp_path / "run.mcap.zstd").write_bytes(zeros("zstd", 4000))
    with pytest.raises(BagError, match=r"run\.mcap\.zstd.*unpack to more than"):
        Bag(tmp_path / "run.mcap.zstd")


def packed_records(record: bytes, count: int) -> bytes:
    """An MCAP record many times over, as one zstd chunk."""
    plain = record * count
    return chunk("zstd", zstandard.ZstdCompressor().compress(plain), len(plain))


@pytest.mark.parametrize(("padding", "records_of_it", "chunks"), [(0, 1, 5), (8 << 20, 1, 5), (900_000, 134, 30)])
def test_chunks_of_messages_without_end(tmp_path: Path, padding: int, records_of_it: int, chunks: int) -> None:
    """A large record of another program in the file is no reason to unpack more; many small ones, 120 MB here, are no reason to be slow."""
    messages = make.steering(1.0)
    file = mcap(tmp_path / "run.mcap", messages, whole=False)
    data = file.read_bytes()
    end = data.rindex(b"\x0f" + struct.pack("<Q", 4))
    empty = struct.pack("<BQHIQQ", 5, 22, 1, 0, T0, T0)
    foreign = struct.pack("<BQ", 0x80, padding) + bytes(padding)
    file.write_bytes(data[:end] + foreign * records_of_it + packed_records(empty, 1_000_000) * chunks + data[end:])
    begin = time.process_time()
    count, said = values(file)
    assert count == len(messages)
    assert "unpack to more than" in said
    assert time.process_time() - begin < 10.0


def test_a_long_recording_in_well_packed_chunks_is_read_to_its_end(tmp_path: Path) -> None:
    """So regular that a message takes ten bytes of the file, and longer than what any file may unpack to."""
    count, step = 1_000_000, 10_000_000
    stamp = T0 + step * np.arange(count, dtype=np.int64)
    with BagWriter(tmp_path / "plain") as writer:
        topic = writer.add_topic(*LINE)
        for part in np.array_split(stamp, 30):
            writer.write([Part(topic, part, cdr.encode_fluid_pressure(part, "axle", np.full(part.size, 7e5)))])
    plain = make.file_of(tmp_path / "plain").read_bytes()
    known = np.ones(1 << 16, np.bool_)
    packed, topics = bytearray(), b""
    for op, at, after in records(lambda at, size: plain[at : at + size], 8, len(plain) - 8, known):
        if op in (3, 4):
            topics += plain[at:after]
        elif op == 6:
            (body,) = struct.unpack_from("<Q", plain, at + 41)
            packed += chunk("zstd", zstandard.ZstdCompressor().compress(plain[after - body : after]), body)
    file = tmp_path / "run.mcap"
    file.write_bytes(plain[:8] + topics + packed + plain[-8:])
    recording = read_recording(file, [MAIN_A])
    assert len(packed) < 20 * count
    assert recording.pressure["main_a"].value.size == count
    assert [f.finding for f in recording.findings] == []


def test_messages_that_unpack_without_end(tmp_path: Path) -> None:
    raw = [(*LINE, T0 + i, zeros("zstd", 1000)) for i in range(50)] + [(*LINE, T0 + 99, make.pressure(T0 + 99, 1e5))]
    recording = read_recording(make.write(tmp_path / "run", raw, "sqlite3"), CHANNELS)
    assert recording.pressure["main_a"].value.tolist() == [1e5]
    assert any("50 compressed messages are left out" in f.statement or "unpack" in f.statement for f in recording.findings)


def test_one_chunk_given_many_times_is_read_once(tmp_path: Path) -> None:
    messages = make.steering(1.0)
    file = mcap(tmp_path / "run.mcap", messages)
    data = file.read_bytes()
    (begin,) = struct.unpack_from("<Q", data, len(data) - 28)
    at = data.index(b"\x08", begin)
    while struct.unpack_from("<Q", data, at + 1)[0] > 200:
        at = data.index(b"\x08", at + 1)
    index = data[at : at + 9 + struct.unpack_from("<Q", data, at + 1)[0]]
    summary = data[begin:at] + index * 20_000 + data[at + len(index) : -37]
    file.write_bytes(data[:begin] + summary + struct.pack("<BQQQI", 2, 20, begin, 0, 0) + data[-8:])
    assert values(file)[0] == len(messages)


def test_more_topics_than_any_vehicle_has(tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "run.db3") as db:
        for table in TABLES.values():
            db.execute(table)
        db.executemany("INSERT INTO topics VALUES(?, ?, 'a/B', 'cdr')", ((i, f"/t{i}") for i in range(60_000)))
    db.close()
    with pytest.raises(BagError, match="more than 5000 topics"):
        Bag(tmp_path / "run.db3")


@pytest.mark.parametrize(
    "tables",
    [
        (TABLES["topics"], f"CREATE VIEW messages AS {ENDLESS} id, 1 topic_id, x timestamp, zeroblob(9999) data FROM c"),
        (TABLES["messages"], f"CREATE VIEW topics AS {ENDLESS} id, x name, x type, x serialization_format FROM c"),
        (TABLES["topics"], TABLES["messages"].replace("data BLOB", "data BLOB AS (zeroblob(900000000))")),
    ],
)
def test_tables_that_are_computed(tmp_path: Path, tables: tuple[str, str]) -> None:
    with sqlite3.connect(tmp_path / "run.db3") as db:
        for table in tables:
            db.execute(table)
        if tables[0] == TABLES["topics"]:
            db.execute("INSERT INTO topics VALUES(1, ?, ?, 'cdr')", LINE)
    db.close()
    with pytest.raises(BagError, match=r"not authorized|not a rosbag2 recording|no usable message"):
        read_recording(tmp_path / "run.db3", CHANNELS)


@pytest.mark.parametrize("cut", [1.0, 0.7])
def test_negative_row_and_log_times(tmp_path: Path, cut: float) -> None:
    file = tmp_path / "run.db3"
    with sqlite3.connect(file) as db:
        for table in TABLES.values():
            db.execute(table)
        db.execute("INSERT INTO topics VALUES(1, ?, ?, 'cdr')", LINE)
        rows = [(i - 50, T0 + i, make.pressure(T0 + i, 1e5)) for i in range(3000)]
        rows += [(9000 + i, -1 - i, make.pressure(T0 + 5000 + i, 2e5)) for i in range(3)]
        db.executemany("INSERT INTO messages VALUES(?, 1, ?, ?)", rows)
    db.close()
    file.write_bytes(file.read_bytes()[: int(file.stat().st_size * cut)])
    recording = read_recording(file, CHANNELS)
    assert set(recording.pressure["main_a"].value) == {1e5}
    assert recording.pressure["main_a"].value.size > 2900 * cut
    assert recording.findings


def test_an_impossible_log_time_of_an_mcap_message(tmp_path: Path) -> None:
    messages = [(*LINE, t, make.pressure(T0 + i, 1e5)) for i, t in enumerate((T0, 2**63, 2**64 - 1, T0 + 5))]
    count, said = len(read_recording(file := mcap(tmp_path / "run.mcap", messages), [MAIN_A]).pressure["main_a"].value), ""
    with Bag(file) as bag:
        list(bag.messages())
        said = "; ".join(f.statement for f in bag.findings)
    assert count == 2
    assert "2 messages" in said
    with pytest.raises(BagError, match=r"log time -5 ns, expected"), BagWriter(tmp_path / "out") as writer:
        writer.write([Part(writer.add_topic(*LINE), np.array([-5]), np.zeros((1, 4), np.uint8))])


def test_a_pipe_is_no_bag(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mcap")
    with pytest.raises(BagError, match="neither a file nor a folder"):
        Bag(tmp_path / "pipe.mcap")
    folder = make.write(tmp_path / "run", make.steering(1.0))
    make.file_of(folder).unlink()
    os.mkfifo(folder / "run.mcap")
    with pytest.raises(BagError, match="holds no"):
        Bag(folder)


@pytest.mark.parametrize("begin", [b"\x89MCAP0\r\n", b"SQLite format 3\0"])
def test_a_file_that_is_nearly_all_hole_is_refused_at_once(tmp_path: Path, begin: bytes) -> None:
    """Nothing on the disk, hours to read: 4 TB of zeros."""
    file = tmp_path / "run.bag"
    file.write_bytes(begin)
    os.truncate(file, 4 << 40)
    with pytest.raises(BagError, match="sparse file"):
        Bag(file)


def test_messages_with_more_joints_than_any_machine_are_malformed_and_cost_no_time(tmp_path: Path) -> None:
    """Twenty of a million names each took 37 s of processor time."""
    many = make.joint_state(T0, ["j"] * 1_000_000, [])
    messages = [("/" + LEFT.topic, make.JOINT_STATE, T0 + i, many) for i in range(5)]
    messages.append(("/" + LEFT.topic, make.JOINT_STATE, T0 + 9, make.joint_state(T0 + 9, [LEFT.joint], [0.1])))
    folder = make.write(tmp_path / "run", messages)
    begin = time.process_time()
    recording = read_recording(folder, CHANNELS)
    assert time.process_time() - begin < 2.0
    assert recording.angle["left"].value.tolist() == [0.1]
    assert recording.rejected == {"/" + LEFT.topic: {"malformed": 5}}


@pytest.mark.parametrize(
    "text",
    [
        "[" * 30_000,
        "\n".join(" " * i + "a:" for i in range(2000)),
        "a: &a [*a]",
        "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(f"b{i}: &b{i} [{','.join([f'*b{i - 1}' if i else '*a'] * 9)}]\n" for i in range(20)),
        "rosbag2_bagfile_information: {relative_file_paths: [run.mcap], message_count: .inf}",
        "a: b\n" * 1_000_000,
    ],
)
def test_metadata_made_to_harm(tmp_path: Path, text: str) -> None:
    folder = make.write(tmp_path / "run", make.steering(1.0))
    (folder / "metadata.yaml").write_text(text)
    with Bag(folder) as bag:
        assert sum(len(b.value) for b in bag.blocks(CHANNELS)) == len(make.steering(1.0))
        assert [f.finding for f in bag.findings] == ["damaged_metadata"]


def test_an_unfinished_transaction_is_rolled_back_in_a_copy(tmp_path: Path) -> None:
    """A power cut in the middle of writing: pages of the file are newer than the last commit, the old ones beside it."""
    file = make.file_of(make.write(tmp_path / "run", make.steering(5.0), "sqlite3"))
    count = len(make.steering(5.0))
    db = sqlite3.connect(file, isolation_level=None)
    db.execute("PRAGMA journal_mode=DELETE")
    db.execute("PRAGMA cache_size=1")  # pages leave for the file before the commit
    db.execute("BEGIN")
    db.execute("UPDATE messages SET data = zeroblob(length(data))")
    cut = tmp_path / "cut"
    cut.mkdir()
    victim = tmp_path / "other.txt"
    victim.write_text("not of this program")
    for part in (file, file.with_name(file.name + "-journal")):
        shutil.copy(part, cut)
    db.execute("ROLLBACK")
    db.close()
    before = {f.name: f.read_bytes() for f in cut.iterdir()}
    with Bag(cut / file.name) as bag:
        assert sum(len(b.value) for b in bag.blocks(CHANNELS)) == count
        assert [f.finding for f in bag.findings] == ["interrupted_recording"]
    assert {f.name: f.read_bytes() for f in cut.iterdir()} == before
    # A journal may name another file, which SQLite would delete once it is done.
    name = str(victim).encode()
    tail = struct.pack(">I", len(name)) + struct.pack(">I", sum(name)) + b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7"
    journal = cut / f"{file.name}-journal"
    journal.write_bytes(journal.read_bytes() + struct.pack(">I", 0x3FFFFFFF) + name + tail)
    with Bag(cut / file.name) as bag:
        assert sum(len(b.value) for b in bag.blocks(CHANNELS)) == count
    assert victim.exists()


def test_an_error_shows_the_damage(tmp_path: Path) -> None:
    file = mcap(tmp_path / "run.mcap", make.steering(1.0))
    data = bytearray(file.read_bytes())
    data[100:-2000] = bytes(len(data) - 2100)
    file.write_bytes(data)
    with pytest.raises(BagError, match=r"no usable message.*damage: "):
        read_recording(file, CHANNELS)


def test_messages_out_of_order_without_end_are_given_up_in_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pieces of 1 MB that all begin at one time, so that none may leave before the last is read; read one by one."""
    waiting = 32 << 20
    monkeypatch.setattr(columns, "_WAITING_BYTES", waiting)
    monkeypatch.setattr(columns, "BLOCK_BYTES", waiting // 4)

    def pieces() -> Iterator[columns.Messages]:
        while True:
            yield columns.from_rows([0] * 16, [T0] * 16, [bytes(1 << 16)] * 16)

    tracemalloc.start()
    try:
        with pytest.raises(BagError, match="cannot be sorted"):
            list(columns.merged([(T0, pieces())], 16))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 2.3 * waiting  # what waits, and all of it once more in order


def test_a_nanosecond_part_of_a_second_or_more_is_malformed(tmp_path: Path) -> None:
    raw = bytearray(make.joint_state(T0 + 1, [LEFT.joint], [0.2]))
    struct.pack_into("<I", raw, 8, 10**9)
    sound = make.joint_state(T0, [LEFT.joint], [0.1])
    messages = [("/" + LEFT.topic, make.JOINT_STATE, T0 + i, bytes(r)) for i, r in enumerate((sound, raw))]
    recording = read_recording(make.write(tmp_path / "run", messages), CHANNELS)
    assert recording.angle["left"].value.tolist() == [0.1]
    assert recording.rejected == {"/" + LEFT.topic: {"malformed": 1}}


def test_a_message_of_another_joint_on_the_topic_of_one_is_told(tmp_path: Path) -> None:
    """One flipped bit in a name, and no checksum could tell."""
    raw = [make.joint_state(T0 + i, [LEFT.joint if i != 3 else "left_track_steer_joins"], [0.1]) for i in range(9)]
    messages = [("/" + LEFT.topic, make.JOINT_STATE, T0 + i, r) for i, r in enumerate(raw)]
    recording = read_recording(make.write(tmp_path / "run", messages), CHANNELS)
    assert recording.angle["left"].value.size == 8
    assert [f.finding for f in recording.findings] == ["foreign_joint"]
