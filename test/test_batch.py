# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Many recordings at once: folders and patterns, what is left out and why, several at a time, and when a script wants it to fail."""

from __future__ import annotations

import json
import os
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from lugre_steering.bag import BagWriter, Part, cdr
from lugre_steering.bag.find import find, told_apart
from lugre_steering.bench.replay import START_NS, write_cycle
from lugre_steering.cli import app
from lugre_steering.errors import BagError, DataError
from lugre_steering.gate import Gate
from lugre_steering.pool import WorkerDiedError, in_processes
from lugre_steering.resources import config_folder

VEHICLE = config_folder() / "test_vehicle.yaml"


def of_another_machine(folder: Path) -> Path:
    """A sound bag of a robot arm."""
    with BagWriter(folder) as writer:
        number = writer.add_topic("/joint_states", cdr.JOINT_STATE)
        stamps = START_NS + 10**7 * np.arange(100)
        writer.write([Part(number, stamps, cdr.encode_joint_state(stamps, "arm", ["elbow"], np.zeros((100, 1))))])
    return folder


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings in different depth, a robot's, a picture, a torn file."""
    folder = tmp_path_factory.mktemp("data") / "runs"
    (folder / "monday").mkdir(parents=True)
    write_cycle(folder / "first", 6.0)
    write_cycle(folder / "monday" / "second", 8.0)
    of_another_machine(folder / "robot")
    (folder / "photo.png").write_bytes(b"\x89PNG")
    (folder / "torn.mcap").write_bytes(b"nothing of the kind")
    return folder


