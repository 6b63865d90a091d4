# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Calibration: known truth recovered, intervals that hold it, what cannot be known said so, files and errors."""

import dataclasses
import io
import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from lugre_steering import vehicle as vehicle_file
from lugre_steering.bag import read_recording
from lugre_steering.calibration import calibrate_recordings, coverage, identify
from lugre_steering.calibration.calibrate import chosen
from lugre_steering.calibration.estimate import _larger, estimate
from lugre_steering.calibration.table import show_calibration
from lugre_steering.cli import app
from lugre_steering.data.dataset import prepare
from lugre_steering.data.seen import seen_range
from lugre_steering.errors import DataError
from lugre_steering.estimator.known import SLACK, known_range
from lugre_steering.fitting.apply import apply_calibration
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.keys import KEYS
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Signal
from lugre_steering.replay.run import replay
from lugre_steering.simulate.manoeuvres import BUILT_IN, Hold, Manoeuvre, Sweep
from lugre_steering.vehicle.model import build_model

ROOT = Path(__file__).parent.parent
SHEET_FILE = ROOT / "config" / "test_vehicle.yaml"
BAG = ROOT / "bags" / "synthetic_double_cycle"
SHEET = vehicle_file.load(SHEET_FILE)
KEY = {key.key: key for key in KEYS}


def off_sheet(**factors):
    """The shipped sheet with friction, stiffness and capacity multiplied."""
    friction, rubber = SHEET.friction, SHEET.rubber
    return SHEET.replace(
        friction=dataclasses.replace(
            friction,
            static=friction.static * factors.get("level", 1.0),
            coulomb=friction.coulomb * factors.get("level", 1.0),
            stiffness_Nm_per_deg=friction.stiffness_Nm_per_deg * factors.get("stiffness", 1.0),
        ),
        rubber=dataclasses.replace(
            rubber, specific_heat_J_kgK=rubber.specific_heat_J_kgK * factors.get("capacity", 1.0)
        ),
    )


def test_intervals_hold_the_truth_as_often_as_they_say():
    rows = [row for case in coverage.cases(20) for row in case]
    # Rubber and air begin as the sheet says here, while intervals allow for weather: they hold a little more than they say.
    assert 0.90 <= np.mean([row.covered for row in rows]) < 1.0
    for key in {row.name for row in rows}:
        assert np.mean([row.covered for row in rows if row.name == key]) >= 0.8, key


@pytest.fixture(scope="module")
def long_runs():
    """Runs that determine everything, from a vehicle that no sheet value describes."""
    truth = off_sheet(level=1.12, stiffness=0.87, capacity=1.16)
    truth = truth.replace(
        friction=dataclasses.replace(truth.friction, static=truth.friction.coulomb * 1.2, stribeck_speed_deg_s=1.25),
        rubber=dataclasses.replace(truth.rubber, heat_transfer_W_m2K=22.0),
    )
    runs = [BUILT_IN[name] for name in ("varied-rates", "slow-sweeps", "heat-and-rest")]
    return truth, calibrate_recordings(coverage.record(truth, runs, 3), SHEET)


def test_known_truth_is_recovered(long_runs):
    truth, done = long_runs
    rows = done.result["parameters"]
    assert [row["key"] for row in rows] == [
        "friction.coulomb", "friction.static", "friction.stiffness_Nm_per_deg", "friction.stribeck_speed_deg_s",
        "rubber.specific_heat_J_kgK", "rubber.heat_transfer_W_m2K",
    ]  # fmt: skip
    for row in rows:
        true = KEY[row["key"]].read(truth)
        # Cooling goes with the air, which may be otherwise than the sheet says.
        assert row["value"] == pytest.approx(true, rel=0.05 if row["key"] == "rubber.heat_transfer_W_m2K" else 0.03), row
        assert row["ci95"][0] < true < row["ci95"][1], row
        assert row["at_bound"] is None
        assert not row["prior_dominated"] or row["key"] == "rubber.heat_transfer_W_m2K"


