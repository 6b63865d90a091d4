# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Calibration without the command line: recordings in, calibrated vehicle and its uncertainty out.

``calibration.json`` (schema lugre_steering/calibration/1; every number finite, ``null`` where there is none):

==================  ===============================================================================================
key                 content
==================  ===============================================================================================
bags, vehicle       what was used; ``tool_version``, ``date`` (UTC), ``duration_s``, ``priors`` (true or false)
vehicle_name        the name in the vehicle file, and ``vehicle_file`` as it was given (``vehicle`` is the one or the other)
parameters          list: ``name``, ``key`` in the vehicle file, ``unit``, ``sheet``, ``value``, ``ci95`` (of a joint or
                    axis also what it has beside friction, which become ``effects`` of the file), relative
                    standard deviations ``relative_sd`` and (sheet) ``prior_relative_sd``, ``at_bound`` (null, low,
                    high), ``prior_dominated`` (the data add little to the sheet), ``advice`` (helpful manoeuvre)
covariance          ``names`` and ``matrix`` of the fitted values (logarithms of factors on the sheet; static_ratio:
                    added to static over sliding friction)
rmse_Nm             of ``sheet`` and ``calibrated`` vehicle on all samples, and the ``noise_floor`` to compare with
heldout_rmse_Nm     of ``sheet`` and ``calibrated`` on stretches that this extra fit did not see
undetermined        combinations that the data leave open: ``parts``, ``data_over_sheet``, ``statement``
assumed             sheet values taken as exact: relative change of each parameter per relative error of it
per_bag             list: ``bag``, ``duration_s``, ``samples``, RMSE of ``sheet`` and ``calibrated`` vehicle
data_quality        findings of the reader and of the checks of the sensors, per bag
provenance          version, date, options, and the SHA-256 of the vehicle file and of every file of the bags
statement           one paragraph
==================  ===============================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from typing import Any, Literal

import numpy as np

from lugre_steering import units
from lugre_steering.calibration import result
from lugre_steering.calibration.estimate import LINEARISATIONS, Estimate, estimate
from lugre_steering.calibration.identify import Assumed, Combination, identifiability
from lugre_steering.calibration.terms import term_rows, terms_of, with_terms
from lugre_steering.data.pieces import in_pieces
from lugre_steering.data.quality import inspect
from lugre_steering.data.seen import seen_range
from lugre_steering.errors import DataError
from lugre_steering.fitting.apply import apply_calibration
from lugre_steering.fitting.causal import filtered
from lugre_steering.fitting.clocks import synchronised
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.keys import KEYS, Key
from lugre_steering.fitting.parallel import as_joint
from lugre_steering.fitting.problem import GAIN, KINGPIN, STATIC, Problem, SheetValue, calibrations_for
from lugre_steering.fitting.sheet import wrong_sheet
from lugre_steering.fitting.split import split
from lugre_steering.fitting.weather import initial_of, weather_findings
from lugre_steering.recording import Array, BagFinding, Recording
from lugre_steering.report.words import number
from lugre_steering.vehicle import Vehicle
from lugre_steering.version import __version__

SHORTEST_S = 10.0
SLIDING = 3.0
"""Turns must reach this many presliding lengths, or friction never slides."""
PRIOR_DOMINATED = 0.5
"""Posterior over prior standard deviation above which a value is the sheet's rather than the data's."""
MISFIT = 1.5
"""Residual over noise floor above which the model misses something."""
WORTH_SAYING = 0.1
"""Relative shift per relative error of a sheet value below which it goes without saying."""


ADVICE = {
    "friction_level": "varied-rates",
    "static_ratio": "slow-sweeps",
    "stiffness": "small-loops",
    "stribeck_speed": "slow-sweeps",
    "heat_capacity": "heat-and-rest",
    "cooling": "heat-and-rest",
    "kingpin_arm": "heat-and-rest",
    "pressure_gain": "a run against a known torque",
}
"""Manoeuvre (see ``lugre-steering simulate --list``) that determines each parameter best."""


@dataclass(frozen=True)
class Calibrated:
    """Everything a report needs: the fit, and what it came to."""

    problem: Problem
    estimate: Estimate
    calibration: result.Calibration

    @property
    def vehicle(self) -> Vehicle:
        """The calibrated one."""
        return self.calibration.calibrated

    @property
    def result(self) -> dict[str, Any]:
        """As in calibration.json."""
        return self.calibration.json


