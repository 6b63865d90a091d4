# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Contact of one track, patch by patch: local bristles, local temperature, and the physics hidden in them.

Each roller's footprint is split into four patches with their own load, radius, bristle and temperature. A patch
follows LuGre (Canudas de Wit et al. 1995), integrated with the implicit midpoint rule on a 1 ms grid; play and
elasticity between sensor and track are solved with it in each step.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lugre_steering.chain.compiled import njit
from lugre_steering.proof.rubber import LOWEST_DEGC, STEP_K, RubberTable
from lugre_steering.proof.vehicle_draw import Sheet, TrueVehicle

Array = NDArray[np.float64]

MIXING_S = 6.0  # local temperatures relax to the track's mean: the belt turns, lugs conduct
NATURAL_SPREAD = 0.04  # no two lugs are equally stiff: relative standard deviation that every drawn vehicle has
GATE_S = 1.0  # effects that begin late begin over this time
_CHAIN_S = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)  # Maxwell chain: equal shares at equal log spacing give a log-time decay
_SINK_NODES = 3


class Patches(NamedTuple):
    """Patches of one track, each (p,): share of the friction torque, share of heat, relative deviation of stiffness."""

    torque_share: Array
    natural: Array
    graded: Array


class TrackSeries(NamedTuple):
    """Series (n,) of one track: contact and aligning torque [N m], contact angle [rad], mean temperature [degC]."""

    friction: Array
    aligning: Array
    angle: Array
    temperature: Array


class HiddenContact(NamedTuple):
    """Amplitudes, shapes and start times of what is hidden before and in the contact; neutral by default.

    Units: rad, s, N m, K; amounts are relative. ``*_from`` is the time at which an effect begins.
    """

    backlash_width: float = 0.0
    backlash_soft_torque: float = 1.0
    backlash_from: float = -1e9
    linkage_compliance_compliance: float = 0.0
    linkage_compliance_stiffening_torque: float = 1.0
    linkage_compliance_from: float = -1e9
    viscous_friction_sigma2: float = 0.0
    viscous_friction_bend_speed: float = 1.0
    viscous_friction_from: float = -1e9
    static_ageing_rate: float = 0.0
    static_ageing_time: float = 1.0
    static_ageing_slip_scale: float = 1.0
    static_ageing_from: float = -1e9
    stress_relaxation_share_per_decade: float = 0.0
    stress_relaxation_erase_angle: float = 1.0
    stress_relaxation_from: float = -1e9
    payne_softening_amount: float = 0.0
    payne_softening_angle: float = 1.0
    payne_softening_from: float = -1e9
    mullins_softening_amount: float = 0.0
    mullins_softening_width: float = 1.0
    mullins_softening_from: float = -1e9
    surface_patch_amount: float = 0.0
    surface_patch_low: float = 0.0
    surface_patch_high: float = 0.0
    surface_patch_edge: float = 1.0
    surface_patch_in_time: float = 0.0
    surface_patch_from: float = -1e9
    wear_polishing_amount: float = 0.0
    wear_polishing_slip_scale: float = 1.0
    wear_polishing_from: float = -1e9
    direction_asymmetry_a: float = 0.0
    direction_asymmetry_turn_angle: float = 1.0
    direction_asymmetry_from: float = -1e9
    distributed_contact_spread: float = 0.0
    distributed_contact_from: float = -1e9
    carcass_heat_sink_conductance: float = 0.0
    carcass_heat_sink_capacity: float = 1.0
    carcass_heat_sink_from: float = -1e9
    heat_partition_lost_share: float = 0.0
    heat_partition_from: float = -1e9
    flash_temperature_rise: float = 0.0
    flash_temperature_time: float = 1.0
    flash_temperature_from: float = -1e9
    ambient_drift_rise: float = 0.0
    ambient_drift_time: float = 1.0
    ambient_drift_from: float = -1e9


class Cells(NamedTuple):
    """Arrays of a running track: bristle deflection before and after a step [rad], temperature [degC], friction level [N m]
    and stiffness [N m/rad] per patch (p,); Maxwell elements (6,), and temperatures from belt to carcass [degC] (3,)."""

    z: Array
    z_next: Array
    T: Array
    level: Array
    stiffness: Array
    chain: Array
    sink: Array