def test_residual_and_held_out_error_come_down_to_the_noise(long_runs):
    _, done = long_runs
    rmse, held = done.result["rmse_Nm"], done.result["heldout_rmse_Nm"]
    assert rmse["sheet"] > 10.0 * rmse["calibrated"]
    assert rmse["calibrated"] < 1.3 * rmse["noise_floor"]
    assert held["calibrated"] < 1.3 * rmse["noise_floor"]


def test_an_error_in_temperature_sensitivity_goes_into_the_heat_capacity(long_runs):
    """Oracle: fit again with a rubber table of other sensitivity, and see by how much the heat capacity moved."""
    _, done = long_runs
    said = next(a for a in done.result["assumed"] if a["name"] == "temperature_sensitivity")["shifts"]["heat_capacity"]
    exponent = 1.02
    other = Problem(SHEET, done.problem.runs, done.problem.calibrations)
    other.model = replace(other.model, rubber=other.model.rubber**exponent)
    index = [c.name for c in other.calibrations].index("heat_capacity")
    moved = fit(other, done.estimate.weight, start=done.estimate.x, robust=True, linearisations=40).x[index]
    assert (moved - done.estimate.x[index]) / math.log(exponent) == pytest.approx(said, rel=0.15)
    assert said == pytest.approx(1.0, abs=0.3)


def test_what_a_short_run_cannot_tell_is_said():
    done = calibrate_recordings([read_recording(BAG, SHEET.channels)], SHEET)
    dominated = {row["name"]: row for row in done.result["parameters"] if row["prior_dominated"]}
    assert set(dominated) == {"stribeck_speed", "cooling"}
    assert dominated["cooling"]["advice"] == "heat-and-rest"
    # The data add nothing: the interval is the sheet's own.
    assert dominated["cooling"]["relative_sd"] == pytest.approx(0.15, rel=0.2)
    alone = [set(c["parts"]) for c in done.result["undetermined"]]
    assert {"cooling"} in alone
    assert {"stribeck_speed"} in alone
    tied = next(c for c in done.result["undetermined"] if "temperature_sensitivity" in c["parts"])
    assert tied["parts"]["heat_capacity"] == pytest.approx(1.0, abs=0.2)
    assert "ratio with heat capacity" in tied["statement"]


def test_friction_of_another_form_does_not_turn_into_weather():
    """Torque that varies with the angle by 3 %, which no value explains: rubber of 15 degC does not become 1 degC."""
    truth = off_sheet(level=1.2)
    runs = [prepare(recording, SHEET) for recording in coverage.record(truth, coverage.QUICK, 5)]
    bent = [replace(run, measured=run.measured * (1.0 + 0.03 * np.sin(8.0 * run.theta[0]))) for run in runs]
    problem = Problem(SHEET, bent)
    found = estimate(problem)
    for bag in range(len(runs)):
        assert problem.temperatures(bag, found.x) == pytest.approx((15.0, 15.0), abs=4.0)
    sure = np.sqrt(np.diag(found.covariance))[: len(problem.calibrations)]
    assert np.all(sure < 1.1 * problem.scales()[: len(problem.calibrations)])  # never less than the sheet knows
    level = [c.name for c in problem.calibrations].index("friction_level")
    assert abs(found.x[level] - math.log(1.2)) < 2.0 * sure[level]


def test_a_value_beyond_its_range_is_flagged_at_the_bound():
    recordings = coverage.record(off_sheet(stiffness=2.5), coverage.QUICK, 5)
    row = next(r for r in calibrate_recordings(recordings, SHEET).result["parameters"] if r["name"] == "stiffness")
    assert row["at_bound"] == "high"


def test_pressure_gain_alone():
    wrong = SHEET.replace(sensors=dataclasses.replace(SHEET.sensors, pressure_gain=1.06))
    recordings = coverage.record(SHEET, coverage.QUICK, 6)
    names = ["friction_level", "static_ratio", "stiffness", "stribeck_speed", "heat_capacity", "cooling"]
    done = calibrate_recordings(recordings, wrong, chosen(wrong, free=["pressure_gain"], fix=names))
    assert done.vehicle.sensors.pressure_gain == pytest.approx(1.0, rel=2e-3)


