# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Motion stage, from the corrected angle to the motion of the contact (effects only; for the rate see ``rates``)."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import law


@law
def contact_increment(p, s, theta, stiffness, length, effects):
    """Angle [rad] by which the contact turns when the corrected steering angle reaches ``theta``.

    linkage_compliance: contact = theta - c M (1 + stiffening ...), solved with the tangent stiffness, so stable for any
    c. backlash: a gap of ``width`` that opens when the bristle torque has fallen to zero.
    ``length`` is the presliding length g / sigma_0 [rad].
    """
    if effects and p.linkage_compliance_compliance != 0.0:
        compliance = p.linkage_compliance_compliance / (1.0 + p.linkage_compliance_stiffening * abs(s.torque))
        wanted = theta - compliance * s.torque - s.link_angle
        saturation = math.copysign(s.z, s.z * wanted) / length
        d_theta = wanted / (1.0 + compliance * stiffness * max(0.0, 1.0 - saturation))
    else:
        d_theta = theta - s.link_angle
    s.link_angle += d_theta
    if effects and p.backlash_width > 0.0 and d_theta != 0.0:
        d_theta = through_gap(p, s, d_theta, length)
    return d_theta


@law
def through_gap(p, s, d_theta, length):
    """Part of a link motion that passes a backlash [rad]; ``s.gap`` is the position inside it, -width/2 ... width/2.

    A loaded flank follows until the bristle torque is zero, after the travel L ln(1 + |z| / L) of the exact LuGre step;
    then the link crosses the gap and takes the track along at the other flank.
    """
    sign = math.copysign(1.0, d_theta)
    travel = abs(d_theta)
    followed = 0.0
    if s.z * sign < 0.0 and s.gap * sign <= -0.5 * p.backlash_width * 0.999:
        followed = min(travel, length * math.log1p(abs(s.z) / length))
    crossed = min(travel - followed, 0.5 * p.backlash_width - sign * s.gap)
    s.gap += sign * crossed
    return sign * (travel - crossed)
