# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A real ball screw drive, the EMPS benchmark; needs the user's own copy of the data (folder in LUGRE_STEERING_EMPS).

Published reference model (Janot, Gautier, Brunot 2019): M = 95.11 kg, Fv = 203.5 N s/m, Fc = 20.39 N, offset -3.16 N.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from outside import outside
from scipy.io import loadmat

import lugre_steering as ls
from lugre_steering import vehicle as vehicle_file
from lugre_steering.bag import read_recording
from lugre_steering.data.bursts import all_bursts, set_aside
from lugre_steering.data.dataset import Run, prepare
from lugre_steering.diagnosis.investigate import investigate
from lugre_steering.diagnosis.search.search import Search
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.split import Split
from lugre_steering.importing import import_table
from lugre_steering.simulate.manoeuvres import BUILT_IN, motion_of
from lugre_steering.simulate.run import sensing_of, simulate

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("LUGRE_STEERING_EMPS", outside("real/emps")))
VEHICLE = ROOT / "config" / "emps_vehicle.yaml"
QUIET, PULSES = "DATA_EMPS", "DATA_EMPS_PULSES"

needs_data = pytest.mark.skipif(not (DATA / f"{QUIET}.mat").is_file(), reason="no EMPS data (LUGRE_STEERING_EMPS)")


def test_the_shipped_vehicle_file_describes_a_linear_axis_without_inertia() -> None:
    vehicle = vehicle_file.load(VEHICLE)
    assert (vehicle.coordinate.unit, vehicle.coordinate.force_unit) == ("m", "N")
    run = simulate(vehicle, motion_of(BUILT_IN["small-loops"], vehicle), sensing_of(vehicle))
    assert float(np.abs(run.truth.torque).max()) < 25.0  # friction alone


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("emps")
    for name in (QUIET, PULSES):
        import_table(DATA / f"{name}.mat", ROOT / "config" / "emps_map.yaml", folder / name)
    return folder


@pytest.fixture(scope="module")
def runs(bags: Path) -> dict[str, Run]:
    vehicle = vehicle_file.load(VEHICLE)
    return {name: prepare(read_recording(bags / name, vehicle.channels), vehicle) for name in (QUIET, PULSES)}


def diagnosed(runs: Sequence[Run]) -> tuple[Problem, Split, Search]:
    problem = Problem(vehicle_file.load(VEHICLE), runs)
    done = investigate(problem, seed=1)
    return problem, done.roles, done.found


def residual(problem: Problem, found: Search) -> np.ndarray:
    return problem.measured - found.final.prediction


@pytest.fixture(scope="module")
def quiet(runs: dict[str, Run]) -> tuple[Problem, Split, Search]:
    return diagnosed([runs[QUIET]])


def values(problem: Problem, found: Search) -> dict[str, float]:
    """Mass, viscous friction, Coulomb friction and offset, whatever of equal rivals was named."""
    result = {"Fc": float(problem.fields(found.final.x)["coulomb_torque"])}
    for candidate, numbers in found.final.effects:
        name = candidate.effect.id
        if name == "yaw_inertia":
            result["M"] = numbers["inertia"]
        elif name in ("viscous_friction", "line_loss_linear"):
            result["Fv"] = next(iter(numbers.values()))
        elif name == "direction_asymmetry":  # friction that differs by direction is an offset while the axis moves
            result["offset"] = numbers["asymmetry"] * result["Fc"]
        elif name == "slope_bias":
            result["offset"] = numbers["torque"]
    return result


def check_published(found: dict[str, float]) -> None:
    """Within a few per cent of numbers that others got from the same recording with another method."""
    assert found["M"] == pytest.approx(95.11, rel=0.03)
    assert found["Fv"] == pytest.approx(203.5, rel=0.05)
    assert found["Fc"] == pytest.approx(20.39, rel=0.06)
    assert found["offset"] == pytest.approx(-3.16, abs=0.3)


