# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables of the guide that the code itself knows, in Markdown: ``python -m lugre_steering.reference [NAME]`` prints them.

A page of ``docs/`` asks for one by a line ``<!-- reference: NAME -->``, which the site replaces.
"""

from __future__ import annotations

import argparse
import dataclasses
import inspect
import math
import re
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import typer.main

from lugre_steering.chain.compose import HOOKS, QUANTITIES
from lugre_steering.chain.layout import BASELINE_FIELDS
from lugre_steering.cli import app
from lugre_steering.effects.laws import CHANNELS, COORDINATES, FORMS, MEMORIES
from lugre_steering.effects.laws import TABLE as FORM_TABLE
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.estimator.node_parameters import NODE_TABLE, OPTION_TABLE, NodeParameter
from lugre_steering.program import argument_name
from lugre_steering.schema import meanings_of, section_in, unit_of
from lugre_steering.vehicle.plausible import KEYS
from lugre_steering.vehicle.sections import Vehicle

ASKED = re.compile(r"^<!-- reference: (\w+) -->$", re.MULTILINE)


@dataclasses.dataclass(frozen=True)
class FileKey:
    """One key of a section of the vehicle file, as the page shows it."""

    name: str
    unit: str
    range: str
    default: str
    meaning: str


@dataclasses.dataclass(frozen=True)
class FileSection:
    """A mapping of the vehicle file: where it stands ('' for the file itself), what it is, its keys."""

    path: str
    meaning: str
    keys: tuple[FileKey, ...]


def sections(cls: type = Vehicle, path: str = "") -> Iterator[FileSection]:
    """The vehicle file's sections from the top down; ``NAME`` stands for a name of one's own, ``[]`` for each of a list."""
    hints, meanings = typing.get_type_hints(cls), meanings_of(cls)
    fields = dataclasses.fields(cls)
    keys = tuple(_key(item, meanings.get(item.name, ""), path) for item in fields)
    yield FileSection(path, inspect.getdoc(cls) or "", keys)
    for item in fields:
        if (inner := section_in(hints[item.name])) is not None:
            ending = {tuple: "[]", dict: ".NAME"}.get(typing.get_origin(hints[item.name]), "")
            yield from sections(inner, f"{path}.{item.name}{ending}".removeprefix("."))


def _key(item: dataclasses.Field[Any], meaning: str, path: str) -> FileKey:
    key = f"{path}.{item.name}".removeprefix(".")
    usual = next((f"; usual {u.low:g} to {u.high:g}" for u in KEYS if u.key == key), "")
    return FileKey(item.name, unit_of(item.name), _range(item.metadata) + usual, _default(item), meaning)


def _range(metadata: Mapping[str, Any]) -> str:
    if "low" not in metadata:
        return ""
    low, high = metadata["low"], metadata["high"]
    first = f"above {low:g}, up to" if metadata.get("open_low") else f"{low:g} to"
    return f"{first} {high:g}" if math.isfinite(high) else f"from {low:g}"


def _default(item: dataclasses.Field[Any]) -> str:
    if item.default_factory is not dataclasses.MISSING:
        made = item.default_factory()
        return "all defaults" if dataclasses.is_dataclass(made) else "none"
    if item.default is dataclasses.MISSING:
        return "**required**"
    if item.default is None or item.default == ():
        return "none"
    if isinstance(item.default, tuple):
        return f"`[{', '.join(item.default)}]`"
    return f"`{item.default:g}`" if isinstance(item.default, float) else f"`{item.default}`"


# ------------------------------------------------------------------- tables


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of Markdown."""
    cells = [[cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in rows]
    lines = [" | ".join(row) for row in (headings, ["---"] * len(headings), *cells)]
    return "\n".join(f"| {line} |" for line in lines) + "\n"


def vehicle_keys() -> str:
    """Every key of the vehicle file, section by section."""
    parts = []
    for section in sections():
        rows = [(f"`{k.name}`", k.unit, k.range, k.default, k.meaning) for k in section.keys]
        heading = f"`{section.path}`" if section.path else "Top level"
        meaning = section.meaning.replace("``", "`")
        parts.append(f"## {heading}\n\n{meaning}\n\n" + table(("key", "unit", "range", "default", "meaning"), rows))
    return "\n".join(parts).replace("``", "`")


def node_parameters() -> str:
    """Every parameter of the live node."""
    return table(("parameter", "default", "range", "at run time", "meaning"), [_parameter(p) for p in (*NODE_TABLE, *OPTION_TABLE)])


def _parameter(p: NodeParameter) -> tuple[str, ...]:
    default = str(p.default).lower() if isinstance(p.default, bool) else str(p.default)
    ranged = isinstance(p.default, (int, float)) and not isinstance(p.default, bool)
    span = ", ".join(p.choices) or (f"{p.low:g} to {p.high:g}" if ranged else "")
    return f"`{p.name}`", f"`{default}`" if default else "empty", span, "no" if p.fixed else "yes", p.description


def effects() -> str:
    """The catalogue, by the stage of the signal path where the physics acts."""
    titles = {e.id: e.title + ("" if e.observable else f" (never named: needs {e.not_recorded})") for e in CATALOGUE.values()}
    rows = [(f"`{e.id}`", titles[e.id], e.stage, ", ".join(f"`{p.name}` [{p.unit}]" for p in e.parameters)) for e in CATALOGUE.values()]
    return table(("id", "physics", "stage", "parameters"), rows)


def hooks() -> str:
    """Where in the chain an effect may act."""
    rows = [(f"`{name}`", hook.does.replace("``", "`"), _listed(hook.given) or "-") for name, hook in HOOKS.items()]
    return table(("hook", "a law there gives", "and may read, beside what the hooks above it know"), rows)


def quantities() -> str:
    """What the laws of an effect may read."""
    rows = [(f"`{name}`", meaning) for name, meaning in QUANTITIES.items()]
    rows += [(f"`{name}`", f"parameter of the baseline: {meaning}") for name, meaning in BASELINE_FIELDS.items()]
    return table(("name", "what it is [unit]"), rows)


def law_parts() -> str:
    """What a law of the vehicle file may change, and what it may depend on."""
    channels, coordinates, memories = (
        ", ".join(f"`{name}`" + f" [{unit}]" * bool(unit) for name, unit in of.items()) for of in (CHANNELS, COORDINATES, MEMORIES)
    )
    rows = [("`channel`", channels), ("`coordinate`", coordinates), ("`form`", _listed([*FORMS, FORM_TABLE])), ("`memory`", memories)]
    return table(("key", "one of [unit]"), rows)


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def commands() -> str:
    """Every command with its arguments and options."""
    group: Any = typer.main.get_command(app)
    parts = []
    for name, command in group.commands.items():
        rows = [_option(p) for p in command.params if p.name != "help"]
        parts.append(f"## `lugre-steering {name}`\n\n{' '.join((command.help or '').split())}\n\n{table(('option', 'meaning'), rows)}")
    return "\n".join(parts)


def _option(parameter: Any) -> tuple[str, str]:
    names = ", ".join(f"`{name}`" for name in (*parameter.opts, *parameter.secondary_opts) if name.startswith("-"))
    required = " (required)" if parameter.required else ""
    return names or f"`{argument_name(parameter)}`", f"{parameter.help or ''}{required}"


TABLES: Mapping[str, Callable[[], str]] = {
    "vehicle": vehicle_keys, "laws": law_parts, "parameters": node_parameters, "effects": effects, "hooks": hooks,
    "quantities": quantities, "commands": commands,
}  # fmt: skip


def filled(page: str) -> str:
    """A page of the guide with the tables that it asks for."""
    return ASKED.sub(lambda asked: TABLES[asked[1]](), page)


def main() -> None:
    """Print the tables, or those that are named."""
    parser = argparse.ArgumentParser(prog="python -m lugre_steering.reference", description=main.__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[[], *TABLES], help=", ".join(TABLES))
    for name in parser.parse_args().names or TABLES:
        print(TABLES[name]())


if __name__ == "__main__":
    main()