def chosen(
    vehicle: Vehicle, free: Sequence[str] = (), fix: Sequence[str] = (), prior: Mapping[str, float] | None = None
) -> tuple[SheetValue, ...]:
    """The values to fit: the standard set, plus ``free``, minus ``fix``, with ``prior`` in place of the sheet's."""
    optional = [KINGPIN] if vehicle.axle is not None and vehicle.axle.kingpin_lever_arm_m != 0.0 else []
    if vehicle.hydraulics is not None:
        optional.append(GAIN)
    known = {calibration.name: calibration for calibration in (*calibrations_for(vehicle), *optional)}
    if vehicle.rubber is not None and vehicle.rubber.heat_transfer_W_m2K == 0.0:
        del known["cooling"]  # a factor of nothing
    for option, names in (("--free", free), ("--fix", fix), ("--prior", list(prior or {}))):
        for name in names:
            if name not in known:
                raise DataError(f"{option} {name}: this vehicle has no such parameter; expected {', '.join(known)}")
    standard = {calibration.name for calibration in calibrations_for(vehicle)}
    wanted = [c for c in known.values() if (c.name in standard or c.name in free) and c.name not in fix]
    for name in set(free) & set(fix):
        raise DataError(f"--fix {name}: is given to --free too; expected one of them")
    for name in prior or {}:
        if name not in {calibration.name for calibration in wanted}:
            raise DataError(f"--prior {name}: is not fitted; expected --free {name} beside it, or no --fix {name}")
    if not wanted:
        raise DataError("--fix: keeps every parameter at the sheet, expected at least one to fit")
    changed = []
    for calibration in wanted:
        width = (prior or {}).get(calibration.name, calibration.prior)
        if not 0.0 < width <= 1.0:
            raise DataError(f"--prior {calibration.name}: got {width:g}, expected a relative deviation above 0 up to 1")
        low = calibration.low
        if calibration.name == STATIC.name:
            low = max(low, min(1.0 - _static_ratio(vehicle), 0.0))  # static friction stays at or above the sliding one, if it is
        changed.append(replace(calibration, prior=width, low=low))
    return tuple(changed)


def calibrate_recordings(
    recordings: Sequence[Recording],
    vehicle: Vehicle,
    calibrations: Sequence[SheetValue] | None = None,
    *,
    priors: bool = True,
    progress: Callable[[str], None] = lambda _: None,
) -> Calibrated:
    """Fit ``vehicle`` to the sound samples of recordings in memory.

    Raises ``DataError`` when they cannot determine anything, or are wired so wrongly that a fit would mean nothing.
    """
    progress("checking the data")
    qualities = [inspect(recording, vehicle) for recording in recordings]
    for quality in qualities:
        for finding in quality.blocking:
            raise DataError(f"{quality.recording.name}: the data must be put right first: {finding.statement}")
    progress("preparing")
    pieces, cut = in_pieces([quality.recording for quality in qualities])
    clocks = synchronised(pieces, vehicle, chosen(vehicle) if calibrations is None else calibrations)
    problem = clocks.problem
    check_motion(problem)
    progress("comparing with the vehicle file")
    wrong = wrong_sheet(problem)
    progress("fitting")
    problem = as_joint(problem)
    fitted = estimate(problem, terms_of(problem), priors=priors)
    problem = problem.doubted(fitted.doubt, problem.typical)
    found = [finding.in_bag(quality.recording.name) for quality in qualities for finding in quality.findings]
    further = [*cut.items(), *clocks.findings.items(), *weather_findings(problem, fitted.fit).items()]
    found += [finding.in_bag(bag) for bag, finding in further] + ([wrong.finding()] if wrong else [])
    first = f"The vehicle file seems wrong: {wrong.statement}. " if wrong else ""
    names = tuple(recording.name for recording in recordings)
    return Calibrated(problem, fitted, _summed_up(names, pieces, problem, fitted, found, first, priors, progress))


