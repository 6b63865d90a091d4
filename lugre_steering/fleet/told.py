# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The claims of a fleet for an engineer: what, on which vehicle, how much of the torque, since when, seen in what, what to do."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass

from lugre_steering import units
from lugre_steering.counted import counted
from lugre_steering.diagnosis.conclude import headline
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fleet.claims import ACTING, MOST_TOGETHER, Claim
from lugre_steering.fleet.result import Fleet
from lugre_steering.report import words
from lugre_steering.vehicle import Vehicle

ALL = "all vehicles"
LOOK = "diagnose it alone for the place where it acts"


@dataclass(frozen=True)
class Told:
    """One effect on ``vehicle``, each thing in words; ``claims``: those that say so, the surest first."""

    vehicle: str
    what: str
    size: str
    since: str
    seen: str
    do: str
    claims: tuple[Claim, ...]


def told(fleet: Fleet) -> list[Told]:
    """What leads or is named, the largest torque first; what only fits as well as that is left out."""
    groups: dict[tuple[str, str], list[Claim]] = {}
    for claim in fleet.claims:
        if claim.kind in ACTING:
            groups.setdefault((claim.vehicle, claim.effect.partition("[")[0]), []).append(claim)
    shown = [group for group in groups.values() if any(claim.leads or claim.kind == "recording" for claim in group)]
    return [_told(fleet, group) for group in sorted(shown, key=lambda group: -(best(group).largest_Nm or 0.0))]


def best(group: Sequence[Claim]) -> Claim:
    """The claim of one effect whose numbers are told: of several recordings together, else the largest of single ones, else joint."""
    order = ("together", "recording", "joint", "fleet")
    return min(group, key=lambda claim: (order.index(claim.kind), -(claim.largest_Nm or 0.0)))


def title(fleet: Fleet, claim: Claim) -> str:
    """What an effect is called on its vehicle, with its line and what it may be as well."""
    vehicle = _sheet(fleet, claim.vehicle)
    names = [claim.effect.partition("[")[0], *(name for name in claim.rivals.split(", ") if name)]
    own, *others = [units.title(vehicle, CATALOGUE[name]) if name in CATALOGUE else name for name in names]
    line = claim.effect[len(names[0]) :].strip("[]").replace("_", " ")
    return own + (f" ({line})" if line else "") + (f", or {' or '.join(map(headline.inside, others))}" if others else "")


def size(fleet: Fleet, claim: Claim) -> str:
    """Its largest torque, and of how much that is."""
    if claim.largest_Nm is None:
        return "-"
    share = f" ({words.percent(claim.largest_share)} of the torque)" if claim.largest_share is not None else ""
    return f"up to {words.torque(_sheet(fleet, claim.vehicle), claim.largest_Nm)}{share}"


def commands(fleet: Fleet) -> dict[str, str]:
    """By vehicle: how to look at it alone, with the recordings that say most."""
    found: dict[str, str] = {}
    for one in told(fleet):
        together = [part for part in fleet.together if part.vehicle == one.vehicle]
        bags = together[0].bags if together else [claim.bag for claim in one.claims if claim.kind == "recording"][:MOST_TOGETHER]
        if bags and one.vehicle not in found:
            (file,) = (vehicle.file for vehicle in fleet.vehicles if vehicle.name == one.vehicle)
            out = f"diagnosis_{one.vehicle.replace('/', '_')}"
            found[one.vehicle] = shlex.join(["lugre-steering", "diagnose", *bags, "--vehicle", file, "--out", out])
    return found


def _sheet(fleet: Fleet, name: str) -> Vehicle:
    """The vehicle of this name; for all of them the first."""
    return next((vehicle for vehicle in fleet.vehicles if vehicle.name == name), fleet.vehicles[0]).vehicle


def _told(fleet: Fleet, group: Sequence[Claim]) -> Told:
    shown, effect = best(group), CATALOGUE.get(group[0].effect.partition("[")[0])
    check = headline.CHECKS.get(effect.stage, LOOK) if effect is not None else LOOK
    return Told(
        shown.vehicle or ALL, title(fleet, shown), size(fleet, shown), _since(fleet, group), _seen(fleet, group), check, tuple(group)
    )


def _since(fleet: Fleet, group: Sequence[Claim]) -> str:
    """The date of a change that stands; else whether it was there from the beginning, else when it was named first."""
    vehicle, effect = group[0].vehicle, group[0].effect
    steps = [claim.since for claim in fleet.claims if (claim.kind, claim.vehicle, claim.effect) == ("since", vehicle, effect)]
    if steps:
        return day(steps[0])
    from_start = [claim for claim in group if claim.kind != "recording"]
    first = min((claim.since for claim in from_start or group if claim.since), default=None)
    return "-" if first is None else f"{day(first)}, the first recording" if from_start else day(first)


def day(date: str | None) -> str:
    """The day of a date (ISO)."""
    return (date or "-")[:10]


def _seen(fleet: Fleet, group: Sequence[Claim]) -> str:
    named = sum(claim.kind == "recording" for claim in group)
    if group[0].vehicle == "":
        return f"all vehicles together, {counted(group[0].recordings, 'recording')}; too weak on each"
    (vehicle,) = (vehicle for vehicle in fleet.vehicles if vehicle.name == group[0].vehicle)
    of_all = f"{named} of {counted(vehicle.recordings, 'recording')}"
    for claim in group:
        if claim.kind == "together":
            return f"{claim.recordings} recordings diagnosed together; alone in {of_all}"
    if named:
        return of_all
    asked = any(part.vehicle == vehicle.name and part.verdict != "failed" for part in fleet.together)
    doubt = "; a diagnosis of some of them together does not name it" if asked else ""
    return f"{counted(group[0].recordings, 'recording')} together, too weak in each{doubt}"
