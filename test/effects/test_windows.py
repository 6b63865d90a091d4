# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Windows of other ground that are tried."""

from __future__ import annotations

import numpy as np

from lugre_steering.effects.entry import Seen
from lugre_steering.effects.surface_patch import windows


def test_of_a_window_and_what_lies_outside_it_one_is_tried() -> None:
    """With a recalibrated level the two are the same ground: harder up to an angle is softer beyond it."""
    theta = np.linspace(-0.6, 0.6, 100)
    tried = windows(Seen(theta, -0.6, 0.6, 90.0, np.zeros((4, 100)), np.zeros(100)))
    for low, high, first, last in (("angle_low", "angle_high", -0.61, 0.61), ("time_start", "time_end", -1.0, 91.0)):
        spans = [(variant[low], variant[high]) for variant in tried if low in variant]
        from_first = {round(b, 9) for a, b in spans if np.isclose(a, first)}
        to_last = {round(a, 9) for a, b in spans if np.isclose(b, last)}
        edges = {round(float(edge), 9) for edge in np.linspace(first, last, 9)[1:-1]}
        assert from_first | to_last == edges  # each change of the ground is tried
        assert len(from_first & to_last) <= 1  # and not from both sides, but where both are equal
