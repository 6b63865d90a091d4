# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Ground pressure under one track: where its load and its friction stand. The torque itself uses the roller centres."""

from __future__ import annotations

import math

import numpy as np

from lugre_steering.recording import Array
from lugre_steering.vehicle.loads import roller_loads
from lugre_steering.vehicle.sections import Axle, Track


def peak_pressure(axle: Axle, track: Track, contact_area_m2: float) -> float:
    """Pressure under every roller centre [Pa]: twice the mean over the contact, for the fall across, over that of cos^n.

    Mean of cos^n(pi u) for |u| < 1/2: Gamma((n + 1) / 2) / (sqrt(pi) Gamma(n / 2 + 1)).
    """
    n = track.ground_pressure_exponent
    along = math.gamma(0.5 * (n + 1.0)) / (math.sqrt(math.pi) * math.gamma(0.5 * n + 1.0))
    return 2.0 * float(roller_loads(axle, track).sum()) / (contact_area_m2 * along)


def contact_lengths(axle: Axle, track: Track, contact_area_m2: float) -> Array:
    """Contact length under each roller [m] (n,): together they make the contact area, each in proportion to its load."""
    loads = roller_loads(axle, track)
    return np.asarray(contact_area_m2 / track.width_m * loads / loads.sum())


def ground_pressure(axle: Axle, track: Track, contact_area_m2: float, x: Array, y: Array) -> Array:
    """Pressure [Pa] (k, m) at ``x`` (m,) [m] along the track from the hinge and ``y`` (k,) [m] across from its centreline.

    p = p0 cos^n(pi (x - x_i) / l_i) (1 - 2 |y| / W) under roller i, with one peak p0 for all. Each roller's integral is its
    load, whatever the exponent n (2 soft ground, 4 hard). Reconstructed (R) from Liang et al. 2022, eq. 23, where the
    contact lengths l_i follow from the balance of loads.
    """
    centres = np.array(track.rollers.x_m)[:, None]
    ahead = (x - centres) / contact_lengths(axle, track, contact_area_m2)[:, None]
    along = np.where(np.abs(ahead) < 0.5, np.cos(np.pi * np.clip(ahead, -0.5, 0.5)), 0.0) ** track.ground_pressure_exponent
    across = np.clip(1.0 - 2.0 * np.abs(y) / track.width_m, 0.0, None)
    return np.asarray(peak_pressure(axle, track, contact_area_m2) * across[:, None] * along.sum(axis=0))
