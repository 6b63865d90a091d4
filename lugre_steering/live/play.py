# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A bag on topics, in its own timing: to try the live node where no ROS command line is installed."""

from __future__ import annotations

import importlib
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile

from lugre_steering.bag import Bag, Messages
from lugre_steering.errors import BagError
from lugre_steering.pool import Progress
from lugre_steering.recording import NODE

NAME = "lugre_steering_play"
DEPTH = 200
SECOND_NS = 1_000_000_000
NAP_S = 0.002
"""Earlier than this, a message is as good as due: no clock wakes up more exactly."""


@dataclass(frozen=True)
class Played:
    """Messages by topic, topics left out with the reason, and how often the bag was begun."""

    messages: Counter[str]
    left_out: dict[str, str]
    rounds: int


def play(
    path: Path,
    *,
    rate: float = 1.0,
    loop: bool = False,
    recorded_stamps: bool = False,
    wait_s: float = 2.0,
    progress: Progress = lambda *_: None,
) -> Played:
    """Publish every message of a bag ``rate`` times as fast as it was logged, again and again with ``loop``, until interrupted.

    Header stamps are moved so that the bag begins now, their distances stay; ``recorded_stamps`` leaves them. What a live estimator
    published is left out: it may run beside this. ``wait_s``: how long a first subscriber is waited for [s].
    """
    rclpy.init(args=[])
    try:
        player = _Player(Node(NAME), path, rate, recorded_stamps, progress)
        rounds = 0
        with_subscriber = time.monotonic() + wait_s
        try:
            while rounds == 0 or loop:
                rounds += 1
                player.once(with_subscriber)
        except (KeyboardInterrupt, ExternalShutdownException):
            pass
        return Played(player.messages, player.left_out, rounds)
    finally:
        rclpy.try_shutdown()


class _Player:
    def __init__(self, node: Node, path: Path, rate: float, recorded_stamps: bool, progress: Progress) -> None:
        self._node, self._path, self._rate, self._keep, self._progress = node, path, rate, recorded_stamps, progress
        self._publishers: dict[str, tuple[Any, bool] | None] = {}
        self.messages: Counter[str] = Counter()
        self.left_out: dict[str, str] = {}

    def once(self, with_subscriber: float) -> None:
        """The bag from its beginning to its end."""
        with Bag(self._path) as bag:
            for connection in bag.connections:
                self._publisher(connection.topic, connection.msgtype)
            if not any(self._publishers.values()):
                reasons = "; ".join(f"{topic}: {why}" for topic, why in self.left_out.items()) or "it is empty"
                raise BagError(f"{self._path}: no topic to publish ({reasons})")
            while time.monotonic() < with_subscriber and not self._heard():
                time.sleep(0.02)
            first_ns: int | None = None
            done = 0
            for block in bag.messages():
                if len(block) and first_ns is None:
                    first_ns = int(block.log_ns[0])
                    self._begin(first_ns)
                self._block(bag, block)
                done += len(block)
                self._progress(bag.name, done, bag.message_count)

    def _heard(self) -> bool:
        return any(made[0].get_subscription_count() for made in self._publishers.values() if made is not None)

    def _begin(self, first_ns: int) -> None:
        self._first_ns, self._begun = first_ns, time.monotonic()
        self._shift_ns = 0 if self._keep else time.time_ns() - first_ns

    def _block(self, bag: Bag, block: Messages) -> None:
        for i in range(len(block)):
            connection = bag.connections[int(block.connection[i])]
            made = self._publisher(connection.topic, connection.msgtype)
            if made is None:
                continue
            due = self._begun + (int(block.log_ns[i]) - self._first_ns) * 1e-9 / self._rate
            while (early := due - time.monotonic()) > NAP_S:
                time.sleep(min(early, 0.1))
                if not rclpy.ok():
                    raise ExternalShutdownException
            publisher, stamped = made
            raw = block.bytes_of(i)
            publisher.publish(moved(raw, self._shift_ns) if stamped and self._shift_ns else bytes(raw))
            self.messages[connection.topic] += 1

    def _publisher(self, topic: str, msgtype: str) -> tuple[Any, bool] | None:
        """The publisher of a topic, and whether its messages begin with a header; None for what is not published."""
        if topic not in self._publishers:
            self._publishers[topic] = None
            message = None if NODE in topic.split("/") else _message_class(msgtype)
            if message is None:
                own = NODE in topic.split("/")
                self.left_out[topic] = "an output of the estimator" if own else f"type {msgtype} is not installed"
            else:
                fields = message.get_fields_and_field_types()
                stamped = next(iter(fields.values()), "") == "std_msgs/Header"
                self._publishers[topic] = self._node.create_publisher(message, topic, QoSProfile(depth=DEPTH)), stamped
        return self._publishers[topic]


def _message_class(msgtype: str) -> Any | None:
    """The Python class of a message type, as ``sensor_msgs/msg/JointState`` or without the middle; None where there is none."""
    package, _, name = msgtype.replace("/msg/", "/").partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name, None)
    except (ImportError, ValueError):
        return None


def moved(raw: bytes, shift_ns: int) -> bytes:
    """A serialised message that begins with a header, its stamp ``shift_ns`` later; one without a stamp stays without."""
    if len(raw) < 12:
        return bytes(raw)
    order = "little" if raw[1] & 1 else "big"
    second, nanosecond = (int.from_bytes(raw[k : k + 4], order) for k in (4, 8))  # type: ignore[arg-type]
    if not second and not nanosecond:
        return bytes(raw)
    second, nanosecond = divmod(second * SECOND_NS + nanosecond + shift_ns, SECOND_NS)
    if not 0 <= second < 2**31:
        return bytes(raw)
    return bytes(raw[:4]) + second.to_bytes(4, order) + nanosecond.to_bytes(4, order) + bytes(raw[12:])  # type: ignore[arg-type]
