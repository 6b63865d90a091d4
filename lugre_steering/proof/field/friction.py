# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Friction of one track turning on the ground: a field of rheological bristles with rate-and-state strength.

Every cell of the footprint is a generalised Maxwell element whose tip slides (friction with bristle dynamics, Romano, Aamo,
Aslund and Frisk, arXiv 2601.13799 and 2602.09429; here with a power of the load on the tip):

    dz/dt = w - |w| sgn(f) (|f| / y)^n,    f = k (z + sum of branches),    dm_i/dt = share_i dz/dt - m_i / tau_i

n > 1 is sharper and n < 1 rounder than an exponential. The strength y of a cell follows rubber, place, and a state that
needs some slip to follow the rate (rate and state, Ruina 1983): Stribeck weakening with an exponent of its own, and
strengthening with the logarithm of the rate. Heun steps on a fine grid.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lugre_steering.proof.field.rubber import LOWEST_DEGC, STEP_K, Ratios

Array = NDArray[np.float64]

ALWAYS = -1e9
RELAXING_S = (1.0, 8.0, 64.0)
"""Times of the slow branches that the hidden stress relaxation adds, besides the quick one that all rubber has."""
MIXING_S = 9.0
REFERENCE_RATE = 0.005
"""Rate [rad/s] from which strengthening counts."""


class Ground(NamedTuple):
    """Friction of one track (SI): what the sheet's few numbers stand for in this vehicle.

    ``sharpness`` is the power n, ``rate_strengthening`` per e-fold of the rate, ``direct_share`` the part of it that needs
    no slip, ``follow_angle`` [rad] the slip in which the rest follows. ``waves`` (waves, 3): amplitude, wave number
    [1/rad], phase of the level along the ground.
    """

    sliding_Nm: float
    static_ratio: float
    stiffness_Nm_rad: float
    stribeck_speed: float
    stribeck_exponent: float
    sharpness: float
    rate_strengthening: float
    direct_share: float
    follow_angle: float
    quick_share: float
    quick_time: float
    waves: Array
    heat_capacity_J_K: float
    heat_loss_W_K: float
    rubber_degC: float
    air_degC: float
    aligning_Nm: float


class Cells(NamedTuple):
    """Cells of a footprint, each (c,): share of strength and of stiffness."""

    strength: Array
    stiffness: Array


class Inside(NamedTuple):
    """Amplitudes and shapes of what is hidden before and in the contact, neutral by default; ``_from`` [s]: since when."""

    backlash_width: float = 0.0
    backlash_torque: float = 1.0
    backlash_from: float = ALWAYS
    linkage_compliance_compliance: float = 0.0
    linkage_compliance_torque: float = 1.0
    linkage_compliance_from: float = ALWAYS
    viscous_friction_at_6_deg_s: float = 0.0
    viscous_friction_from: float = ALWAYS
    static_ageing_amount: float = 0.0
    static_ageing_time: float = 1.0
    static_ageing_slip: float = 1.0
    static_ageing_from: float = ALWAYS
    stress_relaxation_share: float = 0.0
    stress_relaxation_from: float = ALWAYS
    surface_patch_amount: float = 0.0
    surface_patch_low: float = 0.0
    surface_patch_high: float = 1.0
    surface_patch_in_time: float = 0.0
    surface_patch_from: float = ALWAYS
    wear_polishing_amount: float = 0.0
    wear_polishing_slip: float = 1.0
    wear_polishing_from: float = ALWAYS
    direction_asymmetry_a: float = 0.0
    direction_asymmetry_angle: float = 1.0
    direction_asymmetry_from: float = ALWAYS
    carcass_heat_sink_conductance: float = 0.0
    carcass_heat_sink_capacity: float = 1.0
    carcass_heat_sink_from: float = ALWAYS
    heat_partition_lost_share: float = 0.0
    heat_partition_from: float = ALWAYS


class Turned(NamedTuple):
    """Series (n,) of one track: torque of the contact and of the kingpin [N m], mean rubber temperature [degC]."""

    friction: Array
    aligning: Array
    temperature: Array


