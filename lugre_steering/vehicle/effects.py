# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Effects of the catalogue in a vehicle file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial

from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import LugreSteeringError
from lugre_steering.schema import Reader, suggestion
from lugre_steering.vehicle.sections import EffectEntry, Vehicle

OF_CYLINDERS = frozenset({"arm", "line"})
"""Hooks that nothing reads where the torque itself is measured."""


def add_effect(
    vehicle: Vehicle, added: EffectEntry, fail: Callable[[str, object, str], LugreSteeringError]
) -> Vehicle:
    """The vehicle with one more effect, checked against the catalogue; ``fail`` makes errors of key, value, expectation.

    An effect stands once; one that acts per line may be given line by line.
    """
    effect = CATALOGUE.get(added.id)
    if effect is None:
        raise fail("id", added.id, f"an effect of the catalogue; {suggestion(added.id, list(CATALOGUE))}")
    if not effect.observable:
        raise fail("id", added.id, f"an effect that the standard topics can show; this one needs {effect.not_recorded}")
    if effect.stage == "thermal" and vehicle.rubber is None:
        raise fail("id", added.id, "a vehicle with the section 'rubber' for a thermal effect")
    if OF_CYLINDERS & effect.hooks.keys() and vehicle.hydraulics is None:
        raise fail("id", added.id, "a vehicle with the section 'hydraulics', whose cylinders have arms and lines")
    before = next((entry for entry in vehicle.effects if entry.id == added.id), None)
    ranges = {p.name: (p.low, p.high) for p in effect.parameters}
    if effect.per_line:
        ranges = dict.fromkeys(vehicle.hydraulics.lines if vehicle.hydraulics else (), next(iter(ranges.values())))
    if before is not None and (not effect.per_line or before.parameters.keys() & added.parameters.keys()):
        raise fail("id", added.id, f"each effect{' and line' if effect.per_line else ''} once")
    for name, value in added.parameters.items():
        if name not in ranges:
            what = "line" if effect.per_line else "parameter"
            raise fail(f"parameters.{name}", value, f"no such {what}; {suggestion(name, list(ranges))}")
        low, high = ranges[name]
        # Fits work on scaled numbers, so a value at its bound comes back with a rounding error.
        if not math.isclose(value, min(max(value, low), high), rel_tol=1e-9):
            raise fail(f"parameters.{name}", value, f"a number from {low:g} to {high:g}")
    # What may not be zero has no neutral value, so it cannot be left out.
    missing = [key for key, (low, high) in ranges.items() if key not in added.parameters and not low <= 0.0 <= high]
    if missing or not added.parameters:
        raise fail("parameters", added.parameters, f"values of {', '.join(missing or ranges) or 'a pressure line'}")
    for low_key, high_key in effect.places:
        low, high = added.parameters.get(low_key, 0.0), added.parameters.get(high_key, 0.0)
        if (low, high) != (0.0, 0.0) and not low < high:
            raise fail(f"parameters.{high_key}", added.parameters.get(high_key), f"more than {low_key} ({low:g}), both of a window given")
    if before is None:
        return vehicle.replace(effects=(*vehicle.effects, added))
    joined = EffectEntry(added.id, {**before.parameters, **added.parameters})
    return vehicle.replace(effects=tuple(joined if entry is before else entry for entry in vehicle.effects))


def with_effects(vehicle: Vehicle, reader: Reader) -> Vehicle:
    """The vehicle with its effects checked, each standing once."""
    checked = vehicle.replace(effects=())
    for i, entry in enumerate(vehicle.effects):
        checked = add_effect(checked, entry, partial(_fail_in, reader, f"effects[{i}]"))
    return checked


def _fail_in(reader: Reader, section: str, key: str, value: object, expected: str) -> LugreSteeringError:
    return reader.fail(f"{section}.{key}", value, expected)


def each_once(effects: Iterable[EffectEntry]) -> tuple[EffectEntry, ...]:
    """Effects found again stand once, as a file must have them: later values replace earlier ones, other lines join."""
    joined: dict[str, dict[str, float]] = {}
    for entry in effects:
        joined.setdefault(entry.id, {}).update(entry.parameters)
    return tuple(EffectEntry(name, values) for name, values in joined.items())
