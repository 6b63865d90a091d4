# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Effects of the catalogue in a vehicle file."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial

from lugre_steering.effects.entry import Effect, Parameter
from lugre_steering.effects.registry import CATALOGUE, ORIGINS
from lugre_steering.errors import LugreSteeringError
from lugre_steering.schema import Reader, suggestion
from lugre_steering.vehicle.sections import EffectEntry, Vehicle
from lugre_steering.vehicle.size import RECALIBRATED, Size, vehicle_size

OF_CYLINDERS = frozenset({"arm", "line"})
"""Hooks that nothing reads where the torque itself is measured."""
_OTHER = {"rad": Size(torque=10.0), "m": Size(torque=10.0, angle=7.0)}
"""Sizes unlike a vehicle's, by the unit of the coordinate: what they change has a size."""

Fail = Callable[[str, object, str], LugreSteeringError]
"""Makes the error of a key, its value and what was expected."""


def add_effect(vehicle: Vehicle, added: EffectEntry, fail: Fail) -> Vehicle:
    """The vehicle with one more effect, checked against the catalogue.

    An effect stands once; one that acts per line may be given line by line.
    """
    effect, added = _of_catalogue(added, fail)
    _check_machine(vehicle, effect, fail)
    before = next((entry for entry in vehicle.effects if entry.id == added.id), None)
    if before is not None and (not effect.per_line or before.parameters.keys() & added.parameters.keys()):
        raise fail("id", added.id, f"each effect{' and line' if effect.per_line else ''} once")
    _check_values(vehicle, effect, added.parameters, fail)
    if before is None:
        return vehicle.replace(effects=(*vehicle.effects, added))
    joined = replace(added, parameters={**before.parameters, **added.parameters})
    return vehicle.replace(effects=tuple(joined if entry is before else entry for entry in vehicle.effects))


def _of_catalogue(added: EffectEntry, fail: Fail) -> tuple[Effect, EffectEntry]:
    """The effect of an entry, and the entry with the source and hash of physics that is not the package's."""
    effect = CATALOGUE.get(added.id)
    if effect is None and added.source is not None:
        what = f"install {added.source}" if added.source.startswith("package ") else f"give the file with --effects {added.source}"
        raise fail("id", added.id, f"physics of {added.source}, which is not here: {what} (sha256 {added.sha256})")
    if effect is None:
        raise fail("id", added.id, f"an effect of the catalogue; {suggestion(added.id, list(CATALOGUE))}")
    origin = ORIGINS.get(added.id)
    if origin is not None and added.sha256 not in (None, origin.sha256, origin.of_file):
        expected = f"that of the laws given now in {origin.source} ({origin.sha256}): they are others under the same name"
        raise fail("sha256", added.sha256, expected)
    return effect, added if origin is None else replace(added, source=origin.source, sha256=origin.sha256)


def _check_machine(vehicle: Vehicle, effect: Effect, fail: Fail) -> None:
    """Whether the vehicle has what the effect acts on."""
    if not effect.observable:
        raise fail("id", effect.id, f"an effect that the standard topics can show; this one needs {effect.not_recorded}")
    if effect.stage == "thermal" and vehicle.rubber is None:
        raise fail("id", effect.id, "a vehicle with the section 'rubber' for a thermal effect")
    if OF_CYLINDERS & effect.hooks.keys() and vehicle.hydraulics is None:
        raise fail("id", effect.id, "a vehicle with the section 'hydraulics', whose cylinders have arms and lines")
    if lacking := [section for section in effect.needs if getattr(vehicle, section) is None]:
        raise fail("id", effect.id, f"a vehicle with the section '{lacking[0]}', without which this effect means nothing")


def _range(vehicle: Vehicle, parameter: Parameter) -> tuple[float, float]:
    """What a value may be. Of what has the size of a machine that is no vehicle only the sign is known beforehand."""
    if vehicle.contact is None:
        ranges = [vehicle_size(vehicle, times).range_of(parameter) for times in (1.0 / RECALIBRATED, RECALIBRATED)]
        return min(low for low, _ in ranges), max(high for _, high in ranges)
    low, high = parameter.low, parameter.high
    if _OTHER[vehicle.coordinate.unit].of(parameter.unit) == 1.0:
        return low, high
    least = -math.inf if low < 0.0 else 0.0 if low == 0.0 else sys.float_info.min
    return least, math.inf if high > 0.0 else 0.0


def _check_values(vehicle: Vehicle, effect: Effect, values: Mapping[str, float], fail: Fail) -> None:
    """Whether parameters, or values by line, are those of the effect, inside their ranges, and all that it needs."""
    ranges = {p.name: _range(vehicle, p) for p in effect.parameters}
    if effect.per_line:
        ranges = dict.fromkeys(vehicle.hydraulics.lines if vehicle.hydraulics else (), next(iter(ranges.values())))
    for name, value in values.items():
        if name not in ranges:
            what = "line" if effect.per_line else "parameter"
            raise fail(f"parameters.{name}", value, f"no such {what}; {suggestion(name, list(ranges))}")
        low, high = ranges[name]
        # Fits work on scaled numbers, so a value at its bound comes back with a rounding error.
        if not math.isclose(value, min(max(value, low), high), rel_tol=1e-9):
            raise fail(f"parameters.{name}", value, f"a number from {low:g} to {high:g}")
    # What may not be zero has no neutral value, so it cannot be left out.
    missing = [key for key, (low, high) in ranges.items() if key not in values and not low <= 0.0 <= high]
    if missing or not values:
        raise fail("parameters", values, f"values of {', '.join(missing or ranges) or 'a pressure line'}")
    for low_key, high_key in effect.places:
        low, high = values.get(low_key, 0.0), values.get(high_key, 0.0)
        if (low, high) != (0.0, 0.0) and not low < high:
            raise fail(f"parameters.{high_key}", values.get(high_key), f"more than {low_key} ({low:g}), both of a window given")


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
    joined: dict[str, EffectEntry] = {}
    for entry in effects:
        before = joined.get(entry.id)
        joined[entry.id] = replace(entry, parameters={**(before.parameters if before else {}), **entry.parameters})
    return tuple(joined.values())
