# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The third simulator against closed forms, an independent solver, the first law, and what it promises about its recordings."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from remembering import remembered
from rosbags.highlevel import AnyReader
from scipy.integrate import solve_ivp

from lugre_steering.proof import field
from lugre_steering.proof.field import dirt, hydraulics, machine, motion, sheets, simulator
from lugre_steering.proof.field import hidden as physics
from lugre_steering.proof.field.friction import REFERENCE_RATE, Cells, Ground, Inside, Turned, turn_track
from lugre_steering.proof.field.rubber import Ratios, draw_rubber, modulus, ratios
from lugre_steering.proof.made import Wanted, recalibrated
from lugre_steering.vehicle import load

Array = NDArray[np.float64]

GROUND = Ground(
    sliding_Nm=2e4, static_ratio=1.0, stiffness_Nm_rad=3e5, stribeck_speed=0.03, stribeck_exponent=1.0, sharpness=1.0,
    rate_strengthening=0.0, direct_share=0.0, follow_angle=0.005, quick_share=0.0, quick_time=0.05, waves=np.zeros((1, 3)),
    heat_capacity_J_K=1e12, heat_loss_W_K=0.0, rubber_degC=15.0, air_degC=15.0, aligning_Nm=0.0,
)  # fmt: skip
ONE = Cells(np.ones(1), np.ones(1))
FLAT = Ratios(np.ones(1000), np.ones(1000))


def turn(angle: Array, ground: Ground, cells: Cells = ONE, step: float = 1e-3, hide: Inside | None = None) -> Turned:
    ones = np.ones(angle.size)
    found: Turned = turn_track(angle, step, ground, FLAT, cells, hide or Inside(), ones, ones)
    return found


def test_bristle_follows_the_exponential_of_its_closed_form() -> None:
    """n = 1, one cell, no branch: f = y (1 - e^(-k x / y)) at first, y - 2 y (1 - e^(-k x / y)) ... after a reversal."""
    out, back = np.linspace(0.0, 0.3, 3001), np.linspace(0.3, 0.1, 2001)[1:]
    torque = turn(np.concatenate([out, back]), GROUND).friction
    length = GROUND.sliding_Nm / GROUND.stiffness_Nm_rad
    virgin = GROUND.sliding_Nm * (1.0 - np.exp(-out / length))
    at = virgin[-1]
    reverse = -GROUND.sliding_Nm + (at + GROUND.sliding_Nm) * np.exp(-(0.3 - back) / length)
    np.testing.assert_allclose(torque, np.concatenate([virgin, reverse]), atol=1e-4 * GROUND.sliding_Nm)


def test_sharp_bristles_become_maxwell_slip() -> None:
    """A large power is elastic until it yields: cells of graded strength are Jenkin elements, and a reversal obeys Masing."""
    cells = Cells(np.array([0.1, 0.3, 0.6]), np.array([0.5, 0.3, 0.2]))
    out, back = np.linspace(0.0, 0.4, 8001), np.linspace(0.4, 0.0, 8001)[1:]
    ground = GROUND._replace(sharpness=80.0)
    torque = turn(np.concatenate([out, back]), ground, cells).friction

    def virgin(x: Array) -> Array:
        k, y = ground.stiffness_Nm_rad * cells.stiffness, ground.sliding_Nm * cells.strength
        return np.asarray(np.minimum(np.outer(x, k), y).sum(axis=1))

    expected = np.concatenate([virgin(out), virgin(np.array([0.4]))[0] - 2.0 * virgin(0.5 * (0.4 - back))])
    assert np.abs(torque - expected).max() < 0.03 * ground.sliding_Nm  # the knee of a power of 80


@pytest.mark.parametrize("rate_deg_s", [1.0, 4.0, 10.0])
def test_steady_sliding_has_the_stated_strength(rate_deg_s: float) -> None:
    ground = GROUND._replace(static_ratio=1.15, stribeck_exponent=0.7, rate_strengthening=0.03, direct_share=0.3)
    rate = np.deg2rad(rate_deg_s)
    torque = turn(np.arange(0.0, 1.0, rate * 1e-3), ground).friction[-1]
    weak = 0.15 * np.exp(-((rate / 0.03) ** 0.7))
    assert torque == pytest.approx(2e4 * (1.0 + weak + 0.03 * np.log(1.0 + rate / REFERENCE_RATE)), rel=1e-3)


