# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From accepted angle samples to the torque of both sides at one instant."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import inner
from lugre_steering.chain.doors import call_step, row
from lugre_steering.chain.lag import lag_weights
from lugre_steering.chain.layout import BASELINE, STATE
from lugre_steering.chain.rates import follow
from lugre_steering.estimator.admission import ACCEPTED, RUNNING, restart
from lugre_steering.estimator.doubt import (
    HEAT,
    LAW,
    LEAP_RATE_RAD_S,
    RANGE,
    TABLE,
    angle_doubts,
    begin_again,
    comes_back,
    depart,
    re_anchor,
    runs,
    standing_doubts,
    trust,
    watch,
    watch_leap,
)
from lugre_steering.estimator.layout import ANGLE_JUMP, OVERRUN, UNPAIRED
from lugre_steering.estimator.noise import lose_bristle, noise_of
from lugre_steering.estimator.preview import preview
from lugre_steering.estimator.rate import believed
from lugre_steering.estimator.release import release
from lugre_steering.estimator.unseen import begin_held, drive_bounds, end_silence

LONGEST_PERIOD_NS = 100_000_000  # of a sensor whose stamps may pair by half their period


@inner
def _pair(core):
    """Drop waiting samples that can get no partner; stamp of the pair now at the head of the sides' queues, or 0."""
    sides, ring = core.waiting.shape
    period_ns = LONGEST_PERIOD_NS
    for side in range(sides):
        if core.channels[side].period_ns > 0:
            period_ns = min(period_ns, core.channels[side].period_ns)
    tolerance_ns = max(core.config[0].pair_tolerance_ns, period_ns // 2)
    while True:
        latest = 0
        for side in range(sides):
            ch = core.channels[side]
            if ch.head == ch.cursor:
                return 0
            latest = max(latest, core.waiting[side, ch.cursor % ring].stamp_ns)
        paired = True
        for side in range(sides):
            ch = core.channels[side]
            if latest - core.waiting[side, ch.cursor % ring].stamp_ns > tolerance_ns:
                ch.cursor += 1
                ch.reasons[UNPAIRED] += 1
                paired = False
        if paired:
            return latest


@inner
def _complete(core, k, stamp_ns, e):
    """Write the estimate of the pair at the head of the sides' queues, and keep it until its pressures come."""
    c, ring = core.config[0], core.waiting.shape[1]
    e.stamp_ns = stamp_ns
    e.message = c.message
    e.total = 0.0
    e.doubts = standing_doubts(core, stamp_ns)
    for side in range(core.waiting.shape[0]):
        w = core.waiting[side, core.channels[side].cursor % ring]
        core.channels[side].cursor += 1
        e.theta[side] = w.theta
        e.omega[side] = w.omega
        e.torque[side] = w.torque
        e.temperature[side] = w.temperature
        e.feed_forward[side] = w.feed_forward
        e.doubts |= w.doubts
        e.total += w.torque
    release(core, e)
    if not math.isfinite(e.total):
        e.predicted = e.total
        restart(core, k)
        return
    if c.lagged_ns != 0:
        decay, present, last = lag_weights((stamp_ns - c.lagged_ns) * 1e-9, c.lag)
        c.lagged = decay * c.lagged + present * e.total + last * c.lag_input
    else:
        c.lagged = e.total
    c.lag_input = e.total
    c.lagged_ns = stamp_ns
    e.predicted = c.lagged
    if c.pending_count == core.pending.size:
        c.pending_first = (c.pending_first + 1) % core.pending.size
        c.pending_count -= 1
        core.channels[k].reasons[OVERRUN] += 1
    core.pending[(c.pending_first + c.pending_count) % core.pending.size] = e
    c.pending_count += 1


@inner
def _set_forth(c, g, ahead_ns):
    """How much of ``ahead_ns`` [ns] since the last sample is only that the clock was set back before, and is now right again."""
    back_ns = g.back_from_ns - g.back_to_ns
    if g.back_from_ns == 0 or ahead_ns <= c.forward_jump_ns or abs(ahead_ns - back_ns) >= c.backward_jump_ns:
        return 0
    g.back_from_ns = 0
    return min(back_ns, ahead_ns - 1)


@inner
def _elapsed(c, ch, g, state, stamp_ns):
    """Time [s] since the last sample of the side; the clock of a side without any begins with the first side's."""
    if c.start_ns == 0 or stamp_ns < c.start_ns:
        c.start_ns = stamp_ns
    if ch.last_ns == 0:
        if state.started == 0.0:
            state.time = max(0.0, (stamp_ns - c.start_ns) * 1e-9)
        return 0.0
    ch.period_ns = stamp_ns - ch.last_ns
    if g.back_from_ns != 0:
        ch.period_ns -= _set_forth(c, g, ch.period_ns)
    return ch.period_ns * 1e-9


@inner
def _seat(ch, ring):
    """Place among the waiting samples of the side for one more; the oldest makes room."""
    if ch.head - ch.cursor == ring:
        ch.reasons[UNPAIRED] += 1
        ch.cursor += 1
    ch.head += 1
    return (ch.head - 1) % ring


@inner
def _wait(waiting, stamp_ns, state, motion, output):
    """Keep what the side has come to until the other side has too."""
    waiting.stamp_ns = stamp_ns
    waiting.theta = state.theta
    waiting.omega = motion.omega
    waiting.torque = output.torque
    waiting.temperature = output.temperature


@inner
def _law_left(core, side):
    """Steps of a side so far with the coordinate of a law outside the range on which that was seen."""
    steps = 0.0
    for i in range(core.law_left.size):
        steps += core.state[side, core.law_left[i]]
    return steps


@inner
def _outside(c, state, motion, saturated, beyond):
    """Doubts about a side outside its rubber table (``saturated``: steps before), the range of a law (``beyond``: whether), or what its
    calibration has seen."""
    doubts = (TABLE if state.saturated > saturated else 0) | (LAW if beyond else 0)
    if abs(motion.theta) > c.seen_angle or abs(motion.omega) > c.seen_rate:
        doubts |= RANGE
    if not c.seen_coldest < state.temperature < c.seen_warmest:
        doubts |= HEAT
    return doubts


@inner
def advance(core, k, stamp_ns, value, rate, verdict, estimates, count):
    """One accepted angle sample: advance its side, and publish when the other side has the same stamp.

    ``verdict`` of its admission: a confirmed jump moves the angle but not the contact. (To hand the whole core on costs 0.1 us: steps
    get what they need of it.)
    """
    c, ch = core.config[0], core.channels[k]
    side = ch.index
    state, motion, output = row(core.state, side, STATE), core.motion[side], core.output[side]
    saturated, law_left = state.saturated, _law_left(core, side)
    g = core.guard[side]
    dt = _elapsed(c, ch, g, state, stamp_ns)
    if g.set_back and ch.last_ns == 0:
        begin_again(core, side, stamp_ns, value)
    jumps, running = verdict != ACCEPTED, verdict == RUNNING
    if jumps:
        ch.reasons[ANGLE_JUMP] += 1
    elif g.shadow_ns != 0:
        running = runs(core, side, dt, value - ch.last_value)
        jumps = running or comes_back(core, side, stamp_ns, value)
    if jumps:
        re_anchor(core, side, ch, stamp_ns, value, running)
    else:
        rates = core.trust[side]
        rate = believed(rates, ch, c, dt, value, rate)
        g.leap_ns = 0
        p = row(core.parameters, side, BASELINE)
        apart = abs(value - ch.last_value - motion.omega * dt)
        if c.accelerates and ch.head >= 2:
            depart(core, side, dt, apart)
        if apart > LEAP_RATE_RAD_S * p.angle_unit * dt:  # the call alone costs 0.1 us
            watch_leap(core, side, ch, dt, value)
        watch(core, side, ch, stamp_ns, dt, value)
        if dt * 1e9 > c.max_gap_ns:
            end_silence(core, side, ch, stamp_ns, value)
        before = motion.theta if motion.age != 0.0 else value
        follow(motion, dt, value, rate, noise_of(core, side), p.acceleration_unit, c.accelerates)
        if c.begin_ns != 0 and not g.begun and stamp_ns >= c.begin_ns:
            begin_held(core, side)
        rates.travel += abs(motion.theta - before)
        call_step(c.step_door, p, state, core.rubber, output, dt, motion.theta, motion.omega, motion.alpha, c.effects)
        trust(core, side, dt)
        lose_bristle(core, side, stamp_ns, value)
    if g.unseen_ns != 0:
        drive_bounds(core, side, dt)
    ch.last_ns = stamp_ns
    ch.last_value = value
    waiting = core.waiting[side, _seat(ch, core.waiting.shape[1])]
    _wait(waiting, stamp_ns, state, motion, output)
    waiting.doubts = angle_doubts(core, side, dt, stamp_ns) | _outside(c, state, motion, saturated, _law_left(core, side) > law_left)
    waiting.feed_forward = preview(core, side, stamp_ns)
    latest = _pair(core)
    if latest == 0:
        return count
    _complete(core, k, latest, estimates[count])
    return count + 1
