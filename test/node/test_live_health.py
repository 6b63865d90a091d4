# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Stale, missing and wrong inputs: reported, never invented, never fatal."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

import itertools

from builtin_interfaces.msg import Time
from live_harness import SECOND, T0, VEHICLE, LiveNode, Sample, World, direct, motion, to_time
from rosgraph_msgs.msg import Clock

from lugre_steering.estimator import Estimator
from lugre_steering.live.health import Health
from lugre_steering.vehicle import load

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"

FAILING_NODE = """
import sys
from lugre_steering.estimator import Estimator
from lugre_steering.live import run

push, failures = Estimator.push, iter(range(3))

def failing(self, channel, stamp_ns, value, rate=float("nan")):
    if value == 0.1255 and next(failures, None) is not None:
        raise ZeroDivisionError("made to fail")
    return push(self, channel, stamp_ns, value, rate)

Estimator.push = failing
sys.exit(run.run(sys.argv))
"""


SLOW_NODE = """
import sys
import time
from lugre_steering.estimator import Estimator
from lugre_steering.live import run, session

push = Estimator.push

def slow(*sample):
    time.sleep(0.002)
    return push(*sample)

run._BACKLOG_S = 0.5
warm_up = session.warm_up
session.warm_up = lambda *given: (warm_up(*given), setattr(Estimator, "push", slow))
sys.exit(run.run(sys.argv))
"""


def now_sample(channel: int, value: float) -> Sample:
    return Sample(channel, time.time_ns(), value)


def test_stale_pressures_stop_the_residual_and_a_missing_angle_the_torque() -> None:
    vehicle = load(VEHICLE)
    samples = motion(vehicle, 60.0)
    whole = [s for s in samples if s.stamp_ns < T0 + SECOND]
    no_pressure = [s for s in samples if T0 + SECOND <= s.stamp_ns < T0 + 3 * SECOND and s.channel in (0, 1)]
    no_right = [s for s in samples if s.stamp_ns >= T0 + 3 * SECOND and s.channel != 1]
    formed = len(direct(Estimator(vehicle), whole)[1])
    assert 90 < formed <= 100
    with LiveNode(), World(vehicle) as world:
        torque, residual = world.heard["torque"], world.heard["residual"]
        world.play(whole)
        world.wait(lambda: len(torque) == 100 and len(residual) == formed)

        world.play(no_pressure)
        world.wait(lambda: len(torque) == 300)
        _, message, _ = world.status("inputs")
        assert message.endswith("pressure/main_a, pressure/main_b, pressure/aux_a, pressure/aux_b stale")
        assert len(torque) == 300
        assert len(residual) == formed

        def told() -> bool:
            level, message, values = world.last_status("inputs")
            late = float(values["angle/right age [s]"]) > 0.9
            return late and level == ERROR and "angle/right stale" in message.split("; ")

        # The left angle goes on until it is told: a report may come at any time, and find the left one stale where that has ended.
        assert world.play(no_right, until=told)
        assert len(torque) == 300


@pytest.mark.parametrize(
    ("estimate", "residual", "level"),
    [(4e4, -4e4, WARN), (4e4, 1e3, OK), (4e4, -2e4, WARN), (4e4, -1e4, OK), (10.0, 70.0, OK), (0.0, 1e5, OK)],
)
def test_a_residual_as_large_as_the_torque_is_told(estimate: float, residual: float, level: bytes) -> None:
    """As pressures in bar or half of the cylinders make it; missing physics leaves less. Without a torque it means nothing."""
    health = Health(load(VEHICLE), 0.2, 0.5, 10)
    for i in range(100):
        sign = (-1.0) ** i
        health.add_residual(sign * residual, sign * (estimate + residual))
    labels = {f"input {i}": {"accepted": 0} for i in range(len(load(VEHICLE).channels))}
    (status,) = (s for s in health.statuses(1, 1, 1.0, labels, 0) if s.name.endswith("residual"))
    assert status.level == level
    assert ("as large as the torque" in status.message) == (level == WARN)


