# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Ground pressure: its integral is the load, roller by roller, whatever the exponent; width and exponent shape it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import dblquad

from lugre_steering.vehicle import Axle, Rollers, Track
from lugre_steering.vehicle.footprint import contact_lengths, ground_pressure, peak_pressure

AXLE = Axle(80_000.0, 6.0, 0.09, 3.6, 2.1)
TRACK = Track(
    Rollers(x_m=(-0.6, 0.0, 0.6), load_share=(0.5, 0.3, 0.2)), weight_N=10_000.0, width_m=0.4, hinge_offset_m=0.4,
    yaw_inertia_kgm2=95.0,
)  # fmt: skip
AREA = 0.3


@pytest.mark.parametrize("exponent", [2.0, 2.7, 4.0])
def test_each_rollers_pressure_carries_its_load(exponent: float) -> None:
    track = dataclasses.replace(TRACK, ground_pressure_exponent=exponent)
    lengths = contact_lengths(AXLE, track, AREA)
    assert lengths.sum() * track.width_m == pytest.approx(AREA)
    for centre, length, load in zip(track.rollers.x_m, lengths, (25_000.0, 15_000.0, 10_000.0), strict=True):
        carried, _ = dblquad(
            lambda y, x: float(ground_pressure(AXLE, track, AREA, np.array([x]), np.array([y]))[0, 0]),
            centre - 0.5 * length, centre + 0.5 * length, -0.2, 0.2, epsrel=1e-5,
        )  # fmt: skip
        assert carried == pytest.approx(load, rel=1e-4)


def test_by_hand() -> None:
    # Mean of cos^2 is 1/2, the fall across halves again: 50 kN on 0.3 m2 peak at four times the mean.
    soft = dataclasses.replace(TRACK, ground_pressure_exponent=2.0)
    assert peak_pressure(AXLE, soft, AREA) == pytest.approx(4.0 * 50_000.0 / 0.3)
    at = ground_pressure(AXLE, soft, AREA, np.array([-0.6, 0.0, 0.3]), np.array([0.0, 0.1, -0.2]))
    np.testing.assert_allclose(at / peak_pressure(AXLE, soft, AREA), [[1, 1, 0], [0.5, 0.5, 0], [0, 0, 0]], atol=1e-12)


def test_width_and_exponent_act() -> None:
    x, y = np.linspace(-0.7, 0.7, 50), np.linspace(-0.15, 0.15, 7)
    base = ground_pressure(AXLE, TRACK, AREA, x, y)
    for change in ({"width_m": 0.5}, {"ground_pressure_exponent": 2.0}):
        other = ground_pressure(AXLE, dataclasses.replace(TRACK, **change), AREA, x, y)
        assert np.abs(other - base).max() > 0.05 * base.max()
