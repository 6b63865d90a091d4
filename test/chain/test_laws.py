# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Laws of the vehicle file: those that the catalogue also has give its numbers, the others those of a plain formula."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from catalogue import put_back
from chain_support import swing, vehicle
from scipy.signal import lsim

from lugre_steering.chain.step import run_side, torque_side
from lugre_steering.effects import laws
from lugre_steering.effects.law_entry import named
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.estimator import Estimator, doubts
from lugre_steering.recording import Array
from lugre_steering.vehicle import EffectEntry, LawEntry, Vehicle
from lugre_steering.vehicle.model import build_model

TIME, THETA, OMEGA, _ = swing(30.0, 0.01)
ALPHA = np.gradient(OMEGA, TIME)
NARROW = LawEntry("friction_level", "angle", "linear", (-0.05, 0.05), {"value": 0.0, "slope": 2.0})
"""A law of few angles."""


def torque(changed: Vehicle) -> Array:
    """Of the left track, with only what the vehicle has in the step."""
    model = build_model(changed, lean=True)
    return torque_side(model.parameters[0], model.rubber, TIME, THETA, OMEGA, ALPHA)


def with_law(*laws: LawEntry) -> Array:
    return torque(vehicle().replace(laws=laws))


def constant(channel: str, value: float) -> LawEntry:
    return LawEntry(channel, "none", "constant", (-1.0, 1.0), {"value": value})


@pytest.mark.parametrize(
    ("entry", "effect", "parameters"),
    [
        (constant("viscous_loss", 7e3), "line_loss_linear", {"b": 7e3}),
        (constant("turbulent_loss", 2e4), "line_loss_quadratic", {"c": 2e4}),
        (constant("inertia", 900.0), "yaw_inertia", {"inertia": 900.0}),
        (constant("load_friction", 0.06), "cylinder_friction", {"load_share": 0.06}),
        (LawEntry("friction_level", "slip", "exponential", (0.0, 6.0), {"start": 0.0, "end": -0.2, "length": 1.5}),
         "wear_polishing", {"amount": 0.2, "slip_scale": 1.5}),
        (LawEntry("friction_level", "angle", "window", (-0.6, 0.6), {"outside": 0.0, "inside": 0.3, "start": 0.05, "end": 0.2}),
         "surface_patch", {"change": 0.3, "angle_low": 0.05, "angle_high": 0.2}),
    ],
)  # fmt: skip
def test_a_law_that_the_catalogue_has_gives_the_same_torque(entry: LawEntry, effect: str, parameters: dict[str, float]) -> None:
    named, base = torque(vehicle().replace(effects=(EffectEntry(effect, parameters),))), with_law()
    change = np.abs(named - base).max()
    assert change > 100.0
    # The windows differ in their edges; wear takes the slip of one step before.
    allowed = {"window": 0.1, "exponential": 1e-3}.get(entry.form, 1e-9)
    assert np.sqrt(np.mean((with_law(entry) - named) ** 2)) < allowed * change


def smooth_sign(rate: Array) -> Array:
    return np.tanh(rate / 2e-3)


def test_a_torque_of_the_angle_stands_beside_the_contact() -> None:
    entry = LawEntry("conservative_torque", "angle", "hinge", (-0.5, 0.5), {"value": 0.0, "below": 0.0, "above": 9e3, "at": 0.1})
    assert with_law(entry) - with_law() == pytest.approx(9e3 * np.maximum(THETA - 0.1, 0.0), abs=10.0)


def test_an_inertia_that_follows_the_angle_has_the_torque_of_lagrange() -> None:
    """Of 1/2 J(theta) omega^2 with J = 300 cos(2 theta / 0.3): J alpha + J' omega^2 / 2."""
    values = {"value": 0.0, "sine": 0.0, "cosine": 300.0, "period": 0.3 * np.pi}
    entry = LawEntry("linked_inertia", "angle", "sinusoid", (-0.5, 0.5), values)
    turning = THETA / 0.15
    expected = 300.0 * np.cos(turning) * ALPHA - 0.5 * 300.0 / 0.15 * np.sin(turning) * OMEGA**2
    assert with_law(entry) - with_law() == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


def test_a_table_is_linear_between_its_knots_and_held_beyond_its_range() -> None:
    entry = LawEntry("coulomb_friction", "angle", "table", (-0.1, 0.1), knots=(100.0, 300.0, 200.0))
    expected = np.interp(THETA, [-0.1, 0.0, 0.1], [100.0, 300.0, 200.0]) * smooth_sign(OMEGA)
    assert with_law(entry) - with_law() == pytest.approx(expected, abs=1e-6)


