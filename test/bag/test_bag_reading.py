# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Every form a bag comes in, topics under other names, and messages that are late, missing, doubled or absurd."""

from __future__ import annotations

import random
import shutil
import sqlite3
import tracemalloc
from pathlib import Path

import bag_making as make
import numpy as np
import pytest
from bag_making import AIR, CHANNELS, LEFT, MAIN_A, RIGHT, SENSOR, T0
from rosbags.highlevel import AnyReader

from lugre_steering.bag import Bag, read_recording
from lugre_steering.errors import BagError
from lugre_steering.recording import Channel, Kind, Recording

FORMS = [
    ("mcap", "none"),
    ("mcap", "storage"),
    ("mcap", "message"),
    ("mcap", "file"),
    ("sqlite3", "none"),
    ("sqlite3", "message"),
    ("sqlite3", "file"),
]


@pytest.fixture(scope="module")
def messages() -> list[make.Message]:
    return make.steering()


def check(recording: Recording, count: int = 2000) -> None:
    """All of the synthetic run is there, against the closed form it was made from."""
    t = np.arange(count) / 100
    for name, sign in (("left", 1), ("right", -1)):
        np.testing.assert_allclose(recording.angle[name].time_s, t, atol=1e-9)
        np.testing.assert_allclose(recording.angle[name].value, sign * 0.5 * np.sin(t), atol=1e-8)
    assert list(recording.rate) == ["left"]
    np.testing.assert_allclose(recording.rate["left"].value, 0.05 * np.sin(t), atol=1e-8)
    np.testing.assert_allclose(recording.pressure["main_a"].value, 7e5 + 0.5e5 * np.sin(t), atol=1e-2)
    assert recording.measured_torque is not None
    assert recording.air_temperature is not None
    np.testing.assert_allclose(recording.measured_torque.time_s, t[::2], atol=1e-9)
    assert recording.air_temperature.time_s[0] == pytest.approx(5.0)
    assert recording.start_ns == T0
    assert recording.rejected == {}


@pytest.mark.parametrize(("storage", "compression"), FORMS)
def test_every_form_reads_the_same(
    tmp_path: Path, messages: list[make.Message], storage: str, compression: str
) -> None:
    folder = make.write(tmp_path / "run", messages, storage, compression)
    recording = read_recording(folder, CHANNELS)
    check(recording)
    assert recording.findings == ()
    assert recording.name == "run"
    single = tmp_path / make.file_of(folder).name
    shutil.copy(make.file_of(folder), single)
    recording = read_recording(single, CHANNELS)
    check(recording)
    assert recording.findings == ()
    assert recording.name == "run"
    (folder / "metadata.yaml").unlink()
    recording = read_recording(folder, CHANNELS)
    check(recording)
    assert [f.finding for f in recording.findings] == ["no_metadata"]


