# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the node publishes, against the estimator called directly with the same samples."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Duration
from live_harness import (
    BEGUN,
    NAME,
    SECOND,
    STOPPED,
    T0,
    VEHICLE,
    LiveNode,
    Sample,
    World,
    direct,
    message_of,
    motion,
    to_ns,
    to_time,
)
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lugre_steering.estimator import Estimator, Options
from lugre_steering.replay.run import replay
from lugre_steering.vehicle import Vehicle, load

EXACT = {"rtol": 1e-9, "atol": 0.0}


def column(messages: list[Any], field: str) -> np.ndarray[Any, Any]:
    def value(message: Any) -> Any:
        for name in field.split("."):
            message = getattr(message, name)
        return message

    return np.array([value(message) for message in messages])


def assert_topics_equal(world: World, estimates: list[Any], residuals: list[Any]) -> None:
    heard, sides = world.heard, len(world.vehicle.sides)
    expected_of = dict.fromkeys(("torque", "estimate", "feed_forward"), len(estimates))
    expected_of |= dict.fromkeys(("cylinder_torque", "residual"), len(residuals))
    if world.vehicle.rubber is not None:
        expected_of |= {f"rubber_temperature/{side}": len(estimates) for side in world.vehicle.sides}
    world.wait(lambda: all(len(heard[topic]) >= count for topic, count in expected_of.items()))
    assert world.stamps("torque") == [int(row["stamp_ns"]) for row in estimates]
    np.testing.assert_allclose(column(heard["torque"], "wrench.torque.z"), [row["total"] for row in estimates], **EXACT)
    for topic, field, source in (
        ("estimate", "position", "theta"),
        ("estimate", "velocity", "omega"),
        ("estimate", "effort", "torque"),
        ("feed_forward", "effort", "feed_forward"),
    ):
        expected = np.array([row[source][:sides] for row in estimates])
        assert world.stamps(topic) == world.stamps("torque")
        np.testing.assert_allclose(column(heard[topic], field), expected, **EXACT)
    if world.vehicle.rubber is not None:
        for i, side in enumerate(world.vehicle.sides):
            messages = heard[f"rubber_temperature/{side}"]
            expected = np.array([row["temperature"][i] for row in estimates])
            np.testing.assert_allclose(column(messages, "temperature"), expected, **EXACT)
    for topic, source in (("cylinder_torque", "measured_torque"), ("residual", "residual")):
        assert world.stamps(topic) == [int(row["stamp_ns"]) for row in residuals]
        values = column(heard[topic], "wrench.torque.z")
        np.testing.assert_allclose(values, [row[source] for row in residuals], **EXACT)


def test_live_equals_direct_on_every_topic() -> None:
    vehicle = load(VEHICLE)
    samples = motion(vehicle, 5.0)
    estimates, residuals = direct(Estimator(vehicle), samples)
    assert len(estimates) == 500
    assert len(residuals) > 490 - BEGUN
    with LiveNode(*STOPPED), World(vehicle) as world:
        world.set_clock(T0)
        world.play(samples, speed=2.0)
        assert_topics_equal(world, estimates, residuals)
        _, _, inputs = world.status("inputs")
        _, _, latency = world.status("latency")
        torque, estimate = world.heard["torque"][0], world.heard["estimate"][0]
        assert torque.header.frame_id == "base_link"
        assert estimate.name == ["left_track_steer_joint", "right_track_steer_joint"]
        assert world.heard["rubber_temperature/left"][0].header.frame_id == "left_track"
        assert not world.heard["feed_forward/commands"]  # off by default
        assert inputs["angle/left topic"] == "/steering/left/joint_state"
        assert latency["torques published"] == "500"
        names = [status.name for status in world.heard["diagnostics"][-1].status]
        components = ("inputs", "rejected", "latency", "residual", "outputs")
        assert names == [f"steering_torque_estimator: {component}" for component in components]


