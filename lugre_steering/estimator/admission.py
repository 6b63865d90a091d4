# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Which samples are accepted, and what a jump in time means."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import inner
from lugre_steering.chain.doors import copy_row, row
from lugre_steering.chain.layout import STATE
from lugre_steering.estimator.doubt import leapt, reachable, runs, strays
from lugre_steering.estimator.layout import (
    ABSURD,
    BACKWARD,
    BELOW,
    DUPLICATE,
    GAP,
    JUMP,
    NOT_FINITE,
    OVERRUN,
    RESTART,
    SPIKE,
    ZERO,
)
from lugre_steering.estimator.lines import JUMPED_NS, STEP_SHARE, below_range, distrust, line_step
from lugre_steering.recording import Kind

HOTTEST_AIR_DEGC = 75.0
"""No air about a vehicle is warmer, or colder the other way; the one in a compartment is not what the tracks meet."""
CONFIRM_NS = 1_000_000_000  # a sample this soon after a suspect one can confirm it
LEAD_NS, LEAD_PERIODS = 500_000_000, 10
"""A sample so far ahead of the last one, and so many periods of its channel, has to be confirmed: its stamp may be astray, and those that
follow would all lie before it."""
BACK_NS = 500_000_000
"""Samples from the past for so long, in a row: the clock was set back. A sensor that catches up sends fewer."""


REJECTED, ACCEPTED, JUMPED, RUNNING = range(4)
"""What ``admit`` says of a sample; of an angle that jumps also if it goes on from there as no joint does."""
_GOES_ON = -1
"""Nothing decides about the sample yet."""
_SOUND = -1
"""No reason to reject it."""


@inner
def _clear(ch):
    """Forget the samples of one channel, not its counters."""
    ch.last_ns = 0
    ch.suspect_ns = 0
    ch.period_ns = 0
    ch.head = 0
    ch.cursor = 0
    ch.wrong_from_ns = ch.wrong_until_ns = 0
    ch.back_ns = ch.back_last_ns = 0
    ch.below = False


@inner
def _begin_side(core, side):
    """Forget what one side has been through, but for the count of its steps outside the rubber table."""
    state = row(core.state, side, STATE)
    saturated = state.saturated
    for i in range(core.state.shape[1]):
        core.state[side, i] = 0.0
    nothing = core.nothing[0]
    core.motion[side], core.trust[side], core.guard[side] = nothing.motion, nothing.trust, nothing.guard
    state.saturated = saturated
    _clear(core.channels[side])


@inner
def _keep_earlier(core, side, stamp_ns):
    """The time of a side jumps forward to a stamp: keep what it was before, in case that this was no time."""
    g = core.guard[side]
    copy_row(core.earlier, side, core.state, side)
    g.jumped_ns, g.jumped_to_ns = core.channels[side].last_ns, stamp_ns


@inner
def _comes_back(core, side, stamp_ns):
    """Whether the time is again what it would be had it not jumped forward."""
    c, g = core.config[0], core.guard[side]
    return g.jumped_ns != 0 and abs(stamp_ns - g.jumped_ns - (core.channels[side].last_ns - g.jumped_to_ns)) < c.backward_jump_ns


@inner
def _set_side_back(core, side, stamp_ns):
    """Forget the samples of one side. What it has been through stays, in doubt that which is trusted, but for the bristle; of a time that
    was none only what was before it."""
    state, g, nothing = row(core.state, side, STATE), core.guard[side], core.nothing[0]
    saturated = state.saturated
    if _comes_back(core, side, stamp_ns):
        copy_row(core.state, side, core.earlier, side)
    elif g.shadow_ns != 0:
        copy_row(core.state, side, core.shadow, side)
    state.saturated = saturated
    fastest = g.fastest
    core.motion[side], core.trust[side], core.guard[side] = nothing.motion, nothing.trust, nothing.guard
    g.fastest, g.set_back = fastest, state.started != 0.0
    g.back_from_ns, g.back_to_ns = core.channels[side].last_ns, stamp_ns


