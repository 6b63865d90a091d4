# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Physics of users: a YAML file of one-line laws (parsed, never run as Python), or a Python file with ``EFFECT`` or ``EFFECTS``."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib.util
import math
import sys
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import yaml

from lugre_steering import yaml_text
from lugre_steering.chain.compiled import exp, law, tanh
from lugre_steering.chain.compose import HOOKS, SENSOR_HOOKS, quantities_of
from lugre_steering.effects.declared import A_NAME, check_declared, check_typed, is_name
from lugre_steering.effects.entry import STAGES, Effect, Parameter
from lugre_steering.effects.law_entry import LawEntry, check_law, named
from lugre_steering.errors import EffectError, reason
from lugre_steering.expression import ExpressionError, parse
from lugre_steering.files import read_text, write_text
from lugre_steering.schema import Reader

OF_PYTHON = ("wind_up", "contact", "line")
"""Hooks whose laws return more than one number, which a line of YAML cannot, or act once per pressure line (``Effect.per_line``)."""


@law
def _sign(x):
    """-1, 0 or 1."""
    return 0.0 if x == 0.0 else math.copysign(1.0, x)


_FUNCTIONS = {
    "abs": abs, "sign": _sign, "sqrt": math.sqrt, "exp": exp, "log": math.log, "tanh": tanh, "sin": math.sin, "cos": math.cos,
    "min": min, "max": max,
}  # fmt: skip


@dataclass(frozen=True)
class _Number:
    """A parameter in a YAML file; see ``entry.Parameter``."""

    unit: str
    meaning: str
    scale: float
    low: float = -1e300
    high: float = 1e300
    grid: tuple[float, ...] = ()
    relative_to: str = ""
    optional: bool = False


@dataclass(frozen=True)
class _Sheet:
    """An effect in a YAML file; see ``entry.Effect``. ``update``: next value of each memory."""

    id: str
    stage: str
    title: str
    laws: dict[str, str]
    parameters: dict[str, _Number]
    source: str = "own physics"
    trace: str = "as its law says"
    coordinate: str = "time"
    equation: str = ""
    memory: dict[str, float] = field(default_factory=dict)
    update: dict[str, str] = field(default_factory=dict)
    rivals: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    counts_from_start: bool = False
    never_late: bool = False
    one_sided: bool = False
    joint_title: str = ""


@dataclass(frozen=True)
class _Kept:
    """A law of a vehicle file under a name, see ``law_entry.named``."""

    id: str
    title: str
    law: LawEntry
    source: str = "found in recordings"


def read_effects(file: Path) -> tuple[list[Effect], str]:
    """Effects of a user's file, each with the SHA-256 by which vehicle files know it again, and that of the whole file.

    Of Python it is that of the file, as a law may use whatever stands there; of YAML it is that of its own entry.
    """
    try:
        content = read_text(file, yaml_text.LONGEST)
    except (OSError, ValueError) as error:
        raise EffectError(f"{file}: cannot be read: {reason(error)}; expected a .py or .yaml file of effects") from error
    sha256 = hashlib.sha256(content.encode()).hexdigest()
    if file.suffix == ".py":
        found = [dataclasses.replace(effect, sha256=sha256) for effect in _of_module(_run(file, content, sha256), str(file))]
    elif file.suffix in (".yaml", ".yml"):
        found = _of_yaml(file)
    else:
        raise EffectError(f"{file}: got the ending '{file.suffix}', expected .py or .yaml")
    return found, sha256


def _run(file: Path, content: str, sha256: str) -> ModuleType:
    """The module of a user's file, under a name that tells its content: compiled code that is kept looks for it by that name.

    What runs is the text whose hash is told: Python's loader would take an older compiled copy for one edited within the second.
    """
    spec = importlib.util.spec_from_file_location(f"lugre_steering_own_{file.stem}_{sha256[:16]}", file)
    assert spec is not None
    if spec.name in sys.modules:
        return sys.modules[spec.name]
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    try:
        exec(compile(content, str(file), "exec", dont_inherit=True), vars(module))
    except (Exception, SystemExit) as error:  # whatever a user's own Python raises
        del sys.modules[spec.name]
        raise EffectError(f"{file}: cannot be run: {type(error).__name__}: {error}") from error
    return module


