# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Vertical load shifts with body attitude."""

from __future__ import annotations

from lugre_steering.effects.entry import Effect

EFFECT = Effect(
    id="load_transfer",
    stage="contact",
    tier=3,
    title="Vertical load shifts with body attitude",
    equation="F_left, F_right = F (1 +- h i / t)",
    source="Gillespie, Fundamentals of Vehicle Dynamics (1992)",
    trace="side torques only",
    coordinate="side",
    not_recorded="an attitude sensor (roll and pitch), or lines per side",
)