def test_kingpin_arm_on_request():
    truth = SHEET.replace(axle=dataclasses.replace(SHEET.axle, kingpin_lever_arm_m=0.12))
    runs = [BUILT_IN["varied-rates"]]
    done = calibrate_recordings(coverage.record(truth, runs, 7), SHEET, chosen(SHEET, free=["kingpin_arm"]))
    row = next(r for r in done.result["parameters"] if r["name"] == "kingpin_arm")
    assert row["ci95"][0] < 0.12 < row["ci95"][1]
    assert row["value"] == pytest.approx(0.12, rel=0.1)


def test_single_joint(tmp_path):
    file = tmp_path / "joint.yaml"
    file.write_text(
        "schema: lugre_steering/vehicle/1\nname: joint\nsides: [left]\n"
        "contact: {static_torque_Nm: 130.0, coulomb_torque_Nm: 100.0, stiffness_Nm_per_deg: 80.0, "
        "stribeck_speed_deg_s: 2.0}\ntorque_sensor: {noise_Nm: 0.5}\n",
        encoding="utf-8",
    )
    truth = vehicle_file.load(file)
    contact = dataclasses.replace(
        truth.contact, static_torque_Nm=120.0, coulomb_torque_Nm=110.0, stiffness_Nm_per_deg=70.0
    )
    wrong = truth.replace(contact=contact)
    motion = Manoeuvre("m", "", (Hold(1.0), *(Sweep(a, r, 0.5) for a, r in ((20, 1), (-20, 8), (15, 3), (0, 0.7)))))
    done = calibrate_recordings(coverage.record(truth, [motion], 8), wrong)
    for row in done.result["parameters"]:
        true = KEY[row["key"]].read(truth)
        assert row["value"] == pytest.approx(true, rel=0.03), row
    assert [row["key"].split(".")[0] for row in done.result["parameters"]] == ["contact"] * 4


def test_vehicle_built_from_fitted_values_has_their_parameters():
    problem = Problem(SHEET, [prepare(r, SHEET) for r in coverage.record(SHEET, coverage.QUICK[:1], 1)])
    x = np.array([0.1, 0.05, -0.2, 0.15, 0.08, -0.12, 0.0])
    record = build_model(apply_calibration(SHEET, problem, x)).parameters[0][0]
    for field, value in problem.fields(x).items():
        assert record[field] == pytest.approx(value, rel=1e-12), field


@pytest.fixture(scope="module")
def commanded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("calibrate")
    sheet = folder / "sheet.yaml"
    vehicle_file.save(off_sheet(level=1.1, stiffness=0.9, capacity=1.1), sheet)
    out = folder / "out"
    outcome = CliRunner().invoke(app, ["calibrate", str(BAG), "--vehicle", str(sheet), "--out", str(out), "--json"])
    assert outcome.exit_code == 0, outcome.output
    return sheet, out, json.loads(outcome.stdout)


def test_the_picture_calls_what_was_fitted_by_its_title():
    figure = pytest.importorskip("matplotlib.figure")
    from lugre_steering.calibration.figure import _parameters

    row = {"value": 0.8, "sheet": 0.75, "ci95": [0.7, 0.9], "prior_relative_sd": None, "at_bound": False, "prior_dominated": False}
    axes = figure.Figure().subplots()
    _parameters(axes, [{**row, "key": key} for key in ("friction.coulomb", "rubber.heat_transfer_W_m2K")])
    assert [label.get_text() for label in axes.get_yticklabels()] == ["sliding friction", "heat transfer to the air"]


