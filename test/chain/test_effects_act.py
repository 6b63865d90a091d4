# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Every parameter acts, neutral is the baseline, effects are causal and the same in one run or step by step."""

from __future__ import annotations

import io
from functools import cache

import numpy as np
import pytest
from chain_support import baseline, double_cycle, swing

from lugre_steering.bench.kernel import every_effect
from lugre_steering.chain.compose import HOOKS, SENSOR_HOOKS
from lugre_steering.chain.layout import BASELINE_FIELDS
from lugre_steering.chain.step import Records, new_state, run_side, torque_side
from lugre_steering.effects.registry import CATALOGUE, composed
from lugre_steering.recording import Array

EFFECT_FIELDS = (composed().parameters.names or ())[len(BASELINE_FIELDS) : -1]
STEPWISE = {*HOOKS} - {*SENSOR_HOOKS} | {"angle"}
CHAIN_EFFECTS = sorted(e.id for e in CATALOGUE.values() if e.hooks.keys() & STEPWISE)
CHAIN_FIELDS = [f for f in EFFECT_FIELDS if any(f.startswith(f"{effect}_") for effect in CHAIN_EFFECTS)]


@cache
def cycle() -> tuple[Array, Array, Array, Array]:
    """Double cycle with a dwell at every limit, then small reversals."""
    time, theta = double_cycle(100.0)
    theta = np.concatenate([theta, theta[-1] + 0.06 * np.sin(np.arange(1500) * 0.01 * 1.5)])
    time = np.arange(theta.size) / 100.0
    omega = np.diff(theta, prepend=theta[0]) * 100.0
    return time, theta, omega, np.gradient(omega, time)


def with_effect(effect_id: str) -> Records:
    p, _ = baseline()
    for field, value in every_effect().items():
        if field.startswith(f"{effect_id}_"):
            p[field] = value
    return p


def with_all() -> Records:
    p, _ = baseline()
    for field, value in every_effect().items():
        p[field] = value
    return p


def change(a: Array, b: Array) -> float:
    """RMS difference relative to the torque amplitude."""
    return float(np.sqrt(np.mean((a - b) ** 2)) / np.abs(a).max())


def test_every_effect_field_belongs_to_a_chain_effect() -> None:
    assert set(every_effect()) == set(EFFECT_FIELDS)
    sensors = {e.id for e in CATALOGUE.values() if e.hooks and not e.per_line} - {*CHAIN_EFFECTS}
    assert sensors == {"time_delay", "pressure_lag", "moment_arm_error"}
    assert len(CHAIN_FIELDS) == len(EFFECT_FIELDS) - 4


@pytest.mark.parametrize("field", CHAIN_FIELDS)
def test_every_effect_parameter_acts(field: str) -> None:
    _, rubber = baseline()
    motion = cycle()
    base = with_effect(next(e for e in CHAIN_EFFECTS if field.startswith(f"{e}_")))
    if field.startswith("surface_patch_angle"):
        base["surface_patch_time_start"] = base["surface_patch_time_end"] = 0.0  # angle window only
    if field.startswith("surface_patch_time"):
        base["surface_patch_angle_high"] = base["surface_patch_angle_low"] = 0.0  # time window only
    other = base.copy()
    other[field] = 1.2 * base[field] if base[field][0] != 0.0 else 0.05
    assert change(torque_side(base, rubber, *motion), torque_side(other, rubber, *motion)) > 1e-6


@pytest.mark.parametrize("beside", CHAIN_EFFECTS)
def test_every_effect_acts_beside_every_other(beside: str) -> None:
    _, rubber = baseline()
    motion = cycle()
    alone = with_effect(beside)
    torque = torque_side(alone, rubber, *motion)
    for effect in CHAIN_EFFECTS:
        if effect != beside:
            both = alone.copy()
            for field, value in every_effect().items():
                if field.startswith(f"{effect}_"):
                    both[field] = value
            assert change(torque, torque_side(both, rubber, *motion)) > 1e-6, effect


@pytest.mark.parametrize("softening", ["payne_softening", "mullins_softening"])
def test_softening_stiffens_graded_elements_as_it_does_one_bristle(softening: str) -> None:
    """Elements that are all alike are the bristle: torque, work and heat are those of it."""
    _, rubber = baseline()
    one, graded = with_effect(softening), with_effect(softening)
    graded["distributed_contact_spread"] = 1e-9
    outputs = [run_side(p, rubber, *cycle()) for p in (one, graded)]
    for name in ("torque", "temperature"):
        np.testing.assert_allclose(outputs[1][name], outputs[0][name], rtol=1e-6, atol=1e-6 * np.abs(outputs[0][name]).max())


