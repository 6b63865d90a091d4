# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How else the law of a named effect may be: its torque bent at some places along its own coordinate.

A wrong shape of the first effect must not be given a name of its own.
"""

from __future__ import annotations

import numpy as np

from lugre_steering.diagnosis.search import locate
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Array

KNOTS, FEWEST = 7, 3
"""Places at most, and at least for a law to have a shape."""
OTHER_AXIS = {"motion": "torque", "thermal": "accumulated slip", "parallel_torque": "steering angle", "measurement": "torque"}
"""Coordinate for effects whose own one is no signal, by stage; angle since reversal for the contact."""


def bends(problem: Problem, current: Fit, index: int) -> Array:
    """Columns (n, k): the torque of one effect near each of some places along its own coordinate; they add up to it where valid."""
    effect = current.effects[index][0].effect
    axes = [locate.coordinates(run, run.measured) for run in problem.runs]
    axis = effect.coordinate if effect.coordinate in axes[0] else OTHER_AXIS.get(effect.stage, "angle since reversal")
    # Laws are odd or even: a difference between the two directions is physics of its own.
    coordinate = np.abs(np.concatenate([bag[axis] for bag in axes]))
    part = locate.contribution(problem, current, index)
    part = np.where(problem.valid, part, 0.0)
    acting = np.abs(part) > 1e-3 * np.max(np.abs(part))
    knots = np.unique(np.quantile(coordinate[acting], np.linspace(0.0, 1.0, KNOTS))) if acting.any() else np.zeros(0)
    if knots.size < FEWEST:  # a direction has no places
        return np.asarray(part[:, None])
    columns = np.array([np.interp(coordinate, knots, row) for row in np.eye(knots.size)])
    return np.asarray((columns * part).T)