def test_what_is_hardly_determined_is_told_by_its_title_and_once_on_a_terminal(commanded):
    _, _, result = commanded
    weak = {key.key: key.beginning for key in KEYS if any(r["key"] == key.key and r["prior_dominated"] for r in result["parameters"])}
    assert weak
    shown = io.StringIO()
    show_calibration(Console(file=shown, width=80), result, "N m")
    for key, title in weak.items():
        assert f"{title} is hardly determined by these recordings" in result["statement"]
        assert key not in result["statement"]
        assert shown.getvalue().count(f"{key}: ") == 1
        assert title not in shown.getvalue()


def test_what_was_seen_of_the_rubber_is_told_from_the_coldest_start_to_the_warmest_end():
    """Standing rubber follows lambda A / (rho c A h) towards the air: one run cools down, the other warms up."""
    time = np.arange(0.0, 600.0, 0.5)
    still = np.zeros((2, time.size))
    run = SimpleNamespace(time=time, theta=still, omega=still, alpha=still)
    rubber = SHEET.rubber
    left = np.exp(-time[-1] * rubber.heat_transfer_W_m2K / (rubber.density_kg_m3 * rubber.specific_heat_J_kgK * rubber.tread_thickness_m))
    low, high = seen_range(SHEET, [run, run], [(30.0, 10.0), (5.0, 50.0)])["rubber_degC"]
    assert low == 5.0
    assert high == pytest.approx(max(30.0, 50.0 - 45.0 * left), abs=0.06)
    low, _ = seen_range(SHEET, [run], [(30.0, 10.0)])["rubber_degC"]
    assert low == pytest.approx(10.0 + 20.0 * left, abs=0.06)
    assert known_range(SHEET.replace(provenance={"seen": {"rubber_degC": [low, 30.0]}})).rubber == (low, 30.0)
    for nothing in (None, [3.0], [5.0, 3.0], ["a", "b"], [1.0, np.nan]):
        assert known_range(SHEET.replace(provenance={"seen": {"rubber_degC": nothing}})).rubber == (-np.inf, np.inf)


def test_what_was_seen_of_a_linear_axis_is_told_in_metres_and_earlier_files_still_read():
    axis = vehicle_file.load(ROOT / "config" / "linear_axis_example.yaml")
    runs = [SimpleNamespace(theta=np.array([[0.1, -0.15]]), omega=np.array([[0.0123456, 0.0]]))]
    assert seen_range(axis, runs) == {"position_m": 0.15, "rate_m_s": 0.01235}
    assert seen_range(SHEET, runs) == {"angle_deg": 8.59, "rate_deg_s": 0.71}
    earlier = {"angle_deg": np.degrees(0.15), "rate_deg_s": np.degrees(0.01235)}
    for vehicle, seen in ((axis, seen_range(axis, runs)), (axis, earlier), (SHEET, earlier)):
        for note in ({"seen": seen}, {"calibration": {"seen": seen}}):
            known = known_range(vehicle.replace(provenance=note))
            assert (known.angle, known.rate) == (pytest.approx(SLACK * 0.15), pytest.approx(SLACK * 0.01235))
    nothing = known_range(axis.replace(provenance={"seen": {"position_m": "far"}}))
    assert (nothing.angle, nothing.rate) == (np.inf, np.inf)


@pytest.mark.parametrize("weak", [["stribeck_speed"], ["stribeck_speed", "stiffness"]])
def test_what_is_not_determined_is_called_by_its_name(weak):
    direction = np.ones(len(weak))
    assert "Stribeck speed" in identify._fitted(weak, direction, 0.1).statement
    assert identify._tied("load", dict.fromkeys(weak, 1.0), 0.1).statement.startswith("load is the sheet's: only the ratio with Stribeck")


