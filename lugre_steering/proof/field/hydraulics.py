# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Line pressures of one to four circuits that share the load, each with its own counter-pressure; and back to torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lugre_steering.proof.field.machine import Machine

Array = NDArray[np.float64]

TANK_PA = 4e5


@dataclass(frozen=True)
class Valves:
    """Habits of the valves: counter-pressure as a share of the working pressure, and return flow resistance [Pa] at 0.1 rad/s."""

    counter_share: float
    return_Pa: float


def gains(machine: Machine, angles: Array, arm_factor: Array | None = None) -> Array:
    """Torque per pressure of each line (lines, n) [N m/Pa] at the angles (2, n); ``arm_factor`` (2, n) scales the levers."""
    out = np.zeros((len(machine.lines), angles.shape[1]))
    for ram in machine.rams:
        lever = ram.lever(angles[ram.side]) * (1.0 if arm_factor is None else arm_factor[ram.side])
        cap, rod = (machine.lines.index(line) for line in machine.chambers(ram))
        out[cap] += 0.25 * np.pi * ram.bore_m**2 * lever
        out[rod] -= 0.25 * np.pi * (ram.bore_m**2 - ram.rod_m**2) * lever
    return out


def pressures(machine: Machine, torque: Array, gain: Array, valves: Valves, rate: Array) -> Array:
    """Line pressures (lines, n) [Pa] that deliver ``torque`` (n,): in each circuit one line works, the other holds against it."""
    passive = TANK_PA + valves.return_Pa * (np.abs(rate) / 0.1) ** 1.75
    out = np.empty_like(gain)
    for j, share in enumerate(machine.circuit_share):
        left, right = gain[2 * j], gain[2 * j + 1]
        missing = share * torque - passive * (left + right)
        forward = missing > 0.0
        working, other = np.where(forward, left, right), np.where(forward, right, left)
        extra = missing / (working + valves.counter_share * other)
        out[2 * j] = passive + extra * np.where(forward, 1.0, valves.counter_share)
        out[2 * j + 1] = passive + extra * np.where(forward, valves.counter_share, 1.0)
    return out


def torque_of(pressure: Array, gain: Array) -> Array:
    """Total torque (n,) [N m]."""
    return np.asarray(np.einsum("ln,ln->n", pressure, gain))
