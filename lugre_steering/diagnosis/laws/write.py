# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A found law as an entry of the vehicle file and in an engineer's words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from lugre_steering import units
from lugre_steering.diagnosis.finished import amplitude_of
from lugre_steering.diagnosis.found_law import FoundLaw, LawCurve, LawTie
from lugre_steering.diagnosis.laws.cells import Axis, Traces, trace
from lugre_steering.diagnosis.laws.find import FoundLaws, Tried, cell_of
from lugre_steering.diagnosis.laws.refine import Law, law_of
from lugre_steering.diagnosis.search.locate import contribution
from lugre_steering.effects import laws
from lugre_steering.fitting.doubt import NORMAL
from lugre_steering.recording import Array
from lugre_steering.report import words
from lugre_steering.vehicle import LawEntry, Vehicle

WRITTEN_KNOTS = 65
"""Knots of a table in a file; of a fine one more."""
SHOWN_TIES = 2
"""Laws that fit as well as one, told in its sentence at most."""
POINTS = 24
"""Steps of the coordinate in which the data are shown beside f."""
CHANNEL_WORDS = {
    "friction_level": "a change of the friction level", "presliding_stiffness": "a change of the presliding stiffness",
    "conservative_torque": "a torque beside the contact", "coulomb_friction": "a friction torque against the motion",
    "load_friction": "friction in proportion to the torque", "viscous_loss": "a loss in proportion to the rate",
    "turbulent_loss": "a loss that grows with the square of the rate", "gain": "a factor on the torque (arms, sensors)",
    "inertia": "a torque in proportion to the acceleration", "lag": "a lag of the torque",
    "linked_inertia": "an inertia that changes as the linkage turns",
}  # fmt: skip
"""What a law of each channel is, in words."""
COORDINATE_WORDS = {
    "angle": "angle", "abs_angle": "absolute angle", "rate": "steering rate", "abs_rate": "absolute steering rate",
    "direction": "direction", "since_reversal": "angle since reversal", "torque": "torque", "abs_torque": "absolute torque",
    "power": "power", "time": "time", "slip": "accumulated slip", "work": "accumulated work", "dwell": "dwell",
    "rubber_temperature": "rubber temperature", "air_temperature": "air temperature", "opposing_torque": "torque against the motion",
    "passes": "passages of the same place",
}  # fmt: skip
"""What each coordinate is called, in words."""


def entries(found: FoundLaws) -> tuple[LawEntry, ...]:
    """The laws as a vehicle file has them."""
    made, first = [], found.problem.nuisances
    spread = np.sqrt(np.maximum(np.diag(found.spread), 0.0))
    for index, (candidate, values) in enumerate(found.fit.effects):
        deviations = dict(zip(candidate.free, spread[first:], strict=False))
        first += len(candidate.free)
        if index < found.names:
            continue
        law = law_of(candidate.effect)
        cell = law.at(values)
        numbers: dict[str, float] = {}
        knots: tuple[float, ...] = ()
        if law.form == laws.TABLE:
            count = WRITTEN_KNOTS if cell.pieces < WRITTEN_KNOTS // 4 else 2 * WRITTEN_KNOTS - 1
            knots = tuple(float(f) for f in np.interp(np.linspace(0, 1, count), np.linspace(0, 1, laws.KNOTS), law.shape(values)))
        else:
            numbers = {**law.fixed, **{name: float(value) for name, value in values.items() if name != "memory_size"}}
        intervals: dict[str, tuple[float, ...]] = {
            name: (float(values[name] - NORMAL * deviations[name]), float(values[name] + NORMAL * deviations[name]))
            for name in candidate.free
            if not name.startswith("piece_")
        }
        made.append(LawEntry(
            cell.channel, cell.axis.coordinate, law.form, (cell.low, cell.high), numbers, knots, cell.axis.memory, cell.axis.memory_size,
            law_words(law, values, found.problem.vehicle), intervals, round(found.heldout[index - found.names], 4),
        ))  # fmt: skip
    return tuple(made)


def shown(coordinate: str, value: float, vehicle: Vehicle) -> str:
    """A place on a coordinate as people say it."""
    unit = laws.COORDINATES[coordinate]
    if unit.startswith("rad"):
        return units.distance(vehicle, value) + unit[3:]
    return f"{value:.3g} {units.label(vehicle, unit)}" if unit != "1" else f"{value:.3g}"


def law_words(law: Law, values: Mapping[str, float], vehicle: Vehicle) -> str:
    """What the law is: channel, coordinate with its memory, and shape."""
    cell = law.at(values)
    what = CHANNEL_WORDS[cell.channel]
    if cell.axis.coordinate != "none":
        along = COORDINATE_WORDS[cell.axis.coordinate]
        if cell.axis.memory == "lag":
            along += f" as remembered for {cell.axis.memory_size:.2g} s"
        elif cell.axis.memory == "ring":
            along = f"ringing of the {along} in a mode of {1.0 / cell.axis.memory_size:.3g} Hz"
        elif cell.axis.memory != "none":
            along += f" through a {cell.axis.memory} of {shown(cell.axis.coordinate, cell.axis.memory_size, vehicle)} to each side"
        what += f", {_shape_words(law, values, along, vehicle)}"
    return units.words(vehicle, what)


