# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Latency of the live node beside that of a bare rclpy echo: real DDS, a publisher in another process.

Ten topics (two angles, eight pressures) arrive staggered, each stamped when it is sent. Latency is from the stamp of
the later angle to the torque published; an update is lost if a pair of angles gave no torque. The echo has the same
subscriptions, queues and executor, publishes one message for each later angle and does nothing else: what it needs is
the machine's and the middleware's. The publisher notes how late it is woken from its own sleeps: the machine's alone.
Node and echo run by turns, so that both see the same machine.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import multiprocessing
import os
import signal
import tempfile
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.bench.neighbour import use_own_domain
from lugre_steering.recording import Array, Kind
from lugre_steering.resources import config_folder
from lugre_steering.serialise import as_json
from lugre_steering.vehicle import Cylinder, Hydraulics, Vehicle, load, save

LEGEND = """\
p50, p99, max: from the stamp of the later angle to the torque published; callback: the part of it inside the callback.
The machine's part: wake-up, how late the publisher's sleeps end; stolen, what the host gave to other machines."""
START_TIMEOUT_S = 180.0  # a first start compiles
SETTLE_S = 0.5


def eight_lines() -> Vehicle:
    """The reference vehicle with a pressure sensor at each chamber of its four cylinders."""
    vehicle = load(config_folder() / "test_vehicle.yaml")
    assert vehicle.hydraulics is not None
    cylinders: dict[str, Cylinder] = {}
    for name, cylinder in vehicle.hydraulics.cylinders.items():
        cylinders[name] = dataclasses.replace(cylinder, cap=f"{name}_cap", rod=f"{name}_rod")
    lines = tuple(f"{name}_{chamber}" for name in cylinders for chamber in ("cap", "rod"))
    return vehicle.replace(hydraulics=Hydraulics(lines, cylinders))


