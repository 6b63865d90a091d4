# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What speaks against the angles: jumps, an encoder that has frozen, noise beyond the sheet; and the trusted state kept meanwhile.

A confirmed jump of an angle re-anchors its side: the model goes on with the bristle as it was, and nothing is slid or
heated by the jump. The state before the first jump is kept as a shadow, to which every further jump goes back: what came
between was not true. If the angle is now where the joint can have got to since, at the rates that it has shown before, the
side goes there in a straight line over the time that passed. What no jump takes back within ``TRUSTED_S`` is believed; sooner where the
measured torque speaks for it.

A step that the joint could make is a jump as well (a leap) if neither the readings before it nor the one after it move like
that. It is believed, in doubt, until that one has come.
"""

from __future__ import annotations

import math

import numpy as np

from lugre_steering.chain.baseline import most_friction
from lugre_steering.chain.compiled import inner
from lugre_steering.chain.doors import call_step, copy_row, row
from lugre_steering.chain.layout import BASELINE, STATE
from lugre_steering.chain.rates import stand
from lugre_steering.estimator.noise import learn_noise, noisy
from lugre_steering.estimator.preview import departs
from lugre_steering.estimator.unseen import AGREED_SHARE, FASTER, UNSEEN_SIGMA, farthest, lose_sight, part
from lugre_steering.online import LARGE_SHARE, NOTABLE_SHARE
from lugre_steering.recording import Kind

TRUSTED_S = 10.0
SUPPORTED_S, SUPPORT_SHARE, SUPPORT_LEVEL = 0.3, 0.25, 0.5
"""A jump is believed as soon as this, where the measured torque stays within such a share of the estimate and both are at least such a
share of the static friction."""
SETTLED_S = 0.2
"""For so long after a return the angle stays in doubt."""
FASTEST_MEMORY_S = 0.1
LEAP_SHARE = 0.1
"""A step of less than this share of the bristle's length costs less than that share of the friction."""
LEAP_SIGMA = 10.0
LEAP_RATE_RAD_S = 1.0
"""No joint needs a sample to come to such a rate, or to leave it."""
STRAY_TIMES, DEPARTED_MEMORY_S, STRAY_AFTER_S = 3.0, 10.0, 0.2
"""Times as far as any reading of late departs one from the motion that is held back until the next; time for which late is, and after
which the motion is known well enough to say so."""
STANDING_SIGMA = 5.0
"""A reading this many times its noise from where it stood has moved: chance alone does that once in 200 000 samples."""
STILL_NS = 100_000_000
STILL_SAMPLES = 5
SETTLED_SAMPLES = 20
"""A reading that stands since so many samples goes by less than a quarter of its noise from one to the next."""
JITTERY, JITTER_SAMPLES = 0.58, 200
"""Of white noise two changes of three go back on the one before; where more than this share did, over so many samples of a reading that
stands, its noise is to be seen."""
REPEATED = 10
"""Such an encoder has steps of less than a third of its noise, and one sample of eleven repeats: ten in a row do once in many years."""
UNSEEN_STEPS = 3.0
"""Motion of so many of an encoder's steps must change its reading, though the sides do not go equally far."""
CREEP_MEMORY_S = 1.0
"""Motion of the other side that comes slower than this does not speak against an angle that stands but for its noise."""
SWING_SHARE = 0.1
"""Torque up to this share of the static friction may come or go while angles stand, seen by their noise to be alive: cylinders stick,
seals and rubber relax. And so far, of the bristle's length, the other side may go meanwhile: at the end of a stroke one sticks before
the other."""
PRESSURE_MEMORY_S = 1.0
"""Torque that comes slower than this may leak away or creep in while the vehicle is parked."""
RESIDUAL_MEMORY_S = 2.0
SUDDEN_MEMORY_S, SUDDEN_SHARE = 0.1, 0.35
"""A residual as large as the torque, where that is at least this share of the static friction, needs no long look."""
REFUSED_S = 0.5
"""A command that could not be used, with no plan in force, is forgotten after this."""
BOUND_MEMORY_S, BOUND_CAP = 0.4, 4.0
"""A residual beyond its bound is forgotten again in less than a second, however large it was."""
SWING_S = 0.05
"""What swings faster is what accelerates a machine on its oil, which is no friction: a loop that swings a little has a sound model."""

