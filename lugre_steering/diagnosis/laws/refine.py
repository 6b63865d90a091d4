# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A cell in the chain: f as free pieces, fitted jointly with the calibration, then the simplest closed form that keeps its gain."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lugre_steering.diagnosis.laws.cells import Axis, Cell
from lugre_steering.effects import laws
from lugre_steering.effects.entry import Effect, Parameter
from lugre_steering.effects.law_entry import LawEntry, law_fields
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Candidate, Problem
from lugre_steering.recording import Array

KEPT = 0.95
"""Share of the free gain that a closed form must keep."""
NUMBER_COSTS = 0.01
"""Share of the gain that one more value of a law must bring to be preferred."""
PULL = 0.03
"""How strongly fits pull the free pieces to zero, for those that the data do not show."""
TRIED_FORMS = 3
"""Closed forms that are fitted in the chain, of those that promise most."""
SHARE, MOST = 0.03, 1e4
"""Size of a law worth seeing, as a share of the torque amplitude, and how many times that it may have."""
FITTED = ("lag", "ring")
"""Memories whose size is fitted, not chosen."""
UNSEEN = 1e-10
"""Share of the largest variance of a fit below which a direction of its values is one that the data do not show."""


@dataclass(frozen=True, kw_only=True)
class Law(Effect):
    """A law as it is fitted: ``shape`` makes f (KNOTS,) of its values, ``form`` and ``fixed`` say what it is in a file."""

    cell: Cell
    form: str
    shape: Callable[[Mapping[str, float]], Array]
    fixed: Mapping[str, float] = dataclasses.field(default_factory=dict)
    centred: bool = False
    """Whether a constant is none of it, as a name has that."""

    def at(self, values: Mapping[str, float]) -> Cell:
        """The cell with the memory that was fitted."""
        if "memory_size" not in values:
            return self.cell
        return dataclasses.replace(self.cell, axis=dataclasses.replace(self.cell.axis, memory_size=values["memory_size"]))

    def fields(self, values: Mapping[str, float] | Mapping[str, float | Array]) -> dict[str, float | Array]:
        numbers = {name: float(value) for name, value in values.items()}
        cell = self.at(numbers)
        if self.form == laws.TABLE:
            made = cell.fields(self.shape(numbers))
        else:  # as a vehicle file has it, where closed forms go on beyond what was seen
            axis, known = cell.axis, {**self.fixed, **{name: value for name, value in numbers.items() if name != "memory_size"}}
            span = (cell.low, cell.high)
            made = law_fields(LawEntry(cell.channel, axis.coordinate, self.form, span, known, (), axis.memory, axis.memory_size))
        return {f"{self.id}_{name}": value for name, value in made.items()}


def _law(cell: Cell, place: int, form: str, parameters: Sequence[Parameter], **more: object) -> Law:
    slot = laws.slot(place)
    memory: tuple[Parameter, ...] = ()
    if cell.axis.memory == "lag":
        memory = (Parameter("memory_size", "s", "time constant", 1.0, 0.05, 60.0, (1.0,)),)
    elif cell.axis.memory == "ring":
        known = cell.axis.memory_size
        memory = (Parameter("memory_size", "s", "period", 0.02 * known, 0.8 * known, 1.25 * known),)
    plain = {item.name: getattr(slot, item.name) for item in dataclasses.fields(slot) if item.name != "parameters"}
    return Law(**plain, parameters=(*parameters, *memory), cell=cell, form=form, **more)  # type: ignore[arg-type]


def typical(problem: Problem, channel: str) -> float:
    """A size of f that is worth seeing."""
    amplitude = SHARE * float(np.ptp(problem.measured)) / 2.0 / len(problem.vehicle.sides)
    rate = max(float(np.abs(run.omega).max()) for run in problem.runs)
    acceleration = max(float(np.abs(run.alpha).max()) for run in problem.runs)
    return {
        "conservative_torque": amplitude, "coulomb_friction": amplitude, "viscous_loss": amplitude / rate,
        "turbulent_loss": amplitude / rate**2, "inertia": amplitude / acceleration, "linked_inertia": amplitude / acceleration, "lag": 0.05,
    }.get(channel, SHARE)  # fmt: skip