def command(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def summary(out: Path) -> dict:
    return json.loads((out / "summary.json").read_text())


@pytest.fixture(scope="module")
def replayed(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[int, tuple[Path, str]]:
    """By the number of jobs, results of all and what was said; every run at the same second."""
    folder, results = tmp_path_factory.mktemp("replayed"), {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", "1780000000")
        for jobs in (1, 2):
            done = command("replay", runs, "--vehicle", VEHICLE, "--out", folder / str(jobs), "--jobs", str(jobs))
            assert done.exit_code == 0, done.stderr
            results[jobs] = (folder / str(jobs), done.stdout)
    return results


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_folder_is_replayed_whole_and_says_what_it_left_out(replayed: dict[int, tuple[Path, str]], jobs: int) -> None:
    out, said = replayed[jobs]
    written = summary(out)
    assert [bag["name"] for bag in written["bags"]] == ["first", "second"]
    assert {Path(left["bag"]).name: left["reason"].split(";")[0] for left in written["skipped"]} == {
        "robot": "topic 'steering/left/joint_state' is missing",
        "torn.mcap": "not a recording (neither MCAP nor sqlite3 by its first bytes)",
    }
    for name in ("first", "second", "robot", "torn.mcap"):
        assert name in said
    assert sorted(path.name for path in out.iterdir() if path.is_dir()) == ["first", "second"]


def test_several_at_a_time_give_the_same(replayed: dict[int, tuple[Path, str]]) -> None:
    one, two = ((summary(out), [file.read_bytes() for file in sorted(out.glob("*/*.mcap"))]) for out, _ in replayed.values())
    assert one == two


def test_results_in_a_folder_are_no_recordings(runs: Path, tmp_path: Path) -> None:
    data = shutil.copytree(runs, tmp_path / "runs")
    assert command("replay", data, "--vehicle", VEHICLE, "--out", data / "results", "--jobs", "1").exit_code == 0
    found = find([data])
    assert [bag.name for bag in found.bags] == ["torn.mcap", "first", "second", "robot"]
    assert [Path(one.bag).name for one in found.skipped] == ["first", "second"]
    assert not find([data], data / "results").skipped  # where the results go is not looked into
    assert [bag.name for bag in find([data / "results" / "first"]).bags] == ["first"]  # named itself, it is meant


def test_patterns_and_doubles(runs: Path) -> None:
    assert [bag.name for bag in find([runs / "**" / "*nd"]).bags] == ["second"]
    assert [bag.name for bag in find([runs / "first", runs / "first" / ".", runs / "fir*"]).bags] == ["first"]


def test_parts_of_one_recording_are_one(tmp_path: Path) -> None:
    write_cycle(tmp_path / "run", 1.0)
    parts = tmp_path / "bags" / "parts"
    parts.mkdir(parents=True)
    for name in ("run_0.mcap", "run_1.mcap"):
        shutil.copy(tmp_path / "run" / "run.mcap", parts / name)
    assert find([tmp_path / "bags"]).bags == (parts,)
    shutil.copy(tmp_path / "run" / "run.mcap", parts / "other.mcap")
    assert len(find([tmp_path / "bags"]).bags) == 3


@pytest.mark.parametrize("name", ["absent", "empty", "absent*"])
def test_where_nothing_is_recorded_nothing_is_done(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    done = command("replay", tmp_path / name, "--vehicle", VEHICLE, "--out", tmp_path / "deep" / "out")
    assert done.exit_code == 2
    assert len(done.stderr.splitlines()) == 1
    assert name in done.stderr
    assert not (tmp_path / "deep").exists()


@pytest.mark.parametrize("verb", ["replay", "calibrate", "diagnose"])
def test_results_never_lie_among_recordings(runs: Path, verb: str) -> None:
    before = sorted(runs.rglob("*"))
    for out in (runs, runs / "first"):
        done = command(verb, runs / "first", "--vehicle", VEHICLE, "--out", out)
        assert done.exit_code == 2
        assert "choose another --out" in done.stderr
    assert sorted(runs.rglob("*")) == before


def test_a_lone_robot_is_refused_and_leaves_no_folder(runs: Path, tmp_path: Path) -> None:
    for given in ((runs / "robot",), (runs / "robot", runs / "torn.mcap")):
        done = command("replay", *given, "--vehicle", VEHICLE, "--out", tmp_path / "a" / "b")
        assert done.exit_code == 2
        assert len(done.stderr.splitlines()) == 1
        assert "steering/left/joint_state" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_bag_of_another_robot_stops_no_calibration(tmp_path: Path) -> None:
    bags = Path(__file__).parents[1] / "bags"
    robot = of_another_machine(tmp_path / "robot")
    out = tmp_path / "out"
    given = (robot, bags / "README.md", bags / "synthetic_double_cycle")
    done = command("calibrate", *given, "--vehicle", VEHICLE, "--out", out, "--jobs", "1", "--fail-on", "skipped")
    assert done.exit_code == 1, done.stderr
    assert "--fail-on" in done.stderr
    result = json.loads((out / "calibration.json").read_text())
    assert result["bags"] == [str(bags / "synthetic_double_cycle")]
    skipped = [Path(one["bag"]).name for one in result["data_quality"] if one["finding"] == "skipped_recording"]
    assert skipped == ["robot", "README.md"]
    assert [row["bag"] for row in result["per_bag"]] == ["synthetic_double_cycle"]
    assert result["per_bag"][0]["calibrated"] == pytest.approx(result["rmse_Nm"]["calibrated"], rel=1e-9)


def test_failing_on_request(runs: Path, tmp_path: Path) -> None:
    def code(*options: str) -> int:
        return command("replay", runs / "first", "--vehicle", VEHICLE, "--out", tmp_path / "out", *options).exit_code

    assert code("--fail-on", "skipped", "--fail-on", "rmse=1e9") == 0
    assert code("--fail-on", "rmse=0.001") == 1
    assert code("--fail-on", "rmse") == code("--fail-on", "skiped") == 2


def test_a_gate_refuses_what_it_does_not_know() -> None:
    gate = Gate(["a", "n=3"], ["a", "b"], ["n"])
    assert gate.failures({"a": "it is so", "b": "too", "n": 4.0}) == ["it is so", "n is 4, above 3"]
    assert gate.failures({"a": None, "b": "too", "n": 3.0}) == []
    for wrong in ("c", "a=1", "n", "n=x"):
        with pytest.raises(DataError, match="expected one of a, b, n=LIMIT"):
            Gate([wrong], ["a", "b"], ["n"])


def dies_on_seven(number: int) -> int:
    if number == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def test_a_worker_that_dies_takes_down_its_own_task_only() -> None:
    answers = dict(in_processes(dies_on_seven, [3, 7, 5, 6], 2))
    assert isinstance(answers.pop(1), WorkerDiedError)
    assert answers == {0: 9, 2: 25, 3: 36}


def test_a_replayed_bag_is_hardly_larger_than_what_is_in_it(tmp_path: Path) -> None:
    """The results have four times the messages of the angles, so twice the packed input is what may be expected."""
    bag = Path(__file__).parents[1] / "bags" / "synthetic_double_cycle"
    assert command("replay", bag, "--vehicle", VEHICLE, "--out", tmp_path / "out").exit_code == 0
    sizes = [sum(file.stat().st_size for file in folder.iterdir()) for folder in (bag, tmp_path / "out" / bag.name)]
    assert sizes[1] < 2.5 * sizes[0]


def test_out_in_a_folder_of_bags_is_told(tmp_path: Path) -> None:
    write_cycle(tmp_path / "run", 1.0)
    with pytest.raises(BagError, match=rf"such as {tmp_path}_results$"):
        find([tmp_path / "run"], tmp_path)
    (tmp_path / "monday").mkdir()
    (tmp_path / "run").rename(tmp_path / "monday" / "run")
    with pytest.raises(BagError, match=rf"such as {tmp_path}_results$"):
        find([tmp_path], tmp_path)


def test_recordings_of_one_name_are_told_apart_by_their_folders(tmp_path: Path) -> None:
    assert told_apart(["a/x/run", "b/x/run", "b/other"]) == ["a/x/run", "b/x/run", "other"]
    assert told_apart(["monday/run", "tuesday/run"]) == ["monday/run", "tuesday/run"]
    assert told_apart(["run"]) == ["run"]
    for day in ("monday", "tuesday"):
        write_cycle(tmp_path / day / "run", 1.0 + (day == "monday"))
    done = command("replay", tmp_path / "monday", tmp_path / "tuesday", "--vehicle", VEHICLE, "--out", tmp_path / "out")
    assert "monday/run -> run " in done.stdout
    assert "tuesday/run -> run_2 " in done.stdout
