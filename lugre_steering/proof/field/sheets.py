# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Wrong sheets: one entry (or one mistake) that no recording can be explained with, and which entries would mend it."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from lugre_steering.proof.field.machine import Machine, draw_machine

Sheet = dict[str, Any]


class Wrong(NamedTuple):
    """A mistaken sheet: what was done, and regular expressions of the entries that a good answer suspects."""

    sheet: Sheet
    what: str
    suspects: tuple[str, ...]


LOAD, BORE, FRICTION = r"load_N|axle\.load", r"bore|rod_m", r"friction\.(static|coulomb)|^friction$"
ARM = r"chassis|knuckle|arm"


def _off(rng: np.random.Generator, low: float, high: float, never: tuple[float, float]) -> float:
    """A factor, even in the logarithm, outside what a recalibration is for."""
    while True:
        factor = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        if not never[0] < factor < never[1]:
            return factor


def _load(sheet: Sheet, rng: np.random.Generator) -> Wrong:
    factor = float(rng.choice([0.1, 10.0])) if rng.random() < 0.5 else _off(rng, 0.1, 10.0, (0.45, 2.2))
    sheet["axle"]["load_N"] = round(sheet["axle"]["load_N"] * factor, 1)
    return Wrong(sheet, f"load x {factor:.2g}", (LOAD,))


def _friction(sheet: Sheet, rng: np.random.Generator) -> Wrong:
    factor = _off(rng, 0.4, 2.0, (0.6, 1.7))
    for key in ("static", "coulomb"):
        sheet["friction"][key] = round(sheet["friction"][key] * factor, 3)
    return Wrong(sheet, f"friction x {factor:.2g}", (FRICTION, LOAD))


def _bore(sheet: Sheet, rng: np.random.Generator) -> Wrong:
    """One pair of cylinders mistyped by a tenth: shared loads then no longer add up, or (one circuit) the friction is a fifth off."""
    factor = float(rng.choice([0.9, 1.1]))
    circuit = str(rng.choice(sorted({name[-1] for name in sheet["hydraulics"]["cylinders"]})))
    for name, cylinder in sheet["hydraulics"]["cylinders"].items():
        if name.endswith(circuit):
            cylinder["bore_m"] = round(cylinder["bore_m"] * factor, 4)
    return Wrong(sheet, f"bores of circuit {circuit} x {factor:g}", (rf"(left|right)_{circuit}\.bore|bores of all",))


def _arm(sheet: Sheet, rng: np.random.Generator) -> Wrong:
    """Every knuckle pivot measured from the wrong place: levers half or twice as long."""
    factor = float(rng.choice([0.5, 2.0]))
    for cylinder in sheet["hydraulics"]["cylinders"].values():
        cylinder["knuckle_m"] = [round(value * factor, 4) for value in cylinder["knuckle_m"]]
    return Wrong(sheet, f"knuckle pivots x {factor:g}", (ARM,))


def _sides(sheet: Sheet, _rng: np.random.Generator) -> Wrong:
    """The joints of both sides exchanged: each angle is taken for the other's."""
    sheet["topics"] = {
        "left": "steering/right/joint_state", "left_joint": "right_track_steer_joint",
        "right": "steering/left/joint_state", "right_joint": "left_track_steer_joint",
    }  # fmt: skip
    return Wrong(sheet, "left and right exchanged", (r"topics\.(left|right)|sides|angles? exchanged",))


def _chambers(sheet: Sheet, _rng: np.random.Generator) -> Wrong:
    """Cap and rod lines of every cylinder exchanged."""
    for cylinder in sheet["hydraulics"]["cylinders"].values():
        cylinder["cap"], cylinder["rod"] = cylinder["rod"], cylinder["cap"]
    return Wrong(sheet, "cap and rod exchanged", (r"\.cap|\.rod$|cap and rod|hydraulics\.lines|chambers",))


def _units(sheet: Sheet, rng: np.random.Generator) -> Wrong:
    """An entry in another unit than its key says."""
    if rng.random() < 0.5:
        sheet["axle"]["load_N"] = round(sheet["axle"]["load_N"] / 9.81, 1)
        return Wrong(sheet, "load in kilograms", (LOAD,))
    for cylinder in sheet["hydraulics"]["cylinders"].values():
        cylinder["bore_m"], cylinder["rod_m"] = round(cylinder["bore_m"] / 2.0, 4), round(cylinder["rod_m"] / 2.0, 4)
    return Wrong(sheet, "bores as radii", (BORE,))


def _vehicle(sheet: Sheet, rng: np.random.Generator) -> Wrong:
    """The axle, tracks and friction of another machine, at least a factor of 2.5 lighter or heavier."""
    while True:
        other: Machine = draw_machine(rng)
        if not 0.4 < other.load_N / sheet["axle"]["load_N"] < 2.5:
            break
    for section, key, value in (
        ("axle", "load_N", other.load_N), ("track", "weight_N", other.track_weight_N), ("track", "hinge_offset_m", other.hinge_offset_m),
        ("track", "width_m", other.width_m), ("axle", "wheelbase_m", other.wheelbase_m),
        ("axle", "kingpin_distance_m", other.kingpin_distance_m),
    ):  # fmt: skip
        sheet[section][key] = value
    return Wrong(sheet, "another vehicle", (r"vehicle|name", LOAD))


ANGLE_ZERO = "angle zero"
MISTAKES: tuple[Callable[[Sheet, np.random.Generator], Wrong], ...] = (
    _load, _friction, _bore, _arm, _sides, _chambers, _units, _vehicle,
)  # fmt: skip
KINDS = len(MISTAKES) + 1


def mistaken(sheet: Sheet, which: int, rng: np.random.Generator) -> Wrong:
    """The sheet with mistake number ``which``; the last one is in the recording: angles with a zero that is off."""
    if which % KINDS == len(MISTAKES):
        return Wrong(sheet, ANGLE_ZERO, (r"angle",))
    return MISTAKES[which % KINDS](copy.deepcopy(sheet), rng)
