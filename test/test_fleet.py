# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A fleet with real worker processes: kept by content, killed and gone on with, bad bags in quarantine, tables that others read."""

from __future__ import annotations

import hashlib
import importlib.util
import io
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import jsonschema
import numpy as np
import pyarrow.parquet as pq
import pytest
from bag_making import thinned_bag
from rich.console import Console
from test_batch import of_another_machine
from test_fleet_statistics import record
from typer.testing import CliRunner

import lugre_steering
from lugre_steering.bench.replay import write_cycle
from lugre_steering.cli import app
from lugre_steering.diagnosis.conclude.headline import CHECKS, inside
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import DataError, LugreSteeringError, VehicleFileError
from lugre_steering.fleet.claims import Claim
from lugre_steering.fleet.command import show_fleet
from lugre_steering.fleet.result import Fleet, VehicleSummary
from lugre_steering.fleet.run import run
from lugre_steering.fleet.tables import KINDS
from lugre_steering.fleet.together import Together
from lugre_steering.fleet.told import commands, folder_of, told
from lugre_steering.fleet.vehicles import member_of, read_members
from lugre_steering.fleet.work import FleetOptions, Task, process
from lugre_steering.resources import config_folder
from lugre_steering.schemas import schema_of
from lugre_steering.serialise import as_json
from lugre_steering.vehicle import load
from lugre_steering.vehicle.identity import identity

VEHICLE = config_folder() / "test_vehicle.yaml"
BAGS = Path(__file__).parents[1] / "bags"
QUICK = FleetOptions(diagnose=False)
ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(lugre_steering.__file__).parents[1])}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four recordings, a robot's, one cut in two and not what it says."""
    folder = tmp_path_factory.mktemp("data") / "runs"
    for number in range(4):
        write_cycle(folder / f"run_{number}", 5.0 + number)
    of_another_machine(folder / "robot")
    write_cycle(folder / "corrupt", 5.0)
    whole = next((folder / "corrupt").glob("*.mcap"))
    whole.write_bytes(whole.read_bytes()[:50] + b"\xff" * 5000)
    return folder


def bags_of(runs: Path) -> list[Path]:
    return sorted(path for path in runs.iterdir() if path.is_dir())


def table(out: Path, name: str) -> list[dict]:
    return pq.read_table(out / f"{name}.parquet").to_pylist()


def without_processes(patch: pytest.MonkeyPatch) -> None:
    """For what processes have no part in: each takes seconds to begin."""
    patch.setattr("lugre_steering.fleet.run.in_processes", lambda function, tasks, _: enumerate(map(function, tasks)))


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    without_processes(monkeypatch)


