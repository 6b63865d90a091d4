# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Entries of a vehicle file that a recording can speak of, and what each may be by mistake: levels of the model, sizes of cylinders, and
what two cylinders, or two lines, may have exchanged."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

from lugre_steering.fitting.problem import FRICTION, GAIN, STATIC, STIFFNESS, STRIBECK, SheetValue
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.loads import vertical_load
from lugre_steering.vehicle.sections import Cylinder, Hydraulics

WIDE, FARTHEST = 1.0, 2.6
"""Standard deviation and bound of the logarithm of an entry under suspicion: a factor of e, up to 13."""
FARTHEST_UNIT = 4.5
"""Bound where units may be mixed up: rad and deg, by 57, or revolutions per minute and deg/s, by 6."""
STARTS = (math.log(6.0), math.log(180.0 / math.pi))
"""Logarithms from which such an entry is fitted, up and down: between them it changes nothing."""
FARTHEST_TERM = 0.5
"""Bound of an entry of either sign, in sliding friction."""
LOAD = SheetValue("load", ("static_torque", "coulomb_torque", "aligning_torque"), WIDE, -FARTHEST, FARTHEST)
LEVEL = replace(FRICTION, prior=WIDE, low=-FARTHEST, high=FARTHEST)
PRESSURES = replace(GAIN, prior=WIDE, low=-FARTHEST, high=FARTHEST)
STIFF = replace(STIFFNESS, prior=WIDE, low=-FARTHEST_UNIT, high=FARTHEST_UNIT)
STICKING = replace(STATIC, prior=WIDE, low=-0.7, high=FARTHEST)
SLOWING = replace(STRIBECK, prior=WIDE, low=-FARTHEST_UNIT, high=FARTHEST_UNIT)
CONSERVATIVE = SheetValue("conservative", ("aligning_torque",), WIDE, -FARTHEST_TERM, FARTHEST_TERM, additive=True)
"""What an entry of the sheet that is wrong changes, as far as it may."""
Cylinders = Mapping[str, Cylinder]
Resized = Callable[[float], Cylinders]
"""Cylinders by name with a size of theirs times a factor."""


@dataclass(frozen=True)
class Level:
    """An entry of the model: with which value it is fitted, in place of that of the same name, from where, and which factor a fitted
    value stands for."""

    key: str
    value: SheetValue
    factor: Callable[[float], float]
    starts: tuple[float, ...] = (0.0,)


def levels(vehicle: Vehicle, sheet: Mapping[str, float]) -> Iterator[Level]:
    """Every level that a vehicle file has; ``sheet``: what it makes of the fields of the model."""
    section = "friction" if vehicle.friction is not None else "contact"
    coulomb, static, conservative = (sheet[name] for name in ("coulomb_torque", "static_torque", "aligning_torque"))
    yield Level(f"{section}.coulomb" + ("" if vehicle.friction is not None else "_torque_Nm"), LEVEL, math.exp)
    units = (0.0, *STARTS, *(-start for start in STARTS))
    yield Level(f"{section}.stiffness_Nm_per_deg", STIFF, math.exp)
    yield Level(f"{section}.stribeck_speed_deg_s", SLOWING, math.exp, units)
    yield Level(
        f"{section}.static" + ("" if vehicle.friction is not None else "_torque_Nm"), STICKING, lambda x: 1.0 + x * coulomb / static,
    )  # fmt: skip
    if conservative:
        key = "gravity.sin_Nm" if vehicle.axle is None else "axle.kingpin_lever_arm_m"
        yield Level(key, CONSERVATIVE, lambda x: 1.0 + x * coulomb / conservative)
    if vehicle.axle is not None and vehicle.track is not None:
        share = vertical_load(vehicle.axle, vehicle.track) / (0.5 * vehicle.axle.load_N)  # the tracks' own weight is no load
        yield Level("axle.load_N", LOAD, lambda x: max((math.exp(x) - 1.0) * share + 1.0, 1e-3))
    if vehicle.hydraulics is not None:  # a torque goes with the square of a bore
        yield Level("bores of all cylinders, or unit of the pressures", PRESSURES, lambda x: math.exp(0.5 * x))
    else:
        yield Level("unit of the measured torque", PRESSURES, math.exp)


