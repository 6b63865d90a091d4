# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The order of the chain, compiled: one ``advance`` shared by the live node, replay, simulation and diagnosis."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from lugre_steering.chain.contact import (
    aged_level,
    bristle,
    bristle_work,
    level_factor,
    relaxed_share,
    stiffness_factor,
    stribeck,
)
from lugre_steering.chain.heat import advance_heat
from lugre_steering.chain.layout import ELEMENTS, OUTPUT, PARAMETERS, STATE
from lugre_steering.chain.motion import contact_increment
from lugre_steering.chain.torque import aligning, hydraulic_limits, losses, parallel_torque
from lugre_steering.recording import Array

Records = np.ndarray[Any, np.dtype[np.void]]

_NORMAL_QUANTILES = (-1.38299413, -0.67448975, -0.21042839, 0.21042839, 0.67448975, 1.38299413)


@njit(fastmath={"contract"})
def ratios(rubber, low, step, temperature):
    """Stiffness and friction ratios at a temperature [degC], linear between rows, clamped (and told) outside."""
    position = (temperature - low) / step
    last = rubber.shape[0] - 2
    index = int(position) if position > 0.0 else 0
    if index > last:
        index = last
    weight = position - index
    outside = weight < 0.0 or weight > 1.0
    weight = max(0.0, min(1.0, weight))
    stiffness = rubber[index, 0] + weight * (rubber[index + 1, 0] - rubber[index, 0])
    friction = rubber[index, 1] + weight * (rubber[index + 1, 1] - rubber[index, 1])
    return stiffness, friction, outside


@njit
def begin(p, s, theta):
    """State at the first sample of a recording: bristles and temperatures as the parameters say."""
    s.started = 1.0
    s.theta = theta
    s.link_angle = theta
    s.z = p.initial_bristle
    s.z_reversal = p.initial_bristle
    s.z_max = abs(p.initial_bristle)
    for i in range(ELEMENTS):
        s.elements[i] = p.initial_bristle
    s.temperature = p.rubber_temperature
    s.carcass_temperature = p.rubber_temperature
    s.air_temperature = p.air_temperature
    s.stop_loading = 1.0


@njit
def distributed(p, s, d_theta, stiffness, g):
    """distributed_contact: parallel elements of log-normally graded stiffness, each carrying an equal share of g.

    Returns elastic torque [N m], its mean deflection [rad] and its work [J] (Maxwell slip; Iwan 1966).
    """
    total = 0.0
    for q in _NORMAL_QUANTILES:
        total += math.exp(p.distributed_contact_spread * q)
    torque, work = 0.0, 0.0
    share = g / ELEMENTS
    for i in range(ELEMENTS):
        k = stiffness * math.exp(p.distributed_contact_spread * _NORMAL_QUANTILES[i]) / total
        z = s.elements[i]
        s.elements[i] = bristle(z, d_theta, k, share)
        work += bristle_work(z, s.elements[i], d_theta, share) - 0.5 * k * (s.elements[i] ** 2 - z * z)
        torque += k * s.elements[i]
    z_next = torque / stiffness
    return torque, z_next, work + 0.5 * stiffness * (z_next * z_next - s.z * s.z)