def test_first_motion_shows_the_stiffness_and_the_branch_relaxes() -> None:
    ground = GROUND._replace(quick_share=0.1, quick_time=0.05)
    angle = np.concatenate([np.linspace(0.0, 1e-4, 11), np.full(1000, 1e-4)])
    torque = turn(angle, ground).friction
    assert torque[10] == pytest.approx(1.1 * 3e5 * 1e-4, rel=0.02)
    assert torque[-1] == pytest.approx(3e5 * 1e-4, rel=0.01)


def test_viscoelastic_cell_agrees_with_an_independent_solver() -> None:
    ground = GROUND._replace(sharpness=1.3, quick_share=0.15, quick_time=0.08)

    def angle(t: Array | float) -> Array:
        return np.asarray(0.25 * np.sin(0.7 * np.asarray(t)))

    def change(t: float, state: Array) -> list[float]:
        z, m = state
        rate = 0.25 * 0.7 * np.cos(0.7 * t)
        load = 3e5 * (z + m) / 2e4
        speed = rate - abs(rate) * np.sign(load) * abs(load) ** 1.3
        return [speed, 0.15 * speed - m / 0.08]

    time = np.arange(0.0, 20.0, 0.05)
    solved = solve_ivp(change, (0.0, 20.0), [0.0, 0.0], method="Radau", t_eval=time, rtol=1e-8, atol=1e-10, max_step=0.01)
    expected = 3e5 * solved.y.sum(axis=0)
    worst = []
    for step in (4e-3, 2e-3):
        grid = np.arange(0.0, 20.0, step)
        worst.append(np.abs(np.interp(time, grid, turn(angle(grid), ground, step=step).friction) - expected).max() / 2e4)
    assert worst[1] < 2e-3
    assert worst[1] < 0.6 * worst[0]


def test_work_becomes_heat_and_stored_energy() -> None:
    ground = GROUND._replace(heat_capacity_J_K=1e4, sharpness=1.2)
    time = np.arange(0.0, 30.0, 1e-3)
    angle = 0.4 * np.sin(0.5 * time)
    track = turn(angle, ground)
    work = np.cumsum(0.5 * (track.friction[1:] + track.friction[:-1]) * np.diff(angle))
    heat = ground.heat_capacity_J_K * (track.temperature - 15.0)
    assert np.diff(heat).min() >= 0.0
    stored = 0.5 * track.friction[-1] ** 2 / ground.stiffness_Nm_rad
    assert work[-1] - heat[-1] == pytest.approx(stored, abs=0.01 * work[-1])


def test_rubber_is_causal_and_softens() -> None:
    """Both moduli positive, storage falling with temperature; the ratios are 1 at the reference."""
    for seed in range(5):
        rubber = draw_rubber(np.random.default_rng(seed))
        value = modulus(rubber, np.arange(-50.0, 120.0, 5.0))
        assert (value.imag > 0.0).all()
        assert (np.diff(value.real) < 0.0).all()
        both, at = ratios(rubber, 15.0), round((15.0 + 80.0) / 0.25)
        assert both.friction[at] == pytest.approx(1.0)
        assert 0.003 < 1.0 - both.friction[at + 4] < 0.02  # per kelvin


MACHINES = [machine.draw_machine(np.random.default_rng(seed)) for seed in range(12)]


def test_machines_are_of_all_sizes_and_circuits() -> None:
    assert {m.circuit_share.size for m in MACHINES} == {1, 2, 3, 4}
    loads = [m.load_N for m in MACHINES]
    assert max(loads) > 4.0 * min(loads)


def test_levers_are_derivatives_and_pressures_do_the_work() -> None:
    rng = np.random.default_rng(1)
    for m in MACHINES:
        mean = rng.uniform(-m.limit, m.limit, 200)
        angles = machine.track_angles(m, mean)
        for ram in m.rams:
            reach = [np.abs(ram.knuckle * np.exp(1j * (angles[ram.side] + d)) - ram.chassis) for d in (1e-6, -1e-6)]
            np.testing.assert_allclose(ram.lever(angles[ram.side]), (reach[0] - reach[1]) / 2e-6, rtol=1e-5)
        torque = rng.uniform(-1.0, 1.0, 200) * 1.6 * m.sliding * m.lever_sum
        gain = hydraulics.gains(m, angles)
        lines = hydraulics.pressures(m, torque, gain, hydraulics.Valves(0.1, 3e5), rng.uniform(-0.1, 0.1, 200))
        np.testing.assert_allclose(hydraulics.torque_of(lines, gain), torque, atol=1e-6 * np.abs(torque).max())
        assert lines.min() >= 0.0
        assert lines.max() < 35e6


