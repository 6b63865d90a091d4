# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the data cannot tell: combinations of parameters that leave the predicted torque as it is.

Besides the fitted parameters, the sheet values that the fit takes as exact are looked at too: an error in one of
them may look just like an error in a fitted one, and then only a combination of both is known.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lugre_steering.calibration.estimate import Estimate, physical_jacobian
from lugre_steering.fitting.problem import GAIN, KINGPIN, Problem, SheetValue
from lugre_steering.recording import Array
from lugre_steering.report.words import named

SENSITIVITY = SheetValue("temperature_sensitivity", (), 0.15, -0.6, 0.6)
"""Exponent on the rubber table's ratios: how strongly stiffness and friction follow the temperature."""
WEAK = 0.5
"""A combination is undetermined when the data alone leave more than this share of the sheet's uncertainty."""
ALONE = 0.9
"""Share of a parameter inside the undetermined space above which it is named by itself."""
NEGLIGIBLE = 0.2
"""Part of a combination that is not worth its name."""
STEP = 0.01


@dataclass(frozen=True)
class Combination:
    """A direction in the logarithms of the parameters that the data do not determine.

    ``parts``: its components relative to the largest (or to the sheet value in question); ``data_over_sheet``: standard
    deviation along it from the data alone over that of the sheet (capped at 1000).
    """

    parts: dict[str, float]
    data_over_sheet: float
    statement: str


@dataclass(frozen=True)
class Assumed:
    """A sheet value taken as exact: relative change of each fitted parameter per relative change of it."""

    name: str
    shifts: dict[str, float]


def assumed_calibrations(problem: Problem) -> list[SheetValue]:
    """What the fit takes from the sheet although it may be wrong."""
    fitted = {calibration.name for calibration in problem.calibrations}
    found = [SENSITIVITY] if problem.vehicle.rubber is not None else []
    if problem.vehicle.axle is not None and problem.model.parameters[0][0]["aligning_torque"] != 0.0:
        found.append(KINGPIN)
    if problem.vehicle.hydraulics is not None:
        found.append(GAIN)
    return [calibration for calibration in found if calibration.name not in fitted]


def identifiability(problem: Problem, result: Estimate) -> tuple[list[Combination], list[Assumed]]:
    """Undetermined combinations, worst first, and what each sheet value taken as exact would move."""
    names = [calibration.name for calibration in problem.calibrations]
    sheet = problem.scales()[: len(names)]
    own = physical_jacobian(result)
    curvature, score = result.information(own)
    weak = _weak_directions(names, sheet, _information(curvature, score, len(names)) * np.outer(sheet, sheet))
    determined = np.sqrt(np.diag(result.covariance))[: len(names)] < WEAK * sheet
    inner = np.linalg.pinv(curvature + np.diag(result.prior), hermitian=True)
    assumed = []
    for calibration in assumed_calibrations(problem):
        column = _column(problem, result, calibration)
        # The sheet value first: what the data say about it beside everything fitted is then a Schur complement.
        curvature, score = result.information(np.column_stack([column, own]))
        known = _information(curvature, score, 1)[0, 0] * calibration.prior**2
        shifts = -inner @ curvature[1:, 0]
        assumed.append(Assumed(calibration.name, dict(zip(names, shifts[: len(names)].tolist(), strict=True))))
        tied = {n: s for (n, s), ok in zip(assumed[-1].shifts.items(), determined, strict=True) if ok and _counts(s)}
        if _weak(known) and tied:
            weak.append(_tied(calibration.name, tied, _ratio(known)))
    return weak, assumed


def _weak_directions(names: Sequence[str], sheet: Array, data: Array) -> list[Combination]:
    """Undetermined directions of ``data``, the information in units of the sheet's: first single parameters, which lie
    in the undetermined space by themselves, then combinations of the others."""
    values, vectors = np.linalg.eigh(data)
    inside = vectors[:, [_weak(value) for value in values]]
    alone = np.sum(inside**2, axis=1) > ALONE
    rest = np.flatnonzero(~alone)
    found = []
    for i in np.flatnonzero(alone):
        others = np.delete(np.arange(len(names)), i)
        beside = data[i, others] @ np.linalg.pinv(data[np.ix_(others, others)], hermitian=True) @ data[others, i]
        found.append(_fitted(names, np.eye(len(names))[i], _ratio(data[i, i] - beside)))
    reduced, cross = data[np.ix_(rest, rest)], data[np.ix_(rest, alone)]
    reduced = reduced - cross @ np.linalg.pinv(data[np.ix_(alone, alone)], hermitian=True) @ cross.T
    for value, vector in zip(*np.linalg.eigh(reduced), strict=True):
        if _weak(value):
            found.append(_fitted([names[int(i)] for i in rest], sheet[rest] * vector, _ratio(value)))
    return found


def _weak(information: float) -> bool:
    """Whether the data leave more than WEAK of the sheet's uncertainty; ``information`` in units of the sheet's."""
    return bool(information * WEAK**2 < 1.0)


def _counts(part: float) -> bool:
    return abs(part) >= NEGLIGIBLE


def _ratio(information: float) -> float:
    return float(1.0 / np.sqrt(max(information, 1e-6)))


def _information(curvature: Array, score: Array, kept: int) -> Array:
    """Inverse covariance A M^-1 A of the data alone about the first ``kept`` parameters, the others profiled out."""
    whole = curvature @ np.linalg.pinv(score, rcond=1e-14, hermitian=True) @ curvature
    cross = whole[:kept, kept:]
    return np.asarray(whole[:kept, :kept] - cross @ np.linalg.pinv(whole[kept:, kept:], hermitian=True) @ cross.T)


def _column(problem: Problem, result: Estimate, calibration: SheetValue) -> Array:
    """Change of the predicted torque per relative change of one sheet value (n,) [N m]."""
    if calibration is SENSITIVITY:
        moved, x = copy.copy(problem), result.x
        moved.model = replace(problem.model, rubber=problem.model.rubber ** (1.0 + STEP))
    else:
        moved = problem.calibrating(calibration)
        x = np.insert(result.x, len(problem.calibrations), STEP)
    return np.asarray((moved.predict_all(x, result.fit.effects) - result.fit.prediction) / STEP)


def _fitted(names: Sequence[str], direction: Array, data_over_sheet: float) -> Combination:
    """A direction among fitted parameters alone."""
    largest = direction[np.argmax(np.abs(direction))]
    parts = {n: float(v) for n, v in zip(names, direction / largest, strict=True) if _counts(v)}
    parts = dict(sorted(parts.items(), key=lambda item: -abs(item[1])))
    first, *others = map(named, parts)
    if not others:
        statement = f"{first} is not determined by these recordings"
    elif len(others) == 1:
        kind = "ratio" if list(parts.values())[1] > 0.0 else "product"
        statement = f"of {first} and {others[0]} only the {kind} is determined"
    else:
        statement = f"of {first}, {', '.join(others[:-1])} and {others[-1]} only a combination is determined"
    return Combination(parts, data_over_sheet, statement)


def _tied(name: str, shifts: dict[str, float], data_over_sheet: float) -> Combination:
    """A sheet value that cannot be told from fitted parameters: they move with it (ratio known) or against it."""
    said = []
    for kind, sign in (("ratio", 1.0), ("product", -1.0)):
        partners = [named(partner) for partner, shift in shifts.items() if shift * sign > 0.0]
        if partners:
            said.append(f"only the {kind} with {' and with '.join(partners)} is determined")
    statement = f"{named(name)} is the sheet's: {', '.join(said)}"
    return Combination({name: 1.0, **shifts}, data_over_sheet, statement)
