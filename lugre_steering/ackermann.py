# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Steering geometry that ties the two tracks together."""

from __future__ import annotations

import numpy as np

from lugre_steering.recording import Array


def other_track(angle: Array, rate: Array, ratio: float) -> tuple[Array, Array]:
    """Angle [rad] and rate [rad/s] (n,) of the other track from those of one.

    Ackermann: cot(right) - cot(left) = b / L (b kingpin distance, L wheelbase, left turns positive), so
    tan(other) = t / (1 + ratio t), t = tan(angle), with ratio = b / L from left to right and -b / L back.
    Reimpell, Stoll, Betzler, The Automotive Chassis (2001), section 3.7.
    """
    with np.errstate(invalid="ignore"):  # what is not finite stays so, and is rejected where the other samples are
        tangent = np.tan(angle)
        widened = 1.0 + ratio * tangent
        slope = (1.0 + tangent**2) / (widened**2 + tangent**2)
        return np.arctan2(tangent, widened), slope * rate
