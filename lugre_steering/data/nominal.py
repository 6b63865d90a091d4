# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the vehicle file makes of the angles of a run, before anything is fitted."""

from __future__ import annotations

import numpy as np

from lugre_steering.chain.step import torque_side
from lugre_steering.data.dataset import Run
from lugre_steering.recording import Array, Kind
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.model import Model

GAIN = 1.6
"""The nominal level may be wrong by this factor; units and lost circuits are further off."""
GOOD = 0.45
"""Relative error of a model that describes a run (80 % of the energy explained)."""


def topics_of(vehicle: Vehicle, kind: Kind) -> dict[str, str]:
    return {channel.name: channel.topic for channel in vehicle.channels if channel.kind is kind}


def nominal_torques(model: Model, run: Run) -> Array:
    """Nominal torque of each side (sides, n) [N m]."""
    rows = zip(model.parameters, run.theta, run.omega, run.alpha, strict=True)
    return np.array([torque_side(p, model.rubber, run.time, *row) for p, *row in rows])
