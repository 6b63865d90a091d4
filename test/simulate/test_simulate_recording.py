# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Actuation, sensors and bags: pressures stand for the torque through the geometry; noise is what was asked for."""

from __future__ import annotations

import dataclasses
import filecmp
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader
from scipy.integrate import trapezoid

from lugre_steering import vehicle as vehicle_file
from lugre_steering.bag import read_recording
from lugre_steering.errors import BagError, DataError, LugreSteeringError
from lugre_steering.recording import Kind
from lugre_steering.resources import config_folder
from lugre_steering.simulate import manoeuvres, plant
from lugre_steering.simulate.manoeuvres import Hold, Manoeuvre, Sweep
from lugre_steering.simulate.run import Simulated, sensing_of, simulate
from lugre_steering.simulate.write import write_bag
from lugre_steering.vehicle import TorqueSensor, Vehicle
from lugre_steering.vehicle.actuation import RETURN_PRESSURE_PA, line_pressures, total_gains

VEHICLE = vehicle_file.load(config_folder() / "test_vehicle.yaml")
SHORT = Manoeuvre("short", "", (Hold(1.0), Sweep(12.0, 8.0, 1.0), Sweep(-5.0, 8.0, 1.0)))
QUIET = dataclasses.replace(sensing_of(VEHICLE), angle_noise_deg=0.0, pressure_noise_Pa=0.0, angle_resolution_deg=0.0)


def torque_by_hand(vehicle: Vehicle, theta: dict[str, float], pressure: dict[str, float]) -> float:
    """Independent oracle: virtual work with the numerical derivative of each pin-to-pin length."""
    assert vehicle.hydraulics is not None

    def length(cylinder: vehicle_file.Cylinder, angle: float) -> float:
        pin = complex(*cylinder.knuckle_m) * complex(math.cos(angle), math.sin(angle))
        return abs(pin - complex(*cylinder.chassis_m))

    total, h = 0.0, 1e-5
    for cylinder in vehicle.hydraulics.cylinders.values():
        angle = theta[cylinder.side]
        arm = (length(cylinder, angle + h) - length(cylinder, angle - h)) / (2.0 * h)
        cap = math.pi * cylinder.bore_m**2 / 4.0
        rod = cap - math.pi * cylinder.rod_m**2 / 4.0
        total += arm * (pressure[cylinder.cap] * cap - pressure[cylinder.rod] * rod)
    return total