DOUBTS = (
    "angle jumped", "angle frozen", "angle noisy", "residual implausible", "rubber temperature outside the table",
    "outside the range of the calibration", "plan far from the angle", "plan has run out", "pressure frozen", "unseen motion",
    "outside the range of a law", "left and right angle contradict", "angle and rate contradict",
    "command refused", "time jumped", "pressures exchanged",
    "pressure below range", "rubber temperature outside the range of the calibration",
)  # fmt: skip
(
    JUMPED, FROZEN, NOISY, RESIDUAL, TABLE, RANGE, PLAN_AWAY, PLAN_OUT, LINE, UNSEEN, LAW, APART, CONTRARY, REFUSED, SET_BACK,
    EXCHANGED, BROKEN, HEAT,
) = (1 << bit for bit in range(len(DOUBTS)))  # fmt: skip

INPUTS = JUMPED | FROZEN | NOISY | LINE | UNSEEN | APART | CONTRARY | SET_BACK | EXCHANGED | BROKEN
"""What speaks against the sensors and not against the model."""

GUARD = np.dtype(
    [
        ("shadow_ns", np.int64),  # stamp of the trusted state; 0: the present one is trusted
        ("shadow_angle", np.float64),  # measured then [rad]
        ("shadow_unseen", np.bool_),  # whether its bristle was not known
        ("calm", np.float64),  # time without another jump since [s]
        ("returned", np.bool_),  # to where the shadow can have gone
        ("absurd", np.bool_),  # the readings since the last accepted one
        ("departed", np.float64),  # how far readings of late have departed from the motion before them [rad]
        ("leap_ns", np.int64),  # stamp of the reading before one that departs from the motion so far; 0: none does
        ("leap_angle", np.float64),  # measured then [rad]
        ("leap_since_ns", np.int64),  # since when the joint may have been on its way
        ("step", np.float64),  # smallest change that the reading has shown [rad]; 0: none yet
        ("fastest", np.float64),  # rate that the joint has shown while trusted [rad/s]
        ("still_ns", np.int64),  # since when the reading has not changed by more than its noise
        ("still", np.int64),  # samples since
        ("same", np.int64),  # samples in a row that were equal to the one before
        ("settled", np.int64),  # changes while the joint hardly moved
        ("jitter", np.float64),  # share of them, of late, that went back on the one before
        ("place", np.float64),  # where it stands: mean of the first of them [rad]
        ("still_other", np.float64),  # angle of the other side then, followed slowly [rad]; NaN: none yet
        ("apart", np.int64),  # samples in a row for which the other side was away from there
        ("begun", np.bool_),  # whether its bristle holds what the first torque has told (see ``unseen``)
        ("unseen_ns", np.int64),  # stamp of the end of unseen motion after which the bristle is not known yet; 0: it is
        ("set_back", np.bool_),  # it is not known because the clock was set back
        ("jumped_ns", np.int64),  # stamp of the sample before the time last jumped forward; 0: it never did
        ("jumped_to_ns", np.int64),  # stamp that it jumped to
        ("back_from_ns", np.int64),  # stamp of the sample before the clock was last set back; 0: it was not, or has been set forth again
        ("back_to_ns", np.int64),  # stamp that it was set back to
        ("frozen_ns", np.int64),  # since when it has stood where it is frozen; 0: it is not
        ("frozen_at", np.float64),  # reading then [rad]
        ("stands", np.bool_),  # it seemed frozen and went on from there: to stand but for its noise is no fault
        ("before", np.float64),  # last change of the reading [rad]
        ("before_s", np.float64),  # and the time that it took [s]
        ("bend", np.float64),  # difference of the last two changes [rad]
        ("straight", np.float64),  # the same, less what the times that they took explain [rad]; NaN: those differ too much
        ("noise", np.float64),  # variance of the reading of late, as neighbours tell it [rad2]
        ("rough", np.float64),  # the same over more samples [rad2]
        ("quiet", np.int64),  # second differences in a row that are no larger than sound ones
    ]
)


@inner
def _stand(g, stamp_ns, value):
    """The reading [rad] stands nowhere else from this sample on."""
    g.still_ns, g.still, g.same, g.place = stamp_ns, 0, 0, value
    g.still_other, g.apart = math.nan, 0


