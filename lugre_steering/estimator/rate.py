# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether a measured rate goes with the angle that it is sent with: drivers fill it with zeros, degrees or spikes."""

from __future__ import annotations

import math

import numpy as np

from lugre_steering.chain.compiled import inner
from lugre_steering.estimator.layout import RATE

MEMORY_S = 3.0
SLACK_SIGMA = 10.0
LEAST_SIGMA = 1e-5  # rad, where the sheet gives the angle no noise
NOISE_SIGMA = 4.0
SHARE_OF_TRAVEL = 0.25
REDEEMING_SHARE = 0.02
REDEEMED_S = 10.0
LASTING = 3  # samples: a spike of the angle is over sooner
LATELY_S = 0.2
LAG_S = 0.1
"""Rates may come so much later than the angle."""
WITNESS_S, CONTRARY_S, RECONCILED_S = 5.0, 0.05, 0.3
"""Of motion that rate and angle must have made together before the rate can contradict, apart, and together again."""

TRUST = np.dtype(
    [
        ("last_rate", np.float64),  # last credible rate [rad/s]
        ("last_astray", np.float64),  # what the last rate made of its interval, less the change of the angle [rad]
        ("astray", np.float64),  # the sum of these of late [rad]
        ("variance", np.float64),  # of that sum, as the difference of neighbours tells it [rad2]
        ("travel", np.float64),  # of the estimated angle in that time, there and back [rad]
        ("doubts", np.int64),  # samples in a row for which the sum was too large
        ("agreed", np.float64),  # for how long it moved and the sum was small, since it was not [s]
        ("refuted", np.bool_),
        ("lately", np.float64),  # as ``astray``, over ``LATELY_S`` and with every rate that came [rad]
        ("way", np.float64),  # in that time, by angle and rate [rad]
        ("mean_rate", np.float64),  # in that time [rad/s]
        ("former_rate", np.float64),  # last rate, credible or not [rad/s]
        ("contrary", np.float64),  # for how long rate and angle have gone different ways [s]
        ("together", np.float64),  # for how long they have gone the same way, since they did not [s]
        ("contradicts", np.bool_),  # the angle, which it had gone with before
    ]
)


@inner
def believed(s, ch, c, dt, value, rate):
    """The ``rate`` [rad/s] of an accepted sample of channel ``ch``, ``dt`` [s] and ``value`` [rad] after the last; NaN: not used.

    ``s`` is one ``TRUST`` record. One rate is left out if it is faster than an angle may be, or departs from the change of
    the angle by more than that change, the last rate and the noise together. All are left out once they add up, over
    ``MEMORY_S``, to another way than the angle went, by a quarter of that way and more than noise could; until they have
    added up closely for ``REDEEMED_S`` of motion. Left out ones are counted. Rates that have gone with the angle for ``WITNESS_S``
    and then no more contradict it (``contradicts``): nobody can know which of the two is wrong.
    """
    decay = math.exp(-dt / MEMORY_S)
    s.astray *= decay
    s.variance *= decay * decay
    s.travel *= decay
    if math.isnan(rate):
        return rate
    credible = abs(rate) <= c.max_rate
    if dt <= 0.0:
        s.last_rate = rate if credible else 0.0
        s.former_rate = s.mean_rate = s.last_rate
        return _counted(ch, rate, credible)
    slack = SLACK_SIGMA * (c.angle_noise if c.angle_noise > 0.0 else LEAST_SIGMA)
    change = value - ch.last_value
    _compare(s, c.max_rate, slack, dt, change, rate)
    single = slack + NOISE_SIGMA * math.sqrt(2.0 * dt / MEMORY_S * s.variance)
    credible = credible and abs(rate * dt - change) <= single + abs(change) + abs(s.last_rate) * dt
    unsure = 0.0
    if credible:
        unsure = 0.5 * abs(rate - s.last_rate) * dt  # it may have changed at any instant between
        astray = 0.5 * (rate + s.last_rate) * dt - change
        s.last_rate = rate
    else:
        astray = math.copysign(slack, rate * dt - change)
    s.astray += astray
    s.variance += 0.5 * (astray - s.last_astray) ** 2
    s.last_astray = astray
    noise = 2.0 * slack + NOISE_SIGMA * math.sqrt(s.variance)
    limit = noise + unsure + SHARE_OF_TRAVEL * s.travel
    s.doubts = s.doubts + 1 if abs(s.astray) > limit else 0
    # Closely: in a steady oscillation even zeros add up to little beside the way there and back.
    if abs(s.astray) > 0.5 * (noise + unsure) + REDEEMING_SHARE * s.travel:
        s.agreed = 0.0
    elif s.travel > 2.0 * noise:
        s.agreed += dt
    s.refuted = s.doubts >= LASTING or (s.refuted and s.agreed < REDEEMED_S)
    return _counted(ch, rate, credible and not s.refuted)


@inner
def _compare(s, max_rate, slack, dt, change, rate):
    """Learn from a ``rate`` [rad/s] and the ``change`` [rad] of the angle in the time ``dt`` [s] whether they go the same way."""
    rate = max(-max_rate, min(max_rate, rate))
    decay = math.exp(-dt / LATELY_S)
    turned = 0.5 * (rate + s.former_rate) * dt
    unsure = 0.5 * abs(rate - s.former_rate) * dt
    s.former_rate = rate
    s.lately = decay * s.lately + turned - change
    s.way = decay * s.way + 0.5 * (abs(turned) + abs(change))
    s.mean_rate += (rate - s.mean_rate) * (1.0 - decay)
    noise = 2.0 * slack + NOISE_SIGMA * math.sqrt(LATELY_S / MEMORY_S * s.variance)
    late = max(0.0, math.copysign(LAG_S, s.lately) * (s.mean_rate - rate))
    if abs(s.lately) > noise + unsure + late + SHARE_OF_TRAVEL * s.way:
        s.contrary += dt
        if s.contrary > CONTRARY_S:
            s.contradicts = s.contradicts or s.together >= WITNESS_S
            s.together = 0.0
        return
    s.contrary = 0.0
    if s.way > 2.0 * noise:
        s.together += dt
        s.contradicts = s.contradicts and s.together < RECONCILED_S


@inner
def _counted(ch, rate, used):
    if used:
        return rate
    ch.reasons[RATE] += 1
    return math.nan
