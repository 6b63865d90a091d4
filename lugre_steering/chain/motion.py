# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Motion stage, from the corrected angle to the motion of the contact (effects only; for the rate see ``rates``)."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import law

FLANK_TORQUE_NM = 100.0
"""Torque over which a gap changes flanks; ``backlash_softness`` adds to it."""
_ITERATIONS = 12


@law
def wind_up(p, torque):
    """Angle [rad] lost between sensor and track under ``torque`` [N m], and its slope [rad/(N m)].

    linkage_compliance: c M / (1 + stiffening |M|). backlash: width / 2 tanh(M / flank torque), a gap whose flank
    changes where the torque changes sign.
    """
    stiffer = 1.0 + p.linkage_compliance_stiffening * abs(torque)
    angle = p.linkage_compliance_compliance * torque / stiffer
    slope = p.linkage_compliance_compliance / (stiffer * stiffer)
    if p.backlash_width > 0.0:
        flank = FLANK_TORQUE_NM + p.backlash_softness
        side = math.tanh(torque / flank)
        angle += 0.5 * p.backlash_width * side
        slope += 0.5 * p.backlash_width / flank * (1.0 - side * side)
    return angle, slope


@law
def contact_increment(p, s, theta, stiffness, length, effects):
    """Angle [rad] by which the contact turns when the corrected steering angle reaches ``theta``.

    contact + wind_up(M) = theta, solved for the contact with the tangent stiffness of the bristle (so stable for any
    compliance). The torque of the last step enters exactly, so errors do not add up. ``length`` is g / sigma_0 [rad].
    """
    if not effects or (p.linkage_compliance_compliance == 0.0 and p.backlash_width == 0.0):
        d_theta = theta - s.contact_angle
        s.contact_angle = theta
        return d_theta
    away = theta - s.contact_angle - wind_up(p, s.load)[0]
    tangent = stiffness * max(0.05, 1.0 - math.copysign(s.z, s.z * away) / length)
    # Newton kept inside a bracket: the left side grows with the step, at least as fast as the step itself.
    low, high = min(0.0, away), max(0.0, away)
    d_theta = away / (1.0 + wind_up(p, s.load)[1] * tangent)
    for _ in range(_ITERATIONS):
        lost, slope = wind_up(p, s.load + tangent * d_theta)
        error = s.contact_angle + d_theta + lost - theta
        if error > 0.0:
            high = d_theta
        else:
            low = d_theta
        d_theta -= error / (1.0 + slope * tangent)
        if not low <= d_theta <= high:
            d_theta = 0.5 * (low + high)
        if abs(error) < 1e-10:
            break
    s.contact_angle += d_theta
    return d_theta
