# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Late stamps against truly uneven sampling, where noise is larger than what most steps change."""

from __future__ import annotations

import numpy as np
import pytest

from lugre_steering.data.stamps import evened
from lugre_steering.recording import Array, Signal


def moved(time: Array) -> Array:
    """Strokes with long rests between."""
    return np.asarray(np.where(time % 16.0 < 4.0, np.sin(0.5 * np.pi * time), 0.0))


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize(("noise", "lost"), [(0.04, 0.0), (0.01, 0.3)])
def test_uneven_sampling_is_told_from_late_stamps_though_values_are_noisy(noise: float, lost: float, late: bool) -> None:
    """The same stamps: of values taken then, or of an even clock and on receipt; with losses too."""
    rng = np.random.default_rng(5)
    even = 0.05 * np.flatnonzero(rng.random(2400) >= lost)
    stamp = even + np.abs(rng.normal(0.0, 0.01, even.size))
    value = moved(even if late else stamp) + noise * rng.normal(size=even.size)
    _, scatter = evened(Signal(stamp, value))
    assert (scatter > 0.0) == late
