# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The order of the chain, compiled: one ``step`` shared by the live node, replay, simulation and diagnosis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit

from lugre_steering.chain.compiled import exp, law
from lugre_steering.chain.contact import (
    aged_level,
    bristle,
    bristle_work,
    level_factor,
    relaxed_share,
    stribeck,
    tangent_factor,
)
from lugre_steering.chain.heat import advance_heat
from lugre_steering.chain.layout import BASELINE_FIELDS, ELEMENTS, OUTPUT, PARAMETERS, STATE
from lugre_steering.chain.motion import contact_increment
from lugre_steering.chain.torque import aligning, hydraulic_limits, losses, parallel_torque
from lugre_steering.recording import Array

Records = np.ndarray[Any, np.dtype[np.void]]

REST_RATE_RAD_S = 3e-4
"""Below this rate a track counts as standing (memories of dwell); noise-free creep of 0.05 deg/s is motion."""

_NORMAL_QUANTILES = (-1.38299413, -0.67448975, -0.21042839, 0.21042839, 0.67448975, 1.38299413)


@law
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


@law
def share_out(p, s):
    """Elements of the distributed contact as deflected as the one bristle, with their log-normal shares of the stiffness."""
    total = 0.0
    for i in range(ELEMENTS):
        s.elements[i] = s.z
        s.element_shares[i] = exp(p.distributed_contact_spread * _NORMAL_QUANTILES[i])
        total += s.element_shares[i]
    for i in range(ELEMENTS):
        s.element_shares[i] /= total


@law
def begin(p, s, theta):
    """State at the first sample of a recording: bristles and temperatures as the parameters say."""
    s.started = 1.0
    s.theta = theta
    s.contact_angle = theta
    s.z = p.initial_bristle
    s.z_max = abs(p.initial_bristle)
    share_out(p, s)
    s.temperature = p.rubber_temperature
    s.carcass_temperature = p.rubber_temperature
    s.air_temperature = p.air_temperature
    s.stop_loading = 1.0


@law
def distributed(s, d_theta, stiffness, g):
    """distributed_contact: parallel elements of log-normally graded stiffness, each carrying an equal share of g.

    Returns elastic torque [N m], its mean deflection [rad] and what sliding dissipates [J] (Maxwell slip; Iwan 1966).
    """
    torque, dissipated = 0.0, 0.0
    share = g / ELEMENTS
    for i in range(ELEMENTS):
        k = stiffness * s.element_shares[i]
        z = s.elements[i]
        z_next = bristle(z, d_theta, k, share)
        s.elements[i] = z_next
        dissipated += bristle_work(z, z_next, d_theta, share) - 0.5 * k * (z_next * z_next - z * z)
        torque += k * z_next
    return torque, torque / stiffness, dissipated


@law
def step(p, s, rubber, out, dt, theta_measured, omega, alpha, effects):
    """One sample of one track: angle [rad], rate [rad/s], acceleration [rad/s2] after ``dt`` [s] -> OUTPUT record.

    Order: motion -> contact -> heat -> parallel torque -> losses. All effects are neutral at zero; ``effects`` False
    (from ``has_effects``) skips them all, which spares the baseline half its time. The angle increment, not omega dt,
    drives the bristle; omega only sets the level (Stribeck) and the damping.
    """
    theta = (theta_measured - p.angle_offset_offset) / (1.0 + p.angle_scale_scale) if effects else theta_measured
    if s.started == 0.0:
        begin(p, s, theta)
    s.time += dt
    stiffness_ratio, friction_ratio, outside = ratios(rubber, p.table_low, p.table_step, s.temperature)
    if p.flash_temperature_resistance != 0.0:
        hot = s.temperature + p.flash_temperature_resistance * s.flash_power
        _, friction_ratio, outside = ratios(rubber, p.table_low, p.table_step, hot)
    s.saturated += outside
    stiffness = p.sigma_0 * stiffness_ratio
    length = p.coulomb_torque * friction_ratio / stiffness

    d_theta = contact_increment(p, s, theta, stiffness, length, effects)
    turned = theta - s.theta
    s.theta = theta
    resting = abs(omega) < REST_RATE_RAD_S
    s.dwell = s.dwell + dt if resting else 0.0
    sign = 0.0 if d_theta == 0.0 else math.copysign(1.0, d_theta)

    level, aged, faster = friction_ratio, 0.0, 1.0
    if effects:
        faster = tangent_factor(p, s, d_theta, sign)
        level *= level_factor(p, s, sign)
        aged = aged_level(p, s, d_theta, dt, length)
    g = stribeck(omega, p.static_torque, p.coulomb_torque, p.stribeck_speed, p.stribeck_exponent)
    g = level * (g + p.coulomb_torque * aged)
    z = s.z
    if effects and p.distributed_contact_spread != 0.0:
        elastic, z_next, work = distributed(s, faster * d_theta, stiffness, g)
        work = (work + 0.5 * stiffness * (z_next * z_next - z * z)) / faster
    else:
        z_next = bristle(z, faster * d_theta, stiffness, g)
        work = bristle_work(z, z_next, faster * d_theta, g) / faster
        elastic = stiffness * z_next
    sigma_1 = p.damping_factor * math.sqrt(stiffness)
    rate = omega - abs(omega) * z_next * stiffness / g
    damping = sigma_1 * rate
    viscous = p.viscous_friction_sigma_2 * omega / (1.0 + p.viscous_friction_thinning * abs(omega)) if effects else 0.0
    if effects:
        elastic *= 1.0 - relaxed_share(p, s, d_theta, resting)

    work += sigma_1 * omega * (z_next - z) + viscous * d_theta
    dissipated = work - 0.5 * stiffness / faster * (z_next * z_next - z * z)
    s.work += work
    s.heat += max(dissipated, 0.0)
    s.non_passive += min(dissipated, 0.0)
    advance_heat(p, s, max(dissipated, 0.0), dt, effects)

    s.z = z_next
    s.z_max = max(s.z_max, abs(z_next))
    s.slip += abs(d_theta)
    if sign != 0.0:
        s.direction = sign

    conservative = aligning(theta, p.aligning_torque, p.gravity_cos)
    parallel = parallel_torque(p, s, turned, omega, alpha) if effects else 0.0
    load = elastic + damping + viscous + conservative + parallel
    s.load = load
    s.torque = hydraulic_limits(p, s, load + losses(p, s, omega, turned, load), dt, resting) if effects else load

    out.torque = s.torque
    out.elastic = elastic
    out.damping = damping + viscous
    out.aligning = conservative
    out.parallel = parallel
    out.losses = s.torque - load
    out.temperature = s.temperature
    out.z = z_next