@given(st.floats(-7e4, 7e4), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_pressures_give_back_the_torque(torque: float, left: float, right: float) -> None:
    gains = total_gains(VEHICLE, np.array([[left], [right]]))
    assert VEHICLE.hydraulics is not None
    lines = dict(zip(VEHICLE.hydraulics.lines, line_pressures(np.array([torque]), gains)[:, 0], strict=True))
    assert torque_by_hand(VEHICLE, {"left": left, "right": right}, lines) == pytest.approx(torque, abs=0.05)
    assert min(lines.values()) >= RETURN_PRESSURE_PA * (1.0 - 1e-9)
    # One line of each circuit returns to tank, the others share the load at one supply pressure.
    for a, b in (("main_a", "main_b"), ("aux_a", "aux_b")):
        assert min(lines[a], lines[b]) == pytest.approx(RETURN_PRESSURE_PA)
    assert max(lines["main_a"], lines["main_b"]) == pytest.approx(max(lines["aux_a"], lines["aux_b"]))


def run(vehicle: Vehicle = VEHICLE, **changes: Any) -> Simulated:
    return simulate(vehicle, manoeuvres.motion_of(SHORT, vehicle), dataclasses.replace(QUIET, **changes))


def test_recorded_pressures_and_angles_give_the_true_torque() -> None:
    recorded = run(angle_rate_Hz=1000.0, pressure_rate_Hz=1000.0)
    time = recorded.truth.motion.time
    torques = []
    for t in np.linspace(0.2, time[-1] - 0.2, 25):
        now = {c: float(np.interp(t, s.time_s, s.value)) for c, s in recorded.signals.items()}
        theta = {c.name: value for c, value in now.items() if c.kind is Kind.ANGLE}
        lines = {c.name: value for c, value in now.items() if c.kind is Kind.PRESSURE}
        torques.append((torque_by_hand(VEHICLE, theta, lines), float(np.interp(t, time, recorded.truth.torque))))
    hand, true = np.array(torques).T
    assert np.ptp(true) > 4e4
    assert np.allclose(hand, true, atol=10.0)


def test_absolute_sensors_add_the_atmosphere() -> None:
    absolute = VEHICLE.replace(sensors=dataclasses.replace(VEHICLE.sensors, pressure_reference="absolute"))
    gauge, other = run(), run(absolute)
    for channel, signal in gauge.signals.items():
        shift = 101_325.0 if channel.kind is Kind.PRESSURE else 0.0
        assert np.allclose(other.signals[channel].value - signal.value, shift, atol=1e-3)


def test_noise_quantisation_jitter_and_seed_are_what_was_asked_for() -> None:
    clean = run()
    noisy = run(angle_noise_deg=0.05, pressure_noise_Pa=2e4, seed=4)
    for channel, signal in noisy.signals.items():
        deviation = float(np.std(signal.value - clean.signals[channel].value))
        wanted = {Kind.ANGLE: math.radians(0.05), Kind.PRESSURE: 2e4}.get(channel.kind, 0.0)
        assert deviation == pytest.approx(wanted, rel=0.12)
    again, other = run(angle_noise_deg=0.05, pressure_noise_Pa=2e4, seed=4), run(angle_noise_deg=0.05, seed=5)
    left = next(iter(clean.signals))
    assert np.array_equal(again.signals[left].value, noisy.signals[left].value)
    assert not np.array_equal(other.signals[left].value, noisy.signals[left].value)
    coarse = run(angle_resolution_deg=0.5).signals[left].value / math.radians(0.5)
    assert np.allclose(coarse, np.round(coarse))
    jittered = run(jitter_s=2e-3).signals[left].time_s
    assert np.all(np.diff(jittered) > 0.0)
    assert np.std(np.diff(jittered)) > 1e-3


@pytest.mark.parametrize(
    "bad", [{"angle_rate_Hz": 0.0}, {"jitter_s": math.nan}, {"pressure_noise_Pa": -1.0}, {"seed": -1}]
)
def test_bad_sensing_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(DataError, match=next(iter(bad))):
        run(**bad)


def test_sensor_effects_reach_the_pressures() -> None:
    clean = run(pressure_rate_Hz=500.0)
    channel = next(c for c in clean.signals if c.name == "main_a")
    base = clean.signals[channel]

    def with_effect(text: str) -> np.ndarray:
        return run(plant.with_effects(VEHICLE, [text]), pressure_rate_Hz=500.0).signals[channel].value

    assert np.allclose(with_effect("pressure_offset:main_a=1e5") - base.value, 1e5)
    assert np.allclose(with_effect("pressure_offset:main_b=1e5"), base.value)
    assert np.allclose(with_effect("pressure_drift:main_a=2e3") - base.value, 2e3 * base.time_s)
    late = with_effect("time_delay:delay=0.1")
    assert np.allclose(late[50:], base.value[:-50], atol=1.0)
    lagging = with_effect("pressure_lag:tau=0.05")
    slope = np.gradient(base.value, base.time_s)
    lag = trapezoid(base.value - lagging, base.time_s) / trapezoid(slope, base.time_s)
    assert lag == pytest.approx(0.05, rel=0.05)


def test_an_effect_of_the_vehicle_acts_on_the_torque() -> None:
    stop = plant.with_effects(VEHICLE, ["end_stop:engage_angle=0.1,stiffness=1e5"])
    plain = run()
    expected = np.sign(plain.truth.motion.theta) * 1e5 * np.maximum(np.abs(plain.truth.motion.theta) - 0.1, 0.0)
    assert np.allclose(run(stop).truth.torque - plain.truth.torque, expected.sum(axis=0), atol=1.0)


@pytest.mark.parametrize(
    "text",
    [
        "nonsense:x=1",
        "end_stop",
        "end_stop:stif=1",
        "end_stop:stiffness=much",
        "end_stop:stiffness=nan",
        "end_stop:stiffness=-5",
        "wear_polishing:amount=0.1",
        "load_transfer:x=1",
        "pressure_offset:no_line=1",
        "slope_bias:torque=1,torque=2",
        ":",
    ],
)
def test_bad_effects_are_refused(text: str) -> None:
    with pytest.raises(LugreSteeringError, match="effect"):
        plant.with_effects(VEHICLE, [text])


def test_torque_beyond_the_pressure_sensors_is_refused() -> None:
    strong = plant.with_effects(VEHICLE, ["end_stop:engage_angle=0.1,stiffness=5e6"])
    with pytest.raises(DataError, match="pressure_range_Pa"):
        run(strong)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_bags_are_labelled_complete_and_equal_in_bytes(tmp_path: Path, storage: str) -> None:
    recorded = run(angle_noise_deg=0.01, seed=2, pressure_rate_Hz=50.0)
    for name in ("first", "second"):
        write_bag(tmp_path / name / "bag", recorded, "a test", storage)
    first = tmp_path / "first" / "bag"
    assert len(list(first.iterdir())) == 2
    for path in first.iterdir():
        assert filecmp.cmp(path, tmp_path / "second" / "bag" / path.name, shallow=False)
    assert "synthetic" in (first / "metadata.yaml").read_text(encoding="utf-8")

    messages: dict[str, list[Any]] = {}
    with AnyReader([first]) as reader:
        for connection, _, raw in reader.messages():
            messages.setdefault(connection.topic, []).append(reader.deserialize(raw, connection.msgtype))
    assert [m.data for m in messages.pop("/synthetic_truth/label")] == ["synthetic: a test"]
    assert {m.header.frame_id for rows in messages.values() for m in rows} == {"synthetic"}
    torque = messages["/synthetic_truth/torque"]
    stamps = np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in torque])
    value = np.array([m.wrench.torque.z for m in torque])
    true = np.interp(stamps - stamps[0], recorded.truth.motion.time, recorded.truth.torque)
    assert np.allclose(value, true, atol=1.0)

    back = read_recording(first, VEHICLE.channels)
    for channel, signal in recorded.signals.items():
        table = {Kind.ANGLE: back.angle, Kind.PRESSURE: back.pressure}.get(channel.kind)
        seen = back.air_temperature if table is None else table[channel.name]
        assert seen is not None
        assert np.array_equal(seen.value, signal.value)
    with pytest.raises(BagError, match="exists"):
        write_bag(first, recorded, "a test", storage)


def test_a_torque_sensor_records_the_torque() -> None:
    vehicle = VEHICLE.replace(hydraulics=None, torque_sensor=TorqueSensor(noise_Nm=50.0))
    recorded = run(vehicle)
    (signal,) = [s for c, s in recorded.signals.items() if c.kind is Kind.TORQUE]
    error = signal.value - np.interp(signal.time_s, recorded.truth.motion.time, recorded.truth.torque)
    assert np.std(error) == pytest.approx(50.0, rel=0.12)
    assert abs(np.mean(error)) < 8.0
