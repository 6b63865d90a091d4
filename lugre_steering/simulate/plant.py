# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The simulated vehicle: the estimator's own chain on true angles, so that what it writes is known exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lugre_steering.chain.step import Records, run_side
from lugre_steering.errors import DataError
from lugre_steering.recording import Array
from lugre_steering.simulate.manoeuvres import Motion
from lugre_steering.vehicle import EffectEntry, Vehicle, add_effect
from lugre_steering.vehicle.model import build_model


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
    truth = Truth(motion, np.stack([run_side(p, model.rubber, motion.time, *row) for p, *row in rows]))
    if not np.isfinite(truth.torque).all():
        raise DataError(f"vehicle '{vehicle.name}': the simulated torque is not finite; check its effects' parameters")
    return truth


def with_effects(vehicle: Vehicle, texts: list[str]) -> Vehicle:
    """The vehicle with effects added, each written ``id:parameter=value,parameter=value`` (SI)."""
    for text in texts:
        vehicle = _with_effect(vehicle, text)
    return vehicle


def _with_effect(vehicle: Vehicle, text: str) -> Vehicle:
    def fail(key: str, value: object, expected: str) -> DataError:
        return DataError(f"effect '{text}': '{key.removeprefix('parameters.')}': got {value!r}, expected {expected}")

    name, _, rest = text.partition(":")
    values: dict[str, float] = {}
    for item in filter(None, rest.split(",")):
        key, _, number = item.partition("=")
        if key in values:
            raise fail(key, number, "each parameter once")
        try:
            values[key] = float(number)
        except ValueError as error:
            raise fail(key, number, "a number") from error
    return add_effect(vehicle, EffectEntry(name, values), fail)