@pytest.mark.parametrize("name", sorted(path.stem for path in Path(str(field.__file__)).parent.glob("*.py")))
def test_shares_no_code_with_the_estimator_nor_a_law_with_the_second_simulator(name: str) -> None:
    tree = ast.parse((Path(str(field.__file__)).parent / f"{name}.py").read_text(encoding="utf-8"))
    names = [a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names]
    names += [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    shared = {f"lugre_steering.proof.{module}" for module in ("made", "bagfile", "generator", "sensors")}
    own = {name for name in names if name.startswith("lugre_steering") and not name.startswith("lugre_steering.proof.field")}
    assert own <= shared


TRACK = remembered(turn_track)


@pytest.fixture(autouse=True)
def _each_track_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulator, "turn_track", TRACK)


@pytest.fixture(scope="module")
def setting() -> simulator.Setting:
    """A case of one quick drive, both bags alike."""
    drawn = simulator.draw_setting(8, "beside", "white")
    limit = drawn.machine.limit
    targets = limit * np.array([0.99, -0.99, 0.4, 0.3, 0.45, -0.2, 0.95, -0.3])
    mean = motion.strokes(targets, np.deg2rad([6.0, 9.0, 4.0, 3.0, 5.0, 7.0, 8.0, 5.0]), np.array([3.0, 6.0, 1.0, 1.0, 0.5, 4.0, 1.0, 2.0]))
    drives = (simulator.Drive("short", mean, 20.0, 20.0), simulator.Drive("short", -mean, 20.0, 20.0))
    return simulator.replace(drawn, drives=drives)


@pytest.mark.parametrize("name", sorted(physics.CATALOGUE))
def test_every_effect_acts_and_is_neutral_without_strength(setting: simulator.Setting, name: str) -> None:
    first = simulator.replace(setting, drives=setting.drives[:1])
    acts = simulator.simulate(first, [Wanted(name)])
    off = simulator.simulate(first, [Wanted(name, strength=0.0)])
    size = np.sqrt(np.mean((acts.bags[0].torque - acts.bags[0].torque_without) ** 2))
    assert size > 5e-4 * setting.torque_scale
    np.testing.assert_allclose(off.bags[0].torque, off.bags[0].torque_without, atol=1e-6 * setting.torque_scale)
    np.testing.assert_array_equal(acts.bags[0].torque_without, off.bags[0].torque_without)
    assert acts.bags[0].intervals[name]


