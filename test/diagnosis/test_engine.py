# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Diagnosis where nothing is hidden, where no entry is right, and where the data do not do."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from bag_making import SLOWEST
from hidden_cases import VEHICLE, cut, made, read
from remembering import same_signals_once
from small_problem import effect, small_problem, weight

import lugre_steering as ls
from lugre_steering.calibration import coverage
from lugre_steering.diagnosis import engine
from lugre_steering.diagnosis.engine import diagnose, diagnose_recordings
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.effects import registry
from lugre_steering.errors import BagError
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.sheet import WrongSheet
from lugre_steering.proof.simulator import Concealed
from lugre_steering.recording import Array
from lugre_steering.simulate.manoeuvres import Hold, Manoeuvre, Sweep
from lugre_steering.vehicle import load


@pytest.fixture(scope="module", autouse=True)
def _same_signal_once() -> Iterator[None]:
    """Where nothing is hidden, tracks turn the same way under any noise."""
    with same_signals_once():
        yield


@pytest.mark.parametrize("noise", ["white", "coloured", "ripple"])
def test_silent_when_nothing_is_hidden(tmp_path: Path, noise: str) -> None:
    _, bags = made(tmp_path, seed=21, noise=noise)
    result = diagnose_recordings(read(bags), load(VEHICLE))
    assert result.json["verdict"] == "consistent"
    assert result.json["effects"] == []
    assert result.json["augmented"]["heldout_rmse_Nm"] == result.json["baseline"]["heldout_rmse_Nm"]
    assert result.json["detection_limits"]["end_stop"]["smallest"] > 0.0


def test_without_the_right_entry_a_law_of_the_angle_takes_its_place(tmp_path: Path) -> None:
    _, bags = made(tmp_path, Concealed("end_stop"), seconds=50.0, stride=SLOWEST)
    result = ls.diagnose(bags, VEHICLE, without="end_stop")
    assert "end_stop" not in result.json["detection_limits"]
    assert registry.sought(registry.effect("end_stop"))  # by the next diagnosis again
    assert result.json["verdict"] == "unlisted_physics"
    assert result.json["effects"] == []
    (law,) = result.json["laws"]
    assert law["coordinate"] in ("angle", "abs_angle")
    before, after, noise = (
        error**2 for error in (
            result.json["baseline"]["heldout_rmse_Nm"], result.json["augmented"]["heldout_rmse_Nm"], result.json["noise_floor_Nm"],
        )
    )  # fmt: skip
    assert (before - after) / (before - noise) > 0.9


def test_a_name_to_be_left_out_must_be_one() -> None:
    with pytest.raises(ls.LugreSteeringError, match="did you mean 'end_stop'"):
        ls.diagnose([], VEHICLE, without="end_stopp")


def test_physics_outside_the_catalogue_is_unlisted(tmp_path: Path) -> None:
    _, bags = made(tmp_path, Concealed("gear_ripple"), seconds=45.0)
    result = diagnose_recordings(read(bags[:1]), load(VEHICLE))
    assert result.json["verdict"] == "unlisted_physics"
    assert result.json["unexplained"]["structured"]
    assert "theta" in result.json["unexplained"]["formula"]
    assert result.json["next_experiment"] is not None


def test_a_recording_counts_once_and_names_are_told_apart(tmp_path: Path) -> None:
    first, second = made(tmp_path, seed=21, seconds=40.0, stride=SLOWEST)[1]
    copy = shutil.copytree(first, tmp_path / "copy")
    inside = next(file for file in first.iterdir() if file.name != "metadata.yaml")
    for again in (first, inside, copy):
        with pytest.raises(BagError, match=f"{again.name}: holds the same recording as .*{first.name};"):
            diagnose([first, second, again], load(VEHICLE))
    twin = tmp_path / "other" / first.name
    twin.parent.mkdir()
    second.rename(twin)
    result = diagnose([first, twin], load(VEHICLE))
    assert result.json["verdict"] == "consistent"
    assert result.json["bags"] == [first.name, f"{first.name}_2"]


def test_too_short_a_recording_is_insufficient_and_says_what_to_drive(tmp_path: Path) -> None:
    vehicle = load(VEHICLE)
    _, bags = made(tmp_path, seed=21, seconds=3.0)
    result = diagnose_recordings(read(bags[:1]), vehicle)
    assert result.json["verdict"] == "insufficient_data"
    assert "double-cycle" in result.json["next_experiment"]["manoeuvre"]
    assert result.vehicle == vehicle


def test_the_angle_between_the_tracks_is_no_motion() -> None:
    """A wiggle at full lock: inner and outer track stand far apart, and neither moves."""
    vehicle = load(VEHICLE)
    parts = (Sweep(30.0, 10.0, 1.0), Hold(4.0), *(Sweep(end, 2.0, 1.0) for end in (26.0, 30.0) * 10))
    whole = coverage.record(vehicle, [Manoeuvre("wiggle", "", parts)], 3)[0]
    result = diagnose_recordings([cut(whole, np.inf, since_s=6.0)], vehicle)
    assert result.json["verdict"] == "insufficient_data"
    assert "presliding lengths" in result.json["statement"]


@pytest.mark.parametrize(("zero", "told"), [(0.09, "5.2 deg"), (-0.09, "-5.2 deg"), (0.02, None)])
def test_angles_far_from_their_zero_are_no_physics(zero: float, told: str | None) -> None:
    """A hidden offset of a degree is named; five degrees are a sensor put on wrongly, and nothing is named before that is right."""
    problem = small_problem(40.0)
    final = fit(problem, weight(problem), [effect("angle_offset", offset=zero)], linearisations=1)
    left = 3.0 * (problem.measured - final.prediction)
    final = replace(final, effects=(effect("angle_offset", offset=zero),), prediction=problem.measured - left)

    def misplaced(left_without: Array) -> WrongSheet | None:
        found = SimpleNamespace(final=final, baseline=replace(final, prediction=problem.measured - left_without))
        return engine._misplaced(cast(Finished, SimpleNamespace(problem=problem, found=found, fitted=weight(problem))))

    wrong = misplaced(10.0 * left)
    assert (wrong is None) == (told is None)
    assert wrong is None or (told in wrong.statement and "zero of the angle sensors" in wrong.statement)
    assert misplaced(1.1 * left) is None, "an offset that explains little only resembles what is there"