def test_every_rejection_is_counted_by_channel_and_reason() -> None:
    vehicle = load(VEHICLE)
    ms = 1_000_000
    samples = [Sample(c, T0 + i * 10 * ms, 0.0) for i in range(20) for c in (0, 1)]
    last = T0 + 190 * ms
    samples += [
        Sample(0, last, 0.0),  # duplicate
        Sample(0, last - 50 * ms, 0.0),  # backward
        Sample(1, 0, 0.0),  # zero stamp
        Sample(1, last + 10 * ms, math.nan),
        Sample(1, last + 10 * ms, math.inf),
        Sample(0, last + 10 * ms, 3.0),  # spike
        Sample(0, last + 10 * ms, 9.0),  # absurd
        Sample(2, last, 1e15),  # absurd
        Sample(0, last + 20 * ms, 0.0),
        Sample(1, last + 20 * ms, 0.0),
    ]
    with LiveNode(), World(vehicle) as world:
        for sample in samples:
            world.send(sample)
            time.sleep(0.001)
        world.wait(lambda: len(world.heard["torque"]) == 21)
        world.wait(lambda: len(world.heard["diagnostics"]) > 2)
        _level, _message, values = world.status("rejected")
        levels = [s.level for d in world.heard["diagnostics"] for s in d.status if s.name.endswith("rejected")]
        assert WARN in levels  # while they were new
        expected = {
            "angle/left duplicate": "1",
            "angle/left backward": "1",
            "angle/left spike": "1",
            "angle/left absurd": "1",
            "angle/right zero_stamp": "1",
            "angle/right not_finite": "2",
            "pressure/main_a absurd": "1",
            "angle/left accepted": "21",
            "angle/right accepted": "21",
        }
        assert expected.items() <= values.items()
        for topic in ("torque", "estimate"):
            assert world.stamps(topic) == [*(T0 + i * 10 * ms for i in range(20)), last + 20 * ms]


