# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Damaged bags: what is readable is kept and the loss is stated, or a clear error; never anything else."""

from __future__ import annotations

import contextlib
import random
import shutil
import sqlite3
import struct
from collections.abc import Callable
from functools import cache
from pathlib import Path

import bag_making as make
import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from bag_making import CHANNELS, LEFT, MAIN_A, T0
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from lugre_steering.bag import Bag, read_recording
from lugre_steering.bag.compression import Allowance, expand
from lugre_steering.errors import BagError

FORMS = [
    (s, c) for s, cs in (("mcap", "none storage message file"), ("sqlite3", "none message file")) for c in cs.split()
]


@pytest.fixture(scope="module")
def run() -> list[make.Message]:
    return make.steering(60.0)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """A bag of so many seconds in a form, made once, to be copied and damaged."""

    @cache
    def made(seconds: float, storage: str, compression: str) -> Path:
        return make.write(tmp_path_factory.mktemp("whole") / "run", make.steering(seconds), storage, compression)

    return made


def sound(folder: Path) -> tuple[int, list[str]]:
    """Read all; whatever is delivered must be true. (number of values, names of findings)."""
    with Bag(folder) as bag:
        count = 0
        for block in bag.blocks(CHANNELS, all_messages=True):
            t = (block.stamp_ns - T0) * 1e-9
            left = block.channel == 0
            np.testing.assert_allclose(block.value[left], 0.5 * np.sin(t[left]), atol=1e-8)
            count += len(t)
        return count, [f.finding for f in bag.findings]


@pytest.mark.parametrize(("storage", "compression"), FORMS)
@pytest.mark.parametrize("with_metadata", [True, False])
def test_cut_at_70_percent(
    tmp_path: Path, whole: Callable[..., Path], storage: str, compression: str, with_metadata: bool
) -> None:
    messages = len(make.steering(30.0))
    folder = shutil.copytree(whole(30.0, storage, compression), tmp_path / "run")
    file = make.file_of(folder)
    data = file.read_bytes()
    file.write_bytes(data[: len(data) * 7 // 10])
    if not with_metadata:
        (folder / "metadata.yaml").unlink()
    count, findings = sound(folder)
    # Most of what was not cut off; where the index at the end is large, cutting it costs no message.
    assert 0.6 * messages < count < messages
    assert "truncated_bag" in findings
    assert ("message_count" in findings) == with_metadata
    recording = read_recording(folder, CHANNELS)
    assert any("kept" in f.statement for f in recording.findings)
    np.testing.assert_allclose(recording.angle["left"].value, 0.5 * np.sin(recording.angle["left"].time_s), atol=1e-8)


@pytest.mark.parametrize("fraction", [0.0, 0.001, 0.01, 0.3, 0.9, 0.99, 0.9999])
@pytest.mark.parametrize(("storage", "compression"), FORMS)
def test_cut_anywhere(tmp_path: Path, whole: Callable[..., Path], storage: str, compression: str, fraction: float) -> None:
    folder = shutil.copytree(whole(5.0, storage, compression), tmp_path / "run")
    file = make.file_of(folder)
    data = file.read_bytes()
    file.write_bytes(data[: int(len(data) * fraction)])
    count, findings = sound(folder)
    assert findings  # never silent
    if count == 0:
        with pytest.raises(BagError, match="no usable message"):
            read_recording(folder, CHANNELS)


@pytest.mark.parametrize(("storage", "compression"), FORMS)
@pytest.mark.parametrize("seed", range(12))
def test_flipped_bytes_never_raise_anything_but_bag_errors(
    tmp_path: Path, whole: Callable[..., Path], storage: str, compression: str, seed: int
) -> None:
    folder = shutil.copytree(whole(5.0, storage, compression), tmp_path / "run")
    file = make.file_of(folder)
    data = bytearray(file.read_bytes())
    rng = random.Random(seed)
    for _ in range(rng.choice([1, 10, 200])):
        data[rng.randrange(len(data))] ^= rng.randrange(1, 256)
    file.write_bytes(data)
    for path in (folder, file):
        with contextlib.suppress(BagError):
            recording = read_recording(path, CHANNELS)
            for signal in (*recording.angle.values(), *recording.pressure.values()):
                assert (np.diff(signal.time_s) > 0).all()
                assert np.isfinite(signal.value).all()


@pytest.mark.parametrize("kind", ["zstd", "lz4"])
def test_a_damaged_block_of_compressed_data_costs_nothing_before_it(kind: str) -> None:
    """Blocks of 20 000 bytes, the third of which says to be of a kind that there is not, or to be longer than any."""
    plain = np.random.default_rng(1).integers(0, 64, (5, 20_000), np.uint8)
    packed, sizes = b"", []
    if kind == "zstd":
        stream = zstandard.ZstdCompressor().compressobj()
        for part in plain:
            packed += stream.compress(part.tobytes()) + stream.flush(zstandard.COMPRESSOBJ_FLUSH_BLOCK)
            sizes.append(len(packed))
    else:
        writer = lz4.frame.LZ4FrameCompressor(block_size=lz4.frame.BLOCKSIZE_MAX64KB, auto_flush=True)
        packed = writer.begin()
        for part in plain:
            packed += writer.compress(part.tobytes())
            sizes.append(len(packed))
    spoiled = bytearray(packed)
    spoiled[sizes[1] : sizes[1] + 3] = b"\xff\xff\xff"
    kept, damage = expand(spoiled, kind, 1 << 20, Allowance(1 << 20))
    assert damage
    assert plain[:2].tobytes().startswith(kept)
    assert len(kept) >= 2 * 20_000 - 8192


def test_overwritten_middle_of_a_checksummed_mcap(tmp_path: Path) -> None:
    """With checksums (as rosbag2 writes them) a damaged chunk is left out whole, named, and the rest is true."""
    file = tmp_path / "run.mcap"
    messages = make.steering(20.0)
    with file.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=50_000, compression=CompressionType.LZ4)
        writer.start(profile="ros2")
        channels = {}
        for topic, msgtype, log_ns, data in messages:
            if topic not in channels:
                schema = writer.register_schema(msgtype, "ros2msg", b"")
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], log_ns, data, log_ns)
        writer.finish()
    assert sound(file) == (len(messages), [])
    data = bytearray(file.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 20] = b"\x55" * 20
    file.write_bytes(data)
    count, findings = sound(file)
    assert 0.8 * len(messages) < count < len(messages)
    assert findings == ["damaged_bag"]
    with Bag(file) as bag:
        for _ in range(2):  # read twice, reported once
            assert sum(len(b.value) for b in bag.blocks(CHANNELS)) == count
        assert [f.finding for f in bag.findings] == ["damaged_bag"]


