# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the records of a fleet claim together: names, joint evidence, since when, trends; all on one budget of false discoveries.

Effects are estimated one at a time, so physics that is there shows in its rivals too: of the effects of one vehicle those lead that a
diagnosis of several of its recordings together names, else the one that most of them name alone, else the strongest; the others are
said to fit as well.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any, Literal

import numpy as np

from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fleet.statistics import Combined, budgeted, change, combined, outliers, trend
from lugre_steering.fleet.work import Record
from lugre_steering.recording import Array
from lugre_steering.serialise import ADDED

BUDGET = 0.05
"""Share of false ones among all that is claimed."""
_NO_VALUE: Mapping[str, Any] = {"value": None, "ci95": (None, None), "unit": ""}
LEAST_JOINT = 3
"""Recordings of a vehicle that joint evidence takes, and vehicles for that of all of them."""
MOST_TOGETHER = 5
"""Recordings of a vehicle that are diagnosed as one."""
DAY_S = 86_400.0

Kind = Literal["recording", "together", "joint", "fleet", "since", "trend over time", "trend over air temperature"]
ACTING: tuple[Kind, ...] = ("recording", "together", "joint", "fleet")
"""Kinds that say of an effect that it is there."""


@dataclass(frozen=True)
class Claim:
    """One statement that may be false: about ``effect`` (or 'rmse', 'bias') of a vehicle, of one of its bags, or (kind fleet, without
    a vehicle) of all vehicles.

    ``value`` with its 95 % interval and standard error in ``unit``; ``since``: date (ISO) of the (first) recording, or of the first one
    after a change; ``leads``: see above; ``named_in``: how many of ``recordings`` have a diagnosis of their own that names the effect;
    ``rivals``: names that a diagnosis cannot tell it from, comma between; ``largest_Nm``, ``largest_share``: largest torque that it
    makes [N m], and over the torque's amplitude.
    """

    kind: Kind
    vehicle: str
    bag: str
    effect: str
    parameter: str
    value: float | None
    low: float | None
    high: float | None
    unit: str
    p_value: float
    q_value: float = 1.0
    recordings: int = 1
    named_in: int = 0
    since: str | None = None
    leads: bool = False
    error: float | None = None
    rivals: str = ""
    largest_Nm: float | None = field(default=None, metadata=ADDED)
    largest_share: float | None = field(default=None, metadata=ADDED)

    @property
    def stands(self) -> bool:
        """Whether the budget allows it."""
        return self.q_value <= BUDGET

    @property
    def mostly_named(self) -> bool:
        """Whether most of the recordings name it alone."""
        return 2 * self.named_in >= self.recordings


@dataclass(frozen=True)
class Shared:
    """One effect over several vehicles: ``common`` if all differ no more than their errors, else whose it is."""

    effect: str
    common: bool
    vehicles: tuple[str, ...]
    between: float
    alike_p: float
    unit: str


@dataclass(frozen=True)
class Outlier:
    """A recording whose ``rmse_Nm`` lies far from those of its vehicle, whose ``median_Nm`` is given."""

    vehicle: str
    bag: str
    rmse_Nm: float
    median_Nm: float


