# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Exceptions where rclpy would swallow them, end a service or the node: in transitions, services and files. The node in this process."""

from __future__ import annotations

import math
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import WrenchStamped
from live_harness import OWN_DOMAIN, PATIENCE_S, VEHICLE
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lugre_steering.errors import DataError
from lugre_steering.estimator.state_file import read_state
from lugre_steering.live import estimator_node, run
from lugre_steering.live.estimator_node import SteeringTorqueEstimator
from lugre_steering.live.outputs import publish_if_heard
from lugre_steering.recording import Kind
from lugre_steering.vehicle import load
from lugre_steering.watch.window import read_window

ANGLE = 0.1


def failing(*_: object, **__: object) -> Any:
    raise MemoryError("made to fail")


def arguments(folder: Path) -> list[str]:
    """Of a node with a folder for its windows and one for its state."""
    for name in ("windows", "state"):
        (folder / name).mkdir()
    given = {"vehicle_file": VEHICLE, "watch_folder": folder / "windows", "state_file": folder / "state" / "s.json"}
    return ["--ros-args", *(word for name, value in given.items() for word in ("-p", f"{name}:={value}"))]


@pytest.fixture
def node(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SteeringTorqueEstimator]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init(args=arguments(tmp_path), domain_id=OWN_DOMAIN, signal_handler_options=SignalHandlerOptions.NO)
    made = SteeringTorqueEstimator()
    try:
        yield made
    finally:
        made.destroy_node()  # else other tests would find one more node of the name
        rclpy.try_shutdown()


def spin_until(node: SteeringTorqueEstimator, condition: Callable[[], bool]) -> None:
    executor, end = SingleThreadedExecutor(), time.monotonic() + PATIENCE_S
    executor.add_node(node)
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()


def steer(node: SteeringTorqueEstimator, until: Callable[[], bool] = lambda: True) -> None:
    """Some samples of each angle, so that there is something to keep, and on until something has come."""
    session = node.session
    assert session is not None
    angles = [channel for channel in session.vehicle.channels if channel.kind is Kind.ANGLE]
    publishers = [node.create_publisher(JointState, channel.topic, qos_profile_sensor_data) for channel in angles]

    def heard() -> bool:
        for channel, publisher in zip(angles, publishers, strict=True):
            message = JointState(name=[channel.joint], position=[ANGLE])
            message.header.stamp = node.get_clock().now().to_msg()
            publisher.publish(message)
        return all(session.estimator.latest_ns[f"angle/{channel.name}"] for channel in angles) and until()

    spin_until(node, heard)


def ask(node: SteeringTorqueEstimator, service: str) -> Trigger.Response:
    future = node.create_client(Trigger, f"~/{service}").call_async(Trigger.Request())
    spin_until(node, future.done)
    return future.result()


