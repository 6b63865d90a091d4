# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""CDR, the wire format of ROS 2, for the few stock messages used here: whole columns at once instead of one by one.

Messages of one topic nearly always differ only in stamp and numbers. The layout of one of them (where its numbers are,
which of its bytes are structure) therefore decodes all others whose structure bytes are equal, as NumPy columns.
Encapsulation, alignment and sequence layout after OMG DDSI-RTPS 2.5 section 10 and OMG CDR (XCDR1), as written by every
ROS 2 middleware; types after common_interfaces (Jazzy).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lugre_steering.bag.messages import Bytes
from lugre_steering.recording import Array, IntArray, Mask

JOINT_STATE = "sensor_msgs/msg/JointState"
FLUID_PRESSURE = "sensor_msgs/msg/FluidPressure"
TEMPERATURE = "sensor_msgs/msg/Temperature"
WRENCH_STAMPED = "geometry_msgs/msg/WrenchStamped"

# float64 fields of these types between the header and the wanted one
_FIELD = {FLUID_PRESSURE: 0, TEMPERATURE: 0, WRENCH_STAMPED: 5}
_STAMP_AT = 4
_LAYOUTS_TRIED = 16
_MOST_JOINTS = 10_000  # in one message: walking millions of names would hold the reader up


class _MalformedError(Exception):
    """The bytes are no message of the expected type."""


class _Cursor:
    """Walks one serialised message and marks the bytes that are structure (encapsulation, lengths, joint names)."""

    def __init__(self, raw: bytes) -> None:
        self.raw, self.order, self.at = raw, "", 4
        self.structure = np.zeros(len(raw), np.uint8)
        self.structure[:2] = 0xFF

    def header(self) -> None:
        """Step over encapsulation, stamp and frame."""
        order = {b"\0\0": ">", b"\0\1": "<"}.get(self.raw[:2])
        if order is None:
            raise _MalformedError
        self.order = order
        self.skip(4, 2)
        self.text(is_structure=False)

    def skip(self, size: int, count: int = 1) -> int:
        """Step over ``count`` aligned primitives of ``size`` bytes; returns where they begin."""
        if count:  # an empty sequence is not followed by padding
            self.at += -(self.at - 4) % size
        begin, self.at = self.at, self.at + size * count
        if self.at > len(self.raw):
            raise _MalformedError
        return begin

    def count(self) -> int:
        at = self.skip(4)
        self.structure[at : self.at] = 0xFF
        return int(struct.unpack_from(self.order + "I", self.raw, at)[0])

    def text(self, *, is_structure: bool) -> bytes:
        begin = self.skip(1, self.count())
        if is_structure:
            self.structure[begin : self.at] = 0xFF
        return self.raw[begin : self.at].rstrip(b"\0")

    def doubles(self) -> tuple[int, int]:
        """(begin, count) of a sequence<double>."""
        count = self.count()
        return self.skip(8, count), count


@dataclass(frozen=True)
class _Layout:
    """Where the wanted numbers of a message are: (value, rate) offsets per joint, -1 where there is none."""

    order: str
    fields: Sequence[tuple[int, int] | None]


def joint_names(raw: bytes) -> list[str]:
    """Joint names of one serialised JointState; empty for a malformed one."""
    cursor = _Cursor(raw)
    try:
        cursor.header()
        return _names(cursor)
    except _MalformedError:
        return []


def _names(cursor: _Cursor) -> list[str]:
    count = cursor.count()
    if count > _MOST_JOINTS:
        raise _MalformedError
    return [cursor.text(is_structure=True).decode("utf-8", "replace") for _ in range(count)]


def _layout(cursor: _Cursor, msgtype: str, joints: Sequence[str]) -> _Layout:
    cursor.header()
    if msgtype != JOINT_STATE:
        return _Layout(
            cursor.order, [(cursor.skip(8, _FIELD[msgtype] + 1) + 8 * _FIELD[msgtype], -1)]
        )
    names = _names(cursor)
    sequences = (cursor.doubles(), cursor.doubles())
    cursor.doubles()  # effort: read only to be sure that the message is whole
    fields: list[tuple[int, int] | None] = []
    ambiguous = not names and len(set(joints)) > 1  # positions without names cannot be told apart
    for joint in joints:
        if ambiguous or (names and joint and joint not in names):
            fields.append(None)
            continue
        i = names.index(joint) if joint in names else 0
        position, velocity = (begin + 8 * i if i < count else -1 for begin, count in sequences)
        fields.append((position, velocity))
    return _Layout(cursor.order, fields)


def _column(rows: Bytes, at: int, dtype: str) -> NDArray[np.generic]:
    column: NDArray[np.generic] = np.ascontiguousarray(rows[:, at : at + int(dtype[-1])]).view(dtype)[:, 0]
    return column


@dataclass(frozen=True)
class Decoded:
    """Columns of n messages for j joints (1 for types without joints)."""

    valid: Mask  # (n,) the message is well-formed
    stamp_ns: IntArray  # (n,)
    carried: Mask  # (j, n) the message speaks of this joint
    value: Array  # (j, n) NaN where it gives no value
    rate: Array  # (j, n)


