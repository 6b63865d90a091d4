# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The life cycle of the managed node, over DDS: transitions, restarts, names."""

from __future__ import annotations

import itertools
import json
import math
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
    PATIENCE_S,
    PERIOD_S,
    SECOND,
    STOP_S,
    STOPPED,
    VEHICLE,
    Driver,
    LiveNode,
    Sample,
    World,
    call,
    commands,
    jump,
    set_parameters,
    to_ns,
)

from lugre_steering.vehicle import load, save

COMMANDS = ("-p", "publish_commands:=true", "-p", "recovery_ramp_s:=0.5")
RATE_LIMIT_NM_S = math.degrees(5393.7)
"""What the sheet's stiffness makes of a radian a second."""
AT_ONCE = 3e3
"""0.05 s of that ramp, at most, are one step; of the static friction of a side that are 2.8 kN m."""


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


def test_life_cycle(tmp_path: Path) -> None:
    with LiveNode(*COMMANDS, "-p", "autostart:=false") as node, unmatched_world() as world:
        assert state_of(world) == State.PRIMARY_STATE_UNCONFIGURED
        world.status("outputs", lambda s: s.message == "not configured")
        assert change_state(world, Transition.TRANSITION_CONFIGURE)
        assert state_of(world) == State.PRIMARY_STATE_INACTIVE
        driver = Driver(world)
        driver.steer_until(lambda: "withheld: node not active" in world.statuses("outputs")[-1].values)
        assert "node not active" in world.statuses("outputs")[-1].message
        assert not world.heard["torque"]  # follows, but publishes nothing
        heard = len(world.heard["feed_forward"])
        assert change_state(world, Transition.TRANSITION_ACTIVATE)
        assert not change_state(world, Transition.TRANSITION_ACTIVATE)  # refused, and no fault
        driver.steer_until(lambda: bool(commands(world)) and abs(commands(world)[-1]) > 5e3)
        assert jump(world, heard) < AT_ONCE
        assert abs(world.heard["torque"][-1].wrench.torque.z) > 1e3
        assert change_state(world, Transition.TRANSITION_DEACTIVATE)
        driver.steer_until(lambda: commands(world)[-1] == 0.0 == world.heard["feed_forward"][-1].effort[0])
        assert max(abs(b - a) for a, b in itertools.pairwise(commands(world))) < 0.3001 * max(map(abs, commands(world)))
        count = len(world.heard["torque"])
        driver.steer(0.2)
        assert len(world.heard["torque"]) == count
        assert change_state(world, Transition.TRANSITION_ACTIVATE)
        heard = len(world.heard["feed_forward"])
        driver.steer_until(lambda: len(world.heard["feed_forward"]) > heard + 20)
        assert jump(world, heard) < AT_ONCE
        assert abs(world.heard["torque"][-1].wrench.torque.z) > 1e3  # the state has gone on meanwhile
        assert change_state(world, Transition.TRANSITION_DEACTIVATE)
        assert change_state(world, Transition.TRANSITION_CLEANUP)
        assert state_of(world) == State.PRIMARY_STATE_UNCONFIGURED
        assert "/no/such/file.yaml" in set_parameters(world, vehicle_file="/no/such/file.yaml").reason
        (no_vehicle := tmp_path / "none.yaml").write_text("none")
        set_parameters(world, vehicle_file=str(no_vehicle))
        assert not change_state(world, Transition.TRANSITION_CONFIGURE)
        assert str(no_vehicle) in node_output(node)
        set_parameters(world, vehicle_file=str(VEHICLE))
        assert change_state(world, Transition.TRANSITION_CONFIGURE)
        assert change_state(world, Transition.TRANSITION_ACTIVATE)
        assert node.process.poll() is None  # type: ignore[attr-defined]


def node_output(node: Any) -> str:
    return str(node.output)


def test_a_node_that_is_stopped_says_so_and_leads_the_commands_to_zero() -> None:
    with LiveNode(*COMMANDS, "-p", "withdrawal_ramp_s:=0.4") as node, World() as world:
        Driver(world).steer_until(lambda: bool(commands(world)) and abs(commands(world)[-1]) > 5e3)
        count = len(commands(world))
        code, seconds = node.stop(signal.SIGTERM)
        assert code == 0
        assert seconds < STOP_S
        world.wait(lambda: commands(world)[-1] == 0.0 == world.heard["feed_forward"][-1].effort[0])
        last = commands(world)[count - 1 :]
        assert len(last) > 8  # 0.05 s, at most, of the ramp of 0.4 s are a step
        assert max(abs(b - a) for a, b in itertools.pairwise(last)) < 0.25 * abs(last[0])
        world.wait(lambda: "node stops: feed-forward to zero" in world.statuses("outputs")[-1].message)


def test_two_nodes_of_one_name_a_missing_topic_and_another_clock_are_told_on_the_console() -> None:
    begin = time.monotonic()
    with LiveNode() as one, LiveNode() as _, World() as world:
        other_clock = "is use_sim_time to be set, or a bag played at another rate?"

        def told() -> bool:
            world.send(Sample(0, time.time_ns() - 100 * SECOND, 0.0))
            said = node_output(one)
            return all(text in said for text in ("of this name: their outputs mix", "angle/right, pressure/main_a", other_clock))

        world.wait(told)
        assert node_output(one).count("angle/right, pressure/main_a") <= time.monotonic() - begin  # once a second at most


def test_quality_of_service_can_be_overridden() -> None:
    topic = "qos_overrides./steering_torque_estimator/torque.publisher.reliability"
    with LiveNode("-p", f"{topic}:=best_effort") as node, World() as world:
        found = world.node.get_publishers_info_by_topic(f"{NAME}/torque")
        assert "BEST_EFFORT" in [info.qos_profile.reliability.name for info in found]
        assert "no such parameter" not in node_output(node)