@njit(fastmath={"contract"})
def advance(p, s, rubber, out, dt, theta_measured, omega, alpha):
    """One sample of one track: angle [rad], rate [rad/s], acceleration [rad/s2] after ``dt`` [s] -> OUTPUT record.

    Order: motion -> contact -> heat -> parallel torque -> losses. All effects are neutral at zero. The angle increment,
    not omega dt, drives the bristle; omega only sets the level (Stribeck) and the damping.
    """
    theta = (theta_measured - p.angle_offset_offset) / (1.0 + p.angle_scale_scale)
    if s.started == 0.0:
        begin(p, s, theta)
    s.time += dt
    stiffness_ratio, friction_ratio, outside = ratios(
        rubber, p.table_low, p.table_step, s.temperature + p.flash_temperature_resistance * s.flash_power
    )
    s.saturated += outside
    stiffness = p.sigma_0 * stiffness_ratio
    length = p.coulomb_torque * friction_ratio / stiffness

    d_theta = contact_increment(p, s, theta, stiffness, length)
    turned = theta - s.theta
    s.theta = theta
    sign = 0.0 if d_theta == 0.0 else math.copysign(1.0, d_theta)

    stiffness *= stiffness_factor(p, s, sign, length)
    level = friction_ratio * level_factor(p, s, sign)
    g = stribeck(omega, p.static_torque * level, p.coulomb_torque * level, p.stribeck_speed, p.stribeck_exponent)
    g += p.coulomb_torque * level * aged_level(p, s, d_theta, dt)
    z = s.z
    if p.distributed_contact_spread == 0.0:
        z_next = bristle(z, d_theta, stiffness, g)
        work = bristle_work(z, z_next, d_theta, g)
        elastic = stiffness * z_next
    else:
        elastic, z_next, work = distributed(p, s, d_theta, stiffness, g)
    sigma_1 = p.damping_factor * math.sqrt(stiffness)
    rate = omega - abs(omega) * z_next * stiffness / g
    damping = sigma_1 * rate
    viscous = p.viscous_friction_sigma_2 * omega
    elastic *= 1.0 - relaxed_share(p, s, d_theta, dt, length)

    work += sigma_1 * omega * (z_next - z) + viscous * d_theta
    dissipated = work - 0.5 * stiffness * (z_next * z_next - z * z)
    s.work += work
    s.heat += max(dissipated, 0.0)
    s.non_passive += min(dissipated, 0.0)
    advance_heat(p, s, max(dissipated, 0.0), dt)

    s.z = z_next
    s.z_max = max(s.z_max, abs(z_next))
    s.slip += abs(d_theta)
    s.dwell = s.dwell + dt if turned == 0.0 else 0.0
    if sign != 0.0:
        s.direction = sign

    conservative = aligning(theta, p.aligning_torque, p.gravity_cos)
    parallel = parallel_torque(p, s, turned, alpha)
    load = elastic + damping + viscous + conservative + parallel
    lost = losses(p, s, omega, turned, load)
    s.torque = hydraulic_limits(p, s, load + lost)

    out.torque = s.torque
    out.elastic = elastic
    out.damping = damping + viscous
    out.aligning = conservative
    out.parallel = parallel
    out.losses = s.torque - load
    out.temperature = s.temperature
    out.z = z_next


@njit(nogil=True, cache=True)
def _run(p, s, rubber, time, theta, omega, alpha, out):
    previous = time[0]
    for i in range(time.size):
        advance(p[0], s[0], rubber, out[i], time[i] - previous, theta[i], omega[i], alpha[i])
        previous = time[i]


@njit(nogil=True, cache=True)
def _torque(p, s, rubber, scratch, time, theta, omega, alpha, torque):
    previous = time[0]
    for i in range(time.size):
        advance(p[0], s[0], rubber, scratch[0], time[i] - previous, theta[i], omega[i], alpha[i])
        torque[i] = scratch[0].torque
        previous = time[i]


def new_state() -> Records:
    """A state record (shape (1,)) before the first sample."""
    return np.zeros(1, STATE)


def new_parameters() -> Records:
    """A parameter record (shape (1,)) with every effect neutral; the baseline fields are still to be set."""
    return np.zeros(1, PARAMETERS)


def run_side(
    p: Records, rubber: Array, time: Array, theta: Array, omega: Array, alpha: Array, state: Records | None = None
) -> Records:
    """Whole record of one track -> OUTPUT records (n,). ``time`` [s] increases; a given ``state`` is advanced."""
    out = np.zeros(time.size, OUTPUT)
    _run(p, new_state() if state is None else state, rubber, time, theta, omega, alpha, out)
    return out


def torque_side(p: Records, rubber: Array, time: Array, theta: Array, omega: Array, alpha: Array) -> Array:
    """Whole record of one track -> torque [N m] only (n,); the fast path of fits. Same arithmetic as ``run_side``."""
    torque = np.empty(time.size)
    _torque(p, new_state(), rubber, np.zeros(1, OUTPUT), time, theta, omega, alpha, torque)
    return torque