@pytest.mark.parametrize(("storage", "compression"), FORMS)
@pytest.mark.parametrize("per_block", [1, 37, 100_000])
def test_blocks_hold_every_message_verbatim_in_log_order(
    tmp_path: Path, storage: str, compression: str, per_block: int
) -> None:
    recorded = [*make.steering(2.0), ("/chatter", "std_msgs/msg/Empty", T0 + 7, b"\0\1\0\0")]
    folder = make.write(tmp_path / "run", recorded, storage, compression)
    with AnyReader([folder]) as oracle:
        expected = [(c.topic, log_ns, bytes(raw)) for c, log_ns, raw in oracle.messages()]
    with Bag(folder) as bag:
        found, rows = [], 0
        for block in bag.blocks(CHANNELS, per_block, all_messages=True):
            assert len(block.messages) <= per_block
            rows += len(block.value)
            m = block.messages
            found += [
                (bag.connections[c].topic, int(t), m.bytes_of(i))
                for i, (c, t) in enumerate(zip(m.connection, m.log_ns, strict=True))
            ]
        assert bag.message_count == len(recorded)
        assert bag.findings == []
    assert [f[1] for f in found] == sorted(f[1] for f in found)
    assert sorted(found) == sorted(expected)
    assert rows == len(recorded) - 1


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_written_topic_by_topic_is_read_in_time_order(tmp_path: Path, storage: str) -> None:
    """Chunks that each span the whole recording are merged."""
    messages = sorted(make.steering(60.0), key=lambda m: m[0])
    with Bag(make.write(tmp_path / "run", messages, storage)) as bag:
        log = np.concatenate([b.log_ns for b in bag.blocks(CHANNELS, 500)])
    assert len(log) == len(messages)
    assert (np.diff(log) >= 0).all()


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_split_recording_and_a_lost_part(tmp_path: Path, messages: list[make.Message], storage: str) -> None:
    first, second, third = (sorted(messages, key=lambda m: m[2])[k * 3000 : (k + 1) * 3000] for k in range(3))
    whole = make.write(tmp_path / "run", first, storage)
    rest = [make.write(tmp_path / f"part{k}", part, storage) for k, part in enumerate((second, third))]
    suffix = make.file_of(whole).suffix
    metadata = (whole / "metadata.yaml").read_text()
    for k, part in enumerate(rest):
        shutil.copy(make.file_of(part), whole / f"run_{k}{suffix}")
    listed = "".join(f"  - run{k}{suffix}\n" for k in ("", "_0", "_1"))
    metadata = metadata.replace(f"  - run{suffix}\n", listed).replace("message_count: 3000", "message_count: 9000")
    (whole / "metadata.yaml").write_text(metadata)
    with Bag(whole) as bag:
        log = np.concatenate([b.log_ns for b in bag.blocks(CHANNELS)])
    np.testing.assert_array_equal(log, sorted(m[2] for m in messages)[:9000])
    (whole / f"run_0{suffix}").unlink()
    recording = read_recording(whole, CHANNELS)
    assert [f.finding for f in recording.findings] == ["missing_file", "message_count"]
    assert f"run_0{suffix}" in recording.findings[0].statement


def test_sqlite_write_ahead_log_of_an_interrupted_recording_is_used(
    tmp_path: Path, messages: list[make.Message]
) -> None:
    file = make.file_of(make.write(tmp_path / "run", messages, "sqlite3"))
    db = sqlite3.connect(file)
    db.execute("PRAGMA journal_mode=WAL")
    late = make.joint_state(T0 + 10**11, [LEFT.joint], [0.125])
    db.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)", (T0 + 10**11, late))
    db.commit()
    torn = tmp_path / "torn"
    torn.mkdir()
    for part in (file, file.with_name(file.name + "-wal")):
        shutil.copy(part, torn)
    db.close()
    before = sorted(f.name for f in torn.iterdir())
    assert read_recording(torn, CHANNELS).angle["left"].value[-1] == 0.125
    assert sorted(f.name for f in torn.iterdir()) == before


def test_memory_is_bounded(tmp_path: Path) -> None:
    """Four times the messages in blocks of the same size need no more memory."""
    peaks = []
    for duration in (120.0, 480.0):
        message = make.steering(1.0)
        many = ((t, k, log + s * 10**9, d) for s in range(int(duration)) for t, k, log, d in message)
        folder = make.write(tmp_path / f"run{duration}", many)
        tracemalloc.start()
        with Bag(folder) as bag:
            assert sum(len(b.value) for b in bag.blocks(CHANNELS, 2000, all_messages=True)) == duration * len(message)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.4 * peaks[0]


# --------------------------------------------------------------------- topics


