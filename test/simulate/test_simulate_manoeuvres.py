# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Manoeuvres: Ackermann geometry, rates and holds, angles from files; each bad file refused by name."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lugre_steering import vehicle as vehicle_file
from lugre_steering.errors import DataError
from lugre_steering.recording import Recording, Signal
from lugre_steering.resources import config_folder
from lugre_steering.simulate import manoeuvres
from lugre_steering.simulate.manoeuvres import BUILT_IN, Chirp, Hold, Manoeuvre, Motion, Sweep

VEHICLE = vehicle_file.load(config_folder() / "test_vehicle.yaml")


def mean_deg(motion: Motion) -> np.ndarray:
    """Mean angle from the two tracks: the cotangent of the middle wheel is the mean of both cotangents."""
    left, right = np.tan(motion.theta)
    moved = np.abs(left) > 1e-9
    return np.degrees(np.where(moved, np.arctan(2.0 * left * right / np.where(moved, left + right, 1.0)), 0.0))


@given(st.floats(0.02, 0.7), st.sampled_from([-1.0, 1.0]))
def test_both_track_axles_meet_on_the_line_of_the_rear_axle(size: float, sign: float) -> None:
    axle = VEHICLE.axle
    assert axle is not None
    left, right = manoeuvres.ackermann(np.array([sign * size]), axle)[:, 0]
    # The normal of each wheel, drawn from its kingpin, reaches the line of the rear axle at this y.
    y_left = 0.5 * axle.kingpin_distance_m + axle.wheelbase_m / math.tan(left)
    y_right = -0.5 * axle.kingpin_distance_m + axle.wheelbase_m / math.tan(right)
    assert y_left == pytest.approx(y_right, rel=1e-9)
    assert y_left == pytest.approx(axle.wheelbase_m / math.tan(sign * size), rel=1e-9)
    inner, outer = (left, right) if sign > 0 else (right, left)
    assert abs(inner) > abs(outer)


@given(st.floats(8.0, 30.0), st.sampled_from([-1.0, 1.0]), st.floats(1.0, 10.0), st.floats(1.0, 4.0))
def test_sweeps_have_their_rates_and_holds(size: float, sign: float, rate: float, hold: float) -> None:
    one = Manoeuvre("one", "", (Hold(1.0), Sweep(sign * size, rate, hold), Sweep(0.0, rate, 1.0)))
    motion = manoeuvres.motion_of(one, VEHICLE)
    turn = size / rate
    assert motion.time[-1] == pytest.approx(2.0 + hold + 2.0 * turn, abs=2 * manoeuvres.STEP_S)
    angle = mean_deg(motion)
    middle = int(np.searchsorted(motion.time, 1.0 + 0.5 * turn))
    slope = (angle[middle + 5] - angle[middle - 5]) / (motion.time[middle + 5] - motion.time[middle - 5])
    assert slope == pytest.approx(sign * rate, rel=1e-3)
    held = (motion.time > 1.0 + turn + 0.25) & (motion.time < 1.0 + turn + hold - 0.25)
    assert np.all(np.abs(angle[held] - sign * size) < 1e-6)
    assert np.all(np.abs(motion.rate[:, held]) < 1e-9)
    assert np.allclose(motion.theta[:, :300], 0.0)


def test_chirp_has_the_cycles_that_its_frequencies_integrate_to() -> None:
    motion = manoeuvres.motion_of(Manoeuvre("c", "", (Chirp(10.0, 0.05, 0.35, 50.0),)), VEHICLE)
    crossings = int(np.sum(np.diff(np.sign(motion.theta[0, 500:-500])) != 0))
    assert crossings == pytest.approx(2.0 * 0.2 * 50.0, abs=1.5)
    assert mean_deg(motion).max() == pytest.approx(10.0, rel=0.02)


@pytest.mark.parametrize("name", BUILT_IN)
def test_corners_are_rounded_so_that_accelerations_stay_finite(name: str) -> None:
    motion = manoeuvres.motion_of(BUILT_IN[name], VEHICLE)
    assert np.all(np.diff(motion.time) > 0.0)
    # 10 deg/s to rest within the smoothing width; the inner track turns up to 1.6 times as fast; reversals count twice.
    assert np.abs(motion.acceleration).max() < math.radians(10.0) / manoeuvres.SMOOTHING_S * 1.6 * 2.0


def test_the_double_cycle_is_the_published_one() -> None:
    angle = mean_deg(manoeuvres.motion_of(BUILT_IN["double-cycle"], VEHICLE)) / manoeuvres.LIMIT_DEG
    at_limit = np.where(np.abs(angle) > 1.0 - 1e-6, np.sign(angle), 0.0)
    visits = [float(x) for before, x in pairwise(at_limit) if x not in (0.0, before)]
    assert visits == [1.0, -1.0, 1.0, -1.0]
    assert angle[0] == angle[-1] == pytest.approx(0.0, abs=1e-9)


def test_a_single_joint_turns_by_the_mean_angle() -> None:
    joint = dataclasses.replace(VEHICLE, axle=None, sides=("left",))
    motion = manoeuvres.motion_of(Manoeuvre("one", "", (Sweep(10.0, 5.0, 1.0),)), joint)
    assert motion.theta.shape[0] == 1
    assert motion.theta[0, -1] == pytest.approx(math.radians(10.0))


