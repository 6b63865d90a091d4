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
from typing import NamedTuple

import numpy as np

from lugre_steering.data.dataset import Run, acceleration, measured_with, motion, with_hydraulics
from lugre_steering.fitting.entries import (
    CONSERVATIVE,
    LEVEL,
    PRESSURES,
    STIFF,
    Resized,
    exchanges,
    knuckle,
    levels,
    resized,
    sizes,
)
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Candidate, Problem, SheetValue, Values, is_rig
from lugre_steering.recording import Array, BagFinding, IntArray
from lugre_steering.serialise import IN_MEMORY
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.sections import Cylinder

SURPRISE = 10.0
"""Squared prior deviations, of friction level, stiffness and weather together, from which a sheet is suspect."""
RELIEVED = 0.5
"""Share of the surprise that a hypothesis must leave at most, unless a value stands at its bound."""
EDGE = 0.01
"""Share of its range within which a value stands at its bound."""
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
CLAIMED = 0.5
"""Share of what an entry claims that is there at most, if its error is what names take back."""
PUT_RIGHT = 0.03
"""Error that is left, as share of the torque, with which a sheet counts as put right."""
FORETOLD, REACHED = 0.5, 0.9
"""Share of what a wrong entry must explain that its linearisation foretells at least, and that its torques anywhere in its range reach."""
POINTS = 9
"""Values, over the range of a level, at which its torque is looked at before it is fitted."""
STEPS, MOST_SIZES = 6, 8
"""Steps that look for a factor; sizes that promise most, to which recalibration is fitted anew."""
OFF, SEVERAL = 0.03, 1.1
"""Relative error from which an entry is wrong, and what several wrong entries must be worth against one."""
TIED = 1.1
"""Cost over the lowest up to which a hypothesis is as good."""
SHOWN, TOLD = 5, 3
"""Most suspects of a result, and those told in words; with these all that are as good as the last of them."""
SAME_SIZE = 0.1
"""Share by which torques differ that are told to be of one size."""
LEVELS = ("friction_level", "stiffness")
"""Values that stop at a bound where a wrong entry makes all torques too large or too small."""


@dataclass(frozen=True)
class Suspect:
    """An entry of the vehicle file: its key, by which factor it seems wrong (None: exchanged), and the error that is left with it
    put right, as share of the measured torque (None: not fitted); ``right``: the problem with it put right; ``claims_more``: a torque of
    its own, which is larger in the file than it is."""

    key: str
    factor: float | None
    relative_error: float | None
    cost: float = field(metadata=IN_MEMORY)
    right: Problem | None = field(default=None, metadata=IN_MEMORY, repr=False)
    claims_more: bool = field(default=False, metadata=IN_MEMORY)

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
        told = [one for i, one in enumerate(self.suspects) if i < TOLD or one.cost <= TIED * self.suspects[TOLD - 1].cost]
        check = ", ".join(suspect.words for suspect in told)
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
    """Whether the recalibrated baseline needs more than nominal values allow, and another entry puts that right, or at least takes that
    need away; else None."""
    thin, doubt = _doubted(thinned(problem)[0])
    baseline = _fitted(thin)
    surprise = _surprise(thin, baseline)
    stuck = at_bounds(thin, baseline.x, LEVELS)
    if not stuck and surprise < SURPRISE:
        return None
    found = sorted(_off((*_levels(thin, baseline), *_geometries(thin, baseline))), key=_least)
    if not found:
        return None
    best = found[0].suspect
    floor = float(np.count_nonzero(thin.valid)) / doubt
    fits = best.puts_right or best.cost - floor < RELIEVED * (baseline.cost - floor)
    if not fits or min(tried.surprise for tried in found if tried.suspect.cost < TIED * best.cost) > RELIEVED * surprise:
        # What is left may be friction of another form, which no entry explains: one that takes the surprise is wrong all the same.
        taking = [tried for tried in found if _takes_surprise(tried, baseline.cost, surprise)]
        if not taking:
            return None
        found = [*taking, *(tried for tried in found if tried not in taking)]
        best = found[0].suspect
    rest = (best.cost - floor) / max(baseline.cost - floor, 1e-30)
    # An entry with which the rest of the sheet is as much of a surprise as before is not what is wrong, however little it leaves.
    relieving = [tried for tried in found if not tried.stuck and tried.surprise <= RELIEVED * surprise]
    others = sorted((tried for tried in found if tried not in relieving), key=lambda tried: tried.stuck)
    shown = [*relieving, *others][: min(SHOWN, max(TOLD, len(relieving)))]
    return WrongSheet(_ratio(thin), tuple(tried.suspect for tried in shown), stuck=bool(stuck), rest=rest)


