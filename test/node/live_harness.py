# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The node as its own process, and the systems around it (sensors, listeners) in this one, over real DDS."""

from __future__ import annotations

import functools
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, JointState, Temperature
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from lugre_steering.estimator import Estimator
from lugre_steering.recording import Kind
from lugre_steering.vehicle import Vehicle, load

PACKAGE_ROOT = Path(__file__).resolve().parents[2]
VEHICLE = PACKAGE_ROOT / "config" / "test_vehicle.yaml"
DOMAIN = 1 + os.getpid() % 50
OWN_DOMAIN = DOMAIN + 50
"""Of nodes that run in the process of the tests: what stays of one whose context was shut down is no namesake of the next."""
START_TIMEOUT_S = 240.0  # a first start compiles
PATIENCE_S = 60.0
"""What is waited for comes at once where nothing is wrong, and at last on a machine that is busy with all other tests."""
STOP_S = 10.0
"""Supervisors kill what is not gone then; the ramp to zero takes two seconds of it at most."""
NAME = "/steering_torque_estimator"
SECOND = 1_000_000_000
T0 = 1_700_000_000 * SECOND
PERIOD_S = 0.01
STOPPED = ("-p", "use_sim_time:=true", "-p", "angle_timeout_s:=60.0")
"""Of a node whose clock ``World.set_clock`` sets: samples of a minute about it are fresh."""

OUTPUTS = {
    "torque": WrenchStamped,
    "cylinder_torque": WrenchStamped,
    "residual": WrenchStamped,
    "estimate": JointState,
    "feed_forward": JointState,
    "rubber_temperature/left": Temperature,
    "rubber_temperature/right": Temperature,
    "feed_forward/commands": Float64MultiArray,
}


class Sample(NamedTuple):
    channel: int
    stamp_ns: int
    value: float
    rate: float = math.nan


class Status(NamedTuple):
    """What a diagnostics message says about one component."""

    level: bytes
    message: str
    values: dict[str, str]


def to_time(stamp_ns: int) -> Time:
    seconds, nanoseconds = divmod(stamp_ns, SECOND)
    return Time(sec=seconds, nanosec=nanoseconds)


def to_ns(stamp: Time) -> int:
    return stamp.sec * SECOND + stamp.nanosec


def environment() -> dict[str, str]:
    paths = [str(PACKAGE_ROOT), os.environ.get("PYTHONPATH", "")]
    return {
        **os.environ,
        "ROS_DOMAIN_ID": str(DOMAIN),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "PYTHONPATH": os.pathsep.join(path for path in paths if path),
    }


@functools.cache
def template() -> subprocess.Popen[str]:
    """Of which nodes are forked; see there."""
    command = [sys.executable, str(Path(__file__).with_name("node_template.py")), str(VEHICLE)]
    return subprocess.Popen(command, env=environment(), text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)


def end_template() -> None:
    """If there is one."""
    if template.cache_info().currsize:
        template().communicate(timeout=PATIENCE_S)
        template.cache_clear()


