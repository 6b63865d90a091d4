# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From accepted line samples to the cylinder torque, and its difference from the estimate."""

from __future__ import annotations

from lugre_steering.chain.compiled import inner
from lugre_steering.chain.doors import call_number, row
from lugre_steering.chain.layout import LINE
from lugre_steering.estimator.doubt import weigh_pressures, weigh_residual
from lugre_steering.estimator.lines import believed_at, look_for_exchange, measured_torque
from lugre_steering.estimator.unseen import before_start, learn_start


@inner
def form_residuals(core, first_line, residuals, count):
    """Form every residual whose pressures have all come and can be believed, in stamp order."""
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
        measured, believed = measured_torque(core, e, value), believed_at(core, at_ns)
        look_for_exchange(core, e, at_ns, value, measured)
        if not c.start_known:
            if believed and c.exchanged == 0:
                learn_start(core, e, measured - e.predicted)
            else:
                c.start_residual_ns = 0
        if before_start(c, e.stamp_ns):
            continue
        # As well of a line that has jumped: that the torque is not what it should be is told, though not shown.
        weigh_residual(c, e.stamp_ns, measured, measured - e.predicted)
        if not believed or c.exchanged != 0:
            c.agreed_ns = 0
            continue
        weigh_pressures(core, e.stamp_ns, measured)
        r = residuals[count]
        r.stamp_ns = e.stamp_ns
        r.measured_torque = measured
        r.residual = measured - e.predicted
        r.message = c.message
        count += 1
    return count