def _summed_up(
    bags: tuple[str, ...],
    pieces: Sequence[Recording],
    problem: Problem,
    fitted: Estimate,
    found: Sequence[BagFinding],
    first: str,
    priors: bool,
    progress: Callable[[str], None],
) -> result.Calibration:
    """What the fit came to; ``first`` is what its statement begins with."""
    progress("judging on held-out stretches")
    held = heldout_rmse(problem, fitted, priors)
    progress("what the data cannot tell")
    weak, assumed = identifiability(problem, fitted)
    changed = apply_calibration(problem.vehicle, problem, fitted.x).replace(initial=initial_of(problem, fitted.fit))
    calibrated, _ = filtered(with_terms(_rounded(changed), fitted), pieces, problem.runs)
    rows = [*parameter_rows(problem, fitted, calibrated, priors), *term_rows(problem, fitted)]
    rmse = _fitted_errors(problem, fitted)
    names = [calibration.name for calibration in problem.calibrations]
    matrix = tuple(tuple(row) for row in fitted.covariance[: len(names), : len(names)].tolist())
    return result.Calibration(
        schema=result.SCHEMA,
        tool_version=__version__,
        date=datetime.now(timezone.utc).isoformat(timespec="seconds"),
        bags=bags,
        vehicle=problem.vehicle.name,
        priors=priors,
        duration_s=sum(float(run.time[-1] - run.time[0]) for run in problem.runs),
        parameters=tuple(rows),
        covariance=result.Covariance(tuple(names), matrix),
        rmse_Nm=rmse,
        heldout_rmse_Nm=held,
        undetermined=tuple(weak),
        assumed=tuple(assumed),
        data_quality=tuple(found),
        statement=units.words(problem.vehicle, first + statement(rows, rmse, held, weak, assumed)),
        calibrated=calibrated,
        seen=seen_range(calibrated, problem.runs, problem.starts(fitted.fit.x)),
        per_bag=tuple(_per_bag(problem, fitted)),
        vehicle_name=problem.vehicle.name,
    )


def _per_bag(problem: Problem, fitted: Estimate) -> Iterator[result.BagErrors]:
    """How well sheet and calibrated vehicle explain each recording."""
    sheet = problem.measured - problem.predict_all(problem.start())
    for bag, run in enumerate(problem.runs):
        used = (problem.bag == bag) & (fitted.weight > 0.0)
        errors = [_rms(left[used]) if used.any() else None for left in (sheet, fitted.residual)]
        yield result.BagErrors(run.name, float(run.time[-1] - run.time[0]), int(used.sum()), *errors)


def _fitted_errors(problem: Problem, fitted: Estimate) -> result.FittedErrors:
    """RMSE [N m] of sheet and calibrated vehicle on the samples that were fitted."""
    used = fitted.weight > 0.0
    return result.FittedErrors(
        sheet=_rms((problem.measured - problem.predict_all(problem.start()))[used]),
        calibrated=_rms(fitted.residual[used]),
        noise_floor=fitted.noise_floor,
    )


def check_motion(problem: Problem) -> None:
    """Refuse recordings that hold no friction to fit, with the manoeuvre that would."""
    duration = sum(float(run.time[-1] - run.time[0]) for run in problem.runs)
    names = ", ".join(run.name for run in problem.runs)
    if duration < SHORTEST_S:
        raise DataError(
            f"{names}: {duration:.1f} s in all, expected at least {SHORTEST_S:g} s; "
            "drive 'varied-rates' (see lugre-steering simulate --list)"
        )
    travel = max(float(np.ptp(run.theta, axis=1).max()) for run in problem.runs)
    needed = SLIDING * problem.presliding
    if travel < needed:
        far, least = (units.distance(problem.vehicle, v) for v in (travel, needed))
        raise DataError(
            f"{names}: turns {far} at most, expected at least {least}, below which friction does not slide; "
            "drive 'varied-rates' (see lugre-steering simulate --list)"
        )


def heldout_rmse(problem: Problem, fitted: Estimate, priors: bool) -> result.HeldOutErrors:
    """RMSE [N m] of sheet and calibrated vehicle on held-out stretches that a fit of its own did not see."""
    parts = split(problem)
    if not parts.held.any() or not parts.fit.any():
        return result.HeldOutErrors(None, None)
    weight = np.where(parts.fit, fitted.weight, 0.0)
    other = fit(problem, weight, fitted.fit.effects, fitted.x, linearisations=LINEARISATIONS, robust=True, priors=priors)
    sheet = problem.predict_all(problem.start())
    return result.HeldOutErrors(
        _rms((problem.measured - sheet)[parts.held]), _rms((problem.measured - other.prediction)[parts.held])
    )