def test_namespace_and_shared_joint_states(tmp_path: Path) -> None:
    state = [
        (
            "/vehicle/joint_states",
            make.JOINT_STATE,
            T0 + i,
            make.joint_state(T0 + i, ["wheel", RIGHT.joint, LEFT.joint], [9.0, -i, i]),
        )
        for i in range(1, 4)
    ]
    wheels = [("/vehicle/joint_states", make.JOINT_STATE, T0 + 9, make.joint_state(T0 + 9, ["wheel"], [7.0]))]
    nameless = [("/vehicle/joint_states", make.JOINT_STATE, T0 + 8, make.joint_state(T0 + 8, [], [8.0, -8.0]))]
    lines = [("/tractor/steering/pressure/main_a", make.FLUID_PRESSURE, T0 + 5, make.pressure(T0 + 5, 3e5))]
    folder = make.write(tmp_path / "run", state + nameless + wheels + lines)
    with Bag(folder) as bag:
        assert bag.match(CHANNELS) == {
            LEFT: "/vehicle/joint_states",
            RIGHT: "/vehicle/joint_states",
            MAIN_A: lines[0][0],
        }
        (block,) = bag.blocks(CHANNELS)
    assert block.channel.tolist() == [0, 1, 0, 1, 0, 1, 2]
    assert block.value.tolist() == [1, -1, 2, -2, 3, -3, 3e5]
    assert [f.finding for f in bag.findings] == ["shared_topic", "shared_topic"]
    second = [("/other/joint_states", make.JOINT_STATE, T0 + 5, make.joint_state(T0 + 5, [LEFT.joint], [0.0]))]
    with Bag(make.write(tmp_path / "two", state + second)) as bag, pytest.raises(BagError, match="exactly one topic"):
        bag.match(CHANNELS)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_an_empty_topic_does_not_hide_the_shared_one(tmp_path: Path, storage: str) -> None:
    raw = make.joint_state(T0, [LEFT.joint, RIGHT.joint], [0.1, 0.2])
    own = make.joint_state(T0, [RIGHT.joint], [0.3])
    messages = [("/joint_states", make.JOINT_STATE, T0, raw), ("/" + RIGHT.topic, make.JOINT_STATE, T0, own)]
    folder = make.write(tmp_path / "run", messages, storage, topics=[("/" + LEFT.topic, make.JOINT_STATE)])
    with Bag(folder) as bag:
        assert bag.match(CHANNELS) == {LEFT: "/joint_states", RIGHT: "/" + RIGHT.topic}
        assert [f.statement.split(";")[0] for f in bag.findings] == [f"topic {LEFT.topic!r} is empty"]
    recording = read_recording(folder, CHANNELS)
    assert (recording.angle["left"].value, recording.angle["right"].value) == (0.1, 0.3)


def test_ambiguous_namespace_is_refused(tmp_path: Path) -> None:
    messages = [(f"/{v}/{MAIN_A.topic}", make.FLUID_PRESSURE, T0 + 5, make.pressure(T0 + 5, 3e5)) for v in "ab"]
    with (
        Bag(make.write(tmp_path / "run", messages)) as bag,
        pytest.raises(BagError, match=r"/a/steering.*, /b/steering"),
    ):
        bag.match(CHANNELS)


def test_an_exact_topic_wins_over_a_namespaced_one(tmp_path: Path) -> None:
    messages = [(f"{v}/{MAIN_A.topic}", make.FLUID_PRESSURE, T0 + 5, make.pressure(T0 + 5, 3e5)) for v in ("", "/b")]
    with Bag(make.write(tmp_path / "run", messages)) as bag:
        assert bag.match([MAIN_A]) == {MAIN_A: "/" + MAIN_A.topic}


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_wrong_type_names_topic_and_both_types(tmp_path: Path, storage: str) -> None:
    folder = make.write(
        tmp_path / "run", [("/" + MAIN_A.topic, make.TEMPERATURE, T0, make.temperature(T0, 3.0))], storage
    )
    with pytest.raises(BagError, match=f"/{MAIN_A.topic}.*{make.TEMPERATURE}.*expected.*{make.FLUID_PRESSURE}"):
        read_recording(folder, CHANNELS)


