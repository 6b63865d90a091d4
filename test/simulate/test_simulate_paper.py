# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The published experiments pass on the shipped vehicle, and fail when the physics that they show is taken away."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lugre_steering import vehicle as vehicle_file
from lugre_steering.errors import DataError
from lugre_steering.provenance import provenance
from lugre_steering.resources import config_folder
from lugre_steering.schemas import schema_of
from lugre_steering.simulate.command import write_outcomes
from lugre_steering.simulate.paper import ALL, EXPERIMENTS, bench, conditions, double_cycle, stiffness
from lugre_steering.simulate.paper.result import PublishedExperiment, PublishedExperiments
from lugre_steering.vehicle import pavements

VEHICLE = vehicle_file.load(config_folder() / "test_vehicle.yaml")


@pytest.fixture(scope="module")
def prepared() -> bench.Bench:
    return bench.build(VEHICLE)


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_each_experiment_passes(name: str, prepared: bench.Bench) -> None:
    outcome = EXPERIMENTS[name][1](prepared)
    assert outcome.name == name
    assert outcome.passed, outcome.caption
    assert all(len(row) == len(outcome.columns) for row in outcome.rows)


def test_calibration_moves_only_friction_level_and_heat_capacity(prepared: bench.Bench) -> None:
    level, capacity = (prepared.calibrated[f"{name} factor"] for name in ("friction level", "heat capacity"))
    assert prepared.vehicle == bench.scaled(VEHICLE, level, capacity)
    assert 0.8 < level < 1.2
    assert 0.5 < capacity < 1.5


def test_published_extremes_are_the_papers() -> None:
    assert bench.PUBLISHED_EXTREMES_NM == (49980.0, 48740.0, 48580.0, 46510.0)


def test_without_heating_nothing_declines(prepared: bench.Bench) -> None:
    cold = bench.Bench(bench.scaled(prepared.vehicle, 1.0, 1e6), prepared.calibrated)
    assert not double_cycle.double_cycle(cold).checks[0].passed
    assert not conditions.six_cycles(cold).passed
    assert not conditions.ambient(cold).checks[1].passed


def test_friction_that_does_not_know_temperature_fails_the_ambient_sweep(prepared: bench.Bench) -> None:
    with pytest.raises(DataError, match="rubber"):
        bench.build(VEHICLE.replace(rubber=None))
    assert not conditions.ambient(bench.Bench(bench.original(prepared.vehicle), prepared.calibrated)).passed


def test_without_heat_and_stribeck_curve_the_rate_makes_no_difference(prepared: bench.Bench) -> None:
    assert prepared.vehicle.friction is not None
    flat = dataclasses.replace(prepared.vehicle.friction, static=prepared.vehicle.friction.coulomb)
    vehicle = bench.original(prepared.vehicle.replace(friction=flat))
    assert not conditions.rate(bench.Bench(vehicle, prepared.calibrated)).passed