def test_a_line_goes_on_for_half_its_range_and_is_then_held() -> None:
    entry = LawEntry("conservative_torque", "angle", "linear", (-0.1, 0.1), {"value": 0.0, "slope": 1e3})
    assert with_law(entry) - with_law() == pytest.approx(1e3 * np.clip(THETA, -0.2, 0.2), abs=1e-6)


def test_an_arm_of_a_hinge_goes_on_no_further_than_it_was_seen() -> None:
    values = {"value": 0.0, "below": 1e3, "above": 3e3, "at": 0.08}
    entry = LawEntry("conservative_torque", "angle", "hinge", (-0.1, 0.1), values)
    expected = np.where(THETA < 0.08, 1e3 * (np.maximum(THETA, -0.2) - 0.08), 3e3 * (np.minimum(THETA, 0.12) - 0.08))
    assert with_law(entry) - with_law() == pytest.approx(expected, abs=5.0)


def test_a_lagged_rate_follows_its_differential_equation() -> None:
    entry = LawEntry("conservative_torque", "rate", "linear", (-1.0, 1.0), {"value": 0.0, "slope": 1e4}, memory="lag", memory_size=2.0)
    fine = np.arange(0.0, TIME[-1], 1e-3)
    rate, kept = np.interp(fine, TIME, OMEGA), np.zeros(fine.size)
    for i in range(1, fine.size):
        kept[i] = kept[i - 1] + 1e-3 * (0.5 * (rate[i] + rate[i - 1]) - kept[i - 1]) / 2.0
    expected = 1e4 * np.interp(TIME[:-1], fine, kept)
    assert (with_law(entry) - with_law())[:-1] == pytest.approx(expected, abs=0.01 * np.abs(expected).max())


def test_what_rings_follows_its_differential_equation() -> None:
    """It adds c (x - M0) with x'' + 2 d w x' + w^2 (x - M0) = 0, for a torque M0 that stays for a step as the last one left it."""
    values = {"value": 0.0, "slope": 0.2}
    entry = LawEntry("conservative_torque", "torque", "linear", (-1e6, 1e6), values, memory="ring", memory_size=0.8)
    w, base = 2.0 * np.pi / 0.8, with_law()
    force = base - base[0]
    position = lsim(([w * w], [1.0, 0.06 * w, w * w]), force, TIME, interp=False)[1]
    expected = 0.2 * (position[1:] - force[:-1])
    assert np.abs(expected).max() > 1e3
    assert (with_law(entry) - base)[1:] == pytest.approx(expected, abs=0.05)  # the first torque has always been there


@pytest.mark.parametrize("kind", ["play", "relay"])
def test_play_and_relay_of_the_angle(kind: str) -> None:
    entry = LawEntry("conservative_torque", "angle", "linear", (-1.0, 1.0), {"value": 0.0, "slope": 1e3}, memory=kind, memory_size=0.1)
    kept, expected = 0.0, []
    for angle in THETA:
        if kind == "play":
            kept = np.clip(kept, angle - 0.1, angle + 0.1)
        elif abs(angle) > 0.1:
            kept = np.sign(angle)
        expected.append(1e3 * kept)
    assert with_law(entry) - with_law() == pytest.approx(expected, abs=1e-6)


def test_a_gain_multiplies_and_a_lag_delays_the_torque() -> None:
    base = with_law()
    assert with_law(constant("gain", 0.07)) == pytest.approx(1.07 * base, rel=1e-9)
    late, expected = with_law(constant("lag", 0.3)), [base[0]]
    for now in base[1:]:
        expected.append(expected[-1] + (now - expected[-1]) * 0.01 / 0.31)
    assert late[1:] == pytest.approx(expected[1:], abs=abs(base[0]) + 1e-6)


def test_stiffness_of_a_law_shows_only_in_presliding() -> None:
    """Along one long sweep, longer than any bristle."""
    theta = np.linspace(0.0, 2.0, TIME.size)
    rate, zero = np.full(TIME.size, theta[1] / TIME[1]), np.zeros(TIME.size)

    def swept(*laws: LawEntry) -> Array:
        model = build_model(vehicle().replace(laws=laws), lean=True)
        p = model.parameters[0].copy()
        p["heat_capacity"] = np.inf
        return torque_side(p, model.rubber, TIME, theta, rate, zero)

    softer, base = swept(constant("presliding_stiffness", -0.5)), swept()
    begun, slid = theta < 0.01, theta > 1.5
    assert np.diff(softer[begun]) == pytest.approx(0.5 * np.diff(base[begun]), rel=0.1)
    assert softer[slid] == pytest.approx(base[slid], rel=1e-3)


