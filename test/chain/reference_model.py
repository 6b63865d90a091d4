# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The baseline as a plain-Python page, equation by equation, without the package's chain: the oracle of its tests.

It reads a vehicle file by itself (YAML and CSV) and takes angles of both tracks; SI, temperatures in degC.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.interpolate import PchipInterpolator


class ReferenceTrack:
    """One track assembly on its four rollers."""

    def __init__(self, file: Path) -> None:
        sheet: dict[str, Any] = yaml.safe_load(file.read_text())
        axle, track, friction, rubber = sheet["axle"], sheet["track"], sheet["friction"], sheet["rubber"]

        # 7, 8, 10: roller loads, radii, friction torques at the reference temperature
        load = axle["load_N"] / 2 + track["weight_N"]
        moment = 0.0
        for x, share in zip(track["rollers"]["x_m"], track["rollers"]["load_share"], strict=True):
            moment += share * load * math.hypot(x, track["hinge_offset_m"])
        self.Ms, self.Mc = friction["static"] * moment, friction["coulomb"] * moment
        self.sigma_0 = friction["stiffness_Nm_per_deg"] * 180 / math.pi
        self.omega_st = math.radians(friction["stribeck_speed_deg_s"])
        self.delta = friction["stribeck_exponent"]
        self.xi, self.J = track["damping_ratio"], track["yaw_inertia_kgm2"]
        self.aligning = load * axle["kingpin_lever_arm_m"] * math.sin(math.radians(axle["kingpin_inclination_deg"]))

        # 3, 4: what the rubber's moduli at 10 Hz do to stiffness and friction
        rows = [row for row in csv.reader((file.parent / rubber["dma_csv"]).open()) if not row[0].startswith("#")]
        table = np.array(rows[1:], float)
        self.storage = PchipInterpolator(table[:, 0], np.log10(table[:, 1]))
        self.loss = PchipInterpolator(table[:, 0], np.log10(table[:, 2]))
        self.T_ref = friction["reference_temperature_degC"]
        self.low, self.high = table[0, 0], table[-1, 0]

        # 6: heat balance of the tread
        volume = rubber["contact_area_m2"] * rubber["tread_thickness_m"]
        self.C = rubber["density_kg_m3"] * rubber["specific_heat_J_kgK"] * volume
        self.cooling = rubber["heat_transfer_W_m2K"] * rubber["contact_area_m2"]
        self.T, self.T_air = sheet["initial"]["rubber_temperature_degC"], sheet["initial"]["air_temperature_degC"]
        self.z = 0.0

    def exact_ratios(self, T: float) -> tuple[float, float]:
        """E'/E'_ref and (E''/|E|)/(E''/|E|)_ref at one temperature."""
        E1, E2 = 10 ** float(self.storage(T)), 10 ** float(self.loss(T))
        R1, R2 = 10 ** float(self.storage(self.T_ref)), 10 ** float(self.loss(self.T_ref))
        return E1 / R1, (E2 / math.hypot(E1, E2)) / (R2 / math.hypot(R1, R2))

    def ratios(self, T: float) -> tuple[float, float]:
        """The same, linear between knots every 0.1 K as the compiled table has them."""
        T = min(max(T, self.low), self.high)
        knot = math.floor((T - self.low) / 0.1)
        weight = (T - self.low) / 0.1 - knot
        a, b = self.exact_ratios(self.low + 0.1 * knot), self.exact_ratios(min(self.low + 0.1 * (knot + 1), self.high))
        return a[0] + weight * (b[0] - a[0]), a[1] + weight * (b[1] - a[1])

    def g(self, omega: float, T: float) -> float:
        """2, 10: steady sliding torque."""
        mu = self.ratios(T)[1]
        return mu * (self.Mc + (self.Ms - self.Mc) * math.exp(-(abs(omega / self.omega_st) ** self.delta)))

    def advance(self, theta: float, d_theta: float, omega: float, dt: float) -> float:
        """Exact bristle step over one sample, then heat; returns the torque of this track."""
        stiffness = self.sigma_0 * self.ratios(self.T)[0]
        sigma_1 = 2 * self.xi * math.sqrt(stiffness * self.J)  # 11
        g = self.g(omega, self.T)
        z, z_ss = self.z, math.copysign(g / stiffness, d_theta)
        self.z = z_ss + (z - z_ss) * math.exp(-stiffness * abs(d_theta) / g)
        dz_dt = omega - stiffness * abs(omega) * self.z / g
        torque = stiffness * self.z + sigma_1 * dz_dt

        work = math.copysign(1.0, d_theta) * g * (d_theta - (self.z - z)) + sigma_1 * omega * (self.z - z)
        power_dt = max(work - stiffness * (self.z**2 - z**2) / 2, 0.0)
        cooled = self.cooling * dt / self.C / 2
        self.T = (self.T * (1 - cooled) + 2 * cooled * self.T_air + power_dt / self.C) / (1 + cooled)
        return torque + self.aligning * math.sin(theta)  # 12


def reference_torque(
    file: Path, time: Sequence[float], theta: np.ndarray, omega: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Torque and temperature (n, 2) of both tracks for angles and rates (n, 2)."""
    tracks = (ReferenceTrack(file), ReferenceTrack(file))
    torque, temperature = np.zeros_like(theta), np.zeros_like(theta)
    for i in range(len(time)):
        before = max(i - 1, 0)
        for side, track in enumerate(tracks):
            d_theta = theta[i, side] - theta[before, side]
            torque[i, side] = track.advance(theta[i, side], d_theta, omega[i, side], time[i] - time[before])
            temperature[i, side] = track.T
    return torque, temperature
