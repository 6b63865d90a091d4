# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The command line of the simulation: results and exit codes; bad input ends with one line and exit code 2."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from lugre_steering import cli
from lugre_steering.bag import read_recording
from lugre_steering.errors import DataError
from lugre_steering.recording import Kind
from lugre_steering.resources import config_folder
from lugre_steering.simulate import command, examples
from lugre_steering.simulate.paper import EXPERIMENTS
from lugre_steering.simulate.paper.outcome import Check, Outcome
from lugre_steering.vehicle import load, save


def invoke(*arguments: str) -> tuple[int, str, str]:
    """Run the program; exit code, stdout, stderr. An exception that would be a traceback fails the test."""
    result = CliRunner().invoke(cli.app, ["simulate", *arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.stdout, result.stderr


def test_the_list_names_everything() -> None:
    code, out, _ = invoke("--list")
    assert code == 0
    for name in ("double-cycle", "varied-rates", "paper-limit-stop", "FILE.csv", "BAG"):
        assert name in out


def test_a_manoeuvre_and_the_angles_of_its_own_bag(tmp_path: Path) -> None:
    own = tmp_path / "mine.yaml"
    own.write_text("segments: [{sweep: {to_deg: 10, rate_deg_s: 8, hold_s: 1}}]", encoding="utf-8")
    code, out, err = invoke(str(own), "--out", str(tmp_path / "a"), "--seed", "3", "--rate", "50", "--json")
    assert code == 0, err
    first = json.loads(out)
    assert first["synthetic"] is True
    assert Path(first["picture"]).is_file()
    effect = ("--effect", "slope_bias:torque=1000", "--storage", "sqlite3")
    code, out, err = invoke(first["bag"], "--out", str(tmp_path / "b"), *effect, "--json")
    assert code == 0, err
    second = json.loads(out)
    assert second["largest_angle_deg"] == pytest.approx(first["largest_angle_deg"], abs=0.2)
    assert second["largest_torque_Nm"] == pytest.approx(first["largest_torque_Nm"] + 1000.0, rel=0.01)
    code, _, err = invoke(str(own), "--out", str(tmp_path / "a"))
    assert code == 2
    assert "exists" in err


SHORT = "segments: [{sweep: {to_deg: 10, rate_deg_s: 8, hold_s: 1}}]"


@pytest.mark.parametrize(
    ("vehicle", "effect", "told"),
    [
        (
            "test_vehicle.yaml", ("--effect", "slope_bias:torque=1000"),
            (r"largest torque +[\d.]+ kN m", r"steering angle +1[01][.\d]* deg", "torque = 1000 N m"),  # the inner track turns further
        ),
        ("linear_axis_example.yaml", (), (r"largest force +[\d.]+ N\b", r"largest position +17\d mm")),  # 10 deg are 0.1745 rad
    ],
)
def test_what_was_simulated_is_told_in_words_and_the_units_of_the_machine(
    tmp_path: Path, vehicle: str, effect: tuple[str, ...], told: tuple[str, ...]
) -> None:
    own = tmp_path / "mine.yaml"
    own.write_text(SHORT, encoding="utf-8")
    code, out, err = invoke(str(own), "--vehicle", str(config_folder() / vehicle), "--out", str(tmp_path / "a"), *effect)
    assert code == 0, err
    for pattern in told:
        assert re.search(pattern, out), out
    assert "_" not in out.partition("bag in")[0]


def test_names_with_dots_do_not_meet(tmp_path: Path) -> None:
    results = []
    for name in ("run.1.yaml", "run.2.yaml"):
        (tmp_path / name).write_text(SHORT, encoding="utf-8")
        code, out, err = invoke(str(tmp_path / name), "--out", str(tmp_path / "out"), "--json")
        assert code == 0, err
        results.append(json.loads(out))
    assert [Path(result["bag"]).name for result in results] == ["synthetic_run.1", "synthetic_run.2"]
    assert [Path(result["picture"]).name for result in results] == ["synthetic_run.1.png", "synthetic_run.2.png"]


def test_both_joints_on_one_topic(tmp_path: Path) -> None:
    vehicle = load(config_folder() / "test_vehicle.yaml")
    shared = replace(vehicle, topics=replace(vehicle.topics, left="/joint_states", right="/joint_states"))
    save(shared, tmp_path / "shared.yaml")
    (tmp_path / "mine.yaml").write_text(SHORT, encoding="utf-8")
    code, out, err = invoke(str(tmp_path / "mine.yaml"), "--out", str(tmp_path), "--vehicle", str(tmp_path / "shared.yaml"), "--json")
    assert code == 0, err
    angles = [channel for channel in shared.channels if channel.kind is Kind.ANGLE]
    read = read_recording(json.loads(out)["bag"], angles)
    assert max(abs(read.angle["left"].value)) == pytest.approx(np.radians(10.0), rel=0.3)
    assert read.angle["left"].value.size == read.angle["right"].value.size > 100


def test_without_matplotlib_the_numbers_are_written_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lugre_steering.report.available.importlib.util.find_spec", lambda _: None)
    (tmp_path / "mine.yaml").write_text(SHORT, encoding="utf-8")
    code, out, err = invoke(str(tmp_path / "mine.yaml"), "--out", str(tmp_path / "out"), "--json")
    assert code == 0, err
    assert json.loads(out)["picture"] is None
    assert "matplotlib" in json.loads(out)["picture_note"]
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["synthetic_mine"]


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        ((), "--out"),
        (("double-cycle",), "--out"),
        (("dubble-cycle", "--out", "{tmp}"), "dubble-cycle"),
        (("double-cycle", "--out", "{tmp}", "--vehicle", "{tmp}/none.yaml"), "none.yaml"),
        (("double-cycle", "--out", "{tmp}/file"), "file"),
        (("double-cycle", "--out", "{tmp}", "--storage", "zip"), "zip"),
        (("double-cycle", "--out", "{tmp}", "--rate", "-1"), "angle_rate_Hz"),
        (("double-cycle", "--out", "{tmp}", "--jitter", "nan"), "jitter_s"),
        (("double-cycle", "--out", "{tmp}", "--effect", "gremlins:x=1"), "gremlins"),
        (("{tmp}/bad.csv", "--out", "{tmp}"), "bad.csv"),
        (("{tmp}/bad.yaml", "--out", "{tmp}"), "bad.yaml"),
        (("{tmp}/empty", "--out", "{tmp}/x"), "empty"),
        (("paper-pavements", "--out", "{tmp}/file"), "file"),
        (("paper-rate", "--out", "{tmp}", "--seed", "3"), "paper-rate"),
        (("paper-rate", "--out", "{tmp}", "--storage", "sqlite3"), "paper-rate"),
        (("{tmp}/bad.folder.yaml", "--out", "{tmp}"), "bad.folder.yaml"),
        (("{tmp}/still.yaml", "--out", "{tmp}"), "at least 0.05 s"),
        (("{tmp}/wide.yaml", "--out", "{tmp}"), "at most 60 deg"),
        (("paper-rate", "--out", "{tmp}", "--effect", "slope_bias:torque=100"), "slope_bias"),
        (("paper-rate", "--out", "{tmp}", "--vehicle", "{tmp}/bad.yaml"), "bad.yaml"),
    ],
)
def test_bad_input_ends_with_one_line(tmp_path: Path, arguments: tuple[str, ...], wanted: str) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").write_text("not a folder", encoding="utf-8")
    (tmp_path / "bad.csv").write_text("time_s,angle_deg\n0,a\n1,2\n", encoding="utf-8")
    (tmp_path / "bad.yaml").write_text("segments: 3", encoding="utf-8")
    (tmp_path / "bad.folder.yaml").mkdir()
    (tmp_path / "still.yaml").write_text("segments: [{sweep: {to_deg: 0, rate_deg_s: 5}}]", encoding="utf-8")
    chirp = "{chirp: {amplitude_deg: 60, from_Hz: 0.1, to_Hz: 0.2, duration_s: 10}}"
    (tmp_path / "wide.yaml").write_text(f"segments: [{{sweep: {{to_deg: 60, rate_deg_s: 20}}}}, {chirp}]", encoding="utf-8")
    code, _, err = invoke(*(a.format(tmp=tmp_path) for a in arguments))
    assert code == 2
    assert err.count("\n") == 1
    assert wanted in err


