# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a fleet came to, with the names of ``fleet.json``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from lugre_steering.bag.find import Skipped
from lugre_steering.counted import counted
from lugre_steering.fleet.changes import Difference
from lugre_steering.fleet.claims import ACTING, Claim, Outlier, Shared
from lugre_steering.fleet.work import FleetOptions
from lugre_steering.gate import Facts, Gate
from lugre_steering.provenance import Provenance
from lugre_steering.result import Result
from lugre_steering.serialise import ADDED, IN_MEMORY
from lugre_steering.vehicle import Vehicle

SCHEMA: Final = "lugre_steering/fleet/1"
RECORD, PAGE = "fleet.json", "report.html"


@dataclass(frozen=True)
class VehicleSummary:
    """One vehicle: sound recordings and those in quarantine, hours [h], first and last date, median RMSE of the replay [N m], verdicts.

    ``identity``: a hash of what its file and tables say, not of how they are written (in ``provenance`` stand those of ``sha256sum``);
    ``sha256``: the same, for readers of earlier results.
    """

    name: str
    file: str
    sha256: str
    recordings: int
    quarantined: int
    hours: float
    first: str | None
    last: str | None
    median_rmse_Nm: float | None
    verdicts: Mapping[str, int]
    vehicle: Vehicle = field(repr=False, metadata=IN_MEMORY)
    identity: str = field(default="", metadata=ADDED)


@dataclass(frozen=True)
class DiagnosedTogether:
    """Several recordings of a vehicle that were diagnosed as one: their paths, the verdict and its words, and the effects named."""

    vehicle: str
    bags: tuple[str, ...]
    verdict: str
    statement: str
    effects: tuple[str, ...]


@dataclass(frozen=True)
class Fleet(Result):
    """Recordings of many vehicles, examined one by one and judged together.

    ``finished``: false while a run is under way, or has been killed; ``examined``: recordings worked on in this run, ``cached``: those
    whose results were there; ``quarantine``: what tells nothing and why; ``claims``: what the budget of false discoveries ``budget``
    allows to be said, ``considered``: how many claims there were; ``seconds``: of this run, ``work_seconds``: of its workers together.
    """

    schema: Literal["lugre_steering/fleet/1"]
    finished: bool
    version: str
    date: str
    options: FleetOptions
    vehicles: tuple[VehicleSummary, ...]
    recordings: int
    examined: int
    cached: int
    quarantine: tuple[Skipped, ...]
    budget: float
    considered: int
    claims: tuple[Claim, ...]
    shared: tuple[Shared, ...]
    outliers: tuple[Outlier, ...]
    other_version: str | None
    changes: tuple[Difference, ...]
    workers: int
    seconds: float
    work_seconds: float
    together: tuple[DiagnosedTogether, ...] = field(default=(), metadata=ADDED)
    provenance: Provenance | None = field(default=None, metadata=ADDED)
    """By what version, when, with what options and from which files it was made."""


def gate(wanted: Sequence[str]) -> Gate:
    """What a fleet can be made to fail for."""
    return Gate(wanted, ("quarantine", "effect", "outlier", "change"), ("rmse",))


def facts(result: Mapping[str, Any]) -> Facts:
    """What of it is so; ``effect``: any that the budget allows to be claimed, ``rmse`` [N m]: the largest median of a vehicle."""
    acting = (claim for claim in result["claims"] if claim["kind"] in ACTING)
    effects = sorted({f"{claim['effect']} on {claim['vehicle'] or 'all vehicles'}" for claim in acting})
    return {
        "quarantine": f"{counted(len(result['quarantine']), 'recording')} in quarantine" if result["quarantine"] else None,
        "effect": ", ".join(effects) or None,
        "outlier": counted(len(result["outliers"]), "outlier") if result["outliers"] else None,
        "change": f"{counted(len(result['changes']), 'difference')} to {result['other_version']}" if result["changes"] else None,
        "rmse": max((one["median_rmse_Nm"] for one in result["vehicles"] if one["median_rmse_Nm"] is not None), default=None),
    }
