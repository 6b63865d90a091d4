# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A campaign of faults against the live node over real DDS, with a scoreboard.

A vehicle steers to and fro at 100 Hz with feed-forward commands on; its file is the one that ``calibrate`` writes after such strokes.
Each fault comes while the joint moves and lasts 0.8 s. Asked of each: every output of both sides finite and inside the limits of value
and rate; flagged in /diagnostics within 0.2 s of its first sample (both by header stamps); no exception; 1 s after its end the torque is
that of a vehicle that never had the fault (to 5 % of the static friction) and the feed-forward is not held back any more; the torque
equals a replay of the same messages. Of one pressure line that fails also: it is told by its name, the torque goes on as if nothing were,
and from 0.2 s on each residual is right or withheld.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.bench.neighbour import (
    NO_TEXT,
    PERIOD_S,
    SECOND,
    STROKE_S,
    STROKES,
    Fault,
    Neighbour,
    NodeProcess,
    Sample,
    Strokes,
    as_it_is,
    use_own_domain,
)
from lugre_steering.calibration.library import calibrate
from lugre_steering.chain.step import Records
from lugre_steering.estimator import Estimator
from lugre_steering.recording import NODE, Array, Kind, Recording
from lugre_steering.resources import config_folder
from lugre_steering.vehicle import Vehicle, load, save
from lugre_steering.vehicle.model import baseline_parameters

FAULT_S, REST_S = 0.8, 1.8
HEARD_S = 5.0
"""So long, at most, an answer is on its way."""
RATED_S = 15.0
"""More motion than rates must go with before they count as a witness."""
TOLD_S, RECOVERED_S = 0.2, 1.0
RAMP_S = 0.5
NEAR = 0.05
SENT_S = 0.005
"""From the moment for which a command is made until it is sent no more than this passes."""
NOTHING: tuple[str, ...] = ()
"""Nothing need be told."""
LINE = "one pressure"
CONTRADICTED, THREE, SIMULATED = "rate against angle", "three nodes of one name", "simulated time"
LIMITED = "slower"
ARGUMENTS = ("-p", "publish_commands:=true", "-p", f"recovery_ramp_s:={RAMP_S}", "-p", "max_rate_rad_s:=2.0")
SLOWER = ("both angles frozen", "both angles dropped", "everything dropped", "stamps 0.5 s behind", "angles in degrees")
SLOWER_NM_S = 1e5
"""A limit of rate a third of the default: the strokes keep to it, the ramp to zero alone would not."""


def _of(vehicle: Vehicle, kinds: tuple[Kind, ...], change: Callable[[int, Sample], Any], only: int | None = None) -> Fault:
    """``change`` for the samples of some kinds (of one channel only); a sample, or several, or none."""

    def fault(tick: int, sample: Sample) -> Any:
        if vehicle.channels[sample.channel].kind not in kinds or only not in (None, sample.channel):
            return (sample,)
        changed = change(tick, sample)
        return (changed,) if isinstance(changed, Sample) else changed

    return fault


def _held() -> Callable[[int, Sample], Sample]:
    """Every channel keeps its first value."""
    first: dict[int, float] = {}
    return lambda _, sample: sample._replace(value=first.setdefault(sample.channel, sample.value))


def _gathered(count: int) -> Callable[[int, Sample], list[Sample]]:
    """Nothing, and then ``count`` messages at once."""
    kept: dict[int, list[Sample]] = {}

    def change(_: int, sample: Sample) -> list[Sample]:
        waiting = kept.setdefault(sample.channel, [])
        waiting.append(sample)
        if len(waiting) < count:
            return []
        kept[sample.channel] = []
        return waiting

    return change


def _late(count: int) -> Callable[[int, Sample], list[Sample]]:
    """Every message so many ticks later."""
    kept: dict[int, list[Sample]] = {}

    def change(_: int, sample: Sample) -> list[Sample]:
        waiting = kept.setdefault(sample.channel, [])
        waiting.append(sample)
        return [waiting.pop(0)] if len(waiting) > count else []

    return change


