# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A law as people read and write it: in a vehicle file, or under a name of its own in a file of effects."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lugre_steering.effects import laws
from lugre_steering.effects.entry import Effect
from lugre_steering.recording import Array
from lugre_steering.schema import Reader, quantity, suggestion

NARROWEST, WIDEST = 1e-12, 1e12
"""How far apart the ends of a range may be, in any unit."""
SHORTEST_S = 1e-3
"""Period of a mode that a chain of such steps could follow."""
FEWEST_PLACES = 3
"""Places of a law in a period: with fewer it would be another one."""
SHARES = ("friction_level", "presliding_stiffness", "gain")
"""Channels of which -1 takes all that is there."""
FED_BACK = (("conservative_torque", "coulomb_friction"), ("torque", "abs_torque", "opposing_torque"))
"""Channels and coordinates by which a law is driven by what it adds itself."""


@dataclass(frozen=True)
class LawEntry:
    """A law that no entry of the catalogue is: channel x f(coordinate); numbers in SI units."""

    channel: str
    """What the law changes."""
    coordinate: str
    """What it is a function of."""
    form: str
    """Closed form of ``values``, or a table of ``knots``."""
    range: tuple[float, ...]
    """Where the coordinate was seen; beyond, f is held, a line, a hinge or a sinusoid from half the range further on."""
    values: dict[str, float] = field(default_factory=dict)
    """Values of the closed form, by name."""
    knots: tuple[float, ...] = ()
    """Values of f, equally spaced over the range."""
    memory: str = "none"
    """What stands between the coordinate and f."""
    memory_size: float = quantity(0.0, 1e12, default=0.0)
    """Of a lag or of what rings (its period): seconds; of a play or relay: half its width in the unit of the coordinate."""
    title: str | None = None
    """What the law says of itself."""
    intervals: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """95 % intervals of ``values``."""
    heldout_gain: float | None = None
    """Share of the missing energy that it foretold on held-out data."""
    small: bool = False
    """Whether f is small by what it is, so that leaving the range is no news."""


def law_fields(entry: LawEntry) -> dict[str, float | Array]:
    """What the parameter record holds of a law, see ``laws.record``."""
    low, high = entry.range
    span = laws.reach(entry.form, entry.values, low, high)
    f = laws.sampled(entry.form, entry.values, entry.knots, *span)
    seen = (-math.inf, math.inf) if entry.small else (low, high)
    return laws.record(entry.channel, entry.coordinate, entry.memory, entry.memory_size, span, f, seen=seen)


STAGE_OF: Mapping[str, str] = {
    "friction_level": "contact", "presliding_stiffness": "contact", "conservative_torque": "parallel_torque", "inertia": "parallel_torque",
    "linked_inertia": "parallel_torque",
}  # fmt: skip
"""Where in the chain a channel belongs; all others with losses and sensors."""
TOLD_BY = {
    "angle": "steering angle", "abs_angle": "|steering angle|", "rate": "steering rate", "abs_rate": "steering rate",
    "direction": "direction", "since_reversal": "angle since reversal", "torque": "torque", "abs_torque": "torque", "time": "time",
    "slip": "accumulated slip", "dwell": "dwell", "rubber_temperature": "rubber temperature", "opposing_torque": "torque",
}  # fmt: skip


THERMAL = ("rubber_temperature", "air_temperature")
"""Coordinates that only a vehicle with rubber has."""


def named(identity: str, title: str, source: str, entry: LawEntry) -> Effect:
    """A law under a name: an effect whose only parameter is its size, 1 as it was found."""
    constants = law_fields(entry)
    del constants["size"]
    return laws.law_effect(
        identity, title, constants, stage=STAGE_OF.get(entry.channel, "measurement"), source=source, trace=entry.title or title,
        equation=f"{entry.channel} x {entry.form} of {entry.coordinate}", coordinate=TOLD_BY.get(entry.coordinate, "time"),
        counts_from_start=entry.coordinate in ("time", "slip", "work", "passes"), needs=("rubber",) if entry.coordinate in THERMAL else (),
    )  # fmt: skip


