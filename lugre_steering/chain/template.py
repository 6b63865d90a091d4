# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The order of the chain: one step of one track as text, with a slot for each place where an effect may act.

``compose`` fills the slots. A slot is a line ``<name>``; its indentation is that of what replaces it. ``<name> else:`` takes
the place of the block below it where an effect acts.
"""

from __future__ import annotations

STEP = '''\
def begin(p, s, theta):
    """State at the first sample of a recording: bristles and temperatures as the parameters say."""
    s.started = 1.0
    s.theta = theta
    s.contact_angle = theta
    s.z = p.initial_bristle
    s.z_max = abs(p.initial_bristle)
    s.temperature = p.rubber_temperature
    s.air_temperature = p.air_temperature
    <memory>


<wind_up_laws>
def step(p, s, rubber, out, dt, theta_measured, omega, alpha, effects):
    """One sample of one track: angle [rad], rate [rad/s], acceleration [rad/s2] after ``dt`` [s] -> OUTPUT record.

    Order: motion -> contact -> heat -> parallel torque -> losses. All effects are neutral at zero; ``effects`` has a
    bit for each hook where one acts (see ``step.acting``). The angle increment, not omega dt, drives the bristle; omega only
    sets the level (Stribeck) and the damping.
    """
    theta = theta_measured
    <angle>
    if s.started == 0.0:
        begin(p, s, theta)
    s.time += dt
    hotter = 0.0
    <friction_temperature>
    if hotter == 0.0:  # a row of the table as a whole: a second look at it after the first would take a quarter of the step
        stiffness_ratio, friction_ratio, outside = ratios(rubber, p.table_low, p.table_step, s.temperature)
    else:
        stiffness_ratio, _, _ = ratios(rubber, p.table_low, p.table_step, s.temperature)
        _, friction_ratio, outside = ratios(rubber, p.table_low, p.table_step, s.temperature + hotter)
    s.saturated += outside
    stiffness = p.sigma_0 * stiffness_ratio
    length = p.coulomb_torque * friction_ratio / stiffness

    <wind_up> else:
        d_theta = theta - s.contact_angle
        s.contact_angle = theta
    turned = theta - s.theta
    s.theta = theta
    resting = abs(omega) < REST_RATE_RAD_S * p.angle_unit
    s.dwell = s.dwell + dt if resting else 0.0
    sign = 0.0 if d_theta == 0.0 else math.copysign(1.0, d_theta)

    faster = 1.0
    <tangent>
    factor = 1.0
    <level>
    aged = 0.0
    <ageing>
    g = stribeck(omega, p.static_torque, p.coulomb_torque, p.stribeck_speed, p.stribeck_exponent)
    g = friction_ratio * max(factor, LEAST_LEVEL) * (g + p.coulomb_torque * aged)
    z = s.z
    drawn = faster * d_theta
    <contact> else:
        z_next = bristle(z, drawn, stiffness, g)
        work = bristle_work(z, z_next, drawn, g) * (1.0 / faster)
        elastic = stiffness * z_next
    sigma_1 = p.damping_factor * math.sqrt(stiffness)
    damping = sigma_1 * (omega - abs(omega) * z_next * stiffness / g)
    viscous = 0.0
    <viscous>
    <elastic>

    work += sigma_1 * omega * (z_next - z) + viscous * d_theta
    dissipated = work - 0.5 * stiffness / faster * (z_next * z_next - z * z)
    s.work += work
    s.heat += max(dissipated, 0.0)
    s.non_passive += min(dissipated, 0.0)
    energy = max(dissipated, 0.0)
    <heat_in>
    air = s.air_temperature
    <air>
    s.temperature = heat(s.temperature, energy, dt, p.heat_capacity, p.cooling, air)
    <heat_out>

    s.z = z_next
    s.z_max = max(s.z_max, abs(z_next))
    if sign != 0.0:
        s.direction = sign

    conservative = aligning(theta, p.aligning_torque, p.gravity_cos)
    parallel = 0.0
    <torque>
    load = elastic + damping + viscous + conservative + parallel
    s.load = load
    lost = 0.0
    <loss>
    torque = load + lost
    <limit>
    s.torque = torque

    out.torque = torque
    out.elastic = elastic
    out.damping = damping + viscous
    out.aligning = conservative
    out.parallel = parallel
    out.losses = torque - load
    out.temperature = s.temperature
    out.z = z_next
'''

WIND_UP = '''\
def wind_up(p, torque):
    """Angle [rad] lost between sensor and track under ``torque`` [N m], and its slope [rad/(N m)]."""
    angle, slope = 0.0, 0.0
    <wind_up>
    return angle, slope


def newton(error, slope, tangent):
    """The step of Newton's method; on flanks that are without slope nothing waits for the tangent."""
    if slope == 0.0:
        return error
    return error / (1.0 + slope * tangent)


def wound_increment(p, s, theta, stiffness, length):
    """Angle [rad] by which the contact turns when the corrected steering angle reaches ``theta``.

    contact + wind_up(M) = theta, solved for the contact with the tangent stiffness of the bristle (so stable for any
    compliance). The torque of the last step enters exactly, so errors do not add up. ``length`` is g / sigma_0 [rad].
    """
    away = theta - s.contact_angle - wind_up(p, s.load)[0]
    tangent = stiffness * max(0.05, 1.0 - math.copysign(s.z, s.z * away) / length)
    # Newton kept inside a bracket: the left side grows with the step, at least as fast as the step itself.
    low, high = min(0.0, away), max(0.0, away)
    d_theta = newton(away, wind_up(p, s.load)[1], tangent)
    for _ in range(WIND_UP_ITERATIONS):
        lost, slope = wind_up(p, s.load + tangent * d_theta)
        error = s.contact_angle + d_theta + lost - theta
        if error > 0.0:
            high = d_theta
        else:
            low = d_theta
        d_theta -= newton(error, slope, tangent)
        if not low <= d_theta <= high:
            d_theta = 0.5 * (low + high)
        if abs(error) < 1e-10:
            break
    return d_theta


'''

SENSED = '''\
def arm_factor(p, theta):
    """True moment arm over that of the drawing, at an angle [rad]."""
    factor = 1.0
    <arm>
    return factor


def line_error(q, elapsed):
    """What the sensor of a line reads too much [Pa], ``elapsed`` [s] after the start."""
    error = 0.0
    <line>
    return error
'''

BESIDE = '''\
def beside(p, theta, omega, alpha):
    """Torque [N m] of those effects that only add to that of the contact: it needs no step, and no memory."""
    parallel, viscous = 0.0, 0.0
    <beside>
    return parallel + viscous
'''
