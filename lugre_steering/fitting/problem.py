# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Predicting a recording: calibration values and trial physics in, the torque that the sensors would show out."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np

from lugre_steering.chain.compose import SENSOR_HOOKS
from lugre_steering.chain.lag import lagged
from lugre_steering.chain.step import torque_in_phases
from lugre_steering.data.dataset import Run
from lugre_steering.effects.entry import Effect, Parameter
from lugre_steering.effects.registry import effect as catalogue_entry
from lugre_steering.recording import Array
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.model import Model, build_model

T = TypeVar("T")
R = TypeVar("R")


def in_threads(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Map over threads (the compiled chain releases the interpreter lock), results in order."""
    if len(items) < 2:
        return [function(item) for item in items]
    return list(_pool().map(function, items))


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    """One pool for the process; the mapped functions never map themselves. LUGRE_STEERING_THREADS limits its size."""
    wanted = os.environ.get("LUGRE_STEERING_THREADS", "")
    return ThreadPoolExecutor(int(wanted) if wanted.isdigit() and int(wanted) > 0 else os.cpu_count() or 1)


@dataclass(frozen=True)
class Calibration:
    """One baseline value that a vehicle sheet may have wrong.

    ``apply`` turns a change x into new parameter-record values; x = 0 is the sheet, ``prior`` its standard deviation.
    Factors enter as exp(x), so a doubling and a halving are equally far from the sheet.
    """

    name: str
    fields: tuple[str, ...]
    prior: float
    low: float
    high: float
    additive: bool = False


FRICTION = Calibration("friction_level", ("static_torque", "coulomb_torque"), 0.15, -0.6, 0.6)
STATIC = Calibration("static_ratio", ("static_torque",), 0.12, -0.3, 0.5, additive=True)
STIFFNESS = Calibration("stiffness", ("sigma_0",), 0.15, -0.6, 0.6)
STRIBECK = Calibration("stribeck_speed", ("stribeck_speed",), 0.15, -0.7, 0.7)
CAPACITY = Calibration("heat_capacity", ("heat_capacity",), 0.15, -0.6, 0.6)
COOLING = Calibration("cooling", ("cooling",), 0.15, -0.6, 0.6)
KINGPIN = Calibration("kingpin_arm", ("aligning_torque",), 0.15, -0.6, 0.6)
GAIN = Calibration("pressure_gain", (), 0.03, -0.3, 0.3)
"""Scales the torque that the pressures show, no field of the chain."""
STANDARD = (FRICTION, STATIC, STIFFNESS, STRIBECK, CAPACITY, COOLING)


def calibrations_for(vehicle: Vehicle) -> tuple[Calibration, ...]:
    """The standard set; a vehicle without rubber has nothing thermal to calibrate."""
    return STANDARD if vehicle.rubber is not None else (FRICTION, STATIC, STIFFNESS, STRIBECK)


@dataclass(frozen=True)
class Candidate:
    """An effect as it is tried: with fixed shape values, on one line or all bags, with free parameters named in ``free``.

    ``since``: time [s] in each bag from which it acts; empty if it always does.
    """

    effect: Effect
    shapes: tuple[tuple[str, float], ...] = ()
    line: str = ""
    bags: tuple[int, ...] | None = None
    free: tuple[str, ...] = ()
    since: tuple[float, ...] = ()

    @property
    def label(self) -> str:
        return self.effect.id + (f"[{self.line}]" if self.line else "")

    def parameter(self, name: str) -> Parameter:
        return next(p for p in self.effect.parameters if p.name == name)

    def active_in(self, bag: int) -> bool:
        return self.bags is None or bag in self.bags

    def start(self, bag: int) -> float:
        return self.since[bag] if self.since else -np.inf


Values = Mapping[str, float]


def standing_effects(vehicle: Vehicle) -> tuple[tuple[Candidate, Values], ...]:
    """Effects that the vehicle file already has, at their values."""
    found: list[tuple[Candidate, Values]] = []
    for entry in vehicle.effects:
        effect = catalogue_entry(entry.id)
        if effect.per_line:
            name = effect.parameters[0].name
            found += [(Candidate(effect, line=line), {name: value}) for line, value in entry.parameters.items()]
        else:
            found.append((Candidate(effect), dict(entry.parameters)))
    return tuple(found)


class Problem:
    """Several runs of one vehicle, and the vector x = (calibration, bristle at the start of each bag, effect parameters)."""

    def __init__(
        self, vehicle: Vehicle, runs: Sequence[Run], calibrations: Sequence[Calibration] | None = None, *, more_laws: int = 0
    ) -> None:
        """``more_laws``: so many laws are tried in place of effects of the catalogue, of which only the vehicle's are there."""
        self.vehicle = vehicle
        self.runs = list(runs)
        self.model: Model = build_model(vehicle, lean=more_laws > 0, more_laws=more_laws)
        self.calibrations = tuple(calibrations_for(vehicle) if calibrations is None else calibrations)
        self.measured = np.concatenate([run.measured for run in runs])
        self.valid = np.concatenate([run.valid for run in runs])
        self.bag = np.concatenate([np.full(run.time.size, i) for i, run in enumerate(runs)])
        self.edges = np.concatenate([[0], np.cumsum([run.time.size for run in runs])])
        record = self.model.parameters[0][0]
        self.presliding = float(record["coulomb_torque"] / record["sigma_0"])
        self.standing = standing_effects(vehicle)
        self._lines = vehicle.hydraulics.lines if vehicle.hydraulics is not None else ()

    @property
    def nuisances(self) -> int:
        """Calibration values and one initial bristle deflection per bag."""
        return len(self.calibrations) + len(self.runs)

    def start(self) -> Array:
        return np.zeros(self.nuisances)

    def scales(self) -> Array:
        """Finite-difference and normalisation scale of the nuisance part of x."""
        return np.array([c.prior for c in self.calibrations] + [1.0] * len(self.runs))

    def bounds(self) -> tuple[Array, Array]:
        low = np.array([c.low for c in self.calibrations] + [-1.5] * len(self.runs))
        high = np.array([c.high for c in self.calibrations] + [1.5] * len(self.runs))
        return low, high

    def fields(self, x: Array) -> dict[str, float]:
        """Baseline parameter-record values for the calibration part of x."""
        record = self.model.parameters[0][0]
        values: dict[str, float] = {}
        for calibration, change in zip(self.calibrations, x, strict=False):
            for field in calibration.fields:
                old = values.get(field, float(record[field]))
                if calibration.additive:
                    values[field] = old + change * values.get("coulomb_torque", float(record["coulomb_torque"]))
                else:
                    values[field] = old * float(np.exp(change))
        if "static_torque" in values:
            coulomb = values.get("coulomb_torque", float(record["coulomb_torque"]))
            values["static_torque"] = max(values["static_torque"], 0.3 * coulomb)
        return values

    def gain(self, x: Array) -> float:
        """Factor on the sheet's pressure gain."""
        return float(np.exp(sum(x[i] for i, c in enumerate(self.calibrations) if c.name == GAIN.name)))

    def torque(
        self, bag: int, x: Array, effects: Sequence[tuple[Candidate, Values]] = (), run: Run | None = None
    ) -> Array:
        """Model torque of one bag (n,) with all effects, before the sensors; ``run`` in place of the bag's own motion."""
        run = run or self.runs[bag]
        record = self.model.parameters[0].copy()
        for field, value in self.fields(x).items():
            record[field] = value
        record["initial_bristle"] = x[len(self.calibrations) + bag] * self.presliding
        phases = []
        for start in sorted({-np.inf, *(candidate.start(bag) for candidate, _ in effects), *(since for since, _ in run.air)}):
            acting = record.copy()
            for since, air in run.air:
                if since <= start:
                    acting["air_temperature"] = air
            for candidate, values in effects:
                if candidate.start(bag) <= start and not candidate.effect.per_line:
                    for field, number in candidate.effect.fields(values).items():
                        acting[field] = number
            phases.append((start, acting))
        total = np.zeros(run.time.size)
        for side in range(run.theta.shape[0]):
            motion = run.theta[side], run.omega[side], run.alpha[side]
            total += torque_in_phases(phases, self.model.rubber, run.time, *motion)
        return total

    def predict(
        self, bag: int, x: Array, effects: Sequence[tuple[Candidate, Values]] = (), run: Run | None = None
    ) -> Array:
        """Measured torque that the model expects in one bag (n,): sensor effects included, those of the vehicle file too.

        An effect that stands in the file and is given again counts as given.
        """
        run = run or self.runs[bag]
        here = [effect for effect in effects if effect[0].active_in(bag)]
        torque = self.torque(bag, x, here, run)
        given = {candidate.label for candidate, _ in here}
        for candidate, values in [*(effect for effect in self.standing if effect[0].label not in given), *here]:
            start = candidate.start(bag)
            if candidate.effect.hooks.keys() & SENSOR_HOOKS:
                changed = self._through_sensor(run, candidate, values, torque, start)
                torque = np.where(run.time >= start, changed, torque) if candidate.since else changed
        return torque / self.gain(x)

    def _through_sensor(self, run: Run, candidate: Candidate, values: Values, torque: Array, start: float) -> Array:
        """Apply one sensor effect by its laws; errors of angles and arms act through the slopes and parts of the measured torque."""
        known = candidate.effect
        if "lag" in known.hooks:
            torque = lagged(torque, run.time[1] - run.time[0], known.law("lag", values))
        if "delay" in known.hooks:
            torque = np.interp(run.time - known.law("delay", values), run.time, torque)
        if "line" in known.hooks:
            elapsed = np.maximum(run.time - max(start, 0.0), 0.0)
            torque = torque + run.torque_per_line[self._lines.index(candidate.line)] * known.law("line", values, elapsed=elapsed)
        if "angle" in known.hooks:
            torque = torque + ((run.theta - known.law("angle", values, theta=run.theta)) * run.side_slope).sum(axis=0)
        if "arm" in known.hooks:
            torque = torque - ((known.law("arm", values, theta=run.theta) - 1.0) * run.side_torque).sum(axis=0)
        return np.asarray(torque)

    def predict_all(self, x: Array, effects: Sequence[tuple[Candidate, Values]] = ()) -> Array:
        return np.concatenate(in_threads(lambda bag: self.predict(bag, x, effects), range(len(self.runs))))
