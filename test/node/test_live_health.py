# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Stale, missing and wrong inputs: reported, never invented, never fatal."""

from __future__ import annotations

import math
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

import itertools

from live_harness import (
    BEGUN,
    PATIENCE_S,
    SECOND,
    STOP_S,
    T0,
    VEHICLE,
    Driver,
    LiveNode,
    Sample,
    World,
    direct,
    motion,
    to_time,
)
from rosgraph_msgs.msg import Clock

from lugre_steering.estimator import Estimator
from lugre_steering.estimator.layout import REASONS
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
    assert 90 - BEGUN < formed <= 100 - BEGUN
    with LiveNode(), World(vehicle) as world:
        torque, residual = world.heard["torque"], world.heard["residual"]
        world.play(whole)
        world.wait(lambda: len(torque) == 100 and len(residual) == formed)

        world.play(no_pressure)
        world.wait(lambda: len(torque) == 300)
        world.status("inputs", lambda s: s.message.endswith("pressure/main_a, pressure/main_b, pressure/aux_a, pressure/aux_b stale"))
        assert len(torque) == 300
        assert len(residual) == formed

        def told() -> bool:
            last = world.statuses("inputs")[-1]
            late = float(last.values["angle/right age [s]"]) > 0.9
            return late and last.level == ERROR and "angle/right stale" in last.message.split("; ")

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


def test_a_model_that_no_longer_matches_is_told_with_the_time_since() -> None:
    health = Health(load(VEHICLE), 0.2, 0.5, 10)
    health.mismatch_s = 12.3
    status = next(s for s in health.statuses(1, 1, 1.0, {}, 0) if s.name.endswith("residual"))
    assert status.level == WARN
    assert status.message == "the residual is not what it was: the model no longer matches; diagnose"
    assert {pair.key: pair.value for pair in status.values}["no longer matches since [s]"] == "12.3"


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
        world.status("rejected", lambda s: expected.items() <= s.values.items())
        assert WARN in [status.level for status in world.statuses("rejected")]  # while they were new
        for topic in ("torque", "estimate"):
            assert world.stamps(topic) == [*(T0 + i * 10 * ms for i in range(20)), last + 20 * ms]


def still(_side: int, _angle: float) -> float:
    return 0.0


