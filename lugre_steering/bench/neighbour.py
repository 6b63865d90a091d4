# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What stands around the live node in a benchmark: its process, sensors that move as a vehicle does, and a listener; over real DDS."""

from __future__ import annotations

import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lugre_steering.recording import NODE, Array, Kind
from lugre_steering.simulate.manoeuvres import Motion
from lugre_steering.simulate.plant import run
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.actuation import line_pressures, total_gains

PERIOD_S = 0.01
STROKE_S, STROKES = 7.0, 40
STEP_S = 0.002
AMPLITUDE_RAD, RIGHT_SHARE = 0.3, 0.95
START_TIMEOUT_S = 240.0
JOINED_S = 0.5
"""After the sensors have seen the node, it has seen them."""
SECOND = 1_000_000_000


def use_own_domain() -> None:
    """Processes started from here on are alone on their DDS domain: one of those that few use, above the ports that systems give away."""
    os.environ["ROS_DOMAIN_ID"] = str(215 + os.getpid() % 18)


class Sample(NamedTuple):
    """One message of an input channel as it is sent; ``joint`` replaces the joint's name."""

    channel: int
    stamp_ns: int
    value: float
    rate: float = math.nan
    joint: str = ""
    frame: str = ""


Fault = Callable[[int, Sample], Sequence[Sample]]
"""What is sent in place of the sample of a tick."""


NO_TEXT = "no text!"
"""A frame that is sent as bytes which are no UTF-8."""


def as_it_is(_: int, sample: Sample) -> Sequence[Sample]:
    """No fault."""
    return (sample,)


class Strokes:
    """A vehicle that steers to and fro for ever: values of all channels at any time, without noise; pressures by the plant, whose rubber
    warms up for ``STROKES`` strokes and then stays as it is."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        time_s = np.arange(0.0, (STROKES + 1) * STROKE_S, STEP_S)
        share = np.array([[1.0], [RIGHT_SHARE]])[: len(vehicle.sides)]
        turn = 2.0 * math.pi / STROKE_S
        theta = AMPLITUDE_RAD * share * np.sin(turn * time_s)
        motion = Motion(time_s, theta)
        torque = run(vehicle, motion).torque
        pressures = line_pressures(torque, total_gains(vehicle, theta))
        self._stroke = round(STROKE_S / STEP_S)
        steady = slice(self._stroke, None)
        rows: list[Array] = []
        for channel in vehicle.channels:
            if channel.kind is Kind.ANGLE:
                rows.append(theta[vehicle.sides.index(channel.name), steady])
            elif channel.kind is Kind.PRESSURE:
                assert vehicle.hydraulics is not None
                rows.append(pressures[vehicle.hydraulics.lines.index(channel.name), steady])
            else:
                rows.append(np.full(time_s[steady].size, 15.0))
        self._rows = np.array(rows)

    def at(self, time_s: float) -> Array:
        """Values (channels,) at a time [s]."""
        place, last = int(time_s / STEP_S), self._rows.shape[1] - self._stroke
        return self._rows[:, place if place < last else last + (place - last) % self._stroke]

    def rate(self, channel: int, time_s: float) -> float:
        """Rate of one channel's value at a time [s]."""
        return float(self.at(time_s + STEP_S)[channel] - self.at(time_s)[channel]) / STEP_S


class NodeProcess:
    """The node as a process of its own."""

    def __init__(self, vehicle_file: Path, log: Path, *arguments: str) -> None:
        command = [sys.executable, "-m", "lugre_steering.node", "--ros-args", "-p", f"vehicle_file:={vehicle_file}", *arguments]
        self.log = log
        with log.open("a", encoding="utf-8") as stream:
            begin = stream.tell()
            self.process = subprocess.Popen(command, stdout=stream, stderr=subprocess.STDOUT)
        deadline = time.monotonic() + START_TIMEOUT_S
        while " ready" not in log.read_text(encoding="utf-8")[begin:]:
            if self.process.poll() is not None or time.monotonic() > deadline:
                self.process.kill()
                raise RuntimeError(f"the node did not start: {log.read_text(encoding='utf-8')}")
            time.sleep(0.02)

    def stop(self, number: int) -> None:
        """Send a signal and wait for the end."""
        self.process.send_signal(number)
        self.process.wait(20.0)


