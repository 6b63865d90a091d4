# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What feed-forward is worth: a hydraulic steering axle in closed loop with the real node, over real topics.

The node runs in simulated time and in step with the plant: each period (5 ms) the plant sends its angles and line pressures, the node
answers with its feed-forward, and the controller acts upon it in the next period. So the figures do not depend on how busy the computer
is. With the pressures the node judges its model too: one whose residual is implausible is not fed forward. The plan is published as
steering/command; the node looks one period and the valve's delay ahead. Compared: no feed-forward; a friction of constant size against
the planned motion; the original LuGre model (no heating) and the improved one, both calibrated on recordings of this plant without feed-
forward, whose sheet does not know its rubber stop; the vehicle file that a diagnosis of the same recordings writes; nine tenths of what
these say; and a wrong model (twice the friction), without and with the limit of value that the node keeps. At last the seals of the same
axle's cylinders rub too: nothing fed forward, the diagnosed file that does not know of it, and what a diagnosis of the axle as it is now
writes.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import signal
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lugre_steering.bench.hydraulic_loop import Side, hydraulics_of
from lugre_steering.bench.neighbour import SECOND, NodeProcess, use_own_domain
from lugre_steering.calibration.library import calibrate
from lugre_steering.diagnosis.library import diagnose
from lugre_steering.proof.field.hydraulics import gains
from lugre_steering.proof.field.machine import Machine, track_angles
from lugre_steering.proof.field.motion import strokes
from lugre_steering.proof.field.rubber import table
from lugre_steering.proof.field.simulator import Setting, draw_setting
from lugre_steering.provenance import Provenance, provenance
from lugre_steering.recording import NODE, Array, Kind, Recording
from lugre_steering.vehicle import Vehicle, load, save
from lugre_steering.vehicle.actuation import line_pressures, total_gains
from lugre_steering.vehicle.model import baseline_parameters

PERIOD_S = 0.005
AHEAD_S = 0.02
PLAN_S, PLAN_EVERY = 0.5, 20
ANSWER_S = 2.0
T0_NS = 1_000 * SECOND
RECORD_S = 60.0
NONE, STATIC = "none", "constant friction"
SEAL_SHARE, SEAL_LOAD_SHARE = 0.02, 0.05
"""Friction of the cylinders' seals: of what the tracks need while they slide, and of the load."""


@dataclass(frozen=True)
class Run:
    """One closed-loop run: tracking error of both sides, energy from the supply, sign changes of the valve command."""

    feed_forward: str
    rms_deg: float
    peak_deg: float
    energy_kJ: float
    reversals: int
    late: int
    time: Array
    wanted: Array
    error_deg: Array
    torque: Array
    angles: Array
    loads: Array


@dataclass(frozen=True)
class Fed:
    """What is fed forward: a vehicle file, further arguments of the node, and the share of it that the controller takes."""

    vehicle: Vehicle
    arguments: tuple[str, ...] = ()
    share: float = 1.0
    seals: bool = False  # whether the axle that it is fed to has seals that rub


def reference(machine: Machine, seconds: float, way: float = 1.0) -> tuple[Array, Array, Array]:
    """Times (n,) [s], wanted angles and rates (2, n): wide strokes into the stop, small reversals, holds; ``way`` -1: mirrored."""
    share = np.array([0.5, -0.5, 0.95, -0.95, 0.6, 0.4, 0.55, -0.3, 0.9, 0.0])
    mean = strokes(way * machine.limit * share, np.radians([6.0, 9.0, 12.0, 12.0, 9.0, 4.0, 4.0, 12.0, 9.0, 9.0]), np.full(share.size, 0.6))
    fine = 2e-3 * np.arange(mean.size)
    time_s = np.arange(0.0, min(seconds, fine[-1]), PERIOD_S)
    wanted = track_angles(machine, np.interp(time_s, fine, mean))
    return time_s, wanted, np.gradient(wanted, PERIOD_S, axis=1)