def free_law(
    problem: Problem, cell: Cell, place: int, pieces: Array, *, centred: bool = False
) -> tuple[Candidate, dict[str, float]]:
    """The cell with f of free pieces, that start as given; ``centred``: without their mean, which something else has."""
    scale, names = typical(problem, cell.channel), [f"piece_{i}" for i in range(cell.pieces)]
    basis = cell.basis(np.linspace(cell.low, cell.high, laws.KNOTS))
    low = 0.0 if cell.channel == "lag" else -MOST * scale
    parameters = [Parameter(name, laws.CHANNELS[cell.channel], "of f", scale, low, MOST * scale, pull=PULL) for name in names]

    def shape(values: Mapping[str, float]) -> Array:
        own = np.array([values[name] for name in names])
        return np.asarray(basis @ (own - own.mean() * centred))

    effect = dataclasses.replace(_law(cell, place, laws.TABLE, parameters, shape=shape), centred=centred)
    start = dict(zip(names, np.maximum(pieces, low).tolist(), strict=True))
    if cell.axis.memory in FITTED:
        start["memory_size"] = cell.axis.memory_size
    return Candidate(effect, free=tuple(start)), start


def given_law(cell: Cell, place: int, f: Array) -> tuple[Candidate, dict[str, float]]:
    """The cell with a given f (KNOTS,), of which nothing is free."""
    return Candidate(_law(cell, place, laws.TABLE, (), shape=lambda _: f)), {}


def sized_law(cell: Cell, place: int, shapes: Array, sizes: Array, typical: float) -> tuple[Candidate, dict[str, float]]:
    """The cell with f a sum of ``shapes`` (k, KNOTS), whose ``sizes`` (k,) are free and pulled to zero from ``typical`` on."""
    names = [f"size_{i}" for i in range(len(shapes))]
    parameters = [Parameter(name, "1", "size of a shape", 1.0, -1.0, 1.0, pull=1.0 / typical) for name in names]

    def shape(values: Mapping[str, float]) -> Array:
        return np.asarray(np.array([values[name] for name in names]) @ shapes)

    start = dict(zip(names, (float(size) for size in sizes), strict=True))
    return Candidate(_law(cell, place, laws.TABLE, parameters, shape=shape), free=tuple(names)), start


def law_of(effect: Effect) -> Law:
    """An effect of a fit that is a law."""
    assert isinstance(effect, Law)
    return effect


VARIANTS: tuple[tuple[str, Mapping[str, float], tuple[str, ...]], ...] = (
    ("constant", {}, ()), ("linear", {"value": 0.0}, ()), ("linear", {}, ()),
    ("power", {}, ("exponent",)), ("hinge", {"value": 0.0, "below": 0.0}, ("at",)), ("hinge", {"value": 0.0, "above": 0.0}, ("at",)),
    ("exponential", {"start": 0.0}, ("length",)), ("exponential", {"end": 0.0}, ("length",)),
    ("step", {"before": 0.0}, ("at", "width")), ("step", {"after": 0.0}, ("at", "width")), ("exponential", {}, ("length",)),
    ("bump", {"value": 0.0}, ("at", "width")), ("window", {"outside": 0.0}, ("start", "end")), ("hinge", {}, ("at",)),
    ("sinusoid", {"value": 0.0}, ("period",)), ("step", {}, ("at", "width")), ("bump", {}, ("at", "width")),
    ("sinusoid", {}, ("period",)),
)  # fmt: skip
"""Closed forms: what of their values is fixed, and which of the others bend the form instead of scaling it."""

LEVELLED = ("linear", "hinge", "bump", "sinusoid")
"""Forms whose value is a constant beside the rest."""


def _grid(cell: Cell, name: str) -> Array:
    span = cell.high - cell.low
    if name == "period" and cell.period:
        return np.array([cell.period])
    if name in ("at", "start", "end"):
        return cell.low + span * np.linspace(0.05, 0.95, 13)
    if name == "exponent":
        return np.array([0.5, 1.5, 2.0, 3.0])
    return span * (np.geomspace(0.02, 1.0, 20) if name == "period" else np.geomspace(0.02, 1.0, 7))  # a period that was seen whole


def _bent(cell: Cell, names: Sequence[str]) -> Iterator[dict[str, float]]:
    grids = np.meshgrid(*[_grid(cell, name) for name in names]) if names else []
    for values in zip(*[grid.ravel() for grid in grids], strict=True) if names else [()]:
        found = dict(zip(names, (float(value) for value in values), strict=True))
        if found.get("start", 0.0) <= found.get("end", np.inf):
            yield found


