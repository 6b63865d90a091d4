# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What ``lugre-steering simulate`` does, without the command line."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table

from lugre_steering import units
from lugre_steering import vehicle as vehicle_file
from lugre_steering.bag import read_recording
from lugre_steering.bag.reader import bag_name
from lugre_steering.effects import registry
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import DataError
from lugre_steering.files import output_folder, refuse_foreign, write_record
from lugre_steering.provenance import Provenance
from lugre_steering.recording import Kind
from lugre_steering.report import words
from lugre_steering.report.available import no_pictures
from lugre_steering.resources import config_folder
from lugre_steering.schema import suggestion
from lugre_steering.simulate import manoeuvres, plant
from lugre_steering.simulate.manoeuvres import BUILT_IN, Motion
from lugre_steering.simulate.paper import ALL, EXPERIMENTS, bench
from lugre_steering.simulate.paper.figure import checks_table, draw_outcome, outcome_table, write_table
from lugre_steering.simulate.paper.outcome import Outcome
from lugre_steering.simulate.paper.result import PublishedExperiments
from lugre_steering.simulate.result import Simulation
from lugre_steering.simulate.run import sensing_of, simulate
from lugre_steering.simulate.sensors import Sensing
from lugre_steering.simulate.write import check_storage, write_bag
from lugre_steering.terminal import Prose, point
from lugre_steering.vehicle import Vehicle

SHIPPED = "test_vehicle.yaml"


class Simulable(NamedTuple):
    """Something that can be simulated by name."""

    kind: str
    name: str
    description: str


def catalogue() -> list[Simulable]:
    """Everything that can be simulated by name."""
    rows = [("manoeuvre", m.name, m.description) for m in BUILT_IN.values()]
    rows += [("experiment", name, text) for name, (text, _) in EXPERIMENTS.items()]
    rows.append(("experiment", ALL, "all published experiments together"))
    rows.append(("file", "FILE.yaml", "segments: a list of sweep, hold and chirp (mean steering angle)"))
    rows.append(("file", "FILE.csv", "time_s and left_deg, right_deg, or angle_deg (mean); also in _rad"))
    rows.append(("file", "BAG", "the steering angles of a recorded rosbag2 folder or file"))
    return [Simulable(*row) for row in rows]


def is_experiment(what: str) -> bool:
    return what == ALL or what in EXPERIMENTS


def load_vehicle(file: Path | None, effects: Sequence[str] = ()) -> Vehicle:
    """The vehicle file, or the shipped test vehicle, with effects added."""
    vehicle = vehicle_file.load(file or config_folder() / SHIPPED)
    return plant.with_effects(vehicle, list(effects))


def origin(what: str, file: Path | None, options: Mapping[str, Any]) -> Provenance:
    """How a simulation comes about; ``options`` that are not given do not stand in it."""
    given = {name: value for name, value in options.items() if value not in (None, [])}
    path = Path(what)
    return registry.made("simulate", {"what": what, **given}, file or config_folder() / SHIPPED, [path] if path.exists() else [])


def motion_named(what: str, vehicle: Vehicle) -> Motion:
    """The motion of a built-in manoeuvre, a YAML or CSV file, or a recorded bag."""
    if what in BUILT_IN:
        return manoeuvres.motion_of(BUILT_IN[what], vehicle)
    if is_experiment(what):
        raise DataError(f"'{what}': is an experiment, which the command runs; expected a file or one of {', '.join(BUILT_IN)}")
    path = Path(what)
    if not path.exists():
        names = ", ".join([*BUILT_IN, *EXPERIMENTS, ALL])
        raise DataError(f"'{what}': no such file, and none of the names {names}")
    if path.suffix in (".yaml", ".yml") and path.is_file():
        return manoeuvres.motion_of(manoeuvres.from_yaml(path), vehicle)
    if path.suffix == ".csv" and path.is_file():
        return manoeuvres.from_csv(path, vehicle)
    angles = [channel for channel in vehicle.channels if channel.kind is Kind.ANGLE]
    return manoeuvres.from_recording(read_recording(path, angles), vehicle)


def run_manoeuvre(
    what: str,
    vehicle: Vehicle,
    out: Path,
    sensing: Mapping[str, float | int | None],
    storage: str = "mcap",
    made: Provenance | None = None,
) -> dict[str, Any]:
    """Simulate one manoeuvre; write the bag ``out/synthetic_<name>`` and its picture. ``sensing`` overrides fields of
    ``Sensing``; None means the vehicle's own. ``made``: how both come about."""
    check_storage(storage)
    folder = out / f"synthetic_{bag_name(Path(what)).replace('-', '_')}"
    if folder.exists():  # said before the work, not after it
        raise DataError(f"{folder}: exists already; recordings are never overwritten, choose another --out")
    given = {name: value for name, value in sensing.items() if value is not None}
    picture, note = out / f"{folder.name}.png", no_pictures()
    with output_folder(out):
        refuse_foreign([picture])
        done = simulation(what, vehicle, given)
        label = f"{what}, vehicle '{vehicle.name}'"
        if note is None:
            from lugre_steering.simulate.figure import draw_simulation  # plotting is loaded only where it is used

            draw_simulation(done.run, label, picture, made)
        write_bag(folder, done.run, label, storage, made=made)  # last: a bag that is there stands in the way of another run
    done = dataclasses.replace(done, bag=str(folder), picture=str(picture) if note is None else None, picture_note=note)
    return done.json