@pytest.fixture(scope="module")
def done(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """As one process does it: the tests that kill workers expect the same of several."""
    out = tmp_path_factory.mktemp("fleet") / "out"
    with pytest.MonkeyPatch.context() as patch:
        without_processes(patch)
        run(bags_of(runs), VEHICLE, out, options=QUICK, jobs=1, version="1")
    return out


def test_bad_bags_are_in_quarantine_and_stop_nobody(done: Path) -> None:
    result = json.loads((done / "fleet.json").read_text())
    assert (result["finished"], result["examined"], result["cached"]) == (True, 6, 0)
    assert {Path(one["bag"]).name for one in result["quarantine"]} == {"robot", "corrupt"}
    assert all(one["reason"] for one in result["quarantine"])
    assert [(one["recordings"], one["quarantined"]) for one in result["vehicles"]] == [(4, 2)]


def test_the_record_keeps_to_its_schema(done: Path) -> None:
    result = json.loads((done / "fleet.json").read_text())
    jsonschema.validate(result, schema_of(Fleet))
    (vehicle,) = result["vehicles"]
    assert vehicle["identity"] == vehicle["sha256"] == identity(load(VEHICLE))
    assert vehicle["identity"] not in result["provenance"]["vehicle"]["sha256"].values()  # which is that of the file


def test_tables_are_what_they_say(done: Path, runs: Path) -> None:
    for name, columns in KINDS.items():
        schema = pq.read_schema(done / f"{name}.parquet")
        assert schema.names == list(columns)
        assert hashlib.sha256(VEHICLE.read_bytes()).hexdigest() in schema.metadata[b"lugre_steering"].decode()
    scores = {Path(row["bag"]).name: row for row in table(done, "scores")}
    assert scores["run_0"]["rmse_Nm"] > 0.0
    assert scores["run_0"]["duration_s"] == pytest.approx(5.0, abs=0.1)
    assert scores["robot"]["quarantine"] is not None
    hashes = {row["bag"]: row["bag_sha256"] for row in scores.values()}
    for name in ("findings", "effects", "estimates"):
        assert all(row["bag_sha256"] == hashes[row["bag"]] for row in table(done, name))
    single = CliRunner().invoke(app, ["replay", str(runs / "run_3"), "--vehicle", str(VEHICLE), "--out", str(done.parent / "replay")])
    assert single.exit_code == 0
    known = json.loads((done.parent / "replay" / "summary.json").read_text())["overall"]
    assert scores["run_3"]["rmse_Nm"] == pytest.approx(known["rmse_Nm"], rel=1e-12)


def test_the_page_says_what_was_left_out_and_loads_nothing(done: Path) -> None:
    page = (done / "report.html").read_text()
    assert "corrupt" in page
    assert "robot" in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "https://" not in page


@pytest.mark.usefixtures("in_this_process")
def test_what_is_known_is_not_done_again(done: Path, runs: Path, tmp_path: Path) -> None:
    out, data = shutil.copytree(done, tmp_path / "out"), shutil.copytree(runs, tmp_path / "runs")
    again = run(bags_of(runs), VEHICLE, out, options=QUICK, jobs=1, version="1")
    assert (again.examined, again.cached) == (0, 6)
    moved = run(bags_of(data), VEHICLE, out, options=QUICK, jobs=1, version="1")  # the same bytes elsewhere
    assert (moved.examined, moved.cached) == (0, 6)
    shutil.rmtree(data / "run_0")
    write_cycle(data / "run_0", 5.5)
    changed = run(bags_of(data), VEHICLE, out, options=QUICK, jobs=1, version="1")
    assert (changed.examined, changed.cached) == (1, 5)
    sheet = tmp_path / "other.yaml"
    text = VEHICLE.read_text().replace("rubber_dma", f"{VEHICLE.parent}/rubber_dma")
    sheet.write_text(f"# the same\n{text}")
    assert run(bags_of(data)[:2], sheet, out, options=QUICK, jobs=1, version="1").cached == 2  # a sheet is what it says


@pytest.mark.usefixtures("in_this_process")
def test_two_versions_are_compared(done: Path, runs: Path, tmp_path: Path) -> None:
    out = shutil.copytree(done, tmp_path / "out")
    bags = bags_of(runs)[:3]
    same = run(bags, VEHICLE, out, options=QUICK, jobs=1, version="2")
    assert (same.examined, same.other_version, same.changes) == (3, "1", ())
    for file in (out / "recordings").glob("*/2.json"):
        record = json.loads(file.read_text())
        if record["score"]:
            record["score"]["rmse_Nm"] *= 2.0
            file.write_text(json.dumps(record))
    changed = run(bags, VEHICLE, out, options=QUICK, jobs=1, version="3")
    assert changed.other_version == "2"
    assert {(Path(one.bag).name, one.what) for one in changed.changes} == {("run_0", "rmse_Nm")}
    assert len(table(out, "changes")) == 1
    assert "Nothing differs" not in (out / "report.html").read_text()


def children(process: int) -> list[int]:
    """Processes that it has started, but for the one that watches shared memory."""
    found = []
    for thread in Path(f"/proc/{process}/task").glob("*/children"):
        found += [int(child) for child in thread.read_text().split()]
    return [child for child in found if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()]


def waiting(condition: object, seconds: float = 120.0) -> Iterator[None]:
    end = time.monotonic() + seconds
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end, "nothing has happened for too long"
        yield
        time.sleep(0.01)


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="processes are looked up in /proc")
def test_workers_may_be_killed_and_then_the_whole_run(
    done: Path, runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    command = [sys.executable, "-m", "lugre_steering.cli", "fleet", runs, "--vehicle", VEHICLE, "--out", out, "--no-diagnose", "-j", "2"]
    first = subprocess.Popen(command, env=ENVIRONMENT, stderr=subprocess.PIPE)
    for _ in waiting(lambda: len(children(first.pid)) == 2):
        pass
    os.kill(children(first.pid)[0], signal.SIGKILL)  # whatever it has is done by another
    for _ in waiting(lambda: len(list((out / "recordings").glob("*/*.json"))) >= 2):
        assert first.poll() is None
    workers = children(first.pid)
    first.kill()
    first.communicate()
    for _ in waiting(lambda: not any(Path(f"/proc/{worker}").exists() for worker in workers)):
        pass  # none is left behind
    assert json.loads((out / "fleet.json").read_text())["finished"] is False
    without_processes(monkeypatch)
    second = CliRunner().invoke(app, [*map(str, command[3:]), "--json"])
    assert second.exit_code == 0, second.stderr
    result = json.loads(second.stdout)
    assert result["cached"] >= 2
    assert result["cached"] + result["examined"] == 6
    whole = {Path(row["bag"]).name: (row["rmse_Nm"], row["quarantine"]) for row in table(done, "scores")}
    assert {Path(row["bag"]).name: (row["rmse_Nm"], row["quarantine"]) for row in table(out, "scores")} == whole


@pytest.mark.usefixtures("in_this_process")
def test_a_bag_that_grows_is_left_for_the_next_run(tmp_path: Path) -> None:
    """A recorder at work: the file gets longer while it is read."""
    write_cycle(tmp_path / "whole", 6.0)
    content = next((tmp_path / "whole").glob("*.mcap")).read_bytes()
    growing = tmp_path / "now" / "now.mcap"
    growing.parent.mkdir()
    growing.write_bytes(content[:-20_000])
    stop = threading.Event()

    def record() -> None:
        with growing.open("ab") as file:
            for place in range(len(content) - 20_000, len(content)):  # for longer than any run takes
                file.write(content[place : place + 1])
                file.flush()
                if stop.wait(0.02):
                    file.write(content[place + 1 :])
                    return

    recorder = threading.Thread(target=record)
    recorder.start()
    try:
        first = run([growing.parent], VEHICLE, tmp_path / "out", options=QUICK, jobs=1)
    finally:
        stop.set()
        recorder.join()
    assert ["still being written" in one.reason for one in first.quarantine] == [True]
    assert growing.read_bytes() == content
    second = run([growing.parent], VEHICLE, tmp_path / "out", options=QUICK, jobs=1)
    assert (second.quarantine, second.examined, second.vehicles[0].recordings) == ((), 1, 1)


@pytest.mark.usefixtures("in_this_process")
def test_a_map_says_which_vehicle_made_which_bag(runs: Path, tmp_path: Path) -> None:
    file = tmp_path / "map.yaml"
    text = "vehicles:\n  seven: {file: %s, bags: ['*_0', '*_1']}\n  nine: {file: %s, bags: ['*_1', '*_2']}\n"
    file.write_text(text % (VEHICLE, VEHICLE))
    members = read_members(file)
    told = [member_of(runs / f"run_{number}", members) for number in range(4)]
    assert [one if isinstance(one, str) else one.name for one in told] == [
        "seven", "its path fits seven and nine of the map of vehicles, expected one", "nine", "its path fits no vehicle of the map",
    ]  # fmt: skip
    result = run([runs / "run_0", runs / "run_3"], file, tmp_path / "out", options=QUICK, jobs=1)
    assert [(one.name, one.recordings) for one in result.vehicles] == [("seven", 1), ("nine", 0)]
    assert [Path(one.bag).name for one in result.quarantine] == ["run_3"]
    for wrong in ("vehicles: {}\n", "vehicles: {a: {file: x.yaml}}\n", f"vehicles: {{a: {{file: '{VEHICLE}', bags: []}}}}\n"):
        file.write_text(wrong)
        with pytest.raises(VehicleFileError, match=r"map\.yaml"):
            read_members(file)


def test_nothing_of_others_is_replaced(runs: Path, tmp_path: Path) -> None:
    (tmp_path / "scores.parquet").write_bytes(b"somebody's")
    with pytest.raises(DataError, match="not part of an earlier result"):
        run([runs / "run_0"], VEHICLE, tmp_path, options=QUICK, jobs=1)
    assert [path.name for path in tmp_path.iterdir()] == ["scores.parquet"]


@pytest.mark.parametrize(("module", "options"), [("pyarrow", ()), ("distributed", ("--scheduler", "tcp://127.0.0.1:1"))])
def test_what_is_missing_is_named(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, options: tuple[str, ...]
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == module else find(name, *rest))
    arguments = ["fleet", str(runs / "run_0"), "--vehicle", str(VEHICLE), "--out", str(tmp_path / "out"), "--no-diagnose", *options]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 2
    assert "lugre_steering[fleet]" in done.stderr


@pytest.mark.usefixtures("in_this_process")
def test_where_nothing_is_there_nothing_is_judged(runs: Path, tmp_path: Path) -> None:
    arguments = ["--vehicle", str(VEHICLE), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, ["fleet", str(tmp_path / "nothing"), *arguments])
    assert (done.exit_code, done.stdout) == (2, "")
    assert "no such file or folder" in done.stderr
    assert not (tmp_path / "out").exists()
    done = CliRunner().invoke(app, ["fleet", str(runs / "corrupt"), *arguments])
    assert done.exit_code == 0
    assert done.stdout.startswith("- No recording tells anything")


@pytest.mark.usefixtures("in_this_process")
def test_one_is_diagnosed_and_its_physics_stands(tmp_path: Path) -> None:
    """The bundled hidden stop at 20 Hz, which is quicker to diagnose."""
    out, slow = tmp_path / "out", thinned_bag(BAGS / "synthetic_hidden_stop_a", tmp_path)
    arguments = ["fleet", slow, "--vehicle", VEHICLE, "--out", out, "-j", "1", "--fail-on", "effect"]
    assert CliRunner().invoke(app, [str(argument) for argument in arguments]).exit_code == 1
    assert {row["effect"] for row in table(out, "effects")} == {"end_stop"}
    assert [(row["kind"], row["effect"]) for row in table(out, "claims") if row["q_value"] < 0.05] == [("recording", "end_stop")]
    estimates = {row["effect"]: row for row in table(out, "estimates")}
    assert len(estimates) > 15
    assert all(row["sd"] > 0.0 for row in estimates.values())
    assert "Elastic end stop" in (out / "report.html").read_text()


def test_the_page_begins_with_what_an_engineer_acts_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight recordings of each of two vehicles; one has 4 standard deviations of an offset in each, too little for any alone."""
    rng = np.random.default_rng(1)
    rows = [
        {**record(vehicle, day, {"pressure_offset": rng.normal(size), "backlash": rng.normal()}), "effects": [], "recordings": 1,
         "duration_s": 60.0, "bag_sha256": f"{day:064d}", "files": {f"{vehicle}_{day}.mcap": f"{day:064d}"}, "seconds": 1.0}
        for vehicle, size in (("seven", 4.5), ("nine", 0.0)) for day in range(1, 9)
    ]  # fmt: skip
    asked = []

    def diagnose_together(tasks: Sequence[Together]) -> Iterator[dict]:
        for task in tasks:
            asked.append((task.member, len(task.bags)))
            size = {"offset": {"value": 4.5, "ci95": [4.0, 5.0], "unit": "Pa"}}
            effect = {"id": "pressure_offset", "p_value": 1e-20, "parameters": size, "indistinguishable_from": ["backlash"],
                      "largest_Nm": 12345.0, "largest_share": 0.123}  # fmt: skip
            yield {"member": task.member, "bags": list(task.bags), "recorded": task.recorded, "verdict": "missing_physics",
                   "statement": "told", "effects": [effect]}  # fmt: skip

    monkeypatch.setattr("lugre_steering.fleet.run._work", lambda *_: iter(rows))
    monkeypatch.setattr("lugre_steering.fleet.run.in_processes", lambda _, tasks, __: enumerate(diagnose_together(tasks)))
    (tmp_path / "map.yaml").write_text(as_json({"vehicles": {name: {"file": VEHICLE, "bags": ["*"]} for name in ("seven", "nine")}}))
    fleet = run([], tmp_path / "map.yaml", tmp_path / "out", jobs=1)
    assert asked == [("seven", 5)]
    (found,) = told(fleet)
    assert (found.vehicle, found.size, found.since) == ("seven", "up to 12.3 kN m (12 % of the torque)", "2026-03-01, the first recording")
    assert found.seen == "5 recordings diagnosed together, 0 of 8 recordings alone"
    assert found.do == CHECKS["measurement"]
    page = (tmp_path / "out" / "report.html").read_text().replace("\u00a0", " ")
    first = page[page.index("<body") : page.index("<section")]
    rival = f"or {inside(CATALOGUE['backlash'].title)}"
    for words in ("model of 1 of 2 vehicles", CATALOGUE["pressure_offset"].title, rival, found.size, found.do):
        assert words in first
    assert not {name for name in CATALOGUE if "_" in name and name in re.sub("<script.*", "", page, flags=re.DOTALL)}
    assert "'bags/seven 1'" in page.replace("&#x27;", "'")  # the command to look closer, as a shell takes it
    assert "--out diagnosis_seven<" in page
    assert folder_of("test vehicle, front axle (7/9)") == "diagnosis_test_vehicle_front_axle_7_9"
    result = json.loads((tmp_path / "out" / "fleet.json").read_text())
    jsonschema.validate(result, schema_of(Fleet))
    made = result["provenance"]
    assert made["options"] == {"diagnose": True, "seed": 1}
    assert made["vehicle"]["sha256"][str(VEHICLE)] == hashlib.sha256(VEHICLE.read_bytes()).hexdigest()
    assert made["vehicle"]["sha256"]["map.yaml"] == hashlib.sha256((tmp_path / "map.yaml").read_bytes()).hexdigest()
    assert {"path": "bags/nine 3", "sha256": {"nine_3.mcap": f"{3:064d}"}} in made["bags"]
    assert f"{3:064d}" in page
    console = Console(width=80, file=io.StringIO())
    show_fleet(console, fleet, tmp_path)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "12.3 kN m" in text.split("recordings  quarantine")[0]


def test_the_command_to_look_closer_takes_recordings_of_every_finding() -> None:
    """A stop in three recordings, a larger patch in two others: no single finding has the command to itself."""
    named = {"end_stop": ("stop 1", "stop 2", "stop 3"), "surface_patch": ("patch 1", "patch 2")}
    found = tuple(
        Claim("recording", "seven", bag, effect, "change", 1.0, 0.9, 1.1, "1", 1e-9, largest_Nm=size, largest_share=0.1)
        for size, (effect, bags) in enumerate(named.items()) for bag in bags
    )  # fmt: skip
    seven = VehicleSummary("seven", "seven.yaml", "", 5, 0, 1.0, None, None, None, {}, load(VEHICLE))
    fleet = cast(Fleet, SimpleNamespace(claims=found, vehicles=(seven,), together=()))
    bags = ["patch 1", "stop 1", "patch 2", "stop 2", "stop 3"]
    assert shlex.split(commands(fleet)["seven"])[2:7] == bags
    asked = SimpleNamespace(claims=found, vehicles=(seven,), together=(SimpleNamespace(vehicle="seven", bags=("a", "b")),))
    assert shlex.split(commands(cast(Fleet, asked))["seven"])[2:5] == ["a", "b", "--vehicle"]


@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="Dask is not installed")
def test_a_dask_cluster_does_the_same_though_a_worker_is_killed(done: Path, runs: Path, tmp_path: Path) -> None:
    from distributed import LocalCluster

    records, missing_then = tmp_path / "out" / "recordings", []
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:

        def kill() -> None:
            for _ in waiting(lambda: any(records.glob("*/*.json"))):
                pass
            os.kill(cluster.workers[0].pid, signal.SIGKILL)
            missing_then.append(6 - len(list(records.glob("*/*.json"))))

        killer = threading.Thread(target=kill)
        killer.start()
        result = run(bags_of(runs), VEHICLE, tmp_path / "out", options=QUICK, scheduler=cluster.scheduler_address, version="1")
        killer.join()
        assert (result.examined + result.cached, len(result.quarantine)) == (6, 2)  # what a killed one had written is kept
    assert missing_then[0] > 0  # in mid-run
    strip = {"seconds": None}
    assert [row | strip for row in table(tmp_path / "out", "scores")] == [row | strip for row in table(done, "scores")]


def test_a_worker_without_the_physics_of_the_command_does_not_work(runs: Path, tmp_path: Path) -> None:
    task = Task(runs / "run_0", "truck", VEHICLE, tmp_path, "1", QUICK, {"chain_ripple": "0" * 64})
    with pytest.raises(LugreSteeringError, match=r"other physics of users \(none\) than this command \(chain_ripple\)"):
        process(task)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="Dask is not installed")
def test_no_scheduler_is_one_line(runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lugre_steering.fleet.cluster.PATIENCE", "1s")
    with pytest.raises(LugreSteeringError, match="no Dask scheduler answers"):
        run([runs / "run_0"], VEHICLE, tmp_path / "out", options=QUICK, scheduler="tcp://127.0.0.1:1")
    assert not (tmp_path / "out" / "report.html").exists()
