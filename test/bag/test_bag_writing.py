# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Bags written here, opened by other people's readers."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import bag_making as make
import numpy as np
import pytest
from bag_making import CHANNELS, LEFT, T0
from mcap.reader import SeekingReader
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

import lugre_steering
from lugre_steering.bag import Bag, BagWriter, Part, cdr, read_recording
from lugre_steering.bag.messages import Connection
from lugre_steering.bag.writer import copied
from lugre_steering.errors import BagError

STORAGES = ["mcap", "sqlite3"]


def replay(source: Path, target: Path, storage: str) -> None:
    """Copy all and add one output topic, block by block."""
    with Bag(source) as bag, BagWriter(target, storage) as writer:
        numbers = np.array([writer.add_connection(c) for c in bag.connections], np.int32)
        torque = writer.add_topic("/node/torque", make.WRENCH)
        for block in bag.blocks(CHANNELS, 700, all_messages=True):
            left = block.channel == 0
            rows = cdr.encode_wrench(block.stamp_ns[left], "axle", 2.0 * block.value[left])
            writer.write([*copied(block.messages, numbers), Part(torque, block.log_ns[left], rows)])


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("source_storage", STORAGES)
def test_copies_are_verbatim_and_any_reader_opens_them(tmp_path: Path, storage: str, source_storage: str) -> None:
    images = [("/camera", "std_msgs/msg/String", T0 + i * 10**8, b"\0\1\0\0" + bytes(i * 50)) for i in range(100)]
    source = make.write(tmp_path / "in", [*make.steering(), *images], source_storage)
    replay(source, tmp_path / "out", storage)
    with AnyReader([source]) as a, AnyReader([tmp_path / "out"]) as b:
        before = [(c.topic, c.msgtype, t, bytes(raw)) for c, t, raw in a.messages()]
        after = [(c.topic, c.msgtype, t, bytes(raw)) for c, t, raw in b.messages()]
        assert [m[2] for m in after] == sorted(m[2] for m in after)
        assert sorted(before) == sorted(m for m in after if m[0] != "/node/torque")
        assert {c.topic: c.msgcount for c in b.connections} == {
            t: sum(m[0] == t for m in after) for t in {m[0] for m in after}
        }
        torque = [b.deserialize(raw, c.msgtype) for c, _, raw in b.messages() if c.topic == "/node/torque"]
    assert len(torque) == 2000
    for i, message in enumerate(torque):
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == T0 + i * 10**7
        assert message.wrench.torque.z == pytest.approx(np.sin(i / 100), abs=1e-7)
    np.testing.assert_array_equal(
        read_recording(tmp_path / "out", CHANNELS).angle["left"].value,
        read_recording(source, CHANNELS).angle["left"].value,
    )


def test_mcap_satisfies_the_reference_implementation(tmp_path: Path) -> None:
    """Sequential reading with checksums, and indexed reading, by the mcap package."""
    replay(make.write(tmp_path / "in", make.steering(60.0)), tmp_path / "out", "mcap")
    file = tmp_path / "out" / "out.mcap"
    with file.open("rb") as stream:
        records = list(StreamReader(stream, validate_crcs=True).records)
    chunks = [r for r in records if type(r).__name__ == "ChunkIndex"]
    with file.open("rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True)
        messages = [(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages()]
        summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(messages) == len(make.steering(60.0)) + 6000
    assert len(chunks) == summary.statistics.chunk_count > 1
    assert [m[1] for m in messages] == sorted(m[1] for m in messages)
    with AnyReader([tmp_path / "out"]) as other:
        assert sorted(messages) == sorted((c.topic, t, bytes(raw)) for c, t, raw in other.messages())


@pytest.mark.parametrize("storage", STORAGES)
def test_output_is_deterministic(tmp_path: Path, storage: str) -> None:
    source = make.write(tmp_path / "in", make.steering())
    for name in ("one", "two"):
        replay(source, tmp_path / name / "out", storage)
    for file in sorted((tmp_path / "one" / "out").iterdir()):
        assert file.read_bytes() == (tmp_path / "two" / "out" / file.name).read_bytes()


@pytest.mark.parametrize("storage", STORAGES)
def test_quality_of_service_survives(tmp_path: Path, storage: str) -> None:
    qos = (
        "- history: 1\n  depth: 5\n  reliability: 2\n  durability: 1\n  deadline:\n    sec: 1\n    nsec: 2\n"
        "  lifespan:\n    sec: 3\n    nsec: 4\n  liveliness: 1\n  liveliness_lease_duration:\n    sec: 5\n    nsec: 6\n"
        "  avoid_ros_namespace_conventions: false"
    )
    with BagWriter(tmp_path / "out", storage) as writer:
        plain = writer.add_topic("/plain", make.TEMPERATURE)
        writer.add_connection(Connection("/t", make.TEMPERATURE, qos=qos))
        writer.write([Part(plain, np.array([T0]), cdr.encode_temperature([T0], "", np.array([1.0])))])
    with Reader(tmp_path / "out") as reader:
        profiles = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}
    assert profiles["/plain"] == []
    assert (profiles["/t"][0].depth, profiles["/t"][0].durability.name, profiles["/t"][0].lifespan.sec) == (
        5,
        "TRANSIENT_LOCAL",
        3,
    )


@pytest.mark.parametrize("storage", STORAGES)
def test_nothing_written_is_still_a_bag(tmp_path: Path, storage: str) -> None:
    with BagWriter(tmp_path / "out", storage) as writer:
        writer.add_topic("/" + LEFT.topic, make.JOINT_STATE)
        writer.write([])
    with Bag(tmp_path / "out") as bag:
        assert bag.topics == {"/" + LEFT.topic: make.JOINT_STATE}
        assert list(bag.messages()) == []
    with AnyReader([tmp_path / "out"]) as reader:
        assert list(reader.messages()) == []


@pytest.mark.parametrize("storage", STORAGES)
def test_a_failed_writer_leaves_nothing_behind(tmp_path: Path, storage: str) -> None:
    def failing() -> None:
        with BagWriter(tmp_path / "out", storage) as writer:
            topic = writer.add_topic("/a", make.TEMPERATURE)
            writer.write([Part(topic, np.array([T0]), cdr.encode_temperature([T0], "", np.array([1.0])))])
            raise RuntimeError("stopped")

    with pytest.raises(RuntimeError, match="stopped"):
        failing()
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("storage", STORAGES)
def test_a_full_disk_is_told_and_leaves_nothing_behind(tmp_path: Path, storage: str) -> None:
    """The process may write no file beyond 64 kB; then the end of the file fails, and so does giving up."""
    code = f"""
import resource, signal, sys
import numpy as np
from lugre_steering.bag import BagWriter, Part, cdr
from lugre_steering.errors import BagError
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (65536, 65536))
stamps = np.arange(1, 20001) * 10**6
try:
    with BagWriter("out", "{storage}") as writer:
        topic = writer.add_topic("/a", "sensor_msgs/msg/Temperature")
        writer.write([Part(topic, stamps, cdr.encode_temperature(stamps, "", np.random.default_rng(1).random(20000)))])
except BagError as error:
    sys.exit(f"told: {{error}}")
"""
    environment = os.environ | {"PYTHONPATH": str(Path(lugre_steering.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.stderr.startswith("told: out"), done.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_existing_folder_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(BagError, match="exists already"):
        BagWriter(tmp_path / "out")
    (tmp_path / "file").write_text("")
    with pytest.raises(BagError, match="cannot be written"):
        BagWriter(tmp_path / "file" / "out")
