# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Torques parallel to the contact, and losses between the contact and the cylinders."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import exp, law

STOP_TRAVEL_RAD = 0.002
"""Travel over which an end stop changes between its loading and unloading branch."""
SIGN_RATE_RAD_S = 2e-3
"""Rate at which losses that oppose motion are at 76 % of their level: an odd, smooth sign function."""
SEAL_TRAVEL_RAD = 2e-3
"""Travel in which a cylinder seal changes sides."""


@law
def aligning(theta: float, amplitude: float, gravity_cos: float) -> float:
    """Conservative torque of the angle [N m]: M_a = F_z e sin(theta_k) sin(theta) (Reimpell; R), plus gravity."""
    return amplitude * math.sin(theta) + gravity_cos * math.cos(theta)


@law
def parallel_torque(p, s, d_theta, omega, alpha):
    """Effects that act beside the contact [N m]: end_stop, soil_shear, yaw_inertia, kingpin_jacking, slope_bias."""
    torque = p.slope_bias_torque / p.sides + p.yaw_inertia_inertia * alpha
    if p.kingpin_jacking_amplitude != 0.0 or p.kingpin_jacking_second_harmonic != 0.0 or p.kingpin_jacking_even != 0.0:
        sine, cosine = math.sin(s.theta), math.cos(s.theta)
        torque += sine * (p.kingpin_jacking_amplitude + 2.0 * p.kingpin_jacking_second_harmonic * cosine)
        torque += sine * sine * p.kingpin_jacking_even
    if p.end_stop_stiffness != 0.0 or p.end_stop_cubic_stiffness != 0.0:
        torque += end_stop(p, s, d_theta, omega)
    if p.soil_shear_torque != 0.0:
        torque += soil_shear(p, s)
    return torque


@law
def end_stop(p, s, d_theta, omega):
    """Elastic limit device: sgn(theta) (k1 x + k3 x**3 + c x'), x = |theta| - engage_angle > 0; less by ``loss``.

    The damping c acts while the stop is driven in (x' > 0). ``shift`` moves the knee of negative angles only.
    Compare the translational hard stop of multibody libraries; hysteresis as a share of the loading branch (rubber
    buffers: 0.15 ... 0.4).
    """
    engage = p.end_stop_engage_angle + (p.end_stop_shift if s.theta < 0.0 else 0.0)
    x = abs(s.theta) - engage
    if x <= 0.0:
        s.stop_loading = 1.0
        return 0.0
    travel = d_theta if s.theta > 0.0 else -d_theta
    s.stop_loading = max(0.0, min(1.0, s.stop_loading + travel / STOP_TRAVEL_RAD))
    torque = p.end_stop_stiffness * x + p.end_stop_cubic_stiffness * x * x * x
    torque *= 1.0 - p.end_stop_loss * (1.0 - s.stop_loading)
    torque += p.end_stop_damping * max(0.0, math.copysign(omega, omega * s.theta))
    return math.copysign(torque, s.theta)


@law
def soil_shear(p, s):
    """Berm of soft ground on both sides: pushed outward when the track goes farther than before, slack between.

    torque (1 + growth b) (1 - (b - x) / span) within ``span`` of the farthest push b, full at fresh ground (Wong).
    """
    s.berm_left = max(s.berm_left, s.theta)
    s.berm_right = max(s.berm_right, -s.theta)
    left = max(0.0, 1.0 - (s.berm_left - s.theta) / p.soil_shear_span) * (1.0 + p.soil_shear_growth * s.berm_left)
    right = max(0.0, 1.0 - (s.berm_right + s.theta) / p.soil_shear_span) * (1.0 + p.soil_shear_growth * s.berm_right)
    onset_left = min(1.0, s.berm_left / p.soil_shear_span)
    onset_right = min(1.0, s.berm_right / p.soil_shear_span)
    return p.soil_shear_torque * (left * onset_left - right * onset_right)


@law
def losses(p, s, omega, d_theta, load):
    """Torque lost between cylinder pressures and steering axis [N m]; each entry is zero when neutral.

    cylinder_friction: (coulomb + load_share |load|) times a direction function, half of it (``holding``) kept at rest
    by the seal, raised by ``breakaway`` at low speed (Stribeck), plus viscous omega; sign changes over ``rate_scale``.
    line_loss: b omega and c omega |omega|. back_pressure: opposes motion, vanishes at rest, grows with the return flow.
    """
    torque = p.cylinder_friction_viscous * omega + p.line_loss_linear_b * omega
    torque += p.line_loss_quadratic_c * omega * abs(omega)
    if p.cylinder_friction_coulomb != 0.0 or p.cylinder_friction_load_share != 0.0 or p.back_pressure_torque != 0.0:
        moving = math.tanh(omega / (SIGN_RATE_RAD_S + p.cylinder_friction_rate_scale))
        s.seal = max(-1.0, min(1.0, s.seal + d_theta / SEAL_TRAVEL_RAD))
        level = p.cylinder_friction_coulomb / p.sides + p.cylinder_friction_load_share * abs(load)
        bump = 1.0 + p.cylinder_friction_breakaway * exp(-((omega / 0.02) ** 2))
        torque += level * bump * (p.cylinder_friction_holding * s.seal + (1.0 - p.cylinder_friction_holding) * moving)
        returned = math.tanh(omega / (SIGN_RATE_RAD_S + p.back_pressure_rate_scale))
        torque += p.back_pressure_torque / p.sides * returned * (1.0 + p.back_pressure_flow * abs(omega))
    return torque


@law
def hydraulic_limits(p, s, torque, dt, resting):
    """What the hydraulics can hold: relief_saturation clips at a ceiling, trapped_pressure leaks away at standstill.

    The ceiling is a pressure, so the torque follows the arms: 1 + arm_slope u + arm_curvature u^2, u the angle toward the push.
    trapped: torque (1 - share leaked); leaked goes to 1 with tau at rest and back to 0 with ``refill_time`` in motion.
    """
    if p.relief_saturation_ceiling != 0.0:
        toward = s.theta if torque > 0.0 else -s.theta
        arm = 1.0 + toward * (p.relief_saturation_arm_slope + toward * p.relief_saturation_arm_curvature)
        limit = p.relief_saturation_ceiling / p.sides * max(arm, 0.1)
        torque = max(-limit, min(limit, torque))
    if p.trapped_pressure_share != 0.0:
        if resting:
            s.leaked += (1.0 - s.leaked) * (1.0 - exp(-dt / p.trapped_pressure_time_constant))
        elif p.trapped_pressure_refill_time > 0.0:
            s.leaked *= exp(-dt / p.trapped_pressure_refill_time)
        else:
            s.leaked = 0.0
        torque *= 1.0 - p.trapped_pressure_share * s.leaked
    return torque
