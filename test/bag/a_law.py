# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A law as a diagnosis tells it, for tests of what shows it."""

from __future__ import annotations

from typing import Any

from lugre_steering.diagnosis.found_law import FoundLaw, LawCurve, LawTie

TIES = tuple(LawTie(title, "gain", "none", "none", 0.0) for title in ("a gain", "a loss", "more"))


def a_law(**changes: Any) -> FoundLaw:
    """A torque in proportion to the angle, with other values where they are given."""
    told: dict[str, Any] = {
        "id": "law_1", "title": "a torque", "channel": "conservative_torque", "coordinate": "angle", "memory": "none", "memory_size": 0.0,
        "form": "linear", "values": {"value": 0.0, "slope": 1500.0}, "intervals": {"slope": (1400.0, 1600.0)}, "range": (-0.6, 0.6),
        "largest_Nm": 900.0, "largest_share": 0.1, "heldout_gain": 0.5, "gain": 2e3, "bar": 30.0, "share_of_ceiling": 0.9, "ties": TIES,
        "nearest_listed": (), "f": LawCurve((-0.6, 0.0, 0.6), (-900.0, 0.0, 900.0), (60.0, 10.0, 60.0), (-0.3, 0.3), (-430.0, 470.0)),
    }  # fmt: skip
    return FoundLaw(**told | changes)
