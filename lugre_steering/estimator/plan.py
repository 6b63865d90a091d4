# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The feed-forward preview: a commanded trajectory as absolute times and angles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lugre_steering.errors import DataError
from lugre_steering.estimator.estimator import PLAN_POINTS
from lugre_steering.recording import Array, IntArray

if TYPE_CHECKING:  # replay reads the same messages without ROS
    from builtin_interfaces.msg import Duration, Time
    from trajectory_msgs.msg import JointTrajectory

PLAN_BYTES = 512 * PLAN_POINTS
"""Of a trajectory of as many points, with velocities, accelerations and efforts of 15 joints; a longer one is not even read."""

BEGIN_S = 60
"""A plan that begins later is on another clock, or nobody knows yet what comes before it."""
SECOND_NS = 1_000_000_000


def _ns(time: Time | Duration) -> int:
    """``DataError`` for nanoseconds of a second or more: it is no time."""
    if time.nanosec >= SECOND_NS:
        raise DataError("a time with nanoseconds of a second or more")
    return int(time.sec * SECOND_NS + time.nanosec)


def planned_angles(message: JointTrajectory, joints: Sequence[str], latest_ns: int) -> tuple[IntArray, Array]:
    """Times (n,) [ns] and angles (joints, n) [rad] of a trajectory; ``DataError`` says why a message is none. The estimator looks at
    the numbers.

    A zero header stamp means "from now on" (as ros2_control reads it): from ``latest_ns``, the newest angle's stamp (0:
    none has come, and there is no now).
    """
    doubled = sorted({joint for joint in message.joint_names if message.joint_names.count(joint) > 1})
    if doubled:
        raise DataError(f"joint {', '.join(doubled)} named more than once")
    missing = [joint for joint in joints if joint not in message.joint_names]
    if missing:
        raise DataError(f"no joint {', '.join(missing)} in it")
    if len(message.points) > PLAN_POINTS:
        raise DataError(f"more than {PLAN_POINTS} points")
    start_ns = _ns(message.header.stamp) or latest_ns
    if not start_ns:
        raise DataError("no stamp, and no angle before it to count from")
    columns = [message.joint_names.index(joint) for joint in joints]
    times, angles = [], []
    for point in message.points:
        if len(point.positions) != len(message.joint_names):
            raise DataError("a point without a position for each joint")
        times.append(start_ns + _ns(point.time_from_start))
        angles.append([point.positions[column] for column in columns])
    if times and latest_ns and times[0] - latest_ns > BEGIN_S * SECOND_NS:
        raise DataError(f"begins more than {BEGIN_S} s ahead")
    return np.array(times, np.int64), np.array(angles, np.float64).reshape(len(times), len(joints)).T
