# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Virgin rubber softens on its first full shear."""

from __future__ import annotations

import math

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter


@law
def tangent(z, z_max, amplitude, width):
    """a erfc((z_max - |z|) / width): stiffer where it was never sheared as far (Ogden and Roxburgh 1999)."""
    return amplitude * math.erfc((z_max - abs(z)) * (1.0 / width))


EFFECT = Effect(
    id="mullins_softening",
    stage="contact",
    tier=2,
    title="Virgin rubber softens on its first full shear",
    equation="dz/dtheta times 1 + a erfc((z_max - |z|) / width)",
    source="Mullins, Rubber Chem. Technol. 21 (1948) 281; Ogden and Roxburgh, Proc. R. Soc. A 455 (1999) 2861",
    trace="the first sweep is stiffer, later ones only near the farthest shear",
    coordinate="first sweep",
    parameters=(
        Parameter("amplitude", "1", "relative stiffening of virgin rubber", 0.2, 0.0, 3.0),
        Parameter("width", "rad", "deflection below the largest over which it fades", 0.02, 0.001, 0.5, (0.008, 0.03)),
    ),
    hooks={"tangent": tangent},
    rivals=("wear_polishing",),
    never_late=True,
)