def _shape_words(law: Law, values: Mapping[str, float], along: str, vehicle: Vehicle) -> str:
    known, name = {**law.fixed, **values}, law.cell.axis.coordinate

    def at(key: str) -> str:
        return shown(name, known[key], vehicle)

    if law.cell.axis == Axis("direction"):
        return "another one in either direction"
    if law.form == "hinge" and known["below"] == 0.0 and known["value"] == 0.0:
        return f"only beyond {at('at')} of the {along}, growing with it"
    if law.form == "hinge" and known["above"] == 0.0 and known["value"] == 0.0:
        return f"only below {at('at')} of the {along}, growing away from it"
    if law.form == "step":
        return f"another one beyond {at('at')} of the {along}"
    if law.form == "bump":
        return f"with a bump at {at('at')} of the {along}, {at('width')} wide"
    if law.form == "window":
        return f"from {at('start')} to {at('end')} of the {along}"
    if law.form == "sinusoid":
        return f"periodic in the {along}, {at('period')} long"
    if law.form == "exponential":
        return f"approached exponentially over {at('length')} of the {along}"
    if law.form == "power":
        return f"with the {along} to the power {known['exponent']:.2g}"
    return f"in proportion to the {along}" if law.form == "linear" and known["value"] == 0.0 else f"a function of the {along}"


def described(found: FoundLaws, nearest: Sequence[str] = ()) -> tuple[FoundLaw, ...]:
    """Each law as the diagnosis tells it: the vehicle file's entry, its size in N m and percent, its share of the ceiling, ties;
    ``nearest``: entries of the catalogue in whose place they stand."""
    torque = amplitude_of(found.problem.measured)
    made = []
    effects = found.fit.effects[found.names :]
    cells = [law_of(candidate.effect).at(values) for candidate, values in effects]
    for index, (entry, (candidate, values)) in enumerate(zip(entries(found), effects, strict=True)):
        law, place = law_of(candidate.effect), found.names + index
        # What rings is not excited by what it adds itself.
        alone = tuple(effect for i, effect in enumerate(found.fit.effects) if i != place or cells[index].axis.memory != "ring")
        traces = trace(found.problem, replace(found.fit, effects=alone), found.problem.last_place, [cells[index].axis])
        largest = float(np.percentile(np.abs(contribution(found.problem, found.fit, place)), 99.0))
        made.append(FoundLaw(
            law.id, entry.title or "", entry.channel, entry.coordinate, entry.memory, entry.memory_size, entry.form,
            values=entry.values,
            intervals={name: (low, high) for name, (low, high) in entry.intervals.items()},
            range=(cells[index].low, cells[index].high),
            largest_Nm=largest,
            largest_share=largest / torque,
            heldout_gain=entry.heldout_gain,
            gain=found.gains[index],
            bar=found.bar,
            share_of_ceiling=found.foretold / found.ceiling,
            ties=tuple(_tie(tie, found.problem.vehicle) for tie in found.ties) if not index else (),
            nearest_listed=tuple(nearest),
            f=LawCurve(*_picture(found, place, law, values), *_points(found, place, traces, law, values)),
        ))  # fmt: skip
    return tuple(made)


def _tie(tie: Tried, vehicle: Vehicle) -> LawTie:
    cell, title = cell_of(tie), law_words(tie.law, tie.fit.effects[-1][1], vehicle)
    return LawTie(title, cell.channel, cell.axis.coordinate, cell.axis.memory, cell.axis.memory_size)


Numbers = tuple[float, ...]


def _picture(found: FoundLaws, index: int, law: Law, values: Mapping[str, float]) -> tuple[Numbers, Numbers, Numbers]:
    """Places over its range, f there, and half the width of its 95 % band, from the spread of the fit."""
    first = found.problem.nuisances + sum(len(known.free) for known, _ in found.fit.effects[:index])
    names = [name for name in found.fit.effects[index][0].free if name != "memory_size"]
    part = slice(first, first + len(names))
    at, f = np.linspace(law.cell.low, law.cell.high, laws.KNOTS), law.shape(values)
    covariance, slopes = found.spread[part, part], []
    for i, name in enumerate(names):
        step = float(np.sqrt(max(covariance[i, i], 1e-300)))
        up, down = ({**values, name: values[name] + sign * 0.5 * step} for sign in (1.0, -1.0))
        slopes.append((law.shape(up) - law.shape(down)) / step)
    slope: Array = np.array(slopes)
    band = NORMAL * np.sqrt(np.maximum(np.einsum("ik,ij,jk->k", slope, covariance, slope), 0.0))
    keep = slice(None, None, 8)
    return tuple(at[keep].tolist()), tuple(f[keep].tolist()), tuple(band[keep].tolist())