def test_an_exception_in_a_callback_withholds_the_torque_and_passes(tmp_path: Path) -> None:
    script = tmp_path / "failing_node.py"
    script.write_text(FAILING_NODE)
    vehicle = load(VEHICLE)
    with LiveNode(script=script) as node, World(vehicle) as world:
        driver = Driver(world)
        driver.steer_until(lambda: len(world.heard["torque"]) > 20, still)
        for channel in (0, 1, 0):
            world.send(now_sample(channel, 0.1255))
        failed_ns = time.time_ns()
        driver.steer_until(lambda: sum(stamp > failed_ns + SECOND for stamp in world.stamps("torque")) > 20, still)
        # Held back for a second from the moment the node failed, which is later than the last failing sample was sent;
        # half of it is left to the way through the middleware.
        assert not [stamp for stamp in world.stamps("torque") if failed_ns < stamp < failed_ns + SECOND // 2]

        values = world.status("outputs", lambda s: s.level == WARN).values  # over, but not forgotten
        assert ERROR in [status.level for status in world.statuses("outputs")]
        assert values["exceptions"] == "3"
        assert values["last exception"] == "ZeroDivisionError: made to fail"
        assert int(values["withheld: after an exception"]) > 0
        assert node.process.poll() is None


def test_a_node_that_cannot_keep_up_says_so_and_can_be_stopped(tmp_path: Path) -> None:
    """Its executor's queue is never empty and, left alone, grows with each message that the middleware drops."""
    script = tmp_path / "slow_node.py"
    script.write_text(SLOW_NODE)
    vehicle = load(VEHICLE)
    with LiveNode(script=script) as node, World(vehicle) as world:
        told, over = "more messages came than could be read", threading.Event()

        def flood() -> None:
            while not over.is_set():
                for channel in range(2, len(vehicle.channels)):
                    world.send(now_sample(channel, 1e6))
                time.sleep(1e-3)

        flooding = threading.Thread(target=flood)
        flooding.start()
        try:
            world.status("rejected", lambda s: told in s.message)
            code, seconds = node.stop(signal.SIGTERM)
        finally:
            over.set()
            flooding.join()
        assert code == 0, node.output
        assert seconds < STOP_S


class Steady:
    """Steers at a constant rate [rad/s], a hundred times a second, and counts."""

    def __init__(self, world: World) -> None:
        self.world, self.angle, self.pairs = world, 0.0, 0

    def steer(self, pairs: int, rate: float, age_ns: int = 0) -> None:
        for _ in range(pairs):
            self.angle += 0.01 * rate
            stamp_ns = time.time_ns() - age_ns
            for channel in (0, 1):
                self.world.send(Sample(channel, stamp_ns, self.angle))
            time.sleep(0.01)
        self.pairs += pairs


def test_commands_stay_silent_on_stale_inputs_and_come_back_without_a_jump() -> None:
    vehicle = load(VEHICLE)
    timeout_s, ramp_s = 2.0, 0.8  # longer than this machine sleeps between two samples: no silence but those meant here
    arguments = ("-p", "publish_commands:=true", "-p", f"recovery_ramp_s:={ramp_s}", "-p", f"angle_timeout_s:={timeout_s}")
    with LiveNode(*arguments), World(vehicle) as world:
        commands, feed_forward = world.heard["feed_forward/commands"], world.heard["feed_forward"]
        steady = Steady(world)

        def steer_until_the_ramp_is_over() -> None:
            for _ in range(100):
                steady.steer(20, 0.01)
                world.wait(lambda: len(commands) == len(feed_forward) == steady.pairs)
                if list(commands[-1].data) == list(feed_forward[-1].effort):
                    return
            raise AssertionError("it never is")

        steer_until_the_ramp_is_over()
        assert commands[0].data[0] == 0.0
        assert len(commands[-1].data) == 2

        before, last = len(commands), list(commands[-1].data)
        time.sleep(timeout_s + 0.5)  # nothing comes in: nothing goes out
        assert len(commands) == before
        steady.pairs -= 1  # the first stamp after it has to be confirmed

        steady.angle = 0.25
        steer_until_the_ramp_is_over()
        wanted = [list(m.effort) for m in feed_forward[before:]]
        assert list(commands[before].data) == last
        assert abs(wanted[0][0] - last[0]) > 500.0  # or this test would show nothing
        # The way back goes by the node's clock: however long this machine slept in between, it only goes forward, and never faster.
        way = [(b.data[0] - last[0]) / (w[0] - last[0]) for b, w in zip(commands[before:], wanted, strict=True)]
        assert way[0] == 0.0
        assert all(a <= b for a, b in itertools.pairwise(way))
        began = world.stamps("feed_forward")[before] * 1e-9 - time.time() + time.monotonic()
        heard = world.arrived["feed_forward/commands"][before:]
        assert all(share < (when - began) / ramp_s + 1e-3 for share, when in zip(way, heard, strict=True))

        before = len(commands)
        time.sleep(timeout_s + 0.5)
        steady.steer(30, 0.0, age_ns=round((timeout_s + 0.3) * SECOND))  # too old on arrival: an estimate, but nothing to act upon
        world.wait(lambda: len(world.heard["torque"]) == steady.pairs)
        assert len(commands) == before
        assert len(feed_forward) == len(commands)
        told = "withheld: feed-forward: stamps are not close to the clock"
        world.status("outputs", lambda s: s.values.get(told) == "30")
        last = feed_forward[-1].effort[0]
        steady.steer(30, 0.0)
        world.wait(lambda: len(feed_forward) == before + 29)  # but for the first, whose stamp has to be confirmed again
        assert feed_forward[before].effort[0] == pytest.approx(last, abs=STEP_NM)  # what nobody heard is not where it goes on from


STEP_NM = 0.05 * math.degrees(5393.7)
"""No step of the feed-forward is larger: 0.05 s of the limit of rate."""


def test_feed_forward_of_old_stamps_is_led_to_zero_if_so_wanted() -> None:
    arguments = ("-p", "publish_commands:=true", "-p", "recovery_ramp_s:=0.3", "-p", "when_stale:=zero")
    with LiveNode(*arguments), World(load(VEHICLE)) as world:
        commands, feed_forward, steady = world.heard["feed_forward/commands"], world.heard["feed_forward"], Steady(world)
        while not commands or abs(commands[-1].data[0]) < 5e3:
            steady.steer(20, 0.05)
        for late in range(200):  # a clock that goes at half speed
            steady.steer(1, 0.0, age_ns=late * SECOND // 200)
        world.wait(lambda: commands[-1].data[0] == 0.0 == feed_forward[-1].effort[0])
        heard = len(commands), len(feed_forward)
        steady.steer(30, 0.0, age_ns=SECOND)
        world.wait(lambda: len(world.heard["torque"]) == steady.pairs)
        assert (len(commands), len(feed_forward)) == heard  # zero has been said: silence
        steps = [abs(b.effort[0] - a.effort[0]) for a, b in itertools.pairwise(feed_forward)]
        assert max(steps) < STEP_NM


@pytest.mark.parametrize("cause", ["a clock set back", "an exception"])
def test_commands_do_not_jump_when_the_torque_does(tmp_path: Path, cause: str) -> None:
    """No silence comes near the time-out here, so only the node can know that a ramp is due."""
    script = tmp_path / "failing_node.py"
    script.write_text(FAILING_NODE)
    arguments = ("-p", "publish_commands:=true", "-p", "recovery_ramp_s:=2.0", "-p", "angle_timeout_s:=60.0")
    vehicle = load(VEHICLE)
    with LiveNode(*arguments, script=script) as node, World(vehicle) as world:
        commands, feed_forward = world.heard["feed_forward/commands"], world.heard["feed_forward"]
        steady = Steady(world)
        steady.steer(300, 0.1)
        world.wait(lambda: len(commands) == steady.pairs)
        last, before = commands[-1].data[0], len(commands)
        assert last > 5000.0
        if cause == "a clock set back":
            steady.steer(50, -0.1, age_ns=10 * SECOND)
            world.wait(lambda: len(commands) >= before + 20)
        else:
            world.send(now_sample(0, 0.1255))
            end = time.monotonic() + PATIENCE_S
            while len(commands) < before + 20 and time.monotonic() < end:
                steady.steer(10, -0.1)
        assert len(commands) >= before + 20
        after = commands[before].data[0]
        assert abs(feed_forward[-1].effort[0] - last) > 3000.0  # or this test would show nothing
        assert after == last
        if cause == "a clock set back":
            assert [key for key in world.status("rejected").values if key.endswith(" restart")]
        assert node.process.poll() is None


def outputs_of(health: Health) -> tuple[bytes, str]:
    """Level and message of the next report, a second after the one before."""
    status = list(health.statuses(0, 0, 1.0, {}, 0))[-1]
    return status.level, status.message


def test_an_exception_that_is_over_is_counted_in_the_message() -> None:
    health = Health(load(VEHICLE), 0.2, 0.5, 16)
    health.fault(ZeroDivisionError("made to fail"), -5 * SECOND)
    assert outputs_of(health) == (ERROR, "exception: ZeroDivisionError: made to fail")
    assert outputs_of(health) == (WARN, "1 exception so far: ZeroDivisionError: made to fail")


def test_silence_of_all_pressures_is_told_as_what_it_means() -> None:
    health = Health(load(VEHICLE), 0.2, 0.5, 16)
    labels = {f"input {i}": {"accepted": 0} for i in range(7)}
    health.arrivals, health.arrived_ns = [1] * 7, [SECOND] * 7
    for silent in (range(2, 5), range(2, 6)):
        health.arrived_ns = [SECOND - 600_000_000 * (i in silent) for i in range(7)]
        status = next(health.statuses(SECOND, 1, 1.0, labels, 0))
        assert status.level == WARN
        values = {pair.key: pair.value for pair in status.values}
        assert ("no measured torque" in values.get("plausibility", "")) == (len(silent) == 4)


def test_late_samples_are_counted_by_input_and_told_once() -> None:
    """One of them between others that are in time: nothing but the count shows it."""
    health, now_ns = Health(load(VEHICLE), 0.2, 0.5, 16), 1000 * SECOND
    labels = {f"input {i}": {"accepted": 0} for i in range(7)}
    for channel in range(7):
        health.arrive(channel, now_ns, now_ns)
        health.arrive(channel, now_ns, now_ns - (300_000_000 if channel in (0, 3) else 1_000_000))  # a pressure may be as late
        health.arrive(channel, now_ns, now_ns + 100_000)
    status = next(health.statuses(now_ns, 1, 1.0, labels, 0))
    assert (status.level, status.message) == (WARN, "input 0 came late")
    values = {pair.key: pair.value for pair in status.values}
    assert [values[f"input {i} late"] for i in range(7)] == ["1", *["0"] * 6]
    status = next(health.statuses(now_ns, 1, 1.0, labels, 0))
    assert (status.level, status.message) == (OK, "all inputs arrive")


@pytest.mark.parametrize(("silent_s", "told"), [(599, False), (601, True)])
def test_an_air_temperature_that_has_come_and_comes_no_more_is_told(silent_s: int, told: bool) -> None:
    health, now_ns = Health(load(VEHICLE), 0.2, 0.5, 16), 1000 * SECOND
    labels = {f"input {i}": {"accepted": 0} for i in range(7)}
    health.arrivals, health.arrived_ns = [1] * 7, [now_ns] * 6 + [now_ns - silent_s * SECOND]
    status = next(health.statuses(now_ns, 1, 1.0, labels, 0))
    assert ("input 6 stale" in status.message) == told


def test_a_pressure_line_that_is_not_believed_is_told_by_its_name() -> None:
    health = Health(load(VEHICLE), 0.2, 0.5, 16)
    labels = {f"input {i}": {"accepted": 0} for i in range(7)}
    for troubles in ([], ["pressure/main_a frozen", "pressure/aux_b jumped"]):
        health.add_residual(1.0, 1e4)
        status = list(health.statuses(SECOND, 1, 1.0, labels, 0, troubles))[3]
        assert (status.level, status.message) == ((WARN, f"withheld: {', '.join(troubles)}") if troubles else (OK, "residual formed"))


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
        status = list(health.statuses(0, 0, 1.0, {}, 0))[3]
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
    rejected = np.zeros((7, len(REASONS)), np.int64)
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
    assert list(health.statuses(0, 0, 1.0, {}, 0))[1].level == WARN
    health.arrivals[0] += 1
    health.foreign["/joint_states"] += 5
    status = list(health.statuses(0, 0, 1.0, {}, 0))[1]
    assert status.level == OK
    assert {pair.key: pair.value for pair in status.values} == {"/joint_states without a wanted joint": "10"}


def test_simulated_time() -> None:
    vehicle = load(VEHICLE)
    arguments = ("-p", "use_sim_time:=true", "-p", "publish_commands:=true")
    with LiveNode(*arguments), World(vehicle) as world:
        world.set_clock(100 * SECOND)
        for i in range(100):
            stamp_ns = 100 * SECOND + i * 10_000_000
            world.clock.publish(Clock(clock=to_time(stamp_ns)))
            world.send(Sample(0, stamp_ns, 0.0))
            world.send(Sample(1, stamp_ns, 0.0))
            # Topics overtake each other where the machine is busy: the next instant begins when this one is answered.
            world.wait(lambda i=i: len(world.heard["torque"]) > i and len(world.heard["feed_forward/commands"]) > i)
        assert len(world.heard["torque"]) == len(world.heard["feed_forward/commands"]) == 100
        latency = world.status("latency").values
        # The clock is a topic like the others: it may come a step of 10 ms after the angles.
        assert abs(float(latency["stamp to publish p50 [ms]"])) <= 10.0
        assert 0.0 < float(latency["arrival to publish p50 [ms]"]) < 1e3
        # Time stands still, so the inputs do not grow old; health is reported all the same.
        time.sleep(1.0)
        _level, message, values = world.status("inputs")
        assert "angle" not in message
        assert float(values["angle/left age [s]"]) < 0.15
