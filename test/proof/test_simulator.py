# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The second simulator is independent, physical, reproducible, and hides exactly what it says."""

from __future__ import annotations

import ast
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from outside import outside
from remembering import remembered
from rosbags.highlevel import AnyReader
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from lugre_steering.bench import own_error
from lugre_steering.diagnosis.loudness import OWN_ERROR
from lugre_steering.errors import DataError, VehicleFileError
from lugre_steering.proof import hydraulics, manoeuvres, simulator
from lugre_steering.proof.conceal import ZONED
from lugre_steering.proof.contact import HiddenContact, Patches, patches, run_track
from lugre_steering.proof.made import beside, recalibrated
from lugre_steering.proof.rubber import complex_modulus, rubber_table
from lugre_steering.proof.simulator import (
    EFFECT_IDS,
    UNLISTED_IDS,
    Case,
    Concealed,
    noise_variance,
    removable_variance,
    simulate_case,
    write_case,
)
from lugre_steering.proof.vehicle_draw import Sheet, TrueVehicle, draw_vehicle, load_sheet
from lugre_steering.proof.worlds import SecondCase

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
SHEET_FILE = ROOT / "config" / "test_vehicle.yaml"
MODULES = (
    "simulator", "contact", "conceal", "hydraulics", "manoeuvres", "rubber", "sensors", "vehicle_draw", "made", "bagfile", "generator",
)  # fmt: skip


TRACK, GAIN = remembered(run_track), remembered(hydraulics.line_gain)


@pytest.fixture(scope="module")
def sheet() -> Sheet:
    return load_sheet(SHEET_FILE)


@pytest.fixture(autouse=True)
def _short_manoeuvre(monkeypatch: pytest.MonkeyPatch) -> None:
    """A minute with both limits, holds and small reversals: wakes every effect, quick enough to run often. Same contacts run once."""

    def short(rng: np.random.Generator) -> Array:
        targets = manoeuvres.LIMIT_RAD * np.array([0.98, -0.98, 0.3, 0.2, 0.35, -0.1, 0.6, 0.0])
        return manoeuvres._sweep_to(targets, np.deg2rad(rng.uniform(6.0, 9.0, 8)), rng.uniform(1.0, 4.0, 8))

    monkeypatch.setitem(manoeuvres.KINDS, "short", short)
    monkeypatch.setattr(simulator, "run_track", TRACK)
    monkeypatch.setattr(hydraulics, "line_gain", GAIN)


def short_case(*effects: Concealed, seed: int = 4, noise: str = "white", bags: int = 2) -> Case:
    """``bags``: one will do where only the first is looked at, or where each shows the same."""
    return Case(seed, effects, noise=noise, manoeuvres=("short",) * bags)  # type: ignore[arg-type]


def lumped() -> Patches:
    """One patch: the contact without any of the simulator's own spread."""
    return Patches(np.ones(1), np.zeros(1), np.zeros(1))


def smooth_motion(time: Array) -> tuple[Array, Array]:
    """Angle and rate of a decaying swing that starts and ends slowly."""
    w, size = 0.6, 0.45
    angle = size * np.sin(w * time) ** 3 * np.exp(-0.02 * time)
    rate = size * np.exp(-0.02 * time) * np.sin(w * time) ** 2 * (3.0 * w * np.cos(w * time) - 0.02 * np.sin(w * time))
    return angle, rate


