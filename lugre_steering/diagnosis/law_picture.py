# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""f of a found law with its band over what the data say, on axes of Matplotlib."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from lugre_steering import units
from lugre_steering.diagnosis.found_law import FoundLaw
from lugre_steering.effects import laws
from lugre_steering.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def axis_of(vehicle: Vehicle, law: FoundLaw) -> tuple[str, float]:
    """Label of the coordinate, and factor from SI to what it says."""
    unit, name = laws.COORDINATES[law.coordinate], law.coordinate.replace("_", " ")
    if law.memory == "relay":
        return f"relay of the {name}", 1.0
    if law.memory == "ring":
        name = f"ringing of the {name}"
    if unit.startswith("rad") and not units.is_linear(vehicle):
        return f"{name} (deg{unit[3:]})", math.degrees(1.0)
    return f"{name} ({units.label(vehicle, unit)})", 1.0


def unit_of(vehicle: Vehicle, law: FoundLaw) -> str:
    """Unit of f."""
    return units.label(vehicle, laws.CHANNELS[law.channel])


def draw(ax: Axes, vehicle: Vehicle, law: FoundLaw) -> None:
    """f, its band and the data on one pair of axes."""
    from lugre_steering.report.style import IMPROVED, MEASURED

    (label, scale), f, colour = axis_of(vehicle, law), law.f, IMPROVED["color"]
    at, value, band = scale * np.array(f.at), np.array(f.f), np.array(f.band)
    ax.plot(scale * np.array(f.points_at), f.points, "o", markersize=4, color=MEASURED["color"], label="the data, in steps")
    ax.plot(at, value, color=colour, label="f with its 95 % band")
    ax.fill_between(at, value - band, value + band, color=colour, alpha=0.2, linewidth=0)
    ax.set_xlabel(units.words(vehicle, label))
    ax.set_ylabel(f"f ({unit_of(vehicle, law)})")
    ax.legend(loc="best")
