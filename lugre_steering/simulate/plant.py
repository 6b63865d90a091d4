# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The simulated vehicle: the estimator's own chain on true angles, so that what it writes is known exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lugre_steering.chain.layout import EFFECT_FIELDS
from lugre_steering.chain.model import build_model
from lugre_steering.chain.step import Records, run_side
from lugre_steering.errors import DataError
from lugre_steering.recording import Array
from lugre_steering.simulate.manoeuvres import Motion
from lugre_steering.vehicle import EffectEntry, Vehicle

_SENSOR_EFFECTS = {
    "time_delay": ("delay",),
    "pressure_lag": ("tau",),
    "moment_arm_error": ("linear", "quadratic"),
}
_LINE_EFFECTS = ("pressure_offset", "pressure_drift")


@dataclass(frozen=True)
class Truth:
    """A noise-free run: ``tracks`` (sides, n) are the chain's output records, ``torque`` (n,) [N m] their sum."""

    motion: Motion
    tracks: Records

    @property
    def torque(self) -> Array:
        total: Array = self.tracks["torque"].sum(axis=0)
        return total

    def part(self, name: str) -> Array:
        """One part of the torque [N m] (n,), all tracks together; see ``OUTPUT_FIELDS``."""
        total: Array = self.tracks[name].sum(axis=0)
        return total


def run(vehicle: Vehicle, motion: Motion) -> Truth:
    """Torques and temperatures of all tracks for true angles, with the effects of the vehicle file."""
    model = build_model(vehicle)
    rows = zip(model.parameters, motion.theta, motion.rate, motion.acceleration, strict=True)
    return Truth(motion, np.stack([run_side(p, model.rubber, motion.time, *row) for p, *row in rows]))


def with_effects(vehicle: Vehicle, texts: list[str]) -> Vehicle:
    """The vehicle with effects added, each written ``id:parameter=value,parameter=value`` (SI)."""
    return vehicle.replace(effects=(*vehicle.effects, *(_effect(vehicle, text) for text in texts)))


def _effect(vehicle: Vehicle, text: str) -> EffectEntry:
    name, _, rest = text.partition(":")
    known = _parameters_of(name, vehicle)
    if not known:
        raise DataError(
            f"effect '{text}': no effect '{name}' that a simulation can carry; expected id:parameter=value,..."
        )
    values: dict[str, float] = {}
    for item in filter(None, rest.split(",")):
        key, _, number = item.partition("=")
        if key not in known:
            raise DataError(f"effect '{text}': no parameter '{key}'; {name} has {', '.join(known)}")
        try:
            values[key] = float(number)
        except ValueError:
            values[key] = np.nan
        if not np.isfinite(values[key]):
            raise DataError(f"effect '{text}': parameter '{key}': got '{number}', expected a number")
    if not values:
        raise DataError(f"effect '{text}': names no parameter; {name} has {', '.join(known)}")
    return EffectEntry(name, values)


def _parameters_of(effect: str, vehicle: Vehicle) -> tuple[str, ...]:
    if effect in _LINE_EFFECTS:
        return vehicle.hydraulics.lines if vehicle.hydraulics else ()
    chain = tuple(field.removeprefix(f"{effect}_") for field in EFFECT_FIELDS if field.startswith(f"{effect}_"))
    return chain or _SENSOR_EFFECTS.get(effect, ())