def _takes_surprise(tried: _Tried, cost: float, surprise: float) -> bool:
    """Whether with an entry put right recalibration stops at no bound and is no surprise any more, and that is what makes it cost less."""
    return not tried.stuck and max(tried.surprise, surprise - (cost - tried.suspect.cost)) < RELIEVED * surprise


def form_instead(beside: Fit, problem: Problem, wrong: WrongSheet) -> bool:
    """Whether ``beside`` the freedoms of the friction law, which ``problem`` has, the values of the sheet are no surprise: friction of
    another form had taken them far off it."""
    return not wrong.stuck and not at_bounds(problem, beside.x, LEVELS) and _surprise(problem, beside) < SURPRISE


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
    floor = float(np.count_nonzero(thin.valid))
    excess = baseline.cost - floor
    if excess <= 0.0:
        return None
    named = fit(thin, thin.sensor_weight, [(c, dict(v)) for c, v in effects], baseline.x, robust=True) if effects else baseline
    beside_names, most_left = named.cost - floor, min(1.0 - EXPLAINED, BETTER * rival)
    # Where sensors are quieter than the sheet says, names may leave less than their noise: a share of that tells nothing.
    clearly = max((1.0 - BETTER) * beside_names, SURPRISE)
    wanted = claimed = 1.0 - most_left
    if effects:  # beside these an entry must leave clearly less, or claim what they take back
        wanted = max(wanted, 1.0 - (beside_names - clearly) / excess)
        claimed = 1.0 - max(beside_names / excess, most_left)
    every = (*_levels(thin, baseline, wanted, claimed), *(_geometries(thin, baseline, FORETOLD * wanted) if wanted < 1.0 else ()))
    found = sorted((tried.suspect for tried in _off(every)), key=lambda item: item.cost)
    if not found:
        return None
    left = found[0].cost - floor
    # What is missing adds to a sheet; names that only take away what an entry of it claims are that entry's error.
    least_taken = BETTER * (excess - beside_names)
    may_leave = min(beside_names, rival * excess) + clearly  # far more than a rival leaves is no matter of names or this sheet
    claims = [
        suspect for suspect in found
        if effects and suspect.claims_more and suspect.cost - floor < may_leave and baseline.cost - suspect.cost > least_taken
    ]  # fmt: skip
    if claims:
        found = [*claims, *(suspect for suspect in found if suspect not in claims)]
        return WrongSheet(_ratio(thin), tuple(found[:SHOWN]), "one entry of this sheet claims what the recordings do not show")
    if left > most_left * excess or (effects and beside_names - left < clearly):
        return None
    return WrongSheet(_ratio(thin), tuple(found[:SHOWN]), "one entry of this sheet explains most of what recalibration leaves")


def _off(found: Iterable[_Tried]) -> list[_Tried]:
    """Those whose entry is off by more than drawings and tapes are."""
    return [tried for tried in found if (factor := tried.suspect.factor) is None or not 1.0 - OFF < factor < 1.0 + OFF]