@njit(cache=True)
def onset(t: float, start: float) -> float:
    """0 before ``start`` [s], 1 from one second later, a half cosine between."""
    share = min(max(t - start, 0.0), 1.0)
    value: float = 0.5 - 0.5 * np.cos(np.pi * share)
    return value


@njit(cache=True)
def _place(where: float, low: float, high: float) -> float:
    """1 inside a window, raised cosines of a tenth of its width at both ends."""
    edge = 0.1 * (high - low)
    inside = min((where - low) / edge, (high - where) / edge)
    inside = min(max(0.5 + 0.5 * inside, 0.0), 1.0)
    value: float = 0.5 - 0.5 * np.cos(np.pi * inside)
    return value


@njit(cache=True)
def _looked_up(table: Array, degC: float) -> float:
    place = (degC - LOWEST_DEGC) / STEP_K
    i = min(max(int(place), 0), table.size - 2)
    value: float = table[i] + min(max(place - i, 0.0), 1.0) * (table[i + 1] - table[i])
    return value


@njit(cache=True)
def _slope(rate: float, load: float, power: float) -> float:
    """dz/dt of a bristle whose tip carries ``load`` (torque over strength) while its root moves at ``rate``."""
    value: float = rate - abs(rate) * np.sign(load) * abs(load) ** power
    return value


@njit(cache=True)
def _bristles(
    rate: float, h: float, ground: Ground, cells: Cells, factor: Array, level: Array, slow_share: float, z: Array, m: Array
) -> tuple[float, float]:
    """Advance all bristles by one Heun step; their torque and the tangent stiffness dM/dtheta that they show."""
    torque, tangent = 0.0, 0.0
    branches = m.shape[0]
    for c in range(z.size):
        k = cells.stiffness[c] * ground.stiffness_Nm_rad * factor[c]
        y = cells.strength[c] * level[c]
        whole = z[c]
        for j in range(branches):
            whole += m[j, c]
        first = _slope(rate, k * whole / y, ground.sharpness)
        guess = whole + h * first * (1.0 + ground.quick_share + slow_share * (branches - 1))
        guess -= h * m[0, c] / ground.quick_time
        second = _slope(rate, k * guess / y, ground.sharpness)
        speed = 0.5 * (first + second)
        z[c] += h * speed
        whole = z[c]
        for j in range(branches):
            tau = ground.quick_time if j == 0 else RELAXING_S[j - 1]
            share = ground.quick_share if j == 0 else slow_share
            keep = np.exp(-h / tau)  # exact for a constant rate
            m[j, c] = keep * m[j, c] + share * speed * tau * (1.0 - keep)
            whole += m[j, c]
        torque += k * whole
        if rate != 0.0:
            tangent += k * (1.0 + ground.quick_share) * max(second / rate, 0.0)
        else:
            tangent += k
    return torque, tangent


@njit(cache=True)
def _strengths(
    t: float, theta: float, pace: float, state: Array, temperatures: Array, ground: Ground, rubber: Ratios, hide: Inside, level: Array,
    factor: Array,
) -> None:  # fmt: skip
    """Strength [N m, of the whole track] and stiffness factor of every cell; ``state``: weakening, strengthening, way, age, slip."""
    around = 1.0
    for w in range(ground.waves.shape[0]):
        around += ground.waves[w, 0] * np.sin(ground.waves[w, 1] * theta + ground.waves[w, 2])
    patch = _place(t if hide.surface_patch_in_time > 0.0 else theta, hide.surface_patch_low, hide.surface_patch_high)
    around *= 1.0 + hide.surface_patch_amount * onset(t, hide.surface_patch_from) * patch
    around *= 1.0 + hide.direction_asymmetry_a * onset(t, hide.direction_asymmetry_from) * state[2]
    aged = ((1.0 + state[3] / hide.static_ageing_time) ** 0.15 - 1.0) / 0.15
    around *= 1.0 + hide.static_ageing_amount * onset(t, hide.static_ageing_from) * aged
    around *= 1.0 - hide.wear_polishing_amount * (1.0 - np.exp(-((state[4] / hide.wear_polishing_slip) ** 0.7)))
    quick = ground.direct_share * np.log(1.0 + pace / REFERENCE_RATE) + (1.0 - ground.direct_share) * state[1]
    around *= 1.0 + (ground.static_ratio - 1.0) * state[0] + ground.rate_strengthening * quick
    for c in range(level.size):
        level[c] = ground.sliding_Nm * around * _looked_up(rubber.friction, temperatures[c])
        factor[c] = _looked_up(rubber.stiffness, temperatures[c])


