# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Laws in a vehicle file: checked, and as fields of the parameter record."""

from __future__ import annotations

import numpy as np

from lugre_steering.effects import laws
from lugre_steering.recording import Array
from lugre_steering.schema import Reader, suggestion
from lugre_steering.vehicle.sections import LawEntry, Vehicle

MOST_LAWS = 8
THERMAL = ("rubber_temperature", "air_temperature")


def law_fields(entry: LawEntry) -> dict[str, float | Array]:
    """What the parameter record holds of a law, see ``effects.laws.record``."""
    low, high = entry.range
    f = laws.sampled(entry.form, entry.values, entry.knots, low, high)
    return laws.record(entry.channel, entry.coordinate, entry.memory, entry.memory_size, low, high, f)


def check_laws(vehicle: Vehicle, reader: Reader) -> None:
    """Refuse laws that mean nothing, by file and key."""
    if len(vehicle.laws) > MOST_LAWS:
        raise reader.fail("laws", f"{len(vehicle.laws)} laws", f"at most {MOST_LAWS}")
    for i, entry in enumerate(vehicle.laws):
        _check(vehicle, entry, reader, f"laws[{i}]")


def _check(vehicle: Vehicle, entry: LawEntry, reader: Reader, key: str) -> None:
    forms = (*laws.FORMS, laws.TABLE)
    for name, known in (("channel", laws.CHANNELS), ("coordinate", laws.COORDINATES), ("memory", laws.MEMORIES), ("form", forms)):
        value = getattr(entry, name)
        if value not in known:
            raise reader.fail(f"{key}.{name}", value, suggestion(value, list(known)))
    if entry.coordinate in THERMAL and vehicle.rubber is None:
        raise reader.fail(f"{key}.coordinate", entry.coordinate, "a vehicle with the section 'rubber' for a law of temperature")
    if entry.memory != "none" and not entry.memory_size > 0.0:
        raise reader.fail(f"{key}.memory_size", entry.memory_size, "a number above 0 for a memory")
    if len(entry.range) != 2 or not entry.range[0] < entry.range[1]:
        raise reader.fail(f"{key}.range", list(entry.range), "two ascending numbers: where the coordinate was seen")
    if entry.form == laws.TABLE:
        if len(entry.knots) < 2 or entry.values:
            expected = "at least two values of f, equally spaced over the range, and no 'values'"
            raise reader.fail(f"{key}.knots", list(entry.knots), expected)
        return
    if entry.knots:
        raise reader.fail(f"{key}.knots", list(entry.knots), f"no knots for a law of the form '{entry.form}'")
    names = laws.form_values(entry.form)
    for name, number in entry.values.items():
        if name not in names:
            raise reader.fail(f"{key}.values.{name}", number, f"no such value of '{entry.form}'; {suggestion(name, list(names))}")
        if name in laws.POSITIVE and not number > 0.0:
            raise reader.fail(f"{key}.values.{name}", number, "a number above 0")
    if missing := [name for name in names if name not in entry.values]:
        raise reader.fail(f"{key}.values", entry.values, f"values of {', '.join(missing)}")
    with np.errstate(all="ignore"):
        f = laws.sampled(entry.form, entry.values, (), *entry.range)
    if not np.isfinite(f).all():
        raise reader.fail(f"{key}.values", entry.values, "numbers with which the law is finite over its range")
