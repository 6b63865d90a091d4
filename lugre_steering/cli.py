# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Command line: a thin shell. Each command parses arguments, calls one function of the package and prints what it
returns."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from lugre_steering import defaults, serialise
from lugre_steering.counted import counted
from lugre_steering.errors import DataError
from lugre_steering.program import app as app  # with all commands once this file is imported
from lugre_steering.program import command, options_of_commands
from lugre_steering.progress import progress_bar, spinner, step_bar
from lugre_steering.terminal import console, forgive_letters, output

if TYPE_CHECKING:
    from lugre_steering.provenance import Provenance
    from lugre_steering.vehicle import Vehicle

_BAGS = "rosbag2 folders or files (mcap or sqlite3, compressed or not), folders of them, or patterns"
Bags = Annotated[list[Path], typer.Argument(help=_BAGS)]
BagsOrNone = Annotated[list[Path] | None, typer.Argument(help=_BAGS)]
VehicleFile = Annotated[Path, typer.Option("--vehicle", help="vehicle file (YAML)")]
OutFolder = Annotated[Path, typer.Option("--out", help="folder for the results")]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=1, help="recordings at a time, each in a process of its own")]
Threads = Annotated[int | None, typer.Option("--jobs", "-j", min=1, help="threads of the computation [all processors]")]
FailOn = Annotated[
    list[str] | None, typer.Option("--fail-on", help="exit code 1 if this is so; 'list' tells what can be asked; repeatable")
]
Json = Annotated[bool, typer.Option("--json", help="print the result as JSON on stdout")]


def _effect_ids(incomplete: str) -> list[str]:
    """For the shell to complete."""
    from lugre_steering.effects.registry import CATALOGUE

    return [name for name in CATALOGUE if name.startswith(incomplete)]


def print_json(result: Any) -> None:
    """The result of a command on stdout, for scripts."""
    print(serialise.as_json(result))


def say_skipped(skipped: Iterable[tuple[str, str]]) -> None:
    """What was left out and why, a line each on stderr."""
    for bag, reason in skipped:
        print(f"lugre-steering: skipped: {bag}: {reason}", file=sys.stderr)


def use_threads(count: int | None) -> None:
    """Limit what a fit takes for itself."""
    if count is not None:
        os.environ["LUGRE_STEERING_THREADS"] = str(count)


def leave_if(failures: Sequence[str]) -> None:
    """Exit code 1, with the reasons on stderr, where there are any."""
    for failure in failures:
        print(f"lugre-steering: --fail-on: {failure}", file=sys.stderr)
    if failures:
        raise typer.Exit(1)


@command()
def replay(
    bags: Bags,
    vehicle: VehicleFile,
    out: OutFolder,
    horizon: Annotated[
        float | None, typer.Option(min=0.0, max=5.0, help="feed-forward this far ahead [s]")
    ] = None,
    parameters: Annotated[
        Path | None, typer.Option(help="parameter file of the node (YAML), to replay with the same time options")
    ] = None,
    initial_temperature: Annotated[
        str | None, typer.Option(help="of the rubber at the start of each bag [degC], or 'air': the first recorded air")
    ] = None,
    look_ahead: Annotated[
        bool, typer.Option("--look-ahead", help="also tell the model's error with the motion known from all samples, as diagnose has it")
    ] = False,
    jobs: Jobs = 1,
    fail_on: FailOn = None,
    as_json: Json = False,
) -> None:
    """Run the estimator over recorded bags.

    Writes a bag with the output topics beside the inputs, a page, a picture and a summary."""
    from lugre_steering.bag.find import find
    from lugre_steering.estimator import Options
    from lugre_steering.estimator.node_parameters import read_options
    from lugre_steering.replay.result import facts, gate
    from lugre_steering.replay.run import replay as run
    from lugre_steering.replay.table import show_replay

    wanted = gate(fail_on or ())
    options = read_options(parameters) if parameters is not None else Options()
    if horizon is not None:
        options = replace(options, feed_forward_horizon_s=horizon)
    found = find(bags, out)
    with progress_bar() as progress:
        result = run(
            found.bags, vehicle, out, options, progress, initial_temperature, jobs=jobs, look_ahead=look_ahead, skipped=found.skipped
        )
    for note in {bag["picture_note"] for bag in result["bags"]} - {None}:
        print(f"lugre-steering: {note}", file=sys.stderr)
    if as_json:
        say_skipped((one["bag"], one["reason"]) for one in result["skipped"])
        print_json(result)
    else:
        show_replay(output(), result)
        print(f"results in {out}, for people in {'<recording>' if len(result['bags']) > 1 else result['bags'][0]['name']}.html")
    leave_if(wanted.failures(facts(result)))


