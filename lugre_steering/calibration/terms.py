# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a joint or axis has beside friction, as far as its recordings carry it: inertia, viscous friction, an offset, gravity."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lugre_steering import units
from lugre_steering.calibration.estimate import DRAWS, Estimate
from lugre_steering.calibration.result import FittedKey
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.noise import noise_model, repeated_motion
from lugre_steering.fitting.problem import Effects, Problem, is_rig
from lugre_steering.fitting.rig import carried
from lugre_steering.vehicle import EffectEntry, Vehicle

EDGE = 0.01
"""Share of the half of its interval within which a value stands at a bound."""


def terms_of(problem: Problem, seed: int = 0) -> Effects:
    """The terms and where their fit may begin; none for a vehicle, or for what the vehicle file has."""
    if not is_rig(problem.vehicle):
        return ()
    first = fit(problem, problem.sensor_weight, robust=True)
    noise = noise_model(problem, first.x, (), repeated_motion(problem, DRAWS, seed), seed=seed)
    weight = problem.valid / noise.sigma
    found = carried(problem, noise, weight, fit(problem, weight, start=first.x))
    return found[-1][0].effects if found else ()


def with_terms(vehicle: Vehicle, fitted: Estimate) -> Vehicle:
    """The vehicle with the terms as effects of its file, to seven digits."""
    entries = tuple(
        EffectEntry(candidate.effect.id, {name: float(f"{value:.7g}") for name, value in values.items() if value})
        for candidate, values in fitted.fit.effects
    )
    return vehicle.replace(effects=(*vehicle.effects, *entries))


def term_rows(problem: Problem, fitted: Estimate) -> Iterator[FittedKey]:
    """One row per value of the terms."""
    spread = np.sqrt(np.diag(fitted.covariance))[problem.nuisances :]
    free = [(candidate, name, values[name]) for candidate, values in fitted.fit.effects for name in candidate.free]
    for (candidate, name, value), deviation in zip(free, spread, strict=True):
        parameter, reach = candidate.parameter(name), float(fitted.quantile * deviation)
        yield FittedKey(
            name=f"{candidate.effect.id}.{name}",
            key=f"effects: {candidate.effect.id}.{name}",
            unit=units.label(problem.vehicle, parameter.unit),
            sheet=0.0,
            value=value,
            ci95=(value - reach, value + reach),
            relative_sd=float(deviation / max(abs(value), 1e-300)),
            prior_relative_sd=None,
            at_bound="low" if value < parameter.low + EDGE * reach else "high" if value > parameter.high - EDGE * reach else None,
            prior_dominated=False,
            advice=None,
        )  # fmt: skip
