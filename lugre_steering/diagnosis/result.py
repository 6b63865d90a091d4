# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis came to, with the names of the contract's JSON, and beside it the arrays that the report draws."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Final, Literal

from lugre_steering import units
from lugre_steering.recording import Array, BagFinding, unused_name
from lugre_steering.result import Result
from lugre_steering.serialise import IN_MEMORY, finite, mapped
from lugre_steering.vehicle import Vehicle, save

SCHEMA: Final = "lugre_steering/diagnosis/1"

Verdict = Literal["consistent", "missing_physics", "unlisted_physics", "insufficient_data"]
Stage = Literal["motion", "contact", "thermal", "parallel_torque", "measurement"]
Interval = tuple[float | None, float | None]
Share = Annotated[float, {"minimum": 0, "maximum": 1}]


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
class Errors:
    """How well a model explains the torque: RMSE [N m] over all valid samples, and over those held out (None: none were)."""

    rmse_Nm: float
    heldout_rmse_Nm: float | None


@dataclass(frozen=True)
class Augmented(Errors):
    """The recalibrated model with the effects found; ``improvement`` is 1 - its held-out RMSE over the baseline's, with its
    95 % interval (None where nothing could be judged)."""

    improvement: float | None
    improvement_ci95: Interval | None
    vehicle: Vehicle = field(repr=False, metadata=IN_MEMORY)
    """The vehicle file of it, to replay, simulate or run live."""

    def save(self, path: str | Path) -> None:
        """Write the vehicle file (augmented.yaml of the command)."""
        save(self.vehicle, path)


@dataclass(frozen=True)
class FittedValue:
    """One fitted parameter with its 95 % interval, in ``unit``."""

    value: float | None
    ci95: Interval
    unit: str


@dataclass(frozen=True)
class Place:
    """Where something acts in one bag: stretches [s] since its first stamp, and the range of the telling coordinate in ``unit``."""

    bag: str
    intervals_s: tuple[tuple[float, float], ...]
    coordinate: str
    range: Interval
    unit: str


@dataclass(frozen=True)
class NamedEffect:
    """One effect of the catalogue that the baseline leaves out.

    ``energy_share``: share of the baseline's residual energy that it explains; ``masked_share``: share of its signature that
    recalibrating the baseline had absorbed; both 0 to 1. ``parameters``: values by name (by line for an effect of a line).
    """

    id: Annotated[str, {"pattern": "^[a-z][a-z0-9_]*$"}]
    stage: Stage
    statement: str
    p_value: Share
    parameters: Mapping[str, FittedValue]
    where: tuple[Place, ...]
    energy_share: Share
    masked_share: Share
    indistinguishable_from: Annotated[tuple[str, ...], {"maxItems": 6}]


@dataclass(frozen=True)
class Unexplained:
    """What is left: whether it is structure, where, and the best formula over named, unit-carrying variables."""

    structured: bool
    description: str
    formula: str | None = None
    where: tuple[Place, ...] | None = None


@dataclass(frozen=True)
class Limit:
    """Smallest ``parameter`` of an effect, in ``unit``, that these recordings would have revealed; None: none that is possible."""

    parameter: str
    smallest: float | None
    unit: str


@dataclass(frozen=True)
class Experiment:
    """What to drive next, what that separates, and why."""

    manoeuvre: str
    separates: tuple[str, ...]
    why: str


@dataclass(frozen=True)
class Diagnosis(Result):
    """What a diagnosis came to, with the names of ``diagnosis.json``; torques in N m (the vehicle's force unit for a linear axis).

    ``noise_floor_Nm``: RMSE that noise alone would leave; ``detection_limits``: by effect; ``augmented.vehicle``: the vehicle with
    the effects in it. ``traces`` and ``evidence`` are kept in memory for pictures.
    """

    schema: Literal["lugre_steering/diagnosis/1"]
    bags: Annotated[tuple[str, ...], {"minItems": 1}]
    verdict: Verdict
    statement: Annotated[str, {"minLength": 20}]
    noise_floor_Nm: Annotated[float, {"exclusiveMinimum": 0}]
    baseline: Errors
    augmented: Augmented
    effects: tuple[NamedEffect, ...]
    unexplained: Unexplained
    detection_limits: Mapping[str, Limit]
    data_quality: tuple[BagFinding, ...]
    next_experiment: Experiment | None
    traces: tuple[BagTrace, ...] = field(default=(), repr=False, metadata=IN_MEMORY)
    evidence: tuple[Evidence, ...] = field(default=(), repr=False, metadata=IN_MEMORY)
    coordinate_of: Mapping[str, str] = field(default_factory=dict, repr=False, metadata=IN_MEMORY)

    @property
    def vehicle(self) -> Vehicle:
        """The augmented vehicle."""
        return self.augmented.vehicle

    def in_words(self) -> Diagnosis:
        """The same in the words of the vehicle's coordinate, with None for every number that does not exist."""
        told: Diagnosis = units.in_words(self.vehicle, mapped(self, lambda value, _: finite(value)))
        return told