def at_bounds(problem: Problem, x: Array, names: Sequence[str]) -> list[str]:
    """Calibration values of those ``names`` that stand at an end of their range."""
    return [
        c.name for c, value in zip(problem.calibrations, x, strict=False)
        if c.name in names and not c.low + EDGE * (c.high - c.low) < value < c.high - EDGE * (c.high - c.low)
    ]  # fmt: skip


def gone_too_far(problem: Problem, x: Array) -> bool:
    """Whether friction level or stiffness stand at an end of their range: beside these a name only makes up for something else. What the
    sheet of an unknown rig says is a guess anyhow."""
    return not is_rig(problem.vehicle) and bool(at_bounds(problem, x, LEVELS))


def thinned(problem: Problem, most: int = SAMPLES, rate_Hz: float = RATE_HZ) -> tuple[Problem, IntArray]:
    """The same with few samples, ``most`` unless they are slow and not more often than at ``rate_Hz``, and which these are."""
    total = sum(run.time.size for run in problem.runs)
    runs, kept = [], []
    for run, first in zip(problem.runs, problem.edges, strict=False):
        step = float(run.time[1] - run.time[0])
        stride = max(1, round(1.0 / rate_Hz / step), -(-total // most) if step < 0.1 else 1)
        runs.append(_every(run, stride))
        kept.append(first + np.arange(0, run.time.size, stride))
    every = np.concatenate(kept)
    return problem.of_sheet(runs=runs, kept=every), every


def _doubted(problem: Problem) -> tuple[Problem, float]:
    """The same with errors as large as the baseline leaves, of which those of ERROR_S count once; and by what their energy has grown.

    Friction of another form than the law's would else drive every value as far from its sheet as helps a little.
    """
    misfit = max(_fitted(problem).cost / max(int(np.count_nonzero(problem.valid)), 1), 1.0)
    step = max(float(run.time[1] - run.time[0]) for run in problem.runs)
    doubt = misfit * max(ERROR_S / step, 1.0)
    return problem.of_sheet(runs=[replace(run, sigma=run.sigma * doubt**0.5) for run in problem.runs]), doubt


def _every(run: Run, stride: int) -> Run:
    if stride == 1:
        return run
    keep = slice(None, None, stride)
    time, theta = run.time[keep].copy(), run.theta[:, keep].copy()
    omega, alpha = motion(time, theta)
    raw = run.raw[:, keep]
    return replace(
        run, time=time, theta=theta, omega=omega, alpha=alpha, raw=raw, sharp=None if run.sharp is None else acceleration(time, raw),
        bridged=run.bridged[keep],
        gains=run.gains[:, :, keep], pressure=run.pressure[:, keep],
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
    weather = scaled[count + len(problem.runs) : problem.first_bend]
    return float(sum(own) + weather.sum() / len(problem.runs))


def _ratio(problem: Problem) -> float:
    """Measured torque over that of the sheet."""
    expected = problem.predict_all(problem.start())[problem.valid]
    return torque_ratio(float(problem.measured[problem.valid] @ expected), float(expected @ expected))


def _levels(problem: Problem, baseline: Fit, least: float = 0.0, claimed: float = 0.0) -> Iterator[_Tried]:
    """Hypotheses about whole levels; only those that may explain ``least`` of what is left beyond noise, or ``claimed`` of it where they
    are a torque of their own."""
    known = [c for c in problem.calibrations if c.name != PRESSURES.name]

    def tried(key: str, values: Sequence[SheetValue], starts: Sequence[float], factor: Callable[[float], float] | None) -> _Tried:
        freed = [value.name for value in values]
        trial = problem.of_sheet(calibrations=[*values, *(c for c in known if c.name not in freed)])
        begun = [_begun(problem, baseline, trial), *(np.concatenate([[start], trial.start()[1:]]) for start in starts)]
        result = min((_fitted(trial, start=x) for x in begun), key=lambda each: each.cost)
        return _tried(problem, trial, result, key, None if factor is None else factor(float(result.x[0])), freed)

    def hopeless(*values: SheetValue) -> bool:
        asked = REACHED * (claimed if CONSERVATIVE in values else least)
        return asked > 0.0 and _reach(problem, baseline, values) < asked

    for level in levels(problem.vehicle, problem.sheet):
        if hopeless(level.value):
            continue
        found = tried(level.key, [level.value], level.starts, level.factor)
        claims = level.value is CONSERVATIVE and abs(found.suspect.factor or 0.0) < CLAIMED
        yield found._replace(suspect=replace(found.suspect, claims_more=claims))
    several = (LEVEL, STIFF, PRESSURES)
    if not hopeless(*several):
        other = tried("several entries: another vehicle", several, (0.0,), None)
        yield other._replace(suspect=replace(other.suspect, cost=SEVERAL * other.suspect.cost))


def _reach(problem: Problem, baseline: Fit, values: Sequence[SheetValue]) -> float:
    """Share of what the baseline leaves beyond noise that ``values`` could explain at most: by the torques that they make over their
    range, in any combination, whatever is recalibrated. A run of the chain each, where a fit takes hundreds."""
    weight, others = problem.sensor_weight, [c for c in problem.calibrations if c.name not in {value.name for value in values}]
    freed = problem.of_sheet(calibrations=[*values, *others])
    begin, moved = _begun(problem, baseline, freed), []
    for i, value in enumerate(values):
        for number in np.linspace(value.low, value.high, POINTS):
            x = begin.copy()
            x[i] = number
            moved.append((freed.predict_all(x) - baseline.prediction) * weight)
    left, every = (problem.measured - baseline.prediction) * weight, np.column_stack([baseline.basis(), *moved])
    explained = every @ np.linalg.lstsq(every, left, rcond=1e-9)[0]
    beyond = float(left @ left) - float(np.count_nonzero(weight))
    return float(explained @ explained) / max(beyond, 1e-30)


def _begun(problem: Problem, baseline: Fit, trial: Problem) -> Array:
    """Where the baseline stands in a problem with other calibrations."""
    at = dict(zip((c.name for c in problem.calibrations), baseline.x, strict=False))
    return np.concatenate([[at.get(c.name, 0.0) for c in trial.calibrations], baseline.x[len(problem.calibrations) :]])


def _geometries(problem: Problem, baseline: Fit, least: float = 0.0) -> Iterator[_Tried]:
    """Hypotheses about sizes of cylinders, the arms of all, and what may be exchanged; only those of which is foretold that ``least`` of
    what is left beyond noise goes, or, of what is exchanged, anything."""
    hydraulics = problem.vehicle.hydraulics
    if hydraulics is None:
        return
    shares = {key: (change, *_best(problem, baseline, change)) for key, change in sizes(hydraulics)}
    promising = sorted((key for key in shares if shares[key][2] >= least), key=lambda key: -shares[key][2])
    for key in promising[:MOST_SIZES]:
        change, factor, _ = shares[key]
        trial, result = _refitted(problem, baseline, change(factor))
        factor, _ = _better(problem, trial.measured, result, change, factor)
        yield _tried(problem, *_refitted(problem, baseline, change(factor)), key, factor)
    if not least:  # levers of half or twice the length are too far off for a linearisation
        arms = [(resized(hydraulics.cylinders, knuckle, factor), factor) for factor in ARMS]
        tried = [_tried(problem, *_refitted(problem, baseline, each), "knuckle_m of all cylinders", f) for each, f in arms]
        yield min(tried, key=_least)
    for key, cylinders in exchanges(hydraulics):
        trial = _changed(problem, cylinders)
        if _could_be_better(problem, trial, baseline):
            yield _tried(problem, trial, _fitted(trial, start=baseline.x), key, None)


def _best(problem: Problem, baseline: Fit, change: Resized) -> tuple[float, float]:
    """The factor on a size with which, whatever is recalibrated, least is left to first order in that, and the share of what is left beyond
    noise that it would explain: by steps, since arms and areas are no lines."""
    weight, basis, factor = problem.sensor_weight, baseline.basis(), 1.0

    def left(measured: Array) -> float:
        error = (measured - baseline.prediction) * weight
        own = error - basis @ (basis.T @ error)
        return float(own @ own) * _seen(problem) / _energy(problem, measured)

    before = least = left(problem.measured)
    measured = _measured(problem, change(factor))
    for _ in range(STEPS):
        further, _ = _better(problem, measured, baseline, change, factor)
        measured = _measured(problem, change(further))
        reached = left(measured)
        if not reached < least:
            break
        factor, least = further, reached
    return factor, (before - least) / max(before - float(np.count_nonzero(weight)), 1e-30)


def _refitted(problem: Problem, baseline: Fit, cylinders: Mapping[str, Cylinder]) -> tuple[Problem, Fit]:
    """The problem of a vehicle with other cylinders, and its fit."""
    trial = _changed(problem, cylinders)
    return trial, _fitted(trial, start=baseline.x)


def _better(problem: Problem, measured: Array, result: Fit, change: Resized, factor: float) -> tuple[float, float]:
    """The factor on one entry that explains most of what is left, by how it changes the ``measured`` torque (n,) that it makes, and which
    share of what is left beyond noise it would explain."""
    weight = problem.sensor_weight
    turned = (_measured(problem, change(factor * 1.02)) - measured) * weight / 0.02
    basis = result.basis()
    own = turned - basis @ (basis.T @ turned)
    left = (measured - result.prediction) * weight
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
    return float(own @ own) * _seen(problem) < float(before @ before) * _seen(trial)


def _seen(problem: Problem) -> float:
    """Sum of squares of the measured torque."""
    return _energy(problem, problem.measured)


def _energy(problem: Problem, torque: Array) -> float:
    """Sum of squares of a torque (n,) where samples are valid."""
    return float(np.sum(torque[problem.valid] ** 2))


def _changed(problem: Problem, cylinders: Mapping[str, Cylinder]) -> Problem:
    """The problem of a vehicle with other cylinders."""
    vehicle = _with_cylinders(problem, cylinders)
    return problem.of_sheet(vehicle, runs=[with_hydraulics(run, vehicle) for run in problem.runs])


def _measured(problem: Problem, cylinders: Mapping[str, Cylinder]) -> Array:
    """The measured torque (n,) of that alone, which is far quicker."""
    vehicle = _with_cylinders(problem, cylinders)
    return np.concatenate([measured_with(run, vehicle) for run in problem.runs])


def _with_cylinders(problem: Problem, cylinders: Mapping[str, Cylinder]) -> Vehicle:
    hydraulics = problem.vehicle.hydraulics
    assert hydraulics is not None
    return problem.vehicle.replace(hydraulics=replace(hydraulics, cylinders={**hydraulics.cylinders, **cylinders}))


def _tried(problem: Problem, trial: Problem, result: Fit, key: str, factor: float | None, freed: Sequence[str] = ()) -> _Tried:
    """``freed``: names of levels that the entry sets free."""
    stuck = at_bounds(trial, result.x, [name for name in LEVELS if name not in freed])
    return _Tried(_suspect(problem, trial, result, key, factor), _surprise(trial, result, freed), bool(stuck))


def _suspect(problem: Problem, trial: Problem, result: Fit, key: str, factor: float | None) -> Suspect:
    """Judged in the torque as measured: a smaller bore makes all errors smaller, which explains nothing."""
    shown = _seen(trial)
    left = float(np.sum((trial.measured - result.prediction)[trial.valid] ** 2))
    return Suspect(key, factor, float(np.sqrt(left / max(shown, 1e-30))), result.cost * _seen(problem) / max(shown, 1e-30), trial)
