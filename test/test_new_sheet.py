# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""`vehicle --new`: a sheet from questions, which loads and replays wherever it is moved."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lugre_steering.cli import app
from lugre_steering.sheet.new import MACHINES, begin_sheet
from lugre_steering.vehicle import Vehicle, load

ROOT = Path(__file__).resolve().parents[1]


def begun(file: Path, **answers: str | list[str]) -> tuple[Vehicle, list[str]]:
    """The sheet begun with some answers (by the last word of the question), and what was said in between."""
    said: list[str] = []
    queues = {key: [answer] if isinstance(answer, str) else list(answer) for key, answer in answers.items()}

    def ask(text: str, default: str) -> str:
        asked = text.split(" (")[0] if text.startswith(("kind", "cylinders")) else text.split(":")[0]
        queue = next((queue for key, queue in queues.items() if asked.endswith(key.replace("__", " ")) and queue), None)
        return queue.pop(0) if queue else default

    begin_sheet(file, ask, said.append)
    assert not any(queues.values()), f"never asked for: {queues}"
    return load(file), said


def test_the_proposed_values_are_the_reference_vehicle_and_replay_anywhere(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["vehicle", str(tmp_path / "own.yaml"), "--new", "--yes", "--json"])
    assert done.exit_code == 0, done.output
    assert done.stderr.splitlines()[-1] == f"written: {tmp_path / 'own.yaml'}, {tmp_path / 'own_rubber.csv'}"
    assert json.loads(done.stdout)["warnings"] == []
    moved = tmp_path / "moved"
    moved.mkdir()
    for file in ("own.yaml", "own_rubber.csv"):
        (tmp_path / file).rename(moved / file)
    assert load(moved / "own.yaml") == load(ROOT / "config/test_vehicle.yaml")
    bag = str(ROOT / "bags/synthetic_double_cycle")
    done = CliRunner().invoke(app, ["replay", bag, "--vehicle", str(moved / "own.yaml"), "--out", str(tmp_path / "out"), "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["overall"]["r2"] > 0.99


@pytest.mark.parametrize("kind", MACHINES)
def test_every_kind_of_machine_can_be_begun(kind: str, tmp_path: Path) -> None:
    vehicle, said = begun(tmp_path / "own.yaml", kind__of__machine=kind)
    assert said == []
    assert vehicle.coordinate.unit == ("m" if kind == "axis" else "rad")
    assert (tmp_path / "own_rubber.csv").exists() == (kind == "tracks")


def test_answers_arrive_and_the_right_side_mirrors_the_left(tmp_path: Path) -> None:
    vehicle, _ = begun(
        tmp_path / "own.yaml", track="1", x_m="-0.5, 0, 0.5", pavement="gravel", load_N="7e4",
        **{"left_main.chassis_m": "[-0.6, -0.7]", "left_main.bore_m": "0.1"},
    )  # fmt: skip
    assert vehicle.axle is not None
    assert vehicle.track is not None
    assert vehicle.friction is not None
    assert vehicle.hydraulics is not None
    assert vehicle.axle.load_N == 70_000.0
    assert vehicle.track.rollers.load_share == pytest.approx((1 / 3, 1 / 3, 1 / 3))
    assert (vehicle.friction.static, vehicle.friction.coulomb) == (0.60, 0.55)
    assert vehicle.hydraulics.lines == ("main_a", "main_b")
    right = vehicle.hydraulics.cylinders["right_main"]
    assert (right.chassis_m, right.bore_m, right.cap) == ((-0.6, 0.7), 0.1, "main_b")


def test_a_wrong_answer_is_told_and_asked_for_again(tmp_path: Path) -> None:
    vehicle, said = begun(
        tmp_path / "own.yaml", kind__of__machine=["car", "tracks"], load_N=["heavy", "0", "80000"],
        load_share=["1, 1, 1, 1", "0.25, 0.25, 0.25, 0.25"],
        dma_csv=["absent.csv", str(ROOT / "config/rubber_dma_10hz.csv")],
    )  # fmt: skip
    assert [any(word in line for line in said) for word in ("'car'", "'heavy'", "from 1 to 1e+07", "sum to 1", "absent.csv")] == [True] * 5
    assert vehicle.axle is not None
    assert vehicle.axle.load_N == 80_000.0


@pytest.mark.parametrize("name", ["own.yaml", "own_rubber.csv"])
def test_a_file_that_is_there_stays(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("mine")
    done = CliRunner().invoke(app, ["vehicle", str(tmp_path / "own.yaml"), "--new", "--yes"])
    assert (done.exit_code, (tmp_path / name).read_text()) == (2, "mine")
    assert name in done.stderr


def test_leaving_in_between_writes_nothing(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["vehicle", str(tmp_path / "own.yaml"), "--new"], input="tracks\n")
    assert done.exit_code == 1
    assert list(tmp_path.iterdir()) == []
