# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Predicting a recording: calibration values and trial physics in, the torque that the sensors would show out."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeVar

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import lsq_linear

from lugre_steering.chain.layout import EFFECT_FIELDS
from lugre_steering.chain.model import Model, build_model
from lugre_steering.chain.step import torque_side
from lugre_steering.diagnosis.dataset import Run
from lugre_steering.effects.entry import Effect, Parameter
from lugre_steering.recording import Array
from lugre_steering.vehicle import Vehicle

ROBUST = 3.0
"""Standard deviations beyond which the robust fit counts an error linearly."""

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


class Problem:
    """Several runs of one vehicle, and the vector x = (calibration, bristle at the start of each bag, effect parameters)."""

    def __init__(
        self, vehicle: Vehicle, runs: Sequence[Run], calibrations: Sequence[Calibration] | None = None
    ) -> None:
        self.vehicle = vehicle
        self.runs = list(runs)
        self.model: Model = build_model(vehicle)
        self.calibrations = tuple(calibrations_for(vehicle) if calibrations is None else calibrations)
        self.measured = np.concatenate([run.measured for run in runs])
        self.valid = np.concatenate([run.valid for run in runs])
        self.bag = np.concatenate([np.full(run.time.size, i) for i, run in enumerate(runs)])
        self.edges = np.concatenate([[0], np.cumsum([run.time.size for run in runs])])
        record = self.model.parameters[0][0]
        self.presliding = float(record["coulomb_torque"] / record["sigma_0"])
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
            values["static_torque"] = max(values["static_torque"], 0.3 * values["coulomb_torque"])
        return values

    def gain(self, x: Array) -> float:
        """Factor on the sheet's pressure gain."""
        return float(np.exp(sum(x[i] for i, c in enumerate(self.calibrations) if c.name == GAIN.name)))

    def torque(
        self, bag: int, x: Array, effects: Sequence[tuple[Candidate, Values]] = (), run: Run | None = None
    ) -> Array:
        """Model torque of one bag (n,) with all effects on, before the sensors; ``run`` in place of the bag's own motion."""
        run = run or self.runs[bag]
        record = self.model.parameters[0].copy()
        for field, value in self.fields(x).items():
            record[field] = value
        record["initial_bristle"] = x[len(self.calibrations) + bag] * self.presliding
        for candidate, values in effects:
            for name, value in values.items():
                field = f"{candidate.effect.id}_{name}"
                if field in EFFECT_FIELDS:
                    record[field] = value
        total = np.zeros(run.time.size)
        for side in range(run.theta.shape[0]):
            total += torque_side(record, self.model.rubber, run.time, run.theta[side], run.omega[side], run.alpha[side])
        return total

    def predict(
        self, bag: int, x: Array, effects: Sequence[tuple[Candidate, Values]] = (), run: Run | None = None
    ) -> Array:
        """Measured torque that the model expects in one bag (n,): sensor effects included."""
        run = run or self.runs[bag]
        here = [effect for effect in effects if effect[0].active_in(bag)]
        expected = np.zeros(run.time.size)
        # What begins late is blended in: its own memory of the time before does not matter to what it does after.
        for start in sorted({-np.inf, *(candidate.start(bag) for candidate, _ in here)}):
            begun = run.time >= start
            if begun.any():
                acting = [effect for effect in here if effect[0].start(bag) <= start]
                torque = self.torque(bag, x, acting, run)
                for candidate, values in acting:
                    torque = self._through_sensor(run, candidate, values, torque)
                expected[begun] = torque[begun]
        return expected / self.gain(x)

    def _through_sensor(self, run: Run, candidate: Candidate, values: Values, torque: Array) -> Array:
        """Apply one sensor effect: lag, delay, line offset or drift, arm error (see effects.sensors for the live form)."""
        name = candidate.effect.id
        if name == "pressure_lag":
            changed = _lagged(torque, run.time[1] - run.time[0], values["tau"])
        elif name == "time_delay":
            changed = np.interp(run.time - values["delay"], run.time, torque)
        elif name in ("pressure_offset", "pressure_drift"):
            gain = run.torque_per_line[self._lines.index(candidate.line)]
            changed = torque + gain * (values["offset"] if name == "pressure_offset" else values["drift"] * run.time)
        elif name == "angle_offset":
            changed = torque + values["offset"] * run.side_slope.sum(axis=0)
        elif name == "angle_scale":
            changed = torque + values["scale"] * (run.theta * run.side_slope).sum(axis=0)
        elif name == "moment_arm_error":
            factor = values.get("linear", 0.0) * run.theta + values.get("quadratic", 0.0) * run.theta**2
            changed = torque - (factor * run.side_torque).sum(axis=0)
        else:
            changed = torque
        return np.asarray(changed)

    def predict_all(self, x: Array, effects: Sequence[tuple[Candidate, Values]] = ()) -> Array:
        return np.concatenate(in_threads(lambda bag: self.predict(bag, x, effects), range(len(self.runs))))