def one_page_model(v: TrueVehicle, time: Array) -> Array:
    """LuGre with heating and aligning torque, written from the equations and solved by Radau: torque (n,) [N m]."""
    reference = complex_modulus(np.array([v.reference_degC]))[0]

    def ratios(T: float) -> tuple[float, float]:
        modulus = complex_modulus(np.array([T]))[0]
        loss = (modulus.imag / abs(modulus)) / (reference.imag / abs(reference))
        return float(modulus.real / reference.real), float(loss)

    def bristle(t: float, state: Array) -> tuple[float, float, float]:
        z, T = state
        stiff, mu = ratios(T)
        rate = float(smooth_motion(np.array(t))[1])
        step = np.exp(-((abs(rate) / v.stribeck_speed_rad_s) ** v.stribeck_exponent))
        g = mu * (v.coulomb_torque_Nm + (v.static_torque_Nm - v.coulomb_torque_Nm) * step)
        sigma0 = v.stiffness_Nm_rad * stiff
        speed = rate - sigma0 * abs(rate) * z / g
        return speed, sigma0 * z, v.damping_Nms_rad * np.sqrt(stiff) * speed

    def change(t: float, state: Array) -> list[float]:
        speed, elastic, damping = bristle(t, state)
        rate = float(smooth_motion(np.array(t))[1])
        power = (elastic + damping) * rate - elastic * speed
        return [speed, (power - v.heat_loss_W_K * (state[1] - v.air_degC)) / v.heat_capacity_J_K]

    solution = solve_ivp(
        change, (0.0, time[-1]), [0.0, v.rubber_degC], method="Radau", t_eval=time, rtol=1e-8, atol=1e-9, max_step=0.05
    )
    parts = [bristle(t, state) for t, state in zip(time, solution.y.T, strict=True)]
    return np.array([e + d for _, e, d in parts])