def test_both_joints_on_one_topic_in_a_namespace() -> None:
    vehicle = load(VEHICLE)
    one = dict.fromkeys(("steering/left/joint_state", "steering/right/joint_state"), "/joint_states")
    remaps = [text for topic, target in one.items() for text in ("-r", f"{topic}:={target}")]
    estimator = Estimator(vehicle)
    expected = []
    with LiveNode("-r", "__ns:=/truck", *remaps), World(vehicle, namespace="truck", remaps=one) as world:
        for i in range(100):
            stamp_ns = T0 + i * 10_000_000
            left, right = 0.1 * math.sin(0.03 * i), 0.09 * math.sin(0.03 * i)
            rates = [0.3 * math.cos(0.03 * i), 0.27 * math.cos(0.03 * i)]
            names = ["boom", "right_track_steer_joint", "left_track_steer_joint"]
            world.publish(0, stamp_ns, JointState(name=names, position=[9.0, right, left], velocity=[9.0, *rates[::-1]]))
            if i % 10 == 0:  # others may publish joints there too, or forget the names
                world.publish(0, stamp_ns, JointState(name=["boom"], position=[9.0]))
                world.publish(0, stamp_ns + 5_000_000, JointState(position=[left, right]))
            for channel, value, rate in zip((0, 1), (left, right), rates, strict=True):
                expected += [float(row["total"]) for row in estimator.push(channel, stamp_ns, value, rate)[0]]
        world.wait(lambda: len(world.heard["torque"]) >= 100)
        np.testing.assert_allclose(column(world.heard["torque"], "wrench.torque.z"), expected, **EXACT)
        _, _, inputs = world.status("rejected")
        levels = [s.level for d in world.heard["diagnostics"] for s in d.status if s.name.endswith("rejected")]
        assert set(levels) == {b"\x00"}
        assert inputs["/joint_states without a wanted joint"] == "20"


def test_late_pressures_give_the_residual_later_in_stamp_order() -> None:
    vehicle = load(VEHICLE)
    samples = motion(vehicle, 1.0)
    angles = [sample for sample in samples if sample.channel < 2]
    rest = [sample for sample in samples if sample.channel >= 2]
    estimates, residuals = direct(Estimator(vehicle), [*angles, *rest])
    with LiveNode(*STOPPED), World(vehicle) as world:
        world.set_clock(T0)
        world.play(angles)
        world.wait(lambda: len(world.heard["torque"]) == len(estimates))
        assert not world.heard["residual"]
        world.play(rest)
        assert_topics_equal(world, estimates, residuals)


def test_one_joint_with_a_torque_sensor(tmp_path: Path) -> None:
    file = tmp_path / "joint.yaml"
    file.write_text(
        "schema: lugre_steering/vehicle/1\nname: single joint\nsides: [left]\n"
        "contact: {static_torque_Nm: 900.0, coulomb_torque_Nm: 700.0, stiffness_Nm_per_deg: 800.0, "
        "stribeck_speed_deg_s: 1.0}\n"
        "torque_sensor: {topic: steering/measured_torque}\n"
    )
    vehicle = load(file)
    samples = motion(vehicle, 1.0)
    estimates, residuals = direct(Estimator(vehicle), samples)
    assert len(residuals) > 90 - BEGUN
    with LiveNode(*STOPPED, vehicle=file), World(vehicle) as world:
        world.set_clock(T0)
        world.play(samples)
        assert_topics_equal(world, estimates, residuals)
        assert world.heard["estimate"][0].name == ["left_track_steer_joint"]
        assert not world.heard["rubber_temperature/left"]  # the vehicle has no rubber: nothing is invented


