# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A load picked up or set down while it was recorded: the level of friction jumps at one instant, and stays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.search.compare import SURE
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Array, Finding
from lugre_steering.report import words

LASTS_S, STEP_S = 1.0, 0.5
"""How long an error lasts that counts once, and how finely the instant is tried."""
LEAST_SIDE = 0.1
"""Share of the friction's energy that must lie on each side of the instant."""
EXPLAINED, FURTHER = 0.5, 0.1
"""Share of what is left beyond noise that a jump must explain, and share of what it takes that a second one may take: of a change all along
the recording the second takes a quarter of the first."""


class Jump(NamedTuple):
    """When [s] the level of friction jumped, by which share of the level before, and the torque [N m] of that."""

    at_s: float
    share: float
    torque: float


def level_jumps(done: Finished) -> dict[str, Finding]:
    """By recording: when its friction jumped, and by how much; none where a name says so."""
    problem, final = done.problem, done.found.final
    if any("level" in candidate.effect.hooks for candidate, _ in final.effects):
        return {}  # a name says it itself
    # What acts in parallel, as inertia, gravity or viscous friction, is no level of friction.
    friction = (problem.predict_all(final.x) if final.effects else final.prediction) - _conservative(problem)
    error, found = problem.measured - final.prediction, dict[str, Finding]()
    for run, first, last in zip(problem.runs, problem.edges, problem.edges[1:], strict=False):
        part = slice(first, last)
        jump = jumped(run.time, friction[part], error[part], done.weight[part])
        if jump is not None:
            more = "more" if jump.share > 0.0 else "less"
            found[run.name] = Finding(
                "level_jump", "",
                f"from {jump.at_s:.0f} s on the friction is {words.percent(abs(jump.share))} {more} than before, at once and to the end "
                f"(up to {done.torque(jump.torque)}): a load picked up or set down, or other ground; diagnose before and after apart",
                ((jump.at_s, float(run.time[-1])),),
            )  # fmt: skip
    return found


def _conservative(problem: Problem) -> Array:
    """Torque (n,) of the angle alone that the vehicle file has."""
    sine, cosine = problem.sheet["aligning_torque"], problem.sheet.get("gravity_cos", 0.0)
    return np.concatenate([np.sum(sine * np.sin(run.theta) + cosine * np.cos(run.theta), axis=0) for run in problem.runs])


def jumped(time: Array, friction: Array, error: Array, weight: Array) -> Jump | None:
    """A jump of the level of ``friction`` (n,) in an ``error`` (n,) of the model, both [N m]; None without one.

    The error is fitted by the friction times a constant on each side of an instant. A change that grows all along, or is never over, is
    none: a straight line takes more than the jump, or a second jump much of what the first one left.
    """
    used = weight > 0.0
    t, f, e = time[used], (friction * weight)[used], (error * weight)[used]
    if t.size < 2 or not float(f @ f) > 0.0:
        return None
    ff, fe = np.cumsum(f * f), np.cumsum(f * e)
    instants = np.arange(t[0] + STEP_S, t[-1], STEP_S)
    after = np.searchsorted(t, instants)

    def taken(low: int, high: int) -> tuple[float, int, float, float]:
        """The most that a jump within samples ``low`` to ``high`` takes beyond one level there, where, and the level before and after."""
        places = after[(after > low) & (after < high)]
        whole, own = ff[high - 1] - (ff[low - 1] if low else 0.0), fe[high - 1] - (fe[low - 1] if low else 0.0)
        before, below = ff[places - 1] - (ff[low - 1] if low else 0.0), fe[places - 1] - (fe[low - 1] if low else 0.0)
        enough = (before > LEAST_SIDE * whole) & (before < (1.0 - LEAST_SIDE) * whole)
        if not enough.any():
            return 0.0, high, 0.0, 0.0
        places, before, below = places[enough], before[enough], below[enough]
        gains = below**2 / before + (own - below) ** 2 / (whole - before) - own**2 / whole
        best = int(np.argmax(gains))
        return float(gains[best]), int(places[best]), float(below[best] / before[best]), float((own - below[best]) / (whole - before[best]))

    gain, at, low, high = taken(0, t.size)
    left = float(e @ e) - fe[-1] ** 2 / ff[-1] - gain
    count = max(LASTS_S / max(float(np.median(np.diff(t))), 1e-9), 1.0)  # samples that err alike
    doubt = max(left / t.size, 1.0) * count
    if gain < SURE * doubt or gain < EXPLAINED * (gain + left - t.size):
        return None
    slope = f * (t - t.mean())
    columns = np.linalg.qr(np.column_stack([f, slope]))[0]
    line = float(np.sum((columns.T @ e) ** 2)) - fe[-1] ** 2 / ff[-1]
    further = max(taken(0, at)[0], taken(at, t.size)[0])
    if line > gain or further > FURTHER * gain:
        return None
    share = (high - low) / max(1.0 + low, 1e-3)
    return Jump(float(t[at]), share, abs(high - low) * float(np.percentile(np.abs(friction), 99.0)))
