# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Contact stage: LuGre friction of rubber on the ground, and the friction physics the baseline leaves out.

Sources: C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, "A new model for control of systems with friction",
IEEE TAC 40 (1995) 419; K. J. Astrom, C. Canudas de Wit, "Revisiting the LuGre friction model", IEEE CSM
28(6) (2008) 101.
"""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import exp, law

PATCH_EDGE_RAD = 0.01
PATCH_EDGE_S = 0.2


@law
def stribeck(omega: float, static: float, coulomb: float, speed: float, exponent: float) -> float:
    """Steady sliding torque g = Mc + (Ms - Mc) exp(-|omega / omega_St|**delta) [N m] (op. cit. 1995)."""
    ratio = abs(omega) / speed
    power = ratio * ratio if exponent == 2.0 else ratio**exponent
    return coulomb + (static - coulomb) * exp(-power)


@law
def bristle(z: float, d_theta: float, stiffness: float, g: float) -> float:
    """Bristle deflection [rad] after the contact turned by ``d_theta`` [rad] at constant rate: exact for any step.

    dz/dt = omega - sigma_0 |omega| z / g  =>  z+ = z_ss + (z - z_ss) exp(-sigma_0 |d_theta| / g),
    z_ss = sgn(omega) g / sigma_0.
    """
    z_ss = math.copysign(g / stiffness, d_theta)
    return z_ss + (z - z_ss) * exp(-stiffness * abs(d_theta) / g)


@law
def bristle_work(z: float, z_next: float, d_theta: float, g: float) -> float:
    """Work of the elastic torque [J] over the exact step from ``z`` to ``z_next``: integral of sigma_0 z dtheta.

    g (|d_theta| + sgn(d_theta) (z - z_next)), the closed-form integral of the exponential step.
    """
    return g * (abs(d_theta) + math.copysign(1.0, d_theta) * (z - z_next))


@law
def window(x: float, low: float, high: float, edge: float) -> float:
    """1 inside [low, high], 0 outside, linear over ``edge`` at each end."""
    return max(0.0, min(1.0, min((x - low) / edge + 0.5, (high - x) / edge + 0.5)))


@law
def level_factor(p, s, sign):
    """Friction level relative to the baseline: direction_asymmetry, surface_patch, wear_polishing (1 when neutral).

    1 + a sgn(omega); 1 + change inside the angle and time window; 1 - amount (1 - exp(-slip / slip_scale)).
    """
    factor = 1.0 + p.direction_asymmetry_asymmetry * sign
    if p.surface_patch_change != 0.0:
        inside = 1.0
        if p.surface_patch_angle_high > p.surface_patch_angle_low:
            inside *= window(s.theta, p.surface_patch_angle_low, p.surface_patch_angle_high, PATCH_EDGE_RAD)
        if p.surface_patch_time_end > p.surface_patch_time_start:
            inside *= window(s.time, p.surface_patch_time_start, p.surface_patch_time_end, PATCH_EDGE_S)
        factor *= 1.0 + p.surface_patch_change * inside
    if p.wear_polishing_amount != 0.0:
        factor *= 1.0 - p.wear_polishing_amount * (1.0 - exp(-s.slip / p.wear_polishing_slip_scale))
    return max(factor, 0.05)


@law
def aged_level(p, s, d_theta, dt, length):
    """static_ageing: extra level as a share of Coulomb friction, rate * ln(1 + age / t_c), d age/dt = 1 - age |dtheta/dt| / D.

    Ageing law of resting and sliding contacts (Dieterich 1972; Rice and Ruina 1983), exact for a constant rate in a step.
    Only sliding renews a contact, the share |z| / length of the motion; bristles that merely bend keep theirs.
    """
    if p.static_ageing_rate == 0.0:
        return 0.0
    slip = abs(d_theta) * min(1.0, abs(s.z) / length) / p.static_ageing_slip_scale
    if slip < 1e-9:
        s.age += dt
    else:
        sliding = dt / slip
        s.age = sliding + (s.age - sliding) * exp(-slip)
    return p.static_ageing_rate * math.log1p(s.age / p.static_ageing_dwell)


@law
def relaxed_share(p, s, d_theta, resting):
    """stress_relaxation: share of the elastic torque lost, R log10(1 + hold / t_0), recovered over an angle.

    Log-time relaxation of filled rubber (Gent 1962).
    """
    if p.stress_relaxation_per_decade == 0.0:
        return 0.0
    if resting:
        s.relaxed = max(
            s.relaxed, p.stress_relaxation_per_decade * math.log10(1.0 + s.dwell / p.stress_relaxation_onset)
        )
    else:
        s.relaxed *= exp(-abs(d_theta) / p.stress_relaxation_recovery_angle)
    return min(s.relaxed, 0.9)


@law
def tangent_factor(p, s, d_theta, sign):
    """Presliding stiffness relative to the baseline, as a factor on the bristle's own motion (1 when neutral).

    Payne: 1 + a / (1 + (angle since reversal / angle)**2), stiffer for small amplitudes (Payne 1962, Kraus 1984);
    Mullins: 1 + a erfc((z_max - |z|) / width), rubber is stiffer where it was never sheared as far (Ogden and Roxburgh 1999).
    The factor scales dz, not sigma_0, so the torque never jumps.
    """
    factor = 1.0
    if p.payne_softening_amplitude != 0.0:
        if sign != 0.0 and sign != s.direction:
            s.since_reversal = 0.0
        strain = (s.since_reversal + 0.5 * abs(d_theta)) / p.payne_softening_angle
        s.since_reversal += abs(d_theta)
        factor += p.payne_softening_amplitude / (1.0 + strain * strain)
    if p.mullins_softening_amplitude != 0.0:
        factor += p.mullins_softening_amplitude * math.erfc((s.z_max - abs(s.z)) / p.mullins_softening_width)
    return factor
