# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""WLF, DMA table and master curve of one synthetic, thermorheologically simple rubber."""

from __future__ import annotations

import numpy as np
import pytest
from chain_support import VEHICLE_FILE, vehicle
from hypothesis import assume, given
from hypothesis import strategies as st
from reference_model import ReferenceTrack
from scipy.interpolate import PchipInterpolator

from lugre_steering.vehicle import DmaTable, MasterCurve, Rubber, Wlf
from lugre_steering.vehicle.monotone import monotone
from lugre_steering.vehicle.rubber import (
    _equivalent_temperature,
    friction_measure,
    known_range,
    moduli,
    ratio_table,
    wlf_shift,
)

WLF = Wlf(c1=10.17, c2_K=42.01, reference_degC=-61.0)
HEAT = {
    "dma_frequency_Hz": 10.0, "density_kg_m3": 1120.0, "specific_heat_J_kgK": 1750.0, "tread_thickness_m": 0.012,
    "contact_area_m2": 0.4, "heat_transfer_W_m2K": 18.0,
}  # fmt: skip


def exact(frequency, temperature):  # type: ignore[no-untyped-def]
    """Fractional Zener solid with WLF: E(f aT)."""
    shift = 10.0 ** (-10.17 * (temperature + 61.0) / (42.01 + temperature + 61.0))
    w = (2j * np.pi * frequency * shift * 1e-2) ** 0.4
    return 5e6 + 2e9 * w / (1.0 + w)


def dma() -> Rubber:
    T = np.arange(-80.0, 121.0, 1.0)
    E = exact(10.0, T)
    return Rubber(**HEAT, wlf=WLF, dma=DmaTable(tuple(T), tuple(E.real), tuple(E.imag)))


def master() -> Rubber:
    f = np.logspace(-12, 8, 201)
    E = exact(f, -61.0)
    return Rubber(**HEAT, wlf=WLF, master_curve=MasterCurve(tuple(f), tuple(E.real), tuple(E.imag)))


def test_wlf_by_hand() -> None:
    assert wlf_shift(np.array([-61.0]), WLF)[0] == 1.0
    assert wlf_shift(np.array([-18.99]), WLF)[0] == pytest.approx(10 ** (-10.17 / 2), rel=1e-12)


@given(st.floats(-75.0, 100.0), st.floats(0.01, 1000.0))
def test_wlf_round_trip(temperature: float, frequency: float) -> None:
    """The equivalent temperature sees at 10 Hz the reduced frequency that ``frequency`` sees at ``temperature``."""
    equivalent = _equivalent_temperature(dma(), np.array([temperature]), frequency)
    reduced = frequency * wlf_shift(np.array([temperature]), WLF)[0]
    assume(np.log10(reduced / 10.0) > -9.5)  # the law reaches no shift below 10**-c1
    assert 10.0 * wlf_shift(equivalent, WLF)[0] == pytest.approx(reduced, rel=1e-6)


@pytest.mark.parametrize("frequency", [0.1, 1.0, 10.0, 100.0])
def test_table_and_master_curve_agree_with_the_material(frequency: float) -> None:
    T = np.linspace(-50.0, 70.0, 25)
    truth = exact(frequency, T)
    inside = _equivalent_temperature(dma(), T, frequency) <= 120.0
    assert inside.sum() >= 10
    for rubber, where in ((dma(), inside), (master(), np.ones_like(inside))):
        found = moduli(rubber, T, frequency)
        np.testing.assert_allclose(found.real[where], truth.real[where], rtol=5e-3)
        np.testing.assert_allclose(found.imag[where], truth.imag[where], rtol=5e-3)
    # Beyond the hottest row the table's last value is held.
    np.testing.assert_allclose(moduli(dma(), T, frequency)[~inside], exact(10.0, np.array(120.0)), rtol=1e-9)


def test_a_master_curve_is_known_as_far_as_its_frequencies_reach() -> None:
    """A shorter curve makes a shorter table, so that a temperature beyond it counts as outside, as with a DMA table."""
    shortened = master().master_curve
    kept = slice(50, 181)  # 10**-7 to 10**6 Hz
    columns = [column[kept] for column in (shortened.frequency_Hz, shortened.storage_modulus_Pa, shortened.loss_modulus_Pa)]
    short = Rubber(**HEAT, wlf=WLF, master_curve=MasterCurve(*columns))
    low, high = known_range(short)
    assert low == -40.0  # the shift reaches further, the table does not
    assert 10.0 * wlf_shift(np.array([high]), WLF)[0] == pytest.approx(1e-7, rel=1e-6)
    table, first, step = ratio_table(short, -20.0, "loss_tangent")
    assert first == low
    assert first + step * (len(table) - 1) == pytest.approx(high, abs=step)
    whole, _, _ = ratio_table(master(), -20.0, "loss_tangent")
    np.testing.assert_allclose(table, whole[: len(table)], rtol=1e-3)


def test_another_frequency_needs_wlf() -> None:
    bare = Rubber(**HEAT, dma=dma().dma)
    with pytest.raises(ValueError, match="wlf"):
        moduli(bare, np.array([20.0]), 1.0)


def test_friction_measures() -> None:
    E = np.array([3.0 + 4.0j])
    assert friction_measure(E, "loss_over_modulus")[0] == pytest.approx(0.8)
    assert friction_measure(E, "loss_tangent")[0] == pytest.approx(4.0 / 3.0)
    assert friction_measure(E, "loss_modulus")[0] == 4.0


def test_ratio_table_against_the_reference_page() -> None:
    rubber = vehicle().rubber
    track = ReferenceTrack(VEHICLE_FILE)
    table, low, step = ratio_table(rubber, 15.0, "loss_over_modulus")
    for T in (-60.0, -44.0, 0.0, 15.0, 40.0, 90.0):
        np.testing.assert_allclose(table[round((T - low) / step)], track.exact_ratios(T), rtol=1e-9)


def test_without_rubber_nothing_depends_on_temperature() -> None:
    table, _, _ = ratio_table(None, 15.0, "loss_over_modulus")
    assert np.all(table == 1.0)


def test_landmarks_of_the_shipped_table() -> None:
    T = np.arange(-85.0, 20.0, 0.1)
    E = moduli(vehicle().rubber, T)  # type: ignore[arg-type]
    assert T[E.imag.argmax()] == pytest.approx(-61.1, abs=1.5)
    assert T[(E.imag / E.real).argmax()] == pytest.approx(-44.4, abs=1.5)


def test_the_curve_through_a_table_is_that_of_scipy() -> None:
    """Rising, falling, level and turning tables of two and more places; at their places and between."""
    random = np.random.default_rng(5)
    for count in (2, 3, 4, 30):
        for kind in range(20):
            axis = np.cumsum(random.uniform(0.1, 3.0, count))
            values = random.standard_normal(count).round(kind % 3)  # rounded ones have equal neighbours
            x = np.concatenate([axis, random.uniform(axis[0], axis[-1], 50)])
            np.testing.assert_allclose(monotone(axis, values, x), PchipInterpolator(axis, values)(x), rtol=0.0, atol=1e-14)
