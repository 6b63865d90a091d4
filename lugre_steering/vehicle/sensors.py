# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the sensors of a vehicle make of it, by the laws of the effects in its file: for the simulator, and for the check of wiring."""

from __future__ import annotations

from collections.abc import Iterator

from lugre_steering.effects.entry import Effect, Variant
from lugre_steering.effects.registry import effect
from lugre_steering.recording import Array
from lugre_steering.vehicle.sections import Vehicle


def _with(vehicle: Vehicle, hook: str) -> Iterator[tuple[Effect, Variant]]:
    for entry in vehicle.effects:
        if hook in (known := effect(entry.id)).hooks:
            yield known, entry.parameters


def true_angle(vehicle: Vehicle, theta: Array) -> Array:
    """True angles of what the sensors show (..., n) [rad]."""
    for known, values in _with(vehicle, "angle"):
        theta = known.law("angle", values, theta=theta)
    return theta


def arm_factor(vehicle: Vehicle, theta: Array) -> Array | float:
    """True moment arms over those of the drawing, at angles (..., n) [rad]."""
    factor: Array | float = 1.0
    for known, values in _with(vehicle, "arm"):
        factor = factor * known.law("arm", values, theta=theta)
    return factor


def line_error(vehicle: Vehicle, line: str, elapsed: Array) -> Array | float:
    """What the sensor of a line reads too much [Pa] at times (n,) [s] after the start."""
    error: Array | float = 0.0
    for known, values in _with(vehicle, "line"):
        error = error + known.law("line", {known.parameters[0].name: values.get(line, 0.0)}, elapsed=elapsed)
    return error


def delay_s(vehicle: Vehicle) -> float:
    """By how much pressures or torque are stamped late [s]."""
    return float(sum(known.law("delay", values) for known, values in _with(vehicle, "delay")))


def lag_s(vehicle: Vehicle) -> float:
    """Time constant of the pressure or torque sensors [s]; small ones add up."""
    return float(sum(known.law("lag", values) for known, values in _with(vehicle, "lag")))