@inner
def _thaw(core, side, ch, stamp_ns, value):
    """A frozen angle moves, or has its noise again: if it goes on from where it was, it may have been sound and only stood."""
    g = core.guard[side]
    alive = _repeating(g) and value != ch.last_value
    if not alive and abs(value - g.frozen_at) <= UNSEEN_SIGMA * core.config[0].angle_noise:
        return
    g.stands = g.stands or reachable(core, side, ch.last_ns, stamp_ns, value - ch.last_value)
    lose_sight(core, side, stamp_ns, value, (stamp_ns - g.frozen_ns) * 1e-9)
    g.frozen_ns = 0


@inner
def watch(core, side, ch, stamp_ns, dt, value):
    """Learn from the next reading [rad] of a side, ``dt`` [s] after the last: whether it stands still, and its noise."""
    g, sigma = core.guard[side], core.config[0].angle_noise
    change = value - ch.last_value
    if g.frozen_ns != 0:
        _thaw(core, side, ch, stamp_ns, value)
    same = g.same + 1 if change == 0.0 else 0
    if g.still >= SETTLED_SAMPLES and same < STILL_SAMPLES:  # a frozen reading teaches nothing about a sound one
        g.settled = min(JITTER_SAMPLES, g.settled + 1)
        g.jitter += ((1.0 if change * g.before < 0.0 else 0.0) - g.jitter) / g.settled
    if change != 0.0 and dt > 0.0:
        g.step = min(abs(change), g.step) if g.step > 0.0 else abs(change)
    if dt <= 0.0 or abs(value - g.place) > STANDING_SIGMA * sigma:
        _stand(g, stamp_ns, value)
    else:
        g.still += 1
        if g.still < STILL_SAMPLES:
            g.place += (value - g.place) / (g.still + 1)
        g.same = same
    learn_noise(core, side, dt, change)


@inner
def _repeating(g):
    """Whether a reading whose noise is to be seen repeats."""
    return g.settled == JITTER_SAMPLES and g.jitter > JITTERY and g.same >= REPEATED


@inner
def still(core, side, stamp_ns):
    """Whether the reading of a side has shown no motion for so long that motion must have shown.

    Of a side that is known to stand on its own, only equal readings tell.
    """
    g = core.guard[side]
    enough = g.same if g.stands else g.still
    return enough >= STILL_SAMPLES and stamp_ns - g.still_ns >= STILL_NS


@inner
def _unseen(core):
    """Motion [rad] that must change a reading, by its noise or by how coarse the encoders are."""
    limit = UNSEEN_SIGMA * core.config[0].angle_noise
    for side in range(core.motion.size):
        limit = max(limit, UNSEEN_STEPS * core.guard[side].step)
    return limit


@inner
def _length(core, side):
    """Way [rad] over which the bristle of a side comes to the friction that holds it."""
    p = row(core.parameters, side, BASELINE)
    return most_friction(p) / p.sigma_0 if p.sigma_0 > 0.0 else math.inf


@inner
def _watch_other(core, side, dt, stamp_ns):
    """Freeze the angle of a side that stands still at its newest sample, ``dt`` [s] after the last, while the other side moves.

    The other side counts as far as its stamps lie within the standstill: one of them may come later than the other.
    """
    g, other = core.guard[side], 1 - side
    seen_ns = core.channels[other].last_ns
    if core.motion[other].age == 0.0 or seen_ns < g.still_ns or seen_ns > stamp_ns:
        return
    theta = core.motion[other].theta
    if math.isnan(g.still_other):
        g.still_other = theta
    elif g.same < STILL_SAMPLES:
        g.still_other += (theta - g.still_other) * min(1.0, dt / CREEP_MEMORY_S)
    limit = _unseen(core)
    if g.same < STILL_SAMPLES:
        limit = max(limit, SWING_SHARE * _length(core, side))
    g.apart = g.apart + 1 if abs(theta - g.still_other) > limit else 0
    if g.apart >= STILL_SAMPLES and still(core, side, stamp_ns):  # fewer may be a spike
        _freeze(core, side)


@inner
def _freeze(core, side):
    """From now on the angle of the side is frozen, until its reading moves."""
    g = core.guard[side]
    if g.frozen_ns == 0:
        g.frozen_ns, g.frozen_at = g.still_ns, core.channels[side].last_value