@njit(cache=True)
def _follow(t: float, h: float, rate: float, sliding: float, state: Array, ground: Ground, hide: Inside) -> None:
    """The memories of strength advance with the slip of the step."""
    pace = abs(rate)
    share = 1.0 - np.exp(-h * pace / ground.follow_angle)
    state[0] += share * (np.exp(-((pace / ground.stribeck_speed) ** ground.stribeck_exponent)) - state[0])
    state[1] += share * (np.log(1.0 + pace / REFERENCE_RATE) - state[1])
    state[2] += h * (rate - pace * state[2]) / hide.direction_asymmetry_angle
    state[3] += h * (1.0 - state[3] * sliding / hide.static_ageing_slip)
    state[4] += h * sliding * onset(t, hide.wear_polishing_from)


@njit(cache=True)
def _warm(
    t: float, h: float, rate: float, z_before: Array, z: Array, m: Array, heat: Array, sink: float, ground: Ground, cells: Cells,
    factor: Array, hide: Inside,
) -> tuple[float, float]:  # fmt: skip
    """Heat of sliding tips into every cell, mixing, cooling; returns the mean slip rate [rad/s] and the carcass's temperature."""
    mean = 0.0
    for c in range(heat.size):
        mean += heat[c] / heat.size
    lost = hide.heat_partition_lost_share * onset(t, hide.heat_partition_from)
    pull = hide.carcass_heat_sink_conductance * onset(t, hide.carcass_heat_sink_from)
    slip = 0.0
    for c in range(heat.size):
        whole = z[c]
        for j in range(m.shape[0]):
            whole += m[j, c]
        tip = rate - (z[c] - z_before[c]) / h
        power = max(cells.stiffness[c] * ground.stiffness_Nm_rad * factor[c] * whole * tip, 0.0)
        slip += cells.strength[c] * abs(tip)
        above = heat[c] - ground.air_degC
        cooling = ground.heat_loss_W_K * above * (abs(above) / 20.0 + 0.05) ** 0.2  # free convection
        gain = power * heat.size * (1.0 - lost) - cooling - pull * (mean - sink)
        heat[c] += h * (gain / ground.heat_capacity_J_K + (mean - heat[c]) / MIXING_S)
    if pull > 0.0:
        sink += h * pull * (mean - sink) / hide.carcass_heat_sink_capacity
    return slip, sink


@njit(cache=True)
def _lost(torque: float, t: float, hide: Inside) -> tuple[float, float]:
    """Angle lost between sensor and track [rad] under a torque, and its slope [rad/(N m)]."""
    width = hide.backlash_width * onset(t, hide.backlash_from)
    lost = width / np.pi * np.arctan(torque / hide.backlash_torque)
    slope = width / np.pi / hide.backlash_torque / (1.0 + (torque / hide.backlash_torque) ** 2)
    compliance = hide.linkage_compliance_compliance * onset(t, hide.linkage_compliance_from)
    bent = np.sqrt(1.0 + abs(torque) / hide.linkage_compliance_torque)
    lost += compliance * torque / bent
    slope += compliance * (1.0 + 0.5 * abs(torque) / hide.linkage_compliance_torque) / bent**3
    return lost, slope