def test_a_misspelt_quality_of_service_is_told() -> None:
    topic = "qos_overrides./steering_torque_estimator/torqe.publisher.reliability"
    with LiveNode("-p", f"{topic}:=best_effort") as node:
        assert f"no such parameter, not used: {topic}" in node_output(node)


def test_the_state_survives_in_simulated_time(tmp_path: Path) -> None:
    file = tmp_path / "state.json"
    arguments = (*STOPPED, "-p", f"state_file:={file}", "-p", "state_period_s:=0.2")
    for start_ns in (100 * SECOND, 101 * SECOND):
        with LiveNode(*arguments) as node, World() as world:
            world.set_clock(start_ns)
            for i in range(20):
                for side in (0, 1):
                    world.send(Sample(side, start_ns + i * 10_000_000, 0.1))
                time.sleep(0.01)
            world.wait(file.exists)
            assert ("taken over" in node_output(node)) == (start_ns > 100 * SECOND)
            assert "state not used" not in node_output(node)


def steer_until_heard(world: World, begin_s: float) -> None:
    """One angle, until the node has joined: the network still lists the one that was killed."""
    driver, end = Driver(world), time.monotonic() + PATIENCE_S
    while not world.heard["torque"]:
        assert time.monotonic() < end, "steered in vain"
        driver.time = begin_s
        driver.steer(PERIOD_S)


def kept_heat(file: Path) -> float:
    """Rubber temperature [degC] of the left track in a state file."""
    return float(json.loads(file.read_text())["memory"]["sides"]["left"]["state"]["temperature"])


def test_what_does_not_survive_and_what_cannot_be_told_is_said_once() -> None:
    with LiveNode() as node, World() as world:
        Driver(world).steer(2.5)
        assert node_output(node).count("name a 'state_file' to keep them") == 1
        assert node_output(node).count("the watch tells changes only: the vehicle file has no calibration") == 1
        told = world.status("residual", lambda s: "the watch tells" in s.values)
        assert told.values["the watch tells"].endswith("so that a model which is wrong from the start is usual")
        assert "implausible from [N m]" not in told.values


def test_a_calibrated_node_with_a_state_file_says_neither(tmp_path: Path) -> None:
    file = tmp_path / "calibrated.yaml"
    save(load(VEHICLE).replace(provenance={"heldout_rmse_Nm": 3000.0}), file)
    with LiveNode("-p", f"state_file:={tmp_path / 'state.json'}", vehicle=file) as node, World() as world:
        assert "state_file" not in node_output(node)
        assert "changes only" not in node_output(node)
        assert world.status("residual").values["implausible from [N m]"] == "15000"


def test_the_state_survives_a_kill_and_a_damaged_one_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "state.json"
    arguments = ("-p", f"state_file:={file}", "-p", "state_period_s:=0.5")
    with LiveNode(*arguments) as node, World() as world:
        driver = Driver(world)
        driver.steer(3.0)
        last = driver.time
        heat = 0.0

        def kept() -> bool:
            """What was said last is in the file."""
            nonlocal heat
            heat = world.heard["rubber_temperature/left"][-1].temperature
            return file.exists() and kept_heat(file) == pytest.approx(heat, abs=1e-6)

        world.wait(kept)
        torque = world.heard["torque"][-1].wrench.torque.z
        assert abs(torque) > 2e4
        assert heat > 15.2
        node.process.send_signal(signal.SIGKILL)  # type: ignore[attr-defined]
        node.process.wait(PATIENCE_S)  # type: ignore[attr-defined]
    assert kept_heat(file) == pytest.approx(heat, abs=1e-6)
    with LiveNode(*arguments) as node, World() as world:
        steer_until_heard(world, last)
        assert "taken over" in node_output(node)
        first = world.heard["torque"][0].wrench.torque.z
        assert first == pytest.approx(torque, rel=0.1)  # ten samples of turning are between
        assert world.heard["rubber_temperature/left"][0].temperature == pytest.approx(heat, abs=0.1)
        # The bristle holds 20 kN m at once; nobody was told of a torque before, so that its feed-forward begins at zero.
        world.wait(lambda: len(world.heard["feed_forward"]) >= 1)
        assert world.heard["feed_forward"][0].effort.tolist() == [0.0, 0.0]
        driver = Driver(world)
        driver.time = last
        driver.steer_until(lambda: abs(world.heard["feed_forward"][-1].effort[0]) > 1e4)
        for before, after in itertools.pairwise(world.heard["feed_forward"]):
            passed_s = (to_ns(after.header.stamp) - to_ns(before.header.stamp)) * 1e-9
            assert abs(after.effort[0] - before.effort[0]) <= RATE_LIMIT_NM_S * passed_s + 1e-6
        assert "the watch goes on from" in node_output(node)
    kept_before = json.loads(file.read_text())
    kept_before["learned"]["record"] = "AAAA"
    file.write_text(json.dumps(kept_before))
    with LiveNode(*arguments) as node:
        assert f"the watch learns anew: {file}: is damaged" in node_output(node)
        assert "temperatures and bristles taken over" in node_output(node)
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
            world.wait(lambda: f"process {process} keeps its state there" in node_output(two))
            diagnostics = world.heard["diagnostics"]
            world.wait(lambda: any("will not survive" in status.message for said in diagnostics for status in said.status))
            assert "taken over" not in node_output(two)
        assert "keeps its state there" not in node_output(one)
    assert json.loads(file.read_text())["memory"]["sides"]
