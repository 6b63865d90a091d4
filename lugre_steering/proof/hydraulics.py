# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From the torque that steering needs to the pressures of four lines that the cylinders of both sides share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lugre_steering.proof.vehicle_draw import Cylinder, Sheet

Array = NDArray[np.float64]

BACK_PRESSURE_PA = 0.7e6


def moment_arm(cylinder: Cylinder, angle: Array) -> Array:
    """Exact dL/dtheta [m] of a cylinder from chassis pivot to turning knuckle pivot, shape as ``angle`` [rad]."""
    x0, y0 = cylinder.knuckle_m
    x, y = x0 * np.cos(angle) - y0 * np.sin(angle), x0 * np.sin(angle) + y0 * np.cos(angle)
    along_x, along_y = x - cylinder.chassis_m[0], y - cylinder.chassis_m[1]
    return np.asarray((along_y * x - along_x * y) / np.hypot(along_x, along_y))


def line_gain(sheet: Sheet, angles: Array, arm_factor: Array | None = None) -> Array:
    """Torque of both sides per pressure of each line (lines, n) [N m/Pa] at the angles (2, n) [rad].

    The force of a cylinder is ``p_cap A_cap - p_rod A_rod``, its torque force x dL/dtheta. ``arm_factor`` (2, n) scales
    the arms of each side.
    """
    gain = np.zeros((len(sheet.lines), angles.shape[1]))
    for cylinder in sheet.cylinders:
        arm = moment_arm(cylinder, angles[cylinder.side])
        if arm_factor is not None:
            arm = arm * arm_factor[cylinder.side]
        gain[sheet.lines.index(cylinder.cap_line)] += cylinder.cap_area_m2 * arm
        gain[sheet.lines.index(cylinder.rod_line)] -= cylinder.rod_area_m2 * arm
    return gain


def torque_of(pressures: Array, gain: Array) -> Array:
    """Total cylinder torque (n,) [N m] of line pressures (lines, n) [Pa]."""
    return np.asarray(np.sum(pressures * gain, axis=0))


def line_pressures(torque: Array, gain: Array, line_share: Array, return_flow: Array) -> Array:
    """Line pressures (lines, n) [Pa] whose cylinders deliver ``torque`` (n,).

    Every line stands at the back pressure plus what the return flow (n,) [Pa] adds. The lines that push the right way
    carry the rest, each with its ``line_share`` (lines,): pumps and valves of two circuits are never quite alike.
    """
    passive = np.broadcast_to(BACK_PRESSURE_PA + return_flow, gain.shape)
    missing = torque - torque_of(passive, gain)
    pushing = np.where(np.sign(gain) == np.sign(missing), line_share[:, None], 0.0)
    load = missing / np.where(missing == 0.0, 1.0, np.sum(pushing * gain, axis=0))
    return np.asarray(passive + pushing * load)
