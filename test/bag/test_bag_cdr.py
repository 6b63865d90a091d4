# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Decoding and encoding of CDR against rosbags' own serialisation."""

from __future__ import annotations

import bag_making as make
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lugre_steering.bag import cdr

T = make.T0
STAMPS = T + np.array([0, 1, 999_999_999, 1_000_000_000, 5_123_456_789])


def rows(*messages: bytes) -> np.ndarray:
    return np.array([list(m) for m in messages], np.uint8)


@pytest.mark.parametrize("frame", ["", "a", "ab", "abc", "steering_axle", "Fräse"])
def test_encoded_columns_equal_rosbags_byte_for_byte(frame: str) -> None:
    x = np.linspace(-1.0, 1.0, len(STAMPS))
    assert [bytes(r) for r in cdr.encode_wrench(STAMPS, frame, x)] == [
        make.pack(
            make.TYPES.types[make.WRENCH](
                make.header(int(t), frame),
                make.TYPES.types["geometry_msgs/msg/Wrench"](
                    make.TYPES.types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0),
                    make.TYPES.types["geometry_msgs/msg/Vector3"](0.0, 0.0, v),
                ),
            )
        )
        for t, v in zip(STAMPS, x, strict=True)
    ]
    assert [bytes(r) for r in cdr.encode_fluid_pressure(STAMPS, frame, x)] == [
        make.pressure(int(t), v, frame) for t, v in zip(STAMPS, x, strict=True)
    ]
    assert [bytes(r) for r in cdr.encode_temperature(STAMPS, "axle", x)] == [
        make.temperature(int(t), v) for t, v in zip(STAMPS, x, strict=True)
    ]
    two = np.column_stack([x, -x])
    for names in ([], ["left"], ["left", "r"], ["le", "right_joint"]):
        for position, velocity, effort in [(two, two, two), (two, None, two), (None, None, None), (two, two, None)]:
            encoded = cdr.encode_joint_state(STAMPS, frame, names, position, velocity, effort)
            for i, t in enumerate(STAMPS):
                arrays = [() if a is None else a[i] for a in (position, velocity, effort)]
                assert bytes(encoded[i]) == make.joint_state(int(t), names, *arrays, frame=frame)


@settings(max_examples=150)
@given(
    frame=st.text(max_size=9),
    names=st.lists(
        st.text(st.characters(min_codepoint=97, max_codepoint=122), min_size=1, max_size=7), max_size=4, unique=True
    ),
    counts=st.tuples(*[st.integers(0, 5)] * 3),
    wanted=st.integers(0, 3),
    little_endian=st.booleans(),
)
def test_any_joint_state_layout_decodes(frame, names, counts, wanted, little_endian) -> None:
    values = [np.arange(c) + 10.0 * k + 0.25 for k, c in enumerate(counts)]
    raw = make.joint_state(T + 5, names, *values, frame=frame, little_endian=little_endian)
    joint = names[wanted] if wanted < len(names) else "absent joint"
    decoded = cdr.decode(rows(raw, raw), make.JOINT_STATE, [joint])
    assert decoded.valid.all()
    assert (decoded.stamp_ns == T + 5).all()
    index = names.index(joint) if joint in names else 0
    assert (decoded.carried == (joint in names or not names)).all()
    for column, given_values in ((decoded.value, values[0]), (decoded.rate, values[1])):
        expected = given_values[index] if decoded.carried[0, 0] and index < len(given_values) else np.nan
        np.testing.assert_array_equal(column[0], [expected, expected])


@pytest.mark.parametrize("little_endian", [True, False])
def test_scalar_types_in_both_byte_orders(little_endian: bool) -> None:
    for build, msgtype in (
        (make.pressure, make.FLUID_PRESSURE),
        (make.temperature, make.TEMPERATURE),
        (make.wrench, make.WRENCH),
    ):
        decoded = cdr.decode(rows(build(T + 3, 42.5, little_endian=little_endian)), msgtype)
        assert (decoded.value[0, 0], decoded.stamp_ns[0]) == (42.5, T + 3)


def test_equally_long_messages_of_different_layout_are_told_apart() -> None:
    """Same length, joints swapped or others: the structure decides, message by message."""
    messages = []
    for i in range(200):
        names = [["left", "rght"], ["rght", "left"], ["lxft", "rght"]][i % 3]
        messages.append(make.joint_state(T + i, names, [i, -i]))
    decoded = cdr.decode(rows(*messages), make.JOINT_STATE, ["left"])
    expected = [float(i) if i % 3 == 0 else float(-i) if i % 3 == 1 else np.nan for i in range(200)]
    np.testing.assert_array_equal(decoded.value[0], expected)
    np.testing.assert_array_equal(decoded.carried[0], [i % 3 != 2 for i in range(200)])


def test_as_many_layouts_as_messages() -> None:
    messages = [make.joint_state(T + i, [f"joint_{i:03d}", "left"], [9.0, i]) for i in range(300)]
    np.testing.assert_array_equal(cdr.decode(rows(*messages), make.JOINT_STATE, ["left"]).value[0], np.arange(300.0))


def test_a_counter_in_the_frame_id_is_not_structure() -> None:
    messages = [make.pressure(T + i, float(i), f"frame{i:02d}") for i in range(50)]
    np.testing.assert_array_equal(cdr.decode(rows(*messages), make.FLUID_PRESSURE).value[0], np.arange(50.0))


def test_malformed_messages_are_marked_and_cost_nothing_else() -> None:
    good = make.joint_state(T, ["left"], [0.5])
    broken = []
    for at, byte in ((1, 7), (15, 0xFF), (12, 0xF0), (24, 0xFF)):  # encapsulation, lengths, counts
        raw = bytearray(good)
        raw[at] = byte
        broken.append(bytes(raw))
    bad_nanoseconds = bytearray(good)
    bad_nanoseconds[8:12] = b"\xff" * 4
    decoded = cdr.decode(rows(good, *broken, bytes(bad_nanoseconds), good), make.JOINT_STATE, ["left"])
    assert decoded.valid.tolist() == [True, *[False] * (len(broken) + 1), True]
    assert decoded.value[0, [0, -1]].tolist() == [0.5, 0.5]
    for size in range(len(good)):
        assert not cdr.decode(rows(good[:size]), make.JOINT_STATE, ["left"]).valid.any(), size
