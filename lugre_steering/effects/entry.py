# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a catalogue entry is: plain data that names physics, says where it acts and how it shows in a recording."""

from __future__ import annotations

import math
from dataclasses import dataclass

STAGES = ("motion", "contact", "thermal", "parallel_torque", "measurement")


LOG_SCALE = 0.3


@dataclass(frozen=True)
class Parameter:
    """One number of an effect. Amplitudes (no ``grid``) are neutral at zero; shapes are tried over a grid before the fit.

    ``scale`` is a typical size in the given unit, used for signatures and finite differences. ``relative_to`` multiplies grid
    and scale by a property of the recording: 'max_angle' [rad], 'slip' [rad], 'duration' [s].
    """

    name: str
    unit: str
    meaning: str
    scale: float
    low: float = -math.inf
    high: float = math.inf
    grid: tuple[float, ...] = ()
    relative_to: str = ""
    optional: bool = False
    """Refinement of the shape: zero (or as the vehicle sheet has it) in the screen, fitted only once the effect is accepted."""

    @property
    def is_shape(self) -> bool:
        return bool(self.grid)

    @property
    def logarithmic(self) -> bool:
        """Positive shapes (times, angles, capacities) are fitted by their logarithm: halving is as far as doubling."""
        return self.is_shape and self.low > 0.0

    def scaled(self, value: float) -> float:
        """The value as fits see it: about one unit is a change worth seeing."""
        return math.log(value) / LOG_SCALE if self.logarithmic else value / self.scale

    def unscaled(self, number: float) -> float:
        return math.exp(number * LOG_SCALE) if self.logarithmic else number * self.scale

    def slope(self, number: float) -> float:
        """Change of the value per unit of its scaled number."""
        return LOG_SCALE * self.unscaled(number) if self.logarithmic else self.scale


@dataclass(frozen=True)
class Effect:
    """Physics that the baseline leaves out.

    ``equation`` in the field's notation, ``source`` the primary literature, ``trace`` how it looks in a residual,
    ``coordinate`` the axis along which it tells itself, ``rivals`` the entries it is easily taken for, ``needs`` what an
    unobservable one would take to be seen (empty: observable with the standard topics).
    """

    id: str
    stage: str
    tier: int
    title: str
    equation: str
    source: str
    trace: str
    coordinate: str
    parameters: tuple[Parameter, ...] = ()
    rivals: tuple[str, ...] = ()
    needs: str = ""
    per_line: bool = False
    """The single amplitude exists once per pressure line; the parameter is then named like the line."""

    @property
    def observable(self) -> bool:
        return not self.needs