class Memory(NamedTuple):
    """What a track has been through: contact angle [rad] and its rate [rad/s], the angle of the last turning point and
    the way since; dwell [s], slip [rad], direction of the lugs, present and largest deflection [rad], flash and mean
    temperature [K, degC]."""

    theta: float
    rate: float
    turned_at: float
    way: float
    rest: float
    slipped: float
    lugs: float
    stretch: float
    largest: float
    flash: float
    mean_T: float


class Moment(NamedTuple):
    """What stays the same within a step of ``h`` from angle ``theta``, whatever the rate of the contact."""

    h: float
    theta: float
    speed_up: float
    kept: float
    elastic_before: float
    lossy: float
    viscous: float
    width: float
    compliance: float


def patches(sheet: Sheet, rng: np.random.Generator) -> Patches:
    """Quarter the footprint of every roller; each quarter sits at the centroid of its share of the ground pressure.

    Pressure is ``cos^n`` along a roller pitch and linear from the centreline to the edge. The torque share is load x
    radius, scaled per roller so that the track's friction torque stays ``mu sum F_i r_i`` with the roller centres.
    Patch stiffness is in proportion to that share (all patches saturate at one angle) up to a small natural deviation;
    ``graded`` is the deviation, of unit standard deviation, that the hidden effect ``distributed_contact`` scales.
    """
    pitch = float(np.min(np.diff(np.sort(sheet.roller_x_m))))
    ahead = np.linspace(0.0, 0.5 * pitch, 400)
    pressure = np.cos(np.pi * ahead / pitch) ** sheet.pressure_exponent
    along = float(np.sum(ahead * pressure) / np.sum(pressure))
    across = sheet.track_width_m / 6.0
    share = []
    for roller_x, load in zip(sheet.roller_x_m, sheet.roller_load_N, strict=True):
        x, y = roller_x + along * np.array([-1, -1, 1, 1]), sheet.hinge_offset_m + across * np.array([-1, 1, -1, 1])
        radius = np.hypot(x, y)
        share.append(load * np.hypot(roller_x, sheet.hinge_offset_m) * radius / radius.sum())
    weight = np.concatenate(share)
    weight /= weight.sum()
    return Patches(weight, *(_unit_deviation(weight, rng.permutation(_grades(weight.size))) for _ in range(2)))


def _grades(n: int) -> Array:
    """Evenly graded values in random order: the same spread whatever the draw."""
    return np.linspace(-1.0, 1.0, n)


def _unit_deviation(weight: Array, value: Array) -> Array:
    value = value - np.sum(weight * value)
    return np.asarray(value / np.sqrt(np.sum(weight * value**2)))


