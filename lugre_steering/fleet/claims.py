# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the records of a fleet claim together: names, joint evidence, since when, trends; all on one budget of false discoveries.

Effects are estimated one at a time, so physics that is there shows in its rivals too: of the effects of one vehicle the strongest
leads, the others are said to fit as well.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, Literal

import numpy as np

from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fleet.statistics import Combined, budgeted, change, combined, outliers, trend
from lugre_steering.fleet.work import Record
from lugre_steering.recording import Array

BUDGET = 0.05
"""Share of false ones among all that is claimed."""
_NO_VALUE: Mapping[str, Any] = {"value": None, "ci95": (None, None), "unit": ""}
LEAST_JOINT = 3
"""Recordings that joint evidence takes."""
DAY_S = 86_400.0

Kind = Literal["recording", "joint", "since", "trend over time", "trend over air temperature"]


@dataclass(frozen=True)
class Claim:
    """One statement that may be false: about ``effect`` (or 'rmse', 'bias') of a vehicle, or of one of its bags.

    ``value`` with its 95 % interval and standard error in ``unit``; ``since``: date (ISO) of the recording, or of the first one
    after a change; ``leads``: the strongest of the effects that its vehicle shows jointly; ``named_in``: how many of ``recordings``
    have a diagnosis of their own that names the effect; ``rivals``: names that such a diagnosis cannot tell it from, comma between.
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

    @property
    def stands(self) -> bool:
        """Whether the budget allows it."""
        return self.q_value <= BUDGET


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


def claims(records: Sequence[Record], seed: int = 1) -> list[Claim]:
    """Everything that is claimed of a fleet, with q-values, the surest first. What was looked for in vain counts too."""
    found: list[Claim] = []
    tried = 0
    for vehicle, rows in by_vehicle(records).items():
        named = [claim for record in rows for claim in _named(vehicle, record)]
        tried += sum(len(CATALOGUE) for record in rows if record["verdict"] is not None) - len(named)
        joint = list(_joint(vehicle, rows))
        found += [*named, *joint, *_since(vehicle, rows, seed), *_trends(vehicle, rows)]
    p = [*(claim.p_value for claim in found), *[1.0] * max(tried, 0)]
    q = budgeted(p, _weights([claim.kind == "recording" for claim in found] + [True] * max(tried, 0)))[: len(found)]
    judged = [replace(claim, q_value=float(value)) for claim, value in zip(found, q, strict=True)]
    return sorted(_with_leaders(judged), key=lambda claim: (claim.q_value, claim.p_value, claim.vehicle, claim.effect, claim.kind))


def _weights(single: Sequence[bool]) -> Array:
    """Half of the budget for what single recordings claim, of which there are many, half for what all together do."""
    of_one = np.array(single, np.bool_)
    counts = of_one.sum(), (~of_one).sum()
    if not all(counts):
        return np.ones(of_one.size)
    return np.asarray(0.5 * of_one.size / np.where(of_one, *counts), np.float64)


def _named(vehicle: str, record: Record) -> Iterator[Claim]:
    """What the diagnosis of one recording names."""
    for effect in record["effects"]:
        name, fitted = next(iter(effect["parameters"].items()), ("", _NO_VALUE))
        low, high = fitted["ci95"]
        yield Claim(
            "recording", vehicle, record["bag"], effect["id"], name, fitted["value"], low, high, fitted["unit"], effect["p_value"],
            named_in=1, since=record["recorded"], rivals=", ".join(effect["indistinguishable_from"]),
        )  # fmt: skip


Estimates = Mapping[tuple[str, int], list[tuple[Record, Mapping[str, Any]]]]


def _estimates(rows: Sequence[Record]) -> Estimates:
    """Signed estimates by effect and variant, in order of dates."""
    found: dict[tuple[str, int], list[tuple[Record, Mapping[str, Any]]]] = defaultdict(list)
    for record in rows:
        for one in record["estimates"]:
            found[one["effect"], one["shape"]].append((record, one))
    return found


def _together(pairs: Sequence[tuple[Record, Mapping[str, Any]]]) -> Combined:
    ones = [one for _, one in pairs]
    return combined([one["value"] for one in ones], [one["sd"] for one in ones], ones[0]["sign"])


def _joint(vehicle: str, rows: Sequence[Record]) -> Iterator[Claim]:
    """Per effect its best variant over all recordings, the others counted."""
    shapes: dict[str, list[int]] = defaultdict(list)
    estimates = _estimates(rows)
    for (effect, shape), pairs in estimates.items():
        if len(pairs) >= LEAST_JOINT:
            shapes[effect].append(shape)
    for effect, numbers in shapes.items():
        whole = {shape: _together(estimates[effect, shape]) for shape in numbers}
        best = min(whole, key=lambda shape: whole[shape].p_value)
        pairs, one = estimates[effect, best], whole[best]
        named = sum(any(entry["id"] == effect.partition("[")[0] for entry in record["effects"]) for record, _ in pairs)
        yield Claim(
            "joint", vehicle, "", effect, pairs[0][1]["parameter"], one.value, one.low, one.high, pairs[0][1]["unit"],
            min(1.0, one.p_value * len(numbers)), recordings=len(pairs), named_in=named, error=one.error,
        )  # fmt: skip


def _since(vehicle: str, rows: Sequence[Record], seed: int) -> Iterator[Claim]:
    """Per effect the largest step over the dates, of its first variant: a date needs no best shape."""
    for (effect, shape), pairs in _estimates(rows).items():
        if shape:
            continue
        step = change([one["value"] for _, one in pairs], [one["sd"] for _, one in pairs], seed)
        if step is not None:
            one = pairs[0][1]
            yield Claim(
                "since", vehicle, "", effect, one["parameter"], step.after - step.before, None, None, one["unit"], step.p_value,
                recordings=len(pairs), since=pairs[step.first][0]["recorded"],
            )  # fmt: skip


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
    best: dict[str, Claim] = {}
    for claim in found:
        if claim.kind == "joint" and claim.stands and claim.p_value < best.get(claim.vehicle, replace(claim, p_value=2.0)).p_value:
            best[claim.vehicle] = claim
    return [replace(claim, leads=claim is best.get(claim.vehicle)) for claim in found]


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
