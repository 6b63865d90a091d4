# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Rolling while steering relaxes the bristles."""

from __future__ import annotations

from lugre_steering.effects.entry import Effect

EFFECT = Effect(
    id="rolling_relief",
    stage="contact",
    tier=3,
    title="Rolling while steering relaxes the bristles",
    equation="dz/dt = omega - sigma_0 |omega| z / g - kappa |V| z",
    source="Deur, Asgari, Hrovat, Vehicle Syst. Dyn. 42 (2004) 77",
    trace="torque collapses while the track drives",
    coordinate="drive speed",
    not_recorded="the drive speed of the tracks",
)
