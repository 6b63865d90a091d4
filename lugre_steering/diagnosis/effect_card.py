# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What an entry of the catalogue is: tables for the terminal, and a picture of the trace it leaves in a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from lugre_steering import vehicle as vehicle_file
from lugre_steering.data.dataset import Run, ideal_run
from lugre_steering.diagnosis.search import locate
from lugre_steering.effects import registry
from lugre_steering.effects.entry import Effect
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.files import output_folder
from lugre_steering.fitting.fingerprint import candidates, possible
from lugre_steering.fitting.problem import Candidate, Problem
from lugre_steering.recording import Array
from lugre_steering.report import words
from lugre_steering.resources import config_folder
from lugre_steering.serialise import plain
from lugre_steering.simulate import plant
from lugre_steering.simulate.manoeuvres import BUILT_IN, SAMPLE_S, Manoeuvre, motion_of
from lugre_steering.vehicle import Vehicle

REFERENCE = "double-cycle"
"""Manoeuvre that sizes the example: it reaches the limits, slides and warms."""
MACHINES = ("test_vehicle.yaml", "single_joint_example.yaml", "linear_axis_example.yaml")
"""Shipped vehicle files; the first that can have an effect shows it."""
NUDGE = 0.02
"""Finite-difference step of the calibration values."""
ROUNDING_NM = 1e-6
"""What two runs differ by where an effect does nothing [N m]."""


@dataclass(frozen=True)
class Trace:
    """One manoeuvre of a shipped vehicle with and without an effect at its typical size; no sensor noise."""

    manoeuvre: Manoeuvre
    problem: Problem
    candidate: Candidate

    @property
    def values(self) -> dict[str, float]:
        """Parameters of the effect: typical amplitudes, the middle of what is tried for shapes."""
        typical = {name: self.candidate.parameter(name).scale for name in self.candidate.free}
        return {**dict(self.candidate.shapes), **typical}

    @property
    def run(self) -> Run:
        return self.problem.runs[0]

    @cached_property
    def without(self) -> Array:
        """Torque that the sensors would show, baseline (n,) [N m]."""
        return self.problem.predict(0, self.problem.start())

    @cached_property
    def difference(self) -> Array:
        """What the effect changes in it (n,) [N m]."""
        with_effect = self.problem.predict(0, self.problem.start(), [(self.candidate, self.values)])
        return with_effect - self.without

    @cached_property
    def visible(self) -> Array:
        """The part of the difference that recalibrating the baseline cannot imitate (n,) [N m]."""
        start = self.problem.start()
        moved = [self.problem.predict(0, start + NUDGE * unit) - self.without for unit in np.eye(start.size)]
        tangent = np.column_stack([column for column in moved if np.any(column)])
        return self.difference - tangent @ np.linalg.lstsq(tangent, self.difference, rcond=None)[0]

    @property
    def visible_rms(self) -> float:
        return float(np.sqrt(np.mean(self.visible**2)))


