# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What is hidden is named, placed and fitted, and what was written runs in replay; one effect of each stage."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bag_making import SLOWEST, STRIDE, slowly_sampled
from hidden_cases import VEHICLE, made, overlap, read
from remembering import same_signals_once
from typer.testing import CliRunner

from lugre_steering.cli import app
from lugre_steering.diagnosis.engine import diagnose_recordings
from lugre_steering.proof.simulator import Case, Concealed, load_sheet, simulate_case, write_case
from lugre_steering.vehicle import load


@pytest.fixture(scope="module", autouse=True)
def _same_signal_once() -> Iterator[None]:
    """All but one case are of one vehicle on the same way."""
    with same_signals_once():
        yield


def command(*arguments: object) -> None:
    done = CliRunner().invoke(app, list(map(str, arguments)))
    assert done.exit_code == 0, done.output


def test_hidden_end_stop_is_named_placed_fitted_and_runs_in_replay(tmp_path: Path) -> None:
    seconds = 70.0
    data, (bag, _) = made(tmp_path, Concealed("end_stop"), seconds=seconds, stride=SLOWEST)
    out = tmp_path / "out"
    command("diagnose", bag, "--vehicle", VEHICLE, "--out", out)
    found = json.loads((out / "diagnosis.json").read_text())
    assert found["verdict"] == "missing_physics"
    assert [e["id"] for e in found["effects"]] == ["end_stop"]
    effect = found["effects"][0]
    true = data.hidden[0].values
    # Nature's stop has a soft knee and differs by side; the knee itself is sharp to a degree.
    assert abs(effect["parameters"]["engage_angle"]["value"] - true["threshold"]) < np.radians(1.5)
    (entry,) = effect["where"]
    acting = [(since, min(until, seconds)) for since, until in data.bags[0].intervals["end_stop"] if since < seconds]
    assert overlap(entry["intervals_s"], acting) > 0.7
    assert found["augmented"]["improvement_ci95"][0] > 0.5
    assert (out / "report.html").stat().st_size > 10_000
    rmse = {}
    for label, vehicle in (("before", VEHICLE), ("after", out / "augmented.yaml")):
        folder = tmp_path / label
        command("replay", bag, "--vehicle", vehicle, "--out", folder)
        summary = json.loads((folder / "summary.json").read_text())
        rmse[label] = summary["bags"][0]["fit"]["rmse_Nm"]
    assert rmse["after"] < 0.35 * rmse["before"]


@pytest.mark.parametrize(
    ("hidden", "count", "seconds", "stride"),
    [
        ("cylinder_friction", 1, 60.0, SLOWEST), ("backlash", 1, 40.0, STRIDE), ("time_delay", 2, 50.0, STRIDE),
        ("carcass_heat_sink", 2, 130.0, 2 * SLOWEST),
    ],
)  # fmt: skip
def test_one_effect_per_stage_is_named(tmp_path: Path, hidden: str, count: int, seconds: float, stride: int) -> None:
    """One minute is enough for some; heat takes two bags, though of 6 Hz, and so does a delay, to be told from a clock that differs."""
    _, bags = made(tmp_path, Concealed(hidden), seconds=seconds, stride=stride)
    result = diagnose_recordings(read(bags[:count]), load(VEHICLE))
    assert result.json["verdict"] == "missing_physics"
    assert [effect["id"] for effect in result.json["effects"]] == [hidden]
    assert result.json["augmented"]["improvement_ci95"][0] > 0.0


def test_two_names_of_which_each_keeps_the_other_in_doubt_are_found_together(tmp_path: Path) -> None:
    """The slow error that a drift leaves makes a small asymmetry doubtful, and the other way round."""
    effects = Concealed("direction_asymmetry", 0.1066), Concealed("pressure_drift", 0.7687)  # each as large as the noise
    case = simulate_case(Case(3048347980, effects, "coloured"), load_sheet(VEHICLE))
    bags = write_case(slowly_sampled(case), tmp_path / "seen", tmp_path / "unseen")
    result = diagnose_recordings(read(bags), load(VEHICLE))
    assert {effect["id"] for effect in result.json["effects"]} == {effect.id for effect in effects}
