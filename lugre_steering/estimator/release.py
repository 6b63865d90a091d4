# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The feed-forward that leaves: inside limits of value and rate, and led to zero while anything speaks against it."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import inner

LONGEST_S = 0.05


@inner
def release(core, e):
    """Replace the wanted feed-forward of an estimate by what may be acted upon.

    Its weight falls to zero over the withdrawal ramp while there are doubts, and rises to one over the recovery ramp when
    there are none. A stamp that is not after the last one leaves no time for a change, and silence no more than ``LONGEST_S``.
    The first one leaves none either: before it others know of no torque, and after a restart the bristle may hold much.
    """
    c = core.config[0]
    first = c.released_ns == 0
    dt = 0.0 if first else min(LONGEST_S, max(0.0, (e.stamp_ns - c.released_ns) * 1e-9))
    c.released_ns = e.stamp_ns
    if not first:
        ramp = c.withdrawal_ramp if e.doubts != 0 else c.recovery_ramp
        change = dt / ramp if ramp > 0.0 else 1.0
        c.weight = max(0.0, c.weight - change) if e.doubts != 0 else min(1.0, c.weight + change)
    elif e.doubts != 0:
        c.weight = 0.0
    for side in range(core.motion.size):
        wanted = c.weight * e.feed_forward[side]
        if math.isfinite(wanted):  # of NaN, limits would make the largest torque that they allow
            wanted = max(-c.limit, min(c.limit, wanted))
            reach, last = c.rate_limit * dt, core.released[side]
            wanted = max(last - reach, min(last + reach, wanted))
            core.released[side] = wanted
        e.feed_forward[side] = wanted
