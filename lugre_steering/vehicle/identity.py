# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What tells one vehicle file from another, whatever it is called."""

from __future__ import annotations

import hashlib

from lugre_steering.vehicle.sections import Vehicle


def identity(vehicle: Vehicle) -> str:
    """A hash of all that the vehicle file and its tables say."""
    return hashlib.sha256(repr(vehicle).encode()).hexdigest()