@pytest.mark.parametrize("module", MODULES)
def test_shares_no_code_with_the_estimator(module: str) -> None:
    tree = ast.parse((Path(simulator.__file__).parent / f"{module}.py").read_text(encoding="utf-8"))
    names = [a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names]
    names += [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert all(node.level == 0 for node in ast.walk(tree) if isinstance(node, ast.ImportFrom))
    own = [name for name in names if name.startswith("lugre_steering")]
    allowed = {"lugre_steering.errors", "lugre_steering.chain.compiled", "lugre_steering.proof"}  # how to compile is no physics
    allowed |= {f"lugre_steering.proof.{m}" for m in MODULES}
    assert set(own) <= allowed


def test_rubber_formula_follows_the_sheets_table() -> None:
    table = np.genfromtxt(ROOT / "config" / "rubber_dma_10hz.csv", delimiter=",", skip_header=3)
    table = table[(table[:, 0] >= -30.0) & (table[:, 0] <= 100.0)]
    modulus = complex_modulus(table[:, 0])
    np.testing.assert_allclose(modulus.real, table[:, 1], rtol=2e-3)
    np.testing.assert_allclose(modulus.imag, table[:, 2], rtol=2e-3)


def test_lumped_contact_approaches_an_independent_solver(sheet: Sheet) -> None:
    v = draw_vehicle(sheet, np.random.default_rng(3), 0.15)._replace(heat_capacity_J_K=4000.0)
    seconds = np.arange(0.0, 20.0, 0.05)
    expected = one_page_model(v, seconds)
    worst = []
    for step in (2e-3, 1e-3, 5e-4):
        grid = np.arange(0.0, 20.0, step)
        track = run_track(smooth_motion(grid)[0], step, v, rubber_table(v.reference_degC), lumped(), HiddenContact())
        worst.append(np.abs(np.interp(seconds, grid, track.friction) - expected).max())
    assert worst[1] < 1e-3 * np.abs(expected).max()
    assert worst[2] < 0.65 * worst[1] < 0.65 * 0.65 * worst[0]


def test_patches_keep_the_lumped_torque_without_spread(sheet: Sheet) -> None:
    cells = patches(sheet, np.random.default_rng(0))
    assert cells.torque_share.size == 16
    assert cells.torque_share.sum() == pytest.approx(1.0)
    time = np.arange(0.0, 20.0, 1e-3)
    angle = smooth_motion(time)[0]
    rubber = rubber_table(15.0)
    one = run_track(angle, 1e-3, sheet.nominal, rubber, lumped(), HiddenContact()).friction
    even = run_track(angle, 1e-3, sheet.nominal, rubber, cells._replace(natural=0.0 * cells.natural), HiddenContact())
    natural = run_track(angle, 1e-3, sheet.nominal, rubber, cells, HiddenContact())
    assert np.abs(even.friction - one).max() < 2e-3 * np.abs(one).max()
    assert 1e-5 < np.sqrt(np.mean((natural.friction - one) ** 2)) / np.abs(one).max() < 2e-3


def test_friction_only_dissipates_and_all_of_it_heats(sheet: Sheet) -> None:
    """First law on one track without heat loss: work done = heat + what the bristles hold at the end."""
    v = sheet.nominal._replace(heat_loss_W_K=0.0)
    time = np.arange(0.0, 4.0 * np.pi / 0.6, 1e-3)
    angle = smooth_motion(time)[0]
    track = run_track(angle, 1e-3, v, rubber_table(15.0), lumped(), HiddenContact())
    work = np.concatenate([[0.0], np.cumsum(0.5 * (track.friction[1:] + track.friction[:-1]) * np.diff(angle))])
    heat = v.heat_capacity_J_K * (track.temperature - v.rubber_degC)
    assert work.min() > -1e-9 * work.max()
    assert np.diff(heat).min() > -1e-3
    stored = work[-1] - heat[-1]
    assert stored == pytest.approx(0.5 * track.friction[-1] ** 2 / v.stiffness_Nm_rad, abs=0.01 * work[-1])


def test_moment_arm_is_the_derivative_of_the_cylinder_length(sheet: Sheet) -> None:
    angle = np.linspace(-0.6, 0.6, 25)
    for cylinder in sheet.cylinders:

        knuckle, chassis = complex(*cylinder.knuckle_m), complex(*cylinder.chassis_m)
        longer, shorter = (np.abs(np.exp(1j * (angle + d)) * knuckle - chassis) for d in (1e-5, -1e-5))
        numeric = (longer - shorter) / 2e-5
        np.testing.assert_allclose(hydraulics.moment_arm(cylinder, angle), numeric, rtol=1e-7)


def test_pressures_deliver_the_required_torque_and_stay_physical(sheet: Sheet) -> None:
    rng = np.random.default_rng(1)
    angles = manoeuvres.ackermann(rng.uniform(-0.5, 0.5, 500), sheet.wheelbase_m, sheet.kingpin_distance_m)
    torque = rng.uniform(-6e4, 6e4, 500)
    gain = hydraulics.line_gain(sheet, angles)
    lines = hydraulics.line_pressures(torque, gain, np.array([1.0, 1.0, 0.93, 0.93]), rng.uniform(0.0, 1e5, 500))
    assert lines.min() >= hydraulics.BACK_PRESSURE_PA
    power = sum(  # virtual work, cylinder by cylinder
        (c.cap_area_m2 * lines[sheet.lines.index(c.cap_line)] - c.rod_area_m2 * lines[sheet.lines.index(c.rod_line)])
        * hydraulics.moment_arm(c, angles[c.side])
        for c in sheet.cylinders
    )
    np.testing.assert_allclose(power, torque, rtol=1e-9, atol=1e-6)


def test_ackermann_relation() -> None:
    left, right = manoeuvres.ackermann(np.array([0.3, -0.2, manoeuvres.LIMIT_RAD]), 3.6, 2.1)
    np.testing.assert_allclose(1.0 / np.tan(right) - 1.0 / np.tan(left), 2.1 / 3.6)
    assert np.rad2deg(left[2]) == pytest.approx(35.0, abs=0.3)
    assert np.rad2deg(right[2]) == pytest.approx(26.3, abs=0.3)


@pytest.mark.parametrize("kind", ["sweeps", "chirp", "decaying", "cycles", "loops"])
def test_manoeuvres_are_smooth_and_within_limits(kind: str) -> None:
    for seed in range(6):
        mean = manoeuvres.mean_angle(kind, np.random.default_rng(seed))
        rate = np.diff(mean) / manoeuvres.STEP_S
        acceleration = np.diff(rate) / manoeuvres.STEP_S
        assert 60.0 < mean.size * manoeuvres.STEP_S < 260.0
        assert np.abs(mean).max() <= manoeuvres.LIMIT_RAD + 1e-9
        assert np.abs(mean).max() > 0.85 * manoeuvres.LIMIT_RAD
        assert mean[0] == 0.0
        assert np.rad2deg(np.abs(rate).max()) < 12.5
        assert np.rad2deg(np.abs(acceleration).max()) < 120.0


def test_same_seed_same_recording_and_only_the_effect_differs(sheet: Sheet, monkeypatch: pytest.MonkeyPatch) -> None:
    first = simulate_case(short_case(Concealed("end_stop")), sheet)
    with monkeypatch.context() as afresh:
        afresh.setattr(simulator, "run_track", run_track)
        again = simulate_case(short_case(Concealed("end_stop")), sheet)
    other = simulate_case(short_case(Concealed("end_stop"), seed=5), sheet)
    null = simulate_case(short_case(), sheet)
    for a, b, c, n in zip(first.bags, again.bags, other.bags, null.bags, strict=True):
        np.testing.assert_array_equal(a.pressures[0].value, b.pressures[0].value)
        assert a.torque.size != c.torque.size or not np.array_equal(a.torque, c.torque)
        np.testing.assert_array_equal(a.angles[0].value, n.angles[0].value)
        np.testing.assert_array_equal(a.torque_without, n.torque)
        np.testing.assert_array_equal(n.torque, n.torque_without)


@pytest.mark.parametrize("effect", EFFECT_IDS + UNLISTED_IDS)
def test_every_effect_acts_and_grows_with_its_strength(effect: str, sheet: Sheet) -> None:
    size = {}
    for strength in (0.0, 0.5, 1.0):
        data = simulate_case(short_case(Concealed(effect, strength), bags=1), sheet)
        assert all(np.isfinite(bag.torque).all() and np.isfinite(bag.pressures[0].value).all() for bag in data.bags)
        size[strength] = np.sqrt(np.mean([removable_variance(bag) for bag in data.bags]))
    if effect != "relief_saturation":  # at margin 0 its ceiling still touches the very peak
        assert size[0.0] < 1e-6
    assert size[1.0] > 10.0
    assert 1.2 * size[0.5] < size[1.0]


def test_an_effect_can_be_limited_to_a_bag_or_begin_late(sheet: Sheet) -> None:
    data = simulate_case(short_case(Concealed("pressure_offset", only_bag=1)), sheet)
    assert removable_variance(data.bags[0]) == 0.0
    assert removable_variance(data.bags[1]) > 0.0
    for effect in ("viscous_friction", "line_loss_linear", "wear_polishing", "stress_relaxation", "backlash"):
        bag = simulate_case(short_case(Concealed(effect, from_time_s=25.0), bags=1), sheet).bags[0]
        added = np.abs(bag.torque - bag.torque_without)
        assert added[bag.time < 25.0].max() < 1e-3
        assert added[bag.time > 26.0].max() > 50.0
        assert bag.intervals[effect][0][0] >= 25.0


@pytest.mark.parametrize("effect", list(ZONED))
def test_a_zone_can_be_moved_to_the_edge(effect: str, sheet: Sheet) -> None:
    usual, barely = (
        simulate_case(short_case(Concealed(effect, barely=edge), seed=6, bags=1), sheet).bags[0] for edge in (False, True)
    )
    assert 0.0 < removable_variance(barely) < 0.5 * removable_variance(usual)


def test_two_effects_each_keep_their_own_part(sheet: Sheet) -> None:
    data = simulate_case(short_case(Concealed("end_stop"), Concealed("line_loss_linear"), bags=1), sheet)
    bag = data.bags[0]
    total = bag.torque - bag.torque_without
    np.testing.assert_allclose(bag.effect_torque["end_stop"] + bag.effect_torque["line_loss_linear"], total, atol=1e-6)
    threshold = next(h for h in data.hidden if h.id == "end_stop").values["threshold"]
    for low, high in bag.intervals["end_stop"]:
        inside = (bag.time >= low) & (bag.time <= high)
        assert np.abs(bag.clean_angles[:, inside]).max(axis=0).min() > threshold - np.deg2rad(1.0)


def test_sensors_have_the_noise_they_claim(sheet: Sheet) -> None:
    spread = {}
    for noise in ("white", "coloured", "ripple"):
        data = simulate_case(short_case(noise=noise, bags=1), sheet)
        bag = data.bags[0]
        spread[noise] = noise_variance(data, bag)
        angle = bag.angles[0]
        assert np.all(np.diff(angle.time) > 0.0)
        error = angle.value - np.interp(angle.time, bag.time, bag.clean_angles[0])
        expected = np.hypot(sheet.angle_noise_rad, sheet.angle_resolution_rad / 12**0.5)
        assert np.std(error) == pytest.approx(expected, rel=0.05)
        steps = angle.value / sheet.angle_resolution_rad
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    gain = hydraulics.line_gain(sheet, bag.clean_angles)
    white = float(np.mean(np.sum(gain**2, axis=0))) * sheet.pressure_noise_Pa**2
    assert spread["white"] == pytest.approx(white, rel=0.1)
    assert spread["coloured"] > 1.15 * white
    assert spread["ripple"] > 1.1 * white


def test_recalibration_hides_some_effects_more_than_others(sheet: Sheet) -> None:
    left = {}
    for effect in ("heat_partition", "end_stop"):
        data = simulate_case(short_case(Concealed(effect)), sheet)
        left[effect] = recalibrated(SecondCase(data)) / np.mean([removable_variance(bag) for bag in data.bags])
    assert left["heat_partition"] < 0.05
    assert 0.1 < left["end_stop"] < 1.0


def test_an_effect_beside_another_keeps_only_what_the_other_cannot_imitate(sheet: Sheet) -> None:
    """Two constants differ by nothing but their arms; an end stop and a constant have little in common."""
    alike = simulate_case(short_case(Concealed("slope_bias"), Concealed("pressure_offset")), sheet)
    apart = simulate_case(short_case(Concealed("slope_bias"), Concealed("end_stop")), sheet)
    alone = recalibrated(SecondCase(simulate_case(short_case(Concealed("slope_bias")), sheet)))
    assert beside(SecondCase(alike))["slope_bias"] < 0.3 * alone
    assert beside(SecondCase(apart))["slope_bias"] == pytest.approx(alone, rel=0.4)


@pytest.mark.parametrize(("seed", "suffix"), [(3, ".db3"), (4, ".mcap")])
def test_bags_follow_the_interface_and_hold_no_answer(tmp_path: Path, sheet: Sheet, seed: int, suffix: str) -> None:
    data = simulate_case(short_case(Concealed("soil_shear"), seed=seed), sheet)
    paths = write_case(data, tmp_path / "case", tmp_path / "truth")
    assert [path.name for path in paths] == ["run_a", "run_b"]
    assert (tmp_path / "case" / "vehicle.yaml").read_bytes() == SHEET_FILE.read_bytes()
    assert load_sheet(tmp_path / "case" / "vehicle.yaml").nominal == sheet.nominal
    for file in (tmp_path / "case").rglob("*"):
        assert "soil" not in file.name
        assert file.is_dir() or b"soil_shear" not in file.read_bytes()
    for path, bag in zip(paths, data.bags, strict=True):
        assert list(path.glob(f"*{suffix}"))
        with AnyReader([path]) as reader:
            types = {c.topic: c.msgtype for c in reader.connections}
            left = [c for c in reader.connections if c.topic == "/steering/left/joint_state"]
            messages = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(left)]
            line = [c for c in reader.connections if c.topic == "/steering/pressure/main_b"]
            fluid = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(line)]
        assert types == {
            "/steering/left/joint_state": "sensor_msgs/msg/JointState",
            "/steering/right/joint_state": "sensor_msgs/msg/JointState",
            **{f"/steering/pressure/{name}": "sensor_msgs/msg/FluidPressure" for name in sheet.lines},
        }
        assert {tuple(m.name) for m in messages} == {("left_track_steer_joint",)}
        np.testing.assert_array_equal([m.position[0] for m in messages], bag.angles[0].value)
        main_b = bag.pressures[sheet.lines.index("main_b")]
        np.testing.assert_array_equal([m.fluid_pressure for m in fluid], main_b.value)
        stamps = np.array([m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in messages])
        np.testing.assert_allclose((stamps - stamps[0]) * 1e-9, bag.angles[0].time - bag.angles[0].time[0], atol=2e-9)
        assert stamps[0] >= 1_790_000_000 * 10**9
    truth = json.loads((tmp_path / "truth" / "truth.json").read_text(encoding="utf-8"))
    assert truth["effects"][0]["id"] == "soil_shear"
    assert truth["effects"][0]["parameters"]["torque"]["unit"] == "N m"
    assert truth["bags"]["run_a"]["intervals_s"]["soil_shear"]
    with np.load(tmp_path / "truth" / "truth.npz") as arrays:
        np.testing.assert_array_equal(arrays["b_torque"], data.bags[1].torque)


