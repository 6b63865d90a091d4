# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Feed-forward: the torque needed one horizon ahead."""

from __future__ import annotations

import math

import numpy as np

from lugre_steering.chain.compiled import inner
from lugre_steering.chain.doors import call_step, copy_row, row
from lugre_steering.chain.layout import BASELINE, STATE

PREVIEW_STEPS = 20
BEND_NS = 50_000_000
"""Accelerations of a plan are means over so long to either side: the corners between its points have none."""


@inner
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


@inner
def departs(core, side, stamp_ns):
    """Whether the plan is farther from the present angle of a side than it may be, or than can be gone before it begins."""
    c = core.config[0]
    begin = core.plan_ns[0]
    at = core.plan_theta[side, 0] if stamp_ns < begin else _planned(core, side, stamp_ns)
    reach = c.plan_tolerance + c.max_rate * max(0.0, (begin - stamp_ns) * 1e-9)
    return abs(at - core.motion[side].theta) > reach


@inner
def _planned_acceleration(core, side, stamp_ns):
    """Of a side at a time [rad/s2]; 0 before the plan and where it ends."""
    at = _planned(core, side, stamp_ns)
    bend = _planned(core, side, stamp_ns + BEND_NS) - at - (at - _planned(core, side, stamp_ns - BEND_NS))
    return 0.0 if math.isnan(bend) else bend / (BEND_NS * 1e-9) ** 2


@inner
def preview(core, side, stamp_ns):
    """Torque [N m] that this side will need one horizon ahead: along the plan, or at the present rate without one.

    A plan that has run out says nothing about what is ahead, one far from the angle nothing about this vehicle: neither
    is used. The acceleration of a plan counts (inertia).
    """
    c, motion = core.config[0], core.motion[side]
    if c.horizon <= 0.0:
        return core.output[side].torque
    planning = c.plan_size > 0 and stamp_ns < core.plan_ns[c.plan_size - 1] and not departs(core, side, stamp_ns)
    alpha = 0.0
    copy_row(core.scratch_state, 0, core.state, side)
    p, state, out = row(core.parameters, side, BASELINE), row(core.scratch_state, 0, STATE), core.scratch_output[0]
    dt = c.horizon / PREVIEW_STEPS
    theta = motion.theta
    for i in range(1, PREVIEW_STEPS + 1):
        at_ns = stamp_ns + np.int64(i * dt * 1e9)
        planned = _planned(core, side, at_ns) if planning else math.nan
        if planning:
            alpha = _planned_acceleration(core, side, at_ns)
        target = theta + motion.omega * dt if math.isnan(planned) else planned
        omega = (target - theta) / dt
        call_step(c.step_door, p, state, core.rubber, out, dt, target, omega, alpha, c.effects)
        theta = target
    return out.torque
