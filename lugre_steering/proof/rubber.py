# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Rubber law of the proof simulator: a closed Havriliak-Negami formula, where the estimator interpolates a table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FREQUENCY_HZ = 10.0
LOWEST_DEGC, HIGHEST_DEGC, STEP_K = -30.0, 100.0, 0.05  # range in which the formula follows the sheet's table


class RubberTable(NamedTuple):
    """Storage modulus and E''/|E*|, relative to the reference temperature, on a grid of STEP_K from LOWEST_DEGC."""

    storage: Array
    loss_ratio: Array


def complex_modulus(temperature_degC: Array) -> NDArray[np.complex128]:
    """Complex modulus E*(T) [Pa] at 10 Hz, shape as given.

    ``E* = Eg + (Er - Eg) / (1 + (i w tau)^a)^b`` (Havriliak & Negami 1967) with a hysteretic rubber plateau Er(T) and a
    WLF relaxation time tau(T). The constants were fitted to the reference sheet's 10 Hz table: storage modulus within
    0.11 %, loss modulus within 0.05 %, E''/|E*| within 0.11 % from -30 to 100 degC.
    """
    T = np.asarray(temperature_degC, dtype=float)
    plateau = 10**7.05748617 * (1.0 + 0.133130158j * np.exp(-0.00576532307 * (T - 20.0)))
    plateau = plateau * np.exp(-0.00689255645 * (T - 20.0))
    glass = 10**9.94866155
    tau = 10.0 ** (-0.725867566 - 10.2991723 * (T + 61.1) / (44.0205624 + T + 61.1))
    relaxing = (1.0 + (2j * np.pi * FREQUENCY_HZ * tau) ** 0.517925039) ** 0.0756894031
    return np.asarray(glass + (plateau - glass) / relaxing)


def rubber_table(reference_degC: float) -> RubberTable:
    """The two ratios that stiffness and friction follow, on a grid fine enough for linear interpolation (1e-6)."""
    grid = np.arange(LOWEST_DEGC, HIGHEST_DEGC + STEP_K, STEP_K)
    modulus, reference = complex_modulus(grid), complex_modulus(np.array([reference_degC]))[0]
    ratio = modulus.imag / np.abs(modulus)
    return RubberTable(modulus.real / reference.real, ratio / (reference.imag / abs(reference)))