def test_missing_topics_and_joints(tmp_path: Path) -> None:
    """Missing topics are no error; a topic that never speaks of the joint is reported; nothing at all is an error."""
    left = [("/" + LEFT.topic, make.JOINT_STATE, T0 + i, make.joint_state(T0 + i, ["other"], [0.1])) for i in range(3)]
    line = [("/" + MAIN_A.topic, make.FLUID_PRESSURE, T0 + 5, make.pressure(T0 + 5, 3e5))]
    recording = read_recording(make.write(tmp_path / "run", left + line), CHANNELS)
    assert (list(recording.angle), list(recording.pressure)) == ([], ["main_a"])
    assert [(f.finding, f.topic) for f in recording.findings] == [("no_data", "/" + LEFT.topic)]
    with pytest.raises(
        BagError, match=r"no usable message.*steering/left.*topics in the bag: /steering/left/joint_state"
    ):
        read_recording(make.write(tmp_path / "none", left), CHANNELS)


def test_a_joint_state_without_names_gives_its_first_position(tmp_path: Path) -> None:
    left = [("/" + LEFT.topic, make.JOINT_STATE, T0 + 1, make.joint_state(T0 + 1, [], [0.1, 0.2]))]
    assert read_recording(make.write(tmp_path / "run", left), CHANNELS).angle["left"].value.tolist() == [0.1]


# ------------------------------------------------------------------- cleaning


