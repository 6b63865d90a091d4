# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The compiled step against stiff ODE solver, closed forms, energy, symmetry, one-page reference, C loop."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from chain_support import VEHICLE_FILE, baseline, final_state, frozen, swing
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_model import ReferenceTrack, reference_torque
from scipy.integrate import solve_ivp, trapezoid

from lugre_steering.bench.kernel_c import CLoop
from lugre_steering.chain.compiled import exp, tanh
from lugre_steering.chain.heat import heat
from lugre_steering.chain.lanes import LANES, torque_sets
from lugre_steering.chain.step import new_state, run_side, torque_side
from lugre_steering.recording import Array


def radau(track: ReferenceTrack, time: Array, omega: Callable[[float], float], heated: bool) -> tuple[Array, Array]:
    """Torque without aligning and temperature from the stiff ODE in (z, T), by a solver that knows no exact step."""

    def parts(t: float, z: float, T: float) -> tuple[float, float, float, float]:
        w = omega(t)
        sigma_0 = track.sigma_0 * track.ratios(T)[0]
        dz = w - sigma_0 * abs(w) * z / track.g(w, T)
        damping = 2 * track.xi * np.sqrt(sigma_0 * track.J) * dz
        return w, sigma_0, dz, damping

    def slope(t: float, state: Array) -> list[float]:
        z, T = state
        w, sigma_0, dz, damping = parts(t, z, T)
        power = max((sigma_0 * z + damping) * w - sigma_0 * z * dz, 0.0)
        heating = (power - track.cooling * (T - track.T_air)) / track.C if heated else 0.0
        return [dz, heating]

    solution = solve_ivp(
        slope, (time[0], time[-1]), [0.0, track.T], "Radau", time, rtol=1e-10, atol=1e-13, max_step=0.05
    )
    torque = np.empty(time.size)
    for i, (t, z, T) in enumerate(zip(time, *solution.y, strict=True)):
        _, sigma_0, _, damping = parts(t, z, T)
        torque[i] = sigma_0 * z + damping
    return torque, solution.y[1]


def smooth(t):  # type: ignore[no-untyped-def]
    return 0.3 * np.sin(0.6 * t) ** 2 * np.sin(0.23 * t)


def smooth_rate(t):  # type: ignore[no-untyped-def]
    return 0.3 * (0.6 * np.sin(1.2 * t) * np.sin(0.23 * t) + 0.23 * np.sin(0.6 * t) ** 2 * np.cos(0.23 * t))


def test_converges_to_the_stiff_solver_on_a_smooth_manoeuvre() -> None:
    p, rubber = baseline()
    p["aligning_torque"] = 0.0
    coarse = np.arange(0.0, 12.0, 0.08)
    expected, temperature = radau(ReferenceTrack(VEHICLE_FILE), coarse, smooth_rate, heated=True)
    errors = []
    for split in (40, 80, 160):  # 2, 1, 0.5 ms
        time = np.linspace(0.0, coarse[-1], (coarse.size - 1) * split + 1)
        out = run_side(p, rubber, time, smooth(time), smooth_rate(time), np.zeros(time.size))[::split]
        errors.append(np.abs(out["torque"] - expected).max() / np.abs(expected).max())
        assert np.abs(out["temperature"] - temperature).max() < 1e-3 * split / 40
    assert errors[0] < 1e-3
    # First order in the step (the rate is held over it), so halving the step halves the error.
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.15)


def test_constant_rates_are_solved_exactly() -> None:
    p, rubber = frozen()
    p["aligning_torque"] = 0.0
    rate = 0.08
    for step in (0.05, 0.5):
        time = np.arange(0.0, 5.01, step)
        expected, _ = radau(ReferenceTrack(VEHICLE_FILE), time, lambda _t: rate, heated=False)
        torque = torque_side(p, rubber, time, rate * time, np.full(time.size, rate), np.zeros(time.size))
        np.testing.assert_allclose(torque[1:], expected[1:], rtol=1e-8)


def test_ramp_response_is_the_closed_form() -> None:
    p, rubber = frozen()
    p["aligning_torque"] = 0.0
    rate, time = 0.1, np.arange(0.0, 8.0, 0.01)
    torque = run_side(p, rubber, time, rate * time, np.full(time.size, rate), np.zeros(time.size))
    Mc, Ms, s0, w = (p[name][0] for name in ("coulomb_torque", "static_torque", "sigma_0", "stribeck_speed"))
    g = Mc + (Ms - Mc) * np.exp(-((rate / w) ** 2))
    np.testing.assert_allclose(torque["elastic"], g * (1.0 - np.exp(-s0 * rate * time / g)), rtol=1e-10, atol=1e-8)
    damping = p["damping_factor"][0] * np.sqrt(s0) * rate * np.exp(-s0 * rate * time / g)
    np.testing.assert_allclose(torque["damping"], damping, rtol=1e-9, atol=1e-8)


