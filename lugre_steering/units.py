# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Units and words in the generalised coordinate and force of a vehicle: a linear axis counts 1 m as 1 rad, 1 N as 1 N m.

The rest of the program computes and writes for a steered track; here alone that is put into the words of a linear axis.
"""

from __future__ import annotations

import math
import re
from typing import Any

from lugre_steering.effects.entry import Effect
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.serialise import mapped
from lugre_steering.vehicle import Vehicle

_MASS = {("m", "N"): "kg"}
"""Unit of force over acceleration where it has a name of its own; kg m2 for joints."""

COORDINATE_UNITS = {
    "steering angle": "rad", "|steering angle|": "rad", "steering rate": "rad/s", "steering acceleration": "rad/s2",
    "angle since reversal": "rad", "accumulated slip": "rad", "dwell": "s", "direction": "1", "time": "s",
    "torque": "N m", "torque rate": "N m/s", "pressure sum": "Pa", "rubber temperature": "degC",
}  # fmt: skip
"""Axes along which residuals are drawn and effects told, with the units of a steered track."""

_PROSE = frozenset({"statement", "headline", "description", "formula", "manoeuvre", "why", "coordinate", "unit"})
"""Keys of the diagnosis that hold words; names, topics and bags are left as they are."""


def is_linear(vehicle: Vehicle) -> bool:
    """Whether the vehicle file labels its coordinate and force other than as an angle and a torque."""
    return (vehicle.coordinate.unit, vehicle.coordinate.force_unit) != ("rad", "N m")


def label(vehicle: Vehicle, unit: str) -> str:
    """A catalogue unit as this vehicle's reports must write it: for a linear axis 'N m s/rad' -> 'N s/m'.

    Replaces the torque 'N m' and the angle 'rad' by the force and coordinate unit of ``vehicle.coordinate``; everything
    else (s, 1, W, K, Pa) stays.
    """
    coordinate, force = vehicle.coordinate.unit, vehicle.coordinate.force_unit
    if not is_linear(vehicle):
        return unit
    if unit == "kg m2":
        return _MASS.get((coordinate, force), f"{force} s2/{coordinate}")
    text = re.sub(r"\(N m\)|\bN m\b", force, unit)
    # Keys of the vehicle file that count degrees hold 0.01745 m each.
    text = re.sub(r"/deg\b", f" per 0.01745 {coordinate}", re.sub(r"\bdeg/s\b", f"0.01745 {coordinate}/s", text))
    return re.sub(r"\brad(?=\b|\d)", coordinate, text)


def distance(vehicle: Vehicle, value: float, degrees: str = ".3g") -> str:
    """A stretch of the coordinate in words: '3.1 deg' (in the format ``degrees``), '0.0012 m'."""
    if is_linear(vehicle):
        return f"{value:.3g} {vehicle.coordinate.unit}"
    return f"{math.degrees(value):{degrees}} deg"


def words(vehicle: Vehicle, text: str) -> str:
    """Prose in the words of a linear axis: 'steering rate' of one called position becomes 'position rate', torque force,
    'angle since reversal' travel, units as in ``label``. Topics and keys (measured_torque) stay, and so does what was
    translated before."""
    if not is_linear(vehicle):
        return text
    own, name = re.escape(vehicle.coordinate.name), vehicle.coordinate.name.replace("\\", r"\\")
    for pattern, word in (
        (r"\bangle(?= since)", "travel"), (r"\bsteering axis", "axis"), (r"\bsteering(?= rate| acceleration)", name),
        (rf"(?<![\w/.-])(?:{own}|(?:steering )?angle)(?![\w/-])", name), (r"\bAngle\b", name.capitalize()),
        (r"(?<![\w/.-])torque(?![\w/-])", "force"), (r"\bTorque\b", "Force"),
        (r"\bturn(?=s?\b)", "move"), (r"\bturned\b", "moved"), (r" ?\bof one track( about its hinge)?", ""),
    ):  # fmt: skip
        text = re.sub(pattern, word, text)
    return label(vehicle, text)


def law(vehicle: Vehicle, text: str) -> str:
    """An equation in the symbols of a linear axis: theta, omega, alpha and M become q, q', q'' and F."""
    if not is_linear(vehicle):
        return text
    for pattern, symbol in (
        (r"(?<![A-Za-z])(d?)theta(?=_m\b|\b)", r"\1q"), (r"\bomega\b", "q'"), (r"\balpha\b", "q''"),
        (r"\b(d?)M(?=[sc]?\b)", r"\1F"),
    ):  # fmt: skip
        text = re.sub(pattern, symbol, text)
    return words(vehicle, text)


def in_words(vehicle: Vehicle, tree: Any) -> Any:
    """A diagnosis with ``words`` in all its prose; its keys and names are those of the contract."""
    return mapped(tree, lambda leaf, key: words(vehicle, leaf) if isinstance(leaf, str) and key in _PROSE else leaf)


def title(vehicle: Vehicle, effect: Effect) -> str:
    """The title of a catalogue entry in words that fit this vehicle: a single joint has no tracks and no kingpin."""
    return effect.title if vehicle.contact is None else effect.joint_title or effect.title


def titles(vehicle: Vehicle) -> list[str]:
    """Those of the effects that stand in a vehicle file."""
    return [title(vehicle, CATALOGUE[effect.id]) for effect in vehicle.effects]
