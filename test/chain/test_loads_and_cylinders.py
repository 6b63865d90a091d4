# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Roller loads and cylinder geometry against hand computation and numerical differentiation."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from chain_support import vehicle

from lugre_steering.chain.hydraulics import moment_arm
from lugre_steering.recording import Array
from lugre_steering.vehicle import Axle, Levers, Rollers, Track
from lugre_steering.vehicle.cylinders import gauge_offset, line_gains
from lugre_steering.vehicle.loads import load_moment, roller_loads, roller_radii, vertical_load

AXLE = Axle(80_000.0, 6.0, 0.09, 3.6, 2.1)


def track(rollers: Rollers) -> Track:
    return Track(rollers, weight_N=6000.0, width_m=0.45, hinge_offset_m=0.4, yaw_inertia_kgm2=95.0)


def test_levers_by_hand() -> None:
    levers = Levers(axle_m=(1.0, 3.0), weight_m=(2.0, 1.0), front_m=(0.3, 0.2), rear_m=(0.25, 0.25))
    loads = roller_loads(AXLE, track(Rollers(x_m=(0.6, 0.2, -0.2, -0.6), levers=levers)))
    # Axle 40 kN: 3/4 to the front balance; weight 6 kN: 1/3 to the front. Front 32 kN: 0.4/0.6; rear 14 kN: halves.
    np.testing.assert_allclose(loads, [12_800.0, 19_200.0, 7_000.0, 7_000.0])


def test_levers_load_the_rollers_from_the_foremost_on_in_whatever_order_they_are_given() -> None:
    levers = Levers(axle_m=(1.0, 3.0), weight_m=(2.0, 1.0), front_m=(0.3, 0.2), rear_m=(0.25, 0.25))
    loads = roller_loads(AXLE, track(Rollers(x_m=(-0.6, -0.2, 0.2, 0.6), levers=levers)))
    np.testing.assert_allclose(loads, [7_000.0, 7_000.0, 19_200.0, 12_800.0])


def test_levers_balance_moments() -> None:
    levers = Levers(axle_m=(0.4, 0.5), weight_m=(0.45, 0.45), front_m=(0.2, 0.24), rear_m=(0.22, 0.2))
    front, second, third, rear = roller_loads(AXLE, track(Rollers(x_m=(0.6, 0.2, -0.2, -0.6), levers=levers)))
    assert front + second + third + rear == pytest.approx(vertical_load(AXLE, track(Rollers(x_m=(0.0,)))))
    assert front * 0.2 == pytest.approx(second * 0.24)
    assert third * 0.22 == pytest.approx(rear * 0.2)


def test_shares_radii_and_moment() -> None:
    t = track(Rollers(x_m=(0.3, -0.3), load_share=(0.25, 0.75)))
    np.testing.assert_allclose(roller_loads(AXLE, t), [11_500.0, 34_500.0])
    np.testing.assert_allclose(roller_radii(t), [0.5, 0.5])
    assert load_moment(AXLE, t) == pytest.approx(23_000.0)


def cylinder_length(theta: Array, chassis_m: tuple[float, ...], knuckle_m: tuple[float, ...]) -> Array:
    """Pin-to-pin length [m] (n,) of a cylinder whose knuckle pivot turned by ``theta`` [rad] about the hinge."""
    x = knuckle_m[0] * np.cos(theta) - knuckle_m[1] * np.sin(theta)
    y = knuckle_m[0] * np.sin(theta) + knuckle_m[1] * np.cos(theta)
    return np.hypot(x - chassis_m[0], y - chassis_m[1])


def test_moment_arm_is_the_derivative_of_the_length() -> None:
    v = vehicle()
    assert v.hydraulics is not None
    theta, h = np.linspace(-0.5, 0.5, 21), 1e-5
    for c in v.hydraulics.cylinders.values():
        numeric = (
            cylinder_length(theta + h, c.chassis_m, c.knuckle_m) - cylinder_length(theta - h, c.chassis_m, c.knuckle_m)
        ) / (2 * h)
        np.testing.assert_allclose(moment_arm(theta, *c.chassis_m, *c.knuckle_m), numeric, rtol=1e-8, atol=1e-10)


def test_virtual_work() -> None:
    """Pressures do the same work on the oil as the torque on the axis, for both sides and all lines."""
    v = vehicle()
    assert v.hydraulics is not None
    pressure = dict(zip(v.hydraulics.lines, (9e6, 2e6, 7e6, 1e6), strict=True))
    theta, h = np.array([[0.21], [0.17]]), 1e-6
    gains = line_gains(v, theta)
    for s, side in enumerate(v.sides):
        torque = sum(gains[s, k, 0] * pressure[line] for k, line in enumerate(v.hydraulics.lines))
        work = 0.0
        for c in v.hydraulics.cylinders.values():
            if c.side == side:
                ends = [float(cylinder_length(theta[s] + d, c.chassis_m, c.knuckle_m)[0]) for d in (-h, h)]
                cap, rod = math.pi * c.bore_m**2 / 4, math.pi * (c.bore_m**2 - c.rod_m**2) / 4
                work += (pressure[c.cap] * cap - pressure[c.rod] * rod) * (ends[1] - ends[0])
        assert torque == pytest.approx(work / (2 * h), rel=1e-7)


def test_left_and_right_are_mirror_images() -> None:
    """Mirrored angle and swapped lines give the opposite torque on the other side."""
    v = vehicle()
    assert v.hydraulics is not None
    theta = np.linspace(-0.4, 0.4, 9)
    gains = line_gains(v, np.stack([theta, -theta]))
    swap = [v.hydraulics.lines.index(name) for name in ("main_b", "main_a", "aux_b", "aux_a")]
    np.testing.assert_allclose(gains[0], -gains[1][swap], rtol=1e-12, atol=1e-12)


def test_absolute_pressure_reference() -> None:
    v = vehicle()
    assert gauge_offset(v) == 0.0
    absolute = v.replace(sensors=dataclasses.replace(v.sensors, pressure_reference="absolute"))
    assert gauge_offset(absolute) == 101_325.0