def test_agrees_with_the_one_page_reference() -> None:
    time, theta, omega, alpha = swing(40.0, 0.02)
    angles, rates = np.column_stack([theta, -0.9 * theta]), np.column_stack([omega, -0.9 * omega])
    torque, temperature = reference_torque(VEHICLE_FILE, list(time), angles, rates)
    p, rubber = baseline()
    for side in range(2):
        out = run_side(p, rubber, time, angles[:, side].copy(), rates[:, side].copy(), alpha)
        np.testing.assert_allclose(out["torque"], torque[:, side], rtol=1e-9, atol=1e-9 * np.abs(torque).max())
        np.testing.assert_allclose(out["temperature"], temperature[:, side], rtol=1e-9)


def test_c_loop_is_the_same_model() -> None:
    loop = CLoop.build()
    if loop is None:
        pytest.skip("no gcc")
    p, rubber = baseline()
    motion = swing(60.0, 0.01)
    expected = torque_side(p, rubber, *motion)
    np.testing.assert_allclose(loop.torque_side(p, rubber, *motion[:3]), expected, rtol=1e-11, atol=1e-7)


def test_energy_balance() -> None:
    p, rubber = frozen()
    p["aligning_torque"] = 0.0
    motion = swing(40.0, 1e-4)
    state = new_state(p)
    out = run_side(p, rubber, *motion, state)
    work = trapezoid((out["elastic"] + out["damping"]) * motion[2], motion[0])
    stored = 0.5 * p["sigma_0"][0] * state["z"][0] ** 2
    accounted = stored + state["heat"][0] + state["non_passive"][0]
    assert state["heat"][0] > 1000.0
    assert accounted == pytest.approx(work, rel=1e-6)
    assert state["work"][0] == pytest.approx(accounted, rel=1e-12)


def test_heat_warms_the_rubber_by_its_capacity() -> None:
    p, rubber = baseline()
    p["cooling"] = 0.0
    state = final_state(p, rubber, *swing(60.0, 0.01))
    assert state["temperature"][0] - p["rubber_temperature"][0] == pytest.approx(
        state["heat"][0] / p["heat_capacity"][0], rel=1e-9
    )


def test_cooling_is_the_exponential() -> None:
    p, rubber = baseline()
    p["rubber_temperature"] = 60.0
    time = np.arange(0.0, 600.0, 0.1)
    still = np.zeros(time.size)
    out = run_side(p, rubber, time, still, still, still)
    expected = 15.0 + 45.0 * np.exp(-p["cooling"][0] / p["heat_capacity"][0] * time)
    np.testing.assert_allclose(out["temperature"], expected, rtol=1e-7)


@pytest.mark.parametrize("gap", [60.0, 600.0, 3600.0, 12 * 3600.0])
def test_a_long_gap_is_the_exponential_too(gap: float) -> None:
    p, rubber = baseline()
    p["rubber_temperature"] = 60.0
    time, still = np.array([0.0, gap]), np.zeros(2)
    rate = p["cooling"][0] / p["heat_capacity"][0]
    expected = 15.0 + 45.0 * np.exp(-rate * gap)
    assert run_side(p, rubber, time, still, still, still)["temperature"][-1] == pytest.approx(expected, abs=0.02)
    warmed = heat(60.0, 1e6, gap, p["heat_capacity"][0], p["cooling"][0], 15.0)
    assert warmed - expected == pytest.approx(1e6 / gap / p["cooling"][0] * (1.0 - np.exp(-rate * gap)), rel=1e-3)


steps = st.lists(
    st.tuples(st.floats(-0.6, 0.6), st.floats(0.002, 0.2)), min_size=2, max_size=40
)  # rate [rad/s] and duration [s] of each sample


def motion_of(pieces: list[tuple[float, float]], split: int = 1) -> tuple[Array, Array, Array, Array]:
    rate = np.concatenate([[0.0], np.repeat([r for r, _ in pieces], split)])
    dt = np.concatenate([[0.0], np.repeat([d / split for _, d in pieces], split)])
    return np.cumsum(dt), np.cumsum(rate * dt), rate, np.zeros(rate.size)


@settings(max_examples=150)
@given(steps, st.integers(2, 7))
def test_step_size_does_not_matter_at_constant_rate(pieces: list[tuple[float, float]], split: int) -> None:
    p, rubber = frozen()
    whole = torque_side(p, rubber, *motion_of(pieces))
    fine = torque_side(p, rubber, *motion_of(pieces, split))
    np.testing.assert_allclose(fine[::split], whole, rtol=1e-9, atol=1e-6)