@njit(cache=True)
def _gate(t: float, start: float) -> float:
    x = min(max((t - start) / GATE_S, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@njit(cache=True)
def _bristles(rate: float, h: float, speed_up: float, stiffness: Array, level: Array, z: Array, out: Array) -> float:
    """Implicit midpoint step of ``dz/dt = k (w - s |w| z / g)`` for all patches; the elastic torque at its end."""
    torque = 0.0
    for p in range(z.size):
        a = 0.5 * h * speed_up * stiffness[p] * abs(rate) / level[p]
        out[p] = (z[p] * (1.0 - a) + h * speed_up * rate) / (1.0 + a)
        torque += stiffness[p] * out[p]
    return torque


@njit(cache=True)
def _wind_up(torque: float, width: float, soft: float, compliance: float, stiffening: float) -> float:
    """Angle lost between sensor and track [rad]: play with soft walls plus a spring that stiffens with load."""
    lost: float = 0.5 * width * np.tanh(torque / soft) + compliance * stiffening * np.arcsinh(torque / stiffening)
    return lost


@njit(cache=True)
def _level_factor(t: float, m: Memory, hidden: HiddenContact) -> float:
    """What direction, place, wear and dwell make of the friction level of all patches."""
    factor: float = 1.0 + hidden.direction_asymmetry_a * _gate(t, hidden.direction_asymmetry_from) * m.lugs
    where = t if hidden.surface_patch_in_time > 0.0 else m.theta
    window = 0.5 * (
        np.tanh((where - hidden.surface_patch_low) / hidden.surface_patch_edge)
        - np.tanh((where - hidden.surface_patch_high) / hidden.surface_patch_edge)
    )
    factor *= 1.0 + hidden.surface_patch_amount * _gate(t, hidden.surface_patch_from) * window
    worn = 1.0 - 1.0 / (1.0 + m.slipped / hidden.wear_polishing_slip_scale)
    factor *= 1.0 - hidden.wear_polishing_amount * worn
    aged = np.log(1.0 + m.rest / hidden.static_ageing_time)
    factor *= 1.0 + hidden.static_ageing_rate * _gate(t, hidden.static_ageing_from) * aged
    return factor


@njit(cache=True)
def _of_table(table: Array, temperature: float) -> float:
    """Value of a row of the rubber table, linear between its nodes."""
    place = (temperature - LOWEST_DEGC) / STEP_K
    i = min(max(int(place), 0), table.size - 2)
    value: float = table[i] + (place - i) * (table[i + 1] - table[i])
    return value


@njit(cache=True)
def _sliding(rate: float, v: TrueVehicle) -> float:
    """Stribeck curve of the whole track at its reference temperature [N m]."""
    drop = (abs(rate) / v.stribeck_speed_rad_s) ** v.stribeck_exponent
    curve: float = v.coulomb_torque_Nm + (v.static_torque_Nm - v.coulomb_torque_Nm) * np.exp(-drop)
    return curve


@njit(cache=True)
def _set_levels(curve: float, hot: float, rubber: RubberTable, patch: Patches, cells: Cells) -> None:
    """Friction level of each patch, from the state at the start of the step; ``hot``: the flash temperature [K]."""
    for p in range(cells.level.size):
        cells.level[p] = patch.torque_share[p] * curve * _of_table(rubber.loss_ratio, cells.T[p] + hot)


@njit(cache=True)
def _set_stiffness(
    spread: float, stiffer: float, v: TrueVehicle, rubber: RubberTable, patch: Patches, cells: Cells
) -> None:
    """Stiffness of each patch, from the state at the start of the step."""
    for p in range(cells.stiffness.size):
        soft = _of_table(rubber.storage, cells.T[p])
        deviation = 1.0 + NATURAL_SPREAD * patch.natural[p] + spread * patch.graded[p]
        cells.stiffness[p] = patch.torque_share[p] * v.stiffness_Nm_rad * soft * stiffer * max(deviation, 0.05)


@njit(cache=True)
def _speed_up(t: float, m: Memory, hidden: HiddenContact) -> float:
    """How much sooner bristles follow: little moved since the last turning point (Payne), stretched as never before (Mullins)."""
    small = 1.0 / (1.0 + (abs(m.theta - m.turned_at) / hidden.payne_softening_angle) ** 1.2)
    virgin = np.exp(-(m.largest - m.stretch) / hidden.mullins_softening_width)
    speed_up: float = 1.0 + hidden.payne_softening_amount * _gate(t, hidden.payne_softening_from) * small
    speed_up *= 1.0 + hidden.mullins_softening_amount * _gate(t, hidden.mullins_softening_from) * virgin
    return speed_up


@njit(cache=True)
def _moment(t: float, h: float, v: TrueVehicle, hidden: HiddenContact, m: Memory, cells: Cells) -> Moment:
    relaxed = 0.0
    for j in range(cells.chain.size):
        relaxed += cells.chain[j]
    relaxed *= hidden.stress_relaxation_share_per_decade * 0.5229
    viscous = hidden.viscous_friction_sigma2 * _gate(t, hidden.viscous_friction_from)
    # Exact at 0.1 rad/s; less than linear above, more below (Eyring).
    viscous /= np.arcsinh(0.1 / hidden.viscous_friction_bend_speed) / 0.1
    elastic_before, whole = 0.0, 0.0
    for p in range(cells.z.size):
        elastic_before += cells.stiffness[p] * cells.z[p]
        whole += cells.stiffness[p]
    # sigma1 ~ sqrt(sigma0(T)), shared like the stiffness
    lossy = v.damping_Nms_rad / np.sqrt(whole * v.stiffness_Nm_rad)
    width = hidden.backlash_width * _gate(t, hidden.backlash_from)
    compliance = hidden.linkage_compliance_compliance * _gate(t, hidden.linkage_compliance_from)
    return Moment(
        h, m.theta, _speed_up(t, m, hidden), 1.0 - relaxed, elastic_before, lossy, viscous, width, compliance
    )


@njit(cache=True)
def _torques(rate: float, now: Moment, v: TrueVehicle, hidden: HiddenContact, cells: Cells) -> tuple[float, float]:
    """Friction torque at the end of a step at this rate of the contact, and the same with the aligning torque [N m]."""
    elastic = _bristles(rate, now.h, now.speed_up, cells.stiffness, cells.level, cells.z, cells.z_next)
    friction = (elastic * now.kept) + now.lossy * (elastic - now.elastic_before) / now.h
    friction += now.viscous * np.arcsinh(rate / hidden.viscous_friction_bend_speed)
    return friction, friction + v.aligning_torque_Nm * np.sin(now.theta + now.h * rate)


@njit(cache=True)
def _give_way(
    sensor: float, rate: float, now: Moment, v: TrueVehicle, hidden: HiddenContact, cells: Cells
) -> tuple[float, float, float]:
    """Rate of the contact, and its torques, where play and springs give way between it and the angle ``sensor``.

    False position, Illinois rule, around the expected ``rate``.
    """
    low_rate, high_rate, low_error, high_error = 0.0, 0.0, 0.0, 0.0
    bracketed, width_of_search = 0, 0.003
    trial = rate - width_of_search
    friction, torque = 0.0, 0.0
    for _ in range(60):
        friction, torque = _torques(trial, now, v, hidden, cells)
        soft, stiffening = hidden.backlash_soft_torque, hidden.linkage_compliance_stiffening_torque
        lost = _wind_up(torque, now.width, soft, now.compliance, stiffening)
        error = now.theta + now.h * trial + lost - sensor
        if abs(error) < 1e-11:
            break
        if bracketed == 0:
            if error < 0.0:
                low_rate, low_error, bracketed = trial, error, 1
                trial = rate + width_of_search
            else:
                width_of_search *= 3.0
                trial = rate - width_of_search
            continue
        if bracketed == 1:
            if error < 0.0:
                low_rate, low_error = trial, error
                width_of_search *= 3.0
                trial = rate + width_of_search
                continue
            high_rate, high_error, bracketed = trial, error, 2
        elif error < 0.0:
            low_rate, low_error = trial, error
            high_error *= 0.5  # Illinois rule: keep the false position method from stalling
        else:
            high_rate, high_error = trial, error
            low_error *= 0.5
        trial = (low_rate * high_error - high_rate * low_error) / (high_error - low_error)
    return trial, friction, torque


@njit(cache=True)
def _rub(
    t: float, rate: float, pull: float, now: Moment, v: TrueVehicle, hidden: HiddenContact, m: Memory,
    patch: Patches, cells: Cells,
) -> tuple[float, float]:  # fmt: skip
    """Bristles and temperatures of the patches at the end of the step; slip [rad/s] and heating [W] of the track."""
    lost_share = hidden.heat_partition_lost_share * _gate(t, hidden.heat_partition_from)
    lost_share *= (abs(rate) / 0.1) ** 0.1  # quicker rubbing leaves relatively more heat in the ground
    rise = hidden.ambient_drift_rise * _gate(t, hidden.ambient_drift_from)
    since = max(t - max(hidden.ambient_drift_from, 0.0), 0.0)
    air = v.air_degC + rise * (1.0 - np.exp(-since / hidden.ambient_drift_time))
    slip, power, count = 0.0, 0.0, cells.z.size
    for p in range(count):
        speed = (cells.z_next[p] - cells.z[p]) / now.h
        slip += patch.torque_share[p] * abs(rate - speed)
        local = 0.5 * cells.stiffness[p] * (cells.z[p] + cells.z_next[p]) * (rate - speed)
        local += now.lossy * cells.stiffness[p] * speed * rate
        power += local
        cooling = v.heat_loss_W_K * (cells.T[p] - air)
        cells.T[p] += now.h * (
            ((1.0 - lost_share) * local * count - cooling - pull * (m.mean_T - cells.sink[0])) / v.heat_capacity_J_K
            - (cells.T[p] - m.mean_T) / MIXING_S
        )
        cells.z[p] = cells.z_next[p]
    return slip, power


@njit(cache=True)
def _warm_carcass(pull: float, h: float, mean_T: float, hidden: HiddenContact, sink: Array) -> None:
    """Heat that the belt gives to the carcass, node by node."""
    node = hidden.carcass_heat_sink_capacity / _SINK_NODES
    flow = pull * (mean_T - sink[0])
    for j in range(_SINK_NODES):
        onward = 6.0 * pull * (sink[j] - sink[j + 1]) if j + 1 < _SINK_NODES else 0.0
        sink[j] += h * (flow - onward) / node
        flow = onward


@njit(cache=True)
def _relax(t: float, rate: float, h: float, hidden: HiddenContact, chain: Array) -> None:
    """Maxwell elements fill with time and are erased by motion."""
    for j in range(chain.size):
        erased = abs(rate) * chain[j] / hidden.stress_relaxation_erase_angle
        chain[j] += h * ((1.0 - chain[j]) / _CHAIN_S[j] - erased)
        if t < hidden.stress_relaxation_from:
            chain[j] = 0.0


@njit(cache=True)
def _remember(
    t: float, h: float, rate: float, slip: float, power: float, hidden: HiddenContact, m: Memory, patch: Patches, cells: Cells
) -> Memory:
    """The memory at the end of a step."""
    warm, stretch = 0.0, 0.0
    for p in range(cells.z.size):
        warm += cells.T[p]
        stretch += patch.torque_share[p] * abs(cells.z[p])
    heated = hidden.flash_temperature_rise * np.sqrt(max(power, 0.0) / 3000.0)
    theta, turned_at, way = m.theta + h * rate, m.turned_at, m.way
    if rate * way < -1e-9:
        way = -way
        turned_at = theta
    return Memory(
        theta,
        rate,
        turned_at,
        way,
        m.rest + h * (1.0 - m.rest * slip / hidden.static_ageing_slip_scale),
        m.slipped + h * slip * _gate(t, hidden.wear_polishing_from),
        m.lugs + h * abs(rate) * (np.sign(rate) - m.lugs) / hidden.direction_asymmetry_turn_angle,
        stretch,
        max(m.largest, stretch),
        m.flash + h * (heated - m.flash) / hidden.flash_temperature_time,
        warm / cells.z.size,
    )


@njit(cache=True)
def run_track(
    angle: Array, h: float, v: TrueVehicle, rubber: RubberTable, patch: Patches, hidden: HiddenContact,
    level_factor: Array | None = None, stiffness_factor: Array | None = None,
) -> Any:  # TrackSeries, compiled  # fmt: skip
    """Simulate one track (see ``TrackSeries``) for its clean angle (n,) on a grid of ``h`` seconds.

    The factors (n,), if any, are what an unlisted law makes of friction level and stiffness.
    """
    n, count, warm = angle.size, patch.torque_share.size, float(v.rubber_degC)
    friction, aligning, contact, heat = np.zeros(n), np.zeros(n), np.empty(n), np.empty(n)
    cells = Cells(
        np.zeros(count), np.zeros(count), np.full(count, warm), np.empty(count), np.empty(count),
        np.zeros(len(_CHAIN_S)), np.full(_SINK_NODES, warm),
    )  # fmt: skip
    m = Memory(angle[0], 0.0, angle[0], 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, warm)
    contact[0], heat[0], aligning[0] = angle[0], warm, v.aligning_torque_Nm * np.sin(angle[0])
    sensor_rate = 0.0
    loaded = hidden.backlash_width > 0.0 or hidden.linkage_compliance_compliance > 0.0
    for k in range(1, n):
        t = k * h
        factor, stiffer = _level_factor(t, m, hidden), 1.0
        if level_factor is not None and stiffness_factor is not None:
            factor *= level_factor[k]
            stiffer = stiffness_factor[k]
        rate = m.rate + (angle[k] - angle[k - 1]) / h - sensor_rate  # exact when nothing gives way
        sensor_rate = (angle[k] - angle[k - 1]) / h
        hot = m.flash * _gate(t, hidden.flash_temperature_from)
        _set_levels(factor * _sliding(rate, v), hot, rubber, patch, cells)
        spread = hidden.distributed_contact_spread * _gate(t, hidden.distributed_contact_from)
        _set_stiffness(spread, stiffer, v, rubber, patch, cells)
        now = _moment(t, h, v, hidden, m, cells)
        if loaded:
            rate, part, torque = _give_way(angle[k], rate, now, v, hidden, cells)
        else:
            rate = (angle[k] - m.theta) / h
            part, torque = _torques(rate, now, v, hidden, cells)
        friction[k], aligning[k] = part, torque - part
        pull = hidden.carcass_heat_sink_conductance * _gate(t, hidden.carcass_heat_sink_from)
        slip, power = _rub(t, rate, pull, now, v, hidden, m, patch, cells)
        if hidden.carcass_heat_sink_conductance > 0.0:
            _warm_carcass(pull, h, m.mean_T, hidden, cells.sink)
        _relax(t, rate, h, hidden, cells.chain)
        m = _remember(t, h, rate, slip, power, hidden, m, patch, cells)
        contact[k], heat[k] = m.theta, m.mean_T
    return TrackSeries(friction, aligning, contact, heat)
