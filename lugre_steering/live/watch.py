# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A live estimator in the terminal: what it publishes, as it comes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rich.console import Console
from rich.live import Live
from sensor_msgs.msg import JointState, Temperature

from lugre_steering.live.view import State, view
from lugre_steering.recording import NODE

REFRESH_S = 0.25
WRENCHES = {"torque": "torque", "cylinder_torque": "cylinder torque", "residual": "residual"}


def watch(console: Console, name: str = NODE, seconds: float = math.inf) -> State:
    """Show the node ``name`` (with its namespace, if any) for ``seconds``, or until interrupted; what was seen."""
    state = State(name)
    rclpy.init(args=[])
    try:
        node = Node("lugre_steering_watch")
        _subscribe(node, name.strip("/"), state)
        end = time.monotonic() + seconds
        plain = not console.encoding.startswith("utf")
        with Live(view(state, time.monotonic(), plain), console=console, auto_refresh=False, transient=not console.is_terminal) as live:
            shown = 0.0
            try:
                while time.monotonic() < end and rclpy.ok():
                    rclpy.spin_once(node, timeout_sec=0.05)
                    if time.monotonic() - shown > REFRESH_S:
                        shown = time.monotonic()
                        if console.is_terminal:
                            live.update(view(state, shown, plain), refresh=True)
            except (KeyboardInterrupt, ExternalShutdownException):
                pass
        if not console.is_terminal:
            console.print(view(state, time.monotonic(), plain))
        return state
    finally:
        rclpy.try_shutdown()


def _subscribe(node: Node, name: str, state: State) -> None:
    """Every output, and its health."""

    def listen(message: type, topic: str, take: Callable[[Any], None]) -> None:
        node.create_subscription(message, topic, take, qos_profile_sensor_data)

    def wrench(label: str) -> Callable[[Any], None]:
        return lambda message: state.add(label, "N m", time.monotonic(), message.wrench.torque.z)

    def temperature(side: str) -> Callable[[Any], None]:
        return lambda message: state.add(f"rubber {side}", "degC", time.monotonic(), message.temperature)

    def joints(message: Any) -> None:
        for joint, angle in zip(message.name, message.position, strict=False):
            state.add(str(joint), "deg", time.monotonic(), math.degrees(angle))

    def health(message: Any) -> None:
        own = name.rpartition("/")[2]
        told = [
            (status.name.partition(": ")[2], int.from_bytes(status.level, "little"), status.message)
            for status in message.status
            if status.name.partition(": ")[0] == own
        ]
        if told:
            state.diagnosed(time.monotonic(), told)

    for topic, label in WRENCHES.items():
        listen(WrenchStamped, f"/{name}/{topic}", wrench(label))
    for side in ("left", "right"):
        listen(Temperature, f"/{name}/rubber_temperature/{side}", temperature(side))
    listen(JointState, f"/{name}/estimate", joints)
    listen(DiagnosticArray, "/diagnostics", health)
