# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The node as a controller's neighbour, over DDS: faults flagged and answered, its life cycle, restarts, changes while it runs."""

from __future__ import annotations

import itertools
import json
import math
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Duration, Time
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from live_harness import NAME, SECOND, VEHICLE, LiveNode, Sample, World, message_of
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

WARN = b"\x01"
PERIOD_S = 0.01
COMMANDS = ("-p", "publish_commands:=true", "-p", "recovery_ramp_s:=0.5")


class Driver:
    """Steers by the clock; ``fault`` turns (side, angle) into what is sent."""

    def __init__(self, world: World) -> None:
        self.world, self.time = world, 0.0

    def angle(self) -> float:
        return 0.3 * math.sin(0.9 * self.time)

    def steer(self, seconds: float, fault: Callable[[int, float], float] = lambda _, angle: angle) -> None:
        begin, count = time.monotonic(), round(seconds / PERIOD_S)
        for i in range(count):
            stamp_ns = time.time_ns()
            for side, share in enumerate((1.0, 0.95)):
                jitter = 2e-4 * math.sin(1e3 * self.time + side)  # as a sensor of this noise has it
                self.world.send(Sample(side, stamp_ns, fault(side, share * self.angle() + jitter)))
            self.time += PERIOD_S
            time.sleep(max(0.0, begin + (i + 1) * PERIOD_S - time.monotonic()))


def call(world: World, kind: Any, name: str, request: Any, timeout_s: float = 20.0) -> Any:
    client = world.node.create_client(kind, name)
    assert client.wait_for_service(timeout_sec=10.0)
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


def told_after(world: World, text: str, since: float) -> float:
    """Seconds from then until /diagnostics said so."""
    for message, when in zip(world.heard["diagnostics"], world.arrived["diagnostics"], strict=False):
        if when >= since and any(text in status.message for status in message.status):
            return when - since
    raise AssertionError(f"'{text}' was never told")


def commands(world: World) -> list[float]:
    return [message.data[0] for message in world.heard["feed_forward/commands"]]


FAULTS: dict[str, tuple[Callable[[], Callable[[int, float], float]], str]] = {
    "two sides jump": (lambda: lambda _, angle: angle + 1.0, "angle jumped"),
    "degrees": (lambda: lambda _, angle: math.degrees(angle) if abs(angle) < 0.05 else angle + 0.9, "angle jumped"),
    "one side frozen": (lambda: (lambda held: lambda side, angle: held.setdefault(side, angle) if side else angle)({}), "angle frozen"),
    "signs": (lambda: lambda _, angle: -angle, "angle jumped"),
}


@pytest.fixture(scope="module")
def neighbour() -> Iterator[tuple[World, Driver]]:
    with LiveNode(*COMMANDS) as _, World() as world:
        driver = Driver(world)
        driver.steer(2.5)
        yield world, driver


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_told_within_a_fifth_of_a_second_and_the_commands_go_to_zero(neighbour: tuple[World, Driver], name: str) -> None:
    world, driver = neighbour
    fault, reason = FAULTS[name]
    driver.steer(1.2)
    begin, sent = time.monotonic(), len(commands(world))
    driver.steer(0.8, fault())
    during = len(commands(world))
    driver.steer(1.6)
    time.sleep(0.2)
    found = commands(world)
    # What the issue asks for, and the reports' own 0.1 s and a busy machine's delay.
    assert told_after(world, f"feed-forward to zero: {reason}", begin) < 0.2 + 0.15
    assert found[during - 1] == 0.0
    assert max(abs(b - a) for a, b in itertools.pairwise(found[sent:])) < 5e3
    assert found[-1] == world.heard["feed_forward"][-1].effort[0] == world.heard["estimate"][-1].effort[0]


def long_plan(points: int) -> JointTrajectory:
    message = JointTrajectory(joint_names=["left_track_steer_joint", "right_track_steer_joint"])
    message.points = [
        JointTrajectoryPoint(positions=[3.1 * (-1) ** i, 0.0], time_from_start=Duration(nanosec=1_000_000 * i % SECOND))
        for i in range(points)
    ]
    return message


def test_hostile_plans_are_refused_and_cost_nothing(neighbour: tuple[World, Driver]) -> None:
    world, driver = neighbour
    driver.steer(0.3)
    flood, wild = long_plan(20_000), long_plan(300)
    before = len(world.heard["torque"])
    for _ in range(6):
        world.command.publish(flood)
        world.command.publish(wild)
        driver.steer(0.2)
    time.sleep(0.3)
    _, _, values = world.status("rejected")
    assert int(values["steering/command: more than 524288 bytes"]) > 0
    assert int(values["steering/command: faster than 10 rad/s"]) > 0
    assert len(world.heard["torque"]) - before == 120