@command()
def simulate(
    what: Annotated[str, typer.Argument(help="manoeuvre, published experiment, YAML or CSV file, or bag; see --list")] = "",
    vehicle: Annotated[Path | None, typer.Option(help="vehicle file (YAML); the shipped test vehicle if left out")] = None,
    out: Annotated[Path | None, typer.Option(help="folder for the results")] = None,
    show_list: Annotated[bool, typer.Option("--list", help="show manoeuvres and experiments")] = False,
    effect: Annotated[list[str] | None, typer.Option(help="add physics, id:parameter=value,... (SI); repeatable")] = None,
    storage: Annotated[str | None, typer.Option(help="mcap or sqlite3 [mcap]")] = None,
    rate: Annotated[float | None, typer.Option(help="angle samples per second [100]")] = None,
    pressure_rate: Annotated[float | None, typer.Option(help="pressure samples per second [as --rate]")] = None,
    jitter: Annotated[float | None, typer.Option(help="standard deviation of the sampling instants [s]")] = None,
    angle_noise: Annotated[float | None, typer.Option(help="deg [as the vehicle's sensors section]")] = None,
    angle_resolution: Annotated[float | None, typer.Option(help="deg [as the vehicle's sensors section]")] = None,
    pressure_noise: Annotated[float | None, typer.Option(help="Pa [as the vehicle's sensors section]")] = None,
    pressure_resolution: Annotated[float | None, typer.Option(help="Pa [0: not quantised]")] = None,
    seed: Annotated[int | None, typer.Option(help="seed of noise and jitter [0]")] = None,
    as_json: Json = False,
) -> None:
    """Simulate a manoeuvre, or the published experiments.

    A manoeuvre becomes a bag labelled synthetic; experiments leave with exit code 1 if one fails."""
    from lugre_steering.simulate import command as simulation

    if show_list:
        print_json([one._asdict() for one in simulation.catalogue()]) if as_json else simulation.show_catalogue(output())
        return
    if not what or out is None:
        raise DataError(
            "simulate: needs a name or file and --out DIR; 'lugre-steering simulate --list' shows what there is"
        )
    sensing = {
        "angle_rate_Hz": rate,
        "pressure_rate_Hz": pressure_rate if pressure_rate is not None else rate,
        "jitter_s": jitter,
        "angle_noise_deg": angle_noise,
        "angle_resolution_deg": angle_resolution,
        "pressure_noise_Pa": pressure_noise,
        "pressure_resolution_Pa": pressure_resolution,
        "seed": seed,
    }
    chosen = simulation.load_vehicle(vehicle, effect or [])
    origin = simulation.origin(what, vehicle, {"effect": effect, **sensing})
    if simulation.is_experiment(what):
        if any(value is not None for value in (storage, *sensing.values())):
            raise DataError(f"simulate {what}: has its own sampling and noise and writes no bag; expected no such option")
        _experiments(what, chosen, out, origin, as_json)
    result = simulation.run_manoeuvre(what, chosen, out, sensing, storage or "mcap", origin)
    print_json(result) if as_json else simulation.show_run(output(), result, chosen)