def by_vehicle(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Sound records by vehicle, in order of their dates; one of several copies."""
    found: dict[str, dict[str, Record]] = defaultdict(dict)
    for record in sorted(records, key=lambda record: (record["recorded"] or "", record["bag"])):
        if record["quarantine"] is None:
            found[record["member"]].setdefault(record["inputs"], record)
    return {vehicle: list(rows.values()) for vehicle, rows in sorted(found.items())}


def claims(records: Sequence[Record], seed: int = 1, together: Sequence[Record] = ()) -> list[Claim]:
    """Everything that is claimed of a fleet, with q-values, the surest first. What was looked for in vain counts too.

    ``together``: diagnoses of several recordings of one vehicle; as many names count as tried as if every vehicle had been.
    """
    found: list[Claim] = []
    alone = pooled = 0
    every: dict[str, Estimates] = {}
    for vehicle, rows in by_vehicle(records).items():
        estimates = every[vehicle] = _estimates(rows)
        named = [claim for record in rows for claim in _named("recording", vehicle, record)]
        alone += sum(len(CATALOGUE) for record in rows if record["verdict"] is not None) - len(named)
        pooled += len(CATALOGUE) * (len(rows) >= LEAST_JOINT and bool(estimates))
        found += [*named, *_joint(vehicle, rows, estimates), *_since(vehicle, estimates, seed), *_trends(vehicle, rows)]
    found += _everywhere(every)
    found += [claim for record in together for claim in _named("together", record["member"], record)]
    pooled -= sum(claim.kind == "together" for claim in found)
    vain = np.repeat([True, False], np.maximum([alone, pooled], 0))
    p = [*(claim.p_value for claim in found), *np.ones(vain.size)]
    q = budgeted(p, _weights([*(claim.kind == "recording" for claim in found), *vain]))[: len(found)]
    judged = [replace(claim, q_value=float(value)) for claim, value in zip(found, q, strict=True)]
    return sorted(_with_leaders(judged), key=lambda claim: (claim.q_value, claim.p_value, claim.vehicle, claim.effect, claim.kind))


def _weights(single: Sequence[bool]) -> Array:
    """Half of the budget for what single recordings claim, of which there are many, half for what all together do."""
    of_one = np.array(single, np.bool_)
    counts = of_one.sum(), (~of_one).sum()
    if not all(counts):
        return np.ones(of_one.size)
    return np.asarray(0.5 * of_one.size / np.where(of_one, *counts), np.float64)


def _named(kind: Literal["recording", "together"], vehicle: str, record: Record) -> Iterator[Claim]:
    """What the diagnosis of one recording names, or of several together."""
    for effect in record["effects"]:
        name, fitted = next(iter(effect["parameters"].items()), ("", _NO_VALUE))
        low, high = fitted["ci95"]
        yield Claim(
            kind, vehicle, record.get("bag", ""), effect["id"], name, fitted["value"], low, high, fitted["unit"], effect["p_value"],
            recordings=len(record.get("bags", [record])), named_in=int(kind == "recording"), since=record["recorded"],
            rivals=", ".join(effect["indistinguishable_from"]), largest_Nm=effect["largest_Nm"], largest_share=effect["largest_share"],
        )  # fmt: skip


Estimates = Mapping[tuple[str, int], list[tuple[Record, Mapping[str, Any]]]]


def _estimates(rows: Sequence[Record]) -> Estimates:
    """Signed estimates by effect and variant, in order of dates."""
    found: dict[tuple[str, int], list[tuple[Record, Mapping[str, Any]]]] = defaultdict(list)
    for record in rows:
        for one in record["estimates"]:
            found[one["effect"], one["shape"]].append((record, one))
    return found


def _together(ones: Sequence[Mapping[str, Any]]) -> Combined:
    return combined([one["value"] for one in ones], [one["sd"] for one in ones], ones[0]["sign"])


def _with_torque(claim: Claim, ones: Sequence[Mapping[str, Any]]) -> Claim:
    """With the largest torque that so much of an effect makes in any of the recordings."""
    torque, share = (abs(claim.value or 0.0) * max(one[each] for one in ones) for each in ("each_Nm", "each_share"))
    return replace(claim, largest_Nm=torque, largest_share=share)


def _jointly(estimates: Estimates) -> dict[str, dict[int, Combined]]:
    """All recordings of a vehicle as one, by effect and variant."""
    found: dict[str, dict[int, Combined]] = defaultdict(dict)
    for (effect, shape), pairs in estimates.items():
        if len(pairs) >= LEAST_JOINT:
            found[effect][shape] = _together([one for _, one in pairs])
    return found


def _best(shapes: Mapping[int, Combined]) -> tuple[int, Combined, float]:
    """Number of the variant that is surest, what it came to, and its p-value with all variants counted."""
    best = min(shapes, key=lambda shape: shapes[shape].p_value)
    return best, shapes[best], min(1.0, shapes[best].p_value * len(shapes))


def _joint(vehicle: str, rows: Sequence[Record], estimates: Estimates) -> Iterator[Claim]:
    """Per effect its best variant over all recordings of a vehicle."""
    for effect, shapes in _jointly(estimates).items():
        shape, one, p = _best(shapes)
        ones = [each for _, each in estimates[effect, shape]]
        named = sum(any(entry["id"] == effect.partition("[")[0] for entry in record["effects"]) for record, _ in estimates[effect, shape])
        claim = Claim(
            "joint", vehicle, "", effect, ones[0]["parameter"], one.value, one.low, one.high, ones[0]["unit"], p, recordings=len(ones),
            named_in=named, since=rows[0]["recorded"], error=one.error,
        )  # fmt: skip
        yield _with_torque(claim, ones)


def _everywhere(every: Mapping[str, Estimates]) -> Iterator[Claim]:
    """Per effect its best variant over all vehicles, of which each counts once: too weak on each, and alike on all."""
    of: dict[str, dict[int, list[Combined]]] = defaultdict(lambda: defaultdict(list))
    ones: dict[tuple[str, int], list[Mapping[str, Any]]] = defaultdict(list)
    for estimates in every.values():
        for effect, shapes in _jointly(estimates).items():
            for shape, one in shapes.items():
                of[effect][shape].append(one)
                ones[effect, shape] += [each for _, each in estimates[effect, shape]]
    for effect, found in of.items():
        whole = {
            shape: combined(
                [one.value for one in many], [one.error for one in many], ones[effect, shape][0]["sign"],
                float(np.median([one.floor for one in many])),
            )
            for shape, many in found.items() if len(many) >= LEAST_JOINT
        }  # fmt: skip
        if whole:
            shape, one, p = _best(whole)
            part = ones[effect, shape]
            claim = Claim(
                "fleet", "", "", effect, part[0]["parameter"], one.value, one.low, one.high, part[0]["unit"], p, recordings=len(part),
                error=one.error,
            )  # fmt: skip
            yield _with_torque(claim, part)


def _since(vehicle: str, estimates: Estimates, seed: int) -> Iterator[Claim]:
    """Per effect the largest step over the dates, of its first variant: a date needs no best shape."""
    for (effect, shape), pairs in estimates.items():
        if shape:
            continue
        step = change([one["value"] for _, one in pairs], [one["sd"] for _, one in pairs], seed)
        if step is not None:
            ones, size = [one for _, one in pairs], step.after - step.before
            claim = Claim(
                "since", vehicle, "", effect, ones[0]["parameter"], size, None, None, ones[0]["unit"], step.p_value,
                recordings=len(pairs), since=pairs[step.first][0]["recorded"],
            )  # fmt: skip
            yield _with_torque(claim, ones)


def _trends(vehicle: str, rows: Sequence[Record]) -> Iterator[Claim]:
    """Of error and bias of the replay, over dates and air temperatures."""
    scored = [record for record in rows if record["score"] is not None]
    warm = [record for record in scored if record["air_degC"] is not None]
    days = [datetime.fromisoformat(record["recorded"]).timestamp() / DAY_S for record in scored]
    air = [record["air_degC"] for record in warm]
    for quantity in ("rmse_Nm", "bias_Nm"):
        for kind, over, x, part in (("trend over time", "d", days, scored), ("trend over air temperature", "K", air, warm)):
            line = trend(x, [record["score"][quantity] for record in part])
            if line is not None:
                name = quantity.removesuffix("_Nm")
                yield Claim(
                    kind, vehicle, "", name, "", line.slope, None, None, f"N m/{over}", line.p_value, recordings=len(part)  # type: ignore[arg-type]
                )


def _with_leaders(found: Sequence[Claim]) -> list[Claim]:
    named = {claim.vehicle for claim in found if claim.kind == "together" and claim.stands}
    best: dict[str, Claim] = {}
    for claim in found:
        if claim.kind in ("joint", "fleet") and claim.stands and claim.vehicle not in named:
            best[claim.vehicle] = max(best.get(claim.vehicle, claim), claim, key=lambda one: (one.mostly_named, -one.p_value))
    return [
        replace(claim, leads=claim is best.get(claim.vehicle) or (claim.kind == "together" and claim.stands)) for claim in found
    ]


def worth_pooling(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Recordings to be diagnosed together, by vehicle: where all hint jointly at something, and most of them alone do not name the same.

    A diagnosis decides, so they may differ by more than their errors here. Those are taken that say most about it, whatever they say:
    choosing those that show most of it would be no fair trial.
    """
    chosen: dict[str, list[Record]] = {}
    for vehicle, rows in by_vehicle(records).items():
        estimates = _estimates(rows)
        whole = {(effect, shape): one for effect, shapes in _jointly(estimates).items() for shape, one in shapes.items()}
        named = Counter(effect["id"] for record in rows for effect in record["effects"])
        if not whole or 2 * max(named.values(), default=0) >= len(rows):
            continue
        hint = min(whole, key=lambda key: whole[key].hint_p)
        if whole[hint].hint_p * len(whole) <= BUDGET:
            sure = sorted(range(len(estimates[hint])), key=lambda i: estimates[hint][i][1]["sd"])[:MOST_TOGETHER]
            chosen[vehicle] = [estimates[hint][i][0] for i in sorted(sure)]
    return chosen


def shared(records: Sequence[Record], found: Sequence[Claim]) -> list[Shared]:
    """For every effect that stands jointly in some vehicle: whether all vehicles have it alike."""
    rows = by_vehicle(records)
    if len(rows) < 2:
        return []
    result = []
    for effect in sorted({claim.effect for claim in found if claim.kind == "joint" and claim.stands}):
        of = {claim.vehicle: claim for claim in found if claim.kind == "joint" and claim.effect == effect}
        if len(of) < 2:
            continue
        whole = combined([claim.value or 0.0 for claim in of.values()], [claim.error or np.inf for claim in of.values()])
        having = tuple(sorted(vehicle for vehicle, claim in of.items() if claim.stands))
        result.append(Shared(effect, whole.alike_p > BUDGET, having, whole.between, whole.alike_p, next(iter(of.values())).unit))
    return result


def unusual(records: Sequence[Record]) -> list[Outlier]:
    """Recordings that the model explains far worse or better than the others of the same vehicle."""
    result = []
    for vehicle, rows in by_vehicle(records).items():
        scored = [record for record in rows if record["score"] is not None]
        errors = np.array([record["score"]["rmse_Nm"] for record in scored])
        far = outliers(errors)
        result += [
            Outlier(vehicle, record["bag"], record["score"]["rmse_Nm"], float(np.median(errors)))
            for record, is_far in zip(scored, far, strict=True) if is_far
        ]  # fmt: skip
    return result
