# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The node's input topics: each message becomes one sample, or is counted by the reason why it is none."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rclpy._rclpy_pybind11 import EventHandle
from rclpy.event_handler import QoSSubscriptionEventType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import FluidPressure, JointState, Temperature
from trajectory_msgs.msg import JointTrajectory

from lugre_steering.ackermann import other_track
from lugre_steering.errors import DataError
from lugre_steering.estimator.plan import PLAN_BYTES, planned_angles
from lugre_steering.live.health import Health
from lugre_steering.recording import COMMAND, Array, IntArray, Kind
from lugre_steering.vehicle import Vehicle

PLAN_SHARE = 0.1
PLAN_BURST_S = 0.02
"""Of the time so much, at most, goes into plans, and so much at once: what comes beyond is not read, and the plan in force stays until the
next one that is, some hundredths of a second later."""
SECOND_NS = 1_000_000_000

_SCALARS: Mapping[Kind, tuple[type, Callable[[Any], float]]] = {
    Kind.PRESSURE: (FluidPressure, lambda message: message.fluid_pressure),
    Kind.AIR_TEMPERATURE: (Temperature, lambda message: message.temperature),
    Kind.TORQUE: (WrenchStamped, lambda message: message.wrench.torque.z),
}
Push = Callable[[int, int, float, float], None]
"""Channel, stamp [ns], value, rate."""


class Inputs:
    """One subscription per resolved topic; joints that share a topic share its subscription."""

    def __init__(
        self,
        node: Node,
        vehicle: Vehicle,
        depth: int,
        health: Health,
        guarded: Callable[[Callable[..., None]], Callable[..., None]],
        push: Push,
        set_plan: Callable[[Callable[[int], tuple[IntArray, Array]]], None],
        refuse_plan: Callable[[], None],
    ) -> None:
        self._node, self._channels, self._health, self._push = node, vehicle.channels, health, push
        self._set_plan, self._refuse_plan = set_plan, refuse_plan
        self._joints = [getattr(vehicle.topics, f"{side}_joint") for side in vehicle.sides]
        self._frames: dict[int, str] = {}  # of the first message of each channel
        self._spent_s, self._spent_at = 0.0, 0.0  # processor time that plans have taken of late, and when that was so (monotonic)
        overrides = QoSOverridingOptions.with_default_policies()

        def subscribe(message: type, topic: str, handle: Callable[..., None], raw: bool = False) -> Any:
            qos = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
            made = node.create_subscription(message, topic, guarded(handle), qos, qos_overriding_options=overrides, raw=raw)
            lost = EventHandle(made.handle, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MESSAGE_LOST)
            self._lost.append((f"{node.resolve_topic_name(topic)} lost on the way", lost))
            return made

        self._lost: list[tuple[str, EventHandle]] = []
        self._subscriptions = []
        joints: dict[str, list[tuple[int, str]]] = {}
        topics = []
        for index, channel in enumerate(self._channels):
            topic = node.resolve_topic_name(channel.topic)
            topics.append(topic)
            if channel.kind is Kind.ANGLE:
                joints.setdefault(topic, []).append((index, channel.joint))
                continue
            message_type, read = _SCALARS[channel.kind]
            self._subscriptions.append(subscribe(message_type, channel.topic, self._scalar(index, topic, read)))
        for topic, wanted in joints.items():
            name = self._channels[wanted[0][0]].topic  # not yet remapped: create_subscription does that
            self._subscriptions.append(subscribe(JointState, name, self._joint_state(topic, wanted)))
        # As bytes: a flood of long plans, or one whose text is no text, must cost nothing.
        self._subscriptions.append(subscribe(JointTrajectory, COMMAND, self._command, raw=True))
        health.set_topics(topics)

    def count_lost(self) -> None:
        """Count what the middleware has lost since the last time. Asked, not called back: rclpy makes a task of each such event, and many
        are lost where there is no time for tasks."""
        for reason, event in self._lost:
            with event:
                if new := event.take_event().total_count_change:
                    self._health.unused[reason] += new

    def close(self) -> None:
        for _, event in self._lost:
            event.destroy_when_not_in_use()
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def _joint_state(self, topic: str, wanted: list[tuple[int, str]]) -> Callable[[Any], None]:
        told_apart = len({joint for _, joint in wanted}) == 1  # without names

        def handle(message: Any) -> None:
            names, position, velocity = message.name, message.position, message.velocity
            stamp_ns = self._stamp_ns(topic, message.header.stamp)
            if stamp_ns is None:
                return
            carried = False
            for channel, joint in wanted:
                if joint in names:
                    i = names.index(joint)
                elif names or not told_apart:
                    continue
                else:
                    i = 0
                carried = True
                self._see_frame(topic, channel, message.header.frame_id)
                angle = position[i] if i < len(position) else math.nan
                rate = velocity[i] if i < len(velocity) else math.nan
                if ratio := self._channels[channel].ackermann:
                    angle, rate = map(float, other_track(np.array(angle), np.array(rate), ratio))
                self._push(channel, stamp_ns, angle, rate)
            if not carried:
                self._health.foreign[topic] += 1

        return handle

    def _scalar(self, channel: int, topic: str, read: Callable[[Any], float]) -> Callable[[Any], None]:
        def handle(message: Any) -> None:
            stamp_ns = self._stamp_ns(topic, message.header.stamp)
            if stamp_ns is not None:
                self._see_frame(topic, channel, message.header.frame_id)
                self._push(channel, stamp_ns, read(message), math.nan)

        return handle

    def _see_frame(self, topic: str, channel: int, frame: str) -> None:
        """A frame is told, not refused: the value is judged as any other, and drivers fill frames as they like."""
        if frame != self._frames.setdefault(channel, frame):
            self._health.unused[f"{topic} of another frame than at first"] += 1

    def _stamp_ns(self, topic: str, stamp: Any) -> int | None:
        """None, and counted, for a stamp whose nanoseconds are a second or more: it is no time."""
        if stamp.nanosec >= SECOND_NS:
            self._health.unused[f"{topic} malformed"] += 1
            return None
        return int(stamp.sec * SECOND_NS + stamp.nanosec)

    def _command(self, raw: bytes) -> None:
        now, begin = time.monotonic(), time.thread_time()
        self._spent_s = max(0.0, self._spent_s - PLAN_SHARE * (now - self._spent_at))
        self._spent_at = now
        if self._spent_s > PLAN_BURST_S:
            self._health.unused[f"{COMMAND}: too many to read them all"] += 1
            return
        try:
            if len(raw) > PLAN_BYTES:
                raise DataError(f"more than {PLAN_BYTES} bytes")
            try:
                message = deserialize_message(raw, JointTrajectory)
            except Exception as error:  # bytes may be anything, and rclpy raises anything
                raise DataError("malformed") from error
            self._set_plan(lambda latest_ns: planned_angles(message, self._joints, latest_ns))
        except DataError as error:
            self._refuse(str(error))
        finally:
            self._spent_s += time.thread_time() - begin

    def _refuse(self, reason: str) -> None:
        self._health.unused[f"{COMMAND}: {reason}"] += 1
        self._refuse_plan()
