# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Relief valve limits the torque."""

from __future__ import annotations

import numpy as np

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter, Seen, Variant

CEILINGS = (0.8, 0.88, 0.92, 0.95, 0.975, 1.0, 1.02, 1.04, 1.07)
"""Shares of the largest torque that are tried."""


@law
def limit(torque, theta, sides, ceiling, arm_slope, arm_curvature):
    """Torque [N m] clipped at ceiling (1 + arm_slope u + arm_curvature u**2), u the angle toward the push.

    The ceiling is a pressure, so the torque follows the arms.
    """
    toward = theta if torque > 0.0 else -theta
    highest = ceiling / sides * max(1.0 + toward * (arm_slope + toward * arm_curvature), 0.1)
    return max(-highest, min(highest, torque))


def ceilings(seen: Seen) -> list[Variant]:
    """A relief pressure limits the torque by the arms of the cylinders toward the push, which the vehicle sheet knows."""
    toward = np.concatenate([seen.theta, -seen.theta])
    held = np.concatenate([np.maximum(seen.gains, 0.0).sum(axis=0), np.maximum(-seen.gains, 0.0).sum(axis=0)])
    middle, slope, curvature = np.polynomial.polynomial.polyfit(toward, held, 2)
    arm = np.where(seen.torque > 0.0, held[: seen.theta.size], held[seen.theta.size :]) / middle
    pushed = arm > 0.0
    if not pushed.any():
        return []
    top = float(np.percentile(np.abs(seen.torque[pushed]) / arm[pushed], 99.9))  # the largest values hold noise
    arms = {"arm_slope": float(slope / middle), "arm_curvature": float(curvature / middle)}
    return [{"ceiling": top * share, **arms} for share in CEILINGS]


EFFECT = Effect(
    id="relief_saturation",
    stage="measurement",
    tier=2,
    title="Relief valve limits the torque",
    equation="|M| <= ceiling (1 + arm_slope u + arm_curvature u^2), u = theta sgn(M)",
    source="Merritt 1967",
    trace="a torque ceiling",
    coordinate="torque",
    parameters=(
        Parameter("ceiling", "N m", "highest torque of the vehicle", 1000.0, 1000.0, 1e7, example=35_000.0),
        Parameter("arm_slope", "1/rad", "slope of the cylinder arms toward the push", 0.05, -2.0, 2.0, optional=True),
        Parameter("arm_curvature", "1/rad^2", "curvature of the cylinder arms", 0.1, -5.0, 5.0, optional=True),
    ),
    hooks={"limit": limit},
    needs=("hydraulics",),
    variants=ceilings,
)
