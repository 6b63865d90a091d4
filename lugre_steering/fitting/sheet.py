# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Is the vehicle file that of this vehicle? Entries that may be wrong by a lot, refitted with wide bounds and ranked.

A recalibration moves values by what nominal values may be off; what it needs beyond that, or stops at its bounds, is told as a
wrong sheet before any physics is named. A load scales friction and aligning torque, a bore all that the pressures show, friction
only itself: each hypothesis is fitted and ranked by what it leaves, in shares of the torque as it was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from lugre_steering.data.dataset import Run, motion, with_hydraulics
from lugre_steering.fitting.fit import Fit, fit, normalised
from lugre_steering.fitting.problem import FRICTION, GAIN, STIFFNESS, Candidate, Problem, SheetValue, Values
from lugre_steering.recording import Array, BagFinding, IntArray
from lugre_steering.serialise import IN_MEMORY
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.loads import vertical_load
from lugre_steering.vehicle.sections import Cylinder, Hydraulics

WIDE, FARTHEST = 1.0, 2.6
"""Standard deviation and bound of the logarithm of an entry under suspicion: a factor of e, up to 13."""
SURPRISE = 10.0
"""Squared prior deviations, of friction level, stiffness and weather together, from which a sheet is suspect."""
RELIEVED = 0.5
"""Share of the surprise that a hypothesis must leave at most, unless a value stands at its bound."""
EDGE = 0.01
ERROR_S = 1.0
"""How long an error of the friction law's form lasts."""
SAMPLES, RATE_HZ = 6000, 25.0
"""Samples and rate to which the hypotheses are fitted: enough to rank them."""
SCALES = (0.4, 2.5)
"""Range of the factor on a bore or an arm."""
ARMS = (0.5, 0.7, 1.4, 2.0)
"""Factors that are tried on all arms together: measured from the wrong place, or on another vehicle."""
EXPLAINED, BETTER = 0.8, 0.9
"""Share of what the baseline leaves that a wrong entry must explain, and share of what named physics leaves that it may leave."""
FAR_BETTER, LITTLE = 0.5, 0.1
"""Share beyond noise of what is left with the worst suspect put right that names may leave where recalibration without them stops at a
bound; and share of what the baseline leaves from which they are tried there at all."""
KEPT = 0.5
"""Share of what named physics takes that it must still take with a suspected entry put right, to be no part of that entry's error."""
PUT_RIGHT = 0.03
"""Error that is left, as share of the torque, with which a sheet counts as put right."""
FORETOLD = 0.5
"""Share of what a wrong entry must explain that its linearisation foretells at least."""
OFF, SEVERAL = 0.03, 1.1
"""Relative error from which an entry is wrong, and what several wrong entries must be worth against one."""
TIED = 1.1
"""Cost over the lowest up to which a hypothesis is as good."""
SHOWN = 5
SAME_SIZE = 0.1
"""Share by which torques differ that are told to be of one size."""
LOAD = SheetValue("load", ("static_torque", "coulomb_torque", "aligning_torque"), WIDE, -FARTHEST, FARTHEST)
LEVEL = replace(FRICTION, prior=WIDE, low=-FARTHEST, high=FARTHEST)
PRESSURES = replace(GAIN, prior=WIDE, low=-FARTHEST, high=FARTHEST)
LEVELS = ("friction_level", "stiffness")
Resized = Callable[[float], Mapping[str, Cylinder]]
"""Cylinders by name with a size of theirs times a factor."""
STIFF = replace(STIFFNESS, prior=WIDE, low=-FARTHEST, high=FARTHEST)


@dataclass(frozen=True)
class Suspect:
    """An entry of the vehicle file: its key, by which factor it seems wrong (None: exchanged), and the error that is left with it
    put right, as share of the measured torque (None: not fitted); ``right``: the problem with it put right."""

    key: str
    factor: float | None
    relative_error: float | None
    cost: float = field(metadata=IN_MEMORY)
    right: Problem | None = field(default=None, metadata=IN_MEMORY, repr=False)

    @property
    def words(self) -> str:
        return self.key if self.factor is None else f"{self.key} (times {self.factor:.3g})"

    @property
    def puts_right(self) -> bool:
        """Whether with it next to nothing is left."""
        return self.relative_error is not None and self.relative_error < PUT_RIGHT


