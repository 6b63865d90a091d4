# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Parameters that change during a recording: the state is carried over, and what begins late counts from there."""

from __future__ import annotations

import numpy as np
import pytest
from chain_support import baseline, final_state, swing

from lugre_steering.chain.step import Records, new_state, run_side, torque_in_phases, torque_side
from lugre_steering.recording import Array

START_S = 31.0
MOTION = swing(60.0, 0.01)
LATER = MOTION[0] >= START_S


def late(**values: float) -> tuple[Records, Records, Array]:
    """Baseline and changed parameters of a track that is warm enough for its heat to matter, and its rubber table."""
    before, rubber = baseline()
    after = before.copy()
    for field, value in values.items():
        after[field] = value
    return before, after, rubber


def test_phases_of_the_same_parameters_are_no_phases() -> None:
    p, rubber = baseline()
    whole = torque_side(p, rubber, *MOTION)
    np.testing.assert_array_equal(torque_in_phases([(-np.inf, p), (START_S, p), (np.inf, p)], rubber, *MOTION), whole)
    np.testing.assert_array_equal(torque_in_phases([(-np.inf, p), (-5.0, p)], rubber, *MOTION), whole)


def test_the_state_is_carried_over_like_by_two_runs() -> None:
    before, after, rubber = late(heat_partition_ground_share=0.5)
    state, time = new_state(before), MOTION[0]
    first = run_side(before, rubber, *(part[~LATER] for part in MOTION), state)["torque"]
    second = run_side(after, rubber, *(part[LATER] for part in MOTION), state, float(time[~LATER][-1]))["torque"]
    found = torque_in_phases([(-np.inf, before), (START_S, after)], rubber, *MOTION)
    np.testing.assert_array_equal(found, np.concatenate([first, second]))
    always = torque_side(after, rubber, *MOTION)
    assert np.max(np.abs(found - always)[LATER]) > 1.0  # the rubber remembers that it was heated fully before


@pytest.mark.parametrize(("effect", "value"), [("wear_polishing_amount", 0.2), ("ambient_drift_rate", 0.5)])
def test_path_and_time_of_a_late_effect_count_from_its_beginning(effect: str, value: float) -> None:
    """At the onset nothing jumps; what follows is what a recording that begins there would show from the same state."""
    before, after, rubber = late(**{effect: value, "wear_polishing_slip_scale": 0.3})
    plain = torque_side(before, rubber, *MOTION)
    found = torque_in_phases([(-np.inf, before), (START_S, after)], rubber, *MOTION)
    change = np.abs(found - plain)
    assert not change[~LATER].any()
    assert change[LATER][0] < 1e-2 * change.max()
    state = final_state(before, rubber, *(part[~LATER] for part in MOTION))
    state["time"] = 0.0
    fresh = run_side(after, rubber, *(part[LATER] for part in MOTION), state, float(MOTION[0][~LATER][-1]))["torque"]
    np.testing.assert_allclose(found[LATER], fresh, rtol=1e-12, atol=1e-6)


def test_elements_take_over_what_the_one_bristle_carries() -> None:
    before, after, rubber = late(distributed_contact_spread=0.8)
    found = torque_in_phases([(-np.inf, before), (START_S, after)], rubber, *MOTION)
    plain, always = torque_side(before, rubber, *MOTION), torque_side(after, rubber, *MOTION)
    step = np.abs(np.diff(plain)).max()
    assert abs(found[LATER][0] - plain[LATER][0]) < step
    # After some reversals the elements have forgotten how they began.
    assert np.max(np.abs(found - always)[-500:]) < 0.02 * np.max(np.abs(always))
    assert np.max(np.abs(found - plain)[LATER]) > 10.0 * np.max(np.abs(found - always)[-500:])


def test_a_phase_without_samples_hides_nothing_from_the_next() -> None:
    """Two effects that begin between the same two samples both count from there."""
    before, drifting, rubber = late(ambient_drift_rate=0.5)
    both = drifting.copy()
    both["slope_bias_torque"] = 100.0
    found = torque_in_phases([(-np.inf, before), (START_S - 0.004, drifting), (START_S - 0.002, both)], rubber, *MOTION)
    apart = torque_in_phases([(-np.inf, before), (START_S - 0.002, drifting)], rubber, *MOTION)
    np.testing.assert_allclose(found - apart, np.where(LATER, 100.0, 0.0) / both["sides"], atol=1e-6)


@pytest.mark.parametrize("wrong_s", [-1.0, 0.0, 1.0])
def test_a_sensor_that_slips_while_it_turns_moves_no_contact(wrong_s: float) -> None:
    """It slips within a second; told a second too early or too late, the torque is nearly that of the true angle all the same."""
    slip = 0.005
    before, after, rubber = late(angle_offset_offset=slip)
    time, theta, omega, alpha = MOTION
    truth, start_s = torque_side(before, rubber, *MOTION), float(time[np.argmax(np.abs(omega) * (time > START_S))])
    seen = theta + slip * np.clip(time - start_s, 0.0, 1.0)
    found = torque_in_phases([(-np.inf, before), (start_s + 0.5 + wrong_s, after)], rubber, time, seen, omega, alpha)
    assert np.abs(found - truth).max() < 0.1 * slip * float(before["sigma_0"][0])