def test_effects_leave_sensor_noise_alone_and_repeat(setting: simulator.Setting, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = simulator.simulate(setting, [Wanted("slope_bias")]), simulator.simulate(setting, [])
    np.testing.assert_array_equal(one.bags[1].angles[0].value, two.bags[1].angles[0].value)
    assert recalibrated(one) > 0.0
    monkeypatch.setattr(simulator, "turn_track", turn_track)  # not as remembered
    np.testing.assert_array_equal(simulator.simulate(setting, []).bags[0].pressures[0].value, two.bags[0].pressures[0].value)


def test_late_and_one_bag_are_where_they_should(setting: simulator.Setting) -> None:
    late = simulator.simulate(setting, [Wanted("slope_bias", from_time_s=20.0)]).bags[0]
    np.testing.assert_allclose(late.effect_torque["slope_bias"][late.time < 20.0], 0.0, atol=1e-6)
    single = simulator.simulate(setting, [Wanted("slope_bias", only_bag=1)])
    assert not single.bags[0].effect_torque
    assert single.bags[1].effect_torque


def test_written_case_reads_back_and_tells_nothing(setting: simulator.Setting, tmp_path: Path) -> None:
    made = simulator.simulate(setting, [Wanted("end_stop")])
    bags = made.write(tmp_path / "seen", tmp_path / "unseen")
    with AnyReader([bags[0]]) as reader:
        topics = {connection.topic: connection.msgcount for connection in reader.connections}
        values = [
            (message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec, message.position[0], message.name[0])
            for message in (
                reader.deserialize(raw, connection.msgtype)
                for connection, _, raw in reader.messages() if connection.topic == "/steering/left/joint_state"
            )
        ]  # fmt: skip
    assert topics["/steering/left/joint_state"] == made.bags[0].angles[0].time.size
    np.testing.assert_array_equal([value for _, value, _ in values], made.bags[0].angles[0].value)
    np.testing.assert_allclose(np.diff([at for at, _, _ in values]), np.diff(made.bags[0].angles[0].time), atol=1e-6)
    assert {name for _, _, name in values} == {"left_track_steer_joint"}
    seen = [file for file in (tmp_path / "seen").rglob("*") if file.is_file()]
    assert not any(b"end_stop" in file.read_bytes() for file in seen)
    assert load(tmp_path / "seen" / "vehicle.yaml").hydraulics is not None


def test_dirt_is_of_the_stated_size() -> None:
    """Loss, gap, skew and quantum of a recording are what the draw says."""
    time = np.arange(0.0, 120.0, 2e-3)
    angles, pressure = np.stack([0.3 * np.sin(0.3 * time)] * 2), np.stack([1e7 + 5e6 * np.sin(0.3 * time)] * 2)
    habits = dirt.Dirt(
        lost=0.2, gap_s=3.0, skew_s=0.02, pressure_bits=10, angle_step=1e-3, jitter_s=1e-4, white_share=1e-5, angle_noise=0.0
    )
    seen, lines = dirt.sense(time, angles, pressure, habits, np.random.default_rng(2))
    assert seen[0].time.size == pytest.approx(0.8 * 117.0 * 100.0, rel=0.03)
    assert np.diff(seen[0].time).max() > 3.0
    assert (np.diff(lines[0].time) > 0.0).all()
    np.testing.assert_allclose(np.round(seen[1].value / 1e-3) * 1e-3, seen[1].value, atol=1e-12)
    assert np.unique(np.diff(np.unique(lines[0].value))).min() == pytest.approx(25e6 / 1024, rel=1e-6)
    shift = np.linspace(-0.05, 0.05, 201)
    error = [np.mean((np.interp(lines[0].time + s, time, pressure[0]) - lines[0].value) ** 2) for s in shift]
    assert shift[int(np.argmin(error))] == pytest.approx(-0.02, abs=2e-3)


def test_dirty_draws_span_the_table() -> None:
    drawn = [dirt.draw_dirt(noise, np.random.default_rng(seed)) for seed in range(120) for noise in ("white", "coloured", "ripple")]
    assert min(d.angle_Hz for d in drawn) < 15.0
    assert max(d.angle_Hz for d in drawn) > 400.0
    assert {d.pressure_bits for d in drawn} == set(range(8, 17))
    assert max(d.lost for d in drawn) > 0.3
    assert max(d.white_share for d in drawn) > 5e-3
    assert max(d.angle_step for d in drawn) <= np.deg2rad(0.1)
    assert 0.3 < np.mean([d.skew_s == 0.0 for d in drawn]) < 0.7


@pytest.mark.parametrize("which", range(sheets.KINDS))
def test_wrong_sheets_load_and_differ_from_the_right_one(which: int, tmp_path: Path) -> None:
    wrong = simulator.draw_setting(31, "sheet", "white", which)
    right = simulator.draw_setting(31, "dirty", "white")
    assert wrong.mistake
    assert all(re.compile(pattern) for pattern in wrong.suspects)
    assert (wrong.sheet == machine.sheet_of(wrong.machine, dict(dirt.STATED), 15.0, 15.0)) == (wrong.mistake == sheets.ANGLE_ZERO)  # type: ignore[arg-type]
    assert (wrong.zero_rad != 0.0) == (wrong.mistake == sheets.ANGLE_ZERO)
    assert wrong.machine.load_N == right.machine.load_N
    (tmp_path / "rubber.csv").write_text(simulator.rubber.table(wrong.machine.rubber), encoding="utf-8")
    (tmp_path / "vehicle.yaml").write_text(yaml.safe_dump(wrong.sheet), encoding="utf-8")
    load(tmp_path / "vehicle.yaml")


def test_unseen_drive_is_quicker_and_wider() -> None:
    mean = motion.draw_mean(0.4, 60.0, np.random.default_rng(3))
    quick = motion.hurried(mean, 1.5, 1.1)
    assert quick.size == pytest.approx(mean.size / 1.5, rel=1e-3)
    assert np.abs(quick).max() == pytest.approx(1.1 * np.abs(mean).max(), rel=1e-3)