@njit(nogil=True, cache=True)
def _run(p, s, rubber, time, theta, omega, alpha, out, previous, effects):
    for i in range(time.size):
        step(p[0], s[0], rubber, out[i], time[i] - previous, theta[i], omega[i], alpha[i], effects)
        previous = time[i]


@njit(nogil=True, cache=True)
def _torque(p, s, rubber, scratch, time, theta, omega, alpha, torque, previous, effects):
    for i in range(time.size):
        step(p[0], s[0], rubber, scratch[0], time[i] - previous, theta[i], omega[i], alpha[i], effects)
        torque[i] = scratch[0].torque
        previous = time[i]


def new_state() -> Records:
    """A state record (shape (1,)) before the first sample."""
    return np.zeros(1, STATE)


def new_parameters() -> Records:
    """A parameter record (shape (1,)) with every effect neutral; the baseline fields are still to be set."""
    return np.zeros(1, PARAMETERS)


def has_effects(p: Records) -> bool:
    """Whether any effect parameter of the records differs from neutral."""
    return bool(np.any(p.view(np.float64).reshape(p.size, -1)[:, len(BASELINE_FIELDS) :]))


def run_side(
    p: Records,
    rubber: Array,
    time: Array,
    theta: Array,
    omega: Array,
    alpha: Array,
    state: Records | None = None,
    previous_time: float | None = None,
) -> Records:
    """Whole record of one track -> OUTPUT records (n,); ``time`` [s] increases.

    A given ``state`` is advanced in place; ``previous_time`` is the stamp of the sample it stands at, if it has one.
    """
    out = np.zeros(time.size, OUTPUT)
    previous = float(time[0]) if previous_time is None else previous_time
    time, theta, omega, alpha = (np.ascontiguousarray(values) for values in (time, theta, omega, alpha))  # one compiled form
    _run(p, new_state() if state is None else state, rubber, time, theta, omega, alpha, out, previous, has_effects(p))
    return out


def torque_side(p: Records, rubber: Array, time: Array, theta: Array, omega: Array, alpha: Array) -> Array:
    """Whole record of one track -> torque [N m] only (n,); the fast path of fits. Same arithmetic as ``run_side``."""
    return torque_in_phases([(-np.inf, p)], rubber, time, theta, omega, alpha)


def torque_in_phases(
    phases: Sequence[tuple[float, Records]], rubber: Array, time: Array, theta: Array, omega: Array, alpha: Array
) -> Array:
    """Like ``torque_side``, with other parameters from given times [s] on, in ascending order; the state is carried over."""
    torque, state, scratch = np.empty(time.size), new_state(), np.zeros(1, OUTPUT)
    time, theta, omega, alpha = (np.ascontiguousarray(values) for values in (time, theta, omega, alpha))
    edges = [*np.searchsorted(time, [start for start, _ in phases]), time.size]
    before = phases[0][1]
    for (_, p), a, b in zip(phases, edges, edges[1:], strict=False):
        if a == b:
            continue
        if a > 0:
            _begin_late(before, p, state)
        before = p
        part = slice(a, b)
        _torque(
            p, state, rubber, scratch, time[part], theta[part], omega[part], alpha[part], torque[part], time[max(a - 1, 0)],
            has_effects(p),
        )  # fmt: skip
    return torque


def _begin_late(before: Records, p: Records, state: Records) -> None:
    """The air takes its new temperature; effects that are new in ``p`` count time and path from now on, and elements take
    over what the bristle carries."""

    def new(field: str) -> bool:
        return bool(before[field][0] == 0.0 != p[field][0])

    state["air_temperature"] += p["air_temperature"] - before["air_temperature"]
    if new("wear_polishing_amount"):
        state["slip"] = 0.0
    if new("ambient_drift_rate"):
        state["air_temperature"] -= p["ambient_drift_rate"] * state["time"]
    if new("distributed_contact_spread"):
        share_out(p[0], state[0])