def _swapped() -> Callable[[int, Sample], list[Sample]]:
    """Each pair of messages in the wrong order."""
    kept: dict[int, Sample] = {}

    def change(_: int, sample: Sample) -> list[Sample]:
        if sample.channel in kept:
            return [sample, kept.pop(sample.channel)]
        kept[sample.channel] = sample
        return []

    return change


def _value(change: Callable[[float], float]) -> Callable[[int, Sample], Sample]:
    return lambda _, sample: sample._replace(value=change(sample.value))


def _stamp(change: Callable[[int], int]) -> Callable[[int, Sample], Sample]:
    return lambda _, sample: sample._replace(stamp_ns=change(sample.stamp_ns))


def _strays(ahead_ns: int) -> Callable[[int, Sample], Sample]:
    """One stamp of twenty is so far ahead."""
    return lambda tick, sample: sample._replace(stamp_ns=sample.stamp_ns + (ahead_ns if tick % 20 == 0 else 0))


def _spike(samples: int, height: float = 1.0) -> Callable[[int, Sample], Sample]:
    return lambda tick, sample: sample._replace(value=sample.value + (height if tick % 20 < samples else 0.0))


def _exchanged(first: int, second: int) -> Fault:
    """Two channels' plugs exchanged: each is sent with the value of the other, which was measured in the same tick."""
    kept: dict[int, Sample] = {}

    def fault(_: int, sample: Sample) -> Sequence[Sample]:
        if sample.channel not in (first, second):
            return (sample,)
        kept[sample.channel] = sample
        if sample.channel == first:
            return ()
        one, two = kept[first], kept[second]
        return (one._replace(value=two.value), two._replace(value=one.value))

    return fault


def _silent(_: int, __: Sample) -> tuple[()]:
    return ()


def _first_line(vehicle: Vehicle) -> int:
    return next(i for i, channel in enumerate(vehicle.channels) if channel.kind is Kind.PRESSURE)


def _faults_of_a_line(vehicle: Vehicle, line: int) -> Mapping[str, tuple[Fault, tuple[str, ...]]]:
    """One line of several, and the line after it: the other one of its circuit."""
    pressure, names = (Kind.PRESSURE,), [f"pressure/{vehicle.channels[i].name}" for i in (line, line + 1)]
    below = -0.25 * vehicle.sensors.pressure_range_Pa  # no current where 4 mA are zero, and 20 mA the end of the range

    def one(change: Callable[[int, Sample], Any], word: str) -> tuple[Fault, tuple[str, ...]]:
        return _of(vehicle, pressure, change, line), (f"{names[0]} {word}",)

    return {
        f"{LINE} silent": (_of(vehicle, pressure, _silent, line), (f"{names[0]} stale",)),
        f"{LINE} frozen": one(_held(), "frozen"),
        f"{LINE} with spikes": one(_spike(2, 1e7), "spike"),
        f"{LINE} stuck at zero": one(_value(lambda _: 0.0), "frozen"),
        f"{LINE} broken": one(_value(lambda _: below), "below_range"),
        f"{LINE} exchanged": (_exchanged(line, line + 1), (f"{names[0]} and {names[1]} exchanged",)),
    }


