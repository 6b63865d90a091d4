# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The claims of a fleet for an engineer: what, on which vehicle, how much of the torque, since when, seen in what, what to do."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from lugre_steering import units
from lugre_steering.counted import counted
from lugre_steering.diagnosis.conclude import headline
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fleet.claims import ACTING, MOST_TOGETHER, Claim
from lugre_steering.fleet.result import Fleet
from lugre_steering.report import words
from lugre_steering.vehicle import Vehicle

ALL = "all vehicles"
MOST_RIVALS = 2
"""Other names told in one breath."""
LOOK = "diagnose this vehicle for the place where it acts (command: 'Look closer' in the report)"


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
    """What leads or is named, the largest torque first; what only fits as well as that, or is another name of it, is told with it."""
    of: dict[str, dict[str, list[Claim]]] = {}
    for claim in fleet.claims:
        if claim.kind in ACTING:
            of.setdefault(claim.vehicle, {}).setdefault(_id(claim), []).append(claim)
    findings = [group for effects in of.values() for group in _findings(effects)]
    return [_told(fleet, group) for group in sorted(findings, key=lambda group: -(best(group).largest_Nm or 0.0))]


def _findings(effects: Mapping[str, list[Claim]]) -> list[list[Claim]]:
    """Claims about one vehicle, by effect, as findings: names that cannot be told apart are one, the surest first."""
    shown = [group for group in effects.values() if any(claim.leads or claim.kind == "recording" for claim in group)]
    found: list[list[Claim]] = []
    for group in sorted(shown, key=lambda group: (not any(c.leads for c in group), -len(group))):
        same = next((earlier for earlier in found if _alike(earlier, group)), None)
        if same is None:
            found.append(list(group))
        else:
            same += group
    return found


def _alike(one: Sequence[Claim], other: Sequence[Claim]) -> bool:
    """Whether two groups may be one thing: their names are rivals, or both fit jointly; and no diagnosis names both."""
    names, also = ({name for claim in group for name in (_id(claim), *_rivals(claim))} for group in (one, other))
    by, also_by = ({(c.kind, c.bag) for c in group if c.kind in ("recording", "together")} for group in (one, other))
    jointly = all(any(claim.kind in ("joint", "fleet") for claim in group) for group in (one, other))
    return not by & also_by and bool(jointly or names & also)


def _id(claim: Claim) -> str:
    return claim.effect.partition("[")[0]


def _rivals(claim: Claim) -> list[str]:
    return [name for name in claim.rivals.split(", ") if name]


def best(group: Sequence[Claim]) -> Claim:
    """The claim whose numbers are told: of a diagnosis of several recordings, else the largest of single ones that name what leads, else
    joint."""
    order = ("together", "recording", "joint", "fleet")
    return min(group, key=lambda claim: (order.index(claim.kind), _id(claim) != _id(group[0]), -(claim.largest_Nm or 0.0)))


def title(fleet: Fleet, claim: Claim, others: Iterable[str] = ()) -> str:
    """What an effect is called on its vehicle, with its line and what it may be as well: its rivals and ``others``."""
    vehicle = _sheet(fleet, claim.vehicle)
    names = list(dict.fromkeys([_id(claim), *_rivals(claim), *others]))
    own, *rest = [units.title(vehicle, CATALOGUE[name]) if name in CATALOGUE else name for name in names]
    line = claim.effect[len(names[0]) :].strip("[]").replace("_", " ")
    more = [f"{len(rest) - MOST_RIVALS} more"] if len(rest) > MOST_RIVALS + 1 else []
    rest = [headline.inside(name) for name in rest[: MOST_RIVALS if more else None]]
    return own + (f" ({line})" if line else "") + "".join(f", or {name}" for name in [*rest, *more])