def _experiments(what: str, vehicle: Vehicle, out: Path, origin: Provenance, as_json: bool) -> NoReturn:
    from lugre_steering.simulate import command as simulation

    outcomes = simulation.run_experiments(what, vehicle)
    result = simulation.write_outcomes(what, outcomes, out, origin)
    print_json(result) if as_json else simulation.show_outcomes(output(), outcomes, out)
    raise typer.Exit(0 if result["passed"] else 1)


@command("vehicle")
def vehicle_(
    file: Annotated[Path, typer.Argument(help="vehicle file (YAML)")],
    out: Annotated[Path | None, typer.Option(help="folder for a picture of the footprint of one track")] = None,
    new: Annotated[bool, typer.Option("--new", help="ask for what a sheet needs and write FILE first")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="with --new: ask nothing, take every value that is proposed")] = False,
    as_json: Json = False,
) -> None:
    """Check a vehicle file and say what it amounts to, or begin one.

    Loads, friction, heat, inputs and effects."""
    from lugre_steering.effects.registry import made
    from lugre_steering.sheet.derived import derive
    from lugre_steering.sheet.show import draw_footprint, show_vehicle
    from lugre_steering.vehicle import load

    if new:
        from lugre_steering.sheet.new import begin_sheet

        written = begin_sheet(file, lambda text, default: default if yes else typer.prompt(text, default, err=True), console().print)
        console().print(f"written: {', '.join(map(str, written))}", highlight=False, soft_wrap=True)
    elif yes:
        raise DataError("vehicle --yes: answers the questions of --new; expected both")
    read = load(file)
    picture = draw_footprint(read, out, made("vehicle", {}, file, [])) if out is not None else None
    result = {**derive(read), "picture": picture and str(picture)}
    print_json(result) if as_json else show_vehicle(output(), result)


@command("import")
def import_(
    table: Annotated[Path, typer.Argument(help="CSV, JSON, npz, Parquet, HDF5 or MATLAB file, by its ending")],
    map_file: Annotated[
        Path | None, typer.Option("--map", help="which column is which channel, and its unit (YAML)")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="bag folder to write")] = None,
    propose: Annotated[
        bool, typer.Option("--propose", help="write a first map (to --map, or TABLE_map.yaml here) and say what was guessed")
    ] = False,
    storage: Annotated[str, typer.Option(help="mcap or sqlite3")] = "mcap",
    as_json: Json = False,
) -> None:
    """Turn a table of any logger into a bag.

    The bag has the standard topics; rates, gaps and outliers are counted, nothing is repaired."""
    from lugre_steering.importing.propose import propose as write_map
    from lugre_steering.importing.show import show_import, show_proposal
    from lugre_steering.importing.write import import_table

    if propose:
        proposal = write_map(table, map_file or Path(f"{table.stem}_map.yaml"))
        print_json(proposal) if as_json else show_proposal(output(), proposal)
        return
    if map_file is None or out is None:
        raise DataError(f"import {table}: needs --map FILE and --out DIR; --propose writes a first map")
    result = import_table(table, map_file, out, storage)
    print_json(result) if as_json else show_import(output(), result)


@command()
def calibrate(
    bags: Bags,
    vehicle: VehicleFile,
    out: OutFolder,
    free: Annotated[list[str] | None, typer.Option(help="also fit kingpin_arm or pressure_gain; repeatable")] = None,
    fix: Annotated[list[str] | None, typer.Option(help="keep this parameter at the sheet; repeatable")] = None,
    prior: Annotated[
        list[str] | None, typer.Option(help="NAME=SHARE: relative standard deviation of the sheet [0.15]; repeatable")
    ] = None,
    no_prior: Annotated[bool, typer.Option("--no-prior", help="let the data alone decide")] = False,
    jobs: Threads = None,
    fail_on: FailOn = None,
    as_json: Json = False,
) -> None:
    """Fit the parameters of a vehicle file to bags.

    All bags together: a new vehicle file, intervals, and what the data cannot tell."""
    from lugre_steering.bag.find import find
    from lugre_steering.calibration import calibrate as run
    from lugre_steering.calibration.result import facts, gate
    from lugre_steering.calibration.table import parse_priors, show_calibration
    from lugre_steering.vehicle import load

    if no_prior and prior:
        raise DataError("--no-prior: leaves no use for --prior; expected one of them")
    wanted, found = gate(fail_on or ()), find(bags, out)
    use_threads(jobs)
    with spinner() as progress:
        result = run(
            found.bags,
            vehicle,
            out,
            free=free or (),
            fix=fix or (),
            prior=parse_priors(prior or ()),
            priors=not no_prior,
            progress=progress,
            skipped=found.skipped,
        )
    if as_json:
        print_json(result)
    else:
        show_calibration(output(), result, load(vehicle).coordinate.force_unit)
        print(f"results in {out}")
    leave_if(wanted.failures(facts(result)))