def test_nanoseconds_of_a_second_or_more_are_malformed(neighbour: tuple[World, Driver]) -> None:
    world, driver = neighbour
    message = message_of(world.vehicle, Sample(0, time.time_ns(), 0.0))
    publisher = world._publishers["steering/left/joint_state"]
    message.header.stamp = Time(sec=int(time.time()), nanosec=SECOND)
    publisher.publish(message)
    driver.steer(0.2)
    _, _, values = world.status("rejected")
    assert values["/steering/left/joint_state malformed"] == "1"


def test_parameters_change_while_it_runs_all_or_nothing(neighbour: tuple[World, Driver]) -> None:
    world, driver = neighbour
    refused = set_parameters(world, feed_forward_limit_Nm=1e3, when_stale="loud")
    assert not refused.successful
    assert "loud" in refused.reason
    driver.steer(1.0)
    assert max(abs(value) for value in commands(world)[-90:]) > 2e3
    assert not set_parameters(world, feed_forward_limit_Nm=math.nan).successful
    assert not set_parameters(world, executor="single").successful  # read at start only
    assert set_parameters(world, feed_forward_limit_Nm=1e3, recovery_ramp_s=0.4).successful
    driver.steer(1.0)
    time.sleep(0.2)
    assert max(abs(value) for value in commands(world)[-50:]) == 1e3
    assert set_parameters(world, feed_forward_limit_Nm=0.0).successful


def test_when_stale_the_feed_forward_is_led_to_zero_if_so_wanted(neighbour: tuple[World, Driver]) -> None:
    world, driver = neighbour
    driver.steer(1.5)
    assert set_parameters(world, when_stale="zero").successful
    driver.steer(0.3)
    time.sleep(0.15)
    count = len(commands(world))
    assert abs(commands(world)[-1]) > 1e3
    time.sleep(0.8)
    faded = commands(world)[count - 1 :]
    assert len(faded) > 5
    assert faded[-1] == 0.0 == world.heard["feed_forward"][-1].effort[0]
    assert max(abs(b - a) for a, b in itertools.pairwise(faded)) < 0.4 * abs(faded[0])
    count = len(faded) + count - 1
    time.sleep(0.3)
    assert len(commands(world)) == count  # zero has been said: silence
    driver.steer(0.2)
    stamped = [message.effort[0] for message in world.heard["feed_forward"][-15:]]
    assert max(abs(b - a) for a, b in itertools.pairwise([0.0, *stamped])) < 5e3
    assert set_parameters(world, when_stale="silent").successful


def test_a_vehicle_file_is_reloaded_without_a_gap_all_or_nothing(neighbour: tuple[World, Driver], tmp_path: Path) -> None:
    world, driver = neighbour
    text = VEHICLE.read_text().replace("rubber_dma_10hz.csv", str(VEHICLE.with_name("rubber_dma_10hz.csv")))
    stiffer, broken, other = (tmp_path / name for name in ("stiffer.yaml", "broken.yaml", "other.yaml"))
    stiffer.write_text(text.replace("5393.7", "5900.0"))
    broken.write_text(text.replace("5393.7", "-1.0"))
    other.write_text(VEHICLE.with_name("single_joint_example.yaml").read_text())
    before = len(world.heard["torque"])
    for file in (broken, other):
        assert set_parameters(world, vehicle_file=str(file)).successful
        answer = call(world, Trigger, f"{NAME}/reload", Trigger.Request())
        assert not answer.success
        assert str(file) in answer.message
    assert set_parameters(world, vehicle_file=str(stiffer)).successful
    import threading

    found: list[Any] = []
    asking = threading.Timer(0.5, lambda: found.append(call(world, Trigger, f"{NAME}/reload", Trigger.Request())))
    asking.start()
    driver.steer(1.5)
    asking.join()
    time.sleep(0.3)
    assert found[0].success, found[0].message
    torques = [message.wrench.torque.z for message in world.heard["torque"][before:]]
    assert len(torques) == 150
    assert max(abs(b - a) for a, b in itertools.pairwise(torques)) < 5e3


def change_state(world: World, transition: int) -> bool:
    request = ChangeState.Request(transition=Transition(id=transition))
    return bool(call(world, ChangeState, f"{NAME}/change_state", request, 120.0).success)


def state_of(world: World) -> int:
    return int(call(world, GetState, f"{NAME}/get_state", GetState.Request()).current_state.id)


@contextmanager
def unmatched_world() -> Iterator[World]:
    """A world whose node has not joined the topics yet."""
    real = World.wait
    World.wait = lambda *_, **__: None  # type: ignore[method-assign]
    try:
        world = World()
    finally:
        World.wait = real  # type: ignore[method-assign]
    with world:
        yield world


