# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the vehicle file says of its calibration: how far the model can be trusted, and how well it should fit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lugre_steering.recording import Array
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.model import most_friction_of_all

SLACK = 1.1
"""The causal estimates of a motion swing a little farther than the smoothed ones that were kept."""
LIKE_SHARE = 0.1
"""Rubber may be so much colder or warmer than it was that its table changes the friction by this share."""
BOUND_RMSE = 5.0
"""A residual this many times as large as the held-out one of the calibration is implausible."""
LEAST_BOUND = 0.1
"""Share of the friction below which none is: a controller that feeds nine tenths of it forward bears as much."""
_DEG = math.pi / 180.0


@dataclass(frozen=True)
class KnownRange:
    """Largest angle [rad] and rate [rad/s] that the calibration saw (inf: not told), its held-out RMSE [N m] (0: none), and the coldest and
    the warmest rubber [degC] (infinite: not told)."""

    angle: float = math.inf
    rate: float = math.inf
    rmse: float = 0.0
    rubber: tuple[float, float] = (-math.inf, math.inf)


def known_range(vehicle: Vehicle) -> KnownRange:
    """From ``provenance``: ``seen`` (written by ``data/seen.py``) and ``heldout_rmse_Nm``, of ``calibration`` or at its top."""
    notes = [note for note in (vehicle.provenance, vehicle.provenance.get("calibration")) if isinstance(note, Mapping)]
    seen: object = next((note["seen"] for note in notes if "seen" in note), None)
    seen = seen if isinstance(seen, Mapping) else {}
    rmse: object = next((note["heldout_rmse_Nm"] for note in notes if "heldout_rmse_Nm" in note), 0.0)
    if isinstance(rmse, Mapping):
        rmse = rmse.get("calibrated", 0.0)
    angle, rate = (
        next((si * value for key, si in keys if (value := _positive(seen.get(key)))), math.inf)
        for keys in ((("position_m", 1.0), ("angle_deg", _DEG)), (("rate_m_s", 1.0), ("rate_deg_s", _DEG)))
    )
    return KnownRange(SLACK * angle, SLACK * rate, _positive(rmse), _ends(seen.get("rubber_degC")))


def residual_bound(vehicle: Vehicle) -> float:
    """Size [N m] from which on a residual is implausible, by what the calibration left; 0 without one."""
    rmse = known_range(vehicle).rmse
    return max(BOUND_RMSE * rmse, LEAST_BOUND * most_friction_of_all(vehicle)) if rmse > 0.0 else 0.0


def like_seen(seen: tuple[float, float], degC: Array, friction: Array) -> tuple[float, float]:
    """From where to where [degC] the friction of a rubber table, at ``degC`` (n,), is still nearly that at the ends of what was ``seen``:
    where the table says little of a change, it can be little wrong."""
    (coldest, warmest), ends = seen, np.interp(seen, degC, friction)
    unlike = [np.abs(friction / end - 1.0) > LIKE_SHARE for end in ends]
    colder, warmer = degC[unlike[0] & (degC < coldest)], degC[unlike[1] & (degC > warmest)]
    return float(colder.max(initial=-math.inf)), float(warmer.min(initial=math.inf))


def _ends(value: object) -> tuple[float, float]:
    """Two numbers in order, or all there are for anything else."""
    if isinstance(value, (list, tuple)) and len(value) == 2 and all(isinstance(end, (int, float)) for end in value):
        low, high = map(float, value)
        if math.isfinite(high - low) and low <= high:
            return low, high
    return -math.inf, math.inf


def _positive(value: object) -> float:
    """The number, or 0 for anything that is no positive one."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value) and value > 0.0
    return float(value) if number else 0.0  # type: ignore[arg-type]
