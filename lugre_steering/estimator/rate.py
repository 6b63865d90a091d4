# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether a measured rate goes with the angle that it is sent with: drivers fill it with zeros, degrees or spikes."""

from __future__ import annotations

import math

from numba import njit

from lugre_steering.estimator.layout import RATE

MEMORY_S = 1.0
SLACK_SIGMA = 10.0
LEAST_SIGMA = 1e-4  # rad; sheets may say that the angle has no noise
SHARE_OF_TRAVEL = 0.25


@njit
def believed(ch, c, dt, value, rate):
    """The ``rate`` [rad/s] of an accepted sample of channel ``ch``, ``dt`` [s] and ``value`` [rad] after the last; NaN: not used.

    One rate is left out if it is faster than an angle may be, or departs from the change of the angle by more than that
    change, the last rate and the noise together. All are left out from then on if, over the last second, they add up
    to another way than the angle went, by a quarter of that way and more than noise could. Left out ones are counted.
    """
    if math.isnan(rate):
        return rate
    if ch.rate_refuted:
        return _counted(ch, rate, False)
    slack = SLACK_SIGMA * max(c.angle_noise, LEAST_SIGMA)
    change = value - ch.last_value
    credible = abs(rate) <= c.max_rate
    if not 0.0 < dt <= c.max_gap_ns * 1e-9:  # nothing to compare with
        ch.last_rate = rate if credible else 0.0
        return _counted(ch, rate, credible)
    credible = credible and abs(rate * dt - change) <= slack + abs(change) + abs(ch.last_rate) * dt
    decay = math.exp(-dt / MEMORY_S)
    if credible:
        doubt = 0.5 * abs(rate - ch.last_rate) * dt  # of the sum, as the rate may have changed at any instant between
        astray = 0.5 * (rate + ch.last_rate) * dt - change
        ch.last_rate = rate
    else:
        doubt = 0.0
        astray = math.copysign(slack, rate * dt - change)
    ch.rate_astray = decay * ch.rate_astray + astray
    ch.travel *= decay
    ch.rate_refuted = abs(ch.rate_astray) > 3.0 * slack + doubt + SHARE_OF_TRAVEL * ch.travel
    return _counted(ch, rate, credible and not ch.rate_refuted)


@njit
def _counted(ch, rate, used):
    if used:
        return rate
    ch.reasons[RATE] += 1
    return math.nan