def test_angles_of_a_csv_come_back(tmp_path: Path) -> None:
    time = np.arange(0.0, 10.0, 0.02)
    left, right = 10.0 * np.sin(0.5 * time), 8.0 * np.sin(0.5 * time)
    file = tmp_path / "angles.csv"
    rows = [f"{t:.3f},{b:.9f},{a:.9f}" for t, a, b in zip(time, left, right, strict=True)]
    file.write_text("# comment\ntime_s,right_deg,left_deg\n" + "\n".join(rows), encoding="utf-8")
    motion = manoeuvres.from_csv(file, VEHICLE)
    inside = (motion.time > 1.0) & (motion.time < 9.0)
    wave = np.sin(0.5 * motion.time[inside])
    assert np.allclose(np.degrees(motion.theta[:, inside]), np.stack([10.0 * wave, 8.0 * wave]), atol=0.02)


def test_a_mean_angle_in_a_csv_is_shared_out_by_ackermann(tmp_path: Path) -> None:
    file = tmp_path / "mean.csv"
    file.write_text("time_s,angle_rad\n0,0.3\n5,0.3\n", encoding="utf-8")
    motion = manoeuvres.from_csv(file, VEHICLE)
    assert np.degrees(0.3) == pytest.approx(mean_deg(motion)[100])
    assert motion.theta[0, 100] > motion.theta[1, 100]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("", "0 data rows"),
        ("time_s,left_deg\n0,1\n1,2\n", "left_deg and right_deg, or angle_deg"),
        ("t,angle_deg\n0,1\n1,2\n", "time_s"),
        ("time_s,angle_deg\n0,1\n1,x\n", "line 3"),
        ("time_s,angle_deg\n0,1\n1\n", "line 3"),
        ("time_s,angle_deg\n0,1\n1,nan\n", "finite"),
        ("time_s,angle_deg,angle_deg\n0,1,2\n1,2,3\n", "line 1: column 'angle_deg' occurs twice"),
        ("time_s,angle_deg\n0,1\n0,2\n", "increasing"),
        ("time_s,angle_deg\n0,1\n1,200\n", "200 deg"),
        ("time_s,angle_deg\n0,1\n1e9,2\n", "7200 s"),
    ],
)
def test_bad_csv_files_are_refused(tmp_path: Path, text: str, wanted: str) -> None:
    file = tmp_path / "bad.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"bad\.csv") as caught:
        manoeuvres.from_csv(file, VEHICLE)
    assert wanted in str(caught.value)


def test_a_csv_of_a_spreadsheet_with_a_byte_order_mark(tmp_path: Path) -> None:
    file = tmp_path / "mean.csv"
    file.write_text("time_s,angle_rad\n0,0.3\n5,0.3\n", encoding="utf-8-sig")
    assert mean_deg(manoeuvres.from_csv(file, VEHICLE))[100] == pytest.approx(np.degrees(0.3))


def test_yaml_manoeuvres(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(
        "segments:\n- hold: {duration_s: 1}\n- sweep: {to_deg: 1e1, rate_deg_s: 5, hold_s: 2}\n"
        "- chirp: {amplitude_deg: 2, from_Hz: 0.1, to_Hz: 1, duration_s: 5}\n",
        encoding="utf-8",
    )
    assert manoeuvres.from_yaml(file).segments == (Hold(1.0), Sweep(10.0, 5.0, 2.0), Chirp(2.0, 0.1, 1.0, 5.0))


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("[", "YAML"),
        ("{}", "segments"),
        ("segments: []", "segments"),
        ("segments: [{hold: {duration_s: 5}}]\nspeling: 1", "key 'speling': got 1"),
        ("segments: [{jump: {}}]", "segments[0]"),
        ("segments: [{sweep: {to_deg: 5}}]", "sweep.rate_deg_s: got nothing"),
        ("segments: [{sweep: {to_deg: 5, rate_deg_s: 0}}]", "sweep.rate_deg_s"),
        ("segments: [{sweep: {to_deg: 5, rate_deg_s: .nan}}]", "sweep.rate_deg_s"),
        ("segments: [{sweep: {to_deg: 95, rate_deg_s: 1}}]", "sweep.to_deg"),
        ("segments: [{sweep: {to_deg: five, rate_deg_s: 1}}]", "sweep.to_deg"),
        ("segments: [{sweep: {to_rad: 5, rate_deg_s: 1}}]", "to_rad"),
    ],
)
def test_bad_yaml_manoeuvres_are_refused(tmp_path: Path, text: str, wanted: str) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"bad\.yaml") as caught:
        manoeuvres.from_yaml(file)
    assert wanted in str(caught.value)


def test_recorded_angles_lose_their_noise_and_parked_tracks_stand_still() -> None:
    true = manoeuvres.motion_of(BUILT_IN["double-cycle"], VEHICLE)
    rng = np.random.default_rng(1)
    at = np.arange(0.0, true.time[-1], 0.01)
    angle = {
        side: Signal(at, np.interp(at, true.time, row) + math.radians(0.01) * rng.standard_normal(at.size))
        for side, row in zip(VEHICLE.sides, true.theta, strict=True)
    }
    motion = manoeuvres.from_recording(Recording("bag", 0, angle, {}), VEHICLE)
    seen = np.stack([np.interp(true.time, motion.time, row) for row in motion.theta])
    assert np.degrees(np.abs(seen - true.theta)).max() < 0.2
    held = (motion.time > 7.6) & (motion.time < 9.2)
    # Chance may push a parked track by no more than the dead band of four standard deviations.
    assert np.degrees(np.abs(np.diff(motion.theta[:, held])).sum(axis=1)).max() < 0.04
    with pytest.raises(DataError, match="right"):
        manoeuvres.from_recording(Recording("bag", 0, {"left": angle["left"]}, {}), VEHICLE)