def test_overwritten_page_of_a_sqlite_file(tmp_path: Path, run: list[make.Message], whole: Callable[..., Path]) -> None:
    folder = shutil.copytree(whole(60.0, "sqlite3", "none"), tmp_path / "run")
    file = make.file_of(folder)
    data = bytearray(file.read_bytes())
    page = len(data) // 2 // 4096 * 4096
    data[page : page + 4096] = b"\x55" * 4096
    file.write_bytes(data)
    count, findings = sound(folder)
    assert len(run) - 200 < count < len(run)
    assert "damaged_bag" in findings
    assert "message_count" in findings


@pytest.mark.parametrize("with_metadata", [True, False])
@pytest.mark.parametrize(("kind", "indexed"), [(2, True), (10, True), (5, True), (5, False)])  # sqlite.org/fileformat2, 1.6
def test_one_bit_in_the_tree_of_an_sqlite_bag_costs_nothing(
    tmp_path: Path, run: list[make.Message], whole: Callable[..., Path], kind: int, indexed: bool, with_metadata: bool
) -> None:
    """SQLite leaves out without an error what lies below cells that an index page does not count; the rows are whole."""
    folder = shutil.copytree(whole(60.0, "sqlite3", "none"), tmp_path / "run")
    file = make.file_of(folder)
    if not indexed:
        with contextlib.closing(sqlite3.connect(file)) as db:
            db.execute("DROP INDEX timestamp_idx")
            db.execute("VACUUM")
    if not with_metadata:
        (folder / "metadata.yaml").unlink()
    data = bytearray(file.read_bytes())
    count = next(page + 3 for page in range(4096, len(data), 4096) if data[page] == kind and any(data[page + 3 : page + 5]))
    cells = int.from_bytes(data[count : count + 2], "big")
    data[count : count + 2] = (cells ^ 1 << cells.bit_length() - 1).to_bytes(2, "big")
    file.write_bytes(data)
    read, findings = sound(folder)
    assert read == len(run)
    assert sorted({*findings} - {"no_metadata"}) == ["damaged_bag"]


