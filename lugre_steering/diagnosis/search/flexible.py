# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How much of what is left over a freer shape of an effect already named would explain: a test before a second name.

The effect's torque is multiplied by a piecewise linear function of the size of its own coordinate that keeps its sign, with
the recalibration free beside it. A wrong shape of the first effect must not be given a name of its own.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

from lugre_steering.diagnosis.search import locate
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Array

KNOTS = 7
OTHER_AXIS = {"motion": "torque", "thermal": "accumulated slip", "parallel_torque": "steering angle", "measurement": "torque"}
"""Coordinate for effects whose own one is no signal, by stage; angle since reversal for the contact."""


def explained(problem: Problem, current: Fit, weight: Array, index: int) -> float:
    """Energy that a free shape of one effect of a fit takes from its errors, in noise variances."""
    error, columns = _shape(problem, current, weight, index)
    return _taken(error, columns)


def beyond(problem: Problem, current: Fit, weight: Array, index: int, change: Array) -> float:
    """Energy that a ``change`` (n,) [N m] of the prediction takes of what a free shape of one effect leaves, in noise variances."""
    error, columns = _shape(problem, current, weight, index)
    basis = current.basis()
    column = change * weight
    column -= basis @ (basis.T @ column)
    return _taken(error, np.column_stack([columns, column])) - _taken(error, columns)


def _shape(problem: Problem, current: Fit, weight: Array, index: int) -> tuple[Array, Array]:
    """Weighted errors (n,) of a fit, and columns (n, k) of the freedom of one effect's shape; recalibration taken out of both.

    What recalibration alone would still gain is no merit of the shape.
    """
    basis = current.basis()
    error = (problem.measured - current.prediction) * weight
    columns = bends(problem, current, weight, index)
    if columns.shape[1] < 3:
        columns = columns[:, :0]
    return error - basis @ (basis.T @ error), columns - basis @ (basis.T @ columns)


def bends(problem: Problem, current: Fit, weight: Array, index: int) -> Array:
    """Weighted columns (n, k): the torque of one effect near each of some places along its own coordinate; they add up to it."""
    effect = current.effects[index][0].effect
    axes = [locate.coordinates(run, run.measured) for run in problem.runs]
    axis = effect.coordinate if effect.coordinate in axes[0] else OTHER_AXIS.get(effect.stage, "angle since reversal")
    # Laws are odd or even: a difference between the two directions is physics of its own.
    coordinate = np.abs(np.concatenate([bag[axis] for bag in axes]))
    part = locate.contribution(problem, current, index)
    acting = np.abs(part) * weight > 1e-3 * np.max(np.abs(part) * weight)
    knots = np.unique(np.quantile(coordinate[acting], np.linspace(0.0, 1.0, KNOTS))) if acting.any() else np.zeros(0)
    if knots.size < 3:  # a direction has no places
        return np.asarray((part * weight)[:, None])
    columns = np.array([np.interp(coordinate, knots, row) for row in np.eye(knots.size)])
    return np.asarray((columns * part).T * weight[:, None])


def _taken(error: Array, columns: Array) -> float:
    """Energy of the error (n,) that the best mixture of columns takes, none turning a shape around."""
    if not columns.shape[1]:
        return 0.0
    solution = lsq_linear(columns, error, (-1.0, np.inf)).x
    return float(error @ error - np.sum((error - columns @ solution) ** 2))