def parameter_rows(problem: Problem, fitted: Estimate, calibrated: Vehicle, priors: bool) -> list[result.FittedKey]:
    """One row per vehicle-file key that the fit decided about."""
    names = [calibration.name for calibration in problem.calibrations]
    spread = np.sqrt(np.diag(fitted.covariance))
    low, high = problem.bounds()
    prior = problem.scales()[: len(names)]
    rows = []
    for key in KEYS:
        sheet, value = key.read(problem.vehicle), key.read(calibrated)
        if key.calibration not in names or sheet is None or value is None:
            continue
        i = names.index(key.calibration)
        gradient = _log_gradient(problem, fitted.x, key)
        deviation = float(np.sqrt(gradient @ fitted.covariance[: gradient.size, : gradient.size] @ gradient))
        reach = math.exp(min(fitted.quantile * deviation, 20.0))
        edge = 0.01 * (high[i] - low[i])
        at_bound: Literal["low", "high"] | None = (
            "low" if fitted.x[i] < low[i] + edge else "high" if fitted.x[i] > high[i] - edge else None
        )
        dominated = bool(spread[i] > PRIOR_DOMINATED * problem.calibrations[i].prior)
        ends = value / reach, value * reach
        rows.append(result.FittedKey(
            name=key.calibration,
            key=key.key,
            unit=units.label(problem.vehicle, key.unit),
            sheet=sheet,
            value=value,
            ci95=(min(ends), max(ends)),
            relative_sd=deviation,
            prior_relative_sd=float(np.linalg.norm(gradient[: len(names)] * prior)) if priors else None,
            at_bound=at_bound,
            prior_dominated=dominated,
            advice=ADVICE[key.calibration] if dominated or at_bound else None,
        ))  # fmt: skip
    return rows


def _log_gradient(problem: Problem, x: Array, key: Key) -> Array:
    """Derivative of the logarithm of a key's value by each fitted value (p,)."""
    gradient = np.zeros(x.size)
    for i in range(len(problem.calibrations)):
        ends = []
        for step in (-1e-4, 1e-4):
            moved = x.copy()
            moved[i] += step
            ends.append(key.read(apply_calibration(problem.vehicle, problem, moved)) or 1.0)
        gradient[i] = math.log(ends[1] / ends[0]) / 2e-4
    return gradient


def statement(
    rows: Sequence[result.FittedKey],
    rmse: result.FittedErrors,
    held: result.HeldOutErrors,
    weak: Sequence[Combination],
    assumed: Sequence[Assumed],
) -> str:
    """What an engineer should know, in one paragraph."""
    before, after = held.sheet, held.calibrated
    text = []
    if before is not None and after is not None:
        now, then = (number(value, 3) for value in (after, before))
        text.append(f"Torque error on held-out stretches: {now} N m; with the sheet it was {then} N m.")
    if rmse.calibrated > MISFIT * rmse.noise_floor:
        text.append(
            f"The residual ({number(rmse.calibrated, 3)} N m) is above the noise ({number(rmse.noise_floor, 3)} N m): physics "
            "beyond the baseline; run diagnose before trusting these values."
        )
    titles = {key.key: key.beginning for key in KEYS}  # the rest are values of effects
    for row in rows:
        if row.at_bound:
            text.append(f"{titles.get(row.key, row.key)} stopped at the {row.at_bound} end of its range.")
        if row.prior_dominated:
            text.append(f"{titles.get(row.key, row.key)} is hardly determined by these recordings; drive '{row.advice}'.")
    said = {row.name for row in rows if row.prior_dominated}
    text += [f"{c.statement[0].upper()}{c.statement[1:]}." for c in weak if not set(c.parts) <= said]
    for value in assumed:
        name = max(value.shifts, key=lambda n: abs(value.shifts[n]) if n not in said else 0.0)
        if abs(value.shifts[name]) > WORTH_SAYING:
            text.append(
                f"Intervals take the sheet's {value.name.replace('_', ' ')} as exact: 1 % of it would move "
                f"{name.replace('_', ' ')} by {value.shifts[name]:+.2g} %."
            )
    return " ".join(text)


def _rounded(vehicle: Vehicle) -> Vehicle:
    """Fitted keys to seven digits: readable, and far below any uncertainty."""
    sections: dict[str, Any] = {}
    for key in KEYS:
        value = key.read(vehicle)
        section, name = key.key.split(".")
        if value is not None:
            old = sections.get(section, getattr(vehicle, section))
            sections[section] = replace(old, **{name: float(f"{value:.7g}")})
    return vehicle.replace(**sections)


def _static_ratio(vehicle: Vehicle) -> float:
    if vehicle.contact is not None:
        return vehicle.contact.static_torque_Nm / vehicle.contact.coulomb_torque_Nm
    assert vehicle.friction is not None
    assert vehicle.friction.static is not None
    assert vehicle.friction.coulomb is not None
    return vehicle.friction.static / vehicle.friction.coulomb


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))