@dataclass(frozen=True)
class SheetFinding(BagFinding):
    """A finding about the vehicle file, with the entries most likely wrong."""

    suspects: tuple[Suspect, ...]


@dataclass(frozen=True)
class WrongSheet:
    """``times``: measured over expected torque; entries most likely wrong, worst first.

    ``stuck``: recalibration stopped at its bounds, where a name can hardly be told from what only makes up for it; ``rest``: share of
    what the baseline leaves beyond noise that is left with the worst one put right.
    """

    times: float
    suspects: tuple[Suspect, ...]
    why: str | None = None
    stuck: bool = True
    rest: float = 0.0

    @property
    def certain(self) -> bool:
        """Whether no physics need be tried in its place."""
        return self.stuck and self.rest < LITTLE

    @property
    def statement(self) -> str:
        check = ", ".join(suspect.words for suspect in self.suspects[:3])
        return f"{self._said}; check {check}"

    @property
    def _said(self) -> str:
        if self.why is not None:
            return self.why
        if abs(self.times - 1.0) < SAME_SIZE:
            return "friction or stiffness would have to be off by more than nominal values are"
        return f"measured torque is {self.times:.2g} times what this sheet can give"

    def finding(self) -> SheetFinding:
        """As an entry of ``data_quality``."""
        return sheet_finding(self.statement, self.suspects)


def sheet_finding(statement: str, suspects: Iterable[Suspect]) -> SheetFinding:
    """The finding ``wrong_sheet`` as an entry of ``data_quality``."""
    return SheetFinding("wrong_sheet", "", "", (), statement, tuple(replace(one, right=None) for one in suspects))


class _Tried(NamedTuple):
    """A suspected entry, the surprise that is left with it put right, and whether recalibration still stops at a bound: then it is
    not what was wrong, however little is left."""

    suspect: Suspect
    surprise: float
    stuck: bool


def _least(tried: _Tried) -> tuple[bool, float]:
    return tried.stuck, tried.suspect.cost


def torque_ratio(product: float, square: float) -> float:
    """Factor on an expected torque that fits the measured one best: sum of products over sum of squares of the expected one."""
    return product / square if square > 0.0 else float("nan")


def wrong_sheet(problem: Problem) -> WrongSheet | None:
    """Whether the recalibrated baseline needs more than nominal values allow, and another entry puts that right; else None."""
    thin, doubt = _doubted(thinned(problem)[0])
    baseline = _fitted(thin)
    surprise = _surprise(thin, baseline)
    stuck = at_bounds(thin, baseline.x, LEVELS)
    if not stuck and surprise < SURPRISE:
        return None
    found = sorted(_off((*_levels(thin), *_geometries(thin, baseline))), key=_least)
    if not found:
        return None
    best = found[0].suspect
    floor = float(np.count_nonzero(thin.valid)) / doubt
    fits = best.puts_right or best.cost - floor < RELIEVED * (baseline.cost - floor)
    if not fits or min(tried.surprise for tried in found if tried.suspect.cost < TIED * best.cost) > RELIEVED * surprise:
        return None
    rest = (best.cost - floor) / max(baseline.cost - floor, 1e-30)
    return WrongSheet(_ratio(thin), tuple(tried.suspect for tried in found[:SHOWN]), stuck=bool(stuck), rest=rest)


