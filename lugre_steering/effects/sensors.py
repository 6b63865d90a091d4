# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Measurement effects that only change how the cylinder torque and the residual are formed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from lugre_steering.recording import Array
from lugre_steering.vehicle import Vehicle


@dataclass(frozen=True)
class SensorCorrection:
    """What to undo on the measured side: offset [Pa] and drift [Pa/s] per line, late stamps [s] (positive: pressures
    stamped late), first-order lag [s], and the true moment arm as arm (1 + a theta + b theta**2)."""

    offset_Pa: Mapping[str, float] = field(default_factory=dict)
    drift_Pa_s: Mapping[str, float] = field(default_factory=dict)
    delay_s: float = 0.0
    lag_s: float = 0.0
    arm_linear: float = 0.0
    arm_quadratic: float = 0.0


def true_angle(vehicle: Vehicle, theta: Array) -> Array:
    """True angles of what the sensors show (..., n) [rad], with angle_offset and angle_scale: (theta - offset) / (1 + scale)."""
    found = {effect.id: effect.parameters for effect in vehicle.effects}
    offset, scale = found.get("angle_offset", {}).get("offset", 0.0), found.get("angle_scale", {}).get("scale", 0.0)
    return (theta - offset) / (1.0 + scale)


def sensor_correction(vehicle: Vehicle) -> SensorCorrection:
    """The sensor effects of a vehicle file, gathered; pressure_offset and pressure_drift take line names."""
    found = {effect.id: effect.parameters for effect in vehicle.effects}
    arm = found.get("moment_arm_error", {})
    return SensorCorrection(
        offset_Pa=found.get("pressure_offset", {}),
        drift_Pa_s=found.get("pressure_drift", {}),
        delay_s=found.get("time_delay", {}).get("delay", 0.0),
        lag_s=found.get("pressure_lag", {}).get("tau", 0.0),
        arm_linear=arm.get("linear", 0.0),
        arm_quadratic=arm.get("quadratic", 0.0),
    )