class Forked:
    """A node forked from the template, with what is used here of a ``subprocess.Popen``."""

    def __init__(self, arguments: Sequence[str], log: Path, env: Mapping[str, str], script: Path | None = None) -> None:
        begun, self._ended = template(), Path(f"{log}.ended")
        assert begun.stdin is not None
        assert begun.stdout is not None
        order = {"arguments": [*arguments], "script": script and str(script), "log": str(log), "environment": {**env}}
        begun.stdin.write(json.dumps(order) + "\n")
        begun.stdin.flush()
        self.pid = int(begun.stdout.readline())

    def poll(self) -> int | None:
        return int(said) if self._ended.exists() and (said := self._ended.read_text(encoding="ascii")) else None

    def wait(self, timeout: float) -> int:
        deadline = time.monotonic() + timeout
        while (code := self.poll()) is None:
            if time.monotonic() > deadline:
                raise subprocess.TimeoutExpired(f"node {self.pid}", timeout)
            time.sleep(0.005)
        self._ended.unlink()
        self.poll = lambda: code  # type: ignore[method-assign]
        return code

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class Live:
    """A process that brings the node up; use as a context manager."""

    def __init__(self, command: Sequence[str], env: Mapping[str, str], *, forked: bool = False, script: Path | None = None) -> None:
        self.log = Path(tempfile.mkstemp(prefix="live_node_", suffix=".log")[1])
        self.process: subprocess.Popen[bytes] | Forked
        if forked:
            self.process = Forked(command, self.log, env, script)
        else:
            with self.log.open("w") as log:
                self.process = subprocess.Popen([*command], stdout=log, stderr=subprocess.STDOUT, env=env)
        deadline = time.monotonic() + START_TIMEOUT_S
        while " ready" not in self.output:
            if self.process.poll() is not None or time.monotonic() > deadline:
                self.process.kill()
                raise AssertionError(f"the node did not start: {self.output}")
            time.sleep(0.05)

    @property
    def output(self) -> str:
        return self.log.read_text()

    def stop(self, number: int) -> tuple[int, float]:
        """Exit code, and seconds it took."""
        begin = time.monotonic()
        self.process.send_signal(number)
        return self.process.wait(timeout=PATIENCE_S), time.monotonic() - begin

    def __enter__(self) -> LiveNode:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait(timeout=PATIENCE_S)
        self.log.unlink()


FRESH = ("-m", "lugre_steering.node")
"""The node as it is started by hand, in an interpreter of its own."""


class LiveNode(Live):
    """The node of this source tree, or a ``script`` that runs it; without a ``command`` forked from the template, which saves the second
    that a start takes."""

    def __init__(self, *ros_args: str, command: Sequence[str] = (), script: Path | None = None, vehicle: Path = VEHICLE):
        arguments = ["--ros-args", "-p", f"vehicle_file:={vehicle}", *ros_args]
        first = [sys.executable, *command] if command else ["estimator"]
        super().__init__([*first, *arguments], environment(), forked=not command, script=script)


