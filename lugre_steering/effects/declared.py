# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What an effect declares is of the right type and in order, and every name in it is one of something: a misspelt one would be
dropped in silence."""

from __future__ import annotations

import dataclasses
import difflib
import inspect
import keyword
import math
import re
import typing
from collections.abc import Collection, Iterator, Mapping
from numbers import Real
from typing import Any

from lugre_steering.chain.layout import BASELINE_FIELDS
from lugre_steering.effects.entry import NEEDS, RELATIVE_TO, STAGES, Effect, Parameter
from lugre_steering.errors import EffectError

LONGEST_NAME = 64
A_NAME = f"a name of small letters, digits and _, a letter first, at most {LONGEST_NAME} of them, that is no word of Python"
OF_MOTION = ("theta", "omega", "alpha", "dt", "time")
"""Quantities that every reader of a law knows: a parameter of that name would be read in their place."""
_KINDS: Mapping[Any, str] = {str: "a text", int: "a whole number", bool: "True or False", tuple: "a tuple", Mapping: "a mapping"}


def is_name(text: object) -> bool:
    """Whether it can name an effect, a parameter or a memory."""
    if not isinstance(text, str) or len(text) > LONGEST_NAME or keyword.iskeyword(text):
        return False
    return re.fullmatch(r"[a-z][a-z0-9_]*", text) is not None


def check_typed(effect: Effect, where: str) -> None:
    """Refuse an effect, made in Python, whose fields are not of the types that ``Effect`` and ``Parameter`` say."""
    for key, value, right, wanted in _typed(effect):
        if not right:
            raise EffectError(f"{where}: effect {effect.id!r}: {key}: got {value!r}, expected {wanted}")


def check_declared(effect: Effect, known: Collection[str]) -> None:
    """Refuse an effect that declares names which mean nothing, or values out of order; ``known``: ids that may be its rivals."""
    for key, value, right, wanted in _in_order(effect):
        if not right:
            raise EffectError(f"effect '{effect.id}': {key}: got {value!r}, expected {wanted}")
    for what, name, among in _declared(effect, known):
        if name not in among:
            near = difflib.get_close_matches(name, among, n=1)
            wanted = f"did you mean '{near[0]}'?" if near else f"expected one of {', '.join(sorted(among)) or 'nothing'}"
            raise EffectError(f"effect '{effect.id}': {what}: got '{name}'; {wanted}")
    if effect.parameters and not effect.hooks and not effect.not_recorded:
        raise EffectError(f"effect '{effect.id}': hooks: got none, expected a law that reads its parameters")
    if effect.hooks and not effect.amplitudes:
        amplitude = "an amplitude, which switches the effect off at zero: a parameter that has no 'grid' and is not 'optional'"
        names = ", ".join(p.name for p in effect.parameters) or "none"
        raise EffectError(f"effect '{effect.id}': parameters: got {names}, expected {amplitude}")


Claim = tuple[str, object, bool, str]
"""Key, value, whether it is right, and what it must be. Each is only asked for once those before it are right."""


def _typed(effect: Effect) -> Iterator[Claim]:
    yield from _fields(effect, "")
    for number, parameter in enumerate(effect.parameters):
        key = f"parameters[{number}]"
        yield key, parameter, isinstance(parameter, Parameter), "a Parameter"
        yield from _fields(parameter, f"{key}.")
        yield from ((f"{key}.grid", value, _is_number(value), "numbers") for value in parameter.grid)
    for key in ("rivals", "needs", "acts_by"):
        yield from ((key, name, isinstance(name, str), "texts") for name in getattr(effect, key))
    for ends in effect.places:
        pair = isinstance(ends, tuple) and len(ends) == 2 and all(isinstance(name, str) for name in ends)
        yield "places", ends, pair, "pairs of names"
    for hook, law in effect.hooks.items():
        yield f"hooks.{hook}", law, inspect.isfunction(law) or hasattr(law, "py_func"), "a function written in Python"
    yield "variants", effect.variants, effect.variants is None or callable(effect.variants), "a function, or None"


def _fields(thing: Effect | Parameter, prefix: str) -> Iterator[Claim]:
    """The plain fields of a dataclass against their annotations."""
    hints = typing.get_type_hints(type(thing))
    for item in dataclasses.fields(thing):
        hint, value = hints[item.name], getattr(thing, item.name)
        kind = typing.get_origin(hint) or hint
        if kind is float:
            yield f"{prefix}{item.name}", value, _is_number(value), "a number"
        elif kind in _KINDS:
            yield f"{prefix}{item.name}", value, isinstance(value, kind), _KINDS[kind]


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and not math.isnan(value)


def _in_order(effect: Effect) -> Iterator[Claim]:
    yield "id", effect.id, is_name(effect.id), A_NAME
    yield "id", effect.id, re.fullmatch(r"law_\d+", effect.id) is None, "another name: law_1, law_2, ... are the laws of a vehicle file"
    for key in ("title", "joint_title"):
        yield key, getattr(effect, key), _is_line(getattr(effect, key)), "one line"
    for name in (*(p.name for p in effect.parameters), *effect.memory, *effect.tables):
        free = is_name(name) and name not in OF_MOTION
        yield "name of a parameter, memory or table", name, free, f"{A_NAME}, nor one of {', '.join(OF_MOTION)}"
    yield from ((f"tables.{name}", size, size > 0, "a length of at least 1") for name, size in effect.tables.items())
    own = [p.name for p in effect.parameters]
    yield "per_line", effect.per_line, effect.per_line == ("line" in effect.hooks), "True for the law 'line', or else False"
    yield "hooks", [*effect.hooks], not effect.per_line or len(effect.hooks) == 1, "no other beside 'line'"
    yield "parameters", own, not effect.per_line or len(own) == 1, "one alone, which is there once for each line"
    for p in effect.parameters:
        key = f"parameters.{p.name}"
        yield from ((f"{key}.{part}", getattr(p, part), _is_line(getattr(p, part)), "one line") for part in ("unit", "meaning"))
        yield f"{key}.low", p.low, p.low < p.high, f"less than high ({p.high:g})"
        largest = max(abs(p.low), abs(p.high))
        yield f"{key}.scale", p.scale, 0.0 < p.scale <= largest, f"a typical size above 0, at most {largest:g}"
        within = f"values from low ({p.low:g}) to high ({p.high:g})"
        yield from ((f"{key}.grid", value, p.low <= value <= p.high, within) for value in p.grid)


def _is_line(text: str) -> bool:
    return len(text.splitlines()) <= 1


def _declared(effect: Effect, known: Collection[str]) -> Iterator[tuple[str, str, Collection[str]]]:
    """What is declared, the name, and what it must be one of."""
    own = [p.name for p in effect.parameters]
    yield "stage", effect.stage, STAGES
    yield from (("acts_by", name, own) for name in effect.acts_by)
    yield from (("places", name, own) for ends in effect.places for name in ends if name)
    yield from (("play", name, own) for name in (effect.play,) if name)
    yield from (("constants", name, [*own, *effect.tables]) for name in effect.constants)
    yield from (("needs", name, NEEDS) for name in effect.needs)
    yield from (("rivals", name, known) for name in effect.rivals)
    yield from ((f"parameters.{p.name}.relative_to", p.relative_to, RELATIVE_TO) for p in effect.parameters if p.relative_to)
    yield from ((f"memory.{key}", start, BASELINE_FIELDS) for key, start in effect.memory.items() if isinstance(start, str))