@command()
def diagnose(
    vehicle: VehicleFile,
    out: OutFolder,
    bags: BagsOrNone = None,
    window: Annotated[
        list[Path] | None, typer.Option(help="window file that the live node wrote when the model no longer matched; may be given again")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="seed of the noise draws and bootstraps")] = 1,
    material: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="share of the torque amplitude from which an effect is called material")
    ] = 0.005,
    without: Annotated[
        list[str] | None,
        typer.Option(
            autocompletion=_effect_ids, help="ID of an effect that is not considered, to see what takes its place; may be given again"
        ),
    ] = None,
    report: Annotated[bool, typer.Option(help="write report.html and pictures")] = True,
    exit_code: Annotated[
        bool, typer.Option("--exit-code", help="leave with 3 for missing, 4 for unlisted physics, 5 for insufficient data")
    ] = False,
    jobs: Threads = None,
    fail_on: FailOn = None,
    as_json: Json = False,
) -> None:
    """Say which physics the model leaves out.

    Locates, names and models it, and shows the gain on held-out data."""
    from lugre_steering.bag.find import find
    from lugre_steering.diagnosis.command import STEPS, run
    from lugre_steering.diagnosis.result import facts, gate
    from lugre_steering.diagnosis.show import EXIT_CODES, show_diagnosis

    wanted, found = gate(fail_on or ()), find(bags or [], out)
    use_threads(jobs)
    with step_bar(STEPS) as progress:
        result = run(
            found.bags, vehicle, out, seed=seed, material=material, report=report, windows=window or [], without=without or [],
            progress=progress, skipped=found.skipped,
        )  # fmt: skip
    if as_json:
        print_json(result.json)
    else:
        show_diagnosis(output(), result)
        print(f"results in {out}" + (", for people in report.html" if report else ""))
    leave_if(wanted.failures(facts(result.json)))
    if exit_code:
        raise typer.Exit(EXIT_CODES[result.verdict])


@command()
def fleet(
    bags: Bags,
    vehicle: Annotated[Path, typer.Option("--vehicle", help="vehicle file, or map of vehicles to patterns of their bags (YAML)")],
    out: OutFolder,
    diagnose: Annotated[bool, typer.Option(help="diagnose each recording, beside check and replay")] = True,
    jobs: Annotated[int | None, typer.Option("--jobs", "-j", min=1, help="local processes [one per processor]")] = None,
    scheduler: Annotated[str | None, typer.Option(help="address of a Dask scheduler whose workers do it, e.g. tcp://host:8786")] = None,
    seed: Annotated[int, typer.Option(min=0, help="seed of the noise draws, bootstraps and permutations")] = 1,
    fail_on: FailOn = None,
    as_json: Json = False,
) -> None:
    """Examine many recordings of many vehicles together.

    Checks, replays and diagnoses each, and judges all of them on one budget of false discoveries; killed, it goes on where it was."""
    from lugre_steering.bag.find import find
    from lugre_steering.fleet.command import show_fleet
    from lugre_steering.fleet.result import facts, gate
    from lugre_steering.fleet.run import run
    from lugre_steering.fleet.work import FleetOptions

    wanted, found = gate(fail_on or ()), find(bags, out)
    with progress_bar() as progress:
        done = run(
            found.bags, vehicle, out, options=FleetOptions(diagnose, seed), jobs=jobs, scheduler=scheduler, skipped=found.skipped,
            progress=progress,
        )  # fmt: skip
    if as_json:
        print_json(done.json)
    else:
        show_fleet(output(), done, out)
        print(f"results in {out}, report: {out / 'report.html'}")
    leave_if(wanted.failures(facts(done.json)))


