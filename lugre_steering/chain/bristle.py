# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""LuGre friction of rubber on the ground.

Sources: C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, "A new model for control of systems with friction",
IEEE TAC 40 (1995) 419; K. J. Astrom, C. Canudas de Wit, "Revisiting the LuGre friction model", IEEE CSM
28(6) (2008) 101.
"""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import exp, law


@law
def stribeck(omega: float, static: float, coulomb: float, speed: float, exponent: float) -> float:
    """Steady sliding torque g = Mc + (Ms - Mc) exp(-|omega / omega_St|**delta) [N m] (op. cit. 1995)."""
    ratio = abs(omega) / speed
    power = ratio * ratio if exponent == 2.0 else ratio if exponent == 1.0 else ratio**exponent
    return coulomb + (static - coulomb) * exp(-power)


@law
def bristle(z: float, d_theta: float, stiffness: float, g: float) -> float:
    """Bristle deflection [rad] after the contact turned by ``d_theta`` [rad] at constant rate: exact for any step.

    dz/dt = omega - sigma_0 |omega| z / g  =>  z+ = z_ss + (z - z_ss) exp(-sigma_0 |d_theta| / g),
    z_ss = sgn(omega) g / sigma_0.
    """
    z_ss = math.copysign(g / stiffness, d_theta)
    return z_ss + (z - z_ss) * exp(-stiffness * abs(d_theta) / g)


@law
def bristle_work(z: float, z_next: float, d_theta: float, g: float) -> float:
    """Work of the elastic torque [J] over the exact step from ``z`` to ``z_next``: integral of sigma_0 z dtheta.

    g (|d_theta| + sgn(d_theta) (z - z_next)), the closed-form integral of the exponential step.
    """
    return g * (abs(d_theta) + math.copysign(1.0, d_theta) * (z - z_next))
