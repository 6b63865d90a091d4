# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Predicting a recording: calibration values and trial physics in, the torque that the sensors would show out."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TypeVar

import numpy as np

from lugre_steering.chain.compose import SENSOR_HOOKS
from lugre_steering.chain.lag import lagged
from lugre_steering.chain.step import added, apart, records_of, torque_in_phases
from lugre_steering.data.dataset import Run, averaged
from lugre_steering.effects.entry import Effect, Parameter
from lugre_steering.effects.registry import effect as catalogue_entry
from lugre_steering.recording import Array, IntArray
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.model import Model, baseline_parameters, build_model
from lugre_steering.vehicle.size import FRICTION_NM, SPARE, TRAVEL_RAD, Size, decade, vehicle_size

LEAST_ARM = 0.1
"""Share of the drawing's moment arm that a true one has at least."""

T = TypeVar("T")
R = TypeVar("R")


def in_threads(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Map over threads (the compiled chain releases the interpreter lock), results in order."""
    if len(items) < 2 or _wanted_threads() == 1:
        return [function(item) for item in items]
    return list(_pool().map(function, items))


@lru_cache(maxsize=1)
def _pool() -> ThreadPoolExecutor:
    """One pool for the process; the mapped functions never map themselves."""
    return ThreadPoolExecutor(_wanted_threads())


def _wanted_threads() -> int:
    """As many as processors, or as LUGRE_STEERING_THREADS says."""
    wanted = os.environ.get("LUGRE_STEERING_THREADS", "")
    return int(wanted) if wanted.isdigit() and int(wanted) > 0 else os.cpu_count() or 1


def is_rig(vehicle: Vehicle) -> bool:
    """Whether it is a single joint or axis: its friction is given as torque, and nothing warms."""
    return vehicle.contact is not None and vehicle.rubber is None and len(vehicle.sides) == 1


@dataclass(frozen=True)
class SheetValue:
    """One baseline value that a vehicle sheet may have wrong.

    ``apply`` turns a change x into new parameter-record values; x = 0 is the sheet, ``prior`` its standard deviation.
    Factors enter as exp(x), so a doubling and a halving are equally far from the sheet.
    """

    name: str
    fields: tuple[str, ...]
    prior: float
    low: float
    high: float
    additive: bool = False


FRICTION = SheetValue("friction_level", ("static_torque", "coulomb_torque"), 0.15, -0.6, 0.6)
STATIC = SheetValue("static_ratio", ("static_torque",), 0.12, -0.3, 0.5, additive=True)
STIFFNESS = SheetValue("stiffness", ("sigma_0",), 0.15, -0.6, 0.6)
STRIBECK = SheetValue("stribeck_speed", ("stribeck_speed",), 0.15, -0.7, 0.7)
CAPACITY = SheetValue("heat_capacity", ("heat_capacity",), 0.15, -0.6, 0.6)
COOLING = SheetValue("cooling", ("cooling",), 0.15, -0.6, 0.6)
KINGPIN = SheetValue("kingpin_arm", ("aligning_torque",), 0.15, -0.6, 0.6)
"""What may be recalibrated: fields of the chain, and how far from the sheet (a logarithm unless additive): deviation and range."""
GAIN = SheetValue("pressure_gain", (), 0.03, -0.3, 0.3)
"""Scales the torque that the pressures show, no field of the chain."""
EXCESS_K, EXCESS_LOW_K, EXCESS_HIGH_K = 12.0, -10.0, 100.0
"""Rubber over air at the start of a bag beyond that of the vehicle file: standard deviation and range; 30 K after a drive, 70 K within an
hour of steering."""
AIR_K, AIR_FAR_K, AIR_KNOWN_K = 15.0, 50.0, 1.0
"""Air against the vehicle file where none was recorded: standard deviation and range; standard deviation where it was."""
LEAST_STATIC = 0.05
"""Share of the sliding friction that static friction has at least."""
TYPICAL = 1.0 / 3.0
"""Standard deviation of the size of a bend, in what it is at most, of real rubber."""
STANDARD = (FRICTION, STATIC, STIFFNESS, STRIBECK, CAPACITY, COOLING)
"""What is recalibrated unless more is asked for, with the doubts of a sheet and the most that it may be off."""


RIG = (
    replace(FRICTION, prior=0.5, low=-7.0, high=2.0),
    STATIC,
    replace(STIFFNESS, prior=0.7, low=-3.0, high=3.0),
    replace(STRIBECK, prior=0.7, low=-3.0, high=3.0),
)
"""Of a single joint or axis, whose sheet holds rough numbers: it may have next to no friction."""

SMOOTH = (RIG[0], replace(STATIC, low=-2.0), replace(RIG[2], high=6.0), RIG[3])
"""The same where friction rises smoothly from standstill, as that of lubricated contacts does: hardly any of it holds what stands."""
RISEN = 0.1
"""Share of the fastest rate at which such a friction has risen; over all rates it would be a viscous friction."""


def calibrations_for(vehicle: Vehicle) -> tuple[SheetValue, ...]:
    """The standard set; without rubber there is nothing thermal to calibrate."""
    if vehicle.rubber is not None:
        return STANDARD
    if not is_rig(vehicle):
        return STANDARD[:4]
    assert vehicle.contact is not None
    static, coulomb = vehicle.contact.static_torque_Nm, vehicle.contact.coulomb_torque_Nm
    if static < coulomb:
        return SMOOTH
    # Beside viscous friction of unknown size, a static level below the sliding one would be another viscous friction.
    return tuple(replace(c, low=-(static - coulomb) / coulomb) if c is STATIC else c for c in RIG)


def smooth_calibrations(vehicle: Vehicle, runs: Sequence[Run]) -> tuple[SheetValue, ...]:
    """Those of a single joint or axis whose friction rises smoothly from standstill, whatever its sheet says."""
    fastest = max(float(np.percentile(np.abs(run.omega), 99.0)) for run in runs)
    most = math.log(max(RISEN * fastest / baseline_parameters(vehicle)["stribeck_speed"], 1.0))
    return (*SMOOTH[:3], replace(SMOOTH[3], high=min(most, SMOOTH[3].high)))


@dataclass(frozen=True)
class Candidate:
    """An effect as it is tried: with fixed shape values, on one line or all bags, with free parameters named in ``free``.

    ``since``: time [s] in each bag from which it acts; empty if it always does.
    """

    effect: Effect
    shapes: tuple[tuple[str, float], ...] = ()
    line: str = ""
    bags: tuple[int, ...] | None = None
    free: tuple[str, ...] = ()
    since: tuple[float, ...] = ()

    @property
    def label(self) -> str:
        return self.effect.id + (f"[{self.line}]" if self.line else "")

    @property
    def claim(self) -> tuple[str, ...]:
        """Its label and the ends of the place at which it is tried: a place in the angle and one in time are different claims."""
        ends = {name for pair in self.effect.places for name in pair}
        return (self.label, *(name for name, _ in self.shapes if name in ends))

    def parameter(self, name: str) -> Parameter:
        return next(p for p in self.effect.parameters if p.name == name)

    def active_in(self, bag: int) -> bool:
        return self.bags is None or bag in self.bags

    def start(self, bag: int) -> float:
        return self.since[bag] if self.since else -np.inf


Values = Mapping[str, float]
Effects = Sequence[tuple[Candidate, Values]]


def standing_effects(vehicle: Vehicle) -> tuple[tuple[Candidate, Values], ...]:
    """Effects that the vehicle file already has, at their values."""
    found: list[tuple[Candidate, Values]] = []
    for entry in vehicle.effects:
        effect = catalogue_entry(entry.id)
        if effect.per_line:
            name = effect.parameters[0].name
            found += [(Candidate(effect, line=line), {name: value}) for line, value in entry.parameters.items()]
        else:
            found.append((Candidate(effect), dict(entry.parameters)))
    return tuple(found)


def size_of(vehicle: Vehicle, runs: Sequence[Run]) -> Size:
    """The size of a machine: of its sheet if it is a vehicle, else as its recordings show."""
    if vehicle.contact is None:
        return vehicle_size(vehicle)
    travel = max(float(np.ptp(run.theta)) for run in runs)
    torque = max(float(np.percentile(np.abs(run.measured), 99.0)) for run in runs)
    angle = 1.0 if vehicle.coordinate.unit == "rad" else decade(travel, TRAVEL_RAD)
    farthest = max(float(np.abs(run.theta).max()) for run in runs)
    return Size(decade(SPARE * torque / len(vehicle.sides), FRICTION_NM), angle, farthest)


def resized(effect: Effect, size: Size) -> Effect:
    """An entry of the catalogue with the scales and bounds of its parameters in the units of a machine."""

    def of(p: Parameter) -> Parameter:
        worth = size.of(p.unit)
        grid = p.grid if p.relative_to else tuple(worth * value for value in p.grid)
        low, high = size.range_of(p)
        if p.place:
            low, high = min(low, -size.farthest) if low < 0.0 else low, max(high, size.farthest)
        return replace(p, scale=p.scale * worth, low=low, high=high, grid=grid)

    return effect if size.usual else replace(effect, parameters=tuple(of(p) for p in effect.parameters))


class Problem:
    """Several runs of one vehicle, and the vector x = (calibration, bristle at the start of each bag, weather, effect parameters).

    Weather, of a vehicle with rubber: what the rubber is warmer than the air at the start of each bag, beyond the vehicle file [K],
    then what the air of each bag is warmer than recorded, or than the vehicle file says [K]. Last stand the sizes of ``bends``.
    """

    def __init__(
        self, vehicle: Vehicle, runs: Sequence[Run], calibrations: Sequence[SheetValue] | None = None, *, more_laws: int = 0,
        beside_names: bool = False, bends: Array | None = None,
    ) -> None:
        """``more_laws``: so many laws are tried, ``beside_names`` of the catalogue or in place of them, with the vehicle's alone.

        ``bends`` (n, k): torques [N m] by which the friction law itself may be of another shape, each at its largest.
        """
        self.vehicle = vehicle
        self.runs = list(runs)
        self._places = (more_laws, beside_names)
        self.model: Model = build_model(vehicle, lean=more_laws > 0 and not beside_names, more_laws=more_laws)
        self.calibrations = tuple(calibrations_for(vehicle) if calibrations is None else calibrations)
        self.measured = np.concatenate([run.measured for run in runs])
        self.valid = np.concatenate([run.valid for run in runs])
        self.sigma = np.concatenate([run.sigma for run in runs])
        """Standard deviation (n,) of the measured torque [N m] by the sensors alone, as the vehicle file and the recording say."""
        self.bag = np.concatenate([np.full(run.time.size, i) for i, run in enumerate(runs)])
        self.edges = np.concatenate([[0], np.cumsum([run.time.size for run in runs])])
        self.bends = np.zeros((self.measured.size, 0)) if bends is None else bends
        self.doubt = 1.0
        """Energy of the errors, in noise variances, that counts as one independent error; priors weigh as much against it."""
        self.typical = TYPICAL
        """Standard deviation of the size of a bend of the friction law, in what it is at most; of the last ``shapes``, TYPICAL."""
        self.shapes = 0
        record = self.model.parameters[0][0]
        self.presliding = float(record["coulomb_torque"] / record["sigma_0"])
        self.size = size_of(vehicle, self.runs)
        self.standing = standing_effects(vehicle)
        self._last_bending: tuple[bytes | None, Array] = None, np.zeros(self.measured.size)
        self._kept_chains: dict[int, tuple[tuple[bytes, Array], ...]] = {}
        self._last_calibrated: tuple[bytes | None, Array] = None, np.zeros(0)
        self._lines = vehicle.hydraulics.lines if vehicle.hydraulics is not None else ()

    @property
    def last_place(self) -> int:
        """The last of the places for laws."""
        return len(self.vehicle.laws) + self._places[0] - 1

    @property
    def sensor_weight(self) -> Array:
        """One over ``sigma`` (n,) [1/(N m)] where samples are valid, 0 elsewhere: before a fit has shown the noise."""
        return np.asarray(self.valid / self.sigma)

    @cached_property
    def mean_of(self) -> float:
        """Energy of the noise of a sample as recorded, in that of the means that stand for them, on the average of all; 1 where none do."""
        return float(np.mean(np.repeat([run.mean_of or 1.0 for run in self.runs], np.diff(self.edges))))

    @property
    def nuisances(self) -> int:
        """Calibration values, one initial bristle deflection per bag, its weather, and bends."""
        return self.first_bend + int(self.bends.shape[1])

    @cached_property
    def first_bend(self) -> int:
        """Where the sizes of the bends stand in x."""
        return int(len(self.calibrations) + len(self.runs) + self._weather[0].size)

    def start(self) -> Array:
        return np.zeros(self.nuisances)

    def scales(self) -> Array:
        """Finite-difference and normalisation scale of the nuisance part of x."""
        return np.concatenate(
            [[c.prior for c in self.calibrations] + [1.0] * len(self.runs), self._weather[0], np.ones(self.bends.shape[1])]
        )

    def prior_weights(self, priors: bool) -> Array:
        """Weight of the prior on each scaled nuisance; the sheet's off without ``priors``, but weather has no other source."""
        own = [float(priors)] * len(self.calibrations) + [0.3] * len(self.runs)
        bends = [1.0 / self.typical] * int(self.bends.shape[1] - self.shapes) + [1.0 / TYPICAL] * self.shapes
        known = 1.0 if is_rig(self.vehicle) else self.doubt**0.5  # the sheet of a rig is a guess, and weighs nothing
        return np.asarray(np.array(own + [1.0] * int(self._weather[0].size) + bends) * known)

    def bounds(self) -> tuple[Array, Array]:
        _, coldest, warmest = self._weather
        far = np.ones(self.bends.shape[1])
        low = np.concatenate([[c.low for c in self.calibrations] + [-1.5] * len(self.runs), coldest, -far])
        high = np.concatenate([[c.high for c in self.calibrations] + [1.5] * len(self.runs), warmest, far])
        return low, high

    @cached_property
    def _weather(self) -> tuple[Array, Array, Array]:
        """Standard deviation, lowest and highest value of each weather nuisance."""
        if self.vehicle.rubber is None:
            return np.zeros(0), np.zeros(0), np.zeros(0)
        excess = [(EXCESS_K, EXCESS_LOW_K, EXCESS_HIGH_K)] * len(self.runs)
        unknown, known = (AIR_K, -AIR_FAR_K, AIR_FAR_K), (AIR_KNOWN_K, -4.0 * AIR_KNOWN_K, 4.0 * AIR_KNOWN_K)
        air = [unknown if run.first_air is None else known for run in self.runs]
        deviation, low, high = np.array(excess + air).T
        return deviation, low, high

    def bent(self, columns: Sequence[Array]) -> Problem:
        """The same with more bends, each of ``columns`` (n, k), whose size is known."""
        bent = copy(self)
        bent.bends = np.hstack([self.bends, *columns])
        bent._last_bending = None, np.zeros(0)
        bent.shapes = int(bent.bends.shape[1] - self.bends.shape[1] + self.shapes)
        return bent

    def unshaped(self) -> Problem:
        """The same without the bends of names."""
        plain = copy(self)
        plain.bends = self.bends[:, : self.bends.shape[1] - self.shapes]
        plain._last_bending, plain.shapes = (None, np.zeros(0)), 0
        return plain

    def of_sheet(
        self, vehicle: Vehicle | None = None, calibrations: Sequence[SheetValue] | None = None, runs: Sequence[Run] | None = None,
        kept: IntArray | slice = slice(None),
    ) -> Problem:
        """The same with another sheet, other calibrations, or ``runs`` of the samples ``kept``, as bent and in as much doubt."""
        calibrations = self.calibrations if calibrations is None else calibrations
        other = Problem(vehicle or self.vehicle, runs or self.runs, calibrations, bends=self.bends[kept])
        other.doubt, other.typical, other.shapes = self.doubt, self.typical, self.shapes
        return other

    def with_names(self) -> Problem:
        """The same without bends, with all of the catalogue beside its places for laws."""
        return Problem(self.vehicle, self.runs, self.calibrations, more_laws=self._places[0], beside_names=True)

    def over(self, runs: Sequence[Run]) -> Problem:
        """The same vehicle, with as many places for laws, in other runs; without bends."""
        more_laws, beside_names = self._places
        return Problem(self.vehicle, runs, self.calibrations, more_laws=more_laws, beside_names=beside_names)

    def doubted(self, doubt: float, typical: float) -> Problem:
        """The same with another doubt, and another typical size of bends."""
        doubted = copy(self)
        doubted.doubt, doubted.typical = doubt, typical
        return doubted

    def calibrating(self, calibration: SheetValue) -> Problem:
        """The same with one more value of the sheet that may be wrong."""
        more = copy(self)
        more.calibrations, more._last_calibrated = (*self.calibrations, calibration), (None, np.zeros(0))
        for known in ("_sheet", "_gains"):  # of the calibrations before
            more.__dict__.pop(known, None)
        return more

    def with_known_weather(self) -> Problem:
        """The same where every bag is known to have begun as warm as the vehicle file says, to a hundredth of a degree."""
        known = copy(self)
        deviation, coldest, warmest = self._weather
        known._weather = (1e-3 * deviation, 1e-3 * coldest, 1e-3 * warmest)
        return known

    def one_bag(self, x: Array) -> Array:
        """The calibration of x for another run alone, with bristle and weather of the vehicle file."""
        return np.concatenate([x[: len(self.calibrations)], np.zeros(1 if self.vehicle.rubber is None else 3)])

    def temperatures(self, bag: int, x: Array) -> tuple[float, float]:
        """Rubber and air [degC] at the start of a bag; of a vehicle with rubber."""
        initial = self.vehicle.initial
        assert initial is not None
        first, recorded = len(self.calibrations) + len(self.runs), self.runs[bag].first_air
        excess, warmer = float(x[first + bag]), float(x[first + len(self.runs) + bag])
        air = (initial.air_temperature_degC if recorded is None else recorded) + warmer
        return air + initial.rubber_temperature_degC - initial.air_temperature_degC + excess, air

    def starts(self, x: Array) -> list[tuple[float, float]]:
        """``temperatures`` of all bags; none of a vehicle without rubber."""
        return [] if self.vehicle.rubber is None else [self.temperatures(bag, x) for bag in range(len(self.runs))]

    def fields(self, x: Array) -> dict[str, float]:
        """Baseline parameter-record values for the calibration part of x."""
        sheet, values = self._sheet, dict[str, float]()
        changes = x[: len(self.calibrations)]
        for calibration, change, factor in zip(self.calibrations, changes.tolist(), np.exp(changes).tolist(), strict=True):
            for field in calibration.fields:
                old = values[field] if field in values else sheet[field]
                if calibration.additive:
                    values[field] = old + change * values.get("coulomb_torque", sheet["coulomb_torque"])
                else:
                    values[field] = old * factor
        if "static_torque" in values:
            coulomb = values.get("coulomb_torque", sheet["coulomb_torque"])
            values["static_torque"] = max(values["static_torque"], LEAST_STATIC * coulomb)
        return values

    @cached_property
    def _sheet(self) -> dict[str, float]:
        """What the record of the vehicle file holds of the fields that calibrations change; read one by one it takes long."""
        return {field: self.sheet[field] for field in {"coulomb_torque", *(f for c in self.calibrations for f in c.fields)}}

    @cached_property
    def sheet(self) -> dict[str, float]:
        """The baseline's fields of the parameter record, as the vehicle file has them."""
        record = self.model.parameters[0][0]
        return {field: float(record[field]) for field in (*baseline_parameters(self.vehicle), "aligning_torque")}

    @cached_property
    def _at(self) -> dict[str, int | slice]:
        """Where each field stands among the numbers of a parameter record: faster than by name, and as a record has it."""
        kind = self.model.parameters[0].dtype
        assert kind.fields is not None
        begin = {name: (offset // 8, field.itemsize // 8) for name, (field, offset, *_) in kind.fields.items()}
        return {name: first if count == 1 else slice(first, first + count) for name, (first, count) in begin.items()}

    @cached_property
    def _gains(self) -> tuple[int, ...]:
        return tuple(i for i, c in enumerate(self.calibrations) if c.name == GAIN.name)

    def gain(self, x: Array) -> float:
        """Factor on the sheet's pressure gain."""
        return float(np.exp(sum(x[i] for i in self._gains))) if self._gains else 1.0

    def torque(
        self, bag: int, x: Array, effects: Sequence[tuple[Candidate, Values]] = (), run: Run | None = None, *, keep: bool = False
    ) -> Array:
        """Model torque of one bag (n,) with all effects, before the sensors; ``run``: the same bag with another motion.

        ``keep``: others will be asked for that differ by what only adds to it.
        """
        run = run or self.runs[bag]
        kind, places = self.model.parameters[0].dtype, self._at
        numbers = self._calibrated(x).copy()
        numbers[places["initial_bristle"]] = x[len(self.calibrations) + bag] * self.presliding
        warmer = 0.0
        if self.vehicle.rubber is not None:
            numbers[places["rubber_temperature"]], numbers[places["air_temperature"]] = self.temperatures(bag, x)
            warmer = float(x[len(self.calibrations) + 2 * len(self.runs) + bag])
        phases = []
        starts = [-np.inf]
        if run.air or any(candidate.since for candidate, _ in effects):
            starts = sorted({-np.inf, *(candidate.start(bag) for candidate, _ in effects), *(since for since, _ in run.air)})
        for start in starts:
            acting = numbers.copy() if len(starts) > 1 else numbers
            for since, air in run.air:
                if since <= start:
                    acting[places["air_temperature"]] = air + warmer
            for candidate, values in effects:
                if candidate.start(bag) <= start and not candidate.effect.per_line:
                    for field, number in candidate.effect.fields(values).items():
                        acting[places[field]] = number
            phases.append(acting)
        # What only adds is no part of the chain, which is the same then while a fit moves nothing else.
        warms = self.vehicle.rubber is not None
        beside = apart(phases, kind, warms)
        torque = self._chain(bag, [*zip(starts, phases, strict=True)], run, keep and not (warms and beside is None))
        return torque if beside is None else torque + added(records_of(beside, kind), run.theta, run.omega, run.alpha)

    def _chain(self, bag: int, phases: Sequence[tuple[float, Array]], run: Run, keep: bool) -> Array:
        """Torque of the chain (n,), one of those kept if it is: of each bag the last two, of which a fit leaves the worse."""
        key = b"".join(np.float64(start).tobytes() + numbers.tobytes() for start, numbers in phases)
        kept = self._kept_chains.get(bag, ()) if run is self.runs[bag] else ()
        for last, known in kept:
            if last == key:
                return known
        records = [(start, records_of(numbers, self.model.parameters[0].dtype)) for start, numbers in phases]
        torque = torque_in_phases(records, self.model.rubber, *run.steps)[:: 1 + run.midway]
        if keep and run is self.runs[bag]:
            self._kept_chains[bag] = ((key, torque), *kept[:1])
        return torque

    def _calibrated(self, x: Array) -> Array:
        """The numbers of the parameter record for the calibration part of x; kept, as they are the same for all bags and while a fit moves
        anything else."""
        key, last = x[: len(self.calibrations)].tobytes(), self._last_calibrated
        if last[0] != key:
            numbers = self.model.parameters[0].view(np.float64).copy()
            for field, value in self.fields(x).items():
                numbers[self._at[field]] = value
            self._last_calibrated = last = key, numbers
        return last[1]

    def predict(
        self, bag: int, x: Array, effects: Sequence[tuple[Candidate, Values]] = (), run: Run | None = None, *, keep: bool = False
    ) -> Array:
        """Measured torque that the model expects in one bag (n,): sensor effects included, those of the vehicle file too; ``keep`` as of
        ``torque``.

        An effect that stands in the file and is given again counts as given.
        """
        run, own = run or self.runs[bag], slice(self.edges[bag], self.edges[bag + 1])
        here = [effect for effect in effects if effect[0].active_in(bag)]
        torque = self.torque(bag, x, here, run, keep=keep)
        given = {candidate.label for candidate, _ in here} if self.standing else set()
        every = [*(effect for effect in self.standing if effect[0].label not in given), *here]
        if run.sharp is not None:
            rough = (run.sharp - run.alpha).sum(axis=0)
            inertias = (effect for effect in every if effect[0].effect.of_every_joint and "alpha" in effect[0].effect.reads("torque"))
            torque = torque + sum(candidate.effect.law("torque", values, alpha=rough) for candidate, values in inertias)
        for candidate, values in every:
            start = candidate.start(bag)
            if candidate.effect.hooks.keys() & SENSOR_HOOKS:
                changed = self._through_sensor(run, candidate, values, torque, start)
                torque = np.where(run.time >= start, changed, torque) if candidate.since else changed
        torque = averaged(run, torque)
        if self._gains:
            torque = torque / self.gain(x)
        return torque + self._bending(x)[own] if self.bends.shape[1] else np.ascontiguousarray(torque)

    def _bending(self, x: Array) -> Array:
        """Torque (n,) of the bends; kept, as it is the same for all bags and while a fit moves anything else."""
        sizes = x[self.first_bend : self.nuisances]
        last = self._last_bending  # threads share it: read once, replaced whole
        if last[0] != sizes.tobytes():
            self._last_bending = last = sizes.tobytes(), self.bends @ sizes
        return last[1]

    def _through_sensor(self, run: Run, candidate: Candidate, values: Values, torque: Array, start: float) -> Array:
        """Apply one sensor effect by its laws; errors of angles and arms act through the slopes and parts of the measured torque."""
        known = candidate.effect
        if "lag" in known.hooks:
            torque = lagged(torque, run.time[1] - run.time[0], known.law("lag", values))
        if "delay" in known.hooks:
            torque = np.interp(run.time - known.law("delay", values), run.time, torque)
        if "line" in known.hooks:
            elapsed = np.maximum(run.time - max(start, 0.0), 0.0)
            torque = torque + run.torque_per_line[self._lines.index(candidate.line)] * known.law("line", values, elapsed=elapsed)
        if "angle" in known.hooks:
            torque = torque + ((run.theta - known.law("angle", values, theta=run.theta)) * run.side_slope).sum(axis=0)
        if "arm" in known.hooks:
            factor = known.law("arm", values, theta=run.theta)
            size = np.abs(run.gains).sum(axis=1)
            mean = np.maximum((factor * size).sum(axis=0) / size.sum(axis=0), LEAST_ARM)
            # The error counts in the torque as measured: else a smaller arm would make both smaller, and look better.
            error = (factor * run.side_torque).sum(axis=0) - torque
            torque = run.side_torque.sum(axis=0) - error / mean
        return np.asarray(torque)

    def predict_all(self, x: Array, effects: Sequence[tuple[Candidate, Values]] = ()) -> Array:
        return np.concatenate(in_threads(lambda bag: self.predict(bag, x, effects, keep=True), range(len(self.runs))))
