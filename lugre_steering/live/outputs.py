# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The node's output topics. Message objects are reused; every number is a Python float and finite before it leaves."""

from __future__ import annotations

import math
import time
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import WrenchStamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Float64MultiArray

from lugre_steering.chain.step import Records
from lugre_steering.estimator.commands import CommandRamp, Fade
from lugre_steering.live.parameters import Settings
from lugre_steering.vehicle import Vehicle


def publish_if_heard(publisher: Publisher, message: Any) -> None:
    """Publish, unless nobody would hear it: to ask costs a seventh of handing over a message."""
    if publisher.get_subscription_count():
        publisher.publish(message)


class Outputs:
    """Publishes what the estimator returns."""

    def __init__(self, node: Node, vehicle: Vehicle, settings: Settings, rate_limit_Nm_s: float) -> None:
        self._node = node
        self._publishers: list[Publisher] = []
        overrides = QoSOverridingOptions.with_default_policies()
        self._stamp = Time()
        joints = [getattr(vehicle.topics, f"{side}_joint") for side in vehicle.sides]
        self._sides = len(joints)
        frame = settings.frame_id

        def publisher(message: type, topic: str) -> Publisher:
            # Reliable, because ros2_control and most tools subscribe so; best-effort subscribers receive it as well.
            made = node.create_publisher(message, topic, QoSProfile(depth=50), qos_overriding_options=overrides)
            self._publishers.append(made)
            return made

        self._torque = self._wrench(frame), publisher(WrenchStamped, "~/torque")
        self._cylinder_torque = self._wrench(frame), publisher(WrenchStamped, "~/cylinder_torque")
        self._residual = self._wrench(frame), publisher(WrenchStamped, "~/residual")
        self._estimate = self._joint_state(frame, joints), publisher(JointState, "~/estimate")
        self._feed_forward = self._joint_state(frame, joints), publisher(JointState, "~/feed_forward")
        self._temperatures = []
        if vehicle.rubber is not None:
            for side in vehicle.sides:
                message = Temperature()
                message.header.frame_id = f"{side}_track"
                message.header.stamp = self._stamp
                self._temperatures.append((message, publisher(Temperature, f"~/rubber_temperature/{side}")))
        self._commands: tuple[Float64MultiArray, Publisher] | None = None
        if settings.publish_commands:
            self._commands = Float64MultiArray(), publisher(Float64MultiArray, "~/feed_forward/commands")
        self._ramp = CommandRamp(settings.angle_timeout_s, settings.options.recovery_ramp_s, rate_limit_Nm_s, self._sides)
        self._rate_limit_Nm_s = rate_limit_Nm_s
        self.released: list[float] = []  # feed-forward last published; empty before the first
        self.fading: Fade | None = None
        self._fade_commands: Fade | None = None

    def close(self) -> None:
        for publisher in self._publishers:
            self._node.destroy_publisher(publisher)

    def set_ramp(self, settings: Settings, rate_limit_Nm_s: float) -> None:
        self._ramp.set_limits(settings.angle_timeout_s, settings.options.recovery_ramp_s, rate_limit_Nm_s)
        self._rate_limit_Nm_s = rate_limit_Nm_s

    def begin_fade(self, ramp_s: float, longest_s: float = math.inf) -> None:
        """From now on ``fade`` leads the feed-forward to zero, by the steady clock: simulated time may stand still.

        It takes longer than the ramp where the limit of rate asks for that, but no more than ``longest_s``.
        """
        now_ns = time.monotonic_ns()
        largest = max(map(abs, (*self.released, *self._ramp.published)))
        ramp_s = min(longest_s, max(ramp_s, largest / self._rate_limit_Nm_s))
        self.fading = Fade(now_ns, self.released, ramp_s)
        self._fade_commands = Fade(now_ns, self._ramp.published, ramp_s)

    @property
    def faded(self) -> bool:
        """Whether the feed-forward that others know is zero."""
        return not any(self.released) and not any(self._ramp.published)

    def fade(self, stamp_ns: int) -> None:
        """Publish the next feed-forward on the way to zero, stamped with the time."""
        if self.fading is None or self._fade_commands is None or not self.released:
            return
        now_ns = time.monotonic_ns()
        self._set_stamp(stamp_ns)
        message, publisher = self._feed_forward
        message.effort = self.released = self.fading(now_ns)
        publisher.publish(message)
        if self._commands is not None:
            command, publisher = self._commands
            command.data = self._fade_commands(now_ns)
            self._ramp.set(command.data)
            publisher.publish(command)

    def await_arrival(self, patience_s: float) -> None:
        """Until reliable listeners have the feed-forward published last, no longer than that: a publisher that goes takes along what
        is still on its way."""
        for _, publisher in filter(None, (self._feed_forward, self._commands)):
            publisher.wait_for_all_acked(Duration(seconds=patience_s))

    def _wrench(self, frame: str) -> WrenchStamped:
        message = WrenchStamped()
        message.header.frame_id = frame
        message.header.stamp = self._stamp
        return message

    def _joint_state(self, frame: str, joints: list[str]) -> JointState:
        message = JointState(name=joints)
        message.header.frame_id = frame
        message.header.stamp = self._stamp
        return message

    def _set_stamp(self, stamp_ns: int) -> None:
        self._stamp.sec, self._stamp.nanosec = divmod(stamp_ns, 1_000_000_000)

    def torque(self, stamp_ns: int, torque: float) -> bool:
        """Publish the total torque; False, and nothing published, if it is not a finite number."""
        if not math.isfinite(torque):
            return False
        self._set_stamp(stamp_ns)
        message, publisher = self._torque
        message.wrench.torque.z = torque
        publisher.publish(message)
        return True

    def estimate(self, stamp_ns: int, row: Records) -> bool:
        """Publish angles, rates, torques and temperatures of each joint; False, and nothing published, if one of them or of the
        feed-forward is not a finite number."""
        n = self._sides
        theta, omega, torque, temperature = (row[name][:n].tolist() for name in ("theta", "omega", "torque", "temperature"))
        if not math.isfinite(sum(theta) + sum(omega) + sum(torque) + sum(temperature) + sum(row["feed_forward"][:n].tolist())):
            return False
        self._set_stamp(stamp_ns)
        message, publisher = self._estimate
        message.position, message.velocity, message.effort = theta, omega, torque
        publish_if_heard(publisher, message)
        for (message, publisher), value in zip(self._temperatures, temperature, strict=False):
            message.temperature = value
            publish_if_heard(publisher, message)
        return True

    def feed_forward(self, stamp_ns: int, now_ns: int, row: Records) -> None:
        """Publish the feed-forward, as commands too if the node is to; the caller sees to it that ``row`` is fresh."""
        wanted = row["feed_forward"][: self._sides].tolist()
        self._set_stamp(stamp_ns)
        message, publisher = self._feed_forward
        message.effort = self.released = wanted
        publish_if_heard(publisher, message)
        self.fading = None
        if self._commands is not None:
            command, publisher = self._commands
            command.data = self._ramp(now_ns, wanted)
            publisher.publish(command)

    def interrupt_commands(self) -> None:
        """Commands go on from the last one along a new ramp: what comes next may be far from it."""
        self._ramp.restart()

    def residual(self, row: Records) -> bool:
        """Publish cylinder torque and residual of one past stamp."""
        measured, residual = float(row["measured_torque"]), float(row["residual"])
        if not math.isfinite(measured + residual):
            return False
        self._set_stamp(int(row["stamp_ns"]))
        for (message, publisher), value in ((self._cylinder_torque, measured), (self._residual, residual)):
            message.wrench.torque.z = value
            publish_if_heard(publisher, message)
        return True
