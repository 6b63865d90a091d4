# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What only adds to the torque of the contact is computed beside the chain, and comes to the same."""

from __future__ import annotations

import numpy as np
import pytest
from chain_support import baseline
from test_effects_act import CHAIN_EFFECTS, cycle, with_effect

from lugre_steering.bench.kernel import every_effect
from lugre_steering.chain import step
from lugre_steering.chain.step import Records, added, records_of, torque_in_phases
from lugre_steering.recording import Array

ALWAYS = ("yaw_inertia", "viscous_friction", "kingpin_jacking", "slope_bias", "spring_load")
COUPLED = (
    "angle_offset", "angle_scale", "backlash", "linkage_compliance", "back_pressure", "cylinder_friction", "gear_friction",
    "line_loss_linear", "line_loss_quadratic", "relief_saturation", "trapped_pressure",
)  # fmt: skip
"""Effects that change what the others see, or what is made of them."""


def beside_others(effect: str) -> Records:
    """Parameters of a track with an effect and all that every joint may have."""
    p = with_effect(effect)
    for field, value in every_effect().items():
        if field.startswith(ALWAYS):
            p[field] = value
    return p


def apart(*phases: Records, warms: bool) -> Records | None:
    """The same of records, which lose what is taken apart."""
    beside = step.apart([p.view(np.float64) for p in phases], phases[0].dtype, warms)
    return None if beside is None else records_of(beside, phases[0].dtype)


def motions() -> tuple[Array, Array, Array, Array]:
    """Two tracks that turn differently."""
    time, *motion = cycle()
    theta, omega, alpha = (np.stack([values, 0.8 * values]) for values in motion)
    return time, theta, omega, alpha


@pytest.mark.parametrize("warms", [True, False])
@pytest.mark.parametrize("effect", CHAIN_EFFECTS)
def test_the_parts_make_the_whole_beside_every_effect(effect: str, warms: bool) -> None:
    """In particular nothing is taken apart where an effect feels what others add."""
    p, rubber = beside_others(effect), baseline()[1]
    if not warms:
        rubber[:] = 1.0
    whole = torque_in_phases([(-np.inf, p)], rubber, *motions())
    own = added(beside, *motions()[1:]) if (beside := apart(p, warms=warms)) is not None else 0.0
    np.testing.assert_allclose(torque_in_phases([(-np.inf, p)], rubber, *motions()) + own, whole, rtol=1e-10, atol=1e-7)
    assert (beside is None) == (effect in COUPLED)


def test_viscous_friction_stays_in_the_chain_where_it_heats_rubber() -> None:
    p, q = beside_others("end_stop"), beside_others("end_stop")
    warm, cold = apart(p, warms=True), apart(q, warms=False)
    assert warm is not None
    assert cold is not None
    assert (p["viscous_friction_sigma_2"] != 0.0, warm["viscous_friction_sigma_2"] != 0.0) == (True, False)
    assert (q["viscous_friction_sigma_2"] != 0.0, cold["viscous_friction_sigma_2"] != 0.0) == (False, True)
    assert (p["yaw_inertia_inertia"], q["yaw_inertia_inertia"]) == (0.0, 0.0)


def test_what_changes_on_the_way_is_no_sum() -> None:
    """An offset that becomes another one leaves all to the chain; beside a patch that begins late all that adds does so alike."""
    rubber, p = baseline()[1], beside_others("end_stop")
    late = p.copy()
    late["slope_bias_torque"] *= 2.0
    assert apart(p, late, warms=True) is None
    assert p["slope_bias_torque"] != 0.0
    later = p.copy()
    later["surface_patch_change"] = 0.3
    whole = torque_in_phases([(-np.inf, p), (9.0, later)], rubber, *motions())
    beside = apart(p, later, warms=True)
    assert beside is not None
    parts = torque_in_phases([(-np.inf, p), (9.0, later)], rubber, *motions()) + added(beside, *motions()[1:])
    np.testing.assert_allclose(parts, whole, rtol=1e-10, atol=1e-7)


def test_what_has_nothing_to_add_stays_whole() -> None:
    p = with_effect("surface_patch")
    before = p.copy()
    assert apart(p, warms=False) is None
    assert p.tobytes() == before.tobytes()
