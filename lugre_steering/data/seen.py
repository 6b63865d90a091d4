# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a calibration has seen of motion and rubber, for a note in the vehicle file: beyond, the model is a guess."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lugre_steering.chain.step import run_side
from lugre_steering.data.dataset import Run
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.model import build_model

Seen = dict[str, float | list[float]]
"""As ``provenance.seen`` keeps it."""


def seen_range(vehicle: Vehicle, runs: Sequence[Run], starts: Sequence[tuple[float, float]] = ()) -> Seen:
    """Largest angle and rate of any track, ``angle_deg`` and ``rate_deg_s``, of a linear axis ``position_m`` and ``rate_m_s`` (files of
    earlier versions call 0.01745 m of one a degree); and the coldest and the warmest rubber, ``rubber_degC``, where it is known
    how warm rubber and air [degC] were at the start of each run."""
    seen = _seen_motion(vehicle, runs)
    if starts:
        ends = [end for run, start in zip(runs, starts, strict=True) for end in _seen_rubber(vehicle, run, *start)]
        seen["rubber_degC"] = [round(min(ends), 1), round(max(ends), 1)]
    return seen


def _seen_rubber(vehicle: Vehicle, run: Run, rubber_degC: float, air_degC: float) -> tuple[float, float]:
    """Coldest and warmest rubber [degC] of any track during a run, as the model has it."""
    model, ends = build_model(vehicle), [rubber_degC]
    for p, theta, omega, alpha in zip(model.parameters, run.theta, run.omega, run.alpha, strict=True):
        p["rubber_temperature"], p["air_temperature"] = rubber_degC, air_degC
        warm = run_side(p, model.rubber, run.time, theta, omega, alpha)["temperature"]
        ends += [float(warm.min()), float(warm.max())]
    return min(ends), max(ends)


def _seen_motion(vehicle: Vehicle, runs: Sequence[Run]) -> Seen:
    angle = max(float(np.abs(run.theta).max()) for run in runs)
    rate = max(float(np.abs(run.omega).max()) for run in runs)
    if vehicle.coordinate.unit == "m":
        return {"position_m": float(f"{angle:.4g}"), "rate_m_s": float(f"{rate:.4g}")}
    return {"angle_deg": round(math.degrees(angle), 2), "rate_deg_s": round(math.degrees(rate), 2)}
