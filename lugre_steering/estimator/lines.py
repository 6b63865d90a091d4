# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Which pressure lines can be believed: what jumps, has frozen, is below its sensor's range, or has been exchanged with another one.

A line that cannot be is told, by its name, and no residual is formed; the torque of the angles needs none.
"""

from __future__ import annotations

from lugre_steering.chain.compiled import inner
from lugre_steering.chain.doors import call_number, row
from lugre_steering.chain.hydraulics import moment_arm
from lugre_steering.chain.layout import BASELINE
from lugre_steering.estimator.doubt import (
    BROKEN,
    EXCHANGED,
    INPUTS,
    LINE,
    STILL_NS,
    STILL_SAMPLES,
    SUDDEN_SHARE,
    SUPPORT_SHARE,
)
from lugre_steering.recording import Kind

STEP_SHARE, ACROSS_S = 0.1, 0.1
"""From one reading to the next a pressure changes by less than this share of the sensor's range, and what lets it go through all of
the range in that time."""
BELOW_SHARE, AIR_PA = 0.025, 1.01325e5
"""No gauge pressure is below a vacuum; and a sound 4-20 mA sensor shows no less than 3.6 mA (NAMUR NE 43)."""
JUMPED_NS = 200_000_000
"""After a jump so long no residual is formed: by then what has frozen there, or was exchanged, is known."""
REPEATING, REPEATS_MEMORY = 0.1, 50.0
"""Of a line whose samples have repeated less often than this, over so many of them, a standstill is no measurement."""
LIVED = 50
"""Only a line that has changed so often is known to live: one that never did may have no noise to be seen, and is shown as it is."""
AGREED_S = 1.0
"""Only lines that have explained the torque for so long, while there was one to be explained, can have been exchanged since."""
LONGEST_S = 0.1
"""No more of a gap between residuals counts."""
IN_A_ROW = 5
"""So many residuals in a row must speak for an exchange, or for its end."""


@inner
def line_step(c, time_ns):
    """Largest change [Pa] of a line's reading within a time that is no jump."""
    return c.pressure_range * (STEP_SHARE + time_ns * 1e-9 / ACROSS_S)


@inner
def below_range(c, value):
    """Whether a reading [Pa] is below what a sound sensor can show."""
    return value - c.gauge_offset < -BELOW_SHARE * c.pressure_range - AIR_PA


@inner
def distrust(ch, from_ns, until_ns):
    """Between these stamps the line is not to be believed."""
    if from_ns > ch.wrong_until_ns:
        ch.wrong_from_ns = from_ns
    ch.wrong_until_ns = max(ch.wrong_until_ns, until_ns)


@inner
def watch_line(ch, stamp_ns, value):
    """Learn from the next reading of a line how often its readings repeat, and whether it stands still now."""
    same = ch.last_ns != 0 and value == ch.last_value
    if not same:
        if ch.frozen and ch.lived >= LIVED:
            distrust(ch, ch.still_ns, stamp_ns)
        ch.still, ch.still_ns, ch.lived = 0, stamp_ns, ch.lived + 1
    else:
        ch.still += 1
    if ch.still < STILL_SAMPLES:  # a frozen line teaches nothing about a sound one
        ch.repeats += ((1.0 if same else 0.0) - ch.repeats) / REPEATS_MEMORY
    ch.frozen = ch.repeats < REPEATING and ch.still >= STILL_SAMPLES and stamp_ns - ch.still_ns >= STILL_NS
    ch.last_value = value


@inner
def believed_at(core, at_ns):
    """Whether every line can be believed at a stamp."""
    for i in range(core.motion.size, core.channels.size):
        ch = core.channels[i]
        frozen = ch.frozen and ch.lived >= LIVED and at_ns > ch.still_ns
        if ch.kind == Kind.PRESSURE and (frozen or ch.wrong_from_ns < at_ns < ch.wrong_until_ns):
            return False
    return True


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
def _exchange(core, e, value):
    """The pair of lines that, exchanged, explain the estimate, as 1 + first * lines + second; 0: none does."""
    lines, found = value.size, 0
    best = SUPPORT_SHARE * abs(e.predicted)
    for i in range(lines):
        for j in range(i + 1, lines):
            value[i], value[j] = value[j], value[i]
            off = abs(measured_torque(core, e, value) - e.predicted)
            value[i], value[j] = value[j], value[i]
            if off < best:
                best, found = off, 1 + i * lines + j
    return found


@inner
def look_for_exchange(core, e, at_ns, value, measured):
    """Learn from the next residual whether two lines have been exchanged, or are as they were again.

    Of angles in doubt, and while there is hardly a torque, nothing follows.
    """
    c = core.config[0]
    dt = min(LONGEST_S, (at_ns - c.explained_ns) * 1e-9) if c.explained_ns != 0 else 0.0
    c.explained_ns = at_ns
    if core.lines.shape[0] == 0 or abs(e.predicted) < SUDDEN_SHARE * c.friction or e.doubts & INPUTS & ~(LINE | EXCHANGED | BROKEN) != 0:
        return
    explained = abs(measured - e.predicted) < SUPPORT_SHARE * abs(e.predicted)
    pair = 0
    if explained:
        c.explained = min(AGREED_S, c.explained + max(0.0, dt))
    elif c.explained >= AGREED_S:
        pair = _exchange(core, e, value)
    decided = explained or pair != 0
    c.exchange_count = c.exchange_count + 1 if decided and pair == c.exchange_seen else (1 if decided else 0)
    c.exchange_seen = pair
    if decided and c.exchange_count >= IN_A_ROW:
        c.exchanged = pair