@inner
def angle_doubts(core, side, dt, stamp_ns):
    """Doubts about the angle of a side at its newest sample, ``dt`` [s] after the last."""
    g, c = core.guard[side], core.config[0]
    found = 0
    if g.shadow_ns != 0 or g.leap_ns != 0:
        found |= JUMPED
    if core.motion.size > 1 and c.angle_noise > 0.0:
        _watch_other(core, side, dt, stamp_ns)
    if _repeating(g) and not g.stands and g.same * dt * 1e9 >= STILL_NS:
        _freeze(core, side)
    if g.frozen_ns != 0:
        found |= FROZEN
    if g.unseen_ns != 0:
        found |= SET_BACK if g.set_back else UNSEEN
    if noisy(core, side):
        found |= NOISY
    if core.trust[side].contradicts:
        found |= CONTRARY
    return found


@inner
def weigh_pressures(core, stamp_ns, measured):
    """Angles that stand still while the measured torque [N m] swings by more than it can without motion that shows are frozen."""
    c = core.config[0]
    dt = (stamp_ns - c.swing_ns) * 1e-9
    c.swing_ns = stamp_ns
    stiffness, standing, equal = 0.0, c.angle_noise > 0.0, True
    for side in range(core.motion.size):
        stiffness += row(core.parameters, side, BASELINE).sigma_0
        standing = standing and still(core, side, stamp_ns)
        equal = equal and core.guard[side].same >= STILL_SAMPLES
    if not standing or dt <= 0.0:
        c.swing_from = measured
        return
    c.swing_from += (measured - c.swing_from) * min(1.0, dt / PRESSURE_MEMORY_S)
    limit = stiffness * _unseen(core)
    if abs(measured - c.swing_from) > (limit if equal else max(limit, SWING_SHARE * c.friction)):
        for side in range(core.motion.size):
            _freeze(core, side)


@inner
def _supported(c):
    """Whether the measured torque has just spoken for the estimate."""
    smaller = math.sqrt(min(c.measured_now, c.estimate_now))
    return smaller > SUPPORT_LEVEL * c.friction and math.sqrt(c.residual_now) < SUPPORT_SHARE * smaller


@inner
def _leap_limit(core, side, dt):
    """How far [rad] a reading may depart from the motion before it, or after it, ``dt`` [s] away."""
    g, p = core.guard[side], row(core.parameters, side, BASELINE)
    noise = LEAP_SIGMA * max(core.config[0].angle_noise, math.sqrt(g.noise))
    return max(LEAP_SHARE * _length(core, side), noise) + max(2.0 * FASTER * g.fastest, LEAP_RATE_RAD_S * p.angle_unit) * dt


@inner
def strays(core, side, ch, dt, value):
    """Whether a reading [rad] departs from the motion so far by much more than any did of late."""
    motion, usual = core.motion[side], max(STRAY_TIMES * core.guard[side].departed, core.config[0].angle_noise)
    return motion.age > 1.0 + STRAY_AFTER_S and dt > 0.0 and abs(value - ch.last_value - motion.omega * dt) > usual


@inner
def depart(core, side, dt, apart):
    """A reading was used that departed so far [rad] from the motion before it."""
    g = core.guard[side]
    g.departed = max(apart, g.departed * math.exp(-dt / DEPARTED_MEMORY_S))


@inner
def watch_leap(core, side, ch, dt, value):
    """Keep the state before a reading [rad] that departs from the motion so far: the next one tells whether it was a jump."""
    g = core.guard[side]
    if dt <= 0.0 or ch.head < 2:
        return
    if abs(value - ch.last_value - core.motion[side].omega * dt) > _leap_limit(core, side, dt):
        g.leap_ns, g.leap_angle = ch.last_ns, ch.last_value
        g.leap_since_ns = g.frozen_ns if g.frozen_ns != 0 else ch.last_ns
        if g.shadow_ns == 0:
            copy_row(core.shadow, side, core.state, side)


@inner
def leapt(core, side, ch, stamp_ns, value):
    """Whether the reading [rad] after one that departed from the motion before does not go on from there either."""
    g = core.guard[side]
    if g.leap_ns == 0:
        return False
    dt = (ch.last_ns - g.leap_ns) * 1e-9
    rate = (value - ch.last_value) / ((stamp_ns - ch.last_ns) * 1e-9)
    return abs(ch.last_value - g.leap_angle - rate * dt) > _leap_limit(core, side, dt)


