# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Friction of rubber sliding on a self-affine rough road: the full contact integral, to judge the ratio form of the chain by.

Source: B. N. J. Persson, J. Chem. Phys. 115 (2001) 3840, with the contact-area correction S(q) of B. N. J. Persson,
J. Phys.: Condens. Matter 18 (2006) 7789. The compiled chain uses the ratio form E''/|E| instead, the limit of one
dominant wavevector and light contact; ``ratio_validity`` shows over which temperatures that holds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid, trapezoid
from scipy.special import erf

from lugre_steering.recording import Array
from lugre_steering.vehicle.rubber import ComplexArray, friction_measure, moduli
from lugre_steering.vehicle.sections import Rubber

Modulus = Callable[[Array], ComplexArray]
"""Complex modulus [Pa] over the frequency [Hz]."""

POISSON = 0.5
GAMMA = 0.5


@dataclass(frozen=True)
class Road:
    """Self-affine road: Hurst exponent, roll-off and cut-off wavevectors [1/m], root mean square height [m]."""

    hurst: float = 0.8
    roll_off_1_m: float = 2.0 * np.pi / 5e-3
    cut_off_1_m: float = 2.0 * np.pi / 5e-6
    rms_height_m: float = 5e-4


def power_spectrum(q: Array, road: Road) -> Array:
    """Surface roughness power spectrum C(q) [m4] (n,): C0 (q/q0)**-2(1+H) between q0 and q1, 0 elsewhere.

    Normalised to the height: <h**2> = 2 pi integral of q C(q) dq.
    """
    ratio = road.cut_off_1_m / road.roll_off_1_m
    level = road.hurst * road.rms_height_m**2 / (np.pi * road.roll_off_1_m**2 * (1.0 - ratio ** (-2.0 * road.hurst)))
    inside = (q >= road.roll_off_1_m) & (q <= road.cut_off_1_m)
    return np.where(inside, level * (q / road.roll_off_1_m) ** (-2.0 * (1.0 + road.hurst)), 0.0)


def friction_coefficient(
    modulus: Modulus, speed_m_s: float, pressure_Pa: float, road: Road, wavevectors: int = 300, angles: int = 41
) -> float:
    """Hysteretic friction coefficient of rubber sliding at ``speed_m_s`` under the nominal ``pressure_Pa`` p0.

    mu = 1/2 int q**3 C S P int_0^2pi cos(phi) Im[E(q v cos phi) / ((1 - nu**2) p0)] dphi dq,
    P = erf(1 / (2 sqrt G)), S = gamma + (1 - gamma) P**2,
    G(q) = 1/8 int_q0^q q'**3 C int_0^2pi |E(q' v cos phi) / ((1 - nu**2) p0)|**2 dphi dq'.
    The integrand over phi repeats in each quadrant (E'' is odd in the frequency, as is the cosine): Gauss-Legendre over
    ``angles`` in one. Trapezoid over u, log(q / q0) ~ u**2, which removes the singularity P ~ (q - q0)**-1/2 at q0.
    """
    u = np.linspace(0.0, 1.0, wavevectors)
    log_q = np.log(road.roll_off_1_m) + np.log(road.cut_off_1_m / road.roll_off_1_m) * u**2
    q = np.exp(log_q)
    node, weight = np.polynomial.legendre.leggauss(angles)
    phi, weight = 0.25 * np.pi * (node + 1.0), 0.25 * np.pi * weight
    frequency = q[:, None] * speed_m_s * np.cos(phi) / (2.0 * np.pi)
    reduced = modulus(frequency.ravel()).reshape(frequency.shape) / ((1.0 - POISSON**2) * pressure_Pa)
    spectrum = power_spectrum(np.clip(q, road.roll_off_1_m, road.cut_off_1_m), road)
    gradient = q**4 * spectrum * (4.0 * (np.abs(reduced) ** 2) @ weight)  # times q: the variable is log q
    G = cumulative_trapezoid(gradient, log_q, initial=0.0) / 8.0
    with np.errstate(divide="ignore"):
        P = erf(0.5 / np.sqrt(G))
    S = GAMMA + (1.0 - GAMMA) * P**2
    integrand = q**4 * spectrum * S * P * (4.0 * reduced.imag @ (weight * np.cos(phi)))
    return float(0.5 * trapezoid(integrand * 2.0 * u * np.log(road.cut_off_1_m / road.roll_off_1_m), u))


def rubber_modulus(rubber: Rubber, temperature_degC: float) -> Modulus:
    """Complex modulus over the frequency of a rubber with a WLF shift, at one temperature."""

    def modulus(frequency_Hz: Array) -> ComplexArray:
        # moduli() takes one frequency: reduce to it by asking each distinct frequency once on a logarithmic grid.
        low, high = np.log10(frequency_Hz.min()), np.log10(frequency_Hz.max())
        grid = np.linspace(low, high, max(2, round((high - low) * 40)))
        values = np.array([moduli(rubber, np.array([temperature_degC]), float(10.0**x))[0] for x in grid])
        x = np.log10(frequency_Hz)
        result: ComplexArray = 10.0 ** np.interp(x, grid, np.log10(values.real)) + 1j * 10.0 ** np.interp(
            x, grid, np.log10(values.imag)
        )
        return result

    return modulus


@dataclass(frozen=True)
class RatioValidity:
    """Both friction laws over temperature [degC] (n,), relative to the reference temperature."""

    temperature_degC: Array
    integral: Array
    ratio: Array

    def agreement(self, tolerance: float) -> tuple[float, float] | None:
        """Widest stretch around unity in which the ratio form is within ``tolerance`` (relative) of the integral."""
        good = np.abs(self.ratio / self.integral - 1.0) <= tolerance
        start = int(np.argmin(np.abs(self.integral - 1.0)))
        if not good[start]:
            return None
        low = start
        while low > 0 and good[low - 1]:
            low -= 1
        high = start
        while high < good.size - 1 and good[high + 1]:
            high += 1
        return float(self.temperature_degC[low]), float(self.temperature_degC[high])


def ratio_validity(
    rubber: Rubber,
    reference_degC: float,
    temperature_degC: Array,
    speed_m_s: float = 0.05,
    pressure_Pa: float = 1.2e5,
    road: Road | None = None,
) -> RatioValidity:
    """Compare mu(T) / mu(T_ref) of the integral with the ratio form [E''/|E|](T) / [E''/|E|](T_ref) of the chain."""
    road = road or Road()
    wanted = np.append(temperature_degC, reference_degC)
    mu = np.array([friction_coefficient(rubber_modulus(rubber, T), speed_m_s, pressure_Pa, road) for T in wanted])
    ratio = friction_measure(moduli(rubber, wanted), "loss_over_modulus")
    return RatioValidity(temperature_degC, mu[:-1] / mu[-1], ratio[:-1] / ratio[-1])
