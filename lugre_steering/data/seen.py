# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a calibration has seen of the motion, for a note in the vehicle file: beyond, the model is a guess."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lugre_steering.data.dataset import Run
from lugre_steering.vehicle import Vehicle


def seen_range(vehicle: Vehicle, runs: Sequence[Run]) -> dict[str, float]:
    """Largest angle and rate of any track, as ``provenance.seen`` keeps them: ``angle_deg`` and ``rate_deg_s``, of a linear axis
    ``position_m`` and ``rate_m_s`` (files of earlier versions call 0.01745 m of one a degree)."""
    angle = max(float(np.abs(run.theta).max()) for run in runs)
    rate = max(float(np.abs(run.omega).max()) for run in runs)
    if vehicle.coordinate.unit == "m":
        return {"position_m": float(f"{angle:.4g}"), "rate_m_s": float(f"{rate:.4g}")}
    return {"angle_deg": round(math.degrees(angle), 2), "rate_deg_s": round(math.degrees(rate), 2)}
