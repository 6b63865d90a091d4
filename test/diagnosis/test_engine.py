# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Diagnosis end to end, on recordings made by a simulator that shares no model code with it."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lugre_steering.bag import read_recording
from lugre_steering.calibration import coverage
from lugre_steering.diagnosis.engine import diagnose, diagnose_recordings
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.diagnosis.search import fingerprint
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import BagError
from lugre_steering.proof.simulator import Case, CaseData, Concealed, load_sheet, simulate_case, write_case
from lugre_steering.recording import Recording, Signal
from lugre_steering.simulate.manoeuvres import Hold, Manoeuvre, Sweep
from lugre_steering.vehicle import load

ROOT = Path(__file__).resolve().parents[2]
VEHICLE = ROOT / "config" / "test_vehicle.yaml"


def made(folder: Path, *effects: Concealed, seed: int = 7, noise: str = "white") -> tuple[CaseData, list[Path]]:
    """Two blind bags with hidden effects."""
    data = simulate_case(Case(seed, effects, noise, ("sweeps", "decaying")), load_sheet(VEHICLE))  # type: ignore[arg-type]
    return data, write_case(data, folder / "case", folder / "truth")


def thinned(bags: list[Path], stride: int = 3) -> list[Recording]:
    """The bags with every third sample: at 33 Hz a diagnosis takes a third of the time."""

    def every(signal: Signal) -> Signal:
        return Signal(signal.time_s[::stride], signal.value[::stride])

    return [
        replace(r, angle={k: every(s) for k, s in r.angle.items()}, pressure={k: every(s) for k, s in r.pressure.items()})
        for r in (read_recording(bag, load(VEHICLE).channels) for bag in bags)
    ]


def names(result: Diagnosis) -> set[str]:
    """Every name given, ties included."""
    return {name for e in result.json["effects"] for name in (e["id"], *e["indistinguishable_from"])}


def overlap(found: list[list[float]], true: list[tuple[float, float]]) -> float:
    """Intersection over union of two sets of stretches, on a 10 ms grid."""
    grid = np.arange(0.0, 400.0, 0.01)
    a, b = (np.any([(grid >= s) & (grid <= e) for s, e in spans], axis=0) for spans in (found, true))
    return float(np.sum(a & b) / np.sum(a | b))


@pytest.mark.parametrize("noise", ["white", "coloured", "ripple"])
def test_silent_when_nothing_is_hidden(tmp_path: Path, noise: str) -> None:
    _, bags = made(tmp_path, seed=21, noise=noise)
    result = diagnose_recordings(thinned(bags), load(VEHICLE))
    assert result.json["verdict"] == "consistent"
    assert result.json["effects"] == []
    assert result.json["augmented"]["heldout_rmse_Nm"] == result.json["baseline"]["heldout_rmse_Nm"]
    assert result.json["detection_limits"]["end_stop"]["smallest"] > 0.0


def test_hidden_end_stop_is_named_placed_fitted_and_runs_in_replay(tmp_path: Path) -> None:
    data, bags = made(tmp_path, Concealed("end_stop"))
    out = tmp_path / "out"
    command = [sys.executable, "-m", "lugre_steering.cli"]
    subprocess.run(
        [*command, "diagnose", *map(str, bags), "--vehicle", str(VEHICLE), "--out", str(out)], check=True, timeout=600
    )
    found = json.loads((out / "diagnosis.json").read_text())
    assert found["verdict"] == "missing_physics"
    assert [e["id"] for e in found["effects"]] == ["end_stop"]
    effect = found["effects"][0]
    true = data.hidden[0].values
    # Nature's stop has a soft knee and differs by side; the knee itself is sharp to a degree.
    assert abs(effect["parameters"]["engage_angle"]["value"] - true["threshold"]) < np.radians(1.5)
    for entry, bag in zip(effect["where"], data.bags, strict=True):
        assert overlap(entry["intervals_s"], bag.intervals["end_stop"]) > 0.7
    assert found["augmented"]["improvement_ci95"][0] > 0.5
    assert (out / "report.html").stat().st_size > 10_000
    rmse = {}
    for label, vehicle in (("before", VEHICLE), ("after", out / "augmented.yaml")):
        folder = tmp_path / label
        subprocess.run(
            [*command, "replay", str(bags[0]), "--vehicle", str(vehicle), "--out", str(folder)], check=True, timeout=600
        )
        summary = json.loads((folder / "summary.json").read_text())
        rmse[label] = summary["bags"][0]["fit"]["rmse_Nm"]
    assert rmse["after"] < 0.35 * rmse["before"]