def test_after_an_exception_in_a_transition_the_node_can_be_configured_anew(
    node: SteeringTorqueEstimator, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as broken:
        broken.setattr(estimator_node, "Session", failing)
        with pytest.raises(DataError, match="MemoryError: made to fail"):
            node.start()
    assert node.session is None
    assert ask(node, "reload").message.startswith(f"{VEHICLE}: the node is not configured")
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    assert node.session is not None
    assert node.session.active


def test_a_service_answers_whatever_happens(node: SteeringTorqueEstimator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    node.start()
    assert node.session is not None
    estimator = node.session.estimator
    with monkeypatch.context() as broken:
        broken.setattr(estimator_node, "load", failing)
        broken.setattr(node.session, "window", failing)
        for number, service in enumerate(("reload", "mark"), 1):
            answer = ask(node, service)
            assert (answer.success, answer.message) == (False, "MemoryError: made to fail")
            assert node.session.health.exceptions == number
    assert node.session.estimator is estimator  # all or nothing
    shutil.rmtree(tmp_path / "windows")
    answer = ask(node, "mark")
    assert not answer.success
    assert "No such file" in answer.message
    assert ask(node, "reload").success


def test_an_alarm_writes_the_window_and_says_what_reads_it(
    node: SteeringTorqueEstimator, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    node.start()
    steer(node)
    assert node.session is not None
    node.session.alarm = True
    spin_until(node, lambda: "diagnose --window" in capfd.readouterr().err)
    (file,) = (tmp_path / "windows").iterdir()
    assert set(read_window(file, node.session.vehicle.channels).recording.angle["left"].value) == {ANGLE}
    assert not node.session.alarm


def test_a_state_that_cannot_be_written_is_told_and_the_node_goes_on(
    node: SteeringTorqueEstimator, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    node.start()
    steer(node)
    shutil.rmtree(tmp_path / "state")
    node.save()
    assert "s.json: state cannot be written: " in capfd.readouterr().err
    assert not node.last_exception
    assert node.session is not None
    assert "cannot be written" in node.session.health.state_trouble
    (tmp_path / "state").mkdir()
    node.save()
    assert not node.session.health.state_trouble


def test_a_window_that_cannot_be_written_is_told_and_withholds_nothing(node: SteeringTorqueEstimator, tmp_path: Path) -> None:
    node.start()
    steer(node)
    session = node.session
    assert session is not None
    shutil.rmtree(tmp_path / "windows")
    session.alarm = True
    spin_until(node, lambda: bool(session.health.window_trouble))
    assert "No such file" in session.health.window_trouble
    assert not session.health.exceptions
    (tmp_path / "windows").mkdir()
    session.alarm = True
    spin_until(node, lambda: not session.health.window_trouble)


def test_a_torque_that_is_no_number_is_withheld_and_told(node: SteeringTorqueEstimator) -> None:
    node.start()
    heard: list[float] = []
    node.create_subscription(WrenchStamped, "~/torque", lambda message: heard.append(message.wrench.torque.z), qos_profile_sensor_data)
    steer(node, until=lambda: bool(heard))
    session = node.session
    assert session is not None
    session.estimator._state["z"][0] = math.nan
    steer(node, until=lambda: bool(session.health.withheld))
    published = len(heard)
    steer(node, until=lambda: len(heard) > published + 3)  # and it begins anew
    assert session.health.withheld == {"torque is not a finite number": 1}
    assert all(map(math.isfinite, heard))


def test_a_feed_forward_that_is_no_number_is_withheld_and_told_while_the_torque_goes_on(node: SteeringTorqueEstimator) -> None:
    node.start()
    torques: list[float] = []
    fed: list[float] = []
    node.create_subscription(WrenchStamped, "~/torque", lambda message: torques.append(message.wrench.torque.z), qos_profile_sensor_data)
    node.create_subscription(JointState, "~/feed_forward", lambda message: fed.extend(message.effort), qos_profile_sensor_data)
    steer(node, until=lambda: bool(torques) and bool(fed))
    session = node.session
    assert session is not None
    session.estimator._core.config["horizon"] = math.nan
    steer(node, until=lambda: bool(session.health.withheld))
    published = len(torques)
    steer(node, until=lambda: len(torques) > published + 3)
    assert set(session.health.withheld) == {"estimate is not a finite number"}
    assert all(map(math.isfinite, (*torques, *fed)))


def test_plans_of_rubbish_and_a_flood_of_them_are_told_and_cost_nothing(node: SteeringTorqueEstimator) -> None:
    node.start()
    steer(node)
    assert node.session is not None
    unused = node.session.health.unused
    publisher = node.create_publisher(JointTrajectory, "steering/command", 10)

    def sent(plan: bytes | JointTrajectory, reason: str) -> bool:
        publisher.publish(plan)
        return bool(unused[f"steering/command: {reason}"])

    spin_until(node, lambda: sent(b"\0\1\0\0" + b"\xff" * 60, "malformed"))
    points = [JointTrajectoryPoint(positions=[ANGLE, ANGLE], time_from_start=Duration(sec=i)) for i in range(1000)]
    flood = JointTrajectory(joint_names=["left_track_steer_joint", "right_track_steer_joint"], points=points)
    spin_until(node, lambda: sent(flood, "too many to read them all"))
    plan = node.session.estimator._core.config[0]
    assert (plan["plan_size"], plan["plan_refused_ns"]) == (1000, 0)  # that not all are read says nothing against the last one
    assert unused["steering/command: not looked at, as 'feed_forward_horizon_s' is 0"] > 0
    assert not node.session.health.exceptions


def test_a_parameter_is_changed_to_what_it_may_be_or_not_at_all(node: SteeringTorqueEstimator) -> None:
    node.start()
    before = node.settings
    (result,) = node.set_parameters([Parameter("when_stale", value="perhaps")])
    assert not result.successful
    assert "expected one of silent, zero" in result.reason
    files = ("vehicle_file", "/none.yaml"), ("vehicle_file", "v" * 300), ("state_file", "/none/s.json"), ("state_file", str(VEHICLE.parent))
    for name, value in files:
        (result,) = node.set_parameters([Parameter(name, value=value)])
        assert not result.successful
        assert f"parameter '{name}': got '{value}', expected a" in result.reason
    assert node.settings == before


def test_a_shutdown_by_a_lifecycle_manager_keeps_the_state(node: SteeringTorqueEstimator, tmp_path: Path) -> None:
    node.start()
    steer(node)
    assert node.trigger_shutdown() == TransitionCallbackReturn.SUCCESS
    assert node.session is None
    memory = read_state(tmp_path / "state" / "s.json", load(VEHICLE), time.time_ns(), 60.0)
    assert [memory["sides"][side]["angle"] for side in ("left", "right")] == [ANGLE, ANGLE]
    assert list((tmp_path / "state").iterdir()) == [tmp_path / "state" / "s.json"]  # and lets go of it


def test_a_context_that_others_shut_down_costs_no_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def spin(node: SteeringTorqueEstimator, *_: object) -> bool:
        steer(node)
        node.destroy_node()
        rclpy.shutdown()
        return True

    monkeypatch.setattr(run, "spin", spin)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(OWN_DOMAIN))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    assert run.run(["estimator", *arguments(tmp_path)]) == 0
    memory = read_state(tmp_path / "state" / "s.json", load(VEHICLE), time.time_ns(), 60.0)
    assert [memory["sides"][side]["angle"] for side in ("left", "right")] == [ANGLE, ANGLE]


@pytest.mark.parametrize("executor", ["events", "single"])
def test_a_context_that_ends_while_it_spins_ends_the_node(executor: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    real, nodes = run.spin, []

    def spin(node: SteeringTorqueEstimator, *given: Any) -> bool:
        nodes.append(node)
        threading.Timer(0.3, rclpy.shutdown).start()
        return real(node, *given)

    monkeypatch.setattr(run, "spin", spin)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(OWN_DOMAIN))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    try:
        assert run.run(["estimator", *arguments(tmp_path), "-p", f"executor:={executor}"]) == 0
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        nodes[0].destroy_node()


def test_arguments_that_are_none_are_refused_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run.run(["estimator", "--ros-args", "-p", "no value"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("estimator: ")
    assert said.count("\n") == 1


def test_what_is_new_is_told_one_status_after_the_other(node: SteeringTorqueEstimator, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where a report is under way, which began before it was new: two are made, and between any two parts torques may go out."""
    node.start()
    assert node.session is not None
    reports: list[str] = []
    monkeypatch.setattr(node, "_diagnose", lambda statuses: reports.append("; ".join(status.message for status in statuses)))
    now_ns = time.monotonic_ns()
    node._finish_reporting(node.session, now_ns)
    assert node._go_on_reporting(node.session, now_ns)  # the next one begins
    node.session.health.fault(MemoryError("made to fail"), now_ns)
    reports.clear()
    node._tick()
    made = []
    for _ in range(11):
        made.append(len(reports))
        node._tell_on()
    assert made == [0] * 5 + [1] * 6  # four statuses of the old report and five of the new one, each then sent
    assert "made to fail" in reports[1]
    node._tell_on()
    assert node._urgent == 0
    assert node._telling.is_canceled()


@pytest.mark.parametrize("listeners", [0, 1])
def test_what_is_for_looking_at_is_sent_where_somebody_looks(listeners: int) -> None:
    sent: list[Any] = []
    publisher = SimpleNamespace(get_subscription_count=lambda: listeners, publish=sent.append)
    publish_if_heard(publisher, "message")
    assert sent == ["message"] * listeners
