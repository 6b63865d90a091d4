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


def swinging() -> tuple[Vehicle, Recording]:
    """A light joint that swings fast and far: a torque of 12 kg m2 times its acceleration, read with an angle noise of 0.02 deg."""
    plain = vehicle_file.load(CONFIG / "single_joint_example.yaml").replace(gravity=None)
    assert plain.contact is not None
    sheet = plain.replace(
        contact=dataclasses.replace(plain.contact, coulomb_torque_Nm=1.0, static_torque_Nm=1.1),
        sensors=dataclasses.replace(plain.sensors, angle_noise_deg=0.02), effects=(EffectEntry("yaw_inertia", {"inertia": 12.0}),)
    )
    rng, time, pulsation = np.random.default_rng(8), np.arange(0.0, 20.0, 0.01), 2.0 * np.pi * 0.8
    angle, noise = 0.6 * np.sin(pulsation * time), math.radians(0.02) * rng.standard_normal(time.size)
    torque = 12.0 * -0.6 * pulsation**2 * np.sin(pulsation * time)
    return sheet, Recording("swinging", 0, {"left": Signal(time, angle + noise)}, {}, measured_torque=Signal(time, torque))


def test_the_filter_of_a_file_that_is_what_its_noise_asks_for_changes_nothing() -> None:
    sheet, recording = swinging()
    sheet = sheet.replace(sensors=dataclasses.replace(sheet.sensors, angle_noise_deg=0.002))
    usual_s = math.sqrt(math.radians(0.002) / 0.11)  # as the documentation says
    assert usual_s < RATE_TIME_CONSTANT_S
    plain, same, other = (replay(recording, filtering(sheet, each)).bags[0].kept().torque for each in (None, usual_s, 0.5 * usual_s))
    assert np.allclose(same, plain, rtol=0.0, atol=1e-9 * np.abs(plain).max())
    assert np.abs(other - plain).max() > 0.01 * np.abs(plain).max()


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
    live = [replay(recording, each).overall for each in (sheet, best)]
    assert live[1] is not None
    assert live[0] is not None
    assert live[1].rmse_Nm < 0.75 * live[0].rmse_Nm


def test_calibration_and_diagnosis_write_that_filter() -> None:
    sheet, recording = swinging()
    bare = sheet.replace(effects=())
    calibrated = calibrate_recordings([recording], bare).vehicle
    found = diagnose_recordings([recording], bare)
    for made in (calibrated, found.vehicle):
        assert made.sensors.rate_filter_s is not None
        assert made.sensors.rate_filter_s < RATE_TIME_CONSTANT_S


def test_what_a_joint_has_is_told_beside_a_law_with_the_values_that_it_has() -> None:
    """A torque periodic in the angle, of a tenth to a half of the friction, is a law. It had stood in place of the inertia and the losses,
    or left their intervals a tenth of them wide and more."""
    told, foreign = joints.judged(9102, ripple=True)
    assert foreign == []
    assert [each.term for each in told if each.value is None] == []
    assert max(abs(each.value / each.true - 1.0) for each in told if each.value is not None) < 0.03
    assert max(0.5 * (each.high - each.low) / abs(each.true) for each in told) < 0.1