def _of_module(module: object, name: str) -> list[Effect]:
    found = getattr(module, "EFFECTS", None) or [getattr(module, "EFFECT", None)]
    return of_objects(found, name)


def of_objects(found: object, name: str) -> list[Effect]:
    """Effects with compiled laws out of what a file or package offers."""
    items = list(found) if isinstance(found, Sequence) else [found]
    effects = [item for item in items if isinstance(item, Effect)]
    if not items or len(effects) < len(items):
        kinds = ", ".join(type(item).__name__ for item in items)
        raise EffectError(f"{name}: got {kinds or 'nothing'}, expected EFFECT = Effect(...), or EFFECTS, a list of them")
    for effect in effects:
        check_typed(effect, name)
    return [
        dataclasses.replace(item, hooks={hook: one if hasattr(one, "py_func") else law(one) for hook, one in item.hooks.items()})
        for item in effects
    ]


def _of_yaml(file: Path) -> list[Effect]:
    reader = Reader(file, EffectError)
    data = reader.load()
    listed = data.get("effects") if isinstance(data, Mapping) and "effects" in data else [data]
    if not isinstance(listed, Sequence) or isinstance(listed, str) or not listed:
        raise reader.fail("effects", listed, "a list of effects")
    prefixes = [f"effects[{i}]" for i in range(len(listed))] if len(listed) > 1 else [""]
    found = [
        _of_law(reader, reader.build(_Kept, item, prefix), prefix)
        if isinstance(item, Mapping) and "law" in item
        else _of_sheet(reader, reader.build(_Sheet, item, prefix), prefix)
        for item, prefix in zip(listed, prefixes, strict=True)
    ]
    digests = (hashlib.sha256(repr(item).encode()).hexdigest() for item in listed)
    return [dataclasses.replace(effect, sha256=digest) for effect, digest in zip(found, digests, strict=True)]


def _of_law(reader: Reader, kept: _Kept, prefix: str) -> Effect:
    before = f"{prefix}." if prefix else ""
    if not is_name(kept.id):
        raise reader.fail(f"{before}id", kept.id, A_NAME)
    check_law(kept.law, reader, f"{before}law")
    return named(kept.id, kept.title, kept.source, kept.law)


def add_law(catalogue: Path, identity: str, title: str, source: str, law: Mapping[str, Any]) -> None:
    """Keep a law (plain data) under a name in a YAML file of effects, which is made if there is none; what stands there stays."""
    if catalogue.suffix not in (".yaml", ".yml"):
        raise EffectError(f"{catalogue}: got the ending '{catalogue.suffix}', expected .yaml")
    new = {"id": identity, "title": title, "source": source, "law": law}
    item = yaml.safe_dump([new], sort_keys=False, allow_unicode=True, width=120)
    reader = Reader(catalogue, EffectError)
    effect = _of_law(reader, reader.build(_Kept, new, ""), "")
    try:
        check_declared(effect, ())
    except EffectError as error:
        raise EffectError(f"{catalogue}: {error}") from error
    before, known = "effects:\n", []
    if catalogue.exists():
        if any(effect.id == identity for effect in read_effects(catalogue)[0]):
            raise EffectError(f"{catalogue}: effect '{identity}': there is one of this name; expected another id")
        before = reader.text().rstrip("\n") + "\n"
        content = reader.parse(before)
        known = list(content["effects"]) if isinstance(content, Mapping) and "effects" in content else []
    for indent in ("", "  ", "    "):
        text = before + textwrap.indent(item, indent)
        try:
            whole = reader.parse(text)
        except EffectError:
            continue
        if whole == {"effects": [*known, new]}:
            try:
                write_text(text, catalogue)
            except OSError as error:
                raise EffectError(f"{catalogue}: cannot be written: {reason(error)}; expected a file in a writable folder") from error
            return
    raise EffectError(f"{catalogue}: expected a file of one list 'effects', each entry behind a dash, to add '{identity}' to")


