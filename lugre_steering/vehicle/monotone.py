# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A smooth curve through a table that rises and falls only where the table does.

Written out, as SciPy's form of it alone would load half of SciPy into the live node (0.4 s of every start).
"""

from __future__ import annotations

import numpy as np

from lugre_steering.recording import Array


def monotone(axis: Array, values: Array, x: Array) -> Array:
    """Piecewise cubic Hermite interpolation (m,) of ``values`` (n,), n >= 2, over the rising ``axis`` (n,), at ``x`` (m,) inside it.

    F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300; the same numbers as ``scipy.interpolate.PchipInterpolator``.
    """
    step = np.diff(axis)
    slope = np.diff(values) / step
    rate = _rates(step, slope)
    bend = (rate[:-1] + rate[1:] - 2.0 * slope) / step
    piece = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, step.size - 1)
    s = x - axis[piece]
    square, cube = ((slope - rate[:-1]) / step - bend)[piece], (bend / step)[piece]
    curve: Array = values[piece] + rate[piece] * s + square * (s * s) + cube * (s * s * s)
    return curve


def _rates(step: Array, slope: Array) -> Array:
    """Derivative (n,) at each place: a harmonic mean of the slopes beside it, zero where they differ in sign."""
    if slope.size == 1:
        return np.repeat(slope, 2)
    before, after = slope[:-1], slope[1:]
    weight = 2.0 * step[1:] + step[:-1], step[1:] + 2.0 * step[:-1]
    alike = before * after > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = 1.0 / ((weight[0] / before + weight[1] / after) / (weight[0] + weight[1]))
    ends = _end(step[0], step[1], slope[0], slope[1]), _end(step[-1], step[-2], slope[-1], slope[-2])
    return np.concatenate([[ends[0]], np.where(alike, mean, 0.0), [ends[1]]])


def _end(step: float, next_step: float, slope: float, next_slope: float) -> float:
    """Derivative at an end: that of the parabola through three places, kept from overshooting."""
    rate = ((2.0 * step + next_step) * slope - step * next_slope) / (step + next_step)
    if rate * slope <= 0.0:
        return 0.0
    if slope * next_slope <= 0.0 and abs(rate) > 3.0 * abs(slope):
        return 3.0 * slope
    return rate
