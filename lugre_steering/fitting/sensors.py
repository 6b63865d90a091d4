# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What sound pressure sensors and clocks may add to a torque though no standstill shows it: hysteresis, a zero that settles, a clock.

Each has the size that data sheets allow; what they explain is no structure, and no name.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Array

HYSTERESIS = 5e-4
"""Of the range of a pressure sensor: half width of its loop."""
SETTLING, SETTLING_S = 2e-3, (10.0, 30.0, 100.0)
"""Of the range: how far a zero may be off when a recording starts, and how long it takes."""


@njit(cache=True)
def loop(pressure: Array, half_width: float) -> Array:
    """What a play of ``half_width`` [Pa] takes off a pressure (n,) [Pa], over its half width: -1 rising ... 1 falling."""
    out = np.empty_like(pressure)
    center = pressure[0]
    for i in range(pressure.size):
        center = min(max(center, pressure[i] - half_width), pressure[i] + half_width)
        out[i] = (center - pressure[i]) / half_width
    return out


def sensor_columns(problem: Problem, *, clocks: bool = True) -> list[tuple[slice, Array]]:
    """Torque [N m] of each in its size, with those of ``clocks`` or without, and which samples it belongs to: it is zero elsewhere."""
    columns: list[tuple[slice, Array]] = []
    for bag, run in enumerate(problem.runs):
        rows = [run.clock_s * np.gradient(run.measured, run.time)] if clocks else []
        if problem.vehicle.hydraulics is not None:
            span = problem.vehicle.sensors.pressure_range_Pa
            elapsed = run.time - run.time[0]
            for gain, pressure in zip(run.torque_per_line, run.pressure, strict=True):
                rows.append(HYSTERESIS * span * gain * loop(np.ascontiguousarray(pressure), HYSTERESIS * span))
                rows += [SETTLING * span * gain * np.exp(-elapsed / tau) for tau in SETTLING_S]
        columns += [(slice(problem.edges[bag], problem.edges[bag + 1]), row) for row in rows]
    return columns


def with_sensors(problem: Problem) -> Problem:
    """The problem with all these as bends, their sizes the most that they may be; where it has bends, the clocks are among them."""
    own = sensor_columns(problem, clocks=not problem.bends.shape[1])
    columns = np.zeros((problem.measured.size, len(own)))
    for k, (part, row) in enumerate(own):
        columns[part, k] = row
    return problem.bent([columns])


def fitted_with_sensors(problem: Problem, weight: Array, current: Fit) -> tuple[Problem, Fit]:
    """The problem with all these as bends, and the fit there of what a fit has."""
    there = with_sensors(problem)
    x = np.append(current.x, np.zeros(there.nuisances - current.x.size))
    return there, fit(there, weight, current.effects, x, linearisations=6)


def beside_sensors(problem: Problem, residual: Array, weight: Array, weighted: Array) -> Array:
    """Standardised residual (n,) without what sensors and clocks explain of it, their sizes standard deviations, the baseline moving along.

    ``weight`` (n,) one over sigma where valid, ``weighted`` (n, p) the baseline's own columns times the weight of its fit.
    """
    own = sensor_columns(problem)
    norms = np.linalg.norm(weighted, axis=0)
    moves = norms > 0.0
    columns = np.zeros((weight.size, len(own) + int(moves.sum())))  # filled in place: of a long recording it is the largest of all
    for k, (part, row) in enumerate(own):
        columns[part, k] = row * weight[part]
    np.divide(weighted[:, moves], norms[moves], out=columns[:, len(own) :])
    target = residual * weight
    # The baseline is only moved along: its own part of the residual has been fitted already.
    penalty = np.concatenate([np.ones(len(own)), np.full(int(moves.sum()), 1e-3)])
    values = np.linalg.solve(columns.T @ columns + np.diag(penalty**2), columns.T @ target)
    return np.asarray(target - columns @ values)