def _lagged(torque: Array, dt: float, tau: float) -> Array:
    """First-order lag of a uniformly sampled signal, exact for piecewise linear input between samples."""
    if tau < 0.02 * dt:
        return torque
    from scipy.signal import lfilter

    decay = np.exp(-dt / tau)
    ramp = (1.0 - decay) * tau / dt  # response at the end of a unit ramp is 1 - ramp
    filtered, _ = lfilter([1.0 - ramp, ramp - decay], [1.0, -decay], torque, zi=[torque[0] * (1.0 - (1.0 - ramp))])
    return np.asarray(filtered)


@dataclass(frozen=True)
class Fit:
    """Result of a joint fit: nuisance x, effects with their values, prediction (n,), weighted cost, Jacobian at the end."""

    x: Array
    effects: tuple[tuple[Candidate, dict[str, float]], ...]
    prediction: Array
    cost: float
    jacobian: Array
    covariance: Array

    def with_effects(self, effects: Sequence[tuple[Candidate, dict[str, float]]]) -> Fit:
        return replace(self, effects=tuple(effects))


def fit(
    problem: Problem,
    weight: Array,
    effects: Sequence[tuple[Candidate, Mapping[str, float]]] = (),
    start: Array | None = None,
    *,
    evaluations: int = 12,
    robust: bool = False,
    priors: bool = True,
    tolerance: float = 1e-6,
) -> Fit:
    """Joint bounded least squares of calibration, initial bristles and the free parameters of all effects.

    ``weight`` (n,) is 1 / sigma, zero where a sample must not be used. Priors of the calibration enter as extra residuals.
    ``tolerance``: relative fall of the cost per step below which the fit ends. ``robust`` bounds the influence of samples
    beyond ROBUST sigma (soft L1); ``priors`` off leaves it all to the data.
    """
    x0 = problem.start() if start is None else start
    low, high = problem.bounds()
    free = [(i, effects[i][0].parameter(name)) for i, (candidate, _) in enumerate(effects) for name in candidate.free]
    scale = problem.scales()
    values0 = [dict(values) for _, values in effects]
    p0 = np.concatenate([x0 / scale, [parameter.scaled(values0[i].get(parameter.name, 0.0)) for i, parameter in free]])
    low = np.concatenate([low / scale, [parameter.scaled(parameter.low) for _, parameter in free]])
    high = np.concatenate([high / scale, [parameter.scaled(parameter.high) for _, parameter in free]])
    prior = np.array([float(priors)] * len(problem.calibrations) + [0.3] * len(problem.runs) + [0.0] * len(free))
    n = problem.nuisances

    def unpack(p: Array) -> tuple[Array, list[tuple[Candidate, dict[str, float]]]]:
        values = [dict(v) for v in values0]
        for (i, parameter), number in zip(free, p[n:], strict=True):
            values[i][parameter.name] = parameter.unscaled(float(number))
        return p[:n] * scale, [(candidate, v) for (candidate, _), v in zip(effects, values, strict=True)]

    def prediction(p: Array) -> Array:
        return problem.predict_all(*unpack(p))

    def jacobian(p: Array, base: Array) -> Array:
        columns = in_threads(lambda j: _column(problem, unpack, p, j, n, high, base), range(p.size))
        return np.column_stack(columns) * weight[:, None]

    p = np.clip(p0, low, high)
    base = prediction(p)
    damping = 1e-3
    for _ in range(evaluations):
        slope = jacobian(p, base)
        error = (base - problem.measured) * weight
        influence = 1.0 / np.sqrt(1.0 + (error / ROBUST) ** 2) if robust else np.ones_like(error)
        normal = slope.T @ (slope * influence[:, None]) + np.diag(prior**2)
        gradient = slope.T @ (error * influence) + prior**2 * p
        before = _cost(error, p * prior, robust)
        while damping < 1e6:
            trial = np.clip(p + _bounded_step(normal, gradient, damping, low - p, high - p), low, high)
            moved = prediction(trial)
            after = _cost((moved - problem.measured) * weight, trial * prior, robust)
            if after < before:
                break
            damping *= 8.0
        else:
            break
        p, base, damping = trial, moved, max(damping / 6.0, 1e-9)
        if before - after < tolerance * after:
            break
    x, fitted = unpack(p)
    final = jacobian(p, base)
    natural = np.concatenate([scale, [parameter.slope(float(number)) for (_, parameter), number in zip(free, p[n:], strict=True)]])
    covariance = np.asarray(np.linalg.pinv(final.T @ final + np.diag(prior**2), rcond=1e-12) * np.outer(natural, natural), float)
    return Fit(
        x, tuple(fitted), base, _cost((base - problem.measured) * weight, p * prior, False), final / natural, covariance
    )