def test_bad_input_is_refused_with_a_reason(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="end_stopp"):
        Concealed("end_stopp")
    with pytest.raises(DataError, match="no zone"):
        Concealed("viscous_friction", barely=True)
    with pytest.raises(VehicleFileError, match="absent"):
        load_sheet(tmp_path / "absent.yaml")
    (tmp_path / "half.yaml").write_text("axle: {load_N: 1.0}\n", encoding="utf-8")
    with pytest.raises(VehicleFileError, match="track"):
        load_sheet(tmp_path / "half.yaml")


CONFORMANCE = outside("conformance")


@pytest.mark.skipif(not CONFORMANCE.is_dir(), reason="the reference recording is not here")
def test_nominal_vehicle_reproduces_the_reference_simulation(sheet: Sheet) -> None:
    """An independent simulation of the same sheet, by others: torque within 0.1 % of its peak, 0.05 K."""
    with AnyReader([CONFORMANCE / "baseline_clean"]) as reader:
        sides = []
        for side in ("left", "right"):
            wanted = [c for c in reader.connections if c.topic == f"/steering/{side}/joint_state"]
            messages = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(wanted)]
            stamps = np.array([m.header.stamp.sec - 1_790_000_000 + m.header.stamp.nanosec * 1e-9 for m in messages])
            sides.append(CubicSpline(stamps, [m.position[0] for m in messages]))
    expected = np.genfromtxt(CONFORMANCE / "expected.csv", delimiter=",", names=True)
    time = np.arange(0.0, expected["t_s"][-1] + 1e-3, 1e-3)
    cells = patches(sheet, np.random.default_rng(0))
    tracks = [run_track(s(time), 1e-3, sheet.nominal, rubber_table(15.0), cells, HiddenContact()) for s in sides]
    torque = np.interp(expected["t_s"], time, sum(track.friction + track.aligning for track in tracks))
    error = np.sqrt(np.mean((torque - expected["torque_Nm"]) ** 2))
    assert error < 1e-3 * np.abs(expected["torque_Nm"]).max()
    warm = np.interp(expected["t_s"], time, tracks[0].temperature) - expected["left_temperature_degC"]
    assert np.abs(warm).max() < 0.05