def test_files_of_the_command(commanded):
    sheet, out, printed = commanded
    assert json.loads((out / "calibration.json").read_text(encoding="utf-8")) == printed
    assert printed["schema"] == "lugre_steering/calibration/1"
    assert (out / "calibration.png").read_bytes().startswith(b"\x89PNG")
    note = vehicle_file.load(out / "calibrated.yaml").provenance["calibration"]
    recording = read_recording(BAG, SHEET.channels)
    farthest = max(float(np.abs(signal.value).max()) for signal in recording.angle.values())
    assert note["seen"]["angle_deg"] == pytest.approx(np.degrees(farthest), abs=0.05)
    assert 3.0 < note["seen"]["rate_deg_s"] < 20.0
    assert note["data"] == [str(BAG)]
    assert note["heldout_rmse_Nm"] == printed["heldout_rmse_Nm"]
    assert note["sheet"] == str(sheet)


def test_an_interrupted_calibration_can_be_repeated(tmp_path, monkeypatch):
    """Ctrl-C while the picture is drawn."""

    def interrupted(*_):
        raise KeyboardInterrupt

    arguments = ["calibrate", str(BAG), "--vehicle", str(SHEET_FILE), "--out", str(tmp_path)]
    with monkeypatch.context() as patch:
        patch.setattr("lugre_steering.calibration.figure.draw_calibration", interrupted)
        assert CliRunner().invoke(app, arguments).exit_code != 0
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert (tmp_path / "calibration.png").exists()


