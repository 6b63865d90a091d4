# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Effects that remember, against the closed forms of their laws."""

import numpy as np
import pytest
from chain_support import final_state, frozen

from lugre_steering.chain.step import run_side
from lugre_steering.recording import Array


def stop_and_go(rate: float, until: float, again: float, end: float, dt: float = 1e-3) -> tuple[Array, Array, Array, Array]:
    """Motion at a constant rate [rad/s], at rest between two instants [s]: time, angle, rate, acceleration (n,)."""
    time = np.arange(0.0, end, dt)
    omega = np.where((time < until) | (time >= again), rate, 0.0)
    return time, np.concatenate([[0.0], np.cumsum(omega[1:]) * dt]), omega, np.zeros(time.size)


def test_contacts_age_by_the_law_of_rice_and_ruina() -> None:
    """Level after a long slide at a constant rate, and after a rest: age = D / rate, then + rest."""
    parameters, rubber = frozen()
    rate, rest = 0.05, 4.0
    time, *_ = motion = stop_and_go(rate, 10.0, 10.0 + rest, 12.0 + rest)
    plain = run_side(parameters, rubber, *motion)["torque"]
    parameters["static_ageing_rate"], parameters["static_ageing_dwell"], parameters["static_ageing_slip_scale"] = 0.02, 1.5, 0.06
    aged = run_side(parameters, rubber, *motion)["torque"]
    gain = (aged - plain) / float(parameters["coulomb_torque"][0])
    steady = 0.02 * np.log1p(0.06 / rate / 1.5)
    assert gain[time < 10.0][-1] == pytest.approx(steady, rel=0.02)
    state = final_state(parameters, rubber, *(part[time < 10.0 + rest] for part in motion))
    assert float(state["static_ageing_age"][0]) == pytest.approx(0.06 / rate + rest, rel=0.02)


def test_trapped_oil_leaks_at_rest_and_is_refilled_in_motion() -> None:
    parameters, rubber = frozen()
    time, *_ = motion = stop_and_go(0.1, 2.0, 7.0, 9.0)
    plain = run_side(parameters, rubber, *motion)["torque"]
    for key, value in (("share", 0.1), ("time_constant", 3.0), ("refill_time", 0.2)):
        parameters[f"trapped_pressure_{key}"] = value
    kept = run_side(parameters, rubber, *motion)["torque"] / plain
    after = 0.1 * (1.0 - np.exp(-5.0 / 3.0))
    assert kept[time < 7.0][-1] == pytest.approx(1.0 - after, abs=1e-4)
    assert kept[time < 7.4][-1] == pytest.approx(1.0 - after * np.exp(-0.4 / 0.2), abs=1e-3)