def test_messages_whose_topic_is_lost_are_told_to_who_reads_some_topics(tmp_path: Path, whole: Callable[..., Path]) -> None:
    folder = shutil.copytree(whole(5.0, "sqlite3", "none"), tmp_path / "run")
    file = make.file_of(folder)
    (folder / "metadata.yaml").unlink()
    with contextlib.closing(sqlite3.connect(file)) as db:
        db.execute("DELETE FROM topics WHERE name = ?", ("/" + make.LEFT.topic,))
        db.commit()
    said = [f.statement for f in read_recording(folder, [make.MAIN_A]).findings if f.finding == "damaged_bag"]
    assert len(said) == 1
    assert "500 rows are no messages (topic" in said[0]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_empty_bag(tmp_path: Path, storage: str) -> None:
    empty = make.write(tmp_path / "run", [], storage)
    assert sound(empty) == (0, [])
    with pytest.raises(BagError, match="no usable message"):
        read_recording(empty, CHANNELS)
    announced = make.write(
        tmp_path / "announced", [], storage, topics=[("/" + c.topic, make.JOINT_STATE) for c in CHANNELS[:2]]
    )
    with Bag(announced) as bag:
        assert len(bag.topics) == 2
    with pytest.raises(BagError, match=r"no usable message.*/steering/left/joint_state"):
        read_recording(announced, CHANNELS)


def test_not_a_bag(tmp_path: Path) -> None:
    for name, content, reason in (
        ("empty.mcap", b"", "empty"),
        ("empty.db3", b"", "empty"),
        ("notes.txt", b"these are notes, and long enough", "neither MCAP nor sqlite3"),
        ("notes.mcap", b"these are notes, and long enough", "neither MCAP nor sqlite3"),
        ("image.db3", bytes(range(256)), "neither MCAP nor sqlite3"),
        ("head.db3", b"SQLite format 3\0", "not a readable sqlite3|not a rosbag2"),
    ):
        file = tmp_path / name
        file.write_bytes(content)
        with pytest.raises(BagError, match=reason) as error:
            Bag(file)
        assert name in str(error.value)
    with pytest.raises(BagError, match=r"no such file or folder$"):
        Bag(tmp_path / "absent")
    with pytest.raises(BagError, match=r"no such file or folder; did you mean 'image\.db3'\?"):
        Bag(tmp_path / "images.db3")
    (tmp_path / "folder").mkdir()
    with pytest.raises(BagError, match=r"no \.mcap or \.db3"):
        Bag(tmp_path / "folder")


def test_an_sqlite_file_of_another_program(tmp_path: Path) -> None:
    db = sqlite3.connect(tmp_path / "other.db3")
    db.execute("CREATE TABLE songs(name)")
    db.commit()
    db.close()
    with pytest.raises(BagError, match="not a rosbag2 recording"):
        Bag(tmp_path / "other.db3")


@pytest.mark.parametrize(
    "text", ["", "{", "a: [1", "rosbag2_bagfile_information: 5", "rosbag2_bagfile_information: {}", "\x00\xff"]
)
def test_damaged_metadata_is_done_without(tmp_path: Path, text: str) -> None:
    folder = make.write(tmp_path / "run", make.steering(1.0))
    (folder / "metadata.yaml").write_bytes(text.encode("latin-1"))
    count, findings = sound(folder)
    assert (count, findings) == (len(make.steering(1.0)), ["damaged_metadata"])


