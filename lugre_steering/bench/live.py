# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Latency of the live node: the real node over real DDS, fed by a publisher in another process.

Ten topics (two angles, eight pressures) arrive staggered, each stamped when it is sent. Latency is from the stamp of
the later angle to the torque published; an update is lost if a pair of angles gave no torque.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import multiprocessing
import os
import signal
import sys
import tempfile
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.resources import config_folder
from lugre_steering.vehicle import Cylinder, Hydraulics, Vehicle, load, save

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
    import gc

    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from lugre_steering.live.estimator_node import SteeringTorqueEstimator
    from lugre_steering.live.run import spin

    # The two angles are stamped apart here: a pause of the publisher between them must not count as a loss.
    arguments = ["-p", f"vehicle_file:={vehicle_file}", "-p", f"executor:={executor}", "-p", "pair_tolerance_s:=1.0"]
    rclpy.init(args=["--ros-args", "--log-level", "warn", *arguments], signal_handler_options=SignalHandlerOptions.NO)
    node = SteeringTorqueEstimator(latency_window=size)
    gc.collect()
    gc.freeze()
    used = time.process_time()
    results.send(None)
    spin(node)
    health = node.health
    results.send(
        {
            "cpu_s": time.process_time() - used,
            "latency_ns": health.stamp_to_publish.values[: health.stamp_to_publish.count],
            "messages": sum(health.arrivals),
            "exceptions": health.exceptions,
        }
    )


def publish(vehicle_file: str, rate_Hz: float, seconds: float, results: Connection) -> None:
    """Process of the sensors: waits for the node's subscriptions, then sends each topic at its own moment."""
    import rclpy
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import FluidPressure, JointState

    from lugre_steering.recording import Kind

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
    begin = time.monotonic()
    for i in range(periods):
        for j, (message, publisher, is_angle) in enumerate(topics):
            wait = begin + (i + j / len(topics)) / rate_Hz - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            if is_angle:
                message.position = [0.3 * math.sin(2.0 * math.pi * 0.2 * i / rate_Hz)]
            stamp = message.header.stamp
            stamp.sec, stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
            publisher.publish(message)
    results.send({"pairs": periods, "messages": periods * len(topics), "seconds": time.monotonic() - begin})
    time.sleep(SETTLE_S)
    rclpy.try_shutdown()


def measure(vehicle_file: str, executor: str, rate_Hz: float, seconds: float) -> dict[str, Any]:
    """One run of node and publisher -> latency [ms], lost updates, CPU share of the node."""
    context = multiprocessing.get_context("spawn")
    from_node, to_node = context.Pipe()
    from_sensors, to_sensors = context.Pipe()
    size = round(seconds * rate_Hz) + 1
    node = context.Process(target=serve, args=(vehicle_file, executor, size, to_node), daemon=True)
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
    latency_ms = got["latency_ns"] * 1e-6
    if not latency_ms.size:
        raise RuntimeError(f"the node published nothing ({got['exceptions']} exceptions)")
    p50, p99 = np.percentile(latency_ms, (50.0, 99.0))
    return {
        "executor": executor,
        "rate_Hz": rate_Hz,
        "sent_rate_Hz": sent["pairs"] / sent["seconds"],
        "updates": sent["pairs"],
        "lost_updates": sent["pairs"] - len(latency_ms),
        "lost_messages": sent["messages"] - got["messages"],
        "p50_ms": float(p50),
        "p99_ms": float(p99),
        "max_ms": float(latency_ms.max()),
        "cpu_cores": got["cpu_s"] / sent["seconds"],
        "exceptions": got["exceptions"],
    }


def run(argv: list[str]) -> None:
    """``python -m lugre_steering.bench live``: a table on stdout, or JSON."""
    parser = argparse.ArgumentParser(prog="bench live", description=__doc__)
    parser.add_argument("--executors", nargs="+", default=["events", "single"], choices=["events", "single"])
    parser.add_argument("--rates", nargs="+", type=float, default=[100.0, 500.0, 1000.0], help="of each topic [Hz]")
    parser.add_argument("--seconds", type=float, default=5.0, help="of each run")
    parser.add_argument("--json", action="store_true", help="print JSON instead of the table")
    options, _ = parser.parse_known_args(argv)
    # Alone on a DDS domain of its own.
    os.environ["ROS_DOMAIN_ID"] = str(10 + os.getpid() % 90)
    results = []
    if not options.json:
        print(
            f"{'executor':>9} {'Hz each':>8} {'sent Hz':>8} {'p50 ms':>7} {'p99 ms':>7} {'max ms':>7} "
            f"{'lost updates':>15} {'lost messages':>14} {'cores':>6}"
        )
    with tempfile.TemporaryDirectory() as folder:
        vehicle_file = str(Path(folder) / "vehicle.yaml")
        save(eight_lines(), vehicle_file)
        for executor in options.executors:
            for rate_Hz in options.rates:
                result = measure(vehicle_file, executor, rate_Hz, options.seconds)
                results.append(result)
                if not options.json:
                    lost = f"{result['lost_updates']} of {result['updates']}"
                    print(
                        f"{executor:>9} {rate_Hz:8.0f} {result['sent_rate_Hz']:8.1f} {result['p50_ms']:7.3f} "
                        f"{result['p99_ms']:7.3f} {result['max_ms']:7.3f} {lost:>15} {result['lost_messages']:14d} "
                        f"{result['cpu_cores']:6.2f}",
                        flush=True,
                    )
    if options.json:
        json.dump({"live": results}, sys.stdout, indent=2)
        print()