@inner
def _forget_samples(core, k):
    """Forget all samples, except their counters; counted for channel ``k``, like the torques that still lack pressures."""
    for i in range(core.channels.size):
        _clear(core.channels[i])
    c = core.config[0]
    core.channels[k].reasons[RESTART] += 1
    core.channels[k].reasons[OVERRUN] += c.pending_count
    c.start_ns = 0
    c.start_known = False
    c.start_residual_ns = c.begin_ns = 0
    c.lagged_ns = 0
    c.pending_count = 0
    c.plan_size = 0
    c.plan_refused_ns = 0
    c.residual_ns = 0
    c.agreed_ns = 0
    c.explained_ns = 0
    c.explained = 0.0
    c.exchange_seen = c.exchange_count = c.exchanged = 0


@inner
def restart(core, k):
    """Forget the past, as a torque of channel ``k`` is no finite number."""
    for side in range(core.motion.size):  # slice assignment would compile for ten seconds more
        _begin_side(core, side)
    _forget_samples(core, k)


@inner
def _set_back(core, k, stamp_ns):
    """Begin anew with the time of channel ``k``."""
    for side in range(core.motion.size):
        _set_side_back(core, side, stamp_ns)
    _forget_samples(core, k)


_DOUBTED, _SHARED, _THERE = range(3)


