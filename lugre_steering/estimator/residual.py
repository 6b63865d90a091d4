# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From accepted line samples to the cylinder torque, and its difference from the estimate."""

from __future__ import annotations

from lugre_steering.chain.compiled import inner
from lugre_steering.chain.doors import call_number, row
from lugre_steering.chain.hydraulics import moment_arm
from lugre_steering.chain.layout import BASELINE, LINE
from lugre_steering.estimator.doubt import weigh_pressures, weigh_residual


@inner
def measured_torque(core, e, value):
    """Torque [N m] on the steering axis from the interpolated line values (or the torque sensor as it is)."""
    c = core.config[0]
    if core.lines.shape[0] == 0:
        return value[0]
    torque = 0.0
    for i in range(core.lines.shape[0]):
        side = int(core.geometry[i, 0])
        theta = e.theta[side]
        force = 0.0
        if core.lines[i, 0] >= 0:
            force += value[core.lines[i, 0]] * core.areas[i, 0]
        if core.lines[i, 1] >= 0:
            force -= value[core.lines[i, 1]] * core.areas[i, 1]
        arm = moment_arm(theta, core.geometry[i, 1], core.geometry[i, 2], core.geometry[i, 3], core.geometry[i, 4])
        torque += force * arm * call_number(c.arm_door, row(core.parameters, side, BASELINE), theta)
    return torque * c.pressure_gain


@inner
def form_residuals(core, first_line, residuals, count):
    """Form every residual whose pressures have all come, in stamp order."""
    c = core.config[0]
    lines = core.line_ns.shape[0]
    value = core.scratch_value
    while c.pending_count > 0:
        e = core.pending[c.pending_first]
        at_ns = e.stamp_ns + c.delay_ns
        for line in range(lines):
            ch = core.channels[first_line + line]
            if ch.head == 0 or ch.last_ns < at_ns:
                return count
        usable = True
        for line in range(lines):
            ch = core.channels[first_line + line]
            ring = core.line_ns.shape[1]
            cursor = max(ch.cursor, ch.head - ring)
            while cursor < ch.head and core.line_ns[line, cursor % ring] < at_ns:
                cursor += 1
            ch.cursor = cursor
            after_ns = core.line_ns[line, cursor % ring]
            after = core.line_value[line, cursor % ring]
            if after_ns == at_ns:
                p = after
            elif cursor == max(0, ch.head - ring) or after_ns - core.line_ns[line, (cursor - 1) % ring] > c.max_gap_ns:
                usable = False
                break
            else:
                before_ns = core.line_ns[line, (cursor - 1) % ring]
                before = core.line_value[line, (cursor - 1) % ring]
                p = before + (after - before) * ((at_ns - before_ns) / (after_ns - before_ns))
            elapsed = (at_ns - c.start_ns) * 1e-9
            value[line] = p - c.gauge_offset - call_number(c.line_door, row(core.line_parameters, line, LINE), elapsed)
        c.pending_first = (c.pending_first + 1) % core.pending.size
        c.pending_count -= 1
        if not usable:
            continue
        r = residuals[count]
        r.stamp_ns = e.stamp_ns
        r.measured_torque = measured_torque(core, e, value)
        r.residual = r.measured_torque - e.predicted
        r.message = c.message
        weigh_pressures(core, e.stamp_ns, r.measured_torque)
        weigh_residual(c, e.stamp_ns, r.measured_torque, r.residual)
        count += 1
    return count