@command()
def play(
    bag: Annotated[Path, typer.Argument(help="rosbag2 folder or file")],
    rate: Annotated[
        float, typer.Option(min=0.01, max=1000.0, help="times as fast as recorded; stamps keep their distances, and the node says so")
    ] = 1.0,
    loop: Annotated[
        bool, typer.Option("--loop", help="again and again, until interrupted; the node warns where end and beginning do not meet")
    ] = False,
    recorded_stamps: Annotated[bool, typer.Option("--recorded-stamps", help="leave the header stamps as they are")] = False,
    as_json: Json = False,
) -> None:
    """Publish a bag on ROS topics, in its own timing.

    Its stamps are moved to now; what an estimator had published is left out."""
    from lugre_steering.live.available import need_ros

    need_ros("play")
    from lugre_steering.live.play import play as run

    with progress_bar() as progress:
        done = run(bag, rate=rate, loop=loop, recorded_stamps=recorded_stamps, progress=progress)
    for topic, reason in done.left_out.items():
        print(f"lugre-steering: not published: {topic}: {reason}", file=sys.stderr)
    print_json(done) if as_json else print(f"{counted(done.messages.total(), 'message')} on {counted(len(done.messages), 'topic')}")


@command()
def watch(
    node_name: Annotated[str, typer.Option("--node", help="name of the node, with its namespace")] = "/steering_torque_estimator",
    seconds: Annotated[float | None, typer.Option(min=0.0, help="leave after this time [until interrupted]")] = None,
) -> None:
    """Show a live estimator in the terminal.

    Torque, residual, angles, temperatures, their last minute, and its health."""
    from lugre_steering.live.available import need_ros

    need_ros("watch")
    from lugre_steering.live.watch import watch as run
    from lugre_steering.watch.view import showing

    with showing(output()) as show:
        run(show, node_name, float("inf") if seconds is None else seconds)


@command()
def node(
    vehicle: VehicleFile,
    parameters: Annotated[Path | None, typer.Option(help="parameter file (YAML)")] = None,
    setting: Annotated[list[str] | None, typer.Option("--set", "-p", help="NAME:=VALUE of a parameter; repeatable")] = None,
    remap: Annotated[list[str] | None, typer.Option("--remap", "-r", help="FROM:=TO of a topic; repeatable")] = None,
) -> None:
    """Start the live estimator; Ctrl-C ends it.

    The same node as that of 'ros2 run lugre_steering estimator'."""
    from lugre_steering.live.available import need_ros

    need_ros("node")
    from lugre_steering.node import arguments_of
    from lugre_steering.node import main as run

    raise typer.Exit(run(arguments_of(vehicle, parameters, setting or (), remap or ())))


