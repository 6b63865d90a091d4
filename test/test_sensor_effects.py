# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Effects of sensors and arms, and the recorded air, mean the same in simulation, replay and diagnosis. All data are synthetic."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lugre_steering.bag import read_recording
from lugre_steering.chain.lag import lagged
from lugre_steering.data.dataset import prepare
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Signal
from lugre_steering.replay.run import replay
from lugre_steering.resources import config_folder
from lugre_steering.simulate.manoeuvres import BUILT_IN, Hold, Manoeuvre, Sweep, motion_of
from lugre_steering.simulate.plant import with_effects
from lugre_steering.simulate.run import sensing_of, simulate
from lugre_steering.simulate.write import write_bag
from lugre_steering.vehicle import Vehicle, load, save

TRACKS = config_folder() / "test_vehicle.yaml"
JOINT = config_folder() / "single_joint_example.yaml"
DRIVE = Manoeuvre("drive", "", (Hold(2.0), Sweep(20.0, 6.0, 1.0), Sweep(-20.0, 9.0, 1.0), Sweep(15.0, 4.0, 0.5), Hold(1.0)))


@pytest.mark.parametrize("tau", [0.004, 0.05, 0.3])
def test_the_lag_solves_its_differential_equation(tau: float) -> None:
    dt = 0.02
    time = dt * np.arange(200)
    value = np.interp(time, [0.0, 1.0, 1.5, 2.5, 4.0], [0.0, 3.0, 3.0, -2.0, 1.0])

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        return (np.interp(t, time, value) - y) / tau

    exact = solve_ivp(slope, (0.0, time[-1]), [value[0]], t_eval=time, rtol=1e-9, atol=1e-10, max_step=dt, method="Radau").y[0]
    np.testing.assert_allclose(lagged(value, dt, tau), exact, atol=1e-4)


@pytest.fixture(autouse=True)
def _no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody looks at them here, and they take longer than all the rest."""
    monkeypatch.setattr("lugre_steering.replay.passage.no_pictures", lambda: "not wanted")


def recorded(vehicle: Vehicle, folder: Path) -> tuple[Path, Path]:
    """A bag with next to no noise, and the vehicle file that made it."""
    sensing = replace(sensing_of(vehicle), angle_noise_deg=0.0005, angle_resolution_deg=0.0, pressure_noise_Pa=10.0)
    quiet = vehicle if vehicle.torque_sensor is None else vehicle.replace(torque_sensor=replace(vehicle.torque_sensor, noise_Nm=0.01))
    quiet = quiet.replace(sensors=replace(vehicle.sensors, angle_noise_deg=0.0005, angle_resolution_deg=0.0, pressure_noise_Pa=10.0))
    write_bag(folder / "run", simulate(quiet, motion_of(DRIVE, quiet), sensing), "test")
    save(quiet, folder / "vehicle.yaml")
    return folder / "run", folder / "vehicle.yaml"


@pytest.mark.parametrize(
    ("file", "effect"),
    [
        (TRACKS, "pressure_lag:tau=0.04"),
        (TRACKS, "pressure_lag:tau=0.01"),
        (TRACKS, "time_delay:delay=0.03"),
        (TRACKS, "angle_offset:offset=0.02"),
        (TRACKS, "angle_scale:scale=0.1"),
        (TRACKS, "moment_arm_error:linear=0.2,quadratic=0.3"),
        (TRACKS, "pressure_offset:main_a=300000"),
        (TRACKS, "pressure_drift:main_b=20000"),
        (JOINT, "pressure_lag:tau=0.04"),
        (JOINT, "time_delay:delay=0.03"),
    ],
)
def test_the_file_that_made_a_recording_explains_it(tmp_path: Path, file: Path, effect: str) -> None:
    """To a tenth of what the same file without the effect leaves, by replay and by the prediction of diagnosis (which is
    linear in an angle offset, so that one is small)."""
    plain = load(file)
    bag, sheet = recorded(with_effects(plain, [effect]), tmp_path)
    without = load(sheet).replace(effects=())
    save(without, tmp_path / "without.yaml")
    left = [replay([bag], path, tmp_path / path.stem)["overall"]["rmse_Nm"] for path in (sheet, tmp_path / "without.yaml")]
    assert left[0] < 0.1 * left[1]
    predicted = []
    for vehicle in (load(sheet), without):
        problem = Problem(vehicle, [prepare(read_recording(bag, vehicle.channels), vehicle)])
        error = (problem.measured - problem.predict_all(problem.start()))[problem.valid]
        predicted.append(float(np.sqrt(np.mean(error**2))))
    assert predicted[0] < 0.1 * predicted[1]


def test_the_recorded_air_is_followed_as_by_replay(tmp_path: Path) -> None:
    """Air of another temperature than the file's, changing on the way: diagnosis predicts what replay estimates, both with the
    rubber as warm as the file says at the start."""
    sheet = load(TRACKS)
    assert sheet.initial is not None
    slower = replace(sensing_of(sheet), angle_rate_Hz=20.0, pressure_rate_Hz=20.0)
    made = simulate(sheet, motion_of(BUILT_IN["six-cycles"], sheet), slower)
    signals = dict(made.signals)
    air = next(channel for channel in signals if channel.name == "air_temperature" or "ambient" in channel.topic)
    at = signals[air].time_s
    signals[air] = Signal(at, np.where(at < 60.0, -5.0, 45.0))
    bag = tmp_path / "run"
    write_bag(bag, replace(made, signals=signals), "test")
    windy = sheet.replace(rubber=replace(sheet.rubber, heat_transfer_W_m2K=2000.0))
    save(windy, tmp_path / "windy.yaml")
    recording = read_recording(bag, windy.channels)
    run = prepare(recording, windy)
    assert [round(value) for _, value in run.air] == [-5, 45]
    assert [since for since, _ in run.air] == pytest.approx([0.0, 60.0], abs=0.1)
    errors = []
    for each in (run, replace(run, air=())):
        problem = Problem(windy, [each])
        x = problem.start()
        rubber, _ = problem.temperatures(0, x)
        x[len(problem.calibrations) + 1] += sheet.initial.rubber_temperature_degC - rubber
        errors.append((problem.measured - problem.predict_all(x))[problem.valid])
    left = replay([bag], tmp_path / "windy.yaml", tmp_path / "out")["overall"]["rmse_Nm"]
    followed, ignored = (float(np.sqrt(np.mean(error**2))) for error in errors)
    assert followed == pytest.approx(left, rel=0.02)
    assert abs(ignored - left) > 0.1 * left