def physics_instead(problem: Problem, effects: Sequence[tuple[Candidate, Values]], wrong: WrongSheet) -> bool:
    """Whether with ``effects`` the rest of the sheet is no surprise any more, and less is left than with its worst suspect put right: far
    less where recalibration without them stops at a bound, which it must not beside them."""
    if wrong.certain or not effects:
        return False
    thin, doubt = _doubted(thinned(problem)[0])
    named, worst = _fitted(thin, effects=effects), wrong.suspects[0].cost
    floor = float(np.count_nonzero(thin.valid)) / doubt
    if wrong.stuck and (named.cost - floor > FAR_BETTER * (worst - floor) or at_bounds(thin, named.x, LEVELS)):
        return False
    return named.cost < BETTER * worst and _surprise(thin, named) < SURPRISE


def physics_beside(problem: Problem, effects: Sequence[tuple[Candidate, Values]], wrong: WrongSheet) -> bool:
    """Whether ``effects`` are there whatever of the sheet is put right: each leading suspect leaves more than they do, and beside each
    they take most of what they take without.

    Both are then to be told; only where recalibration stops at its bounds, nothing can be told from what makes up for it.
    """
    if wrong.stuck or not effects:
        return False
    thin, _ = _doubted(thinned(problem)[0])
    named, worst = _fitted(thin, effects=effects).cost, wrong.suspects[0].cost
    taken = 1.0 - named / _fitted(thin).cost
    leading = [suspect.right for suspect in wrong.suspects if suspect.cost < TIED * worst and suspect.right is not None]
    beside = (1.0 - _fitted(right, effects=effects).cost / _fitted(right).cost for right in leading)
    return named < BETTER * worst and all(share > KEPT * taken for share in beside)


def wrong_entry(problem: Problem, effects: Sequence[tuple[Candidate, Values]] = (), rival: float = 1.0) -> WrongSheet | None:
    """Whether one wrong bore, arm or pair of lines, or another vehicle, explains what the baseline leaves, and better than ``effects``.

    ``rival``: share of it that another explanation leaves, which it must do better than.
    """
    thin, _ = thinned(problem)
    baseline = _fitted(thin)
    named = fit(thin, thin.sensor_weight, [(c, dict(v)) for c, v in effects], baseline.x, robust=True) if effects else baseline
    least = FORETOLD * EXPLAINED
    levels = _levels(thin) if _foretold(thin, baseline) > least else ()
    found = sorted((tried.suspect for tried in _off((*levels, *_geometries(thin, baseline, least)))), key=lambda item: item.cost)
    if not found:
        return None
    floor = float(np.count_nonzero(thin.valid))
    left, excess, beside_names = found[0].cost - floor, baseline.cost - floor, named.cost - floor
    if excess <= 0.0 or left > min(1.0 - EXPLAINED, BETTER * rival) * excess:
        return None
    # Where sensors are quieter than the sheet says, names may leave less than their noise: a share of that tells nothing.
    if effects and beside_names - left < max((1.0 - BETTER) * beside_names, SURPRISE):
        return None
    return WrongSheet(_ratio(thin), tuple(found[:SHOWN]), "one entry of this sheet explains most of what recalibration leaves")


def _foretold(problem: Problem, baseline: Fit) -> float:
    """Share of what is left beyond noise that levels without any prior would explain, to first order."""
    weight = problem.sensor_weight
    left = (problem.measured - baseline.prediction) * weight
    columns = np.column_stack([baseline.jacobian, baseline.prediction * weight])
    along = np.linalg.qr(normalised(columns))[0].T @ left
    return float(along @ along) / max(float(left @ left) - float(np.count_nonzero(weight)), 1e-30)


def _off(found: Iterable[_Tried]) -> list[_Tried]:
    """Those whose entry is off by more than drawings and tapes are."""
    return [tried for tried in found if tried.suspect.factor is None or abs(np.log(tried.suspect.factor)) > OFF]


def at_bounds(problem: Problem, x: Array, names: Sequence[str]) -> list[str]:
    """Calibration values of those ``names`` that stand at an end of their range."""
    return [
        c.name for c, value in zip(problem.calibrations, x, strict=False)
        if c.name in names and not c.low + EDGE * (c.high - c.low) < value < c.high - EDGE * (c.high - c.low)
    ]  # fmt: skip