def simulation(what: str, vehicle: Vehicle, sensing: Mapping[str, float | int]) -> Simulation:
    """One manoeuvre in memory; ``sensing`` overrides fields of ``Sensing``."""
    known = [item.name for item in dataclasses.fields(Sensing)]
    for key, value in sensing.items():
        if key not in known:
            raise DataError(f"{key}: got {value!r}, expected no such option; {suggestion(key, known)}")
    name = bag_name(Path(what)).replace("-", "_")
    run = simulate(vehicle, motion_named(what, vehicle), dataclasses.replace(sensing_of(vehicle), **sensing))  # type: ignore[arg-type]
    return Simulation.of(name, run)


def run_experiments(what: str, vehicle: Vehicle) -> list[Outcome]:
    """One published experiment, or all of them."""
    names = list(EXPERIMENTS) if what == ALL else [what]
    prepared = bench.build(vehicle)
    return [EXPERIMENTS[name][1](prepared) for name in names]


def write_outcomes(what: str, outcomes: list[Outcome], out: Path, made: Provenance | None = None) -> dict[str, Any]:
    """Table (CSV), result (JSON) and figure (PNG) of each experiment into ``out``; with several also a JSON of all. ``made``: how they
    come about."""
    note = no_pictures()
    result = PublishedExperiments.of(outcomes, made, note)
    names = [*(outcome.name for outcome in outcomes), *([ALL] if what == ALL else [])]
    with output_folder(out):
        refuse_foreign(out / f"{name}{kind}" for name in names for kind in (".json", ".png", ".csv"))
        for outcome, each in zip(outcomes, result.experiments, strict=True):
            write_table(outcome, out / f"{outcome.name}.csv", made)
            if note is None:
                draw_outcome(outcome, out / f"{outcome.name}.png", made)
            write_record(each.json, out / f"{outcome.name}.json")
        if what == ALL:
            write_record(result.json, out / f"{ALL}.json")
    return result.json


def show_catalogue(console: Console) -> None:
    """Table of everything that can be simulated."""
    table = Table("what", "name", "description")
    for row in catalogue():
        table.add_row(*row)
    console.print(table)


def show_run(console: Console, result: Mapping[str, Any], vehicle: Vehicle) -> None:
    """What was simulated, in a few lines."""
    table = Table(title="synthetic recording", show_header=False, title_justify="left", box=None, padding=(0, 2, 0, 0))
    angle = words.coordinate_axis(vehicle, "steering angle")
    table.add_row("duration", words.quantity(result["duration_s"], "s"))
    table.add_row(f"largest {units.words(vehicle, 'torque')}", words.torque(vehicle, result["largest_torque_Nm"]))
    table.add_row(f"largest {angle.name}", words.quantity(result["largest_coordinate"] * angle.scale, angle.unit))
    if result["largest_pressure_Pa"] is not None:
        table.add_row("largest pressure", words.quantity(1e-5 * result["largest_pressure_Pa"], "bar"))
    if vehicle.rubber is not None:
        ends = " and ".join(words.number(value, 3) for value in result["rubber_at_end_degC"])
        table.add_row("rubber at the end", f"{ends} degC")
    for id_, parameters in result["effects"].items():
        of = {p.name: units.label(vehicle, p.unit) for p in CATALOGUE[id_].parameters}
        per_line = next(iter(of.values()))  # of an effect of pressure lines, which stand in place of its parameter
        given = (f"{name} = {words.number(value)} {of.get(name, per_line)}" for name, value in parameters.items())
        table.add_row(CATALOGUE[id_].title, Prose(", ".join(each.removesuffix(" 1") for each in given)))
    console.print(table)
    if result["picture_note"]:
        console.print(result["picture_note"])
    console.print(f"bag in {result['bag']}", highlight=False, soft_wrap=True)


def show_outcomes(console: Console, outcomes: Sequence[Outcome], out: Path) -> None:
    """Tables, calibrated parameters, verdicts and disagreements of experiments."""
    for outcome in outcomes:
        console.print(outcome_table(outcome))
    console.print(checks_table(outcomes))
    fitted = ", ".join(f"{name} = {value:.5g}" for name, value in outcomes[0].calibrated.items())
    console.print(Prose(f"Calibrated to the four published extremes: {fitted}"))
    for outcome in outcomes:
        for note in outcome.notes:
            console.print(point(f"{outcome.name} differs or assumes: {note}"))
    passed = sum(check.passed for outcome in outcomes for check in outcome.checks)
    console.print(f"{passed} of {sum(len(o.checks) for o in outcomes)} statements pass; tables and figures in {out}")
