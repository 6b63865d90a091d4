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
import yaml
from bag_making import thinned_bag
from typer.testing import CliRunner

import lugre_steering
from lugre_steering.cli import app
from lugre_steering.provenance import provenance
from lugre_steering.vehicle import load, save

VEHICLE_FILE = Path(__file__).resolve().parents[1] / "config" / "test_vehicle.yaml"


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """At 20 Hz, which is quicker to calibrate and to diagnose."""
    return thinned_bag(VEHICLE_FILE.parents[1] / "bags" / "synthetic_double_cycle", tmp_path_factory.mktemp("slow"))


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


def test_recordings_tell_it(out: Path, tmp_path: Path) -> None:
    """Those that are simulated, imported and replayed, in their metadata."""
    table, mapped = tmp_path / "log.csv", tmp_path / "map.yaml"
    table.write_text("time [s],angle left [deg],p main a [bar]\n" + "".join(f"{0.01 * i:.2f},{0.1 * i:.1f},50\n" for i in range(200)))
    for arguments in (
        ["simulate", "chirp", "--vehicle", VEHICLE_FILE, "--seed", "3", "--effect", "yaw_inertia:inertia=500", "--out", tmp_path],
        ["import", table, "--propose", "--map", mapped],
        ["import", table, "--map", mapped, "--out", tmp_path / "imported"],
    ):
        done = CliRunner().invoke(app, [str(argument) for argument in arguments])
        assert done.exit_code == 0, done.output
    proposed = mapped.read_text()
    assert f"# lugre_steering {lugre_steering.__version__} import --propose" in proposed
    assert sha256(table) in proposed
    for folder, told in (
        (tmp_path / "synthetic_chirp", ("simulate", "seed = 3", "yaw_inertia:inertia=500", sha256(VEHICLE_FILE))),
        (tmp_path / "imported", ("import", sha256(table), sha256(mapped))),
        (out / "replay" / "synthetic_double_cycle", ("replay", "feed_forward_horizon_s = 0.25", sha256(VEHICLE_FILE))),
    ):
        made = yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]["custom_data"]["made"]
        for words in (f"lugre_steering {lugre_steering.__version__}", *told):
            assert words in made


def test_pictures_of_simulations_sheets_and_effects_tell_it(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("matplotlib")
    for command, name in (
        (["vehicle", VEHICLE_FILE], "footprint.png"), (["effects", "end_stop"], "end_stop.png"),
        (["simulate", "chirp", "--vehicle", VEHICLE_FILE], "synthetic_chirp.png"),
    ):  # fmt: skip
        done = CliRunner().invoke(app, [*map(str, command), "--out", str(tmp_path / command[0])])
        assert done.exit_code == 0, done.output
        with image.open(tmp_path / command[0] / name) as picture:
            assert f"lugre_steering {lugre_steering.__version__} {command[0]}" in picture.info["Comment"]
            assert VEHICLE_FILE not in command or sha256(VEHICLE_FILE) in picture.info["Comment"]


def test_a_vehicle_file_that_was_begun_tells_it(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["vehicle", str(tmp_path / "own.yaml"), "--new", "--yes"])
    assert done.exit_code == 0, done.output
    assert f"# lugre_steering {lugre_steering.__version__} vehicle --new, 20" in (tmp_path / "own.yaml").read_text()