def recorded(folder: Path, vehicle: Vehicle, samples: Sequence[Sample]) -> Path:
    """The bag that a recorder would have made of these samples."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(folder, version=9) as writer:
        connections: dict[str, Any] = {}
        for sample in samples:
            topic, message = vehicle.channels[sample.channel].topic, message_of(vehicle, sample)
            if topic not in connections:
                kind = f"{type(message).__module__.split('.')[0]}/msg/{type(message).__name__}"
                connections[topic] = writer.add_connection(f"/{topic}", kind, typestore=store)
            writer.write(connections[topic], sample.stamp_ns, serialize_message(message))
    return folder


def replayed(bag: Path) -> dict[str, dict[int, Any]]:
    """Messages of each output of a replay, by stamp."""
    found: dict[str, dict[int, Any]] = defaultdict(dict)
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        wanted = [c for c in reader.connections if c.topic.startswith(NAME)]
        for connection, _, raw in reader.messages(wanted):
            message: Any = reader.deserialize(raw, connection.msgtype)
            found[connection.topic.removeprefix(f"{NAME}/")][to_ns(message.header.stamp)] = message
    return found


def test_one_angle_sensor_live_equals_replay(tmp_path: Path) -> None:
    """Of one track only the angle is measured; the node and replay each work out the other with their own code."""
    file = VEHICLE.with_name("one_angle_sensor_example.yaml")
    vehicle = load(file)
    assert [channel.topic for channel in vehicle.channels[:2]] == ["steering/right/joint_state"] * 2
    samples = [sample for sample in motion(vehicle, 4.0) if sample.channel != 0]  # the left one has no sensor
    replay([recorded(tmp_path / "run", vehicle, samples)], file, tmp_path / "out")
    expected = replayed(tmp_path / "out" / "run")
    assert len(expected["torque"]) == 400
    assert len(expected["residual"]) > 390 - BEGUN
    with LiveNode(*STOPPED, vehicle=file), World(vehicle) as world:
        world.set_clock(T0)
        world.play(samples, speed=2.0)
        world.wait(lambda: all(len(world.heard[topic]) >= len(messages) for topic, messages in expected.items()))
        for topic, field in (
            ("torque", "wrench.torque.z"), ("residual", "wrench.torque.z"), ("cylinder_torque", "wrench.torque.z"),
            ("estimate", "position"), ("estimate", "velocity"), ("estimate", "effort"),
        ):  # fmt: skip
            assert world.stamps(topic) == list(expected[topic])
            values = column(list(expected[topic].values()), field)
            np.testing.assert_allclose(column(world.heard[topic], field), values, **EXACT)
        left, right = column(world.heard["estimate"], "position").T
        axle = vehicle.axle
        assert axle is not None
        turned = np.abs(right) > 0.01
        cotangents = 1.0 / np.tan(right[turned]) - 1.0 / np.tan(left[turned])
        # Each angle is filtered for itself, so they obey the geometry nearly; a mirrored one would give the negative.
        np.testing.assert_allclose(cotangents, axle.kingpin_distance_m / axle.wheelbase_m, rtol=0.1)
        assert np.abs(column(world.heard["torque"], "wrench.torque.z")).max() > 1e4


def trajectory(joints: list[str], start_ns: int, points: list[tuple[float, list[float]]]) -> JointTrajectory:
    message = JointTrajectory(joint_names=joints)
    message.header.stamp = to_time(start_ns)
    for seconds, positions in points:
        duration = Duration(sec=int(seconds), nanosec=round((seconds % 1) * SECOND))
        message.points.append(JointTrajectoryPoint(positions=positions, time_from_start=duration))
    return message


def test_feed_forward_looks_ahead_along_the_commanded_trajectory() -> None:
    vehicle = load(VEHICLE)
    options = Options(feed_forward_horizon_s=0.3)
    joints = ["right_track_steer_joint", "left_track_steer_joint"]
    bad = [
        trajectory(joints[:1], T0, [(1.0, [0.1])]),
        trajectory(joints, T0, [(1.0, [0.1, 0.1]), (0.5, [0.2, 0.2])]),
        trajectory(joints, T0, [(1.0, [0.1, math.nan])]),
        trajectory(joints, T0, [(1.0, [0.1])]),
    ]
    early = trajectory(joints, 0, [(1.0, [0.1, 0.1])])  # from now on, when there is no now yet
    good = trajectory(joints, T0 + SECOND // 2, [(0.0, [0.0, 0.0]), (1.5, [0.2, 0.3])])
    estimator = Estimator(vehicle, options)
    still = [Sample(channel, T0 + i * 10_000_000, 0.0) for i in range(120) for channel in (0, 1)]
    estimates = direct(estimator, still[:50])[0]
    points_ns = [T0 + SECOND // 2, T0 + 2 * SECOND]
    estimator.set_plan(np.array(points_ns, np.int64), np.array([[0.0, 0.3], [0.0, 0.2]]))
    estimates += direct(estimator, still[50:100])[0]
    estimator.refuse_plan()
    estimates += direct(estimator, still[100:160])[0]
    with LiveNode(*STOPPED, "-p", "feed_forward_horizon_s:=0.3"), World(vehicle) as world:

        def refused() -> dict[str, int]:
            values = world.statuses("rejected")[-1].values
            return {key: int(n) for key, n in values.items() if key.startswith("steering/command")}

        world.set_clock(T0)
        world.command.publish(early)
        world.wait(lambda: len(refused()) == 1)
        world.play(still[:50])
        world.wait(lambda: len(world.heard["torque"]) == 25)
        world.command.publish(good)
        world.play(still[50:100])
        world.wait(lambda: len(world.heard["torque"]) == 50)
        for message in bad:  # one by one: a node that is given little time leaves out what comes at once
            before = len(refused())
            world.command.publish(message)
            world.wait(lambda before=before: len(refused()) > before)
        world.play(still[100:160])
        assert_topics_equal(world, estimates, [])
        effort = column(world.heard["feed_forward"], "effort")
        torque = column(world.heard["estimate"], "effort")
        # While the vehicle stands, its torque stays; the planned turn needs torque, in the direction of the turn.
        assert np.all(np.abs(effort[:25] - torque[:25]) < 1e-6)
        assert np.all(effort[35:50] > torque[35:50] + 1000.0)
        assert np.all(effort[75:] == 0.0)  # what was meant last could not be read
        assert to_ns(good.header.stamp) == points_ns[0]
        assert list(refused().values()) == [1] * 5
        world.wait(lambda: "feed-forward to zero: command refused" in world.statuses("outputs")[-1].message)
        world.command.publish(good)
        assert world.play(still[160:], until=lambda: world.heard["feed_forward"][-1].effort[0] > 1000.0)
