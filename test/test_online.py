# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Statistics and curves of streamed data against NumPy on all data at once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lugre_steering.online import BINS, Comparison, Curves, Timeline


@given(
    seed=st.integers(0, 2**32 - 1),
    cuts=st.lists(st.integers(0, 500), max_size=6),
    mean=st.sampled_from([0.0, 1e3, 1e9]),
)
def test_fit_does_not_depend_on_how_the_data_are_cut(seed: int, cuts: list[int], mean: float) -> None:
    rng = np.random.default_rng(seed)
    time, measured, residual = np.arange(500.0), mean + rng.normal(0.0, 1e3, 500), rng.normal(5.0, 50.0, 500)
    fit = Comparison()
    for part in np.split(np.arange(500), sorted(cuts)):
        fit.add(time[part], measured[part], residual[part])
    result = fit.result()
    assert result is not None
    assert result.samples == 500
    assert result.rmse_Nm == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-12)
    assert result.bias_Nm == pytest.approx(residual.mean(), rel=1e-9)
    # A mean of 1e9 leaves 1e-7 of a deviation of 1e3 in a double.
    assert result.r2 == pytest.approx(
        1.0 - np.sum(residual**2) / np.sum((measured - measured.mean()) ** 2), rel=1e-6
    )
    peaks = result.peaks.cylinder_torque
    assert (peaks.max_Nm, peaks.max_at_s) == (measured.max(), time[measured.argmax()])
    assert (peaks.min_Nm, peaks.min_at_s) == (measured.min(), time[measured.argmin()])


def test_fit_of_nothing_and_of_a_constant() -> None:
    fit = Comparison()
    fit.add(np.empty(0), np.empty(0), np.empty(0))
    assert fit.result() is None
    fit.add(np.arange(3.0), np.full(3, 7.0), np.zeros(3))
    result = fit.result()
    assert result is not None
    assert result.r2 is None


@given(seed=st.integers(0, 2**32 - 1), cuts=st.lists(st.integers(0, 20_000), max_size=5))
def test_curves_keep_every_extreme_within_its_bin(seed: int, cuts: list[int]) -> None:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.001, 0.02, 20_000))
    values = rng.normal(size=(2, 20_000))
    values[0, rng.integers(20_000)] = 1e6  # one spike of one sample
    curves = Curves(2)
    for part in np.split(np.arange(20_000), sorted(cuts)):
        curves.add(time[part], values[:, part])
    middle, low, high = curves.bins()
    assert middle.size <= BINS
    assert time[-1] < BINS * curves.bin_s
    assert (high.max(axis=1) == values.max(axis=1)).all()
    assert (low.min(axis=1) == values.min(axis=1)).all()
    inside = (time / curves.bin_s).astype(int)
    for i in rng.integers(0, middle.size, 20):
        chosen = values[:, inside == int(middle[i] / curves.bin_s)]
        assert low[:, i].tolist() == chosen.min(axis=1).tolist()
        assert high[:, i].tolist() == chosen.max(axis=1).tolist()


def test_time_goes_on_where_the_clock_was_set_back() -> None:
    clock = Timeline(1_000)
    stamps = np.array([1_000, 2_000, 3_000, 500, 1_500, 2_500], np.int64)
    parts = [clock(part) for part in np.split(stamps, [2, 4])]
    assert np.concatenate(parts).tolist() == pytest.approx([0.0, 1e-6, 2e-6, 2e-6, 3e-6, 4e-6])
    assert clock.set_back == 1