def check_law(entry: LawEntry, reader: Reader, key: str) -> None:
    """Refuse a law that means nothing, by file and key."""
    forms = (*laws.FORMS, laws.TABLE)
    for name, known in (("channel", laws.CHANNELS), ("coordinate", laws.COORDINATES), ("memory", laws.MEMORIES), ("form", forms)):
        value = getattr(entry, name)
        if value not in known:
            raise reader.fail(f"{key}.{name}", value, suggestion(value, list(known)))
    if entry.memory != "none" and not entry.memory_size > 0.0:
        raise reader.fail(f"{key}.memory_size", entry.memory_size, "a number above 0 for a memory")
    if entry.memory == "ring" and (entry.channel, entry.coordinate) != laws.RINGS:
        raise reader.fail(f"{key}.memory", "ring", f"no other than {' over '.join(laws.RINGS)} with it")
    if entry.channel == laws.LINKED[0] and (entry.coordinate, entry.memory) != (laws.LINKED[1], "none"):
        raise reader.fail(f"{key}.channel", entry.channel, f"no other than {laws.LINKED[1]} as its coordinate, without a memory")
    if entry.memory == "ring" and not entry.memory_size >= SHORTEST_S:
        raise reader.fail(f"{key}.memory_size", entry.memory_size, f"a period of at least {SHORTEST_S:g} s for what rings")
    if len(entry.range) != 2 or not NARROWEST <= entry.range[1] - entry.range[0] <= WIDEST:
        expected = f"two ascending numbers, {NARROWEST:g} to {WIDEST:g} apart: where the coordinate was seen"
        raise reader.fail(f"{key}.range", list(entry.range), expected)
    if entry.form == laws.TABLE:
        if not 2 <= len(entry.knots) <= laws.KNOTS or entry.values:
            expected = f"at least two and at most {laws.KNOTS} values of f, equally spaced over the range, and no 'values'"
            raise reader.fail(f"{key}.knots", list(entry.knots), expected)
    else:
        _check_values(entry, reader, key)
    if expected := _wrong_size(entry):
        which = "knots" if entry.form == laws.TABLE else "values"
        raise reader.fail(f"{key}.{which}", getattr(entry, which), expected)
    for name, ends in entry.intervals.items():
        if name not in (*entry.values, "memory_size") or len(ends) != 2 or not ends[0] <= ends[1]:
            expected = f"two ascending numbers for each of {', '.join((*entry.values, 'memory_size'))}"
            raise reader.fail(f"{key}.intervals.{name}", list(ends), expected)
    if entry.heldout_gain is not None and entry.heldout_gain > 1.0:
        raise reader.fail(f"{key}.heldout_gain", entry.heldout_gain, "a share, at most 1")


def _wrong_size(entry: LawEntry) -> str:
    """What the values or knots of a law should be; empty if they are."""
    f = np.asarray(law_fields(entry)["f"])
    if not np.isfinite(f).all():
        return "numbers with which the law is finite over its range, and as far beyond as it goes on"
    low, high = entry.range
    if entry.channel in SHARES and laws.sampled(entry.form, entry.values, entry.knots, low, high).max() <= -1.0:
        return "a law above -1 somewhere on its range: a share of -1 takes all that is there"
    start, end = laws.reach(entry.form, entry.values, low, high)
    driven = entry.channel in FED_BACK[0] and entry.coordinate in FED_BACK[1] and entry.memory != "ring"
    if driven and abs(float(f[-1]) - float(f[0])) >= end - start:
        return "a law that changes by less than the torque it depends on: it would drive itself"
    return ""


def _check_values(entry: LawEntry, reader: Reader, key: str) -> None:
    """Refuse values that the closed form of a law has not, or lacks."""
    if entry.knots:
        raise reader.fail(f"{key}.knots", list(entry.knots), f"no knots for a law of the form '{entry.form}'")
    names = laws.form_values(entry.form)
    for name, number in entry.values.items():
        if name not in names:
            raise reader.fail(f"{key}.values.{name}", number, f"no such value of '{entry.form}'; {suggestion(name, list(names))}")
        if name in laws.POSITIVE and not number > 0.0:
            raise reader.fail(f"{key}.values.{name}", number, "a number above 0")
        start, end = laws.reach(entry.form, entry.values, *entry.range)
        least = FEWEST_PLACES * (end - start) / (laws.KNOTS - 1)
        if name == "period" and number < least:
            raise reader.fail(f"{key}.values.{name}", number, f"at least {least:.3g}: a law is kept at {laws.KNOTS} places")
    if missing := [name for name in names if name not in entry.values]:
        raise reader.fail(f"{key}.values", entry.values, f"values of {', '.join(missing)}")
    if entry.form == "window" and entry.values["start"] > entry.values["end"]:
        raise reader.fail(f"{key}.values.end", entry.values["end"], f"at least the start ({entry.values['start']:g})")
