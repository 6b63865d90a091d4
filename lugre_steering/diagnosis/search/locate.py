# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Locating: where in time, and along which coordinate, physics acts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lugre_steering.data.dataset import Run
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Array

ACTIVE_SHARE = 0.05
"""An effect is active where its torque exceeds this share of its largest torque."""
BRIDGE_S = 0.5
"""Shorter pauses are bridged: one stretch for an engineer."""
BINS = 24
"""Of a coordinate, equally filled, in which structure is looked for."""


def contribution(problem: Problem, result: Fit, index: int) -> Array:
    """Torque (n,) that one effect of a fit adds to the prediction, everything else as fitted."""
    without = [effect for i, effect in enumerate(result.effects) if i != index]
    return result.prediction - problem.predict_all(result.x, without)


def intervals(time: Array, part: Array) -> tuple[tuple[float, float], ...]:
    """Stretches [s] in which |part| exceeds ACTIVE_SHARE of its largest value; shorter pauses than BRIDGE_S are bridged."""
    size = np.abs(part)
    top = float(np.max(size)) if size.size else 0.0
    if top <= 0.0:
        return ()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (size > ACTIVE_SHARE * top).astype(int), [0]])))
    found: list[list[float]] = []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        start, end = float(time[a]), float(time[b - 1])
        if found and start - found[-1][1] < BRIDGE_S:
            found[-1][1] = end
        else:
            found.append([start, end])
    step = float(time[1] - time[0])
    return tuple((start, end) for start, end in found if end - start > 3.0 * step)


def coordinates(run: Run, torque: Array, temperature: Array | None = None) -> dict[str, Array]:
    """State-space coordinates (n,) of one run, by the names of ``units.COORDINATE_UNITS``."""
    mean_rate = run.omega.mean(axis=0)
    dt = run.time[1] - run.time[0]
    moving = np.abs(mean_rate) > 1e-3 * run.angle_unit
    since, dwell, travelled, rest, last = np.zeros(run.time.size), np.zeros(run.time.size), 0.0, 0.0, 0.0
    for i, rate in enumerate(mean_rate):
        if moving[i]:
            travelled = 0.0 if np.sign(rate) == -last else travelled + abs(rate) * dt
            last, rest = np.sign(rate), 0.0
        else:
            rest += dt
        since[i], dwell[i] = travelled, rest
    inner = run.theta[np.argmax(np.abs(run.theta), axis=0), np.arange(run.time.size)]
    found = {
        "steering angle": inner,
        "|steering angle|": np.abs(inner),
        "steering rate": mean_rate,
        "steering acceleration": run.alpha.mean(axis=0),
        "angle since reversal": since,
        "accumulated slip": np.cumsum(np.abs(mean_rate)) * dt,
        "dwell": dwell,
        "direction": np.sign(mean_rate) * moving,
        "time": run.time,
        "torque": torque,
        "torque rate": np.gradient(torque, run.time),
        "pressure sum": run.pressure.sum(axis=0),
    }
    if temperature is not None:
        found["rubber temperature"] = temperature
    return found


def active_range(coordinate: Array, part: Array) -> tuple[float, float]:
    """Range of a coordinate that holds the central 98 % of the energy of ``part``."""
    order = np.argsort(coordinate)
    energy = np.cumsum(part[order] ** 2)
    if energy[-1] <= 0.0:
        return float(coordinate.min()), float(coordinate.max())
    low, high = np.searchsorted(energy, [0.01 * energy[-1], 0.99 * energy[-1]])
    return float(coordinate[order][low]), float(coordinate[order][min(high, order.size - 1)])


def explained_by(coordinate: Array, values: Array) -> Array:
    """Share of the energy of each row of ``values`` (m, n) that bin means along a coordinate (n,) explain (correlation ratio).

    NaN in ``values`` marks samples that do not count.
    """
    edges = np.unique(np.quantile(coordinate, np.linspace(0.0, 1.0, BINS + 1)))
    if edges.size < 3:
        return np.zeros(values.shape[0])
    index = np.clip(np.searchsorted(edges, coordinate, side="right") - 1, 0, edges.size - 2)
    used = np.isfinite(values[0])
    count = np.bincount(index[used], minlength=edges.size - 1)
    filled = count > 0
    shares = np.zeros(values.shape[0])
    for i, row in enumerate(values):
        total = np.bincount(index[used], row[used], edges.size - 1)
        shares[i] = np.sum(total[filled] ** 2 / count[filled]) / max(float(row[used] @ row[used]), 1e-30)
    return shares


def telling_coordinate(axes: Mapping[str, Array], residual: Array, weight: Array, draws: Array) -> tuple[str, float, float]:
    """The coordinate along which a residual has the most structure: name, share, p-value of the maximum over all.

    ``draws`` (m, n) are residuals that hide nothing; the maximum over coordinates is taken in each, so looking everywhere is
    paid for. Samples without weight do not count.
    """
    values = np.vstack([residual, draws]) * np.where(weight > 0.0, weight, np.nan)
    shares = {name: explained_by(axis, values) for name, axis in axes.items()}
    best = max(shares, key=lambda name: shares[name][0])
    null = np.max([share[1:] for share in shares.values()], axis=0)
    p = (1.0 + float(np.sum(null >= shares[best][0]))) / (1.0 + null.size)
    return best, float(shares[best][0]), p