@inner
def _other_side(core, k, stamp_ns):
    """What the other side says to a jump of angle channel ``k``: it is not there, it jumps as well, or it is there.

    A side without any sample yet (or without another) agrees.
    """
    near_ns = min(CONFIRM_NS, core.config[0].backward_jump_ns // 2)
    for side in range(core.motion.size):
        other = core.channels[side]
        if side == k or other.last_ns == 0:
            continue
        if abs(stamp_ns - other.last_ns) < near_ns:
            return _THERE
        if other.suspect_ns == 0 or abs(stamp_ns - other.suspect_ns) >= near_ns:
            return _DOUBTED
    return _SHARED


@inner
def _absurd(c, kind, value):
    """Whether no such sensor can show this value."""
    if kind == Kind.ANGLE:
        return abs(value) > c.max_angle
    if kind == Kind.PRESSURE:
        return abs(value) > c.max_pressure
    return abs(value) > (HOTTEST_AIR_DEGC if kind == Kind.AIR_TEMPERATURE else 1e12)


@inner
def _unusable(c, ch, stamp_ns, value):
    """Why the sample can be used under no circumstances, or ``_SOUND``."""
    if stamp_ns <= 0:
        return ZERO
    if not math.isfinite(value):
        return NOT_FINITE
    if _absurd(c, ch.kind, value):
        return ABSURD
    if ch.last_ns == 0:
        return _SOUND
    ahead = stamp_ns - ch.last_ns
    if ahead == 0:
        return DUPLICATE
    return BACKWARD if -c.backward_jump_ns < ahead < 0 else _SOUND


@inner
def _suspect(ch, reason, stamp_ns, value):
    """Refuse the sample, until one soon after it agrees with it."""
    ch.reasons[reason] += 1
    ch.suspect_ns = stamp_ns
    ch.suspect_value = value
    return REJECTED


@inner
def _farthest_ahead(c, ch):
    """How far [ns] ahead of the last one the stamp of a sample is believed at once."""
    if ch.period_ns == 0:
        return c.forward_jump_ns
    return min(c.forward_jump_ns, max(LEAD_NS, LEAD_PERIODS * ch.period_ns))


@inner
def _all_from_the_past(core, k, stamp_ns):
    """Whether a sample from the past of angle channel ``k`` is one of so many in a row that the clock was set back: if there is another
    side, it says so too."""
    ch = core.channels[k]
    follows = ch.back_ns != 0 and 0 < stamp_ns - ch.back_last_ns < CONFIRM_NS
    ch.back_ns, ch.back_last_ns = ch.back_ns if follows else stamp_ns, stamp_ns
    if ch.kind != Kind.ANGLE or stamp_ns - ch.back_ns < BACK_NS:
        return False
    for side in range(core.motion.size):
        other = core.channels[side]
        if other.last_ns != 0 and (other.back_ns == 0 or abs(stamp_ns - other.back_last_ns) >= CONFIRM_NS):
            return False
    return True


@inner
def _jump_in_time(core, k, stamp_ns, value, follows_suspect):
    """What a stamp far from the last one means: refused, a new beginning, or ``_GOES_ON``."""
    c, ch = core.config[0], core.channels[k]
    far = stamp_ns < ch.last_ns or stamp_ns - ch.last_ns > c.forward_jump_ns
    other_side = _other_side(core, k, stamp_ns) if far and ch.kind == Kind.ANGLE else _THERE
    if not follows_suspect or other_side == _DOUBTED:
        return _suspect(ch, JUMP, stamp_ns, value)
    if stamp_ns > ch.last_ns:
        if ch.kind == Kind.ANGLE:
            _keep_earlier(core, ch.index, stamp_ns)
        return _GOES_ON
    if other_side == _SHARED:
        _set_back(core, k, stamp_ns)
        return ACCEPTED
    if ch.kind != Kind.ANGLE:
        _clear(ch)
        return ACCEPTED
    # This side alone had strayed ahead: it goes on from the sample before, which the stray one made suspect.
    ch.last_ns = ch.suspect_ns
    ch.cursor = ch.head
    return _GOES_ON


@inner
def _reach(c, time_ns):
    """How far [rad] the reading of a joint can change in a time."""
    return c.max_rate * time_ns * 1e-9 + 10.0 * c.angle_noise


@inner
def _goes_with_suspect(core, ch, stamp_ns, value):
    """Whether an angle that follows a suspect one goes on from that, rather than from the last accepted one.

    The time of the suspect allows the joint no more way: else a jump could pass as motion at its second sample.
    """
    c, change = core.config[0], value - ch.last_value
    since_ns, suspect_since_ns = stamp_ns - ch.last_ns, stamp_ns - ch.suspect_ns
    lead_ns = ch.suspect_ns - ch.last_ns
    if lead_ns <= 0 or abs(ch.suspect_value - ch.last_value) <= _reach(c, lead_ns):
        return False  # suspect for its stamp alone
    omega = core.motion[ch.index].omega
    from_suspect = abs(value - ch.suspect_value - omega * suspect_since_ns * 1e-9)
    if from_suspect < abs(change - omega * since_ns * 1e-9):
        return True
    return abs(change) > _reach(c, suspect_since_ns) and not reachable(core, ch.index, ch.last_ns, stamp_ns, change)


@inner
def _jump_of_angle(core, ch, stamp_ns, value, follows_suspect):
    """What an angle means that the joint cannot have reached: refused, a new beginning, a confirmed jump; else ``_GOES_ON``."""
    c = core.config[0]
    reach = _reach(c, stamp_ns - ch.last_ns)
    change = value - ch.last_value
    # After absurd readings the next ones are no better than they: the angle is believed where it can have gone.
    strayed = core.guard[ch.index].absurd and not reachable(core, ch.index, ch.last_ns, stamp_ns, change)
    strayed = strayed or (follows_suspect and _goes_with_suspect(core, ch, stamp_ns, value))
    if not strayed and abs(change) <= reach:
        return JUMPED if leapt(core, ch.index, ch, stamp_ns, value) else _GOES_ON
    near = follows_suspect and abs(value - ch.suspect_value) <= c.max_rate * (stamp_ns - ch.suspect_ns) * 1e-9 + reach
    if not near:
        return _suspect(ch, SPIKE, stamp_ns, value)
    if ch.head == 1:  # two agree against the first one
        _begin_side(core, ch.index)
        return ACCEPTED
    seconds = (stamp_ns - ch.suspect_ns) * 1e-9
    ch.suspect_ns = 0
    return RUNNING if runs(core, ch.index, seconds, value - ch.suspect_value) else JUMPED


@inner
def _jump_of_line(c, ch, stamp_ns, value, follows_suspect):
    """What a pressure means that the line cannot have come to: refused, until the next one agrees; below its range always.

    A line that comes there without a jump shows a difference of pressures.
    """
    below = below_range(c, value)
    if below and not ch.goes_below and (ch.suspect_ns != 0 or abs(value - ch.last_value) > STEP_SHARE * c.pressure_range):
        ch.below = True
        return _suspect(ch, BELOW, stamp_ns, value)
    ch.goes_below = below
    ch.below = False
    if stamp_ns - ch.last_ns > c.max_gap_ns:
        return _GOES_ON
    lead_ns, change = ch.suspect_ns - ch.last_ns, abs(value - ch.last_value)
    jumped = follows_suspect and lead_ns > 0 and abs(ch.suspect_value - ch.last_value) > line_step(c, lead_ns)
    if jumped and abs(value - ch.suspect_value) < change:
        distrust(ch, ch.last_ns, stamp_ns + JUMPED_NS)
    elif change > line_step(c, stamp_ns - ch.last_ns):
        return _suspect(ch, SPIKE, stamp_ns, value)
    return _GOES_ON


@inner
def admit(core, k, stamp_ns, value):
    """Whether channel ``k`` accepts the sample, and whether its angle jumps; counts the reason if not."""
    c, ch = core.config[0], core.channels[k]
    reason = _unusable(c, ch, stamp_ns, value)
    if reason != _SOUND:
        ch.reasons[reason] += 1
        if reason == BACKWARD and _all_from_the_past(core, k, stamp_ns):
            _set_back(core, k, stamp_ns)
            return ACCEPTED
        if reason == ABSURD and ch.kind == Kind.ANGLE:
            core.guard[ch.index].calm = 0.0
            core.guard[ch.index].absurd = True
        return REJECTED
    if ch.last_ns == 0 or ch.kind == Kind.AIR_TEMPERATURE:
        ch.goes_below = ch.kind == Kind.PRESSURE and below_range(c, value)
        return ACCEPTED  # air may come as rarely as it likes, and no sample of it is needed at any instant
    verdict = _GOES_ON
    ch.back_ns = 0
    follows_suspect = ch.suspect_ns != 0 and 0 < stamp_ns - ch.suspect_ns < CONFIRM_NS
    ahead = stamp_ns - ch.last_ns
    if ahead < 0 or ahead > _farthest_ahead(c, ch):
        verdict = _jump_in_time(core, k, stamp_ns, value, follows_suspect)
    # Only what may be a jump is worth the call: to hand over the whole core costs 0.1 us.
    if verdict == _GOES_ON and ch.kind == Kind.ANGLE and (
        follows_suspect or core.guard[ch.index].absurd or core.guard[ch.index].leap_ns != 0 or abs(value - ch.last_value) > _reach(c, ahead)
    ):
        verdict = _jump_of_angle(core, ch, stamp_ns, value, follows_suspect)
    # What an inertia makes of a stray angle is beyond any torque; a joint that has indeed set off loses one sample.
    waits = verdict == _GOES_ON and ch.kind == Kind.ANGLE and c.accelerates and ch.suspect_ns == 0
    if waits and strays(core, ch.index, ch, ahead * 1e-9, value):
        return _suspect(ch, SPIKE, stamp_ns, value)
    if verdict == _GOES_ON and ch.kind == Kind.PRESSURE:
        verdict = _jump_of_line(c, ch, stamp_ns, value, follows_suspect)
    if verdict != _GOES_ON:
        return verdict
    if stamp_ns - ch.last_ns > c.max_gap_ns:
        ch.reasons[GAP] += 1
    ch.suspect_ns = 0
    return ACCEPTED
