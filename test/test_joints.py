# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Joints whose torque holds more than every joint has, and the filter of a joint's motion."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from lugre_steering import replay
from lugre_steering import vehicle as vehicle_file
from lugre_steering.bench import joints
from lugre_steering.calibration.calibrate import calibrate_recordings
from lugre_steering.chain.rates import RATE_TIME_CONSTANT_S
from lugre_steering.data.dataset import prepare
from lugre_steering.diagnosis.engine import diagnose_recordings
from lugre_steering.errors import VehicleFileError
from lugre_steering.fitting.causal import causal_rmse, filtered
from lugre_steering.recording import Recording, Signal
from lugre_steering.vehicle import EffectEntry, Vehicle

CONFIG = Path(__file__).parents[1] / "config"


def filtering(vehicle: Vehicle, rate_filter_s: float | None) -> Vehicle:
    return vehicle.replace(sensors=dataclasses.replace(vehicle.sensors, rate_filter_s=rate_filter_s))


def swinging(*slower: float) -> tuple[Vehicle, Recording]:
    """A light joint that swings fast and far: a torque of 12 kg m2 times its acceleration, read with an angle noise of 0.02 deg.

    ``slower``: frequencies [Hz] of other swings beside that, which tell an inertia from a spring.
    """
    plain = vehicle_file.load(CONFIG / "single_joint_example.yaml").replace(gravity=None)
    assert plain.contact is not None
    sheet = plain.replace(
        contact=dataclasses.replace(plain.contact, coulomb_torque_Nm=1.0, static_torque_Nm=1.1),
        sensors=dataclasses.replace(plain.sensors, angle_noise_deg=0.02), effects=(EffectEntry("yaw_inertia", {"inertia": 12.0}),)
    )
    rng, time, pulsations = np.random.default_rng(8), np.arange(0.0, 20.0, 0.01), 2.0 * np.pi * np.array([0.8, *slower])
    swings, noise = 0.6 * np.sin(np.outer(pulsations, time)), math.radians(0.02) * rng.standard_normal(time.size)
    angle, torque = swings.sum(axis=0), 12.0 * -(pulsations**2) @ swings
    return sheet, Recording("swinging", 0, {"left": Signal(time, angle + noise)}, {}, measured_torque=Signal(time, torque))


def test_the_rate_of_the_filter_of_a_file_is_not_late_where_the_joint_accelerates() -> None:
    """At 0.5 rad/s2 the usual rate is that of 0.04 s ago: 0.24 N m too little of a viscous friction of 12 N m s/rad."""
    sheet, _ = swinging()
    sheet = sheet.replace(effects=(EffectEntry("viscous_friction", {"sigma_2": 12.0}),))
    time, rng = np.arange(0.0, 3.3, 0.01), np.random.default_rng(4)
    angle = Signal(time, 0.25 * time**2 + math.radians(0.02) * rng.standard_normal(time.size))
    faster = Recording("faster", 0, {"left": angle}, {}, measured_torque=Signal(time, 6.0 * time))
    usual, other = (replay(faster, filtering(sheet, each)).bags[0].kept().torque for each in (None, RATE_TIME_CONSTANT_S))
    assert np.mean((other - usual)[100:]) == pytest.approx(12.0 * 0.5 * RATE_TIME_CONSTANT_S, rel=0.15)


def test_a_joint_that_stands_has_no_acceleration() -> None:
    """At rest the noise of the angle is none of the joint, which yields to it once by a bristle: 12 kg m2 would show 100 N m of it."""
    sheet, _ = swinging()
    time, rng = np.arange(0.0, 10.0, 0.01), np.random.default_rng(3)
    angle = 0.3 * np.clip(time - 2.0, 0.0, 1.0) + math.radians(0.02) * rng.standard_normal(time.size)
    standing = Recording("standing", 0, {"left": Signal(time, angle)}, {}, measured_torque=Signal(time, 0.0 * time))
    torque = replay(standing, filtering(sheet, 0.01)).bags[0].kept().torque
    assert np.ptp(torque[100:190]) == 0.0
    assert np.ptp(torque[500:]) < 0.1
    assert np.ptp(torque[200:320]) > 5.0


@pytest.mark.parametrize("rate_filter_s", [None, 0.02])
def test_a_recording_that_begins_in_motion_does_not_begin_with_an_acceleration(rate_filter_s: float | None) -> None:
    """At 3 rad/s from the first sample on: to come to that rate would take 12 kg m2 x 3 rad/s / 0.04 s = 900 N m."""
    sheet, recording = swinging()
    torque, measured = replay(recording, filtering(sheet, rate_filter_s)).bags[0].kept().torque, recording.measured_torque
    assert measured is not None
    assert np.abs(torque[:30]).max() < 1.2 * np.abs(measured.value).max()