@njit(cache=True)
def turn_track(
    angle: Array, h: float, ground: Ground, rubber: Ratios, cells: Cells, hide: Inside, level_factor: Array, stiffness_factor: Array
) -> Any:  # Turned, compiled
    """One track driven by its measured angle (n,) [rad] on a grid of ``h`` [s].

    ``level_factor`` and ``stiffness_factor`` (n,): what an unlisted law makes of strength and stiffness, 1 for none.
    """
    n, count = angle.size, cells.strength.size
    friction, aligning, temperature = np.zeros(n), np.zeros(n), np.full(n, ground.rubber_degC)
    z, before, m = np.zeros(count), np.zeros(count), np.zeros((1 + len(RELAXING_S), count))
    heat, level, factor = np.full(count, ground.rubber_degC), np.empty(count), np.empty(count)
    state = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    sink, theta, torque, tangent = ground.rubber_degC, angle[0], 0.0, ground.stiffness_Nm_rad
    gives = hide.backlash_width > 0.0 or hide.linkage_compliance_compliance > 0.0
    aligning[0] = ground.aligning_Nm * np.sin(theta)
    for i in range(1, n):
        t = i * h
        rate = (angle[i] - angle[i - 1]) / h
        if gives:  # the torque's own change takes a part of the motion; a slow pull keeps the sum exact
            lost, slope = _lost(torque, t, hide)
            rate = (rate + (angle[i - 1] - lost - theta) / 0.02) / (1.0 + slope * tangent)
        theta += h * rate
        _strengths(t, theta, abs(rate), state, heat, ground, rubber, hide, level, factor)
        for c in range(count):
            level[c] *= level_factor[i]
            factor[c] *= stiffness_factor[i]
            before[c] = z[c]
        slow = hide.stress_relaxation_share * onset(t, hide.stress_relaxation_from)
        part, tangent = _bristles(rate, h, ground, cells, factor, level, slow, z, m)
        thick = hide.viscous_friction_at_6_deg_s * onset(t, hide.viscous_friction_from)
        part += thick * np.sign(rate) * (abs(rate) / 0.10472) ** 0.8
        friction[i], aligning[i] = part, ground.aligning_Nm * np.sin(theta)
        torque = part + aligning[i]
        slip, sink = _warm(t, h, rate, before, z, m, heat, sink, ground, cells, factor, hide)
        _follow(t, h, rate, slip, state, ground, hide)
        mean = 0.0
        for c in range(count):
            mean += heat[c] / count
        temperature[i] = mean
    return Turned(friction, aligning, temperature)


class Standing(NamedTuple):
    """A track between two steps of ``turn_step``: bristles, branches, heat, memories (``state``), all cells in their places."""

    z: Array
    m: Array
    heat: Array
    state: Array
    level: Array
    factor: Array


def standing(cells: Cells, ground: Ground) -> Standing:
    """A track that has not turned yet."""
    count = cells.strength.size
    return Standing(
        np.zeros(count), np.zeros((1 + len(RELAXING_S), count)), np.full(count, ground.rubber_degC),
        np.array([1.0, 0.0, 0.0, 0.0, 0.0]), np.empty(count), np.empty(count),
    )  # fmt: skip


@njit(cache=True)
def turn_step(theta: float, rate: float, h: float, track: Standing, ground: Ground, rubber: Ratios, cells: Cells, hide: Inside) -> float:
    """Torque [N m] of one track, contact and kingpin, after a step of ``h`` [s] to the angle [rad] at that rate; nothing hidden in it."""
    _strengths(0.0, theta, abs(rate), track.state, track.heat, ground, rubber, hide, track.level, track.factor)
    before = track.z.copy()
    part, _ = _bristles(rate, h, ground, cells, track.factor, track.level, 0.0, track.z, track.m)
    slip, _ = _warm(0.0, h, rate, before, track.z, track.m, track.heat, ground.rubber_degC, ground, cells, track.factor, hide)
    _follow(0.0, h, rate, slip, track.state, ground, hide)
    value: float = part + ground.aligning_Nm * np.sin(theta)
    return value