class World:
    """Sensors that publish and listeners that keep what they hear."""

    def __init__(
        self,
        vehicle: Vehicle | None = None,
        *,
        namespace: str = "",
        remaps: Mapping[str, str] | None = None,
        outputs: Sequence[str] = tuple(OUTPUTS),
    ) -> None:
        self.vehicle = vehicle or load(VEHICLE)
        self.context = rclpy.Context()
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        rclpy.init(context=self.context, domain_id=DOMAIN, args=[])
        self.node = rclpy.create_node("world", context=self.context, namespace=namespace)
        self.heard: dict[str, list[Any]] = defaultdict(list)
        self.arrived: dict[str, list[float]] = defaultdict(list)
        prefix = f"/{namespace}{NAME}" if namespace else NAME
        for topic in outputs:
            self._listen(OUTPUTS[topic], f"{prefix}/{topic}", topic)
        self._listen(DiagnosticArray, "/diagnostics", "diagnostics")
        kinds = {Kind.ANGLE: JointState, Kind.PRESSURE: FluidPressure, Kind.AIR_TEMPERATURE: Temperature}
        kinds[Kind.TORQUE] = WrenchStamped
        self._publishers: dict[str, Any] = {}
        self._topics = []
        for channel in self.vehicle.channels:
            topic = (remaps or {}).get(channel.topic, channel.topic)
            self._topics.append(topic)
            if topic not in self._publishers:
                publisher = self.node.create_publisher(kinds[channel.kind], topic, qos_profile_sensor_data)
                self._publishers[topic] = publisher
        self.command = self.node.create_publisher(JointTrajectory, "steering/command", QoSProfile(depth=10))
        self.clock = self.node.create_publisher(Clock, "/clock", QoSProfile(depth=10))
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        matched = [*self._publishers.values(), self.command]
        self.wait(lambda: all(publisher.get_subscription_count() for publisher in matched))
        self.wait(lambda: bool(self.heard["diagnostics"]))  # the way back works as well
        time.sleep(0.2)

    def _spin(self) -> None:
        with suppress(ExternalShutdownException):
            self._executor.spin()

    def _listen(self, message: type, topic: str, name: str) -> None:
        def keep(received: Any) -> None:
            self.arrived[name].append(time.monotonic())
            self.heard[name].append(received)

        self.node.create_subscription(message, topic, keep, QoSProfile(depth=10_000))

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        rclpy.shutdown(context=self.context)  # ends the thread's spin; only then may the executor go
        self._thread.join(5.0)
        self._executor.shutdown()

    def wait(self, condition: Callable[[], bool], timeout_s: float = PATIENCE_S) -> None:
        deadline = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline, "waited in vain"
            time.sleep(0.01)

    def send(self, sample: Sample) -> None:
        self.publish(sample.channel, sample.stamp_ns, message_of(self.vehicle, sample))

    def publish(self, channel: int, stamp_ns: int, message: Any) -> None:
        message.header.stamp = to_time(stamp_ns)
        self._publishers[self._topics[channel]].publish(message)

    def play(self, samples: Sequence[Sample], speed: float = 1.0, until: Callable[[], bool] = lambda: False) -> bool:
        """Publish samples in order, paced by their stamps, all or ``until`` something has come; whether it has."""
        begin, first = time.monotonic(), samples[0].stamp_ns
        for sample in samples:
            if until():
                return True
            wait = begin + (sample.stamp_ns - first) / SECOND / speed - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            self.send(sample)
        return until()

    def set_clock(self, stamp_ns: int) -> None:
        """Publish a simulated time until the node has it."""

        def heard() -> bool:
            self.clock.publish(Clock(clock=to_time(stamp_ns)))
            return to_ns(self.heard["diagnostics"][-1].header.stamp) == stamp_ns

        self.wait(heard)

    def stamps(self, topic: str) -> list[int]:
        return [to_ns(message.header.stamp) for message in self.heard[topic]]

    def statuses(self, component: str, since: int = 0) -> list[Status]:
        """What all diagnostics messages, or those after so many, say about a component."""
        found = (s for message in self.heard["diagnostics"][since:] for s in message.status if s.name == f"{NAME[1:]}: {component}")
        return [Status(s.level, s.message, {pair.key: pair.value for pair in s.values}) for s in found]

    def status(self, component: str, wanted: Callable[[Status], bool] = lambda _: True) -> Status:
        """What is said next about a component, or next such that it is as ``wanted``: reports come when they like."""
        seen = len(self.heard["diagnostics"])
        deadline = time.monotonic() + PATIENCE_S
        while not (found := [status for status in self.statuses(component, seen) if wanted(status)]):
            assert time.monotonic() < deadline, f"never told; last: {self.statuses(component)[-1:]}"
            time.sleep(0.01)
        return found[0]


def message_of(vehicle: Vehicle, sample: Sample) -> Any:
    """One sample as the message that its channel arrives in."""
    channel = vehicle.channels[sample.channel]
    if channel.kind is Kind.ANGLE:
        message: Any = JointState(name=[channel.joint], position=[sample.value])
        message.velocity = [] if math.isnan(sample.rate) else [sample.rate]
    elif channel.kind is Kind.PRESSURE:
        message = FluidPressure(fluid_pressure=sample.value)
    elif channel.kind is Kind.AIR_TEMPERATURE:
        message = Temperature(temperature=sample.value)
    else:
        message = WrenchStamped()
        message.wrench.torque.z = sample.value
    message.header.stamp = to_time(sample.stamp_ns)
    return message


BEGUN = 20
"""Samples of such a motion without a residual at its start, as its pressures disagree with bristles that are relaxed."""


