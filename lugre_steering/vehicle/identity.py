# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What tells one vehicle file from another, whatever it is called."""

from __future__ import annotations

import dataclasses
import hashlib

from lugre_steering.vehicle.sections import Vehicle


def identity(vehicle: Vehicle) -> str:
    """A hash of all that the vehicle file and its tables say."""
    said = ", ".join(f"{item.name}={getattr(vehicle, item.name)!r}" for item in dataclasses.fields(vehicle))
    return hashlib.sha256(f"Vehicle({said})".encode()).hexdigest()
