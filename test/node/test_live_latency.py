# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Latencies are kept in a ring of fixed size, and percentiles are of the latest ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lugre_steering.live.health import RECENT, Latencies


@pytest.mark.parametrize(("size", "added"), [(100, 30), (100, 250), (4 * RECENT, 3 * RECENT), (4 * RECENT, 9 * RECENT)])
def test_percentiles_are_of_the_latest_values(size: int, added: int) -> None:
    window, values = Latencies(size), np.random.default_rng(2).integers(1, 10**9, added)
    assert all(math.isnan(value) for value in window.percentiles_ms(50.0, 99.0))
    for value in values:
        window.add(int(value))
    latest = values[-min(added, size, RECENT) :]
    assert window.percentiles_ms(50.0, 99.0) == pytest.approx((np.percentile(latest, [50.0, 99.0]) * 1e-6).tolist())
    assert window.max_ns == values.max()