def serve(vehicle_file: str, executor: str, size: int, results: Connection) -> None:
    """Process of the node: says when it is ready, runs until SIGTERM, then hands over what it measured."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from lugre_steering.live.estimator_node import SteeringTorqueEstimator

    # The two angles are stamped apart here: a pause of the publisher between them must not count as a loss.
    arguments = ["-p", f"vehicle_file:={vehicle_file}", "-p", f"executor:={executor}", "-p", "pair_tolerance_s:=1.0"]
    rclpy.init(args=["--ros-args", "--log-level", "warn", *arguments], signal_handler_options=SignalHandlerOptions.NO)
    node = SteeringTorqueEstimator(latency_window=size)
    node.start()
    assert node.session is not None
    health = node.session.health
    cpu_s = _run(node, executor, results)
    results.send(
        {
            "cpu_s": cpu_s,
            "latency_ns": health.stamp_to_publish.values[: health.stamp_to_publish.count],
            "own_ns": health.arrival_to_publish.values[: health.arrival_to_publish.count],
            "messages": sum(health.arrivals),
            "exceptions": health.exceptions,
        }
    )


def echo(vehicle_file: str, executor: str, size: int, results: Connection) -> None:
    """Process of the reference: subscribes as the node does and publishes one message for each later angle."""
    import rclpy
    from geometry_msgs.msg import WrenchStamped
    from rclpy.qos import QoSProfile, ReliabilityPolicy
    from rclpy.signals import SignalHandlerOptions
    from sensor_msgs.msg import FluidPressure, JointState

    from lugre_steering.live.health import Latencies

    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("bench_echo")
    out, publisher = WrenchStamped(), node.create_publisher(WrenchStamped, "echo", QoSProfile(depth=50))
    latency, own, heard = Latencies(size), Latencies(size), [0]

    def keep(_: Any) -> None:
        heard[0] += 1

    def answer(message: Any) -> None:
        begin_ns = time.monotonic_ns()
        heard[0] += 1
        out.header.stamp = stamp = message.header.stamp
        publisher.publish(out)
        own.add(time.monotonic_ns() - begin_ns)
        latency.add(time.time_ns() - (stamp.sec * 1_000_000_000 + stamp.nanosec))

    qos = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
    channels = [channel for channel in load(vehicle_file).channels if channel.kind in (Kind.ANGLE, Kind.PRESSURE)]
    later = [channel for channel in channels if channel.kind is Kind.ANGLE][-1]
    for channel in channels:
        message_type = JointState if channel.kind is Kind.ANGLE else FluidPressure
        node.create_subscription(message_type, channel.topic, answer if channel is later else keep, qos)
    cpu_s = _run(node, executor, results)
    windows = {"latency_ns": latency.values[: latency.count], "own_ns": own.values[: own.count]}
    results.send({"cpu_s": cpu_s, "messages": heard[0], "exceptions": 0, **windows})


def _run(node: Any, executor: str, results: Connection) -> float:
    """Spin until SIGTERM as the executable does -> processor time [s]."""
    import gc

    from lugre_steering.live.run import spin

    def fault(error: Exception) -> None:
        raise error

    gc.collect()
    gc.freeze()
    used = time.process_time()
    results.send(None)
    spin(node, executor, fault, lambda: 0)
    return time.process_time() - used


def stolen_s() -> float:
    """Processor time [s] of this (virtual) machine that its host gave to others since the start; NaN where not told."""
    try:
        first = Path("/proc/stat").read_text(encoding="ascii").split("\n", 1)[0]
    except OSError:
        return math.nan
    return int(first.split()[8]) / os.sysconf("SC_CLK_TCK")


def publish(vehicle_file: str, rate_Hz: float, seconds: float, results: Connection) -> None:
    """Process of the sensors: waits for the node's subscriptions, then sends each topic at its own moment."""
    import rclpy
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import FluidPressure, JointState

    rclpy.init(args=[])
    node = rclpy.create_node("bench_sensors")
    topics: list[tuple[Any, Any, bool]] = []
    for channel in load(vehicle_file).channels:
        if channel.kind is Kind.ANGLE:
            angle = JointState(name=[channel.joint], position=[0.0])
            topics.append((angle, node.create_publisher(JointState, channel.topic, qos_profile_sensor_data), True))
        elif channel.kind is Kind.PRESSURE:
            pressure = FluidPressure(fluid_pressure=1e6)
            topics.append(
                (pressure, node.create_publisher(FluidPressure, channel.topic, qos_profile_sensor_data), False)
            )
    while any(publisher.get_subscription_count() == 0 for _, publisher, _ in topics):
        time.sleep(0.05)
    time.sleep(SETTLE_S)
    periods = round(seconds * rate_Hz)
    woken_late_s = []
    stolen, begin = stolen_s(), time.monotonic()
    for i in range(periods):
        for j, (message, publisher, is_angle) in enumerate(topics):
            due = begin + (i + j / len(topics)) / rate_Hz
            wait = due - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
                woken_late_s.append(time.monotonic() - due)
            if is_angle:  # where it is now: a publisher that was held up must not make the angle jump
                message.position = [0.3 * math.sin(0.4 * math.pi * (time.monotonic() - begin))]
            else:  # one that repeats would be taken for frozen
                message.fluid_pressure = 1e6 + 1e3 * (7 * i % 11)
            stamp = message.header.stamp
            stamp.sec, stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
            publisher.publish(message)
    sent = {"pairs": periods, "messages": periods * len(topics), "seconds": time.monotonic() - begin}
    results.send({**sent, "woken_late_s": np.array(woken_late_s), "stolen_s": stolen_s() - stolen})
    time.sleep(SETTLE_S)
    rclpy.try_shutdown()


Task = Callable[[str, str, int, Connection], None]


def observe(task: Task, vehicle_file: str, executor: str, rate_Hz: float, seconds: float) -> dict[str, Any]:
    """One run of a task in its own process beside the publisher in another: what both report."""
    context = multiprocessing.get_context("spawn")
    from_node, to_node = context.Pipe()
    from_sensors, to_sensors = context.Pipe()
    size = round(seconds * rate_Hz) + 1
    node = context.Process(target=task, args=(vehicle_file, executor, size, to_node), daemon=True)
    sensors = context.Process(target=publish, args=(vehicle_file, rate_Hz, seconds, to_sensors), daemon=True)
    node.start()
    if not from_node.poll(START_TIMEOUT_S):
        raise TimeoutError("the node did not start")
    from_node.recv()
    sensors.start()
    if not from_sensors.poll(60.0 + 3.0 * seconds):
        raise TimeoutError("the publisher did not finish")
    sent = from_sensors.recv()
    sensors.join()
    assert node.pid is not None
    os.kill(node.pid, signal.SIGTERM)
    got = from_node.recv()
    node.join()
    if not got["latency_ns"].size:
        raise RuntimeError(f"{task.__name__} published nothing ({got['exceptions']} exceptions)")
    return {**sent, **got, "lost_messages": sent["messages"] - got["messages"]}


