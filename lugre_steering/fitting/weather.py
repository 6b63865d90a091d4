# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How warm the rubber was when each recording began, where that matters: weather and drives before, no wear and no patch."""

from __future__ import annotations

import numpy as np

from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Finding
from lugre_steering.vehicle.sections import Initial

MATTERS_K, APART = 4.0, 2.0
"""Difference to the vehicle file from which a temperature is told, and standard deviations that it must be."""


def weather_findings(problem: Problem, result: Fit) -> dict[str, Finding]:
    """By bag: its rubber temperature at the start, where it is not that of the vehicle file."""
    initial = problem.vehicle.initial
    if problem.vehicle.rubber is None or initial is None:
        return {}
    found = {}
    first, count = len(problem.calibrations) + len(problem.runs), len(problem.runs)
    for bag, run in enumerate(problem.runs):
        rubber, air = problem.temperatures(bag, result.x)
        at = [first + bag, first + count + bag]
        spread = float(np.sqrt(max(problem.doubt * result.covariance[np.ix_(at, at)].sum(), 0.0)))
        off = rubber - initial.rubber_temperature_degC
        if abs(off) > max(MATTERS_K, APART * spread):
            source = f"air {air:.0f} degC" + (" as recorded" if run.first_air is not None else ", by the fit")
            found[run.name] = Finding(
                "rubber_temperature", "",
                f"the rubber was about {rubber:.0f} degC (+-{2.0 * spread:.0f}) at the start, {source}; the vehicle file says "
                f"{initial.rubber_temperature_degC:.0f} degC; taken into account here (replay: --initial-temperature {rubber:.0f})",
            )  # fmt: skip
    return found


def initial_of(problem: Problem, result: Fit) -> Initial | None:
    """How warm rubber and air were at the start, on average of all bags: a calibration holds beside that."""
    if problem.vehicle.rubber is None or problem.vehicle.initial is None:
        return problem.vehicle.initial
    found = [problem.temperatures(bag, result.x) for bag in range(len(problem.runs))]
    rubber, air = (sum(values) / len(found) for values in zip(*found, strict=True))
    return Initial(round(rubber, 3), round(air, 3))
