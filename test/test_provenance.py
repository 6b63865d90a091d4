# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Every result says by what version, when, with what options and from which files it was made. All data are synthetic."""

from __future__ import annotations

import hashlib
import json
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import lugre_steering
from lugre_steering.cli import app
from lugre_steering.provenance import provenance
from lugre_steering.vehicle import load, save

VEHICLE_FILE = Path(__file__).resolve().parents[1] / "config" / "test_vehicle.yaml"


@pytest.fixture(scope="module")
def bag() -> Path:
    return VEHICLE_FILE.parents[1] / "bags" / "synthetic_double_cycle"


@pytest.fixture(scope="module")
def out(bag: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("matplotlib")
    folder = tmp_path_factory.mktemp("out")
    for command, extra in (("replay", ["--horizon", "0.25"]), ("calibrate", ["--fix", "cooling"]), ("diagnose", ["--seed", "5"])):
        arguments = [command, str(bag), "--vehicle", str(VEHICLE_FILE), "--out", str(folder / command), *extra]
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
    return folder


def sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("command", "record", "option", "value"),
    [("replay", "summary.json", "feed_forward_horizon_s", 0.25), ("calibrate", "calibration.json", "fix", ["cooling"]),
     ("diagnose", "diagnosis.json", "seed", 5)],
)  # fmt: skip
def test_records_hold_it(bag: Path, out: Path, command: str, record: str, option: str, value: object) -> None:
    made: dict[str, Any] = json.loads((out / command / record).read_text())["provenance"]
    assert (made["tool"], made["command"]) == (f"lugre_steering {lugre_steering.__version__}", command)
    assert datetime.now(timezone.utc) - datetime.fromisoformat(made["date"]) < timedelta(hours=1)
    assert made["options"][option] == value
    assert made["vehicle"] == {"path": str(VEHICLE_FILE), "sha256": {VEHICLE_FILE.name: sha256(VEHICLE_FILE)}}
    assert made["bags"] == [{"path": str(bag), "sha256": {file.name: sha256(file) for file in sorted(bag.iterdir())}}]


@pytest.mark.parametrize(("command", "file"), [("calibrate", "calibrated.yaml"), ("diagnose", "augmented.yaml")])
def test_vehicle_files_tell_it_in_comments_and_are_read_as_ever(bag: Path, out: Path, command: str, file: str) -> None:
    comments = [line for line in (out / command / file).read_text().splitlines() if line.startswith("# ")]
    said = "\n".join(comments)
    for words in (f"lugre_steering {lugre_steering.__version__} {command}", *map(sha256, bag.iterdir()), sha256(VEHICLE_FILE), "options: "):
        assert words in said
    assert load(out / command / file).name == load(VEHICLE_FILE).name


@pytest.mark.parametrize(("command", "page"), [("replay", "synthetic_double_cycle.html"), ("diagnose", "report.html")])
def test_pages_tell_it(out: Path, bag: Path, command: str, page: str) -> None:
    source = (out / command / page).read_text().replace("\u00a0", " ")
    for words in (f"lugre_steering {lugre_steering.__version__}", sha256(VEHICLE_FILE), *map(sha256, bag.iterdir())):
        assert words in source


def test_pictures_tell_it(out: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    pictures = sorted(out.rglob("*.png"))
    assert len(pictures) >= 4
    for file in pictures:
        with image.open(file) as picture:
            assert f"lugre_steering {lugre_steering.__version__} {file.parent.name}" in picture.info["Comment"], file
            assert sha256(VEHICLE_FILE) in picture.info["Comment"]


def test_names_of_files_cannot_break_out_of_a_comment(tmp_path: Path) -> None:
    sheet = tmp_path / "a\nname: stolen\x07é.yaml"
    sheet.write_text("x")
    written = tmp_path / "own.yaml"
    save(load(VEHICLE_FILE), written, provenance("calibrate", {}, sheet).lines())
    assert load(written).name == load(VEHICLE_FILE).name
