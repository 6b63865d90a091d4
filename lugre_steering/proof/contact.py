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


class Track(NamedTuple):
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
def run_track(
    angle: Array, h: float, v: TrueVehicle, rubber: RubberTable, patch: Patches, hidden: HiddenContact,
    level_factor: Array | None = None, stiffness_factor: Array | None = None,
) -> Any:  # Track, compiled  # fmt: skip
    """Simulate one track (see ``Track``) for its clean angle (n,) on a grid of ``h`` seconds.

    The factors (n,), if any, are what an unlisted law makes of friction level and stiffness.
    """
    n, count = angle.size, patch.torque_share.size
    friction, aligning, contact, heat = np.zeros(n), np.zeros(n), np.empty(n), np.empty(n)
    z, z_next = np.zeros(count), np.zeros(count)
    T = np.full(count, v.rubber_degC)
    level, stiffness = np.empty(count), np.empty(count)
    chain = np.zeros(len(_CHAIN_S))
    sink = np.full(_SINK_NODES, v.rubber_degC)
    mean_T, flash, air = v.rubber_degC, 0.0, v.air_degC
    theta, torque = angle[0], v.aligning_torque_Nm * np.sin(angle[0])
    contact[0], heat[0], aligning[0] = theta, mean_T, torque
    previous_rate, sensor_rate, turned_at, way = 0.0, 0.0, theta, 1.0
    rest, slipped, lugs, largest = 0.0, 0.0, 0.0, 0.0
    damping = v.damping_Nms_rad
    loaded = hidden.backlash_width > 0.0 or hidden.linkage_compliance_compliance > 0.0
    for k in range(1, n):
        t = k * h
        # Friction level and stiffness of each patch, from the state at the start of the step.
        spread = hidden.distributed_contact_spread * _gate(t, hidden.distributed_contact_from)
        factor = 1.0 + hidden.direction_asymmetry_a * _gate(t, hidden.direction_asymmetry_from) * lugs
        where = t if hidden.surface_patch_in_time > 0.0 else theta
        window = 0.5 * (
            np.tanh((where - hidden.surface_patch_low) / hidden.surface_patch_edge)
            - np.tanh((where - hidden.surface_patch_high) / hidden.surface_patch_edge)
        )
        factor *= 1.0 + hidden.surface_patch_amount * _gate(t, hidden.surface_patch_from) * window
        worn = 1.0 - 1.0 / (1.0 + slipped / hidden.wear_polishing_slip_scale)
        factor *= 1.0 - hidden.wear_polishing_amount * worn
        aged = np.log(1.0 + rest / hidden.static_ageing_time)
        factor *= 1.0 + hidden.static_ageing_rate * _gate(t, hidden.static_ageing_from) * aged
        stiffer = 1.0
        if level_factor is not None and stiffness_factor is not None:
            factor *= level_factor[k]
            stiffer = stiffness_factor[k]
        rate = previous_rate + (angle[k] - angle[k - 1]) / h - sensor_rate  # exact when nothing gives way
        sensor_rate = (angle[k] - angle[k - 1]) / h
        drop = (abs(rate) / v.stribeck_speed_rad_s) ** v.stribeck_exponent
        curve = factor * (v.coulomb_torque_Nm + (v.static_torque_Nm - v.coulomb_torque_Nm) * np.exp(-drop))
        hot = flash * _gate(t, hidden.flash_temperature_from)
        for p in range(count):
            place = (T[p] + hot - LOWEST_DEGC) / STEP_K
            i = min(max(int(place), 0), rubber.storage.size - 2)
            level[p] = patch.torque_share[p] * curve * (
                rubber.loss_ratio[i] + (place - i) * (rubber.loss_ratio[i + 1] - rubber.loss_ratio[i])
            )
            place = (T[p] - LOWEST_DEGC) / STEP_K
            i = min(max(int(place), 0), rubber.storage.size - 2)
            soft = rubber.storage[i] + (place - i) * (rubber.storage[i + 1] - rubber.storage[i])
            deviation = 1.0 + NATURAL_SPREAD * patch.natural[p] + spread * patch.graded[p]
            stiffness[p] = patch.torque_share[p] * v.stiffness_Nm_rad * soft * stiffer * max(deviation, 0.05)
        stretch = 0.0
        for p in range(count):
            stretch += patch.torque_share[p] * abs(z[p])
        small = 1.0 / (1.0 + (abs(theta - turned_at) / hidden.payne_softening_angle) ** 1.2)
        virgin = np.exp(-(largest - stretch) / hidden.mullins_softening_width)
        speed_up = 1.0 + hidden.payne_softening_amount * _gate(t, hidden.payne_softening_from) * small
        speed_up *= 1.0 + hidden.mullins_softening_amount * _gate(t, hidden.mullins_softening_from) * virgin
        relaxed = 0.0
        for j in range(chain.size):
            relaxed += chain[j]
        relaxed *= hidden.stress_relaxation_share_per_decade * 0.5229
        viscous = hidden.viscous_friction_sigma2 * _gate(t, hidden.viscous_friction_from)
        bend = hidden.viscous_friction_bend_speed
        viscous /= np.arcsinh(0.1 / bend) / 0.1  # exact at 0.1 rad/s; less than linear above, more below (Eyring)
        elastic_before, whole = 0.0, 0.0
        for p in range(count):
            elastic_before += stiffness[p] * z[p]
            whole += stiffness[p]
        lossy = damping / np.sqrt(whole * v.stiffness_Nm_rad)  # sigma1 ~ sqrt(sigma0(T)), shared like the stiffness
        width = hidden.backlash_width * _gate(t, hidden.backlash_from)
        compliance = hidden.linkage_compliance_compliance * _gate(t, hidden.linkage_compliance_from)
        # The rate of the contact: the sensor's, unless something between the two gives way under the torque.
        low_rate, high_rate, low_error, high_error = 0.0, 0.0, 0.0, 0.0
        bracketed, width_of_search = 0, 0.003
        trial = rate - width_of_search if loaded else (angle[k] - theta) / h
        for _ in range(60):
            elastic = _bristles(trial, h, speed_up, stiffness, level, z, z_next)
            part = (elastic * (1.0 - relaxed)) + lossy * (elastic - elastic_before) / h
            part += viscous * np.arcsinh(trial / bend)
            torque = part + v.aligning_torque_Nm * np.sin(theta + h * trial)
            if not loaded:
                break
            lost = _wind_up(
                torque, width, hidden.backlash_soft_torque, compliance, hidden.linkage_compliance_stiffening_torque
            )
            error = theta + h * trial + lost - angle[k]
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
        rate = trial
        friction[k] = part
        aligning[k] = torque - part
        theta += h * rate
        # Memories: direction of the lugs, dwell, slip, relaxation, last turning point.
        slip, power, warm = 0.0, 0.0, 0.0
        lost_share = hidden.heat_partition_lost_share * _gate(t, hidden.heat_partition_from)
        lost_share *= (abs(rate) / 0.1) ** 0.1  # quicker rubbing leaves relatively more heat in the ground
        pull = hidden.carcass_heat_sink_conductance * _gate(t, hidden.carcass_heat_sink_from)
        rise = hidden.ambient_drift_rise * _gate(t, hidden.ambient_drift_from)
        since = max(t - max(hidden.ambient_drift_from, 0.0), 0.0)
        air = v.air_degC + rise * (1.0 - np.exp(-since / hidden.ambient_drift_time))
        stretch = 0.0
        for p in range(count):
            speed = (z_next[p] - z[p]) / h
            slip += patch.torque_share[p] * abs(rate - speed)
            local = 0.5 * stiffness[p] * (z[p] + z_next[p]) * (rate - speed)
            local += lossy * stiffness[p] * speed * rate
            power += local
            T[p] += h * (
                ((1.0 - lost_share) * local * count - v.heat_loss_W_K * (T[p] - air) - pull * (mean_T - sink[0]))
                / v.heat_capacity_J_K
                - (T[p] - mean_T) / MIXING_S
            )
            warm += T[p]
            z[p] = z_next[p]
            stretch += patch.torque_share[p] * abs(z[p])
        if hidden.carcass_heat_sink_conductance > 0.0:
            node = hidden.carcass_heat_sink_capacity / _SINK_NODES
            flow = pull * (mean_T - sink[0])
            for j in range(_SINK_NODES):
                onward = 6.0 * pull * (sink[j] - sink[j + 1]) if j + 1 < _SINK_NODES else 0.0
                sink[j] += h * (flow - onward) / node
                flow = onward
        mean_T = warm / count
        largest = max(largest, stretch)
        rest += h * (1.0 - rest * slip / hidden.static_ageing_slip_scale)
        slipped += h * slip * _gate(t, hidden.wear_polishing_from)
        lugs += h * abs(rate) * (np.sign(rate) - lugs) / hidden.direction_asymmetry_turn_angle
        for j in range(chain.size):
            erased = abs(rate) * chain[j] / hidden.stress_relaxation_erase_angle
            chain[j] += h * ((1.0 - chain[j]) / _CHAIN_S[j] - erased)
            if t < hidden.stress_relaxation_from:
                chain[j] = 0.0
        heated = hidden.flash_temperature_rise * np.sqrt(max(power, 0.0) / 3000.0)
        flash += h * (heated - flash) / hidden.flash_temperature_time
        if rate * way < -1e-9:
            way = -way
            turned_at = theta
        previous_rate = rate
        contact[k], heat[k] = theta, mean_T
    return Track(friction, aligning, contact, heat)