def test_life_cycle() -> None:
    with LiveNode(*COMMANDS, "-p", "autostart:=false") as node, unmatched_world() as world:
        assert state_of(world) == State.PRIMARY_STATE_UNCONFIGURED
        assert change_state(world, Transition.TRANSITION_CONFIGURE)
        assert state_of(world) == State.PRIMARY_STATE_INACTIVE
        world.wait(lambda: bool(world.heard["diagnostics"]))
        driver = Driver(world)
        driver.steer(0.5)
        assert not world.heard["torque"]  # follows, but publishes nothing
        assert "node not active" in world.status("outputs")[1]
        assert change_state(world, Transition.TRANSITION_ACTIVATE)
        driver.steer(1.5)
        world.wait(lambda: len(world.heard["torque"]) > 100)
        torque = world.heard["torque"][-1].wrench.torque.z
        assert abs(torque) > 1e4
        assert change_state(world, Transition.TRANSITION_DEACTIVATE)
        driver.steer(0.6)
        time.sleep(0.2)
        assert commands(world)[-1] == 0.0 == world.heard["feed_forward"][-1].effort[0]
        assert max(abs(b - a) for a, b in itertools.pairwise(commands(world))) < 6e3
        count = len(world.heard["torque"])
        driver.steer(0.2)
        assert len(world.heard["torque"]) == count
        assert change_state(world, Transition.TRANSITION_ACTIVATE)
        driver.steer(0.3)
        stamped = [message.effort[0] for message in world.heard["feed_forward"][-25:]]
        assert max(abs(b - a) for a, b in itertools.pairwise(stamped)) < 5e3
        assert abs(world.heard["torque"][-1].wrench.torque.z) > 1e4  # the state has gone on meanwhile
        assert change_state(world, Transition.TRANSITION_DEACTIVATE)
        assert change_state(world, Transition.TRANSITION_CLEANUP)
        assert state_of(world) == State.PRIMARY_STATE_UNCONFIGURED
        set_parameters(world, vehicle_file="/no/such/file.yaml")
        assert not change_state(world, Transition.TRANSITION_CONFIGURE)
        assert "/no/such/file.yaml" in node_output(node)
        set_parameters(world, vehicle_file=str(VEHICLE))
        assert change_state(world, Transition.TRANSITION_CONFIGURE)
        assert change_state(world, Transition.TRANSITION_ACTIVATE)
        assert node.process.poll() is None  # type: ignore[attr-defined]


def node_output(node: Any) -> str:
    return str(node.output)


def test_the_state_survives_a_kill_and_a_damaged_one_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "state.json"
    arguments = ("-p", f"state_file:={file}", "-p", "state_period_s:=0.5")
    with LiveNode(*arguments) as node, World() as world:
        driver = Driver(world)
        driver.steer(3.0)
        last = driver.time
        time.sleep(1.3)
        torque = world.heard["torque"][-1].wrench.torque.z
        heat = world.heard["rubber_temperature/left"][-1].temperature
        assert abs(torque) > 2e4
        assert heat > 15.2
        node.process.send_signal(signal.SIGKILL)  # type: ignore[attr-defined]
        node.process.wait(10.0)  # type: ignore[attr-defined]
    assert json.loads(file.read_text())["memory"]["sides"]["left"]["state"]["temperature"] == pytest.approx(heat, abs=1e-6)
    with LiveNode(*arguments) as node, World() as world:
        driver = Driver(world)
        driver.time = last
        driver.steer(0.1)
        world.wait(lambda: bool(world.heard["torque"]))
        assert "taken over" in node_output(node)
        first = world.heard["torque"][0].wrench.torque.z
        assert first == pytest.approx(torque, rel=0.1)  # ten samples of turning are between
        assert world.heard["rubber_temperature/left"][0].temperature == pytest.approx(heat, abs=0.1)
    damaged = file.read_text()
    file.write_text(damaged[: len(damaged) // 2])
    with LiveNode(*arguments) as node, World() as world:
        Driver(world).steer(0.1)
        world.wait(lambda: bool(world.heard["torque"]))
        assert "state not used" in node_output(node)
        assert "damaged" in node_output(node)
        assert abs(world.heard["torque"][0].wrench.torque.z) < 1e3


def test_two_nodes_of_one_name_a_missing_topic_and_another_clock_are_told_on_the_console() -> None:
    with LiveNode() as one, LiveNode() as _, World() as world:
        for _ in range(40):
            world.send(Sample(0, time.time_ns() - 100 * SECOND, 0.0))
            time.sleep(0.1)

        def told(text: str) -> bool:
            return text in node_output(one)

        world.wait(lambda: told("other node of this name") and told("angle/right missing"), 15.0)
        assert told("is use_sim_time to be set?")
        assert node_output(one).count("angle/right missing") < 5


def test_quality_of_service_can_be_overridden() -> None:
    topic = "qos_overrides./steering_torque_estimator/torque.publisher.reliability"
    with LiveNode("-p", f"{topic}:=best_effort") as node, World() as world:
        (info,) = world.node.get_publishers_info_by_topic(f"{NAME}/torque")
        assert info.qos_profile.reliability.name == "BEST_EFFORT"
        assert "no such parameter" not in node_output(node)
