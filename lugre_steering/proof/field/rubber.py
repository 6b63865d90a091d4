# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Rubber of the third simulator: a fractional Zener solid, other values for every vehicle, and the table its maker gives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LOWEST_DEGC, HIGHEST_DEGC, STEP_K = -80.0, 140.0, 0.25


class Rubber(NamedTuple):
    """Order of the fractional element, moduli [Pa], loss factor of the plateau, temperature at which w tau = 1 at 10 Hz."""

    order: float
    glassy_Pa: float
    rubbery_Pa: float
    plateau_loss: float
    softening_degC: float


class Ratios(NamedTuple):
    """Storage modulus and E''/|E*| relative to the reference temperature, on a grid of STEP_K from LOWEST_DEGC."""

    stiffness: Array
    friction: Array


def draw_rubber(rng: np.random.Generator) -> Rubber:
    """A filled tread rubber; friction falls by about 1 % per kelvin at room temperature."""
    return Rubber(
        rng.uniform(0.38, 0.46), rng.uniform(0.8e9, 1.5e9), rng.uniform(0.7e7, 1.3e7), rng.uniform(0.06, 0.11), rng.uniform(-66.0, -56.0)
    )


def modulus(rubber: Rubber, temperature_degC: Array) -> NDArray[np.complex128]:
    """Complex modulus [Pa] at 10 Hz: ``E = Er + (Eg - Er) (i w tau)^a / (1 + (i w tau)^a)``, Vogel-Fulcher relaxation time.

    The plateau softens by 0.4 % per kelvin and loses a constant share (filler).
    """
    above = np.asarray(temperature_degC, dtype=float) - rubber.softening_degC
    pulsation_tau = 10.0 ** (-9.5 * above / (44.0 + above))
    fractional = (1j * pulsation_tau) ** rubber.order
    plateau = rubber.rubbery_Pa * (1.0 + 1j * rubber.plateau_loss) * np.exp(-0.004 * (np.asarray(temperature_degC) - 20.0))
    return np.asarray(plateau + (rubber.glassy_Pa - plateau) * fractional / (1.0 + fractional))


def ratios(rubber: Rubber, reference_degC: float) -> Ratios:
    """What stiffness and friction are multiplied with at each temperature."""
    grid = np.arange(LOWEST_DEGC, HIGHEST_DEGC + STEP_K, STEP_K)
    value, reference = modulus(rubber, np.maximum(grid, rubber.softening_degC - 30.0)), modulus(rubber, np.array([reference_degC]))[0]
    loss = value.imag / np.abs(value)
    return Ratios(value.real / reference.real, loss / (reference.imag / abs(reference)))


def table(rubber: Rubber) -> str:
    """The maker's DMA table as CSV: what the vehicle file refers to."""
    rows = ["temperature_degC,storage_modulus_Pa,loss_modulus_Pa"]
    for temperature in np.arange(-84.0, 142.0, 2.0):
        value = modulus(rubber, np.array([max(temperature, rubber.softening_degC - 30.0)]))[0]
        rows.append(f"{temperature:.1f},{value.real:.6e},{value.imag:.6e}")
    return "\n".join(rows) + "\n"