@settings(max_examples=100)
@given(steps)
def test_sign_symmetry(pieces: list[tuple[float, float]]) -> None:
    p, rubber = baseline()
    time, theta, omega, alpha = motion_of(pieces)
    one, other = torque_side(p, rubber, time, theta, omega, alpha), torque_side(p, rubber, time, -theta, -omega, alpha)
    np.testing.assert_allclose(one, -other, rtol=1e-12, atol=1e-7)


@settings(max_examples=100)
@given(steps)
def test_dissipation_is_never_negative_and_the_rest_is_booked(pieces: list[tuple[float, float]]) -> None:
    p, rubber = baseline()
    motion = motion_of(pieces)
    heat = [final_state(p, rubber, *(column[: k + 1] for column in motion))["heat"][0] for k in range(motion[0].size)]
    assert np.all(np.diff([0.0, *heat]) >= 0.0)
    p, rubber = frozen()
    state = final_state(p, rubber, *motion)[0]
    stored = 0.5 * p["sigma_0"][0] * state["z"] ** 2
    assert state["work"] == pytest.approx(stored + state["heat"] + state["non_passive"], rel=1e-9, abs=1e-6)
    # The bristle alone, without presliding damping, is passive to rounding.
    p["damping_factor"] = 0.0
    assert final_state(p, rubber, *motion)[0]["non_passive"] > -1e-9


@settings(max_examples=100)
@given(steps)
def test_bristle_never_exceeds_static_friction(pieces: list[tuple[float, float]]) -> None:
    p, rubber = frozen()
    out = run_side(p, rubber, *motion_of(pieces))
    assert np.abs(out["elastic"]).max() <= p["static_torque"][0] * (1.0 + 1e-12)


def test_temperature_outside_the_table_is_clamped_and_counted() -> None:
    p, rubber = baseline()
    p["rubber_temperature"] = p["table_low"][0] - 20.0
    p["air_temperature"] = p["rubber_temperature"]
    motion = swing(1.0, 0.01)
    state = final_state(p, rubber, *motion)
    assert state["saturated"][0] == motion[0].size
    colder = run_side(p, rubber, *motion)["torque"]
    p["rubber_temperature"] = p["air_temperature"] = p["table_low"][0] - 1e-9
    np.testing.assert_allclose(colder[:3], run_side(p, rubber, *motion)["torque"][:3], rtol=1e-9)


def test_original_lugre_is_the_frozen_temperature() -> None:
    p, rubber = frozen()
    time, theta, omega, alpha = swing(60.0, 0.01)
    out = run_side(p, rubber, time, theta, omega, alpha)
    assert np.all(out["temperature"] == p["rubber_temperature"][0])


@pytest.mark.parametrize("gap", [0.0, 7200.0])
def test_lanes_equal_the_scalar_path(gap: float) -> None:
    p, rubber = baseline()
    sets = LANES + 7
    many = np.repeat(p, sets)
    rng = np.random.default_rng(3)
    for name in ("static_torque", "coulomb_torque", "sigma_0", "heat_capacity", "stribeck_speed", "damping_factor"):
        many[name] *= rng.uniform(0.8, 1.2, sets)
    many["rubber_temperature"] += rng.uniform(-120.0, 200.0, sets)  # beyond both ends of the table, too
    many["initial_bristle"] = rng.uniform(-0.05, 0.05, sets)
    many["heat_capacity"][5] = np.inf
    time, theta, omega, alpha = swing(20.0, 0.01)
    time[1500:] += gap
    for tables in (rubber, np.stack([rubber * (1.0 + 0.01 * k) for k in range(sets)])):
        together = torque_sets(many, tables, time, theta, omega)
        for k in range(sets):
            table = tables if tables.ndim == 2 else tables[k]
            alone = torque_side(many[k : k + 1], table, time, theta, omega, alpha)
            np.testing.assert_allclose(together[:, k], alone, rtol=1e-12, atol=1e-12 * np.abs(alone).max())


def test_lanes_fall_back_for_effects_and_other_exponents() -> None:
    p, rubber = baseline()
    many = np.repeat(p, 3)
    many["stribeck_exponent"][1] = 1.3
    many["slope_bias_torque"][2] = 500.0
    time, theta, omega, alpha = swing(5.0, 0.01)
    together = torque_sets(many, rubber, time, theta, omega)
    for k in range(3):
        np.testing.assert_array_equal(together[:, k], torque_side(many[k : k + 1], rubber, time, theta, omega, alpha))


def test_functions_of_our_own_are_those_of_the_library() -> None:
    some = np.linspace(-700.0, 700.0, 20_001)
    assert np.all(np.abs(np.array([exp(x) for x in some]) - np.exp(some)) <= 3.0 * np.spacing(np.exp(some)))
    near = np.array([*np.linspace(-30.0, 30.0, 20_001), -np.inf, -800.0, 0.0, 1e-12, 800.0, np.inf])
    np.testing.assert_allclose([tanh(x) for x in near], np.tanh(near), rtol=0.0, atol=3e-16)
