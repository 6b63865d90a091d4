# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The simulated vehicle: the estimator's own chain on true angles, so that what it writes is known exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lugre_steering.chain.model import build_model
from lugre_steering.chain.step import Records, run_side
from lugre_steering.effects import catalogue
from lugre_steering.errors import DataError
from lugre_steering.recording import Array
from lugre_steering.simulate.manoeuvres import Motion
from lugre_steering.vehicle import EffectEntry, Vehicle


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
    return vehicle.replace(effects=(*vehicle.effects, *(_effect(vehicle, text) for text in texts)))


def _effect(vehicle: Vehicle, text: str) -> EffectEntry:
    name, _, rest = text.partition(":")
    entry = catalogue.effect(name)
    if entry.needs:
        raise DataError(f"effect '{text}': cannot be simulated; it needs {entry.needs}")
    ranges = {p.name: (p.low, p.high) for p in entry.parameters}
    if entry.per_line:
        ranges = dict.fromkeys(vehicle.hydraulics.lines if vehicle.hydraulics else (), next(iter(ranges.values())))
    values: dict[str, float] = {}
    for item in filter(None, rest.split(",")):
        key, _, number = item.partition("=")
        if key not in ranges:
            raise DataError(f"effect '{text}': no parameter '{key}'; {name} has {', '.join(ranges)}")
        low, high = ranges[key]
        try:
            values[key] = float(number)
        except ValueError:
            values[key] = np.nan
        if not low <= values[key] <= high:
            raise DataError(f"effect '{text}': '{key}': got '{number}', expected a number from {low:g} to {high:g}")
    # What may not be zero has no neutral value, so it cannot be left out.
    missing = [key for key, (low, high) in ranges.items() if key not in values and not low <= 0.0 <= high]
    if missing or not values:
        raise DataError(f"effect '{text}': lacks {', '.join(missing or ranges)}")
    return EffectEntry(name, values)