def traces(effect: Effect) -> list[Trace]:
    """The effect in every built-in manoeuvre, the most telling first; empty if the standard topics cannot show it."""
    if not effect.observable:
        return []
    machine = next((file for file in MACHINES if possible(_recorded(file)[0], effect)), MACHINES[0])
    vehicle, runs = _recorded(machine)
    problems = {name: Problem(vehicle, [run]) for name, run in runs.items()}  # of the catalogue as it is now
    others = [name for name in CATALOGUE if name != effect.id]
    variants = [variant for variant in candidates(problems[REFERENCE], others) if variant.bags is None]
    fewest = min(len(variant.shapes) for variant in variants)
    plain_ones = [variant for variant in variants if len(variant.shapes) == fewest]  # a stop on both sides, not on one alone
    example = plain_ones[len(plain_ones) // 2]
    found = [Trace(BUILT_IN[name], problem, example) for name, problem in problems.items()]
    return sorted(found, key=lambda trace: -trace.visible_rms)


@cache
def _recorded(file: str) -> tuple[Vehicle, dict[str, Run]]:
    """A shipped vehicle, and every built-in manoeuvre of its baseline as a run."""
    vehicle = vehicle_file.load(config_folder() / file)
    return vehicle, {name: _ideal_run(vehicle, manoeuvre) for name, manoeuvre in BUILT_IN.items()}


def _ideal_run(vehicle: Vehicle, manoeuvre: Manoeuvre) -> Run:
    """A manoeuvre of the baseline as a run, seen by perfect sensors."""
    motion = motion_of(manoeuvre, vehicle)
    keep = slice(None, None, round(SAMPLE_S / float(motion.time[1] - motion.time[0])))
    torque = plant.run(vehicle, motion).torque
    rates = motion.rate[:, keep], motion.acceleration[:, keep]
    return ideal_run(vehicle, manoeuvre.name, motion.time[keep], motion.theta[:, keep], rates, torque[keep], 1.0)


def describe(effect: Effect) -> dict[str, Any]:
    """An entry as plain data for JSON; unbounded ends are null."""
    entry = {
        "id": effect.id, "stage": effect.stage, "tier": effect.tier, "title": effect.title, "equation": effect.equation,
        "trace": effect.trace, "coordinate": effect.coordinate, "source": effect.source, "rivals": registry.rivals(effect),
        "observable": effect.observable, "needs": effect.not_recorded or None, "per_line": effect.per_line,
        "parameters": [
            {"name": p.name, "unit": p.unit, "meaning": p.meaning, "typical": p.scale, "low": p.low, "high": p.high,
             "optional": p.optional}
            for p in effect.parameters
        ],
    }  # fmt: skip
    result = plain(entry)
    assert isinstance(result, dict)
    return result


def explain(effect: Effect, found: Sequence[Trace], picture: Path | None) -> dict[str, Any]:
    """The same with the manoeuvres that show the effect, best first, and the picture that was drawn."""
    shows = [
        {
            "manoeuvre": trace.manoeuvre.name,
            "description": trace.manoeuvre.description,
            "rms_Nm": float(np.sqrt(np.mean(trace.difference**2))),
            "visible_rms_Nm": trace.visible_rms,
        }
        for trace in found
    ]
    example = found[0].values if found else None
    return {**describe(effect), "example": example, "shown_by": shows, "picture": picture and str(picture)}


def draw(found: Sequence[Trace], out: Path) -> Path:
    """Picture of the signature in the most telling manoeuvre: torque with and without, difference, telling coordinate."""
    from lugre_steering.report.style import IMPROVED, MEASURED, SERIES, figure  # needs matplotlib

    best = found[0]
    effect, run, vehicle = best.candidate.effect, best.run, best.problem.vehicle
    torque = words.torque_axis(vehicle, best.without)
    change = words.torque_axis(vehicle, best.difference)
    coordinates = locate.coordinates(run, best.without)
    name = "steering angle" if effect.coordinate == "direction" else effect.coordinate
    along = name in coordinates and name != "time"
    values = ", ".join(f"{key} = {words.number(value)}" for key, value in best.values.items())
    line = f" on line {best.candidate.line}" if best.candidate.line else ""
    caption = (
        f"SIMULATED: {vehicle.name}, manoeuvre '{best.manoeuvre.name}', no sensor noise. {effect.title} ({effect.id}){line} with "
        f"{values} (SI). Law: {effect.equation}. How it shows: {effect.trace}. Thin line: the part of the difference that "
        "recalibrating the baseline cannot imitate; only that part can be seen in a recording."
    )
    file, origin = out / f"{effect.id}.png", registry.made("effects", {"id": effect.id}, None, [])
    with output_folder(out), figure(3 if along else 2, 1, caption, file, row_inches=2.2, made=origin) as axes:
        top, middle = axes[0, 0], axes[1, 0]
        top.plot(run.time, best.without * torque.scale, **MEASURED, label="without")
        top.plot(run.time, (best.without + best.difference) * torque.scale, **IMPROVED, label="with the effect")
        middle.plot(run.time, best.difference * change.scale, color=SERIES[0], label="difference")
        middle.plot(run.time, best.visible * change.scale, color=SERIES[1], linewidth=0.9, label="after recalibration")
        for ax, title, unit in ((top, "torque", torque.unit), (middle, "what the effect changes", change.unit)):
            ax.set_title(title)
            ax.set_ylabel(unit)
            ax.set_xlabel("time (s)")
            ax.set_xlim(0.0, float(run.time[-1]))
            ax.legend(ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
        if along:
            axis = words.coordinate_axis(vehicle, name)
            x, y = words.broken(coordinates[name] * axis.scale, best.difference * change.scale)
            axes[2, 0].plot(x, y, color=SERIES[0], linewidth=1.1)
            axes[2, 0].set_title("difference along the coordinate that tells it")
            axes[2, 0].set_xlabel(axis.label)
            axes[2, 0].set_ylabel(change.unit)
    return file


# ----------------------------------------------------------------- terminal


def show_list(console: Console) -> None:
    """The catalogue as a table, one stage after the other."""
    table = Table(box=None, padding=(0, 2, 0, 0), show_header=False)
    table.add_column("id", no_wrap=True)
    table.add_column("what it is", overflow="fold")
    stage = ""
    for effect in CATALOGUE.values():
        if effect.stage != stage:
            stage = effect.stage
            table.add_row(Text(stage.replace("_", " "), "bold"))
        table.add_row(f"  {effect.id}", effect.title)
        if not effect.observable:
            table.add_row("", Text(f"not observable: needs {effect.not_recorded}", "yellow"))
    console.print(table)
    console.print("'lugre-steering effects ID' explains one; with --out DIR it draws its signature.", highlight=False)


def _table(title: str) -> Table:
    return Table(title=title, title_justify="left", title_style="bold", box=None, padding=(0, 2, 0, 0))


def show_effect(console: Console, effect: Effect, result: dict[str, Any]) -> None:
    """One entry in full."""
    console.print(Text.assemble((effect.title, "bold"), f" ({effect.id})"), highlight=False)
    facts = Table.grid(padding=(0, 2))
    facts.add_column(no_wrap=True, style="dim")
    facts.add_column(overflow="fold")
    for name, text in (
        ("stage", f"{effect.stage.replace('_', ' ')}, tier {effect.tier}"),
        ("law", effect.equation),
        ("how it shows", effect.trace),
        ("told by", effect.coordinate),
        ("source", effect.source),
        ("easily taken for", "; ".join(f"{CATALOGUE[rival].title} ({rival})" for rival in registry.rivals(effect))),
        ("would need", effect.not_recorded),
    ):
        if text:
            facts.add_row(name, text)
    console.print(facts, highlight=False, markup=False)
    if effect.parameters:
        table = _table("\nparameters")
        # Names must be typed as they stand, so none is cut.
        table.add_column("name", overflow="fold", min_width=max(len(p.name) for p in effect.parameters))
        table.add_column("unit", no_wrap=True)
        table.add_column("meaning")
        table.add_column("typical", justify="right")
        for column in ("lowest", "highest"):
            table.add_column(column, justify="right", no_wrap=True)
        for p in effect.parameters:
            name = f"{p.name} (for each line, by its name)" if effect.per_line else p.name
            meaning = f"{p.meaning} (refinement)" if p.optional else p.meaning
            scaled = f"{p.relative_to.replace('_', ' ')} times {', '.join(map(words.number, p.grid))}"
            typical = scaled if p.relative_to else words.number(p.grid[len(p.grid) // 2] if p.grid else p.scale)
            table.add_row(name, p.unit, meaning, typical, words.number(p.low), words.number(p.high))
        console.print(table)
    if result["shown_by"]:
        table = _table("\nshown by (simulated)")
        table.add_column("manoeuvre", no_wrap=True)
        table.add_column("what is driven")
        table.add_column("trace (N m rms)", justify="right")
        table.add_column("after recalibration", justify="right")
        for row in result["shown_by"]:
            sizes = [words.number(row[key] if row[key] > ROUNDING_NM else 0.0, 3) for key in ("rms_Nm", "visible_rms_Nm")]
            table.add_row(row["manoeuvre"], row["description"], *sizes)
        console.print(table)
        values = ", ".join(f"{key} = {words.number(value)}" for key, value in result["example"].items())
        console.print(f"Traces are for {values}.", highlight=False)
    else:
        console.print("No manoeuvre shows it with the standard topics; there is no picture.", highlight=False)
    if result["picture"]:
        console.print(f"picture in {result['picture']}", highlight=False)
