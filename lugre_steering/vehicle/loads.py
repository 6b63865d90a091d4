# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Loads and geometry of one track: rollers and radii."""

from __future__ import annotations

import numpy as np

from lugre_steering.recording import Array
from lugre_steering.vehicle.sections import Axle, Track


def vertical_load(axle: Axle, track: Track) -> float:
    """Load on the ground under one track [N]: half the axle load plus the assembly weight."""
    return 0.5 * axle.load_N + track.weight_N


def roller_loads(axle: Axle, track: Track) -> Array:
    """Load of each roller [N] (n,): given shares, or two levels of balance levers (R; Liang et al. 2022, eq. 16-20).

    P1 = alpha1 F + alpha2 G, P2 = (1 - alpha1) F + (1 - alpha2) G, alpha1 = l2 / (l1 + l2), alpha2 = l4 / (l3 + l4);
    F1 = beta1 P1, F2 = (1 - beta1) P1, F3 = beta2 P2, F4 = (1 - beta2) P2 in the same way, F1 on the foremost roller.
    """
    rollers = track.rollers
    if rollers.load_share is not None:
        return vertical_load(axle, track) * np.array(rollers.load_share)
    assert rollers.levers is not None
    levers = rollers.levers
    alpha_1, alpha_2, beta_1, beta_2 = (
        rear / (front + rear) for front, rear in (levers.axle_m, levers.weight_m, levers.front_m, levers.rear_m)
    )
    axle_load = 0.5 * axle.load_N
    front = alpha_1 * axle_load + alpha_2 * track.weight_N
    rear = (1.0 - alpha_1) * axle_load + (1.0 - alpha_2) * track.weight_N
    loads = np.empty(4)
    foremost_first = np.argsort(-np.array(rollers.x_m))
    loads[foremost_first] = beta_1 * front, (1.0 - beta_1) * front, beta_2 * rear, (1.0 - beta_2) * rear
    return loads


def roller_radii(track: Track) -> Array:
    """Distance of each roller centre from the hinge [m] (n,): hypot(x_i, hinge offset)."""
    radii: Array = np.hypot(np.array(track.rollers.x_m), track.hinge_offset_m)
    return radii


def load_moment(axle: Axle, track: Track) -> float:
    """sum F_i r_i [N m]: friction torque per unit of friction coefficient."""
    return float(roller_loads(axle, track) @ roller_radii(track))