def summary(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Runs of one task as one: latency and own share of it [ms], lost updates and messages, processor shares."""

    def joined_ms(key: str, unit_s: float) -> Array:
        return np.concatenate([run[key] for run in runs]) * (1e3 * unit_s)

    def total(key: str) -> Any:
        return sum(run[key] for run in runs)

    latency, own, late = joined_ms("latency_ns", 1e-9), joined_ms("own_ns", 1e-9), joined_ms("woken_late_s", 1.0)
    return {
        "sent_rate_Hz": total("pairs") / total("seconds"),
        "updates": total("pairs"),
        "lost_updates": total("pairs") - latency.size,
        "lost_messages": total("lost_messages"),
        "p50_ms": float(np.percentile(latency, 50.0)),
        "p99_ms": float(np.percentile(latency, 99.0)),
        "max_ms": float(latency.max()),
        "callback_p50_ms": float(np.percentile(own, 50.0)),
        "callback_p99_ms": float(np.percentile(own, 99.0)),
        "cpu_cores": total("cpu_s") / total("seconds"),
        "exceptions": total("exceptions"),
        "wake_up_p99_ms": float(np.percentile(late, 99.0)),
        "stolen_cores": total("stolen_s") / total("seconds"),
    }


def measure(vehicle_file: str, executor: str, rate_Hz: float, seconds: float, rounds: int) -> dict[str, Any]:
    """Node and echo by turns."""
    runs: dict[str, list[dict[str, Any]]] = {"node": [], "echo": []}
    for _ in range(rounds):
        for name, task in (("node", serve), ("echo", echo)):
            runs[name].append(observe(task, vehicle_file, executor, rate_Hz, seconds))
    node, bare = summary(runs["node"]), summary(runs["echo"])
    # The machine has bad minutes: each run of the node against the echo beside it, and the median of those.
    own, other = (np.array([np.percentile(run["latency_ns"], 99.0) for run in runs[name]]) for name in ("node", "echo"))
    ratio = float(np.median(own / other))
    return {"executor": executor, "rate_Hz": rate_Hz, "node": node, "echo": bare, "p99_node_over_echo": ratio}


def run(argv: list[str]) -> None:
    """``python -m lugre_steering.bench live``: a table on stdout, or JSON."""
    parser = argparse.ArgumentParser(prog="bench live", description=__doc__)
    parser.add_argument("--executors", nargs="+", default=["events", "single"], choices=["events", "single"])
    parser.add_argument("--rates", nargs="+", type=float, default=[100.0, 500.0, 1000.0], help="of each topic [Hz]")
    parser.add_argument("--seconds", type=float, default=4.0, help="of each run")
    parser.add_argument("--rounds", type=int, default=5, help="runs of node and echo, by turns; the ratio of their p99 is a median")
    parser.add_argument("--json", action="store_true", help="print JSON instead of the table")
    options = parser.parse_args(argv)
    use_own_domain()
    results = []
    if not options.json:
        print(LEGEND)
        print(
            f"{'executor':>8} {'Hz each':>7} {'':>10} {'p50 ms':>7} {'p99 ms':>7} {'max ms':>7} {'callback p50, p99 ms':>20} "
            f"{'lost updates':>12} {'messages':>8} {'cores':>5} {'wake-up p99 ms':>14} {'stolen cores':>12}"
        )
    with tempfile.TemporaryDirectory() as folder:
        vehicle_file = str(Path(folder) / "vehicle.yaml")
        save(eight_lines(), vehicle_file)
        for executor in options.executors:
            for rate_Hz in options.rates:
                result = measure(vehicle_file, executor, rate_Hz, options.seconds, options.rounds)
                results.append(result)
                if options.json:
                    continue
                for name, label in (("node", "node"), ("echo", "bare rclpy")):
                    row = result[name]
                    lost = f"{row['lost_updates']} of {row['updates']}"
                    print(
                        f"{executor:>8} {rate_Hz:7.0f} {label:>10} {row['p50_ms']:7.3f} {row['p99_ms']:7.3f} "
                        f"{row['max_ms']:7.3f} {row['callback_p50_ms']:13.3f} {row['callback_p99_ms']:6.3f} "
                        f"{lost:>12} {row['lost_messages']:8d} {row['cpu_cores']:5.2f} "
                        f"{row['wake_up_p99_ms']:14.3f} {row['stolen_cores']:12.2f}"
                    )
                print(f"{'':>16} {'p99 ratio':>10} {'':>7} {result['p99_node_over_echo']:7.2f}", flush=True)
    if options.json:
        print(as_json({"live": results}))