def size(fleet: Fleet, claim: Claim) -> str:
    """Its largest torque, and of how much that is."""
    if claim.largest_Nm is None:
        return "-"
    share = f" ({words.percent(claim.largest_share)} of the torque)" if claim.largest_share is not None else ""
    return f"up to {words.torque(_sheet(fleet, claim.vehicle), claim.largest_Nm)}{share}"


def commands(fleet: Fleet) -> dict[str, str]:
    """By vehicle: how to look at it alone, with the recordings that say most, in turn of each of its findings."""
    naming: dict[str, list[list[str]]] = {}
    for one in told(fleet):
        naming.setdefault(one.vehicle, []).append([claim.bag for claim in one.claims if claim.kind == "recording"])
    asked = {part.vehicle: part.bags for part in fleet.together}
    found: dict[str, str] = {}
    for name, file in ((vehicle.name, vehicle.file) for vehicle in fleet.vehicles if vehicle.name in naming):
        in_turn = dict.fromkeys(bag for bags in zip_longest(*naming[name]) for bag in bags if bag is not None)
        if bags := asked.get(name) or list(in_turn)[:MOST_TOGETHER]:
            found[name] = shlex.join(["lugre-steering", "diagnose", *bags, "--vehicle", file, "--out", folder_of(name)])
    return found


def folder_of(vehicle: str) -> str:
    """A folder for the diagnosis of a vehicle, whatever it is called, that a shell takes without quotes."""
    return re.sub(r"\W+", "_", f"diagnosis {vehicle}").strip("_")


def _sheet(fleet: Fleet, name: str) -> Vehicle:
    """The vehicle of this name; for all of them the first."""
    return next((vehicle for vehicle in fleet.vehicles if vehicle.name == name), fleet.vehicles[0]).vehicle


def _told(fleet: Fleet, group: Sequence[Claim]) -> Told:
    shown = best(group)
    effect = CATALOGUE.get(_id(shown))
    check = headline.CHECKS.get(effect.stage, LOOK) if effect is not None else LOOK
    what = title(fleet, shown, map(_id, group))
    return Told(shown.vehicle or ALL, what, size(fleet, shown), _since(fleet, group), _seen(fleet, group), check, tuple(group))


def _since(fleet: Fleet, group: Sequence[Claim]) -> str:
    """The date of a change that stands; else whether it was there from the beginning, else when it was named first."""
    about = {(claim.vehicle, claim.effect) for claim in group}
    steps = [claim.since for claim in fleet.claims if claim.kind == "since" and (claim.vehicle, claim.effect) in about]
    if steps:
        return day(steps[0])
    from_start = [claim for claim in group if claim.kind != "recording"]
    first = min((claim.since for claim in from_start or group if claim.since), default=None)
    return "-" if first is None else f"{day(first)}, the first recording" if from_start else day(first)


def day(date: str | None) -> str:
    """The day of a date (ISO)."""
    return (date or "-")[:10]


def _seen(fleet: Fleet, group: Sequence[Claim]) -> str:
    """In which recordings, alone and together, and what a diagnosis of several says that does not name it."""
    if group[0].vehicle == "":
        return f"all vehicles together ({counted(group[0].recordings, 'recording')}), too weak on each"
    (vehicle,) = (vehicle for vehicle in fleet.vehicles if vehicle.name == group[0].vehicle)
    alone = f"{len({claim.bag for claim in group if claim.kind == 'recording'})} of {counted(vehicle.recordings, 'recording')} alone"
    joint = [claim for claim in group if claim.kind in ("together", "joint")]
    if not joint:
        return alone
    diagnosed = [claim for claim in joint if claim.kind == "together"]
    if diagnosed:
        return f"{diagnosed[0].recordings} recordings diagnosed together, {alone}"
    asked = [part for part in fleet.together if part.vehicle == vehicle.name and part.verdict != "failed"]
    doubt = f"; a diagnosis of {len(asked[0].bags)} of them together does not name it" if asked else ""
    return f"{counted(joint[0].recordings, 'recording')} together, {alone}{doubt}"
