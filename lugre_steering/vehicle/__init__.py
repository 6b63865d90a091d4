# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The vehicle file: one frozen, typed, validated description of a vehicle and its model.

``load`` refuses unknown keys, missing keys, wrong types and impossible values with file, key, value and expectation;
``save`` writes a file that stands alone (tables embedded) and loads back equal.
"""

from lugre_steering.effects.law_entry import LawEntry
from lugre_steering.vehicle.effects import add_effect, each_once
from lugre_steering.vehicle.file import SCHEMA, from_mapping, load, save, to_mapping, vehicle_of
from lugre_steering.vehicle.sections import (
    Axle,
    Contact,
    Cylinder,
    DmaTable,
    EffectEntry,
    Friction,
    Hydraulics,
    Initial,
    Levers,
    MasterCurve,
    Rollers,
    Rubber,
    Sensors,
    Topics,
    TorqueSensor,
    Track,
    Vehicle,
    Wlf,
)  # fmt: skip
from lugre_steering.vehicle.tables import pavements

__all__ = [
    "SCHEMA", "Axle", "Contact", "Cylinder", "DmaTable", "EffectEntry", "Friction", "Hydraulics", "Initial", "LawEntry", "Levers",
    "MasterCurve", "Rollers", "Rubber", "Sensors", "Topics", "TorqueSensor", "Track", "Vehicle", "Wlf", "add_effect",
    "each_once", "from_mapping", "load", "pavements", "save", "to_mapping", "vehicle_of",
]  # fmt: skip
