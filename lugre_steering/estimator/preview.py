# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Feed-forward: the torque needed one horizon ahead."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lugre_steering.chain.step import step

PREVIEW_STEPS = 20


@njit
def _planned(core, side, stamp_ns):
    """Planned angle of a side at a time, linear between points, held at the last; NaN before or without a plan."""
    n = core.config[0].plan_size
    if n == 0 or stamp_ns < core.plan_ns[0]:
        return math.nan
    if stamp_ns >= core.plan_ns[n - 1]:
        return core.plan_theta[side, n - 1]
    i = 1
    while core.plan_ns[i] < stamp_ns:
        i += 1
    weight = (stamp_ns - core.plan_ns[i - 1]) / (core.plan_ns[i] - core.plan_ns[i - 1])
    return core.plan_theta[side, i - 1] + weight * (core.plan_theta[side, i] - core.plan_theta[side, i - 1])


@njit
def preview(core, side, stamp_ns):
    """Torque [N m] that this side will need one horizon ahead: along the plan, or at the present rate without one.

    A plan that has run out says nothing about what is ahead, and is not used any more. Accelerations of a plan are not
    foreseen: yaw_inertia adds nothing ahead.
    """
    c, motion = core.config[0], core.motion[side]
    if c.horizon <= 0.0:
        return core.output[side].torque
    planning = c.plan_size > 0 and stamp_ns < core.plan_ns[c.plan_size - 1]
    core.scratch_state[0] = core.state[side]
    dt = c.horizon / PREVIEW_STEPS
    theta = motion.theta
    for i in range(1, PREVIEW_STEPS + 1):
        planned = _planned(core, side, stamp_ns + np.int64(i * dt * 1e9)) if planning else math.nan
        target = theta + motion.omega * dt if math.isnan(planned) else planned
        omega = (target - theta) / dt
        step(
            core.parameters[side],
            core.scratch_state[0],
            core.rubber,
            core.scratch_output[0],
            dt,
            target,
            omega,
            0.0,
            c.effects,
        )
        theta = target
    return core.scratch_output[0].torque