def _of_sheet(reader: Reader, sheet: _Sheet, prefix: str) -> Effect:
    def key(name: str) -> str:
        return f"{prefix}.{name}" if prefix else name

    for what, names in (("id", [sheet.id]), ("parameters", sheet.parameters), ("memory", sheet.memory)):
        for name in names:
            if not is_name(name):
                raise reader.fail(key(what), name, A_NAME)
            if name in _FUNCTIONS:
                raise reader.fail(key(what), name, f"a name that is none of the functions {', '.join(_FUNCTIONS)}")
    if sheet.stage not in STAGES:
        raise reader.fail(key("stage"), sheet.stage, f"one of {', '.join(STAGES)}")
    if not sheet.laws:
        raise reader.fail(key("laws"), sheet.laws, f"at least one law: {', '.join(HOOKS)}")
    if set(sheet.update) != set(sheet.memory):
        raise reader.fail(key("update"), sorted(sheet.update), f"the next value of each memory ({', '.join(sheet.memory) or 'none'})")
    hooks = {}
    keeping = next((hook for hook in sheet.laws if hook not in SENSOR_HOOKS), "")  # whose law makes the next values of the memory
    for hook, text in sheet.laws.items():
        if hook not in HOOKS or hook in OF_PYTHON:
            known = ", ".join(name for name in HOOKS if name not in OF_PYTHON)
            hint = " (this one needs a .py file)" if hook in OF_PYTHON else ""
            raise reader.fail(key(f"laws.{hook}"), text, f"a hook out of {known}{hint}")
        memory = {} if hook in SENSOR_HOOKS else sheet.update if hook == keeping else {name: name for name in sheet.memory}
        own = [*sheet.parameters, *memory]
        names = [*own, *(name for name in quantities_of(hook) if name not in own)]
        hooks[hook] = _compiled(reader, key(f"laws.{hook}"), hook, text, memory, names)
    parameters = tuple(
        Parameter(
            name, p.unit, p.meaning, p.scale, -math.inf if p.low <= -1e300 else p.low, math.inf if p.high >= 1e300 else p.high,
            p.grid, p.relative_to, p.optional,
        )
        for name, p in sheet.parameters.items()
    )  # fmt: skip
    return Effect(
        id=sheet.id, stage=sheet.stage, tier=2, title=sheet.title, source=sheet.source, trace=sheet.trace, coordinate=sheet.coordinate,
        equation=sheet.equation or "; ".join(f"{hook}: {text}" for hook, text in sheet.laws.items()), parameters=parameters, hooks=hooks,
        memory=sheet.memory, rivals=sheet.rivals, needs=sheet.needs, counts_from_start=sheet.counts_from_start,
        never_late=sheet.never_late, one_sided=sheet.one_sided, joint_title=sheet.joint_title,
    )  # fmt: skip


def _compiled(reader: Reader, key: str, hook: str, part: str, memory: Mapping[str, str], names: Sequence[str]) -> Any:
    """A law out of its expression and what becomes of the ``memory``; both see the memory as it was."""
    try:
        checked = {name: parse(text, names) for name, text in {"": part, **memory}.items()}
    except ExpressionError as error:
        raise EffectError(f"{reader.file}: key '{key}': {error}") from None
    used = [name for name in names if name not in memory and any(name in one.names for one in checked.values())]
    results = ", ".join(checked[name].source for name in ("", *memory))
    text = f"def {hook}({', '.join([*used, *memory])}):\n    return {results}\n"
    scope: dict[str, Any] = dict(_FUNCTIONS)
    exec(compile(text, f"{reader.file}:{key}", "exec"), scope)  # built of checked nodes only: numbers, names, arithmetic
    scope[hook].__source__ = text
    return law(scope[hook])
