# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How else rubber may rub: small smooth freedoms of the friction law itself, each within what real rubber shows.

No friction law is true to a percent. What such a freedom explains is no missing physics, so names are compared beside these. Each is
a law in the chain, so that bristles and heat follow it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from lugre_steering.chain.lag import lagged
from lugre_steering.diagnosis.freedom import Freedom
from lugre_steering.diagnosis.laws.cells import Axis, Cell
from lugre_steering.diagnosis.laws.refine import given_law
from lugre_steering.effects import laws
from lugre_steering.fitting.clocks import still_apart, still_unknown
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem, in_threads
from lugre_steering.recording import Array

STRENGTHENING, STRIBECK = 0.04, 0.06
"""Change of the friction level per e-fold of the rate, 1 to 4 % in tests of rubber; and at low rates, which is what Stribeck
exponents from 0.5 to 2 make of a static level 15 % above the sliding one."""
GROUND, PER_PRESLIDING, MOST_PLACES = 0.06, 2.0, 40
"""That along the ground, three times the 1 to 2 % of even pavements; and places per presliding length, as bristles blur what is shorter."""
SHARPER, ROUNDER, REACH = 0.4, 0.08, 6.0
"""Presliding stiffness along the torque against the motion, on which it depends in every model of one state (Dahl's exponent, 1968);
and it and the level along the way since a reversal, up to so many presliding lengths: between rounder and sharper than an exponential."""
WARMTH, WARMTH_K = 0.05, 20.0
"""Level per so many kelvin, in which batches of one rubber differ."""
RELAXING, RELAXING_S = 0.15, (0.1, 1.0)
"""Share of the torque that follows so many seconds late: the loss factor of treads."""
RELAXATION = "its relaxation"
LATE = "the clocks of its sensors"
"""What these freedoms are called in reports."""
SMALL = 0.2
"""Share of a freedom by which its effect on the torque is found: small enough to be linear."""


class Bent(NamedTuple):
    """A problem with these freedoms; what each of its bends is, in ``words``; and the laws whose shapes are the first of them."""

    problem: Problem
    words: tuple[str, ...]
    freedoms: tuple[Freedom, ...]


def bent(problem: Problem, fitted: Fit) -> Bent:
    """The problem with these freedoms, as the chain shows them at a fit."""
    lawful = Problem(problem.vehicle, problem.runs, problem.calibrations, more_laws=1)
    place, x = len(problem.vehicle.laws), fitted.x[: problem.nuisances]
    bags = range(len(problem.runs))
    base = lawful.predict_all(x)

    def column(freedom: Freedom, f: Array) -> Array:
        law = given_law(Cell(freedom.channel, Axis(freedom.coordinate), freedom.low, freedom.high), place, SMALL * f)
        return np.asarray((np.concatenate([lawful.predict(bag, x, [law]) for bag in bags]) - base) / SMALL)

    freedoms = _freedoms(problem, fitted)
    shapes = [(freedom, f) for freedom in freedoms for f in freedom.shapes]
    columns = in_threads(lambda shape: column(*shape), shapes)
    parts = zip(problem.runs, np.split(base, problem.edges[1:-1]), strict=True)
    late = [[lagged(torque, run.time[1] - run.time[0], tau) - torque for tau in RELAXING_S] for run, torque in parts]
    columns += [RELAXING * np.concatenate(rows) for rows in zip(*late, strict=True)]
    columns.append(still_apart(problem, base))
    words = (*(freedom.words for freedom, _ in shapes), *(RELAXATION for _ in RELAXING_S), *(LATE for _ in (*bags, *bags)))
    freer = Problem(problem.vehicle, problem.runs, problem.calibrations, bends=np.column_stack(columns))
    return Bent(freer.bent([still_unknown(problem, base)]), words, tuple(freedoms))


def _freedoms(problem: Problem, fitted: Fit) -> list[Freedom]:
    own = {name: float(problem.model.parameters[0][0][name]) for name in ("stribeck_speed", "static_torque", "coulomb_torque", "sigma_0")}
    own |= problem.fields(fitted.x)
    presliding = own["coulomb_torque"] / own["sigma_0"]
    low, high = min(float(run.theta.min()) for run in problem.runs), max(float(run.theta.max()) for run in problem.runs)
    fast, far = max(float(np.abs(run.omega).max()) for run in problem.runs), REACH * presliding
    rate, way = np.linspace(0.0, fast, laws.KNOTS) / own["stribeck_speed"], np.linspace(0.0, far, laws.KNOTS) / presliding
    # Places that crowd around the reversal, where the presliding bends most.
    near = np.array([np.interp(np.sqrt(way), np.linspace(0.0, np.sqrt(REACH), 7), hat) for hat in np.eye(7)])
    found = [
        Freedom(
            "how it follows the rate", "friction_level", "abs_rate", 0.0, fast,
            np.array([STRENGTHENING * np.log1p(rate), STRIBECK * np.exp(-rate)]),
        ),
        Freedom("its level along the ground", "friction_level", "angle", low, high, GROUND * _places(low, high, presliding)),
    ]
    most, loads = max(own["static_torque"], own["coulomb_torque"]), np.linspace(-1.0, 1.0, 7)
    hats = np.array([np.interp(np.linspace(-1.0, 1.0, laws.KNOTS), loads, hat) for hat in np.eye(7)])
    found.append(Freedom("its presliding", "presliding_stiffness", "opposing_torque", -most, most, SHARPER * hats))
    for way_of in ("since_reversal", "slip"):  # and on the first sweep, which no reversal has prepared
        found.append(Freedom("its presliding", "presliding_stiffness", way_of, 0.0, far, SHARPER * near[:4]))
        found.append(Freedom("its presliding", "friction_level", way_of, 0.0, far, ROUNDER * near[:5]))
    if problem.vehicle.rubber is not None:
        cold, hot = -60.0, 140.0
        warmer = (np.linspace(cold, hot, laws.KNOTS) - problem.temperatures(0, fitted.x)[0]) / WARMTH_K
        shapes = WARMTH * np.array([warmer, 0.5 * warmer * np.abs(warmer)])
        found.append(Freedom("how it follows the temperature", "friction_level", "rubber_temperature", cold, hot, shapes))
    return found


def _places(low: float, high: float, presliding: float) -> Array:
    """Smooth pieces (k, KNOTS) that add up to one along the angles."""
    count = int(np.clip(np.ceil(PER_PRESLIDING * (high - low) / presliding), 3, MOST_PLACES))
    knots = np.concatenate([[low] * 3, np.linspace(low, high, count + 1), [high] * 3])
    return np.asarray(BSpline.design_matrix(np.linspace(low, high, laws.KNOTS), knots, 3).toarray().T)
