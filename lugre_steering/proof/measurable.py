# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Found effects against the truth in quantities that an engineer would measure, with the interval that the parameters' intervals give.

The truth comes from the simulator that made the case, the answer from the estimator's own chain with the values that the
diagnosis wrote, both on the motion of ``probe``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lugre_steering.data.dataset import ideal_run
from lugre_steering.fitting.problem import Candidate, Problem, standing_effects
from lugre_steering.proof.made import Made
from lugre_steering.proof.probe import MEASURES, Seen, Trip, motion, sliding_torque
from lugre_steering.vehicle import load

Array = NDArray[np.float64]
Row = dict[str, Any]

EVERY = 10
"""The chain runs on every tenth sample of the probe: 100 Hz."""


def measured(made: Made, augmented: Path, diagnosis: Mapping[str, Any]) -> dict[str, Row]:
    """Of each hidden effect that was found under its name: what is measured, its true value, the answer's, and its 95 % interval."""
    named = {effect["id"]: effect["parameters"] for effect in diagnosis["effects"]}
    wanted = [effect for effect in made.hidden if effect.id in named and effect.id in MEASURES]
    if not wanted:
        return {}
    trip = motion(made.limit)
    truth = made.probe(np.stack([trip.angle, trip.angle]), float(trip.time[1]))
    chain, found = Chain(augmented, trip, truth.torque), {}
    for effect in wanted:
        what, unit, measure = MEASURES[effect.id]
        scale = sliding_torque(truth.without[effect.id])
        true = measure(Seen(trip, truth.torque, truth.without[effect.id], scale))
        value, low, high = chain.measured(effect.id, named[effect.id], scale)
        found[effect.id] = {"what": what, "unit": unit, "true": true, "value": value, "ci95": [low, high]}
    return found


class Chain:
    """The estimator's chain with the physics of a vehicle file, on the probe."""

    def __init__(self, augmented: Path, trip: Trip, torque: Array) -> None:
        vehicle = load(augmented)
        self.effects = standing_effects(vehicle)
        angle, rate, acceleration = (row[::EVERY] for row in (trip.angle, trip.rate, trip.acceleration))
        self.trip = Trip(trip.time[::EVERY], angle, rate, acceleration, trip.leg[::EVERY], trip.limit)
        bare, sides = replace(vehicle, effects=()), len(vehicle.sides)
        theta, omega, alpha = (np.stack([row] * sides) for row in (self.trip.angle, self.trip.rate, self.trip.acceleration))
        run = ideal_run(bare, "probe", self.trip.time, theta, (omega, alpha), torque[::EVERY], 1.0)
        self.problem = Problem(bare, [run])

    def torque(self, effects: list[tuple[Candidate, Mapping[str, float]]]) -> Array:
        return self.problem.predict(0, self.problem.start(), effects)

    def measured(self, id_: str, parameters: Mapping[str, Any], scale: float) -> tuple[float | None, float | None, float | None]:
        """Value and interval of an effect's measure: each parameter is moved to the ends of its interval, and the changes that
        this makes are added as squares. The covariance of parameters is not told, so that a trade-off between two makes it too wide.

        None for an effect that the vehicle file does not hold, as it acted in an earlier recording only."""
        if all(c.effect.id != id_ for c, _ in self.effects):
            return None, None, None
        without = self.torque([(c, values) for c, values in self.effects if c.effect.id != id_])

        def value(name: str = "", moved: float = 0.0) -> float | None:
            changed = [(c, _moved(c, values, name, moved) if c.effect.id == id_ else values) for c, values in self.effects]
            return MEASURES[id_][2](Seen(self.trip, self.torque(changed), without, scale))

        middle = value()
        if middle is None:
            return None, None, None
        down, up = 0.0, 0.0
        for name, entry in parameters.items():
            ends = [] if entry.get("ci95") is None else [end for end in (value(name, x) for x in entry["ci95"]) if end is not None]
            down += min([0.0, *(end - middle for end in ends)]) ** 2
            up += max([0.0, *(end - middle for end in ends)]) ** 2
        return middle, middle - float(np.sqrt(down)), middle + float(np.sqrt(up))


def _moved(candidate: Candidate, values: Mapping[str, float], name: str, to: float) -> dict[str, float]:
    """Values with one of them changed; the parameter of an effect on a line goes by the line's name."""
    key = next(iter(values)) if candidate.line and name == candidate.line else name
    return {**values, key: to} if key in values else dict(values)
