# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A law that a diagnosis found, with the names of the contract's JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from lugre_steering.serialise import ADDED

Interval = tuple[float | None, float | None]


@dataclass(frozen=True)
class LawTie:
    """Another law that fits as well: what it is in words, and its keys as in the vehicle file."""

    title: str = field(metadata=ADDED)
    channel: str
    coordinate: str
    memory: str
    memory_size: float


@dataclass(frozen=True)
class LawCurve:
    """f of a law over its coordinate with the half width of its 95 % band, (n,) each; and what the data say of it within steps of the
    coordinate, (m,) each. In SI units: of the coordinate ``at`` and ``points_at``, of the channel the others."""

    at: tuple[float, ...]
    f: tuple[float, ...]
    band: tuple[float, ...]
    points_at: tuple[float, ...]
    points: tuple[float, ...]


@dataclass(frozen=True)
class FoundLaw:
    """A law that no entry of the catalogue is: ``channel`` x f(``coordinate``), with the keys that it has in the vehicle file, in SI units.

    ``title``: in words; ``values`` of its ``form`` by name (none of a table) with their 95 % ``intervals``; ``range``: where its coordinate
    was seen; ``largest_Nm``: largest torque it makes in the recordings [N m], ``largest_share`` of the amplitude of the measured torque;
    ``heldout_gain``: share of the missing energy that it foretells on held-out data; ``gain``: energy that it takes, in noise variances,
    and ``bar``: the most that searches took where nothing is; ``share_of_ceiling``: share of what any function of the same coordinates
    foretells; ``nearest_listed``: entries of the catalogue in whose place it stands.
    """

    id: Annotated[str, {"pattern": "^law_[1-9][0-9]*$"}]
    title: str
    channel: str
    coordinate: str
    memory: str
    memory_size: float
    form: str
    values: Mapping[str, float]
    intervals: Mapping[str, Interval]
    range: tuple[float, float]
    largest_Nm: float
    largest_share: float
    heldout_gain: float | None
    gain: float
    bar: float
    share_of_ceiling: float | None
    ties: tuple[LawTie, ...]
    nearest_listed: tuple[str, ...]
    f: LawCurve