@pytest.mark.parametrize("seconds", [3.0, 10.0])
def test_a_clock_set_back_by_much_of_a_short_recording(tmp_path: Path, seconds: float) -> None:
    i = np.arange(round(100 * seconds))
    stamps = T0 + i * 10**7 - np.where(i < i.size // 2, 0, 905_000_000)
    messages = [
        ("/" + LEFT.topic, make.JOINT_STATE, T0 + int(k) * 10**7, make.joint_state(int(stamp), [LEFT.joint], [1e-4 * k]))
        for k, stamp in zip(i, stamps, strict=True)
    ]
    recording = read_recording(make.write(tmp_path / "run", messages), CHANNELS)
    assert recording.rejected == {"/" + LEFT.topic: {"backward": 90}}


@pytest.mark.parametrize("kind", ["swapped in pairs", "reversed in fives", "delayed at random"])
def test_messages_out_of_order_are_put_back(tmp_path: Path, kind: str) -> None:
    """Merely late ones are no set-back clock, however many they are."""
    sent = np.arange(1000)
    arrived = {
        "swapped in pairs": sent ^ 1,
        "reversed in fives": sent // 5 * 5 + 4 - sent % 5,
        "delayed at random": np.argsort(sent + np.random.default_rng(1).exponential(5.0, 1000), kind="stable"),
    }[kind]
    messages = [
        ("/" + LEFT.topic, make.JOINT_STATE, T0 + i * 10**7, make.joint_state(T0 + int(k) * 10**7, [LEFT.joint], [1e-4 * k]))
        for i, k in enumerate(arrived)
    ]
    recording = read_recording(make.write(tmp_path / "run", messages), CHANNELS)
    assert recording.rejected == {}
    assert recording.angle["left"].value == pytest.approx(1e-4 * sent)


def test_why_nothing_is_usable(tmp_path: Path) -> None:
    stopped = [("/" + LEFT.topic, make.JOINT_STATE, T0 + i, make.joint_state(0, [LEFT.joint], [0.1])) for i in range(30)]
    with pytest.raises(BagError, match=f"left out: 30 zero_stamp on /{LEFT.topic}"):
        read_recording(make.write(tmp_path / "run", stopped), CHANNELS)


def test_a_clock_set_back_a_little_does_not_mix_two_times(tmp_path: Path) -> None:
    """Half a second back: what then comes between samples that are there already is left out; a late message fills a hole."""
    stamps = [T0 + i * 10**7 for i in range(100)] + [T0 + i * 10**7 - 5 * 10**8 + 4 * 10**6 for i in range(100, 300)]
    late = stamps.pop(30)
    stamps.insert(35, late)
    messages = [
        ("/" + LEFT.topic, make.JOINT_STATE, T0 + i * 10**7, make.joint_state(stamp, [LEFT.joint], [1e-3 * i]))
        for i, stamp in enumerate(stamps)
    ]
    recording = read_recording(make.write(tmp_path / "run", messages), CHANNELS)
    assert recording.rejected == {"/" + LEFT.topic: {"backward": 49}}
    assert recording.angle["left"].value.size == 251
    assert [f.statement for f in recording.findings] == ["1 message was recorded out of order and put back in order"]


def test_late_messages_are_sorted_and_bad_ones_counted(tmp_path: Path) -> None:
    """Ten good samples at 10 Hz, recorded among every kind of bad one."""
    t = [T0 + i * 10**8 for i in range(10)]
    good = [(t[i], make.joint_state(t[i], [LEFT.joint], [0.01 * i])) for i in range(10)]
    bad = {
        "duplicate": [make.joint_state(t[3], [LEFT.joint], [0.5])] * 2,
        "backward": [make.joint_state(T0 - 5 * 10**9, [LEFT.joint], [0.5])],
        "time_jump": [make.joint_state(t[3] + 10**15, [LEFT.joint], [0.5])],
        "zero_stamp": [make.joint_state(stamp, [LEFT.joint], [0.5]) for stamp in (0, 0, -(10**9))],
        "not_finite": [make.joint_state(t[3] + 1, [LEFT.joint], [v]) for v in (np.nan, np.inf, -np.inf)]
        + [make.joint_state(t[3] + 2, [LEFT.joint], [])],
        "absurd": [make.joint_state(t[3] + 3, [LEFT.joint], [v]) for v in (3.2, -1e300)],
        "malformed": [b"\0\1\0\0\1\2\3"],
    }
    order = [good[i] for i in (0, 1, 3, 2)]  # one late by 0.1 s
    order += [(t[3] + k, raw) for k, raw in enumerate(r for group in bad.values() for r in group)]
    order += good[4:]
    messages = [("/" + LEFT.topic, make.JOINT_STATE, log + 10**6, raw) for log, raw in order]
    messages[3] = (*messages[3][:2], t[3] + 10**6 + 1, messages[3][3])
    recording = read_recording(make.write(tmp_path / "run", messages), CHANNELS)
    np.testing.assert_allclose(recording.angle["left"].time_s, np.arange(10) * 0.1, atol=1e-12)
    np.testing.assert_allclose(recording.angle["left"].value, np.arange(10) * 0.01)
    assert recording.rejected == {"/" + LEFT.topic: {reason: len(group) for reason, group in sorted(bad.items())}}
    assert [(f.finding, f.topic) for f in recording.findings if f.finding != "malformed_messages"] == [
        ("out_of_order", "/" + LEFT.topic)
    ]


def test_a_clock_set_back_is_not_interleaved(tmp_path: Path) -> None:
    """Two runs with the same stamps in one bag: the second is left out and counted, not mixed into the first."""
    messages = []
    for i in range(200):
        stamp = T0 + (i % 100) * 10**8
        raw = make.pressure(stamp, 1e5 if i < 100 else 2e5)
        messages.append(("/" + MAIN_A.topic, make.FLUID_PRESSURE, T0 + i * 10**8, raw))
    recording = read_recording(make.write(tmp_path / "run", messages), CHANNELS)
    inside = recording.pressure["main_a"].value
    rejected = sum(recording.rejected["/" + MAIN_A.topic].values())
    assert len(inside) + rejected == 200
    assert (inside[:88] == 1e5).all()
    assert rejected >= 99


def test_of_two_clocks_alike_in_number_one_is_kept(tmp_path: Path) -> None:
    messages = []
    for i in range(20):
        stamp = T0 + i * 10**8 + (0 if i < 10 else 10**16)
        messages.append(("/" + MAIN_A.topic, make.FLUID_PRESSURE, T0 + i * 10**8, make.pressure(stamp, 1e5)))
    recording = read_recording(make.write(tmp_path / "run", messages), CHANNELS)
    assert len(recording.pressure["main_a"].value) == 10
    assert recording.rejected == {"/" + MAIN_A.topic: {"time_jump": 10}}


def test_one_wild_stamp_does_not_outdate_the_rest(tmp_path: Path) -> None:
    stamps = [T0 + i * 10**8 for i in range(50)]
    stamps[20] += 3600 * 10**9
    messages = [
        ("/" + MAIN_A.topic, make.FLUID_PRESSURE, T0 + i * 10**8, make.pressure(s, 1e5)) for i, s in enumerate(stamps)
    ]
    recording = read_recording(make.write(tmp_path / "run", messages), CHANNELS)
    assert len(recording.pressure["main_a"].value) == 49
    assert recording.rejected == {"/" + MAIN_A.topic: {"backward": 1}}


def test_absurd_values_of_every_kind(tmp_path: Path) -> None:
    messages = []
    for i, (p, c, n) in enumerate([(1e5, 20.0, 5.0), (2e9, -101.0, np.nan), (-2e9, 288.15, 1e10)], start=1):
        t = T0 + i * 10**8
        messages.append(("/" + MAIN_A.topic, make.FLUID_PRESSURE, t, make.pressure(t, p)))
        messages.append(("/" + AIR.topic, make.TEMPERATURE, t, make.temperature(t, c)))
        messages.append(("/" + SENSOR.topic, make.WRENCH, t, make.wrench(t, n)))
    recording = read_recording(make.write(tmp_path / "run", messages), CHANNELS)
    assert recording.pressure["main_a"].value.tolist() == [1e5]
    assert recording.air_temperature is not None
    assert recording.measured_torque is not None
    assert recording.air_temperature.value.tolist() == [20.0]
    assert recording.measured_torque.value.tolist() == [5.0]
    assert recording.rejected == {
        "/" + MAIN_A.topic: {"absurd": 2},
        "/" + AIR.topic: {"absurd": 2},
        "/" + SENSOR.topic: {"absurd": 1, "not_finite": 1},
    }


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_gaps_and_missing_messages_stay_gaps(tmp_path: Path, messages: list[make.Message], storage: str) -> None:
    rng = random.Random(3)
    kept = [m for m in messages if rng.random() > 0.2 and not 8.0 < (m[2] - T0) * 1e-9 < 11.0]
    recording = read_recording(make.write(tmp_path / "run", kept, storage), CHANNELS)
    left = recording.angle["left"]
    stamps = [round((m[2] - T0) * 1e-7) / 100 for m in kept if m[0].endswith("left/joint_state")]
    np.testing.assert_allclose(left.time_s, np.array(stamps) - stamps[0], atol=0.006)
    assert 3.0 < np.diff(left.time_s).max() < 3.3
    np.testing.assert_allclose(left.value, 0.5 * np.sin(left.time_s + (recording.start_ns - T0) * 1e-9), atol=1e-8)


def test_single_joint_of_a_linear_axis(tmp_path: Path) -> None:
    axis = Channel(Kind.ANGLE, "left", "axis/joint_state")
    message = ("/axis/joint_state", make.JOINT_STATE, T0 + 1, make.joint_state(T0 + 1, ["any"], [0.1]))
    assert read_recording(make.write(tmp_path / "run", [message]), [axis]).angle["left"].value.tolist() == [0.1]


def test_an_axis_in_metres_may_be_longer_than_half_a_turn(tmp_path: Path) -> None:
    """12 is a position [m] of a long axis, and no angle [rad]."""
    stamped = ((T0 + 10**7, 0.1), (T0 + 2 * 10**7, 12.0))
    messages = [("/axis/joint_state", make.JOINT_STATE, at, make.joint_state(at, ["any"], [x])) for at, x in stamped]
    bag = make.write(tmp_path / "run", messages)
    metres, radians = (Channel(Kind.ANGLE, "left", "axis/joint_state", farthest=farthest) for farthest in (100.0, 3.1))
    assert read_recording(bag, [metres]).angle["left"].value.tolist() == [0.1, 12.0]
    assert read_recording(bag, [radians]).angle["left"].value.tolist() == [0.1]
