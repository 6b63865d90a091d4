# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The catalogue of physics that the baseline leaves out, one module per stage."""

from __future__ import annotations

import difflib

from lugre_steering.effects import contact, measurement, motion, parallel_torque, thermal
from lugre_steering.effects.entry import Effect
from lugre_steering.errors import LugreSteeringError

CATALOGUE: dict[str, Effect] = {
    effect.id: effect
    for module in (motion, contact, thermal, parallel_torque, measurement)
    for effect in module.EFFECTS
}


def effect(effect_id: str) -> Effect:
    """The entry of that name, or an error that offers the nearest one."""
    if effect_id not in CATALOGUE:
        near = difflib.get_close_matches(effect_id, CATALOGUE, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(CATALOGUE)}"
        raise LugreSteeringError(f"effect '{effect_id}': not in the catalogue; {hint}")
    return CATALOGUE[effect_id]