def motion(vehicle: Vehicle, seconds: float, *, start_ns: int = T0, rate_Hz: float = 100.0) -> list[Sample]:
    """A smooth made-up steering motion with jittering pressures at the same rate, and ambient air now and then."""
    samples = []
    for i in range(round(seconds * rate_Hz)):
        t = i / rate_Hz
        stamp_ns = start_ns + round(t * SECOND)
        for index, channel in enumerate(vehicle.channels):
            late_ns = 500_000 * index + 137_000 * (i % 5)
            if channel.kind is Kind.ANGLE:
                sign = 1.0 if channel.name == "left" else 0.97
                rate = 0.4 * math.cos(2.0 * t) if i % 3 else math.nan
                samples.append(Sample(index, stamp_ns, sign * 0.2 * math.sin(2.0 * t), rate))
            elif channel.kind is Kind.PRESSURE:
                samples.append(Sample(index, stamp_ns + late_ns, 5e6 + 1e6 * index * math.sin(2.0 * t + index)))
            elif channel.kind is Kind.TORQUE:
                samples.append(Sample(index, stamp_ns + late_ns, 300.0 * math.sin(2.0 * t)))
            elif i % 100 == 50:
                samples.append(Sample(index, stamp_ns + late_ns, 20.0 + 0.1 * i))
    return sorted(samples, key=lambda sample: sample.stamp_ns)


def direct(estimator: Estimator, samples: Sequence[Sample]) -> tuple[list[Any], list[Any]]:
    """Estimates and residuals of the same samples pushed without ROS."""
    estimates, residuals = [], []
    for sample in samples:
        new_estimates, new_residuals = estimator.push(*sample)
        estimates += [row.copy() for row in new_estimates]
        residuals += [row.copy() for row in new_residuals]
    return estimates, residuals


class Driver:
    """Steers by the clock; ``fault`` turns (side, angle) into what is sent."""

    def __init__(self, world: World) -> None:
        self.world, self.time = world, 0.0

    def angle(self) -> float:
        return 0.3 * math.sin(0.9 * self.time)

    def steer(self, seconds: float, fault: Callable[[int, float], float] = lambda _, angle: angle) -> None:
        last = time.monotonic()
        for _ in range(round(seconds / PERIOD_S)):
            stamp_ns = time.time_ns()
            for side, share in enumerate((1.0, 0.95)):
                jitter = 2e-4 * math.sin(1e3 * self.time + side)  # as a sensor of this noise has it
                self.world.send(Sample(side, stamp_ns, fault(side, share * self.angle() + jitter)))
            time.sleep(PERIOD_S)
            now = time.monotonic()
            self.time += now - last  # a busy machine makes gaps, no haste afterwards
            last = now

    def steer_until(self, condition: Callable[[], bool], fault: Callable[[int, float], float] = lambda _, angle: angle) -> None:
        """Steer on, however slow this machine is, until what is waited for has come."""
        end = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end, "steered in vain"
            self.steer(PERIOD_S, fault)


def call(world: World, kind: Any, name: str, request: Any, timeout_s: float = PATIENCE_S) -> Any:
    client = world.node.create_client(kind, name)
    assert client.wait_for_service(timeout_sec=PATIENCE_S)
    future = client.call_async(request)
    world.wait(future.done, timeout_s)
    world.node.destroy_client(client)
    return future.result()


def set_parameters(world: World, **values: float | str) -> Any:
    parameters = []
    for name, value in values.items():
        if isinstance(value, str):
            content = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)
        else:
            content = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        parameters.append(Parameter(name=name, value=content))
    request = SetParametersAtomically.Request(parameters=parameters)
    return call(world, SetParametersAtomically, f"{NAME}/set_parameters_atomically", request).result


def commands(world: World) -> list[float]:
    return [message.data[0] for message in world.heard["feed_forward/commands"]]


def jump(world: World, since: int) -> float:
    """Largest step [N m] of the left feed-forward, from zero on, that is more than turning makes of the time between two stamps."""
    fastest = math.degrees(5393.7) * 0.3 * 0.9  # presliding stiffness and rate of the driver [N m/s]
    said = [(to_ns(message.header.stamp), message.effort[0]) for message in world.heard["feed_forward"][since:]]
    return max(abs(said[0][1]), *(abs(b - a) - fastest * (later - sooner) * 1e-9 for (sooner, a), (later, b) in pairwise(said)))
