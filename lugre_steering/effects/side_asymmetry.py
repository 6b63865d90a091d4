# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Friction differs between the left and the right track."""

from __future__ import annotations

from lugre_steering.effects.entry import Effect

EFFECT = Effect(
    id="side_asymmetry",
    stage="contact",
    tier=3,
    title="Friction differs between the left and the right track",
    equation="mu_left = (1 + a) mu, mu_right = (1 - a) mu",
    source="uneven ground; lateral load transfer",
    trace="nothing in the sum of both sides",
    coordinate="side",
    not_recorded="pressure lines that belong to one side each",
)
