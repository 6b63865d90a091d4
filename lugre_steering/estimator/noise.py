# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How noisy the reading of an angle is, as its samples tell it, and what noise beyond the sheet's leaves unknown.

Noise that the play operator is too narrow for is slid there and back by the model: a parked joint would lose its torque. The play is
therefore made as wide as the reading needs; what was slid before it is, leaves the bristle unknown (see ``unseen``).
Neighbouring second differences of a smooth motion have one sign; of white noise their product is -4 variances.
"""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import inner
from lugre_steering.estimator.unseen import part

NOISY_SIGMA = 10.0
NOISE_MEMORY_S = 0.2
"""So soon noise of ``NOISY_SIGMA`` is told."""
ROUGH_SIGMA = 4.0
ROUGH_SAMPLES = 50.0
"""Over so many samples, noise of ``ROUGH_SIGMA`` can be told."""
WIDER_SIGMA = 2.0
"""Noise this many times the sheet's is believed: chance alone has not made it over ``ROUGH_SAMPLES`` in a million samples."""
SHARE_OF_BENDS = 0.359
"""Variance of white noise over the mean square of the smaller of two neighbouring second differences (with a sign, see below)."""
QUIET_SIGMA, QUIET_SAMPLES, LEFT_SIGMA = 6.0, 15, 3.0
"""Noise of ``ROUGH_SIGMA`` makes one second difference of two larger than that; where none of so many in a row is, no more noise than
``LEFT_SIGMA`` can be left."""
UNEVEN = 1.5
"""Samples whose intervals differ more say little of the noise."""
STEPS = 4.0
"""An encoder's step is no noise: flickering between two of its values comes to the variance of a step."""
LASTING = 1.5
"""Noise over ``ROUGH_SAMPLES`` is over where that of ``NOISE_MEMORY_S`` has less than one part in so many of its variance."""


@inner
def _expected(core, side):
    """Noise [rad] of one angle sample of a side, by the sheet or how coarse its encoder is."""
    return max(core.config[0].angle_noise, core.guard[side].step / STEPS)


@inner
def _measured(core, side):
    """Variance [rad2] of one angle sample, as the samples tell it, while it lasts."""
    g = core.guard[side]
    return min(g.rough, LASTING * g.noise)


@inner
def noisy(core, side):
    """Whether the reading is so noisy that the play, made for the sheet's noise or grown since, cannot have held the bristle."""
    c, g = core.config[0], core.guard[side]
    if c.angle_noise <= 0.0:
        return False
    return g.noise > (NOISY_SIGMA * c.angle_noise) ** 2 or _measured(core, side) > (ROUGH_SIGMA * _expected(core, side)) ** 2


@inner
def noise_of(core, side):
    """Noise [rad] of one angle sample of a side: the sheet's, or what it is where that is more."""
    g, sigma = core.guard[side], core.config[0].angle_noise
    if sigma <= 0.0:
        return sigma
    if g.noise > (NOISY_SIGMA * sigma) ** 2:
        return math.sqrt(g.noise)
    measured = _measured(core, side)
    return math.sqrt(measured) if measured > (WIDER_SIGMA * _expected(core, side)) ** 2 else sigma


@inner
def learn_noise(core, side, dt, change):
    """Learn from the next ``change`` [rad] of the reading, ``dt`` [s] after the last."""
    g, sigma = core.guard[side], core.config[0].angle_noise
    ratio = dt / g.before_s if g.before_s > 0.0 and dt > 0.0 else math.inf
    if dt <= 0.0 or dt > NOISE_MEMORY_S:
        g.before = math.nan  # neither the first sample nor a silence has neighbours
    bend, straight = change - g.before, change - ratio * g.before
    limit = (3.0 * NOISY_SIGMA * sigma) ** 2  # one spike is no noise
    if not math.isnan(bend * g.bend):
        square = max(-limit, min(limit, -0.25 * bend * g.bend))
        g.noise = max(0.0, g.noise + (square - g.noise) * dt / NOISE_MEMORY_S)
    g.quiet = g.quiet + 1 if abs(straight) < QUIET_SIGMA * max(1.0, ratio) * _expected(core, side) else 0
    if not 1.0 / UNEVEN < ratio < UNEVEN:
        straight = math.nan
    if not math.isnan(straight * g.straight):
        square = min(limit, SHARE_OF_BENDS * min(straight * straight, g.straight * g.straight))
        g.rough = max(0.0, g.rough + (math.copysign(square, -straight * g.straight) - g.rough) / ROUGH_SAMPLES)
    if g.quiet >= QUIET_SAMPLES:
        left = (LEFT_SIGMA * _expected(core, side)) ** 2
        g.noise, g.rough = min(g.noise, left), min(g.rough, left)
    g.before, g.before_s, g.bend, g.straight = change, dt, bend, straight


@inner
def lose_bristle(core, side, stamp_ns, value):
    """While the reading [rad] is noisy nobody knows the bristle."""
    if noisy(core, side):
        part(core, side, stamp_ns, value, math.inf)