def faults_of(vehicle: Vehicle, rng: np.random.Generator) -> Mapping[str, tuple[Fault, tuple[str, ...]]]:
    """What is sent in place of the sensors' samples, and words of which one must be told."""
    angle, pressure, air = (Kind.ANGLE,), (Kind.PRESSURE,), (Kind.AIR_TEMPERATURE,)
    line = _first_line(vehicle)
    hour = 3600 * SECOND

    jumped = ("angle jumped", "spike")
    frozen, stale, framed = ("angle frozen",), ("stale",), ("of another frame",)
    unlike = ("residual implausible", "pressure frozen", "below_range")  # "residual formed" is told all the time
    return {
        "clock an hour ahead": (_of(vehicle, (*angle, *pressure), _stamp(lambda ns: ns + hour)), ("time_jump",)),
        "clock an hour back": (_of(vehicle, (*angle, *pressure), _stamp(lambda ns: ns - hour)), ("time_jump",)),
        "both angles frozen": (_of(vehicle, angle, _held()), frozen),
        "left angle frozen": (_of(vehicle, angle, _held(), 0), frozen),
        "right angle frozen": (_of(vehicle, angle, _held(), 1), frozen),
        "both angles dropped": (_of(vehicle, angle, _silent), stale),
        "left angle dropped": (_of(vehicle, angle, _silent, 0), stale),
        "all pressures dropped": (_of(vehicle, pressure, _silent), stale),
        "everything dropped": (_of(vehicle, (*angle, *pressure, *air), _silent), stale),
        "everything 0.5 s late": (_of(vehicle, (*angle, *pressure), _late(50)), ("stamps are not close", *stale)),
        "stamps 0.5 s behind": (_of(vehicle, (*angle, *pressure), _stamp(lambda ns: ns - SECOND // 2)), ("not close", "backward")),
        "stray stamps 1.9 s ahead": (_of(vehicle, (*angle, *pressure), _strays(19 * SECOND // 10)), ("time_jump",)),
        "everything twice": (_of(vehicle, (*angle, *pressure), lambda _, sample: [sample, sample]), ("duplicate",)),
        "everything in wrong order": (_of(vehicle, (*angle, *pressure), _swapped()), ("backward",)),
        "ten messages at once": (_of(vehicle, (*angle, *pressure), _gathered(10)), NOTHING),
        "angles are no number": (_of(vehicle, angle, _value(lambda _: math.nan)), ("not_finite",)),
        "left angle infinite": (_of(vehicle, angle, _value(lambda _: math.inf), 0), ("not_finite",)),
        "angles out of range": (_of(vehicle, angle, _value(lambda _: 4.0)), ("absurd",)),
        "angles in degrees": (_of(vehicle, angle, _value(math.degrees)), (*jumped, "absurd")),
        "both signs flipped": (_of(vehicle, angle, _value(lambda angle: 0.3 - angle)), jumped),
        "left angle 0.5 rad off": (_of(vehicle, angle, _value(lambda angle: angle + 0.5), 0), jumped),
        "spikes of two samples": (_of(vehicle, angle, _spike(2)), jumped),
        "spikes of five samples": (_of(vehicle, angle, _spike(5)), jumped),
        "noise of one degree": (
            _of(vehicle, angle, _value(lambda angle: angle + math.radians(1.0) * float(rng.standard_normal()))), ("noisy", *jumped)
        ),
        "rates that contradict": (_of(vehicle, angle, lambda _, sample: sample._replace(rate=50.0)), ("absurd_rate",)),
        "another joint's name": (_of(vehicle, angle, lambda _, sample: sample._replace(joint="boom")), ("without a wanted joint", *stale)),
        "frame of another sensor": (_of(vehicle, (*angle, *pressure), lambda _, sample: sample._replace(frame="boom")), framed),
        "frames that are no text": (_of(vehicle, (*angle, *pressure), lambda _, sample: sample._replace(frame=NO_TEXT)), framed),
        "zero stamps": (_of(vehicle, (*angle, *pressure), _stamp(lambda _: 0)), ("zero_stamp",)),
        "pressures are no number": (_of(vehicle, pressure, _value(lambda _: math.nan)), ("not_finite",)),
        "pressures out of range": (_of(vehicle, pressure, _value(lambda _: 1e9)), ("absurd",)),
        "pressures in bar": (_of(vehicle, pressure, _value(lambda p: 1e-5 * p)), unlike),
        "pressures negative": (_of(vehicle, pressure, _value(lambda p: -p)), unlike),
        "pressures frozen": (_of(vehicle, pressure, _held()), unlike),
        **_faults_of_a_line(vehicle, line),
        "air of 95 degC": (_of(vehicle, air, _value(lambda _: 95.0)), ("absurd",)),
        "air is no number": (_of(vehicle, air, _value(lambda _: math.nan)), ("not_finite",)),
    }  # fmt: skip


@dataclass(frozen=True)
class Score:
    """What came of one fault; times [s], NaN where it never came."""

    fault: str
    finite: bool
    inside_limits: bool
    told_s: float
    recovered_s: float
    held_back_s: float
    exceptions: bool
    largest_step_Nm: float
    off_replay_Nm: float
    wrong_residual_Nm: float
    words: str

    @property
    def passed(self) -> bool:
        quick = self.told_s <= TOLD_S and max(self.recovered_s, self.held_back_s) <= RECOVERED_S
        right = self.off_replay_Nm <= 1e-6 and self.wrong_residual_Nm <= NEAR
        return self.finite and self.inside_limits and not self.exceptions and quick and right


class Campaign:
    """One node and its neighbour; faults one after the other."""

    def __init__(self, folder: Path, seed: int, simulated: bool = False, limited: bool = False) -> None:
        """``limited``: other parameters than the defaults, a lower limit of rate and ``when_stale: zero``."""
        sheet = load(config_folder() / "test_vehicle.yaml")
        self.vehicle_file = folder / "calibrated.yaml"
        if not self.vehicle_file.exists():
            save(calibrated(sheet, seed), self.vehicle_file)
        self.vehicle = load(self.vehicle_file)
        self.log, self.rng = folder / "node.log", np.random.default_rng(seed)
        parameters = baseline_parameters(self.vehicle)
        self.friction = float(parameters["static_torque"]) * len(self.vehicle.sides)
        self.limit = 3.0 * float(parameters["static_torque"])
        self.slope = SLOWER_NM_S if limited else float(parameters["sigma_0"])
        self.arguments: tuple[str, ...] = (*ARGUMENTS, "-p", f"use_sim_time:={'true' if simulated else 'false'}")
        if limited:
            self.arguments += ("-p", f"feed_forward_rate_limit_Nm_s:={SLOWER_NM_S}", "-p", "when_stale:=zero")
        self.node = NodeProcess(self.vehicle_file, self.log, *self.arguments)
        self.neighbour = Neighbour(sheet, seed, simulated=simulated)
        self.neighbour.wait_for_node()
        time.sleep(2.0)

    def close(self) -> None:
        self.neighbour.close()
        if self.node.process.poll() is None:
            self.node.stop(signal.SIGTERM)

    def samples(self, name: str, fault: Fault, words: tuple[str, ...]) -> Score:
        """A fault of the sensors' samples."""
        neighbour = self.neighbour

        first: list[int] = []

        def faulty(tick: int, sample: Sample) -> Sequence[Sample]:
            sent = fault(tick, sample)
            if not first and tuple(sent) != (sample,):
                first.append(sample.stamp_ns)
            return sent

        def begin() -> None:
            neighbour.fault = faulty

        def end() -> None:
            neighbour.fault = as_it_is

        return self.judge(name, begin, end, words, first)

    def judge(
        self, name: str, begin: Callable[[], None], end: Callable[[], None], words: tuple[str, ...], first: Sequence[int] = ()
    ) -> Score:
        """Let a fault happen and judge it; ``first``: the stamp [ns] of its first sample, once there was one."""
        neighbour = self.neighbour
        neighbour.wait_until_it_moves()
        mark = len(neighbour.commands), len(neighbour.told)
        begin()
        begin_ns = neighbour.now_ns()
        time.sleep(FAULT_S)
        end()
        end_ns = neighbour.now_ns()
        time.sleep(REST_S)
        begin_ns = next(iter(first), begin_ns)
        told = neighbour.told[mark[1] :]
        when = [ns for ns, text in told if ns >= begin_ns and any(word in text for word in words)]
        commands = neighbour.commands[mark[0] :]
        steps = [abs(b - a) for (_, before), (_, after) in itertools.pairwise(commands) for a, b in zip(before, after, strict=True)]
        values = [value for _, sides in (*commands, *neighbour.feed_forward) for value in sides]
        wanted = dict(neighbour.estimate)
        now_ns = neighbour.now_ns()  # stamps may have been ahead of it
        fed = [(ns, value) for ns, value in neighbour.feed_forward if end_ns < ns < now_ns]
        held = [
            ns for ns, sides in fed
            if any(abs(value - torque) > NEAR * self.friction for value, torque in zip(sides, wanted.get(ns, sides), strict=True))
        ]  # fmt: skip
        return Score(
            fault=name,
            finite=all(map(math.isfinite, (*values, *(torque for _, torque in neighbour.torque)))),
            inside_limits=all(abs(value) <= self.limit for value in values) and keep_to_rate(commands, self.slope),
            told_s=(min(when) - begin_ns) / SECOND if when else (math.nan if words else 0.0),
            recovered_s=self._recovered_s(end_ns),
            held_back_s=(max(held, default=end_ns) - end_ns) / SECOND,
            exceptions="exception" in " ".join(text for _, text in told),
            largest_step_Nm=max(steps, default=0.0),
            off_replay_Nm=self._off_replay(end_ns),
            wrong_residual_Nm=self._wrong_residual(begin_ns) if name.startswith(LINE) else 0.0,
            words=next((text for ns, text in told if when and ns == min(when)), ""),
        )

    def _recovered_s(self, end_ns: int) -> float:
        """When after the fault's end the torque is, and stays, that of a vehicle without the fault."""
        clean = torques(self.vehicle, list(self.neighbour.clean))
        after = [(ns, value) for ns, value in self.neighbour.torque if ns > end_ns and ns in clean]
        off = [ns for ns, value in after if abs(value - clean[ns]) > NEAR * self.friction]
        if not after or (off and off[-1] == after[-1][0]):
            return math.nan
        return max(after[0][0] - end_ns, (max(off, default=end_ns) - end_ns)) / SECOND

    def _off_replay(self, end_ns: int) -> float:
        """Largest difference [N m] between what the node said after the fault and a replay of what it was sent."""
        replayed = torques(self.vehicle, list(self.neighbour.sent))  # more is being sent
        off = [abs(value - replayed[ns]) for ns, value in self.neighbour.torque if ns > end_ns and ns in replayed]
        return max(off, default=math.nan)


    def _wrong_residual(self, begin_ns: int) -> float:
        """How far [static friction] a residual, from when the fault should have been told, is off that of sound lines at most; infinite
        if a torque of the angles was off meanwhile, which no line touches."""
        estimates, residuals = replayed(self.vehicle, list(self.neighbour.clean))
        torque = {int(row["stamp_ns"]): float(row["total"]) for row in estimates}
        sound = {int(row["stamp_ns"]): float(row["residual"]) for row in residuals}
        if any(abs(value - torque[ns]) > NEAR * self.friction for ns, value in self.neighbour.torque if ns > begin_ns and ns in torque):
            return math.inf
        late_ns = begin_ns + round(TOLD_S * SECOND)
        off = (abs(value - sound[ns]) for ns, value in self.neighbour.residual if ns > late_ns and ns in sound)
        return max(off, default=math.inf) / self.friction


def calibrated(sheet: Vehicle, seed: int) -> Vehicle:
    """The vehicle as ``calibrate`` writes it after strokes as they are to come: with its error and the range that it has seen."""
    strokes, rng, sensors = Strokes(sheet), np.random.default_rng(seed), sheet.sensors
    time_s = np.arange(0.0, STROKES * STROKE_S, PERIOD_S)
    rows = np.array([strokes.at(float(t)) for t in time_s]).T
    assert sheet.hydraulics is not None
    noise = {Kind.ANGLE: math.radians(sensors.angle_noise_deg), Kind.PRESSURE: sensors.pressure_noise_Pa}
    signals: dict[Kind, dict[str, Array]] = {kind: {} for kind in noise}
    for channel, row in zip(sheet.channels, rows, strict=True):
        if channel.kind in noise:
            signals[channel.kind][channel.name] = row + noise[channel.kind] * rng.standard_normal(row.size)
    recording = Recording.from_arrays(time_s, angle=signals[Kind.ANGLE], pressure=signals[Kind.PRESSURE], name="strokes")
    return calibrate(recording, sheet).with_provenance()


def keep_to_rate(commands: Sequence[tuple[float, Sequence[float]]], limit_Nm_s: float) -> bool:
    """Whether commands (time [s], value [N m] of each side) go nowhere faster than the limit, from one to the next and over ten of them."""
    pairs = itertools.chain(itertools.pairwise(commands), zip(commands, commands[10:], strict=False))
    return all(
        abs(b - a) <= limit_Nm_s * (later - sooner + SENT_S)
        for (sooner, before), (later, after) in pairs
        for a, b in zip(before, after, strict=True)
    )


def torques(vehicle: Vehicle, samples: list[Sample]) -> dict[int, float]:
    """Total torque [N m] by stamp, of the messages pushed without ROS."""
    return {int(row["stamp_ns"]): float(row["total"]) for row in replayed(vehicle, samples)[0]}


def replayed(vehicle: Vehicle, samples: list[Sample]) -> tuple[Records, Records]:
    """Estimates and residuals of the messages pushed without ROS."""
    from lugre_steering.estimator import Options

    table = np.array([(s.channel, s.stamp_ns) for s in samples], np.int64).reshape(-1, 2)
    values = np.array([(s.value, s.rate) for s in samples]).reshape(-1, 2)
    estimator = Estimator(vehicle, Options(max_rate_rad_s=2.0, recovery_ramp_s=RAMP_S))
    return estimator.push_block(table[:, 0], table[:, 1].copy(), values[:, 0].copy(), values[:, 1].copy())


def _plan(neighbour: Neighbour, points: int, angle: float) -> Any:
    from builtin_interfaces.msg import Duration
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

    topics = neighbour.vehicle.topics
    message = JointTrajectory(joint_names=[topics.left_joint, topics.right_joint])
    message.points = [
        JointTrajectoryPoint(positions=[angle, angle], time_from_start=Duration(sec=i // 1000, nanosec=i % 1000 * 1_000_000))
        for i in range(points)
    ]
    return message


def events_of(campaign: Campaign) -> Mapping[str, tuple[Callable[[], None], Callable[[], None], tuple[str, ...]]]:
    """Faults that are no samples: begin, end, words of which one must be told."""
    from rclpy.serialization import serialize_message

    neighbour = campaign.neighbour
    def again(do: Callable[[], None], period_s: float) -> tuple[Callable[[], None], Callable[[], None]]:
        """Do it in every so many ticks, in the sensors' own thread."""
        every = max(1, round(period_s / neighbour.period_s))
        count = itertools.count()

        def moved(_: float) -> None:
            if next(count) % every == 0:
                do()

        def begin() -> None:
            neighbour.moved = moved

        def end() -> None:
            neighbour.moved = lambda _: None

        return begin, end

    huge, far, wild = serialize_message(_plan(neighbour, 20_000, 0.0)), _plan(neighbour, 10, 3.0), _plan(neighbour, 10, math.nan)
    publish = neighbour.command.publish
    garbage = bytes(campaign.rng.integers(0, 256, 200, np.uint8))

    def restart() -> None:
        neighbour.restart = True

    def nothing() -> None:
        pass

    return {
        "plans far from the angle": (*again(lambda: publish(far), 0.05), ("present angle", "faster")),
        "plans of no numbers": (*again(lambda: publish(wild), 0.05), ("not a number",)),
        "plans of garbage bytes": (*again(lambda: publish(garbage), 0.05), ("malformed",)),
        # The middleware itself throws them away.
        "angles of garbage bytes": (*again(lambda: neighbour.publishers[0].publish(garbage), 0.05), NOTHING),
        # Most are too long for the middleware, too: it says how many it lost.
        "a flood of huge plans": (*again(lambda: publish(huge), 0.1), ("more than", "lost on the way")),
        "sensors restart": (restart, nothing, ("stale",)),
    }


def parameters_set_wrongly(campaign: Campaign) -> bool:
    """Whether every wrong value is refused and the node goes on."""
    from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
    from rcl_interfaces.srv import SetParametersAtomically

    client = campaign.neighbour.node.create_client(SetParametersAtomically, f"/{NODE}/set_parameters_atomically")
    wrong = {
        "angle_timeout_s": ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=math.nan),
        "when_stale": ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="loud"),
        "max_gap_s": ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=1),
        "executor": ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="single"),
    }
    refused = []
    for name, value in wrong.items():
        future = client.call_async(SetParametersAtomically.Request(parameters=[Parameter(name=name, value=value)]))
        end = time.monotonic() + HEARD_S
        while not future.done() and time.monotonic() < end:
            time.sleep(0.01)
        refused.append(future.done() and not future.result().result.successful)
    return all(refused)


def killed(campaign: Campaign, number: int) -> tuple[bool, float]:
    """Stop the node and start it again: whether its last command was zero (a node that is killed cannot say it), start [s]."""
    neighbour = campaign.neighbour
    neighbour.wait_until_it_moves()
    campaign.node.stop(number)
    end = time.monotonic() + HEARD_S
    while any(neighbour.commands[-1][1]) and time.monotonic() < end:
        time.sleep(0.01)
    zero = not any(neighbour.commands[-1][1])
    begin = time.monotonic()
    campaign.node = NodeProcess(campaign.vehicle_file, campaign.log, *campaign.arguments)
    ready_s = time.monotonic() - begin
    neighbour.wait_for_node()
    return zero, ready_s


def rate_against_angle(campaign: Campaign) -> Score:
    """Rates that have gone with the angles for a while, and then go another way."""
    neighbour = campaign.neighbour
    angles = [i for i, channel in enumerate(campaign.vehicle.channels) if channel.kind is Kind.ANGLE]
    neighbour.rated = True
    time.sleep(RATED_S)
    try:
        return campaign.samples(
            CONTRADICTED, lambda _, s: (s._replace(rate=s.rate + 0.3) if s.channel in angles else s,), ("angle and rate contradict",)
        )
    finally:
        neighbour.rated = False


def three_at_once(campaign: Campaign) -> Score:
    """Two more nodes of the name: told as soon as the network knows of the first of them; when they are gone all is as before.

    They give no commands: of two that command one topic nobody can say what comes out.
    """
    neighbour, own = campaign.neighbour, (NODE, "/")
    mark, others = len(neighbour.told), (*campaign.arguments, "-p", "publish_commands:=false")

    def one_more(number: int) -> NodeProcess:
        return NodeProcess(campaign.vehicle_file, campaign.log.with_name(f"other_{number}.log"), *others)

    with ThreadPoolExecutor() as pool:
        started = pool.map(one_more, range(2))
        while neighbour.node.get_node_names_and_namespaces().count(own) < 2:
            time.sleep(0.001)
        seen_ns = neighbour.now_ns()
        nodes = list(started)

    def end() -> None:
        for node in nodes:
            node.stop(signal.SIGTERM)

    score = campaign.judge(THREE, lambda: None, end, NOTHING)
    told = [(ns, text) for ns, text in neighbour.told[mark:] if "of this name" in text]
    if not told:
        return replace(score, told_s=math.nan)
    return replace(score, told_s=max(0, told[0][0] - seen_ns) / SECOND, words=told[0][1])


def simulated_time(folder: Path, seed: int) -> Iterator[Score]:
    """A simulation that begins anew an hour back, as a bag that is looped does, and one whose clock leaps ahead."""
    campaign = Campaign(folder, seed, simulated=True)
    neighbour = campaign.neighbour

    def shift(hours: int) -> Callable[[], None]:
        def begin() -> None:
            neighbour.shift_ns += hours * 3600 * SECOND
            neighbour.clean.clear()  # the estimator begins anew, and so does what it is compared with

        return begin

    try:
        for name, hours in ((f"{SIMULATED} an hour ahead", 1), (f"{SIMULATED} reset", -1)):
            yield campaign.judge(name, shift(hours), lambda: None, ("time_jump",))
    finally:
        campaign.close()


def slower(folder: Path, seed: int) -> Iterator[Score]:
    """Faults that take the feed-forward away and give it back, with parameters other than the defaults."""
    campaign = Campaign(folder, seed, limited=True)
    try:
        for name, (fault, words) in faults_of(campaign.vehicle, campaign.rng).items():
            if name in SLOWER:
                yield replace(campaign.samples(name, fault, words), fault=f"{LIMITED}: {name}")
    finally:
        campaign.close()


def whole(folder: Path, seed: int, only: str, others: dict[str, Any]) -> Iterator[Score]:
    """All faults with ``only`` in their names, one after the other; what is no score goes into ``others``, if none is left out."""
    campaign = Campaign(folder, seed)
    try:
        for name, (fault, words) in faults_of(campaign.vehicle, campaign.rng).items():
            if only in name:
                yield campaign.samples(name, fault, words)
        for name, (begin, end, words) in events_of(campaign).items():
            if only in name:
                yield campaign.judge(name, begin, end, words)
        if only in CONTRADICTED:
            yield rate_against_angle(campaign)
        if only in THREE:
            yield three_at_once(campaign)
        if not only:
            others["wrong parameters refused"] = parameters_set_wrongly(campaign)
            others["SIGTERM: last command is zero"], others["then ready after [s]"] = killed(campaign, signal.SIGTERM)
            _, others["SIGKILL: ready after [s]"] = killed(campaign, signal.SIGKILL)
    finally:
        campaign.close()
    if only in SIMULATED:
        yield from simulated_time(folder, seed)
    if only in LIMITED:
        yield from slower(folder, seed)


HEAD = f"{'fault':28} {'told s':>7} {'back s':>7} {'free s':>7} {'step N m':>9} {'off replay':>11}  passed"


def line_of(score: Score) -> str:
    return (
        f"{score.fault:28} {score.told_s:7.3f} {score.recovered_s:7.3f} {score.held_back_s:7.3f} {score.largest_step_Nm:9.0f} "
        f"{score.off_replay_Nm:11.2g}  {'yes' if score.passed else 'NO'}"
    )


def run(argv: list[str]) -> None:
    """``python -m lugre_steering.bench faults``: a line a fault, or JSON."""
    parser = argparse.ArgumentParser(prog="bench faults", description=__doc__)
    parser.add_argument("--only", default="", help="only faults with this in their names")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="print JSON instead of the table")
    options = parser.parse_args(argv)
    use_own_domain()
    scores: list[Score] = []
    others: dict[str, Any] = {}
    if not options.json:
        print(HEAD)
    with tempfile.TemporaryDirectory() as folder:
        for score in whole(Path(folder), options.seed, options.only, others):
            scores.append(score)
            if not options.json:
                print(line_of(score), flush=True)
    if options.json:
        json.dump({"faults": [{**asdict(score), "passed": score.passed} for score in scores], **others}, sys.stdout, indent=2)
        print()
        return
    print(f"passed: {sum(score.passed for score in scores)} of {len(scores)}")
    for what, came in others.items():
        print(f"{what}: {came if isinstance(came, bool) else f'{came:.2f}'}")