def test_an_experiment_that_fails_gives_exit_code_1(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code, out, _ = invoke("paper-pavements", "--out", str(tmp_path), "--json")
    assert code == 0
    assert json.loads(out)["passed"] is True
    failed = Outcome("paper-pavements", "t", ("a",), ((1.0,),), (Check("c", "p", "o", False),), ())
    monkeypatch.setitem(EXPERIMENTS, "paper-pavements", ("", lambda _: failed))
    monkeypatch.setattr(command, "write_outcomes", lambda _what, outcomes, *_: {"passed": outcomes[0].passed})
    assert invoke("paper-pavements", "--out", str(tmp_path))[0] == 1


@pytest.mark.parametrize("moment", ["write.Writer.write", "figure.draw_simulation"])
def test_an_interrupted_recording_can_be_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    vehicle, slower = command.load_vehicle(None), {"angle_rate_Hz": 20.0, "pressure_rate_Hz": 20.0}
    with monkeypatch.context() as patch:
        patch.setattr(f"lugre_steering.simulate.{moment}", interrupted)
        with pytest.raises(KeyboardInterrupt):
            command.run_manoeuvre("small-loops", vehicle, tmp_path, slower)
    assert not [path for path in tmp_path.iterdir() if path.suffix != ".png"]
    command.run_manoeuvre("small-loops", vehicle, tmp_path, slower)
    with pytest.raises(DataError, match="exists already"):
        command.run_manoeuvre("small-loops", vehicle, tmp_path, slower)


def test_the_examples_are_written_with_equal_bytes(tmp_path: Path) -> None:
    example = examples.EXAMPLES[0]
    for name in ("one", "two"):
        examples.write_example(example, tmp_path / name)
    for path in (tmp_path / "one" / example.name).iterdir():
        assert path.read_bytes() == (tmp_path / "two" / example.name / path.name).read_bytes()


def test_the_shipped_examples_are_small_and_labelled() -> None:
    folder = Path(__file__).resolve().parents[2] / "bags"
    assert sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) < 6_000_000
    for example in examples.EXAMPLES:
        assert "synthetic" in (folder / example.name / "metadata.yaml").read_text(encoding="utf-8")
