# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The node: each input message is one sample pushed into the estimator; what comes out is published at once."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import FluidPressure, JointState, Temperature
from trajectory_msgs.msg import JointTrajectory

from lugre_steering.ackermann import other_track
from lugre_steering.chain.step import Records
from lugre_steering.errors import DataError
from lugre_steering.estimator import Estimator, Options
from lugre_steering.live.health import Health
from lugre_steering.live.outputs import Outputs
from lugre_steering.live.parameters import declare
from lugre_steering.live.plan import planned_angles
from lugre_steering.recording import NODE, Kind
from lugre_steering.vehicle import Vehicle, load

LATENCY_WINDOW = 4096

_SCALARS: Mapping[Kind, tuple[type, Callable[[Any], float]]] = {
    Kind.PRESSURE: (FluidPressure, lambda message: message.fluid_pressure),
    Kind.AIR_TEMPERATURE: (Temperature, lambda message: message.temperature),
    Kind.TORQUE: (WrenchStamped, lambda message: message.wrench.torque.z),
}


class SteeringTorqueEstimator(Node):
    """See INTERFACE: topics in, topics out. Raises ``LugreSteeringError`` for bad parameters or a bad vehicle file."""

    def __init__(self, *, latency_window: int = LATENCY_WINDOW) -> None:
        super().__init__(NODE)
        self.settings = settings = declare(self)
        with warnings.catch_warnings(record=True) as doubts:
            warnings.simplefilter("always")
            self.vehicle = load(settings.vehicle_file)
        for doubt in doubts:
            self.get_logger().warning(str(doubt.message))
        begin = time.monotonic()
        self.get_logger().info("loading compiled code (the first start compiles it, which takes up to a minute)")
        warm_up(self.vehicle, settings.options)
        self.estimator = Estimator(self.vehicle, settings.options)
        self.health = Health(self.vehicle, settings.angle_timeout_s, settings.pressure_timeout_s, latency_window)
        self.outputs = Outputs(self, self.vehicle, settings)
        self._fresh_ns = round(settings.angle_timeout_s * 1e9)
        self._joints = [getattr(self.vehicle.topics, f"{side}_joint") for side in self.vehicle.sides]
        self._torque_ns = 0  # stamp of the newest torque
        self._now_ns: Callable[[], int] = time.time_ns
        self._choose_clock()
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._reported_ns = time.monotonic_ns()
        # Steady, so that health is reported while simulated time stands still.
        self.create_timer(1.0, self._guarded(self._report), clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._subscribe()
        self.get_logger().info(
            f"'{self.vehicle.name}' ready, executor '{settings.executor}'; "
            f"compiled code loaded in {time.monotonic() - begin:.2f} s"
        )

    # --------------------------------------------------------------- inputs

    def _subscribe(self) -> None:
        """One subscription per resolved topic; joints that share a topic share its subscription."""
        qos = QoSProfile(depth=self.settings.input_depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        joints: dict[str, list[tuple[int, str]]] = {}
        topics = []
        for index, channel in enumerate(self.vehicle.channels):
            topic = self.resolve_topic_name(channel.topic)
            topics.append(topic)
            if channel.kind is Kind.ANGLE:
                joints.setdefault(topic, []).append((index, channel.joint))
                continue
            message_type, read = _SCALARS[channel.kind]
            self.create_subscription(message_type, channel.topic, self._guarded(self._scalar(index, read)), qos)
        for topic, wanted in joints.items():
            name = self.vehicle.channels[wanted[0][0]].topic  # not yet remapped: create_subscription does that
            self.create_subscription(JointState, name, self._guarded(self._joint_state(topic, wanted)), qos)
        self.create_subscription(JointTrajectory, "steering/command", self._guarded(self._command), qos)
        self.health.set_topics(topics)

    def _guarded(self, handle: Callable[..., None]) -> Callable[..., None]:
        """``handle``, made unable to end the node: an exception would escape spin."""

        def callback(*message: Any) -> None:
            self.health.callbacks += 1
            try:
                handle(*message)
            except Exception as error:
                self.fault(error)

        return callback

    def fault(self, error: BaseException) -> None:
        """Count an exception, report it, and withhold the outputs for a while."""
        self.health.fault(error, time.monotonic_ns())
        self.outputs.interrupt_commands()
        self.get_logger().error(f"{type(error).__name__}: {error}", throttle_duration_sec=1.0)

    def _joint_state(self, topic: str, wanted: list[tuple[int, str]]) -> Callable[[Any], None]:
        told_apart = len({joint for _, joint in wanted}) == 1  # without names

        def handle(message: Any) -> None:
            names, position, velocity = message.name, message.position, message.velocity
            stamp_ns = _nanoseconds(message.header.stamp)
            carried = False
            for channel, joint in wanted:
                if joint in names:
                    i = names.index(joint)
                elif names or not told_apart:
                    continue
                else:
                    i = 0
                carried = True
                angle = position[i] if i < len(position) else math.nan
                rate = velocity[i] if i < len(velocity) else math.nan
                if ratio := self.vehicle.channels[channel].ackermann:
                    angle, rate = map(float, other_track(np.array(angle), np.array(rate), ratio))
                self._push(channel, stamp_ns, angle, rate)
            if not carried:
                self.health.foreign[topic] += 1

        return handle

    def _scalar(self, channel: int, read: Callable[[Any], float]) -> Callable[[Any], None]:
        def handle(message: Any) -> None:
            self._push(channel, _nanoseconds(message.header.stamp), read(message), math.nan)

        return handle

    def _command(self, message: Any) -> None:
        latest_ns = max(self.estimator.latest_ns[f"angle/{side}"] for side in self.vehicle.sides)
        try:
            times, angles = planned_angles(message, self._joints, latest_ns)
        except DataError as error:
            self.health.unused[f"steering/command: {error}"] += 1
            return
        self.estimator.set_plan(times, angles)

    # -------------------------------------------------------------- outputs

    def _push(self, channel: int, stamp_ns: int, value: float, rate: float) -> None:
        # Arrival is the begin of the callback: the time of reception that rclpy offers (MessageInfo) makes
        # EventsExecutor of rclpy 7.1 raise SystemError.
        begin_ns = time.monotonic_ns()
        health = self.health
        now_ns = self._now_ns()
        health.arrivals[channel] += 1
        health.arrived_ns[channel] = now_ns
        health.behind_ns[channel] = now_ns - stamp_ns
        estimates, residuals = self.estimator.push(channel, stamp_ns, value, rate)
        if estimates.size:
            self._publish(estimates[0], begin_ns)
        for residual in residuals:
            if self.outputs.residual(residual):
                health.add_residual(float(residual["residual"]), float(residual["measured_torque"]))
            else:
                health.withheld["residual is not a finite number"] += 1

    def _publish(self, row: Records, begin_ns: int) -> None:
        health, outputs = self.health, self.outputs
        stamp_ns = int(row["stamp_ns"])
        if stamp_ns <= self._torque_ns:  # the estimator began anew
            outputs.interrupt_commands()
        self._torque_ns = stamp_ns
        if health.faulty(begin_ns):
            self._withhold("after an exception")
            return
        if not outputs.torque(stamp_ns, float(row["total"])):
            self._withhold("torque is not a finite number")
            return
        now_ns = self._now_ns()
        health.estimates += 1
        health.arrival_to_publish.add(time.monotonic_ns() - begin_ns)
        health.stamp_to_publish.add(now_ns - stamp_ns)
        if not outputs.estimate(stamp_ns, row):
            self._withhold("estimate is not a finite number")
        elif abs(now_ns - stamp_ns) <= self._fresh_ns:
            outputs.commands(now_ns, row)
        elif self.settings.publish_commands:
            self._withhold("commands: stamps are not close to the clock")

    def _withhold(self, reason: str) -> None:
        self.health.withheld[reason] += 1
        self.outputs.interrupt_commands()

    def _choose_clock(self) -> None:
        """ROS time: simulated time where it is in use, else the system clock itself (30 times cheaper to read)."""
        clock = self.get_clock()
        self._now_ns = (lambda: int(clock.now().nanoseconds)) if clock.ros_time_is_active else time.time_ns

    def _report(self) -> None:
        self._choose_clock()
        monotonic_ns = time.monotonic_ns()
        elapsed_s = (monotonic_ns - self._reported_ns) * 1e-9
        self._reported_ns = monotonic_ns
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        message.status = self.health.statuses(
            self._now_ns(), monotonic_ns, elapsed_s, self.estimator.counters, self.estimator.saturated_steps
        )
        self._diagnostics.publish(message)


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec * 1_000_000_000 + stamp.nanosec)


def warm_up(vehicle: Vehicle, options: Options) -> None:
    """Compile, or load from the cache, everything that callbacks call, on an estimator that is then thrown away."""
    estimator = Estimator(vehicle, options)
    for step in range(1, 200):
        stamp_ns = 1_000_000_000 + step * 10_000_000
        if step == 100:
            estimator.set_plan(np.array([stamp_ns, 2 * stamp_ns], np.int64), np.zeros((len(vehicle.sides), 2)))
        for channel in range(len(vehicle.channels)):
            estimator.push(channel, stamp_ns, 1e-3 * step)
