# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The life cycle of the managed node, over DDS: transitions, restarts, names."""

from __future__ import annotations

import itertools
import json
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from live_harness import (
    NAME,
    PERIOD_S,
    SECOND,
    VEHICLE,
    Driver,
    LiveNode,
    Sample,
    World,
    call,
    commands,
    set_parameters,
)

COMMANDS = ("-p", "publish_commands:=true", "-p", "recovery_ramp_s:=0.5")


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
        world.wait(lambda: any(s.message == "not configured" for d in world.heard["diagnostics"] for s in d.status))
        assert change_state(world, Transition.TRANSITION_CONFIGURE)
        assert state_of(world) == State.PRIMARY_STATE_INACTIVE
        world.wait(lambda: bool(world.heard["diagnostics"]))
        driver = Driver(world)
        driver.steer(0.5)
        assert not world.heard["torque"]  # follows, but publishes nothing
        assert "node not active" in world.status("outputs")[1]
        heard = len(world.heard["feed_forward"])
        assert change_state(world, Transition.TRANSITION_ACTIVATE)
        assert not change_state(world, Transition.TRANSITION_ACTIVATE)  # refused, and no fault
        driver.steer(1.5)
        stamped = [message.effort[0] for message in world.heard["feed_forward"][heard:]]
        assert max(abs(b - a) for a, b in itertools.pairwise([0.0, *stamped])) < 6e3
        world.wait(lambda: len(world.heard["torque"]) > 100)
        torque = world.heard["torque"][-1].wrench.torque.z
        assert abs(torque) > 1e3
        assert change_state(world, Transition.TRANSITION_DEACTIVATE)
        driver.steer(0.6)
        time.sleep(0.2)
        assert commands(world)[-1] == 0.0 == world.heard["feed_forward"][-1].effort[0]
        assert max(abs(b - a) for a, b in itertools.pairwise(commands(world))) < 6e3
        count = len(world.heard["torque"])
        driver.steer(0.2)
        assert len(world.heard["torque"]) == count
        assert change_state(world, Transition.TRANSITION_ACTIVATE)
        heard = len(world.heard["feed_forward"])
        driver.steer(0.3)
        stamped = [message.effort[0] for message in world.heard["feed_forward"][heard:]]
        assert max(abs(b - a) for a, b in itertools.pairwise([0.0, *stamped])) < 5e3
        assert abs(world.heard["torque"][-1].wrench.torque.z) > 1e3  # the state has gone on meanwhile
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


def test_a_node_that_is_stopped_says_so_and_leads_the_commands_to_zero() -> None:
    with LiveNode(*COMMANDS, "-p", "withdrawal_ramp_s:=0.4") as node, World() as world:
        Driver(world).steer(1.5)
        count = len(commands(world))
        assert abs(commands(world)[-1]) > 5e3
        code, seconds = node.stop(signal.SIGTERM)
        assert code == 0
        assert seconds < 3.0
        world.wait(lambda: commands(world)[-1] == 0.0)
        last = commands(world)[count - 1 :]
        assert len(last) > 10
        assert max(abs(b - a) for a, b in itertools.pairwise(last)) < 0.25 * abs(last[0])
        assert world.heard["feed_forward"][-1].effort[0] == 0.0
        told = [status.message for status in world.heard["diagnostics"][-1].status if status.name.endswith("outputs")]
        assert "node stops: feed-forward to zero" in told[0]


def test_two_nodes_of_one_name_a_missing_topic_and_another_clock_are_told_on_the_console() -> None:
    begin = time.monotonic()
    with LiveNode() as one, LiveNode() as _, World() as world:
        for _ in range(40):
            world.send(Sample(0, time.time_ns() - 100 * SECOND, 0.0))
            time.sleep(0.1)

        def told(text: str) -> bool:
            return text in node_output(one)

        world.wait(lambda: told("of this name: their outputs mix") and told("angle/right, pressure/main_a"), 15.0)
        assert told("is use_sim_time to be set, or a bag played at another rate?")
        assert node_output(one).count("angle/right, pressure/main_a") <= time.monotonic() - begin  # once a second at most


def test_quality_of_service_can_be_overridden() -> None:
    topic = "qos_overrides./steering_torque_estimator/torque.publisher.reliability"
    with LiveNode("-p", f"{topic}:=best_effort") as node, World() as world:
        found = world.node.get_publishers_info_by_topic(f"{NAME}/torque")
        assert "BEST_EFFORT" in [info.qos_profile.reliability.name for info in found]
        assert "no such parameter" not in node_output(node)


def steer_until_heard(world: World, begin_s: float) -> None:
    """One angle, until the node has joined: the network still lists the one that was killed."""
    driver, end = Driver(world), time.monotonic() + 20.0
    while not world.heard["torque"]:
        assert time.monotonic() < end, "steered in vain"
        driver.time = begin_s
        driver.steer(PERIOD_S)


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
        steer_until_heard(world, last)
        assert "taken over" in node_output(node)
        first = world.heard["torque"][0].wrench.torque.z
        assert first == pytest.approx(torque, rel=0.1)  # ten samples of turning are between
        assert world.heard["rubber_temperature/left"][0].temperature == pytest.approx(heat, abs=0.1)
    damaged = file.read_text()
    file.write_text(damaged[: len(damaged) // 2])
    with LiveNode(*arguments) as node, World() as world:
        steer_until_heard(world, 0.0)
        assert "state not used" in node_output(node)
        assert "damaged" in node_output(node)
        assert abs(world.heard["torque"][0].wrench.torque.z) < 1e3


def test_two_nodes_with_one_state_file_are_told_and_the_second_leaves_it_alone(tmp_path: Path) -> None:
    file = tmp_path / "state.json"
    arguments = ("-p", f"state_file:={file}", "-p", "state_period_s:=0.2")
    with LiveNode(*arguments) as one, World() as world:
        steer_until_heard(world, 0.0)
        with LiveNode(*arguments, "-r", "__node:=other") as two:
            process = one.process.pid  # type: ignore[attr-defined]
            world.wait(lambda: f"process {process} keeps its state there" in node_output(two), 30.0)
            diagnostics = world.heard["diagnostics"]
            world.wait(lambda: any("will not survive" in status.message for said in diagnostics for status in said.status), 10.0)
            assert "taken over" not in node_output(two)
        assert "keeps its state there" not in node_output(one)
    assert json.loads(file.read_text())["memory"]["sides"]