def test_an_exception_in_a_callback_withholds_the_torque_and_passes(tmp_path: Path) -> None:
    script = tmp_path / "failing_node.py"
    script.write_text(FAILING_NODE)
    vehicle = load(VEHICLE)
    with LiveNode(command=[str(script)]) as node, World(vehicle) as world:

        def steer(until: Callable[[], bool]) -> None:
            """Steer on, however slow this machine is, until what is waited for has come."""
            end = time.monotonic() + 20.0
            while not until():
                assert time.monotonic() < end, "steered in vain"
                stamp_ns = time.time_ns()
                world.send(Sample(0, stamp_ns, 0.0))
                world.send(Sample(1, stamp_ns, 0.0))
                time.sleep(0.01)

        steer(lambda: len(world.heard["torque"]) > 20)
        for channel in (0, 1, 0):
            world.send(now_sample(channel, 0.1255))
        failed_ns = time.time_ns()
        steer(lambda: sum(stamp > failed_ns + SECOND for stamp in world.stamps("torque")) > 20)
        # Held back for a second from the moment the node failed, which is later than the last failing sample was sent;
        # half of it is left to the way through the middleware.
        assert not [stamp for stamp in world.stamps("torque") if failed_ns < stamp < failed_ns + SECOND // 2]

        def levels() -> list[bytes]:
            return [s.level for d in world.heard["diagnostics"] for s in d.status if s.name.endswith("outputs")]

        world.wait(lambda: levels()[-1] == WARN)  # over, but not forgotten
        assert ERROR in levels()
        _, _, values = world.status("outputs")
        assert values["exceptions"] == "3"
        assert values["last exception"] == "ZeroDivisionError: made to fail"
        assert int(values["withheld: after an exception"]) > 10
        assert node.process.poll() is None


def test_a_node_that_cannot_keep_up_says_so_and_can_be_stopped(tmp_path: Path) -> None:
    """Its executor's queue is never empty and, left alone, grows with each message that the middleware drops."""
    script = tmp_path / "slow_node.py"
    script.write_text(SLOW_NODE)
    vehicle = load(VEHICLE)
    with LiveNode(command=[str(script)]) as node, World(vehicle) as world:
        told, over = "more messages came than could be read", threading.Event()

        def flood() -> None:
            while not over.is_set():
                for channel in range(2, len(vehicle.channels)):
                    world.send(now_sample(channel, 1e6))
                time.sleep(1e-3)

        flooding = threading.Thread(target=flood)
        flooding.start()
        try:
            heard = world.heard["diagnostics"]
            world.wait(lambda: any(told in status.message for said in list(heard) for status in said.status))
            code, seconds = node.stop(signal.SIGTERM)
        finally:
            over.set()
            flooding.join()
        assert code == 0, node.output
        assert seconds < 3.0


def test_commands_stay_silent_on_stale_inputs_and_come_back_without_a_jump() -> None:
    vehicle = load(VEHICLE)
    with (
        LiveNode("-p", "publish_commands:=true", "-p", "recovery_ramp_s:=0.8", "-p", "angle_timeout_s:=0.6"),
        World(vehicle) as world,
    ):
        commands = world.heard["feed_forward/commands"]

        def steer(seconds: float, value: float, age_ns: int = 0) -> None:
            for i in range(round(seconds * 100)):
                stamp_ns = time.time_ns() - age_ns
                for channel in (0, 1):
                    world.send(Sample(channel, stamp_ns, value + 1e-4 * i))
                time.sleep(0.01)

        steer(1.2, 0.0)
        world.wait(lambda: len(commands) == 120)
        assert commands[0].data[0] == 0.0
        assert list(commands[-1].data) == list(world.heard["feed_forward"][-1].effort)
        assert len(commands[-1].data) == 2

        time.sleep(1.0)  # nothing comes in: nothing goes out
        assert len(commands) == 120

        last = list(commands[-1].data)
        steer(1.0, 0.25)
        world.wait(lambda: len(commands) == 220)
        wanted = [list(m.effort) for m in world.heard["feed_forward"][120:]]
        assert list(commands[120].data) == last
        assert abs(wanted[0][0] - last[0]) > 500.0  # or this test would show nothing
        # The way back goes by the node's clock: however long this machine slept in between, it only goes forward, in many steps.
        way = [(b.data[0] - last[0]) / (w[0] - last[0]) for b, w in zip(list(commands)[120:], wanted, strict=True)]
        assert way[0] == 0.0
        assert all(a <= b for a, b in itertools.pairwise(way))
        assert sum(0.0 < each < 1.0 for each in way) > 20
        assert list(commands[-1].data) == wanted[-1]

        n_torque = len(world.heard["torque"])
        time.sleep(1.2)
        steer(0.3, 0.3, age_ns=SECOND)  # a second old on arrival: an estimate, but nothing to act upon
        world.wait(lambda: len(world.heard["torque"]) == n_torque + 30)
        assert len(commands) == 220
        _, _, values = world.status("outputs")
        assert values["withheld: commands: stamps are not close to the clock"] == "30"


@pytest.mark.parametrize("cause", ["a clock set back", "an exception"])
def test_commands_do_not_jump_when_the_torque_does(tmp_path: Path, cause: str) -> None:
    """No silence comes near the time-out here, so only the node can know that a ramp is due."""
    script = tmp_path / "failing_node.py"
    script.write_text(FAILING_NODE)
    arguments = ("-p", "publish_commands:=true", "-p", "recovery_ramp_s:=2.0", "-p", "angle_timeout_s:=60.0")
    vehicle = load(VEHICLE)
    with LiveNode(*arguments, command=[str(script)]) as node, World(vehicle) as world:
        commands = world.heard["feed_forward/commands"]
        angle = 0.0

        def steer(seconds: float, rate: float, age_ns: int = 0) -> None:
            nonlocal angle
            for _ in range(round(seconds * 100)):
                angle += 0.01 * rate
                stamp_ns = time.time_ns() - age_ns
                for channel in (0, 1):
                    world.send(Sample(channel, stamp_ns, angle))
                time.sleep(0.01)

        steer(3.0, 0.1)
        world.wait(lambda: len(commands) > 290)
        time.sleep(0.2)
        last, before = commands[-1].data[0], len(commands)
        assert last > 5000.0
        if cause == "a clock set back":
            steer(0.5, -0.1, age_ns=10 * SECOND)
        else:
            world.send(now_sample(0, 0.1255))
            steer(1.6, -0.1)
        world.wait(lambda: len(commands) > before + 20)
        after = commands[before].data[0]
        wanted = world.heard["feed_forward"][-1].effort[0]
        assert abs(wanted - last) > 3000.0  # or this test would show nothing
        assert after == last
        if cause == "a clock set back":
            _, _, values = world.status("rejected")
            assert [key for key in values if key.endswith(" restart")]
        assert node.process.poll() is None


def outputs_of(health: Health) -> tuple[bytes, str]:
    """Level and message of the next report, a second after the one before."""
    status = health.statuses(0, 0, 1.0, {}, 0)[-1]
    return status.level, status.message


def test_angles_without_a_torque_are_an_error() -> None:
    health = Health(load(VEHICLE), 0.2, 0.5, 16)
    assert outputs_of(health) == (OK, "running")
    health.arrivals[0] += 100
    assert outputs_of(health) == (OK, "running")  # the missing side is what the inputs tell
    health.arrivals[0] += 100
    health.arrivals[1] += 100
    assert outputs_of(health) == (ERROR, "no torque although angles arrive")
    health.arrivals[0] += 100
    health.arrivals[1] += 100
    health.estimates += 100
    assert outputs_of(health) == (OK, "running")


def test_every_withheld_output_is_an_error_once() -> None:
    health = Health(load(VEHICLE), 0.2, 0.5, 16)
    health.withheld["torque is not a finite number"] += 3
    assert outputs_of(health) == (ERROR, "withheld: torque is not a finite number")
    assert outputs_of(health) == (OK, "running")


def residual_after(seconds: int, measured_over_estimate: float, estimate: float) -> tuple[bytes, str]:
    """Level and message about the residual after so long with torques of one shape."""
    health = Health(load(VEHICLE), 0.2, 0.5, 16)
    for _ in range(seconds):
        for i in range(100):
            torque = estimate * math.sin(0.1 * i)
            health.add_residual((measured_over_estimate - 1.0) * torque, measured_over_estimate * torque)
        status = health.statuses(0, 0, 1.0, {}, 0)[3]
    return status.level, status.message


def test_a_torque_of_the_right_shape_and_another_size_tells_the_sheet() -> None:
    level, message = residual_after(20, 1.65, 3e4)
    assert level == WARN
    assert "measured torque is 1.6 times" in message or "measured torque is 1.7 times" in message
    assert "axle.load_N" in message
    assert residual_after(20, 1.2, 3e4) == (OK, "residual formed")
    assert residual_after(20, 1.65, 30.0) == (OK, "residual formed")  # next to nothing moves


def test_what_is_new_is_to_be_told_at_once_and_what_goes_on_is_not() -> None:
    health = Health(load(VEHICLE), 0.2, 0.5, 16)
    rejected = np.zeros((7, 13), np.int64)
    health.arrivals, health.arrived_ns = [1] * 7, [SECOND] * 7
    health.told(SECOND, rejected)
    assert not health.untold(SECOND, rejected)
    assert health.untold(SECOND + 300_000_000, rejected)  # angles are stale
    for step in range(1, 4):
        more = rejected.copy()
        more[2, 4] += step
        assert health.untold(SECOND, more) == (step == 1)
        health.told(SECOND, more)
    health.unused["steering/command: malformed"] += 1
    assert health.untold(SECOND, more)
    late = SECOND + 300_000_000
    health.told(late, more)
    assert not health.untold(late, more)
    assert not health.untold(SECOND, more)  # all inputs are back
    assert health.untold(late, more)


def test_other_joints_are_a_mistake_only_where_no_wanted_joint_comes() -> None:
    health = Health(load(VEHICLE), 0.2, 0.5, 16)
    health.set_topics(["/joint_states"] * 2 + ["/pressure"] * 5)
    health.foreign["/joint_states"] += 5
    assert health.statuses(0, 0, 1.0, {}, 0)[1].level == WARN
    health.arrivals[0] += 1
    health.foreign["/joint_states"] += 5
    status = health.statuses(0, 0, 1.0, {}, 0)[1]
    assert status.level == OK
    assert {pair.key: pair.value for pair in status.values} == {"/joint_states without a wanted joint": "10"}


def test_simulated_time() -> None:
    vehicle = load(VEHICLE)
    arguments = ("-p", "use_sim_time:=true", "-p", "publish_commands:=true")
    with LiveNode(*arguments), World(vehicle) as world:
        world.clock.publish(Clock(clock=Time(sec=100)))
        world.wait(lambda: bool(world.heard["diagnostics"]) and world.heard["diagnostics"][-1].header.stamp.sec == 100)
        for i in range(100):
            stamp_ns = 100 * SECOND + i * 10_000_000
            world.clock.publish(Clock(clock=to_time(stamp_ns)))
            time.sleep(0.005)
            world.send(Sample(0, stamp_ns, 0.0))
            world.send(Sample(1, stamp_ns, 0.0))
            # Topics overtake each other where the machine is busy: the next instant begins when this one is answered.
            world.wait(lambda i=i: len(world.heard["torque"]) > i and len(world.heard["feed_forward/commands"]) > i)
        assert len(world.heard["torque"]) == len(world.heard["feed_forward/commands"]) == 100
        _, _, latency = world.status("latency")
        assert 0.0 <= float(latency["stamp to publish p50 [ms]"]) <= 10.0
        assert float(latency["arrival to publish p50 [ms]"]) < 10.0
        # Time stands still, so the inputs do not grow old; health is reported all the same.
        time.sleep(1.0)
        _level, message, values = world.status("inputs")
        assert "angle" not in message
        assert float(values["angle/left age [s]"]) < 0.2
