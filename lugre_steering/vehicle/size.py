# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How large a machine is beside a rubber-tracked vehicle, in decades: what is written for one must hold for all."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from lugre_steering.chain.rates import USUAL_ACCELERATION_RAD_S2
from lugre_steering.effects.entry import Parameter
from lugre_steering.vehicle.loads import load_moment
from lugre_steering.vehicle.sections import Vehicle

FRICTION_NM, STRIBECK_RAD_S, TRAVEL_RAD = 25e3, 0.026, 0.8
"""Friction torque and Stribeck speed of one track, and travel, of the vehicle whose size counts as one."""
FASTEST_RAD_S, FASTEST_JOINT_RAD_S = 10.0, 100.0
"""Beyond any steering, or an axis [m/s] that is not of unusual size; and beyond what servos and robots turn at."""
AXIS_ACCELERATION = 10.0
"""Acceleration of an axis for its size, against that of the vehicle."""
SPARE = 5.0
"""By how much the torque of a rig is overstated, so that ranges written for a vehicle, which rests on friction, are wide enough for it."""

RECALIBRATED = 2.0
"""By how much recalibration may move the friction of a vehicle: its file holds what was found when it was that much more or less."""

_DIMENSIONS = {"N m": (1, 0), "rad": (0, 1), "W": (1, 1), "J": (1, 1), "kg m2": (1, -1)}
"""Exponents of torque and angle; power and energy are torque times angle, so a linear axis has them right too."""
_UNIT = re.compile(r"(N m|kg m2|rad|W|J)(?![A-Za-z])(?:\^?(\d))?")


@dataclass(frozen=True)
class Size:
    """Units of torque [N m] and angle [rad] of a machine, powers of ten, so that all vehicles alike share one; and how far from zero it
    turns [rad], where that may be further than tracks do. ``tracked``: ranges written for a vehicle hold for it too, whatever its size."""

    torque: float = 1.0
    angle: float = 1.0
    farthest: float = 0.0
    tracked: bool = False

    @property
    def usual(self) -> bool:
        """Whether what is written for a vehicle holds as it stands."""
        return self.torque == self.angle == 1.0 and not self.farthest

    def of(self, unit: str) -> float:
        """What a number in a unit of the catalogue, written for a vehicle, is worth on this machine."""
        above, _, below = unit.partition("/")
        return self._product(above) / self._product(below)

    def range_of(self, parameter: Parameter) -> tuple[float, float]:
        """Lowest and highest value of a parameter of the catalogue on this machine."""
        worth = self.of(parameter.unit)
        low, high = parameter.low * worth, parameter.high * worth
        return (min(parameter.low, low), max(parameter.high, high)) if self.tracked else (low, high)

    def _product(self, text: str) -> float:
        worth = 1.0
        for name, power in _UNIT.findall(text):
            torque, angle = _DIMENSIONS[name]
            worth *= (self.torque**torque * self.angle**angle) ** int(power or 1)
        return worth


VEHICLE = Size()
"""The size that counts as one."""


def decade(value: float, reference: float) -> float:
    """The power of ten nearest to value / reference; 1 where there is no value."""
    return 10.0 ** round(math.log10(value / reference)) if 0.0 < value < math.inf else 1.0


def vehicle_size(vehicle: Vehicle, times: float = 1.0) -> Size:
    """Size of a vehicle as its sheet tells: by the sliding friction of one track, or so many times that."""
    axle, track, friction = vehicle.axle, vehicle.track, vehicle.friction
    if axle is None or track is None or friction is None or friction.coulomb is None:
        return VEHICLE
    return Size(decade(times * friction.coulomb * load_moment(axle, track), FRICTION_NM), tracked=True)


def acceleration_unit(vehicle: Vehicle) -> float:
    """Size of the accelerations, likewise, or what the filter of its motion was chosen for; an axis is driven by a screw or a belt, and
    faster for its size than tracks are turned."""
    sigma, filter_s = vehicle.sensors.angle_sigma, vehicle.sensors.rate_filter_s
    if filter_s is not None and sigma > 0.0:
        return sigma / (USUAL_ACCELERATION_RAD_S2 * filter_s**2)
    return 1.0 if vehicle.coordinate.unit == "rad" else AXIS_ACCELERATION * angle_unit(vehicle)


def fastest(vehicle: Vehicle) -> float:
    """Rate [rad/s] that no angle of such a machine has: a faster change is a spike."""
    if vehicle.contact is None or vehicle.coordinate.unit == "m":
        return FASTEST_RAD_S * max(1.0, angle_unit(vehicle))
    return FASTEST_JOINT_RAD_S


def angle_unit(vehicle: Vehicle) -> float:
    """Size of the travel of a linear axis as its sheet tells; an angle is one on machines of any size."""
    if vehicle.coordinate.unit == "rad" or vehicle.contact is None:
        return 1.0
    return decade(math.radians(vehicle.contact.stribeck_speed_deg_s), STRIBECK_RAD_S)