@needs_data
def test_it_discovers_what_the_literature_needed(quiet: tuple[Problem, Split, Search]) -> None:
    problem, roles, found = quiet
    check_published(values(problem, found))
    held = roles.held
    before = float(np.sqrt(np.mean((problem.measured - found.baseline.prediction)[held] ** 2)))
    after = float(np.sqrt(np.mean(residual(problem, found)[held] ** 2)))
    assert after < 0.08 * before
    last = found.found[-1]
    assert {found.final.effects[-1][0].effect.id, *last.rivals} >= {
        "direction_asymmetry",
        "slope_bias",
    }  # a tie, and said so


@needs_data
def test_it_predicts_unseen_data_as_well_as_the_published_model(quiet: tuple[Problem, Split, Search]) -> None:
    problem, roles, found = quiet
    run = problem.runs[0]
    published = 95.11 * run.alpha[0] + 203.5 * run.omega[0] + 20.39 * np.sign(run.omega[0]) - 3.16
    reference = float(np.sqrt(np.mean((run.measured - published)[roles.held] ** 2)))
    assert float(np.sqrt(np.mean(residual(problem, found)[roles.held] ** 2))) < 1.05 * reference


@needs_data
def test_the_second_recording_holds_pulses_where_its_own_channel_says(
    runs: dict[str, Run], quiet: tuple[Problem, Split, Search]
) -> None:
    assert all_bursts(quiet[0].runs, [residual(quiet[0], quiet[2])]) == [None]
    problem, _, found = diagnosed([runs[PULSES]])
    (bursts,) = all_bursts(problem.runs, [residual(problem, found)])
    assert bursts is not None
    assert bursts.period_s == pytest.approx(0.5, abs=0.01)
    content = loadmat(DATA / f"{PULSES}.mat", squeeze_me=True)
    edges = content["t"][np.flatnonzero(np.diff(content["pulses_N"].astype(int)))]
    middle = np.array([0.5 * (a + b) for a, b in bursts.intervals])
    assert np.mean(np.abs(middle[:, None] - edges).min(axis=1) < 0.03) > 0.9
    assert np.mean(np.abs(edges[:, None] - middle).min(axis=1) < 0.03) > 0.8
    cleaned, findings = set_aside(problem.runs, [residual(problem, found)])
    assert "every 0.50 s" in findings[PULSES].statement
    problem, _, found = diagnosed(cleaned)
    check_published(values(problem, found))  # the axis is the same


@needs_data
@pytest.mark.parametrize("name", [QUIET, PULSES])
def test_no_law_takes_the_place_of_what_the_literature_found(bags: Path, name: str) -> None:
    """As a user runs it: what is left over is more than noise, and laws that follow it had moved viscous friction by a third."""
    result = ls.diagnose(bags / name, VEHICLE).json
    assert result["laws"] == []
    held = {effect["id"]: next(iter(effect["parameters"].values()))["ci95"] for effect in result["effects"]}
    for id_, published in {"yaw_inertia": 95.11, "viscous_friction": 203.5, "slope_bias": -3.16}.items():
        low, high = held.pop(id_)
        assert low < published < high
    assert not held
    assert result["augmented"]["heldout_rmse_Nm"] < 0.065 * result["baseline"]["heldout_rmse_Nm"]


@needs_data
def test_without_viscous_friction_a_law_of_the_rate_takes_its_place(bags: Path) -> None:
    """As the page on real data says; the published model is the oracle of the law."""
    result = ls.diagnose(bags / QUIET, VEHICLE, without="viscous_friction").json
    assert {effect["id"] for effect in result["effects"]} >= {"yaw_inertia"}
    (law,) = result["laws"]
    assert (law["channel"], law["coordinate"], law["form"]) == ("viscous_loss", "rate", "linear")
    assert law["values"]["value"] == pytest.approx(203.5, rel=0.02)
    assert result["augmented"]["heldout_rmse_Nm"] < 0.065 * result["baseline"]["heldout_rmse_Nm"]  # 2.54 of 39.3 N is the published one's