ELSEWHERE = ("angle_noise", "torque_unit", "angle_unit", "acceleration_unit")  # in the motion estimate, and in constants of effects


@pytest.mark.parametrize("field", [f for f in BASELINE_FIELDS if f not in ELSEWHERE])
def test_every_baseline_parameter_acts(field: str) -> None:
    _, rubber = baseline()
    motion = cycle()
    base = with_effect("slope_bias")  # the sides share it
    base["gravity_cos"], base["initial_bristle"], base["air_temperature"] = 300.0, 0.01, 5.0
    other = base.copy()
    other[field] *= 1.1
    assert change(torque_side(base, rubber, *motion), torque_side(other, rubber, *motion)) > 1e-6


@pytest.mark.parametrize("effect", CHAIN_EFFECTS)
def test_every_effect_changes_the_torque_and_vanishes_with_its_amplitude(effect: str) -> None:
    p, rubber = baseline()
    motion = cycle()
    plain = torque_side(p, rubber, *motion)
    assert change(plain, torque_side(with_effect(effect), rubber, *motion)) > 1e-5
    amplitudes = [f"{effect}_{q.name}" for q in CATALOGUE[effect].parameters if not q.is_shape]
    tiny = with_effect(effect)
    if effect == "relief_saturation":
        tiny["relief_saturation_ceiling"] = 1e7
    else:
        for field in amplitudes:
            tiny[field] *= 1e-12
    assert change(plain, torque_side(tiny, rubber, *motion)) < 1e-9


def test_neutral_is_the_baseline_to_rounding() -> None:
    p, rubber = baseline()
    through_effects = p.copy()
    through_effects["slope_bias_torque"] = 1e-300  # takes the path of the effects without adding anything
    motion = cycle()
    np.testing.assert_allclose(
        torque_side(through_effects, rubber, *motion), torque_side(p, rubber, *motion), rtol=1e-13, atol=1e-9
    )


@pytest.mark.parametrize("effect", [*CHAIN_EFFECTS, "all"])
def test_effects_are_causal(effect: str) -> None:
    _, rubber = baseline()
    p = with_all() if effect == "all" else with_effect(effect)
    time, theta, omega, alpha = cycle()
    before = torque_side(p, rubber, time, theta, omega, alpha)
    k = 1700
    later = [column.copy() for column in (theta, omega, alpha)]
    for column in later:
        column[k:] *= 0.9
    np.testing.assert_array_equal(torque_side(p, rubber, time, *later)[:k], before[:k])


@pytest.mark.parametrize("effect", [*CHAIN_EFFECTS, "all", "none"])
def test_whole_record_equals_pieces_with_a_saved_state(effect: str) -> None:
    p, rubber = baseline()
    if effect != "none":
        p = with_all() if effect == "all" else with_effect(effect)
    motion = cycle()
    whole = run_side(p, rubber, *motion)
    state = new_state(p)
    run_side(p, rubber, *(column[:1200] for column in motion), state)
    file = io.BytesIO()
    np.save(file, state)
    file.seek(0)
    restored = np.load(file)
    rest = run_side(p, rubber, *(column[1200:] for column in motion), restored, motion[0][1199])
    np.testing.assert_array_equal(rest, whole[1200:])
    state = new_state(p)
    for i in range(300):
        one = run_side(p, rubber, *(column[i : i + 1] for column in motion), state, motion[0][max(i - 1, 0)])
        assert one[0] == whole[i]


def test_mirrored_motion_mirrors_symmetric_effects() -> None:
    _, rubber = baseline()
    time, theta, omega, alpha = swing(30.0, 0.01)
    odd = ("linkage_compliance", "viscous_friction", "static_ageing", "distributed_contact", "cylinder_friction",
           "line_loss_quadratic", "stress_relaxation", "payne_softening", "backlash", "soil_shear")  # fmt: skip
    for effect in odd:
        p = with_effect(effect)
        one, other = (
            torque_side(p, rubber, time, theta, omega, alpha),
            torque_side(p, rubber, time, -theta, -omega, alpha),
        )
        np.testing.assert_allclose(one, -other, rtol=1e-9, atol=1e-6, err_msg=effect)