class Neighbour:
    """Sensors that publish at 1 / ``PERIOD_S`` in a thread of their own, through whatever ``fault`` is set; what the node says is kept."""

    def __init__(self, vehicle: Vehicle, seed: int = 0, period_s: float = PERIOD_S, simulated: bool = False) -> None:
        """``simulated``: the time is published as /clock; ``shift_ns`` sets it."""
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from geometry_msgs.msg import WrenchStamped
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import QoSProfile, qos_profile_sensor_data
        from rosgraph_msgs.msg import Clock
        from sensor_msgs.msg import FluidPressure, JointState, Temperature
        from std_msgs.msg import Float64MultiArray
        from trajectory_msgs.msg import JointTrajectory

        self.vehicle, self.period_s = vehicle, period_s
        self.fault: Fault = as_it_is
        self.shift_ns = 0
        self.rated = False  # whether the angles come with their rates
        self.sent: list[Sample] = []
        self.clean: list[Sample] = []
        self.torque: list[tuple[int, float]] = []
        self.feed_forward: list[tuple[int, list[float]]] = []
        self.residual: list[tuple[int, float]] = []
        self.estimate: list[tuple[int, list[float]]] = []
        self.commands: list[tuple[float, list[float]]] = []
        self.told: list[tuple[int, str]] = []
        self.phase = 0.0
        self.moved: Callable[[float], None] = lambda _: None
        self._strokes, self._rng = Strokes(vehicle), np.random.default_rng(seed)
        self._context = rclpy.Context()
        rclpy.init(context=self._context, args=[])
        self.node = rclpy.create_node("neighbour", context=self._context)
        self._types = {Kind.ANGLE: JointState, Kind.PRESSURE: FluidPressure, Kind.AIR_TEMPERATURE: Temperature}
        self._clock = self.node.create_publisher(Clock, "/clock", qos_profile_sensor_data) if simulated else None
        self.publishers: list[Any] = []
        self.restart = True
        # Of a participant of its own, as a planner is: a flood out of the sensors' own shared memory would crowd out what they send.
        self._planning = rclpy.Context()
        rclpy.init(context=self._planning, args=[])
        self._planner = rclpy.create_node("planner", context=self._planning)
        self.command = self._planner.create_publisher(JointTrajectory, "steering/command", 10)

        def listen(kind: type, topic: str, keep: Callable[..., None]) -> None:
            self.node.create_subscription(kind, topic, keep, QoSProfile(depth=1000))

        listen(WrenchStamped, f"/{NODE}/torque", lambda m: self.torque.append((_ns(m.header.stamp), m.wrench.torque.z)))
        listen(WrenchStamped, f"/{NODE}/residual", lambda m: self.residual.append((_ns(m.header.stamp), m.wrench.torque.z)))
        listen(JointState, f"/{NODE}/feed_forward", lambda m: self.feed_forward.append((_ns(m.header.stamp), list(m.effort))))
        listen(JointState, f"/{NODE}/estimate", lambda m: self.estimate.append((_ns(m.header.stamp), list(m.effort))))
        # At the time of sending: how fast they change must not depend on when this busy process hears them.
        listen(Float64MultiArray, f"/{NODE}/feed_forward/commands", self._keep_command)
        listen(DiagnosticArray, "/diagnostics", self._keep_told)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._on = True
        self._threads = [threading.Thread(target=self._spin, daemon=True), threading.Thread(target=self._steer, daemon=True)]
        for thread in self._threads:
            thread.start()

    def _make_publishers(self) -> None:
        """Publishers of all sensors, anew, and matched."""
        from rclpy.qos import qos_profile_sensor_data

        old, self.publishers = self.publishers, [
            self.node.create_publisher(self._types[channel.kind], channel.topic, qos_profile_sensor_data)
            for channel in self.vehicle.channels
        ]
        for publisher in old:
            self.node.destroy_publisher(publisher)
        while self._on and any(publisher.get_subscription_count() == 0 for publisher in self.publishers):
            time.sleep(0.01)
        time.sleep(JOINED_S)
        self.restart = False

    def wait_for_node(self) -> None:
        """Until every sensor is heard and torques come."""
        deadline, count = time.monotonic() + 60.0, len(self.torque)
        while len(self.torque) < count + 20:
            if time.monotonic() > deadline:
                raise RuntimeError("the node was not heard")
            time.sleep(0.01)

    def wait_until_it_moves(self) -> None:
        """Until the joint passes the middle of a stroke: at its end an angle that stands still is no fault."""
        while abs(math.cos(2.0 * math.pi * self.phase / STROKE_S)) < 0.8:
            time.sleep(self.period_s)

    def now_ns(self) -> int:
        """The time that is stamped and, where it is simulated, published."""
        return time.time_ns() + self.shift_ns

    def close(self) -> None:
        self._on = False
        for thread in self._threads:
            thread.join(5.0)
        self._context.try_shutdown()
        self._planning.try_shutdown()

    def send(self, sample: Sample) -> None:
        """Publish one sample; what a sensor's message carries of it is kept in ``sent``."""
        from rclpy.serialization import serialize_message

        channel = self.vehicle.channels[sample.channel]
        message = self._types[channel.kind]()
        if channel.kind is Kind.ANGLE:
            message.name, message.position = [sample.joint or channel.joint], [sample.value]
            if not math.isnan(sample.rate):
                message.velocity = [sample.rate]
        elif channel.kind is Kind.PRESSURE:
            message.fluid_pressure = sample.value
        else:
            message.temperature = sample.value
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(sample.stamp_ns, SECOND)
        message.header.frame_id = sample.frame
        if not sample.joint:
            self.sent.append(sample)
        if sample.frame == NO_TEXT:
            message = serialize_message(message).replace(NO_TEXT.encode(), b"\xff" * len(NO_TEXT))
        self.publishers[sample.channel].publish(message)

    def _publish_clock(self, stamp_ns: int) -> None:
        from rosgraph_msgs.msg import Clock

        if self._clock is not None:
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(stamp_ns, SECOND)
            self._clock.publish(message)

    def _keep_command(self, message: Any, info: Any) -> None:
        self.commands.append((info["source_timestamp"] / SECOND, list(message.data)))

    def _keep_told(self, message: Any) -> None:
        text = "; ".join(status.message for status in message.status)
        self.told.append((_ns(message.header.stamp), text))

    def _spin(self) -> None:
        from rclpy.executors import ExternalShutdownException

        with suppress(ExternalShutdownException):
            while self._on:
                self._executor.spin_once(timeout_sec=0.1)

    def _steer(self) -> None:
        sensors = self.vehicle.sensors
        tick, last = 0, time.monotonic()
        noise = {Kind.ANGLE: math.radians(sensors.angle_noise_deg), Kind.PRESSURE: sensors.pressure_noise_Pa}
        while self._on:
            if self.restart:
                self._make_publishers()
                last = time.monotonic()
            stamp_ns = self.now_ns()
            self._publish_clock(stamp_ns)
            values = self._strokes.at(self.phase)
            for i, (channel, value) in enumerate(zip(self.vehicle.channels, values.tolist(), strict=True)):
                if channel.kind is Kind.AIR_TEMPERATURE and tick % 20:
                    continue
                rate = self._strokes.rate(i, self.phase) if self.rated and channel.kind is Kind.ANGLE else math.nan
                sample = Sample(i, stamp_ns, value + noise.get(channel.kind, 0.0) * float(self._rng.standard_normal()), rate)
                self.clean.append(sample)
                for changed in self.fault(tick, sample):
                    self.send(changed)
            self.moved(self.phase)
            tick += 1
            time.sleep(max(0.0, last + self.period_s - time.monotonic()))
            now = time.monotonic()
            self.phase += min(now - last, 5.0 * self.period_s)  # a busy machine makes gaps, no haste afterwards
            last = now


def _ns(stamp: Any) -> int:
    return int(stamp.sec * SECOND + stamp.nanosec)