def test_every_coordinate_drives_a_law() -> None:
    for name in laws.COORDINATES:
        if name in ("none", "air_temperature"):
            continue
        low, high = (10.0, 30.0) if name == "rubber_temperature" else (-1.0, 1.0)
        entry = LawEntry("coulomb_friction", name, "linear", (low, high), {"value": 0.0, "slope": 100.0})
        with_it = with_law(entry) - with_law()
        assert np.abs(with_it).max() > 0.1, name


def test_passes_are_how_often_the_track_has_turned_over_a_place() -> None:
    """As often as the angle was crossed before, and half of the passage that goes on; not told near where a stroke begins or ends, where a
    place is rubbed in part. Two places share a passage within 0.05, and a step is at most a seventh of a place."""
    entry = LawEntry("conservative_torque", "passes", "linear", (0.0, 20.0), {"value": 0.0, "slope": 1.0})
    counted = with_law(entry) - with_law()
    crossed = [np.count_nonzero((THETA[1:k] - at) * (THETA[: k - 1] - at) < 0.0) for k, at in enumerate(THETA) if k > 0]
    ends = THETA[np.flatnonzero(np.diff(np.sign(OMEGA)) != 0.0)]
    clear = np.abs(THETA[1:, None] - ends).min(axis=1) > 2.0 * laws.PLACE_RAD
    assert set(np.asarray(crossed)[clear]) >= {0, 1, 2, 3}
    assert counted[1:][clear] == pytest.approx(np.asarray(crossed)[clear] + 0.5, abs=0.05 + 0.5 / 7.0)


def test_what_trembles_at_rest_passes_no_place() -> None:
    entry = LawEntry("conservative_torque", "passes", "linear", (0.0, 20.0), {"value": 0.0, "slope": 1.0})
    trembling = 1e-4 * np.random.default_rng(3).standard_normal(TIME.size)
    still = np.zeros(TIME.size)
    torques = []
    for laws_of in ((entry,), ()):
        model = build_model(vehicle().replace(laws=laws_of), lean=True)
        torques.append(torque_side(model.parameters[0], model.rubber, TIME, trembling, still, still))
    assert np.all(torques[0] == torques[1])


def test_two_laws_add_up_and_all_share_one_compiled_code() -> None:
    one = constant("viscous_loss", 3e3)
    other = LawEntry("conservative_torque", "angle", "linear", (-1.0, 1.0), {"value": 5.0, "slope": 40.0})
    both = with_law(one, other) - with_law()
    assert both == pytest.approx(with_law(one) + with_law(other) - 2.0 * with_law(), abs=1e-6)
    names = {build_model(vehicle().replace(laws=(entry,)), lean=True).composition.name for entry in (one, other)}
    assert len(names) == 1


def test_the_whole_catalogue_in_place_changes_nothing() -> None:
    entry = LawEntry("friction_level", "angle", "step", (-0.5, 0.5), {"before": 0.0, "after": 0.2, "at": 0.1, "width": 0.02})
    model = build_model(vehicle().replace(laws=(entry,)))
    full = run_side(model.parameters[0], model.rubber, TIME, THETA, OMEGA, ALPHA)["torque"]
    assert full == pytest.approx(with_law(entry), rel=1e-12)


@pytest.fixture
def kept() -> Iterator[EffectEntry]:
    """That law under a name."""
    with put_back():
        CATALOGUE["kept"] = named("kept", "a kept law", "a test", NARROW)
        yield EffectEntry("kept", {"size": 1.0})


@pytest.mark.parametrize("place", ["laws[0]", "effects[0]"])
def test_the_estimator_counts_steps_outside_the_range_and_runs_a_block_like_single_messages(place: str, kept: EffectEntry) -> None:
    driven = vehicle().replace(laws=(NARROW,)) if place == "laws[0]" else vehicle().replace(effects=(kept,))
    block, single = Estimator(driven), Estimator(driven)
    stamps = (10**18 + np.repeat(np.round(TIME * 1e9).astype(np.int64), 2)).astype(np.int64)
    channel, value = np.tile([0, 1], TIME.size), np.repeat(THETA, 2)
    together, _ = block.push_block(channel, stamps, value, np.full(value.size, np.nan))
    each = [single.push(int(k), int(t), float(v))[0].copy() for k, t, v in zip(channel, stamps, value, strict=True)]
    assert np.array_equal(np.concatenate(each)["total"], together["total"])
    outside = int(np.sum(np.abs(together["theta"]) > 0.05 + 1e-6))
    assert outside > 500
    assert block.law_left_steps == {place: outside}
    told = np.array(["outside the range of a law" in doubts(row) for row in together])
    assert np.array_equal(told, (np.abs(together["theta"]) > 0.05).any(axis=1))
    begin = int(np.argmax(told))
    assert not together["feed_forward"][begin + 1 : begin + 40][told[begin + 1 : begin + 40]][25:].any()
