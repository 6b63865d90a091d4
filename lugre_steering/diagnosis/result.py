# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis came to: the contract's JSON, and beside it the arrays that the report draws."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from lugre_steering.recording import Array, unused_name
from lugre_steering.vehicle import Vehicle

SCHEMA = "lugre_steering/diagnosis/1"


def picture_names(names: Sequence[str]) -> list[str]:
    """File names of a report's pictures, in order: safe everywhere, and each its own."""
    stems: list[str] = []
    for name in names:
        stems.append(unused_name(re.sub(r"[^\w.-]+", "_", name), stems))
    return [f"{stem}.png" for stem in stems]


@dataclass(frozen=True)
class BagTrace:
    """One bag for the report, all (n,): time [s], measured torque, recalibrated baseline, augmented model [N m], and what
    each named effect contributes; coordinates by name for residual pictures."""

    name: str
    time: Array
    measured: Array
    baseline: Array
    augmented: Array
    held: Array
    contributions: Mapping[str, Array]
    intervals: Mapping[str, tuple[tuple[float, float], ...]]
    coordinates: Mapping[str, Array]
    heldout_Nm: tuple[float, float] | None = None
    """Held-out errors of the baseline and with the named effects, where one fit that saw none of these data was judged."""


@dataclass(frozen=True)
class Evidence:
    """One candidate in the table of evidence."""

    label: str
    title: str
    energy_share: float
    masked_share: float
    p_value: float
    heldout_gain: float | None
    verdict: str


@dataclass(frozen=True)
class Diagnosis:
    """``json`` follows the interface contract; ``vehicle`` is the augmented vehicle; the rest is for the report."""

    json: dict[str, Any]
    vehicle: Vehicle
    traces: tuple[BagTrace, ...] = ()
    evidence: tuple[Evidence, ...] = ()
    coordinate_of: Mapping[str, str] = field(default_factory=dict)


def finite(value: Any) -> Any:
    """The same tree with plain Python numbers, non-finite ones as None: what JSON can hold."""
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return value
    if isinstance(value, int):
        return value
    number = float(value)
    return number if math.isfinite(number) else None