def test_a_wrong_pavement_table_fails_the_ranking(prepared: bench.Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    table = {name: dict(row) for name, row in pavements().items()}
    table["gravel"], table["dry_earth"] = table["dry_earth"], table["gravel"]
    monkeypatch.setattr(conditions, "pavements", lambda: table)
    assert not conditions.pavement(prepared).checks[0].passed


def test_no_stop_no_rise(prepared: bench.Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    stop = double_cycle.limit_device()
    soft = dataclasses.replace(stop, parameters={**stop.parameters, "stiffness": 0.0, "cubic_stiffness": 0.0})
    monkeypatch.setattr(double_cycle, "limit_device", lambda: soft)
    assert not double_cycle.limit_stop(prepared).passed


def test_presliding_angle_solves_the_bristle_equation() -> None:
    sigma, static = 3.1e5, 2.8e4
    angle = float(stiffness.presliding_angle(np.array([0.6 * static]), sigma, static)[0])
    solved = solve_ivp(lambda _, z: 1.0 - sigma * z / static, (0.0, angle), [0.0], rtol=1e-10, atol=1e-14)
    assert sigma * solved.y[0, -1] == pytest.approx(0.6 * static, rel=1e-8)


def test_a_softer_contact_fails_the_stiffness(prepared: bench.Bench) -> None:
    assert prepared.vehicle.friction is not None
    soft = dataclasses.replace(prepared.vehicle.friction, stiffness_Nm_per_deg=5200.0)
    assert not stiffness.stiffness(bench.Bench(prepared.vehicle.replace(friction=soft), prepared.calibrated)).passed


def test_results_are_written(prepared: bench.Bench, tmp_path: Path) -> None:
    outcome = stiffness.stiffness(prepared)
    made = provenance("simulate", {"paper": True}, config_folder() / "test_vehicle.yaml")
    write_outcomes("paper-stiffness", [outcome], tmp_path, made)
    result = json.loads((tmp_path / "paper-stiffness.json").read_text(encoding="utf-8"))
    jsonschema.validate(result, schema_of(PublishedExperiment))
    keys = ("schema", "experiment", "title", "synthetic", "passed", "calibrated", "checks", "table", "notes", "caption", "provenance")
    assert tuple(result) == keys
    assert list(result["table"][0]) == list(outcome.columns)
    assert list(result["checks"][0]) == ["claim", "published", "ours", "passed"]
    assert result["synthetic"] is True
    assert result["passed"] is True
    assert result["calibrated"]["heat capacity factor"] == prepared.calibrated["heat capacity factor"]
    # F / theta of the exact LuGre presliding curve at 60 % of break-away: 0.6 / -ln(0.4) = 0.655 of the stiffness.
    assert "34 % below" in result["caption"]
    assert (tmp_path / "paper-stiffness.png").read_bytes().startswith(b"\x89PNG")
    lines = (tmp_path / "paper-stiffness.csv").read_text(encoding="utf-8").splitlines()
    told = [line for line in lines if line.startswith("# ")]
    assert "simulated" in told[0]
    assert [line.removeprefix("# ") for line in told[1:]] == made.lines()
    header, *rows = csv.reader(lines[len(told) :])
    assert tuple(header) == outcome.columns
    assert [[float(cell) for cell in row] for row in rows] == [pytest.approx(row, rel=1e-5) for row in outcome.rows]


def test_several_are_told_together_and_keep_to_their_schema(prepared: bench.Bench, tmp_path: Path) -> None:
    outcome = stiffness.stiffness(prepared)
    failed = dataclasses.replace(outcome, name="failed", checks=(dataclasses.replace(outcome.checks[0], passed=False),), rows=())
    made = provenance("simulate", {"paper": True}, config_folder() / "test_vehicle.yaml")
    told = write_outcomes(ALL, [outcome, failed], tmp_path, made)
    files = {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in tmp_path.glob("*.json")}
    assert files == {ALL: told, **{one["experiment"]: one for one in told["experiments"]}}
    assert list(told) == ["schema", "passed", "picture_note", "experiments", "provenance"]
    assert [one["passed"] for one in (told, *told["experiments"])] == [False, True, False]
    schema = jsonschema.Draft202012Validator(schema_of(PublishedExperiments))
    assert schema.is_valid(told)
    one = told["experiments"][0]
    for wrong in (one | {"passed": "yes"}, one | {"calibrated": [1.0]}, one | {"table": [{"torque": None}, {"torque": []}]}):
        assert not schema.is_valid(told | {"experiments": [wrong]})
    assert not schema.is_valid(one)  # which is of one alone


def test_a_table_of_others_stays_and_ours_is_replaced(prepared: bench.Bench, tmp_path: Path) -> None:
    outcome, table = stiffness.stiffness(prepared), tmp_path / "paper-stiffness.csv"
    theirs = ",".join(outcome.columns) + "\n1,2,3\n"
    table.write_text(theirs)
    with pytest.raises(DataError, match=r"paper-stiffness\.csv: exists and is not part of an earlier result"):
        write_outcomes("paper-stiffness", [outcome], tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == [table.name]
    assert table.read_text() == theirs
    table.unlink()
    for _ in range(2):
        write_outcomes("paper-stiffness", [outcome], tmp_path)