@inner
def trust(core, side, dt):
    """Time passes without a jump: in the end the present state is the trusted one."""
    g = core.guard[side]
    g.absurd = False
    if g.shadow_ns != 0:
        # What is faster than the joint ever was may only come past where that can be.
        fast = abs(core.motion[side].omega) * SETTLED_S > farthest(core, side, SETTLED_S)
        g.calm = 0.0 if g.returned and fast else g.calm + dt
        patience = SUPPORTED_S if _supported(core.config[0]) else TRUSTED_S
        if g.calm >= (SETTLED_S if g.returned else patience):
            g.shadow_ns = 0
    elif g.frozen_ns == 0 and g.leap_ns == 0:
        g.fastest += max(0.0, abs(core.motion[side].omega) - g.fastest) * min(1.0, dt / FASTEST_MEMORY_S)


@inner
def reachable(core, side, since_ns, stamp_ns, change):
    """Whether a joint can have turned by ``change`` [rad] between two stamps, at the rates that it has shown."""
    return abs(change) <= farthest(core, side, (stamp_ns - since_ns) * 1e-9)


@inner
def runs(core, side, dt, change):
    """Whether a reading changes by ``change`` [rad] in ``dt`` [s] as that of no joint does: degrees sweep like that."""
    return dt > 0.0 and abs(change) > _leap_limit(core, side, dt)


@inner
def comes_back(core, side, stamp_ns, value):
    """Whether an angle that jumped, with its last sample again, is now where the joint can have got to."""
    g = core.guard[side]
    return g.calm == 0.0 and not g.returned and reachable(core, side, g.shadow_ns, stamp_ns, value - g.shadow_angle)


@inner
def _carry(core, side, stamp_ns, value):
    """The contact goes along with the angle to ``value`` [rad], without slip; how its bristle is then, nobody knows."""
    c, p = core.config[0], row(core.parameters, side, BASELINE)
    state, trial = row(core.state, side, STATE), row(core.scratch_state, 0, STATE)
    copy_row(core.scratch_state, 0, core.state, side)
    call_step(c.step_door, p, trial, core.rubber, core.scratch_output[0], 0.0, value, 0.0, 0.0, c.effects)
    turned = trial.theta - state.theta
    state.theta += turned
    state.contact_angle += turned
    part(core, side, stamp_ns, value, math.inf)


@inner
def begin_again(core, side, stamp_ns, value):
    """The first reading [rad] of a side after its clock was set back: heat and memories are as they were, the bristle is lost."""
    _carry(core, side, stamp_ns, value)
    row(core.state, side, STATE).z = 0.0


@inner
def re_anchor(core, side, ch, stamp_ns, value, running):
    """The angle of a side jumps to ``value`` [rad], confirmed: no slip, no heat, unless the joint has really gone there.

    That it has, after it was frozen, and where the shadow can have got to; not if it is ``running`` on from an earlier jump.
    """
    g, c, out, motion = core.guard[side], core.config[0], core.output[side], core.motion[side]
    p, state = row(core.parameters, side, BASELINE), row(core.state, side, STATE)
    if g.shadow_ns == 0:
        g.shadow_unseen = g.unseen_ns != 0
    if g.shadow_ns == 0 and g.leap_ns == 0:
        copy_row(core.shadow, side, core.state, side)
        g.shadow_ns, g.shadow_angle = ch.last_ns, ch.last_value
        begin_ns = g.frozen_ns
        g.returned = g.frozen_ns != 0
    else:
        saturated = state.saturated
        copy_row(core.state, side, core.shadow, side)
        state.saturated = saturated
        begin_ns = g.shadow_ns
        if g.shadow_ns == 0:  # the leap before was the first jump
            g.shadow_ns, g.shadow_angle, begin_ns = g.leap_ns, g.leap_angle, g.leap_since_ns
        g.returned = not running and reachable(core, side, begin_ns, stamp_ns, value - g.shadow_angle)
    g.calm = 0.0
    g.leap_ns = 0
    passed = (stamp_ns - g.shadow_ns) * 1e-9
    if g.returned:
        unseen_s = (stamp_ns - begin_ns) * 1e-9
        rate = (value - g.shadow_angle) / unseen_s
        if not g.shadow_unseen:
            g.unseen_ns = 0
        lose_sight(core, side, stamp_ns, value, unseen_s)
        call_step(c.step_door, p, state, core.rubber, out, passed, value, rate, 0.0, c.effects)
    else:
        _carry(core, side, stamp_ns, value)
        call_step(c.step_door, p, state, core.rubber, out, passed, value, 0.0, 0.0, c.effects)
    g.absurd, g.frozen_ns = False, 0
    _stand(g, stamp_ns, value)
    for other in range(core.motion.size):  # a jump is no motion
        core.guard[other].still_other, core.guard[other].apart = math.nan, 0
    g.before = g.before_s = g.bend = 0.0
    stand(motion, value)


