# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Motion that nobody saw: before the start, during a silence, a freeze or a jump. How the bristle came out of it is not known.

At the start it is taken for relaxed, as on a track that was rolled straight, unless the first measured torque says otherwise; so it is
where the clock was set back.

Of all the ways that the joint can have gone, dz = d theta - |d theta| z / length makes two lead to the ends of what the bristle can
hold: first as far as possible to one side, then back to where the joint is now. Both are driven on beside the estimate. Every radian
brings two starts closer to each other, whatever they were; until all agree, the torque is in doubt.
"""

from __future__ import annotations

from lugre_steering.chain.baseline import REST_RATE_RAD_S, most_friction, ratios
from lugre_steering.chain.compiled import inner
from lugre_steering.chain.doors import call_step, copy_row, row
from lugre_steering.chain.layout import BASELINE, STATE

FASTER = 1.5
"""How much faster than ever before a joint may be while nobody sees it."""
UNSEEN_SIGMA = 20.0
"""Motion of so many times the noise of an angle must change its reading."""
AGREED_SHARE = 0.05
"""Torques agree within this share of the static friction, and with the measured torque."""
FORGOTTEN = 5.0
"""Presliding lengths after which less than 1 % of any start is left."""
SUPPORTED_NS = 200_000_000
BEGIN_NS = 200_000_000
"""How long after the first torque the bristles are set right: at the same sample, in whatever order messages come."""
SETTLED_LAGS = 5.0
"""Time constants of a lag after which hardly anything is left of what was before."""


@inner
def farthest(core, side, seconds):
    """How far [rad] the joint of a side can have gone in that time [s], at the rates that it has shown."""
    return FASTER * core.guard[side].fastest * seconds + UNSEEN_SIGMA * core.config[0].angle_noise


@inner
def lose_sight(core, side, stamp_ns, value, seconds):
    """Nobody has seen for so long [s] how the joint went from where its state is to ``value`` [rad]: part the two ways."""
    change = abs(value - row(core.state, side, STATE).theta)
    part(core, side, stamp_ns, value, max(farthest(core, side, seconds), FASTER * change))


@inner
def part(core, side, stamp_ns, value, far):
    """The two ways to ``value`` [rad] of a joint that can have gone so far [rad], there and back, from where its state is."""
    c, g, p, state = core.config[0], core.guard[side], row(core.parameters, side, BASELINE), row(core.state, side, STATE)
    length = most_friction(p) / p.sigma_0 if p.sigma_0 > 0.0 else 0.0
    aside = max(0.0, min(FORGOTTEN * length, 0.5 * (far - abs(value - state.theta))))
    for way in range(2):
        i = 2 * side + way
        bound, out = row(core.bounds, i, STATE), core.scratch_output[0]
        if g.unseen_ns == 0:
            copy_row(core.bounds, i, core.state, side)
        turn = max(state.theta, value) + aside if way == 0 else min(state.theta, value) - aside
        call_step(c.step_door, p, bound, core.rubber, out, 0.0, turn, 0.0, 0.0, c.effects)
        call_step(c.step_door, p, bound, core.rubber, out, 0.0, value, 0.0, 0.0, c.effects)
        bound.temperature = state.temperature  # what may have been slid is a bound of the bristle, not of the heat
    g.unseen_ns = stamp_ns


@inner
def end_silence(core, side, ch, stamp_ns, value):
    """The reading [rad] comes after a silence. A joint that stood and is where it stood has not moved meanwhile."""
    p, omega, noise = row(core.parameters, side, BASELINE), core.motion[side].omega, core.config[0].angle_noise
    stood = abs(omega) < REST_RATE_RAD_S * p.angle_unit and abs(value - ch.last_value) <= UNSEEN_SIGMA * noise
    if not stood:
        lose_sight(core, side, stamp_ns, value, (stamp_ns - ch.last_ns) * 1e-9)


@inner
def _supported(c, since_ns):
    """Whether the measured torque has agreed with the estimate for long enough since then."""
    return c.agreed_ns != 0 and c.residual_ns - max(c.agreed_ns, since_ns) > SUPPORTED_NS


@inner
def drive_bounds(core, side, dt):
    """Both ways go on with the motion of the side, ``dt`` [s] after its last sample, until their torques agree with its own."""
    c, g, p, motion = core.config[0], core.guard[side], row(core.parameters, side, BASELINE), core.motion[side]
    out, apart = core.scratch_output[0], 0.0
    for i in range(2 * side, 2 * side + 2):
        bound = row(core.bounds, i, STATE)
        call_step(c.step_door, p, bound, core.rubber, out, dt, motion.theta, motion.omega, motion.alpha, c.effects)
        apart = max(apart, abs(out.torque - core.output[side].torque))
    if apart <= AGREED_SHARE * most_friction(p) or _supported(c, g.unseen_ns):
        g.unseen_ns, g.set_back = 0, False


@inner
def learn_start(core, e, residual):
    """The first measured torque is ``residual`` [N m] more than the estimate ``e`` of that instant: how much bristles held at the start.

    Pressures tell only by their next samples whether the first ones were astray, so it is believed at the next residual. All sides hold
    the same share of what they can, as one torque does not tell them apart.
    """
    c, most = core.config[0], 0.0
    first, first_ns = c.start_residual, c.start_residual_ns
    if first_ns == 0:
        c.start_residual, c.start_residual_ns = residual, e.stamp_ns
        c.start_known = abs(residual) <= AGREED_SHARE * c.friction
        return
    c.start_known = True
    for side in range(core.motion.size):
        p = row(core.parameters, side, BASELINE)
        warm = e.temperature[side] if core.guard[side].set_back else p.rubber_temperature
        most += most_friction(p) * ratios(core.rubber, p.table_low, p.table_step, warm)[0]
    if most > 0.0:
        c.start_share = max(-1.0, min(1.0, first / most))
        c.begin_ns = first_ns + BEGIN_NS


@inner
def begin_held(core, side):
    """The bristle of a side holds what is left of what it held at the start; what was deflected since has been taken from it. After the
    clock was set back, when it has been deflected before, the two ways tell how much is left: half of what is between them."""
    c, g, state, p = core.config[0], core.guard[side], row(core.state, side, STATE), row(core.parameters, side, BASELINE)
    g.begun = True
    left = 0.0
    if g.set_back:
        left = 0.5 * abs(row(core.bounds, 2 * side, STATE).z - row(core.bounds, 2 * side + 1, STATE).z)
    elif g.unseen_ns == 0 and p.sigma_0 > 0.0:
        left = max(0.0, most_friction(p) / p.sigma_0 - state.z_max)
    if left > 0.0:
        state.z += c.start_share * left
        state.z_max = max(state.z_max, abs(state.z))


@inner
def before_start(c, stamp_ns):
    """Whether the bristles of that time did not hold yet what they do, or that is not known."""
    return not c.start_known or (c.begin_ns != 0 and stamp_ns < c.begin_ns + int(SETTLED_LAGS * c.lag * 1e9))