def test_an_mcap_without_index_is_read_in_full(tmp_path: Path) -> None:
    """No summary and no chunks, as small writers make them: whole, so nothing to report."""
    for chunked in (True, False):
        file = tmp_path / f"plain{chunked}.mcap"
        messages = make.steering(3.0)
        with file.open("wb") as stream:
            writer = McapWriter(stream, use_chunking=chunked, compression=CompressionType.NONE)
            writer.start(profile="ros2")
            channels = {}
            for topic, msgtype, log_ns, data in messages:
                if topic not in channels:
                    channels[topic] = writer.register_channel(
                        topic, "cdr", writer.register_schema(msgtype, "ros2msg", b"")
                    )
                writer.add_message(channels[topic], log_ns, data, log_ns)
            writer.finish()
        data = file.read_bytes()
        footer = 8 + 9 + 20
        without = data[:-footer] + struct.pack("<BQQQI", 2, 20, 0, 0, 0) + data[-8:]
        file.write_bytes(without)
        assert sound(file) == (len(messages), [])


def test_a_lost_file_of_a_split_recording_does_not_cost_the_others(tmp_path: Path) -> None:
    folder = make.write(tmp_path / "run", make.steering(1.0))
    (folder / "metadata.yaml").unlink()
    (folder / "run_1.mcap").write_bytes(b"")
    shutil.copy(make.file_of(make.write(tmp_path / "b", make.steering(1.0), "sqlite3")), folder / "run_2.db3")
    count, findings = sound(folder)
    assert count == 2 * len(make.steering(1.0))
    assert sorted(findings) == ["lost_file", "no_metadata"]


def test_an_index_that_leads_to_other_rows_is_not_believed(tmp_path: Path, whole: Callable[..., Path]) -> None:
    """As many entries as rows, but one leads to a row twice, and so another is never found."""
    folder = shutil.copytree(whole(5.0, "sqlite3", "none"), tmp_path / "run")
    (folder / "metadata.yaml").unlink()
    file = make.file_of(folder)
    with contextlib.closing(sqlite3.connect(file)) as db:
        number, log_ns = db.execute("SELECT id, timestamp FROM messages ORDER BY id LIMIT 1 OFFSET 400").fetchone()
    data = bytearray(file.read_bytes())
    entry = struct.pack(">q", log_ns) + struct.pack(">h", number)  # the index holds log times and row numbers
    assert data.count(entry) == 1
    data[data.index(entry) + 9] ^= 1
    file.write_bytes(data)
    with contextlib.closing(sqlite3.connect(file)) as db:
        rows = db.execute("SELECT id FROM messages INDEXED BY timestamp_idx").fetchall()
        assert len(rows) == len(set(rows)) + 1
    with Bag(folder) as bag:
        assert sum(len(block) for block in bag.messages()) == len(rows)
        assert [f.finding for f in bag.findings] == ["no_metadata", "damaged_bag"]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_topic_with_fewer_messages_than_promised_is_told_when_it_is_read(tmp_path: Path, storage: str) -> None:
    folder = make.write(tmp_path / "run", make.steering(2.0), storage)
    metadata = folder / "metadata.yaml"
    content = yaml.safe_load(metadata.read_text())
    for topic in content["rosbag2_bagfile_information"]["topics_with_message_count"]:
        if topic["topic_metadata"]["name"] == "/" + LEFT.topic:
            topic["message_count"] = 999
    metadata.write_text(yaml.safe_dump(content))
    assert read_recording(folder, [MAIN_A]).findings == ()
    (finding,) = read_recording(folder, [LEFT]).findings
    assert (finding.finding, finding.topic) == ("message_count", "/" + LEFT.topic)
    assert "promises 999 messages, 200 could be read" in finding.statement


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_topic_whose_name_is_damaged_is_told_as_lost(tmp_path: Path, storage: str) -> None:
    folder = make.write(tmp_path / "run", make.steering(2.0), storage)
    (file,) = (file for file in folder.iterdir() if file.name != "metadata.yaml")
    name = ("/" + MAIN_A.topic).encode()
    data = file.read_bytes()
    assert name in data
    file.write_bytes(data.replace(name, name[:-1] + b"?"))
    recording = read_recording(folder, [LEFT, MAIN_A])
    lost = [f.topic for f in recording.findings if f.finding == "message_count" and "0 could be read" in f.statement]
    assert lost == [name.decode()]