def _cost(error: Array, prior_error: Array, robust: bool) -> float:
    """Sum of squares, or its soft L1 form beyond ROBUST."""
    if robust:
        return float(2.0 * ROBUST**2 * np.sum(np.sqrt(1.0 + (error / ROBUST) ** 2) - 1.0) + prior_error @ prior_error)
    return float(error @ error + prior_error @ prior_error)


def _bounded_step(normal: Array, gradient: Array, damping: float, low: Array, high: Array) -> Array:
    """Levenberg-Marquardt step that respects bounds: min 1/2 d'(A + damping diag A) d + g'd, low <= d <= high.

    The small normal equations keep the cost of a step independent of the number of samples.
    """
    diagonal = np.diag(normal)
    damped = normal + np.diag(damping * diagonal + 1e-9 * max(float(diagonal.max()), 1e-30))
    factor = np.linalg.cholesky(damped)
    span = np.maximum(high - low, 1e-12)
    target = solve_triangular(factor, -gradient, lower=True)
    return np.asarray(lsq_linear(factor.T, target, (low, low + span), method="bvls").x)


def _column(
    problem: Problem,
    unpack: Callable[[Array], tuple[Array, list[tuple[Candidate, dict[str, float]]]]],
    p: Array,
    j: int,
    nuisances: int,
    high: Array,
    base: Array,
) -> Array:
    """One Jacobian column by a forward (or, at the upper bound, backward) difference of 2 % of the parameter's scale."""
    step = 0.02 if p[j] + 0.02 <= high[j] else -0.02
    moved = p.copy()
    moved[j] += step
    x, effects = unpack(moved)
    bag = j - len(problem.calibrations)
    if 0 <= bag < len(problem.runs) and j < nuisances:
        column = np.zeros_like(base)
        part = slice(problem.edges[bag], problem.edges[bag + 1])
        column[part] = (problem.predict(bag, x, effects) - base[part]) / step
        return column
    moved_prediction = np.concatenate([problem.predict(i, x, effects) for i in range(len(problem.runs))])
    return (moved_prediction - base) / step