def decode(rows: Bytes, msgtype: str, joints: Sequence[str] = ("",)) -> Decoded:
    """Decode n equally long serialised messages ``rows`` (n, length) of one stock type."""
    n = len(rows)
    shape = (len(joints), n)
    result = Decoded(
        np.zeros(n, np.bool_),
        np.zeros(n, np.int64),
        np.zeros(shape, np.bool_),
        np.full(shape, np.nan),
        np.full(shape, np.nan),
    )
    todo = np.arange(n)
    layouts = 0
    while len(todo):
        first = rows[todo[0]]
        cursor, layout = _Cursor(first.tobytes()), None
        with suppress(_MalformedError):  # as are those that look like it so far
            layout = _layout(cursor, msgtype, joints)
        # Where every message looks different, comparing each with all others would cost the square of their number.
        among = todo if layouts < _LAYOUTS_TRIED else todo[:1]
        layouts += 1
        alike = ~((rows[among] ^ first) & cursor.structure).any(axis=1)
        if layout is not None:
            _fill(result, rows, among[alike], layout)
        todo = np.concatenate([among[~alike], todo[len(among) :]])
    return result


def _fill(result: Decoded, rows: Bytes, which: IntArray, layout: _Layout) -> None:
    same = rows[which]
    seconds = _column(same, _STAMP_AT, layout.order + "i4").astype(np.int64)
    nanoseconds = _column(same, _STAMP_AT + 4, layout.order + "u4").astype(np.int64)
    result.stamp_ns[which] = seconds * 1_000_000_000 + nanoseconds
    result.valid[which] = nanoseconds < 1_000_000_000
    for j, field in enumerate(layout.fields):
        if field is None:
            continue
        result.carried[j, which] = True
        for target, at in zip((result.value, result.rate), field, strict=True):
            if at >= 0:
                target[j, which] = _column(same, at, layout.order + "f8")


def _encode(stamp_ns: ArrayLike, frame_id: str, parts: Sequence[bytes | Array]) -> Bytes:
    """Rows of n messages: header, then bytes that all share and float64 columns (n, k), each aligned as CDR asks."""
    stamp = np.asarray(stamp_ns, np.int64)
    n = len(stamp)
    pieces = [
        np.broadcast_to(np.frombuffer(b"\0\1\0\0", np.uint8), (n, 4)),
        (stamp // 1_000_000_000).astype("<i4")[:, None].view(np.uint8),
        (stamp % 1_000_000_000).astype("<u4")[:, None].view(np.uint8),
    ]
    size = 8
    for part in (_text(frame_id), *parts):
        alignment, data = (4, part) if isinstance(part, bytes) else (8, None)
        padding = -size % alignment
        pieces.append(np.zeros((n, padding), np.uint8))
        if data is None:
            pieces.append(np.ascontiguousarray(part, "<f8").view(np.uint8))
        else:
            pieces.append(np.broadcast_to(np.frombuffer(data, np.uint8), (n, len(data))))
        size += padding + pieces[-1].shape[1]
    return np.concatenate(pieces, axis=1)


def _text(text: str) -> bytes:
    raw = text.encode() + b"\0"
    return struct.pack("<I", len(raw)) + raw


def _joined(parts: Sequence[bytes]) -> bytes:
    """Sequence of 4-byte aligned items."""
    out = b""
    for part in parts:
        out += b"\0" * (-len(out) % 4) + part
    return out


def encode_joint_state(
    stamp_ns: ArrayLike,
    frame_id: str,
    names: Sequence[str],
    position: Array | None = None,
    velocity: Array | None = None,
    effort: Array | None = None,
) -> Bytes:
    """JointState messages as rows (n, length); each quantity is (n, joints), or absent (an empty sequence)."""
    parts: list[bytes | Array] = [_joined([struct.pack("<I", len(names)), *map(_text, names)])]
    for column in (position, velocity, effort):
        count = 0 if column is None else column.shape[1]
        parts.append(struct.pack("<I", count))
        if column is not None and count:
            parts.append(column)
    return _encode(stamp_ns, frame_id, parts)


def encode_fluid_pressure(stamp_ns: ArrayLike, frame_id: str, pressure_Pa: Array) -> Bytes:
    """FluidPressure messages (n, length); variance 0 = unknown."""
    return _encode(stamp_ns, frame_id, [np.column_stack([pressure_Pa, np.zeros(len(pressure_Pa))])])


def encode_temperature(stamp_ns: ArrayLike, frame_id: str, temperature_degC: Array) -> Bytes:
    """Temperature messages (n, length); variance 0 = unknown."""
    return _encode(stamp_ns, frame_id, [np.column_stack([temperature_degC, np.zeros(len(temperature_degC))])])


def encode_wrench(stamp_ns: ArrayLike, frame_id: str, torque_z_Nm: Array) -> Bytes:
    """WrenchStamped messages (n, length) with only torque.z set."""
    wrench = np.zeros((len(torque_z_Nm), 6))
    wrench[:, 5] = torque_z_Nm
    return _encode(stamp_ns, frame_id, [wrench])