def thinned(problem: Problem, most: int = SAMPLES, rate_Hz: float = RATE_HZ) -> tuple[Problem, IntArray]:
    """The same with few samples, ``most`` unless they are slow and not more often than at ``rate_Hz``, and which these are."""
    total = sum(run.time.size for run in problem.runs)
    runs, kept = [], []
    for run, first in zip(problem.runs, problem.edges, strict=False):
        step = float(run.time[1] - run.time[0])
        stride = max(1, round(1.0 / rate_Hz / step), -(-total // most) if step < 0.1 else 1)
        runs.append(_every(run, stride))
        kept.append(first + np.arange(0, run.time.size, stride))
    return Problem(problem.vehicle, runs, problem.calibrations), np.concatenate(kept)


def _doubted(problem: Problem) -> tuple[Problem, float]:
    """The same with errors as large as the baseline leaves, of which those of ERROR_S count once; and by what their energy has grown.

    Friction of another form than the law's would else drive every value as far from its sheet as helps a little.
    """
    misfit = max(_fitted(problem).cost / max(int(np.count_nonzero(problem.valid)), 1), 1.0)
    step = max(float(run.time[1] - run.time[0]) for run in problem.runs)
    doubt = misfit * max(ERROR_S / step, 1.0)
    return Problem(problem.vehicle, [replace(run, sigma=run.sigma * doubt**0.5) for run in problem.runs], problem.calibrations), doubt


def _every(run: Run, stride: int) -> Run:
    if stride == 1:
        return run
    keep = slice(None, None, stride)
    time, theta = run.time[keep].copy(), run.theta[:, keep].copy()
    omega, alpha = motion(time, theta)
    return replace(
        run, time=time, theta=theta, omega=omega, alpha=alpha, gains=run.gains[:, :, keep], pressure=run.pressure[:, keep],
        side_torque=run.side_torque[:, keep], side_slope=run.side_slope[:, keep], measured=run.measured[keep],
        sigma=run.sigma[keep], valid=run.valid[keep],
    )  # fmt: skip


def _fitted(problem: Problem, start: Array | None = None, effects: Sequence[tuple[Candidate, Values]] = ()) -> Fit:
    return fit(problem, problem.sensor_weight, effects, start, robust=True, linearisations=25 if effects else 15, tolerance=1e-4)


def _surprise(problem: Problem, result: Fit, freed: Sequence[str] = ()) -> float:
    """Squared prior deviations of friction level, stiffness and the weather of the average bag."""
    count = len(problem.calibrations)
    scaled = (result.x / problem.scales()) ** 2
    own = [scaled[i] for i, c in enumerate(problem.calibrations) if c.name in ("friction_level", "stiffness") and c.name not in freed]
    weather = scaled[count + len(problem.runs) :]
    return float(sum(own) + weather.sum() / len(problem.runs))


def _ratio(problem: Problem) -> float:
    """Measured torque over that of the sheet."""
    expected = problem.predict_all(problem.start())[problem.valid]
    return torque_ratio(float(problem.measured[problem.valid] @ expected), float(expected @ expected))


def _levels(problem: Problem) -> Iterator[_Tried]:
    """Hypotheses about whole levels."""
    vehicle = problem.vehicle
    known = [c for c in problem.calibrations if c.name != GAIN.name]
    others = [c for c in known if c.name != LEVEL.name]
    level = "friction.coulomb" if vehicle.friction is not None else "contact.coulomb_torque_Nm"
    stiff = level.split(".")[0] + ".stiffness_Nm_per_deg"
    trials: list[tuple[str, list[SheetValue], str]] = [(level, [LEVEL, *others], LEVEL.name)]
    trials.append((stiff, [STIFF, *(c for c in known if c.name != STIFF.name)], STIFF.name))
    if vehicle.axle is not None:
        trials.append(("axle.load_N", [LOAD, *known], LOAD.name))
    pressures = "bores of all cylinders, or unit of the pressures" if vehicle.hydraulics is not None else "unit of the measured torque"
    trials.append((pressures, [PRESSURES, *known], PRESSURES.name))
    trials.append((
        "several entries: another vehicle", [LEVEL, STIFF, PRESSURES, *(c for c in others if c.name != STIFF.name)], "",
    ))  # fmt: skip
    for key, calibrations, name in trials:
        trial = Problem(vehicle, problem.runs, calibrations)
        result = _fitted(trial)
        names = [c.name for c in calibrations]
        factor = float(np.exp(result.x[names.index(name)])) if name else None
        if key == pressures and factor is not None:  # a torque goes with the square of a bore
            factor = factor**0.5 if vehicle.hydraulics is not None else factor
        if vehicle.axle is not None and vehicle.track is not None and name == LOAD.name and factor is not None:
            share = vertical_load(vehicle.axle, vehicle.track) / (0.5 * vehicle.axle.load_N)  # the tracks' own weight is no load
            factor = max((factor - 1.0) * share + 1.0, 1e-3)
        tried = _tried(problem, trial, result, key, factor, (name,) if name else (LEVEL.name, STIFF.name))
        yield tried if name else tried._replace(suspect=replace(tried.suspect, cost=SEVERAL * tried.suspect.cost))


def _geometries(problem: Problem, baseline: Fit, least: float = 0.0) -> Iterator[_Tried]:
    """Hypotheses about single cylinders, those of one circuit, and the arms of all; only those of which is foretold that ``least`` of
    what is left beyond noise goes, or, of exchanged lines, anything."""
    hydraulics = problem.vehicle.hydraulics
    if hydraulics is None:
        return
    sizes: list[tuple[str, Resized]] = []
    for name, cylinder in hydraulics.cylinders.items():
        key = f"hydraulics.cylinders.{name}"
        for entry, scale in (("bore_m", _bore), ("knuckle_m", _knuckle)):
            sizes.append((f"{key}.{entry}", partial(_resized, {name: cylinder}, scale)))
    for names in circuits(hydraulics):
        key = "hydraulics.cylinders." + " and ".join(f"{name}.bore_m" for name in names)
        sizes.append((key, partial(_resized, {name: hydraulics.cylinders[name] for name in names}, _bore)))
    for key, change in sizes:
        factor, share = _better(problem, problem, baseline, change, 1.0)
        if share < least:
            continue
        factor, _ = _better(problem, *_refitted(problem, baseline, change(factor)), change, factor)
        yield _tried(problem, *_refitted(problem, baseline, change(factor)), key, factor)
    if not least:  # levers of half or twice the length are too far off for a linearisation
        arms = [(_resized(hydraulics.cylinders, _knuckle, factor), factor) for factor in ARMS]
        tried = [_tried(problem, *_refitted(problem, baseline, each), "knuckle_m of all cylinders", f) for each, f in arms]
        yield min(tried, key=_least)
    for names in (*((name,) for name in hydraulics.cylinders), *circuits(hydraulics)):
        turned = {name: _turned(hydraulics.cylinders[name]) for name in names}
        trial = _changed(problem, turned)
        if least and not _could_be_better(problem, trial, baseline):
            continue
        result = _fitted(trial, start=baseline.x)
        yield _tried(problem, trial, result, f"hydraulics.cylinders.{' and '.join(names)}.cap and .rod exchanged", None)


def circuits(hydraulics: Hydraulics) -> list[tuple[str, ...]]:
    """Several cylinders, but not all, that lines connect: their bores are read off one drawing."""
    groups: list[tuple[set[str], set[str]]] = []
    for name, cylinder in hydraulics.cylinders.items():
        names, lines = {name}, {line for line in (cylinder.cap, cylinder.rod) if line}
        for group in [group for group in groups if group[1] & lines]:
            groups.remove(group)
            names, lines = names | group[0], lines | group[1]
        groups.append((names, lines))
    ordered = [tuple(name for name in hydraulics.cylinders if name in names) for names, _ in groups]
    return [names for names in ordered if 1 < len(names) < len(hydraulics.cylinders)]


def _refitted(problem: Problem, baseline: Fit, cylinders: Mapping[str, Cylinder]) -> tuple[Problem, Fit]:
    """The problem of a vehicle with other cylinders, and its fit."""
    trial = _changed(problem, cylinders)
    return trial, _fitted(trial, start=baseline.x)


def _resized(cylinders: Mapping[str, Cylinder], scale: Callable[[Cylinder, float], Cylinder], factor: float) -> dict[str, Cylinder]:
    return {name: scale(cylinder, factor) for name, cylinder in cylinders.items()}


def _bore(cylinder: Cylinder, factor: float) -> Cylinder:
    bore = cylinder.bore_m * factor
    return replace(cylinder, bore_m=bore, rod_m=min(cylinder.rod_m, 0.95 * bore))


def _knuckle(cylinder: Cylinder, factor: float) -> Cylinder:
    return replace(cylinder, knuckle_m=tuple(factor * value for value in cylinder.knuckle_m))


def _turned(cylinder: Cylinder) -> Cylinder:
    return replace(cylinder, cap=cylinder.rod, rod=cylinder.cap)


def _better(
    problem: Problem, trial: Problem, result: Fit, change: Resized, factor: float
) -> tuple[float, float]:
    """The factor on one entry that explains most of what is left, by how it changes the measured torque, and which share of what is
    left beyond noise it would explain."""
    weight = trial.sensor_weight
    turned = (_changed(problem, change(factor * 1.02)).measured - trial.measured) * weight / 0.02
    basis = result.basis()
    own = turned - basis @ (basis.T @ turned)
    left = (trial.measured - result.prediction) * weight
    power, along = float(own @ own), float(own @ left)
    if not power > 0.0:
        return factor, 0.0
    beyond = max(float(left @ left) - float(np.count_nonzero(weight)), 1e-30)
    return float(np.clip(factor * np.exp(np.clip(-along / power, -0.5, 0.5)), *SCALES)), along**2 / power / beyond


def _could_be_better(problem: Problem, trial: Problem, baseline: Fit) -> bool:
    """Whether, whatever is recalibrated, to first order less is left in a changed measured torque than the baseline leaves."""
    weight, basis = trial.sensor_weight, baseline.basis()
    before, after = ((each.measured - baseline.prediction) * weight for each in (problem, trial))
    own = after - basis @ (basis.T @ after)
    shown, seen = (float(np.sum(each.measured[each.valid] ** 2)) for each in (trial, problem))
    return float(own @ own) * seen < float(before @ before) * shown


def _changed(problem: Problem, cylinders: Mapping[str, Cylinder]) -> Problem:
    """The problem of a vehicle with other cylinders."""
    hydraulics = problem.vehicle.hydraulics
    assert hydraulics is not None
    vehicle: Vehicle = problem.vehicle.replace(
        hydraulics=replace(hydraulics, cylinders={**hydraulics.cylinders, **cylinders})
    )
    return Problem(vehicle, [with_hydraulics(run, vehicle) for run in problem.runs], problem.calibrations)


def _tried(problem: Problem, trial: Problem, result: Fit, key: str, factor: float | None, freed: Sequence[str] = ()) -> _Tried:
    """``freed``: names of levels that the entry sets free."""
    stuck = at_bounds(trial, result.x, [name for name in LEVELS if name not in freed])
    return _Tried(_suspect(problem, trial, result, key, factor), _surprise(trial, result, freed), bool(stuck))


def _suspect(problem: Problem, trial: Problem, result: Fit, key: str, factor: float | None) -> Suspect:
    """Judged in the torque as measured: a smaller bore makes all errors smaller, which explains nothing."""
    shown = float(np.sum(trial.measured[trial.valid] ** 2))
    seen = float(np.sum(problem.measured[problem.valid] ** 2))
    left = float(np.sum((trial.measured - result.prediction)[trial.valid] ** 2))
    return Suspect(key, factor, float(np.sqrt(left / max(shown, 1e-30))), result.cost * seen / max(shown, 1e-30), trial)
