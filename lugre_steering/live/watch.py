# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A listener of a live estimator: what it publishes, as it comes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState, Temperature

from lugre_steering.recording import NODE
from lugre_steering.watch.seen import Arrived

WRENCHES = {"torque": "torque", "cylinder_torque": "cylinder torque", "residual": "residual"}


def watch(show: Callable[[Arrived], None], name: str = NODE, seconds: float = math.inf) -> None:
    """Listen to the node ``name`` (with its namespace, if any) for ``seconds``, or until interrupted, and ``show`` what has come."""
    seen = Arrived(name)
    rclpy.init(args=[])
    try:
        node = Node("lugre_steering_watch")
        _subscribe(node, name.strip("/"), seen)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        end = time.monotonic() + seconds
        while time.monotonic() < end and rclpy.ok():
            executor.spin_once(timeout_sec=0.05)
            show(seen)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


def _subscribe(node: Node, name: str, seen: Arrived) -> None:
    """Every output, and its health."""

    def listen(message: type, topic: str, take: Callable[[Any], None]) -> None:
        node.create_subscription(message, topic, take, QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT))

    def wrench(label: str) -> Callable[[Any], None]:
        return lambda message: seen.add(label, "N m", time.monotonic(), message.wrench.torque.z)

    def temperature(side: str) -> Callable[[Any], None]:
        return lambda message: seen.add(f"rubber {side}", "degC", time.monotonic(), message.temperature)

    def joints(message: Any) -> None:
        for joint, angle in zip(message.name, message.position, strict=False):
            seen.add(str(joint), "deg", time.monotonic(), math.degrees(angle))

    def health(message: Any) -> None:
        own = name.rpartition("/")[2]
        told = [
            (status.name.partition(": ")[2], int.from_bytes(status.level, "little"), status.message)
            for status in message.status
            if status.name.partition(": ")[0] == own
        ]
        if told:
            seen.diagnosed(time.monotonic(), told)

    for topic, label in WRENCHES.items():
        listen(WrenchStamped, f"/{name}/{topic}", wrench(label))
    for side in ("left", "right"):
        listen(Temperature, f"/{name}/rubber_temperature/{side}", temperature(side))
    listen(JointState, f"/{name}/estimate", joints)
    listen(DiagnosticArray, "/diagnostics", health)
