# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Rubber: moduli over temperature and frequency, and what follows from them for stiffness and friction.

Sources: M. L. Williams, R. F. Landel, J. D. Ferry, JACS 77 (1955) 3701 (shift); B. N. J. Persson, J. Phys.: Condens.
Matter 10 (1998) 7789 and J. Chem. Phys. 115 (2001) 3840 (friction of rubber on rough ground); Liang et al. 2022 for
their use here (R).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lugre_steering.recording import Array
from lugre_steering.vehicle.monotone import monotone
from lugre_steering.vehicle.sections import Rubber, Wlf

TABLE_STEP_K = 0.1
WORKING_DEGC = (-40.0, 150.0)
"""Range of the table where a master curve reaches further."""

ComplexArray = NDArray[np.complex128]


def wlf_shift(temperature_degC: Array, wlf: Wlf) -> Array:
    """Shift factor aT (n,): log10 aT = -c1 (T - Tr) / (c2 + T - Tr); valid above Tr - c2 (clamped there)."""
    delta = np.maximum(np.asarray(temperature_degC, float) - wlf.reference_degC, 1e-3 - wlf.c2_K)
    shift: Array = 10.0 ** np.clip(-wlf.c1 * delta / (wlf.c2_K + delta), -30.0, 30.0)
    return shift


def moduli(rubber: Rubber, temperature_degC: Array, frequency_Hz: float | None = None) -> ComplexArray:
    """Complex modulus E' + i E'' [Pa] (n,) at each temperature and one frequency (default: the DMA frequency).

    A DMA table is interpolated in log modulus over temperature; another frequency f is reached through the equivalent
    temperature T* with f aT(T) = f_DMA aT(T*). A master curve is interpolated in log-log over the reduced
    frequency f aT.
    """
    temperature = np.asarray(temperature_degC, float)
    frequency = rubber.dma_frequency_Hz if frequency_Hz is None else frequency_Hz
    if rubber.master_curve is not None:
        assert rubber.wlf is not None
        curve = rubber.master_curve
        x = np.log10(frequency * wlf_shift(temperature, rubber.wlf))
        axis = np.log10(np.array(curve.frequency_Hz))
        storage, loss = curve.storage_modulus_Pa, curve.loss_modulus_Pa
    else:
        assert rubber.dma is not None
        if frequency != rubber.dma_frequency_Hz:
            temperature = _equivalent_temperature(rubber, temperature, frequency)
        x, axis = temperature, np.array(rubber.dma.temperature_degC)
        storage, loss = rubber.dma.storage_modulus_Pa, rubber.dma.loss_modulus_Pa
    x = np.clip(x, axis[0], axis[-1])
    real, imaginary = (10.0 ** monotone(axis, np.log10(column), x) for column in (storage, loss))
    modulus: ComplexArray = real + 1j * imaginary
    return modulus


def _equivalent_temperature(rubber: Rubber, temperature: Array, frequency: float) -> Array:
    """Temperature at which the DMA frequency sees the state that ``frequency`` sees at ``temperature``."""
    wlf = rubber.wlf
    if wlf is None:
        raise ValueError("another frequency than the DMA table's needs rubber.wlf")
    return _shifted_by(np.log10(frequency / rubber.dma_frequency_Hz * wlf_shift(temperature, wlf)), wlf)


def _shifted_by(log_shift: Array, wlf: Wlf) -> Array:
    """Temperature [degC] of a shift: inverse of the WLF law, delta = -c2 s / (c1 + s) for s = log10 aT, which must exceed -c1."""
    s = np.maximum(log_shift, 1e-6 - wlf.c1)
    result: Array = wlf.reference_degC - wlf.c2_K * s / (wlf.c1 + s)
    return result


def known_range(rubber: Rubber) -> tuple[float, float]:
    """Temperatures [degC] that the rubber's data cover: those of the DMA table, or that the shift brings onto the master curve."""
    if rubber.dma is not None:
        return rubber.dma.temperature_degC[0], rubber.dma.temperature_degC[-1]
    assert rubber.master_curve is not None
    assert rubber.wlf is not None
    ends = np.log10(np.array(rubber.master_curve.frequency_Hz)[[-1, 0]] / rubber.dma_frequency_Hz)
    low, high = _shifted_by(ends, rubber.wlf)
    return max(float(low), WORKING_DEGC[0]), min(float(high), WORKING_DEGC[1])


def friction_measure(modulus: ComplexArray, law: str) -> Array:
    """Quantity to which the friction coefficient is proportional: E''/|E| (Persson, light contact), E''/E' or E''."""
    if law == "loss_tangent":
        return modulus.imag / modulus.real
    if law == "loss_modulus":
        return modulus.imag
    measure: Array = modulus.imag / np.abs(modulus)
    return measure


def ratio_table(rubber: Rubber | None, reference_degC: float, law: str) -> tuple[Array, float, float]:
    """Table for the compiled step: columns E'/E'_ref and friction ratio over a uniform temperature grid.

    Returns (n, 2) table, first temperature [degC], step [K]. Without rubber both ratios are 1 everywhere.
    """
    if rubber is None:
        return np.ones((2, 2)), -1e6, 2e6
    low, high = known_range(rubber)
    temperature = low + TABLE_STEP_K * np.arange(round((high - low) / TABLE_STEP_K) + 1)
    modulus = moduli(rubber, np.asarray(temperature, np.float64))
    reference = moduli(rubber, np.array([reference_degC]))
    table = np.column_stack(
        [modulus.real / reference.real, friction_measure(modulus, law) / friction_measure(reference, law)]
    )
    return np.ascontiguousarray(table), float(low), TABLE_STEP_K