class Controller:
    """The node's neighbour in step with it: angles, clock and plans out, feed-forward in."""

    def __init__(self, vehicle: Vehicle, pressures: bool = True) -> None:
        """``pressures``: whether they are published, too."""
        import rclpy
        from rclpy.qos import QoSProfile, qos_profile_sensor_data
        from rosgraph_msgs.msg import Clock
        from sensor_msgs.msg import FluidPressure, JointState
        from trajectory_msgs.msg import JointTrajectory

        self.vehicle, self._topics = vehicle, vehicle.topics
        self._context = rclpy.Context()
        rclpy.init(context=self._context, args=[])
        self.node = rclpy.create_node("controller", context=self._context)
        self._executor = rclpy.executors.SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        topics = vehicle.topics.left, vehicle.topics.right
        self._angle = [self.node.create_publisher(JointState, topic, QoSProfile(depth=10)) for topic in topics]
        lines = [channel.topic for channel in vehicle.channels if pressures and channel.kind is Kind.PRESSURE]
        self._pressure = [self.node.create_publisher(FluidPressure, topic, QoSProfile(depth=10)) for topic in lines]
        self._clock = self.node.create_publisher(Clock, "/clock", qos_profile_sensor_data)
        self._plan = self.node.create_publisher(JointTrajectory, "steering/command", QoSProfile(depth=10))
        self._heard: tuple[int, list[float]] = (0, [0.0, 0.0])
        self.node.create_subscription(JointState, f"/{NODE}/feed_forward", self._keep, QoSProfile(depth=50))

    def _keep(self, message: Any) -> None:
        self._heard = message.header.stamp.sec * SECOND + message.header.stamp.nanosec, list(message.effort)

    def join(self) -> None:
        """Until the node has joined the topics."""
        end = time.monotonic() + 60.0
        own = (*self._angle, *self._pressure, self._clock, self._plan)
        while any(publisher.get_subscription_count() == 0 for publisher in own) and time.monotonic() < end:
            time.sleep(0.02)
        time.sleep(0.5)

    def close(self) -> None:
        self.node.destroy_node()
        self._context.try_shutdown()

    def ask(self, stamp_ns: int, angles: list[float], pressures: Sequence[float]) -> list[float] | None:
        """The feed-forward [N m] for these angles; None if none came in time. The pressures [Pa] of the same instant come before them."""
        from builtin_interfaces.msg import Time
        from rosgraph_msgs.msg import Clock
        from sensor_msgs.msg import FluidPressure, JointState

        stamp = Time(sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND)
        self._clock.publish(Clock(clock=stamp))
        for publisher, pressure in zip(self._pressure, pressures, strict=False):  # there may be none
            message = FluidPressure(fluid_pressure=pressure)
            message.header.stamp = stamp
            publisher.publish(message)
        for publisher, joint, angle in zip(self._angle, (self._topics.left_joint, self._topics.right_joint), angles, strict=True):
            message = JointState(name=[joint], position=[angle])
            message.header.stamp = stamp
            publisher.publish(message)
        end = time.monotonic() + ANSWER_S
        while self._heard[0] < stamp_ns and time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.05)
        return self._heard[1] if self._heard[0] >= stamp_ns else None

    def plan(self, stamp_ns: int, angles: Array) -> None:
        """Publish the angles (2, n) wanted from now on, one period apart."""
        from builtin_interfaces.msg import Duration, Time
        from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

        message = JointTrajectory(joint_names=[self._topics.left_joint, self._topics.right_joint])
        message.header.stamp = Time(sec=stamp_ns // SECOND, nanosec=stamp_ns % SECOND)
        for i, both in enumerate(angles.T.tolist()):
            ahead_ns = round(i * PERIOD_S * SECOND)
            message.points.append(JointTrajectoryPoint(positions=both, time_from_start=Duration(nanosec=ahead_ns)))
        self._plan.publish(message)


def drive(
    name: str, setting: Setting, seconds: float, controller: Controller | None = None, *, constant_Nm: float = 0.0, share: float = 1.0,
    way: float = 1.0, seals: bool = False,
) -> Run:
    """The whole manoeuvre; without a controller nothing is fed forward but a constant friction against the planned motion."""
    time_s, wanted, rate = reference(setting.machine, seconds, way)
    drive_ = setting.drives[0]
    ground = setting.ground._replace(rubber_degC=drive_.rubber_degC, air_degC=drive_.air_degC)
    par = hydraulics_of(setting.machine, gains(setting.machine, np.zeros((2, 1)))[:, 0])
    if seals:
        par = par._replace(seal=SEAL_SHARE * ground.sliding_Nm, seal_share=SEAL_LOAD_SHARE)
    sides = [Side(par, ground, setting.ratios, cells) for cells in setting.cells]
    rng = np.random.default_rng(1)
    angles, loads, commands = np.zeros((3, 2, time_s.size))
    torques, late = np.zeros(time_s.size), 0
    fed = [0.0, 0.0]
    for i in range(time_s.size):
        stamp_ns = T0_NS + round(time_s[i] * SECOND)
        if controller is None:
            fed = (constant_Nm * np.tanh(rate[:, i] / np.radians(0.3))).tolist()
        for j, side in enumerate(sides):
            commands[j, i] = side.command(wanted[j, i], rate[j, i], share * fed[j], PERIOD_S)
            side.advance(commands[j, i], PERIOD_S)
            angles[j, i], loads[j, i] = side.angle, side.load
        torques[i] = share * fed[0]
        if controller is not None:
            if i % PLAN_EVERY == 0:
                controller.plan(stamp_ns, wanted[:, i : i + round(PLAN_S / PERIOD_S)])
            seen, shown = shown_by(controller.vehicle, angles[:, i : i + 1], loads[:, i : i + 1], rng)
            answer = controller.ask(stamp_ns, seen[:, 0].tolist(), shown[:, 0].tolist())
            late += answer is None
            fed = answer or fed
    error = np.degrees(wanted - angles)
    energy = sum(float(side.state[5]) for side in sides) * 1e-3
    turns = int((np.diff(np.sign(commands), axis=1) != 0).sum())
    return Run(
        name, float(np.sqrt(np.mean(error**2))), float(np.abs(error).max()), energy, turns, late, time_s, wanted[0], error[0], torques,
        angles, loads,
    )  # fmt: skip


def sheet_of(setting: Setting, folder: Path) -> Vehicle:
    """The vehicle file that came with the machine: it knows of no stop."""
    (folder / "vehicle.yaml").write_text(yaml.safe_dump(setting.sheet, sort_keys=False), encoding="utf-8")
    (folder / "rubber.csv").write_text(table(setting.machine.rubber), encoding="utf-8")
    return load(folder / "vehicle.yaml")


def shown_by(sheet: Vehicle, angles: Array, loads: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Angles (2, n) [rad] and pressures (lines, n) [Pa] as the sensors show them."""
    sensors = sheet.sensors
    pressures = line_pressures(loads.sum(axis=0), total_gains(sheet, angles))
    pressures = pressures + sensors.pressure_noise_Pa * rng.standard_normal(pressures.shape)
    return angles + np.radians(sensors.angle_noise_deg) * rng.standard_normal(angles.shape), pressures


def recorded(setting: Setting, sheet: Vehicle, way: float, seals: bool = False) -> Recording:
    """The plant without feed-forward, as its sensors show it."""
    assert sheet.hydraulics is not None
    run_ = drive(NONE, setting, RECORD_S, way=way, seals=seals)
    angles, pressures = shown_by(sheet, run_.angles, run_.loads, np.random.default_rng(2))
    named = dict(zip(sheet.sides, angles, strict=True)), dict(zip(sheet.hydraulics.lines, pressures, strict=True))
    return Recording.from_arrays(run_.time, angle=named[0], pressure=named[1], name="there" if way > 0.0 else "mirrored")


def found_in(recordings: Sequence[Recording], sheet: Vehicle) -> Vehicle:
    """The vehicle file that a diagnosis writes; what it says and how long it took goes to the standard error."""
    begin = time.monotonic()
    diagnosis = diagnose(recordings, sheet)
    print(f"({time.monotonic() - begin:.0f} s) {diagnosis.statement}", file=sys.stderr, flush=True)
    return diagnosis.augmented.vehicle


def models(setting: Setting, folder: Path) -> Mapping[str, Fed]:
    """What to compare, calibrated on and found in recordings of the plant."""
    sheet = sheet_of(setting, folder)
    recordings = [recorded(setting, sheet, way) for way in (1.0, -1.0)]
    improved, found = calibrate(recordings, sheet).with_provenance(), found_in(recordings, sheet)
    rubbing = found_in([recorded(setting, sheet, way, seals=True) for way in (1.0, -1.0)], sheet)
    axle = improved.axle
    assert axle is not None
    wrong = improved.replace(axle=dataclasses.replace(axle, load_N=2.0 * axle.load_N))
    limit = 1.1 * float(baseline_parameters(found)["static_torque"])
    return {
        "original LuGre": Fed(improved.replace(rubber=None)),
        "improved": Fed(improved),
        "improved, nine tenths": Fed(improved, share=0.9),
        "as diagnosed": Fed(found),
        "as diagnosed, nine tenths": Fed(found, share=0.9),
        "wrong model": Fed(wrong),
        "wrong model, limited": Fed(wrong, ("-p", f"feed_forward_limit_Nm:={limit:.1f}")),
        "seals rub, not known": Fed(found, share=0.9, seals=True),
        "seals rub, as diagnosed": Fed(rubbing, share=0.9, seals=True),
    }


def campaign(seed: int, seconds: float, pressures: bool = True) -> list[Run]:
    """All runs; ``pressures``: whether the node gets them."""
    setting = draw_setting(seed, "clean", "white")
    runs = [drive(NONE, setting, seconds)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        compared = models(setting, folder)
        constant_Nm = float(baseline_parameters(compared["improved"].vehicle)["coulomb_torque"])
        runs.append(drive(STATIC, setting, seconds, constant_Nm=constant_Nm))
        rubbing = drive(f"seals rub, {NONE}", setting, seconds, seals=True)
        for label, fed in compared.items():
            file = folder / f"{label.replace(' ', '_').replace(',', '')}.yaml"
            save(fed.vehicle, file)
            common = ("-p", "use_sim_time:=true", "-p", f"feed_forward_horizon_s:={AHEAD_S}", "-p", "recovery_ramp_s:=0.2")
            node = NodeProcess(file, folder / "node.log", *common, *fed.arguments)
            controller = Controller(fed.vehicle, pressures)
            try:
                controller.join()
                runs.append(drive(label, setting, seconds, controller, share=fed.share, seals=fed.seals))
            finally:
                controller.close()
                node.stop(signal.SIGTERM)
    last = next(i for i, run_ in enumerate(runs) if run_.feed_forward.startswith("seals"))
    return [*runs[:last], rubbing, *runs[last:]]


def draw(runs: list[Run], file: Path, made: Provenance) -> None:
    """The picture: wanted angle, torque fed forward, tracking error; of as many runs as there are colours, the wrong models last."""
    from lugre_steering.report.style import SERIES, figure

    with figure(3, 1, "Closed loop with the live node: what feed-forward is worth", file, made=made) as axes:
        axes[0, 0].plot(runs[0].time, np.degrees(runs[0].wanted), color="black")
        for run_, colour in zip(runs, SERIES, strict=False):
            axes[1, 0].plot(run_.time, 1e-3 * run_.torque, color=colour, linewidth=1.0)
            axes[2, 0].plot(run_.time, run_.error_deg, color=colour, linewidth=1.0)
            axes[0, 0].plot([], [], color=colour, label=f"{run_.feed_forward}: {run_.rms_deg:.2f} deg")
        titles = "wanted angle (deg)", "torque fed forward, left (kN m)", "tracking error, left (deg)"
        for ax, words in zip(axes[:, 0], titles, strict=True):
            ax.set_ylabel(words)
            ax.set_xlabel("time (s)")
        axes[0, 0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)  # curves are everywhere inside


def run(argv: list[str]) -> None:
    """``python -m lugre_steering.bench closed_loop``: a table, and a picture with --out; or JSON."""
    parser = argparse.ArgumentParser(prog="bench closed_loop", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of the manoeuvre, at most")
    parser.add_argument("--seed", type=int, default=11, help="of the machine")
    parser.add_argument("--no-pressures", action="store_true", help="the node gets angles only, so that nothing judges its model")
    parser.add_argument("--out", type=Path, help="file of the picture (.png)")
    parser.add_argument("--json", action="store_true", help="print JSON instead of the table")
    options = parser.parse_args(argv)
    use_own_domain()
    runs = campaign(options.seed, options.seconds, not options.no_pressures)
    _tell(runs, options.json)
    if options.out is not None:
        made = provenance("bench closed_loop", {"seed": options.seed, "seconds": options.seconds})
        draw(runs, options.out, made)


def _tell(runs: list[Run], as_json: bool) -> None:
    if as_json:
        shown = ("feed_forward", "rms_deg", "peak_deg", "energy_kJ", "reversals", "late")
        json.dump([{key: asdict(run_)[key] for key in shown} for run_ in runs], sys.stdout, indent=2)
        print()
        return
    print(f"{'feed-forward':26} {'rms deg':>8} {'peak deg':>9} {'energy kJ':>10} {'reversals':>10} {'no answer':>10}")
    for run_ in runs:
        print(
            f"{run_.feed_forward:26} {run_.rms_deg:8.3f} {run_.peak_deg:9.3f} {run_.energy_kJ:10.0f} {run_.reversals:10d} {run_.late:10d}"
        )