@pytest.mark.parametrize("hidden", ["cylinder_friction", "backlash", "time_delay", "carcass_heat_sink"])
def test_one_effect_per_stage_is_named(tmp_path: Path, hidden: str) -> None:
    _, bags = made(tmp_path, Concealed(hidden))
    result = diagnose(bags, load(VEHICLE))
    assert result.json["verdict"] == "missing_physics"
    assert hidden in names(result)
    assert result.json["augmented"]["improvement_ci95"][0] > 0.0


def test_without_the_right_entry_the_physics_is_unlisted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data, bags = made(tmp_path, Concealed("end_stop"))
    poorer = {key: entry for key, entry in CATALOGUE.items() if key != "end_stop"}
    monkeypatch.setattr(fingerprint, "CATALOGUE", poorer)
    result = diagnose_recordings(thinned(bags[:1]), load(VEHICLE))
    assert result.json["verdict"] == "unlisted_physics"
    assert result.json["effects"] == []
    for entry, bag in zip(result.json["unexplained"]["where"], data.bags[:1], strict=True):
        assert overlap(entry["intervals_s"], bag.intervals["end_stop"]) > 0.4


def test_physics_outside_the_catalogue_is_unlisted(tmp_path: Path) -> None:
    _, bags = made(tmp_path, Concealed("gear_ripple"))
    result = diagnose_recordings(thinned(bags[:1]), load(VEHICLE))
    assert result.json["verdict"] == "unlisted_physics"
    assert result.json["unexplained"]["structured"]
    assert "theta" in result.json["unexplained"]["formula"]
    assert result.json["next_experiment"] is not None


def cut(recording: Recording, until_s: float, since_s: float = 0.0) -> Recording:
    """Some seconds of a recording only."""

    def short(signal: Signal) -> Signal:
        keep = (signal.time_s < until_s) & (signal.time_s >= since_s)
        return Signal(signal.time_s[keep], signal.value[keep])

    return Recording(
        recording.name, recording.start_ns, {k: short(s) for k, s in recording.angle.items()},
        {k: short(s) for k, s in recording.pressure.items()},
    )  # fmt: skip


def test_a_recording_counts_once_and_names_are_told_apart(tmp_path: Path) -> None:
    _, (first, second) = made(tmp_path, seed=21)
    copy = shutil.copytree(first, tmp_path / "copy")
    inside = next(file for file in first.iterdir() if file.name != "metadata.yaml")
    for again in (first, inside, copy):
        with pytest.raises(BagError, match=f"{again.name}: holds the same recording as .*{first.name};"):
            diagnose([first, second, again], load(VEHICLE))
    twin = tmp_path / "other" / first.name
    twin.parent.mkdir()
    second.rename(twin)
    result = diagnose([first, twin], load(VEHICLE))
    assert result.json["bags"] == [first.name, f"{first.name}_2"]


def test_too_short_a_recording_is_insufficient_and_says_what_to_drive(tmp_path: Path) -> None:
    vehicle = load(VEHICLE)
    _, bags = made(tmp_path)
    result = diagnose_recordings([cut(read_recording(bags[0], vehicle.channels), 3.0)], vehicle)
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
