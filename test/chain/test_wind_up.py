# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the step solves or sums for an effect, against a bracketing solver, plain sums and the exponential of the library."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from scipy.optimize import brentq

from lugre_steering.chain.compose import compose
from lugre_steering.chain.step import new_parameters, new_state
from lugre_steering.effects import distributed_contact, static_ageing
from lugre_steering.effects.registry import CATALOGUE

COMPLIANCE, STIFFENING, WIDTH, FLANK = 3e-7, 4e-5, 0.006, 600.0


def lost_in_the_linkage(torque: float) -> float:
    return COMPLIANCE * torque / (1.0 + STIFFENING * abs(torque))


def lost_in_the_gap(torque: float) -> float:
    return 0.5 * WIDTH * math.tanh(torque / FLANK)


LOST: dict[tuple[str, ...], Callable[[float], float]] = {
    ("linkage_compliance",): lost_in_the_linkage,
    ("backlash",): lost_in_the_gap,
    ("backlash", "linkage_compliance"): lambda torque: lost_in_the_linkage(torque) + lost_in_the_gap(torque),
}


@pytest.mark.parametrize("names", LOST)
def test_the_angle_lost_is_solved_as_by_bracketing(names: Sequence[str]) -> None:
    """Loads on both flanks and between them, steps that stay there, cross over or hardly move, contacts soft and as stiff as a vehicle's.

    (Much stiffer ones, far between two flanks, can use up the iterations.)
    """
    made = compose([CATALOGUE[name] for name in names])
    wound_increment = made.step.__globals__["wound_increment"]
    p, s = new_parameters(made), new_state(new_parameters(made))
    for name, values in {
        "backlash": {"width": WIDTH, "softness": FLANK - 100.0}, "linkage_compliance": {"compliance": COMPLIANCE, "stiffening": STIFFENING},
    }.items():  # fmt: skip
        for key, value in values.items() if name in names else ():
            p[f"{name}_{key}"] = value
    lost, random = LOST[tuple(names)], np.random.default_rng(3)
    for _ in range(1500):
        stiffness, sliding = 10.0 ** random.uniform(4.0, 5.7), 2e4
        s["z"] = random.uniform(-1.0, 1.0) * sliding / stiffness
        s["load"] = load = float(random.choice([stiffness * s["z"][0], random.normal(0.0, 800.0), random.normal(0.0, 2e4)]))
        away = float(random.choice([-1.0, 1.0])) * 10.0 ** random.uniform(-7.0, -2.5)
        s["contact_angle"] = contact = 0.1
        theta = contact + lost(load) + away
        tangent = stiffness * max(0.05, 1.0 - math.copysign(s["z"][0], s["z"][0] * away) * stiffness / sliding)
        ends = sorted((-1e-9 * away, (1.0 + 1e-9) * away))
        exact = brentq(lambda d: d + lost(load + tangent * d) - lost(load) - away, *ends, xtol=1e-18, rtol=1e-15)  # noqa: B023
        found = wound_increment(p[0], s[0], theta, stiffness, sliding / stiffness)
        assert found == pytest.approx(exact, rel=1e-12, abs=2e-16)


def test_the_parts_of_a_contact_are_bristles_beside_each_other() -> None:
    """Against each one by itself: deflection, torque and what sliding takes, over reversals."""
    count, spread, stiffness, g = distributed_contact.ELEMENTS, 0.4, 5e5, 2e4
    shares = np.exp(spread * np.array(distributed_contact.NORMAL_QUANTILES))
    shares /= shares.sum()
    alone, elements, kept = np.full(count, 0.003), np.zeros(count), np.zeros(count)
    for drawn in np.concatenate([np.full(40, 2e-3), np.full(60, -3e-3), [0.0], np.full(5, 1e-5)]):
        torque, mean, dissipated = distributed_contact.contact.py_func(0.003, drawn, stiffness, g, spread, elements, kept)
        before, k, share = alone, stiffness * shares, g / count
        steady = math.copysign(1.0, drawn) * share / k
        alone = steady + (before - steady) * np.exp(-k * abs(drawn) / share)
        work = share * (abs(drawn) + math.copysign(1.0, drawn) * (before - alone)) - 0.5 * k * (alone**2 - before**2)
        assert elements == pytest.approx(alone, rel=1e-12, abs=1e-16)
        assert torque == pytest.approx(float(k @ alone), rel=1e-12, abs=1e-9)
        assert mean == pytest.approx(torque / stiffness, rel=1e-12, abs=1e-16)
        assert dissipated == pytest.approx(float(work.sum()), rel=1e-9, abs=1e-10)


@pytest.mark.parametrize("slip", [0.0, 1e-12, 1e-6, 0.01, 0.0299, 0.0301, 0.3, 20.0])
def test_contacts_age_as_the_exponential_says(slip: float) -> None:
    scale, dt, dwell, rate, age = 0.1, 0.01, 1.0, 0.02, 0.7
    renewed = -math.expm1(-slip) / slip if slip else 1.0
    older = age * math.exp(-slip) + dt * renewed
    level, found = static_ageing.ageing(slip * scale, dt, 1.0, 1.0, 1.0, 1.0, rate, dwell, scale, age)
    assert found == pytest.approx(older, rel=2e-14, abs=0.0)
    assert level == pytest.approx(rate * math.log1p(older / dwell), rel=2e-14, abs=1e-17)
