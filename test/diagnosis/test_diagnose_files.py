# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The folder that ``diagnose`` writes: nothing of an earlier diagnosis stays, nothing of anybody else is lost."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lugre_steering.bag import BagWriter, Part, cdr
from lugre_steering.calibration import coverage
from lugre_steering.diagnosis.command import run
from lugre_steering.errors import LugreSteeringError
from lugre_steering.files import MARKS
from lugre_steering.recording import Kind
from lugre_steering.resources import config_folder
from lugre_steering.simulate.manoeuvres import Hold, Manoeuvre
from lugre_steering.vehicle import load

SHEET = config_folder() / "test_vehicle.yaml"


@pytest.fixture(scope="module")
def parked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag without motion: diagnosed at once, as data that do not decide."""
    vehicle = load(SHEET)
    recording = coverage.record(vehicle, [Manoeuvre("parked", "", (Hold(12.0),))], 1)[0]
    folder = tmp_path_factory.mktemp("bags") / "parked"
    with BagWriter(folder) as writer:
        parts = []
        for channel in vehicle.channels:
            if channel.kind is Kind.AIR_TEMPERATURE:
                continue
            signal = (recording.angle if channel.kind is Kind.ANGLE else recording.pressure)[channel.name]
            stamps = 1_780_000_000 * 10**9 + (1e9 * signal.time_s).round().astype("int64")
            if channel.kind is Kind.ANGLE:
                kind, rows = cdr.JOINT_STATE, cdr.encode_joint_state(stamps, "f", [channel.joint], signal.value[:, None])
            else:
                kind, rows = cdr.FLUID_PRESSURE, cdr.encode_fluid_pressure(stamps, "f", signal.value)
            parts.append(Part(writer.add_topic("/" + channel.topic, kind), stamps, rows))
        writer.write(parts)
    return folder


def test_a_folder_in_the_place_of_a_result_is_named(parked: Path, tmp_path: Path) -> None:
    run([parked], SHEET, tmp_path, report=False)
    (tmp_path / "augmented.yaml").unlink()
    (tmp_path / "augmented.yaml").mkdir()
    with pytest.raises(LugreSteeringError, match=r"augmented\.yaml: exists and is not part of"):
        run([parked], SHEET, tmp_path, report=False)


@pytest.mark.parametrize("name", ["augmented.yaml", "report.html", "evidence.png", "before_after_x.png"])
def test_a_file_without_an_earlier_result_is_somebody_elses(parked: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine", encoding="utf-8")
    with pytest.raises(LugreSteeringError, match=f"{name}: exists and is not part of an earlier result"):
        run([parked], SHEET, tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text(encoding="utf-8") == "mine"


def test_the_vehicle_file_is_never_replaced(parked: Path, tmp_path: Path) -> None:
    run([parked], SHEET, tmp_path, report=False)
    before = (tmp_path / "augmented.yaml").read_bytes()
    with pytest.raises(LugreSteeringError, match="would be replaced by the result"):
        run([parked], tmp_path / "augmented.yaml", tmp_path, report=False)
    assert (tmp_path / "augmented.yaml").read_bytes() == before


def test_a_share_that_is_no_number_is_refused(parked: Path, tmp_path: Path) -> None:
    with pytest.raises(LugreSteeringError, match="--material: got nan, expected a share"):
        run([parked], SHEET, tmp_path / "out", material=float("nan"), report=False)


def test_the_report_of_an_earlier_diagnosis_is_taken_away_and_nothing_else(parked: Path, tmp_path: Path) -> None:
    run([parked], SHEET, tmp_path, report=False)
    earlier = json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8"))
    assert earlier["verdict"] == "insufficient_data"
    earlier |= {"bags": ["a run"], "effects": [{"id": "end_stop"}]}
    (tmp_path / "diagnosis.json").write_text(json.dumps(earlier), encoding="utf-8")
    old = ["report.html", "before_after_a_run.png", "residual_end_stop.png", "evidence.png", "heldout.png"]
    others = ["my_report.html", "notes.txt", "before_after_mine.png", "residual_mine.png", "residual_end_stop.csv"]
    for name in old:
        (tmp_path / name).write_bytes(b"..." + MARKS[Path(name).suffix])
    for name in others:
        (tmp_path / name).write_text("old", encoding="utf-8")
    run([parked], SHEET, tmp_path, report=False)
    assert not any((tmp_path / name).exists() for name in old)
    assert all((tmp_path / name).is_file() for name in others)


def test_a_report_that_somebody_put_in_its_place_stays(parked: Path, tmp_path: Path) -> None:
    run([parked], SHEET, tmp_path, report=False)
    (tmp_path / "report.html").write_text("mine", encoding="utf-8")
    with pytest.raises(LugreSteeringError, match=r"report\.html: exists and is not part of an earlier result"):
        run([parked], SHEET, tmp_path, report=False)
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("content", ['{"mine": 1}', '{"schema": "other/1", "bags": [], "effects": []}', "[]", "no json"])
def test_a_result_of_something_else_is_never_replaced(parked: Path, tmp_path: Path, content: str) -> None:
    for name in ("diagnosis.json", "report.html"):
        (tmp_path / name).write_text(content, encoding="utf-8")
    with pytest.raises(LugreSteeringError, match="not part of an earlier result"):
        run([parked], SHEET, tmp_path, report=False)
    assert (tmp_path / "diagnosis.json").read_text(encoding="utf-8") == content
    assert (tmp_path / "report.html").exists()