def closed_forms(
    cell: Cell, coefficients: Array, covariance: Array, *, centred: bool = False
) -> list[tuple[float, str, dict[str, float], dict[str, float]]]:
    """Closed forms by the energy (noise variances) that they lose against free pieces: that, form, fixed values, free values.

    ``centred``: those that hold no constant of their own. Energy is told by the covariance of the pieces, so that places that the data
    hardly show do not count.
    """
    places = np.linspace(cell.low, cell.high, laws.KNOTS)
    onto = np.linalg.pinv(cell.basis(places))
    spread, directions = np.linalg.eigh(covariance)
    seen = spread > UNSEEN * spread.max()
    root = (directions[:, seen] / np.sqrt(spread[seen])).T
    target, found = root @ coefficients, []
    for form, fixed, bends in VARIANTS:
        if centred and form in LEVELLED:
            fixed = {"value": 0.0, **fixed}
        elif centred and not fixed and form != "power":
            continue
        if cell.period and form != "sinusoid":
            continue  # two numbers cannot tell any other apart
        linear = [name for name in laws.form_values(form) if name not in (*fixed, *bends, "scale")]
        always = {**fixed, **({"scale": max(abs(cell.low), abs(cell.high))} if form == "power" else {})}
        best: tuple[float, dict[str, float]] = (np.inf, {})
        for bent in _bent(cell, bends):
            units = [{**always, **bent, **{name: float(name == unit) for name in linear}} for unit in linear]
            columns = root @ onto @ np.column_stack([laws.sampled(form, unit, (), cell.low, cell.high) for unit in units])
            sizes = np.linalg.lstsq(columns, target, rcond=1e-10)[0]
            lost = float(np.sum((target - columns @ sizes) ** 2))
            if lost < best[0]:
                best = lost, {**dict(zip(linear, (float(size) for size in sizes), strict=True)), **bent}
        found.append((best[0], form, always, best[1]))
    return found


def closed_law(
    problem: Problem, cell: Cell, place: int, form: str, fixed: Mapping[str, float], start: Mapping[str, float]
) -> tuple[Candidate, dict[str, float]]:
    """The cell with f of a closed form; a constant depends on nothing."""
    if form == "constant":
        cell = dataclasses.replace(cell, axis=Axis("none"), low=-1.0, high=1.0, pieces=1)
    span, size = cell.high - cell.low, typical(problem, cell.channel)

    def parameter(name: str) -> Parameter:
        if name in ("at", "start", "end") and form not in ("exponential",):
            return Parameter(name, laws.COORDINATES[cell.axis.coordinate], "place", 0.1 * span, cell.low, cell.high)
        if name == "period":  # a turn of a hundredth of a radian at the end of the range is a small step
            known = start["period"]
            most = min(1.4 * known, span)
            return Parameter(name, laws.COORDINATES[cell.axis.coordinate], "period", 0.1 * known**2 / span, 0.7 * known, most)
        if name in laws.POSITIVE:
            return Parameter(name, laws.COORDINATES[cell.axis.coordinate], "width", span, 2e-3 * span, 10.0 * span, (span,))
        if name == "exponent":
            return Parameter(name, "1", "exponent", 0.3, 0.1, 6.0)
        scale = size / span if name in ("slope", "below", "above") else size
        return Parameter(name, laws.CHANNELS[cell.channel], "of f", scale, -MOST * scale, MOST * scale)

    def shape(values: Mapping[str, float]) -> Array:
        given = {name: values[name] for name in start}
        return laws.sampled(form, {**fixed, **given}, (), cell.low, cell.high)

    effect = _law(cell, place, form, [parameter(name) for name in start], shape=shape, fixed=fixed)
    values = dict(start)
    if cell.axis.memory in FITTED:
        values["memory_size"] = cell.axis.memory_size
    return Candidate(effect, free=tuple(values)), values


def with_law(problem: Problem, weight: Array, before: Fit, law: tuple[Candidate, dict[str, float]]) -> Fit:
    """A fit with one law more, everything set free."""
    return fit(problem, weight, [*before.effects, law], before, linearisations=5, tolerance=1e-4)


def simplified(problem: Problem, weight: Array, before: Fit, free: Fit, place: int) -> Fit:
    """The fit whose last law, of free pieces, is replaced by the closed form that keeps most of its gain for its values; or as it is."""
    candidate, values = free.effects[-1]
    law = law_of(candidate.effect)
    cell, names = law.at(values), [f"piece_{i}" for i in range(law.cell.pieces)]
    first = problem.nuisances + sum(len(known.free) for known, _ in before.effects)
    part = slice(first, first + len(names))
    gain = before.cost - free.cost
    trials = closed_forms(cell, np.array([values[name] for name in names]), free.covariance[part, part], centred=law.centred)
    promising = [trial for trial in trials if trial[0] < (1.0 - KEPT) * gain * 2.0]
    for _, form, fixed, start in sorted(promising, key=lambda trial: trial[0] + NUMBER_COSTS * gain * len(trial[3]))[:TRIED_FORMS]:
        law_here = closed_law(problem, cell, place, form, fixed, start)
        closed = with_law(problem, weight, dataclasses.replace(before, x=free.x), law_here)
        if before.cost - closed.cost >= KEPT * gain:
            return closed
    return free

