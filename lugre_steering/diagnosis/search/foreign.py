# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Patterns that no catalogue entry makes: periodic in the angle, remembering the rate, ringing. They compete with the names.

A set of listed effects that imitates such a pattern would be a false answer; a pattern that explains more at fewer
parameters says "unlisted" instead.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from lugre_steering import units
from lugre_steering.chain.compiled import njit
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Array

ROUNDS = 3
"""Alternations between pattern and recalibration, which is not linear."""
RING_DAMPING, RING_STEPS = 0.03, 5
"""Damping ratio that is tried, and steps of its integration per sample."""


@dataclass(frozen=True)
class Pattern:
    """The strongest pattern: its torque (n,), the recalibration beside it, and its formula."""

    torque: Array
    beside: Fit
    text: str

    def cost(self, problem: Problem, weight: Array) -> float:
        """Weighted sum of squared errors that recalibration and pattern leave together, in noise variances."""
        return float(np.sum(((problem.measured - self.beside.prediction - self.torque) * weight) ** 2))


ColumnsOf = Callable[[float], Array]
Text = Callable[[float, Array], str]


@dataclass(frozen=True)
class _Family:
    """Columns (n, k) for one shape value, the values to try, and words for a fitted pattern."""

    grid: Sequence[float]
    columns: ColumnsOf
    text: Text
    more: ColumnsOf | None = None
    """Columns of the full pattern, once the shape is known; the same as ``columns`` if None."""


def strongest(problem: Problem, baseline: Fit, weight: Array) -> Pattern:
    """The pattern that explains most of what a fit leaves over (its effects stay), recalibrated beside it."""
    families = _families(problem, baseline)
    trials = [(family, value) for family in families for value in family.grid]
    basis = baseline.basis()
    family, value = min(trials, key=lambda trial: _left(problem, baseline, basis, trial[0].columns(trial[1]))[0])
    near = 1.0 + 1.0 / len(family.grid)
    value = float(np.exp(minimize_scalar(
        lambda log: _left(problem, baseline, basis, family.columns(float(np.exp(log))))[0],
        bounds=(np.log(value / near), np.log(value * near)), method="bounded", options={"xatol": 1e-4},
    ).x))  # fmt: skip
    columns, beside, rest = (family.more or family.columns)(value), baseline, copy.copy(problem)
    for _ in range(ROUNDS):
        coefficients = _left(problem, beside, beside.basis(), columns)[1]
        torque = columns @ coefficients
        rest.measured = problem.measured - torque
        beside = fit(rest, weight, beside.effects, beside, linearisations=6)
    return Pattern(torque, beside, family.text(value, coefficients))


def _left(problem: Problem, beside: Fit, basis: Array, columns: Array) -> tuple[float, Array]:
    """Energy left over by a pattern and a linear recalibration (``basis``) together, and the pattern's coefficients (k,)."""
    pattern = columns * beside.weight[:, None]
    pattern -= basis @ (basis.T @ pattern)
    error = (problem.measured - beside.prediction) * beside.weight
    error -= basis @ (basis.T @ error)
    coefficients = np.linalg.lstsq(pattern, error, rcond=1e-10)[0]
    return float(np.sum((error - pattern @ coefficients) ** 2)), np.asarray(coefficients, np.float64)


def _families(problem: Problem, baseline: Fit) -> tuple[_Family, ...]:
    vehicle, runs = problem.vehicle, problem.runs
    travel = max(float(np.ptp(run.theta)) for run in runs)
    sides = [run.theta for run in runs]
    rates = [run.omega.sum(axis=0) for run in runs]
    signs = [np.sign(np.where(np.abs(run.omega) > 1e-3 * run.angle_unit, run.omega, 0.0)).sum(axis=0) for run in runs]
    steps = [float(run.time[1] - run.time[0]) for run in runs]
    model = np.split(baseline.prediction, problem.edges[1:-1])

    def wave(period: float) -> Array:
        phases = [2.0 * np.pi * theta / period for theta in sides]
        return np.concatenate([np.column_stack([np.sin(p).sum(axis=0), np.cos(p).sum(axis=0)]) for p in phases])

    def with_harmonic(period: float) -> Array:
        return np.column_stack([wave(period), wave(0.5 * period)])

    def memory(tau: float) -> Array:
        return np.concatenate([
            np.column_stack([_low_pass(rate, dt / tau), _low_pass(sign, dt / tau)])
            for rate, sign, dt in zip(rates, signs, steps, strict=True)
        ])  # fmt: skip

    def ringing(frequency: float) -> Array:
        rung = [_ring(torque, dt, 2.0 * np.pi * frequency, RING_DAMPING) - torque for torque, dt in zip(model, steps, strict=True)]
        return np.concatenate(rung)[:, None]

    def periodic_text(period: float, c: Array) -> str:
        one, two = np.hypot(c[0], c[1]), np.hypot(c[2], c[3])
        shown = units.distance(vehicle, period, ".2f")
        return (
            f"sum over the sides of {one:.4g} sin(2 pi theta / {shown} {np.arctan2(c[1], c[0]):+.2f}) "
            f"+ {two:.3g} sin(4 pi theta / {shown} {np.arctan2(c[3], c[2]):+.2f})"
        )

    def memory_text(tau: float, c: Array) -> str:
        return f"{c[0]:+.4g} low-pass({tau:.2g} s) of omega {c[1]:+.4g} low-pass({tau:.2g} s) of sgn(omega)"

    def ringing_text(frequency: float, c: Array) -> str:
        return f"{c[0]:+.3g} (M through a mode of {frequency:.2f} Hz with damping {RING_DAMPING} - M)"

    shortest = max(travel / 60.0, 4.0 * float(np.median(np.abs(np.diff(sides[0][0])))))
    return (
        _Family(tuple(np.geomspace(shortest, travel / 3.0, 48)), wave, periodic_text, with_harmonic),
        _Family(tuple(np.geomspace(1.0, 12.0, 7)), memory, memory_text),
        _Family(tuple(np.geomspace(0.3, min(8.0, 0.1 / max(steps)), 32)), ringing, ringing_text),
    )


def _low_pass(value: Array, step_over_tau: float) -> Array:
    decay = np.exp(-step_over_tau)
    return np.asarray(lfilter([1.0 - decay], [1.0, -decay], value))


@njit(cache=True)
def _ring(force: Array, step: float, pulsation: float, damping: float) -> Array:
    """Deflection of a lightly damped mode in units of the force that holds it: x'' + 2 d w x' + w**2 x = w**2 F."""
    out = np.empty(force.size)
    x, speed = force[0], 0.0
    fine = step / RING_STEPS
    for k in range(force.size):
        before = force[max(k - 1, 0)]
        for i in range(RING_STEPS):
            push = before + (force[k] - before) * (i + 0.5) / RING_STEPS
            speed += fine * (pulsation**2 * (push - x) - 2.0 * damping * pulsation * speed)
            x += fine * speed
        out[k] = x
    return out
