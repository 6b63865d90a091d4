# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Many parameter sets over one record: the baseline laws on SIMD lanes, blocks of lanes on threads."""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit

from lugre_steering.chain.bristle import bristle, bristle_work, stribeck
from lugre_steering.chain.heat import LONG, short_heat
from lugre_steering.chain.step import Records, acting, torque_side
from lugre_steering.recording import Array

LANES = 64
"""Sets per block: enough independent chains to hide the latency of one step."""

_PARAMETERS = (
    "static_torque", "coulomb_torque", "sigma_0", "damping_factor", "stribeck_speed", "heat_capacity", "cooling",
    "air_temperature", "aligning_torque", "gravity_cos", "table_low", "table_step", "initial_bristle",
    "rubber_temperature",
)  # fmt: skip
# Rows of the block's one buffer, LANES numbers each. One buffer with constant row offsets is what lets LLVM prove that
# the lanes are independent.
(
    _STATIC, _COULOMB, _SIGMA_0, _DAMPING, _SPEED, _CAPACITY, _COOLING, _AIR, _ALIGNING, _GRAVITY, _LOW, _STEP, _Z,
    _TEMPERATURE, _WEIGHT, _STIFFNESS_LOW, _STIFFNESS_HIGH, _FRICTION_LOW, _FRICTION_HIGH, _INDEX, _TORQUE,
) = (LANES * row for row in range(21))  # fmt: skip


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract"})
def _block(b, rubber, time, theta, omega, torque, first, count):
    """Advance ``count`` <= LANES sets through the record; ``rubber`` (sets or 1, rows, 2); fills ``torque``."""
    last = rubber.shape[1] - 2
    for i in range(time.size):
        dt = time[i] - time[max(i - 1, 0)]
        d_theta = theta[i] - theta[max(i - 1, 0)]
        sine, cosine = math.sin(theta[i]), math.cos(theta[i])
        for j in range(LANES):
            position = min(max((b[_TEMPERATURE + j] - b[_LOW + j]) / b[_STEP + j], 0.0), last + 1.0)
            index = min(math.floor(position), float(last))
            b[_INDEX + j] = index
            b[_WEIGHT + j] = position - index
        for j in range(LANES):
            table = rubber[first + j if rubber.shape[0] > 1 and j < count else 0]
            row = np.uint64(b[_INDEX + j])
            b[_STIFFNESS_LOW + j], b[_FRICTION_LOW + j] = table[row, 0], table[row, 1]
            b[_STIFFNESS_HIGH + j], b[_FRICTION_HIGH + j] = table[row + np.uint64(1), 0], table[row + np.uint64(1), 1]
        for j in range(LANES):
            weight = b[_WEIGHT + j]
            stiffness = b[_SIGMA_0 + j] * (
                b[_STIFFNESS_LOW + j] + weight * (b[_STIFFNESS_HIGH + j] - b[_STIFFNESS_LOW + j])
            )
            level = b[_FRICTION_LOW + j] + weight * (b[_FRICTION_HIGH + j] - b[_FRICTION_LOW + j])
            g = level * stribeck(omega[i], b[_STATIC + j], b[_COULOMB + j], b[_SPEED + j], 2.0)
            z = b[_Z + j]
            z_next = bristle(z, d_theta, stiffness, g)
            sigma_1 = b[_DAMPING + j] * math.sqrt(stiffness)
            damping = sigma_1 * (omega[i] - abs(omega[i]) * z_next * stiffness / g)
            work = bristle_work(z, z_next, d_theta, g) + sigma_1 * omega[i] * (z_next - z)
            dissipated = max(work - 0.5 * stiffness * (z_next * z_next - z * z), 0.0)
            b[_TEMPERATURE + j] = short_heat(
                b[_TEMPERATURE + j], dissipated, dt, b[_CAPACITY + j], b[_COOLING + j], b[_AIR + j]
            )
            b[_Z + j] = z_next
            b[_TORQUE + j] = stiffness * z_next + damping + b[_ALIGNING + j] * sine + b[_GRAVITY + j] * cosine
        for j in range(count):
            torque[i, first + j] = b[_TORQUE + j]


def torque_sets(parameters: Records, rubber: Array, time: Array, theta: Array, omega: Array) -> Array:
    """Torque [N m] (n, sets) of one track for each parameter record of ``parameters`` (sets,).

    ``rubber`` (rows, 2) for all sets or (sets, rows, 2). Same laws and numbers as ``torque_side`` to rounding.
    Records with an effect, another Stribeck exponent than 2 or a gap too long for ``short_heat`` go through
    ``torque_side``.
    """
    sets = parameters.size
    tables = rubber[np.newaxis] if rubber.ndim == 2 else rubber
    torque = np.empty((time.size, sets))
    with_effects = np.array([acting(parameters[k : k + 1]) != 0 for k in range(sets)])
    gap = float(np.diff(time).max(initial=0.0))
    ordinary = 0.5 * parameters["cooling"] * gap / parameters["heat_capacity"] <= LONG
    plain = (parameters["stribeck_exponent"] == 2.0) & ~with_effects & ordinary

    def block(first: int) -> None:
        count = min(LANES, sets - first)
        if not plain[first : first + count].all():
            still = np.zeros(time.size)
            for k in range(first, first + count):
                torque[:, k] = torque_side(parameters[k : k + 1], tables[k % len(tables)], time, theta, omega, still)
            return
        buffer = np.zeros((21, LANES))
        for row, name in enumerate(_PARAMETERS):
            buffer[row] = np.resize(parameters[name][first : first + count], LANES)
        _block(buffer.ravel(), tables, time, theta, omega, torque, first, count)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(block, range(0, sets, LANES)))
    return torque