def sizes(hydraulics: Hydraulics) -> Iterator[tuple[str, Resized]]:
    """Sizes of single cylinders, and of those of one circuit, by key; a pivot as a whole, and its coordinates."""
    for name, cylinder in hydraulics.cylinders.items():
        key, alone = f"hydraulics.cylinders.{name}", {name: cylinder}
        yield f"{key}.bore_m", partial(resized, alone, bore)
        yield f"{key}.bore_m and .rod_m", partial(resized, alone, _both)
        yield f"{key}.rod_m", partial(resized, alone, _rod)
        yield f"{key}.knuckle_m", partial(resized, alone, knuckle)
        for pivot in ("knuckle_m", "chassis_m"):
            for axis, letter in enumerate("xy"):
                yield f"{key}.{pivot} ({letter})", partial(resized, alone, partial(_coordinate, pivot=pivot, axis=axis))
    for names in circuits(hydraulics):
        key = "hydraulics.cylinders." + " and ".join(f"{name}.bore_m" for name in names)
        yield key, partial(resized, {name: hydraulics.cylinders[name] for name in names}, bore)


def exchanges(hydraulics: Hydraulics) -> Iterator[tuple[str, dict[str, Cylinder]]]:
    """What may be exchanged: the lines of a cylinder or a circuit; sizes, or pivots, of two cylinders of a side, or of both sides."""
    cylinders = hydraulics.cylinders
    for names in (*((name,) for name in cylinders), *circuits(hydraulics)):
        turned = {name: replace(cylinders[name], cap=cylinders[name].rod, rod=cylinders[name].cap) for name in names}
        yield f"hydraulics.cylinders.{' and '.join(names)}.cap and .rod exchanged", turned
    sides = {side: [name for name, c in cylinders.items() if c.side == side] for side in dict.fromkeys(c.side for c in cylinders.values())}
    pairs = {side: list(combinations(names, 2)) for side, names in sides.items()}
    groups = [[pair] for of_side in pairs.values() for pair in of_side]
    if len(pairs) > 1:
        groups += [list(both) for both in zip(*pairs.values(), strict=False)]
    for fields, what in ((("bore_m", "rod_m"), "bore_m and .rod_m"), (("chassis_m", "knuckle_m"), "chassis_m and .knuckle_m")):
        for group in groups:
            exchanged: dict[str, Cylinder] = {}
            for one, other in group:
                for name, source in ((one, cylinders[other]), (other, cylinders[one])):
                    exchanged[name] = replace(cylinders[name], **{field: getattr(source, field) for field in fields})
            if any(exchanged[name] != cylinders[name] for name in exchanged):
                said = ", ".join(f"{one} and {other}" for one, other in group)
                yield f"hydraulics.cylinders: {what} of {said} exchanged", exchanged


def circuits(hydraulics: Hydraulics) -> list[tuple[str, ...]]:
    """Several cylinders, but not all, that lines connect: their bores are read off one drawing."""
    groups: list[tuple[set[str], set[str]]] = []
    for name, cylinder in hydraulics.cylinders.items():
        names, lines = {name}, {line for line in (cylinder.cap, cylinder.rod) if line}
        for group in [group for group in groups if group[1] & lines]:
            groups.remove(group)
            names, lines = names | group[0], lines | group[1]
        groups.append((names, lines))
    ordered = [tuple(name for name in hydraulics.cylinders if name in names) for names, _ in groups]
    return [names for names in ordered if 1 < len(names) < len(hydraulics.cylinders)]


def resized(cylinders: Cylinders, scale: Callable[[Cylinder, float], Cylinder], factor: float) -> dict[str, Cylinder]:
    """These cylinders with a size times a factor."""
    return {name: scale(cylinder, factor) for name, cylinder in cylinders.items()}


def bore(cylinder: Cylinder, factor: float) -> Cylinder:
    """With another bore; the rod fits into it."""
    wider = cylinder.bore_m * factor
    return replace(cylinder, bore_m=wider, rod_m=min(cylinder.rod_m, 0.95 * wider))


def _both(cylinder: Cylinder, factor: float) -> Cylinder:
    return replace(cylinder, bore_m=factor * cylinder.bore_m, rod_m=factor * cylinder.rod_m)


def _rod(cylinder: Cylinder, factor: float) -> Cylinder:
    return replace(cylinder, rod_m=min(factor * cylinder.rod_m, 0.95 * cylinder.bore_m))


def knuckle(cylinder: Cylinder, factor: float) -> Cylinder:
    """With its knuckle pivot farther from the hinge."""
    return replace(cylinder, knuckle_m=tuple(factor * value for value in cylinder.knuckle_m))


def _coordinate(cylinder: Cylinder, factor: float, *, pivot: str, axis: int) -> Cylinder:
    place: Sequence[float] = getattr(cylinder, pivot)
    moved = tuple(factor * value if i == axis else value for i, value in enumerate(place))
    return replace(cylinder, knuckle_m=moved) if pivot == "knuckle_m" else replace(cylinder, chassis_m=moved)