def test_the_error_that_the_engine_allows_itself_covers_what_the_baseline_cannot_follow() -> None:
    """With nothing hidden and no noise, recalibration leaves little, and patches are what it cannot follow."""
    case = own_error.measure(1, SHEET_FILE)
    assert case["one patch"] < case["patches"] < OWN_ERROR * case["noise"]
    assert case["cylinders and lines"] < OWN_ERROR * case["noise"]
    # The motion as the sensors show it adds more than that; the noise model counts it, so it must see it.
    assert case["measured motion"] > 1.5 * case["cylinders and lines"]


def test_generated_law_is_hidden_in_the_second_simulator_too(sheet: Sheet, tmp_path: Path) -> None:
    """With a law the torque differs, without strength it does not; the unseen manoeuvre is written apart."""
    for seed in (21, 22, 24):
        off = simulate_case(replace(short_case(seed=seed, bags=1), law=0.0), sheet)
        np.testing.assert_allclose(off.bags[0].torque, off.bags[0].torque_without, atol=1e-6)
    data = simulate_case(replace(short_case(seed=21), law=1.0), sheet)
    assert removable_variance(data.bags[0]) > 0.0
    write_case(data, tmp_path / "seen", tmp_path / "unseen")
    assert not list((tmp_path / "seen").rglob("*unseen*"))
    assert (tmp_path / "unseen" / "run_unseen" / "metadata.yaml").exists()
    truth = np.load(tmp_path / "unseen" / "truth.npz")
    assert truth["unseen_time"][-1] == pytest.approx(data.bags[0].time[-1] / simulator.FASTER, rel=0.01)
