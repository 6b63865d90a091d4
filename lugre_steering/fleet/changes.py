# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What two versions of the program say differently of the same recordings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lugre_steering.fleet.work import Record

NOTABLE = 1e-6
"""Relative change of a number below which it is the same."""


@dataclass(frozen=True)
class Difference:
    """One thing about one bag: what it was by ``old_version`` and is by ``new_version``, as text."""

    vehicle: str
    bag: str
    what: str
    before: str
    after: str
    old_version: str
    new_version: str


def differences(records: Sequence[Record], earlier: Mapping[str, Record]) -> list[Difference]:
    """Every difference, in order of vehicles and bags; ``earlier``: records of the other version by their inputs."""
    found = []
    for new in sorted(records, key=lambda record: (record["member"], record["bag"])):
        old = earlier.get(new.get("inputs", ""))
        if old is not None:
            found += [
                Difference(new["member"], new["bag"], what, before, after, old["version"], new["version"])
                for what, before, after in _of(old, new)
            ]
    return found


def _of(old: Record, new: Record) -> Iterator[tuple[str, str, str]]:
    for what in ("quarantine", "verdict"):
        if old[what] != new[what]:
            yield what, old[what] or "-", new[what] or "-"
    for what in ("rmse_Nm", "bias_Nm"):
        before, after = (record["score"][what] if record["score"] else None for record in (old, new))
        if _differ(before, after):
            yield what, _number(before), _number(after)
    before, after = ({effect["id"]: effect for effect in record["effects"]} for record in (old, new))
    for name in sorted({*before, *after}):
        if name not in before or name not in after:
            yield f"effect {name}", _named(before.get(name)), _named(after.get(name))
            continue
        for key, fitted in after[name]["parameters"].items():
            was = before[name]["parameters"].get(key, {"value": None})["value"]
            if _differ(was, fitted["value"]):
                yield f"effect {name}: {key} [{fitted['unit']}]", _number(was), _number(fitted["value"])


def _named(effect: Mapping[str, Any] | None) -> str:
    return "not named" if effect is None else f"named, p {effect['p_value']:.2g}"


def _differ(before: float | None, after: float | None) -> bool:
    if before is None or after is None:
        return before is not after
    return abs(after - before) > NOTABLE * max(abs(before), abs(after))


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.6g}"
