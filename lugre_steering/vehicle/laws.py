# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Laws in a vehicle file, checked."""

from __future__ import annotations

from lugre_steering.effects.law_entry import THERMAL, check_law
from lugre_steering.schema import Reader
from lugre_steering.vehicle.sections import Vehicle

MOST_IN_FILE = 16


def check_laws(vehicle: Vehicle, reader: Reader) -> None:
    """Refuse laws that mean nothing, by file and key."""
    if len(vehicle.laws) > MOST_IN_FILE:
        raise reader.fail("laws", f"{len(vehicle.laws)} laws", f"at most {MOST_IN_FILE}")
    for i, entry in enumerate(vehicle.laws):
        check_law(entry, reader, f"laws[{i}]")
        if entry.coordinate in THERMAL and vehicle.rubber is None:
            expected = "a vehicle with the section 'rubber' for a law of temperature"
            raise reader.fail(f"laws[{i}].coordinate", entry.coordinate, expected)