@inner
def _sudden(c):
    """Whether residuals have just become as large as the torque, and that is large."""
    larger = math.sqrt(max(c.measured_now, c.estimate_now))
    return larger > SUDDEN_SHARE * c.friction and math.sqrt(c.residual_now) > LARGE_SHARE * larger


@inner
def weigh_residual(c, stamp_ns, measured, residual):
    """Learn from the next residual [N m] how large residuals and torques have been of late."""
    dt = (stamp_ns - c.residual_ns) * 1e-9
    known = dt > 0.0 and c.residual_ns != 0
    c.residual_ns = stamp_ns
    if abs(residual) > AGREED_SHARE * c.friction:
        c.agreed_ns = 0
    elif c.agreed_ns == 0:
        c.agreed_ns = stamp_ns
    soon = min(1.0, dt / SUDDEN_MEMORY_S) if known else 0.0
    c.residual_now += (residual * residual - c.residual_now) * soon
    c.measured_now += (measured * measured - c.measured_now) * soon
    c.estimate_now += ((measured - residual) ** 2 - c.estimate_now) * soon
    if c.residual_bound > 0.0:
        most = math.sqrt(BOUND_CAP) * c.residual_bound
        slowly = 1.0 - math.exp(-dt / SWING_S) if known else 0.0
        c.residual_slow += (max(-most, min(most, residual)) - c.residual_slow) * slowly
        c.beyond += ((c.residual_slow / c.residual_bound) ** 2 - c.beyond) * (min(1.0, dt / BOUND_MEMORY_S) if known else 0.0)
    if _sudden(c):  # told already, and to be forgotten soon after
        return
    weight = min(1.0, dt / RESIDUAL_MEMORY_S) if known else 0.0
    c.residual_square += (residual * residual - c.residual_square) * weight
    c.measured_square += (measured * measured - c.measured_square) * weight
    c.estimate_square += ((measured - residual) ** 2 - c.estimate_square) * weight


@inner
def _apart(core):
    """Whether the sides are farther from each other than steering geometry and tolerance allow, however slowly they came there.

    A linkage is something between parallel and Ackermann's.
    """
    c = core.config[0]
    if math.isnan(c.side_ratio) or core.motion[0].age == 0.0 or core.motion[1].age == 0.0:
        return False
    first, second = core.motion[0].theta, core.motion[1].theta
    tangent = math.tan(first)
    tied = math.atan2(tangent, 1.0 + c.side_ratio * tangent)
    return not min(first, tied) - c.side_tolerance <= second <= max(first, tied) + c.side_tolerance


@inner
def standing_doubts(core, stamp_ns):
    """Doubts about the whole vehicle: sides that contradict, a residual beyond the bound of the calibration, or as large as the
    torque; the plan, and a command that is none."""
    c, found = core.config[0], APART if _apart(core) else 0
    if c.residual_ns != 0 and stamp_ns - c.residual_ns < RESIDUAL_MEMORY_S * 1e9:
        level = math.sqrt(c.residual_square)
        smaller = math.sqrt(min(c.measured_square, c.estimate_square))
        large = c.estimate_square > (NOTABLE_SHARE * c.friction) ** 2 and level > LARGE_SHARE * smaller
        if large or c.beyond > 1.0 or _sudden(c):
            found |= RESIDUAL
    for i in range(core.motion.size, core.channels.size):
        if core.channels[i].kind == Kind.PRESSURE and core.channels[i].frozen:
            found |= LINE
        if core.channels[i].below:
            found |= BROKEN
    if c.exchanged != 0:
        found |= EXCHANGED
    # What is wanted now is not known: an earlier plan is not what was meant last.
    refused = c.plan_refused_ns != 0 and (c.plan_size > 0 or stamp_ns - c.plan_refused_ns < REFUSED_S * 1e9)
    if c.horizon > 0.0 and refused:
        found |= REFUSED
    if c.horizon > 0.0 and c.plan_size > 0:
        if stamp_ns >= core.plan_ns[c.plan_size - 1]:
            found |= PLAN_OUT
        for side in range(core.motion.size):
            if departs(core, side, stamp_ns):
                found |= PLAN_AWAY
    return found