def test_a_stray_angle_is_held_back_and_the_torque_goes_on() -> None:
    """A twentieth of the swing for one sample: 12 kg m2 would make five times the largest torque of it."""
    sheet, recording = swinging()
    angle = recording.angle["left"]
    strayed = angle.value.copy()
    strayed[[700, 1203, 1506]] += 0.03
    stray = dataclasses.replace(recording, angle={"left": Signal(angle.time_s, strayed)})
    clean, other = (replay(each, filtering(sheet, 0.02)).bags[0] for each in (recording, stray))
    assert other.samples["angle/left"].rejected.get("spike") == 3
    assert "spike" not in clean.samples["angle/left"].rejected
    torque = np.interp(other.kept().time_s, clean.kept().time_s, clean.kept().torque)
    assert np.abs(other.kept().torque - torque).max() < 0.5 * np.abs(torque).max()


def test_a_filter_without_noise_of_the_angle_is_refused(tmp_path: Path) -> None:
    sheet, _ = swinging()
    silent = sheet.replace(sensors=dataclasses.replace(sheet.sensors, angle_noise_deg=0.0))
    vehicle_file.save(silent, tmp_path / "silent.yaml")
    vehicle_file.load(tmp_path / "silent.yaml")
    text = (tmp_path / "silent.yaml").read_text().replace("sensors:\n", "sensors:\n  rate_filter_s: 0.01\n")
    (tmp_path / "silent.yaml").write_text(text)
    with pytest.raises(VehicleFileError, match=r"silent.yaml: key 'sensors.rate_filter_s': got 0.01, expected angle_noise_deg"):
        vehicle_file.load(tmp_path / "silent.yaml")


def test_a_joint_gets_the_filter_with_which_its_file_errs_least_in_replay() -> None:
    """A filter of 0.04 s lags a swing of 0.8 Hz, by two stages, by a fifth of a turn: 0.4 of the torque."""
    sheet, recording = swinging()
    runs = [prepare(recording, sheet)]
    best, error = filtered(sheet, [recording], runs)
    assert error < 0.75 * causal_rmse(sheet, [recording], runs)
    assert error_live(recording, best) < 0.75 * error_live(recording, sheet)


def test_calibration_and_diagnosis_write_that_filter() -> None:
    sheet, recording = swinging(0.33)
    bare = sheet.replace(effects=())
    calibrated = calibrate_recordings([recording], bare).vehicle
    found = diagnose_recordings([recording], bare)
    for made in (calibrated, found.vehicle):
        assert made.sensors.rate_filter_s is not None
        assert error_live(recording, made) < 0.75 * error_live(recording, filtering(made, None))


def error_live(recording: Recording, vehicle: Vehicle) -> float:
    said = replay(recording, vehicle).overall
    assert said is not None
    return said.rmse_Nm


def test_a_filter_that_suits_slow_motion_follows_a_fast_one() -> None:
    """One of 0.16 s alone would be late by most of a swing's quarter, and the torque with it: 184 N m."""
    sheet, recording = swinging()
    assert error_live(recording, filtering(sheet, 0.16)) < 1.2 * error_live(recording, filtering(sheet, 0.02))


def test_looking_ahead_the_motion_is_no_part_of_the_error() -> None:
    """Live, an acceleration that comes late is a tenth of the torque of an inertia and more."""
    sheet, recording = swinging()
    (asked,), (plain,) = (replay(recording, filtering(sheet, 0.04), look_ahead=ahead).bags for ahead in (True, False))
    assert asked.fit is not None
    assert recording.measured_torque is not None
    assert asked.look_ahead_rmse_Nm is not None
    assert asked.look_ahead_rmse_Nm < 0.03 * float(np.std(recording.measured_torque.value))
    assert asked.fit.rmse_Nm > 5.0 * asked.look_ahead_rmse_Nm
    assert plain.look_ahead_rmse_Nm is None
    assert plain.fit == asked.fit


def test_an_error_that_cannot_be_told_looking_ahead_is_told_so() -> None:
    sheet, recording = swinging()
    (bag,) = replay(dataclasses.replace(recording, measured_torque=None), sheet, look_ahead=True).bags
    assert bag.look_ahead_rmse_Nm is None
    assert [finding.finding for finding in bag.findings] == ["no_look_ahead"]
    assert "measured_torque" in bag.findings[0].statement


def test_what_a_joint_has_is_told_beside_a_law_with_the_values_that_it_has() -> None:
    """A torque periodic in the angle, of a tenth to a half of the friction, is a law. It had stood in place of the inertia and the losses,
    or left their intervals a tenth of them wide and more."""
    told, foreign = joints.judged(9102, ripple=True)
    assert foreign == []
    assert [each.term for each in told if each.value is None] == []
    assert max(abs(each.value / each.true - 1.0) for each in told if each.value is not None) < 0.03
    assert max(0.5 * (each.high - each.low) / abs(each.true) for each in told) < 0.1