@command()
def effects(
    effect_id: Annotated[
        str, typer.Argument(metavar="ID", autocompletion=_effect_ids, help="explain this effect; all are listed if left out")
    ] = "",
    out: Annotated[Path | None, typer.Option(help="folder for a picture of its signature")] = None,
    check: Annotated[bool, typer.Option("--check", help="try what every effect owes the chain (exit code 1 if it fails)")] = False,
    add: Annotated[Path | None, typer.Option(help="keep a law of this vehicle file under the name --id")] = None,
    name: Annotated[str, typer.Option("--id", help="name of the law that is kept")] = "",
    title: Annotated[str, typer.Option(help="its title (default: what the law says of itself)")] = "",
    law: Annotated[int, typer.Option(help="which law of the vehicle file is kept, from 1")] = 1,
    to: Annotated[Path, typer.Option(help="file of effects of your own that it is kept in, for --effects")] = Path("own_physics.yaml"),
    as_json: Json = False,
) -> None:
    """List or explain the physics that diagnosis knows.

    One effect: law, source, parameters, how it shows. With --add a law that was found is kept under a name."""
    from lugre_steering.diagnosis import effect_card as card
    from lugre_steering.effects import registry

    if add is not None:
        from lugre_steering.vehicle.keep import keep_law

        if not name:
            raise DataError("effects --add: needs a name for the law: --id NAME")
        keep_law(add, name, to, law=law, title=title)
        print_json({"id": name, "file": str(to)}) if as_json else print(f"{name} is kept in {to}; use it with --effects {to}")
        return
    if not effect_id:
        if out is not None:
            raise DataError("effects --out: needs the id of one effect; 'lugre-steering effects' lists them")
        print_json([card.describe(e) for e in registry.CATALOGUE.values()]) if as_json else card.show_list(output())
        return
    effect = registry.effect(effect_id)
    if check:
        from lugre_steering.simulate.contract import broken

        failures = broken(effect)
        print_json({"id": effect.id, "broken": failures}) if as_json else print("\n".join(failures) or f"{effect.id}: sound")
        raise typer.Exit(1 if failures else 0)
    traces = card.traces(effect)
    result = card.explain(effect, traces, card.draw(traces, out) if out is not None and traces else None)
    print_json(result) if as_json else card.show_effect(output(), effect, result)


@command()
def prove(
    out: OutFolder,
    quick: Annotated[bool, typer.Option("--quick", help="a stratified few, under five minutes on two cores")] = False,
    cases: Annotated[str | None, typer.Option(help="only cases whose name fits this pattern, e.g. 'null/*'")] = None,
    simulator: Annotated[str, typer.Option(help="2 (a world like the sheet's), 3 (other friction, machines, sensors) or all")] = "all",
    kinds: Annotated[str | None, typer.Option(help="only these kinds of cases, e.g. 'dirty,sheet'")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="repeat or resume the run with this seed [a new one]")] = None,
    each: Annotated[int | None, typer.Option(min=1, help="at most so many at random of each kind of each simulator")] = None,
    peers: Annotated[bool, typer.Option("--peers", help="also run other methods, on one in four of the recordings")] = False,
    as_json: Json = False,
) -> None:
    """Score diagnosis on physics hidden from it.

    Hides effects in recordings of two other simulators, diagnoses them blind and scores the answers."""
    from lugre_steering.proof.command import run
    from lugre_steering.proof.table import show_board

    with progress_bar() as progress:
        result = run(
            out, quick=quick, cases=cases, simulator=simulator, kinds=kinds, seed=seed, each=each, peers=peers,
            announce=lambda text: print(f"lugre-steering: {text}", file=sys.stderr), progress=progress,
        )  # fmt: skip
    if as_json:
        print_json(result)
    else:
        show_board(output(), result)
        print(f"results in {out}")


@command()
def config(
    option: Annotated[str, typer.Argument(help="name of an option (vehicle), or of that of one command (diagnose.seed)")] = "",
    value: Annotated[str, typer.Argument(help="what it shall be where it is not given")] = "",
    unset: Annotated[bool, typer.Option("--unset", help="forget this default")] = False,
    as_json: Json = False,
) -> None:
    """Show, save or forget defaults of options.

    Such as the vehicle file: lugre-steering config vehicle truck.yaml; --unset forgets it."""
    saved = defaults.load()
    if unset:
        saved.pop(option, None)
        defaults.save(saved)
    elif option:
        saved[option] = defaults.checked(option, value, options_of_commands())
        defaults.save(saved)
    if as_json:
        print_json({"file": defaults.file(), "defaults": saved})
    else:
        lines = [f"{defaults.file()}:", *(f"  {key} = {kept}" for key, kept in saved.items())]
        print("\n".join(lines) if saved else "no defaults are saved")


def main() -> None:
    """Entry point of ``lugre-steering``."""
    forgive_letters()
    app(prog_name="lugre-steering")


if __name__ == "__main__":
    main()
