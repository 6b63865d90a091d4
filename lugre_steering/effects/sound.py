# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether an effect of a user's own is made of what effects are made of: names, texts, numbers and functions in their places."""

from __future__ import annotations

import inspect
import keyword
import math
import re
from collections.abc import Callable, Mapping, Sequence

from lugre_steering.effects.entry import Effect, Parameter
from lugre_steering.errors import EffectError

NAME, LONGEST = re.compile(r"[a-z][a-z0-9_]*"), 60
NAMED = f"a name of small letters, digits and _, a letter first, of {LONGEST} at most, no word of Python"
TEXTS = ("stage", "title", "equation", "source", "trace", "coordinate", "play", "joint_title", "not_recorded")


def is_name(name: object) -> bool:
    """Whether fields and functions can be called so."""
    return isinstance(name, str) and bool(NAME.fullmatch(name)) and len(name) <= LONGEST and not keyword.iskeyword(name)


def check_sound(effect: Effect, where: str) -> None:
    """Refuse an effect of a file or package by the first thing that is not what it must be."""

    def must(holds: bool, key: str, got: object, expected: str) -> None:
        if not holds:
            raise EffectError(f"{where}: effect {effect.id!r}: {key}: got {got!r}, expected {expected}")

    must(is_name(effect.id), "id", effect.id, NAMED)
    for key in TEXTS:
        text: object = getattr(effect, key)
        must(isinstance(text, str) and "\n" not in text, key, text, "a text of one line")
    tier: object = effect.tier
    must(isinstance(tier, int), "tier", tier, "1 or 2")
    hooks: object = effect.hooks
    must(isinstance(hooks, Mapping), "hooks", hooks, "laws by the name of their hook")
    for hook, one in effect.hooks.items():
        must(inspect.isfunction(getattr(one, "py_func", one)), f"hooks.{hook}", one, "a Python function")
    parameters: object = effect.parameters
    listed = isinstance(parameters, Sequence) and all(isinstance(item, Parameter) for item in parameters)
    must(listed, "parameters", parameters, "a list of Parameter(...)")
    for parameter in effect.parameters:
        _check_parameter(parameter, must)
    for key in ("memory", "tables", "constants"):
        kept: object = getattr(effect, key)
        must(isinstance(kept, Mapping) and all(map(is_name, kept)), key, kept, "values by their names")
    variants: object = effect.variants
    must(variants is None or callable(variants), "variants", variants, "a function of what a recording shows")


def _check_parameter(item: Parameter, must: Callable[[bool, str, object, str], None]) -> None:
    key = f"parameters.{item.name}"
    must(is_name(item.name), key, item.name, NAMED)
    must(isinstance(item.unit, str), f"{key}.unit", item.unit, "a unit")
    for end in ("scale", "low", "high"):
        number: object = getattr(item, end)
        must(isinstance(number, (int, float)) and not math.isnan(number), f"{key}.{end}", number, "a number")
    must(item.low < item.high, f"{key}.low", item.low, f"a number below high, {item.high!r}")
    must(0.0 < item.scale < math.inf, f"{key}.scale", item.scale, "a positive number")
    within = bool(item.relative_to) or all(item.low <= place <= item.high for place in item.grid)
    must(within, f"{key}.grid", item.grid, f"places from {item.low!r} to {item.high!r}")