@pytest.mark.parametrize("name", ["calibration.json", "calibrated.yaml", "calibration.png"])
def test_files_of_others_are_never_replaced(tmp_path, name):
    (tmp_path / name).write_text("{}", encoding="utf-8")
    done = CliRunner().invoke(app, ["calibrate", str(BAG), "--vehicle", str(SHEET_FILE), "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert f"{name}: exists and is not part of an earlier result" in done.stderr
    assert (tmp_path / name).read_text(encoding="utf-8") == "{}"


def test_the_vehicle_file_is_never_replaced(commanded):
    _, out, _ = commanded
    done = CliRunner().invoke(app, ["calibrate", str(BAG), "--vehicle", str(out / "calibrated.yaml"), "--out", str(out)])
    assert done.exit_code == 2
    assert "would be replaced by the result" in done.stderr


def test_replay_with_the_calibrated_vehicle_is_better(commanded, tmp_path, monkeypatch):
    monkeypatch.setattr("lugre_steering.replay.passage.no_pictures", lambda: "not wanted")
    sheet, out, _ = commanded
    alone = tmp_path / "elsewhere.yaml"
    alone.write_bytes((out / "calibrated.yaml").read_bytes())
    before = replay([BAG], sheet, tmp_path / "a")["overall"]["rmse_Nm"]
    after = replay([BAG], alone, tmp_path / "b")["overall"]["rmse_Nm"]
    truth = replay([BAG], SHEET_FILE, tmp_path / "c")["overall"]["rmse_Nm"]
    assert after < 0.1 * before
    # Replay begins with the sheet's temperatures, and beside these the fitted values hold.
    assert after < 1.05 * truth


STILL = Manoeuvre("still", "", (Hold(15.0),))
TINY = Manoeuvre("tiny", "", (Hold(5.0), Sweep(0.5, 0.5, 5.0), Sweep(0.0, 0.5, 5.0)))
SHORT = Manoeuvre("short", "", (Hold(0.5), Sweep(14.0, 8.0, 1.0)))


@pytest.mark.parametrize(
    ("manoeuvre", "said"), [(STILL, "friction does not slide"), (TINY, "friction does not slide"), (SHORT, "s in all")]
)
def test_recordings_that_determine_nothing_are_refused(manoeuvre, said):
    with pytest.raises(DataError, match=said) as error:
        calibrate_recordings(coverage.record(SHEET, [manoeuvre], 1), SHEET)
    assert "varied-rates" in str(error.value)


def test_a_missing_line_is_named():
    recording = coverage.record(SHEET, coverage.QUICK[:1], 1)[0]
    pressure = {line: signal for line, signal in recording.pressure.items() if line != "aux_b"}
    with pytest.raises(DataError, match="pressure/aux_b"):
        calibrate_recordings([dataclasses.replace(recording, pressure=pressure)], SHEET)


def with_pressures(change):
    """The shipped recording with every pressure changed by line name and value."""
    recording = read_recording(BAG, SHEET.channels)
    pressure = {line: Signal(s.time_s, change(line, s.value)) for line, s in recording.pressure.items()}
    return dataclasses.replace(recording, pressure=pressure)


def with_angles(factor):
    recording = read_recording(BAG, SHEET.channels)
    angle = {side: Signal(s.time_s, factor * s.value) for side, s in recording.angle.items()}
    return dataclasses.replace(recording, angle=angle)


@pytest.mark.parametrize(
    ("recording", "said"),
    [
        (lambda: with_angles(-1.0), "sign is flipped"),
        (lambda: with_angles(180.0 / math.pi), "probably in degrees"),
        (lambda: with_pressures(lambda _, value: 1e-5 * value), "probably in bar"),
        (lambda: with_pressures(lambda _, value: 0.0 * value), "expected one that varies"),
    ],
)
def test_wrong_wiring_is_refused(recording, said):
    with pytest.raises(DataError, match=said) as error:
        calibrate_recordings([recording()], SHEET)
    assert str(error.value).startswith("synthetic_double_cycle")


def test_the_larger_of_two_variances_when_one_is_singular():
    a, b = np.diag([4.0, 0.0, 0.0]), np.diag([1.0, 9.0, 0.0])
    np.testing.assert_allclose(_larger(a, b), np.diag([4.0, 9.0, 0.0]), atol=1e-6)


def test_a_stuck_sensor_is_left_out_and_said():
    def stuck(line, value):
        value = value.copy()
        if line == "main_a":
            value[750:1750] = value[750]
        return value

    sound = calibrate_recordings([read_recording(BAG, SHEET.channels)], SHEET).result
    result = calibrate_recordings([with_pressures(stuck)], SHEET).result
    assert "stuck_sensor" in {entry["finding"] for entry in result["data_quality"]}
    assert "physics beyond" not in result["statement"]
    for row, right in zip(result["parameters"][:3], sound["parameters"], strict=False):
        assert row["value"] == pytest.approx(right["value"], rel=0.05), row


def test_the_static_ratio_without_the_level():
    recordings = coverage.record(SHEET, coverage.QUICK[:1], 1)
    done = calibrate_recordings(recordings, SHEET, chosen(SHEET, fix=["friction_level"]))
    assert done.vehicle.friction.static == pytest.approx(SHEET.friction.static, rel=0.02)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--free", "viscosity"], "--free viscosity"),
        (["--fix", "speed"], "--fix speed"),
        (["--prior", "stiffness"], "--prior stiffness"),
        (["--prior", "stiffness=0"], "--prior stiffness"),
        (["--prior", "stiffness=0.1", "--no-prior"], "--no-prior"),
        (["--prior", "kingpin_arm=0.05"], "--prior kingpin_arm: is not fitted"),
        (["--prior", "stiffness=0.1", "--fix", "stiffness"], "--prior stiffness: is not fitted"),
        (["--free", "pressure_gain", "--fix", "pressure_gain"], "--fix pressure_gain: is given to --free too"),
    ],
)
def test_wrong_options_end_with_one_line(options, said, tmp_path):
    arguments = ["calibrate", str(BAG), "--vehicle", str(SHEET_FILE), "--out", str(tmp_path / "out"), *options]
    outcome = CliRunner().invoke(app, arguments)
    assert outcome.exit_code == 2
    assert len(outcome.stderr.splitlines()) == 1
    assert said in outcome.stderr
    assert not (tmp_path / "out").exists()


def test_a_copy_of_a_recording_is_no_new_evidence(tmp_path):
    again = next(file for file in BAG.iterdir() if file.name != "metadata.yaml")
    done = CliRunner().invoke(
        app, ["calibrate", str(BAG), str(again), "--vehicle", str(SHEET_FILE), "--out", str(tmp_path / "out")]
    )
    assert done.exit_code == 2
    assert not (tmp_path / "out").exists()