_SIGNALS = {
    "friction_level": "g", "presliding_stiffness": "sigma_0 z", "conservative_torque": "", "coulomb_friction": "sgn(omega)",
    "load_friction": "|M| sgn(omega)", "viscous_loss": "omega", "turbulent_loss": "omega |omega|", "gain": "M", "inertia": "alpha",
    "lag": "dM/dt", "linked_inertia": "alpha + f' omega^2 / 2",
}  # fmt: skip
"""What f is multiplied by, in symbols."""
_PLACES = {
    "angle": "theta", "abs_angle": "|theta|", "rate": "omega", "abs_rate": "|omega|", "direction": "sgn(omega)", "torque": "M",
    "abs_torque": "|M|", "time": "t", "rubber_temperature": "T", "air_temperature": "T_air", "opposing_torque": "M sgn(omega)",
}  # fmt: skip
"""What f is a function of, in symbols."""


def formula(described: Sequence[FoundLaw], vehicle: Vehicle) -> str:
    """The laws in symbols: what each channel's signal is multiplied by, over its coordinate."""
    parts = [f"{_f_in_symbols(law)} {_SIGNALS[law.channel]}".strip() for law in described]
    return units.law(vehicle, "torque [N m] = " + " + ".join(parts))


def _f_in_symbols(law: FoundLaw) -> str:
    """f with its numbers where few of them make it, else by name; in SI."""
    place = _PLACES.get(law.coordinate, law.coordinate.replace("_", " "))
    v, form = law.values, law.form
    if form == "constant":
        return f"{v['value']:.4g}"
    if law.memory != "none":
        size = f"{law.memory_size:.3g} {laws.MEMORIES[law.memory] or laws.COORDINATES[law.coordinate]}"
        return f"f({place}; {law.memory} of {size})"
    begin = {"step": "before", "exponential": "end"}.get(form, "value")
    level = f"{v[begin]:+.4g} " if v.get(begin) else ""
    if form == "linear":
        return f"({level}{v['slope']:+.4g} {place})"
    if form == "power":
        return f"{v['value']:.4g} |{place} / {v['scale']:.4g}|^{v['exponent']:.3g}"
    if form == "sinusoid":
        phase = f"2 pi {place} / {v['period']:.4g} {laws.COORDINATES[law.coordinate]}"
        return f"({level}{v['sine']:+.4g} sin({phase}) {v['cosine']:+.4g} cos({phase}))"
    if form == "hinge":
        away = f"{place} - {v['at']:.4g}"
        arms = [f"{v[side]:+.4g} {least}({away}, 0)" for side, least in (("below", "min"), ("above", "max")) if v[side]]
        return f"({level}{' '.join(arms)})"
    if form == "step":
        return f"({level}{0.5 * (v['after'] - v['before']):+.4g} (1 + tanh(({place} - {v['at']:.4g}) / {v['width']:.4g})))"
    if form == "window":
        return f"({v['inside']:.4g} from {place} = {v['start']:.4g} to {v['end']:.4g}, else {v['outside']:.4g})"
    if form == "bump":
        return f"({level}{v['height']:+.4g} exp(-(({place} - {v['at']:.4g}) / {v['width']:.4g})^2 / 2))"
    if form == "exponential":
        return f"({level}{v['start'] - v['end']:+.4g} exp(-({place} - {law.range[0]:.4g}) / {v['length']:.4g}))"
    return f"f({place})"


def sentence(described: Sequence[FoundLaw], torque: Callable[[float], str]) -> str:
    """Laws with their sizes, and what fits as well; ``torque`` writes a torque with its unit."""

    def told(law: FoundLaw) -> str:
        size = f"up to {torque(law.largest_Nm)}, {words.percent(law.largest_share)} of the torque"
        others = " or ".join(tie.title for tie in law.ties[:SHOWN_TIES])
        as_well = f"; not to be told from {others}" if others else ""
        return f"{law.title} ({size}{as_well})"

    return " and ".join(map(told, described))


def _points(found: FoundLaws, index: int, traces: Traces, law: Law, values: Mapping[str, float]) -> tuple[Numbers, Numbers]:
    """Steps of its coordinate, and what the data say of f within them: fitted to the residual of the rest of the model."""
    problem, cell = found.problem, law.at(values)
    residual = problem.measured - found.fit.prediction + contribution(problem, found.fit, index)
    edges = np.linspace(cell.low, cell.high, POINTS + 1)
    columns = []
    for bag in range(len(problem.runs)):
        parts = []
        for signal, place in zip(traces.signals[cell.channel][bag], traces.axes[cell.axis][bag], strict=True):
            step = np.clip(np.searchsorted(edges, place, side="right") - 1, 0, POINTS - 1)
            parts.append(signal[:, None] * (step[:, None] == np.arange(POINTS)))
        columns.append(np.sum(parts, axis=0))
    weighted = np.concatenate(columns)[problem.valid]
    gram = weighted.T @ weighted
    size = np.diag(gram)
    seen = size > 1e-4 * size.max()
    kept = gram[np.ix_(seen, seen)]
    f = np.linalg.solve(kept + 1e-9 * np.trace(kept) * np.eye(len(kept)), weighted[:, seen].T @ residual[problem.valid])
    return tuple((0.5 * (edges[1:] + edges[:-1]))[seen].tolist()), tuple(f.tolist())
