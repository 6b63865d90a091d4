# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Saved defaults of the command line: options by name (``vehicle``), or of one command alone (``diagnose.seed``)."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args, get_origin

import yaml

from lugre_steering import yaml_text
from lugre_steering.errors import LugreSteeringError
from lugre_steering.files import read_text, write_text

VARIABLE = "LUGRE_STEERING_CONFIG"
"""Environment variable that names another file."""

_SAVED: dict[type, tuple[tuple[type, ...], str]] = {
    bool: ((bool,), "true or false"),
    int: ((int,), "a whole number"),
    float: ((int, float), "a number"),
    str: ((str,), "text"),
    Path: ((str,), "a path"),
}
"""For each type of option what YAML has for it, and in words."""


def file() -> Path:
    """Where they are kept."""
    if given := os.environ.get(VARIABLE):
        return Path(given)
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "lugre_steering" / "defaults.yaml"


def load() -> dict[str, Any]:
    """All that were saved; none where there is no file."""
    path = file()
    if not path.exists():
        return {}
    try:
        content = yaml_text.parse(read_text(path, yaml_text.LONGEST))
    except OSError as error:
        raise LugreSteeringError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (yaml.YAMLError, ValueError) as error:
        raise LugreSteeringError(f"{path}: is not valid YAML: {' '.join(str(error).split())}") from error
    if content is None:
        return {}
    if not isinstance(content, dict) or not all(isinstance(key, str) for key in content):
        raise LugreSteeringError(f"{path}: expected a mapping of options to values, such as 'vehicle: truck.yaml'")
    return content


def save(saved: Mapping[str, Any]) -> None:
    """Keep these and no others."""
    path = file()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(yaml.safe_dump(dict(saved), allow_unicode=True) if saved else "", path)
    except OSError as error:
        raise LugreSteeringError(f"{path}: cannot be written ({error.strerror or error})") from error


@dataclass(frozen=True)
class Option:
    """An option of a command: the name of its parameter and its type."""

    parameter: str
    hint: Any

    @property
    def several(self) -> bool:
        """Whether it may be given more than once."""
        return any(get_origin(hint) is list for hint in (self.hint, *get_args(self.hint)))

    @property
    def kind(self) -> type:
        """Of one value."""
        hint = next(h for h in (*get_args(self.hint), self.hint) if h is not type(None))
        kind: type = next(iter(get_args(hint)), hint)
        return kind


    @property
    def expected(self) -> str:
        """What may be saved for it, in words."""
        return f"a list, each {_SAVED[self.kind][1]}" if self.several else _SAVED[self.kind][1]

    def takes(self, saved: object) -> bool:
        """Whether this may be saved for it."""
        values = saved if isinstance(saved, list) else [saved]
        return isinstance(saved, list) == self.several and all(type(value) in _SAVED[self.kind][0] for value in values)


CommandOptions = Mapping[str, Mapping[str, Option]]
"""Options of each command by the name as it is typed, without its dashes."""


def of_commands(saved: Mapping[str, Any], options: CommandOptions) -> dict[str, dict[str, Any]]:
    """Defaults of each command by the name of its parameter."""
    for key in saved:
        meant, forget = _meant(key, options), f"'lugre-steering config {key} --unset' forgets it"
        if not meant:
            raise LugreSteeringError(f"{file()}: key '{key}': no such option; {forget}")
        if not any(option.takes(saved[key]) for option in meant):
            got = str(saved[key])[:40]
            raise LugreSteeringError(f"{file()}: key '{key}': got '{got}', expected {meant[0].expected}; {forget}")
    return {
        command: {
            option.parameter: saved.get(f"{command}.{name}", saved.get(name))
            for name, option in of_one.items()
            if f"{command}.{name}" in saved or name in saved
        }
        for command, of_one in options.items()
    }


def checked(key: str, value: str, options: CommandOptions) -> Any:
    """A default as it is kept: one that its option takes; a path that is there in full, as commands run anywhere."""
    meant = _meant(key, options)
    if not meant or not value:
        raise LugreSteeringError(f"config {key}: expected the name of an option, such as vehicle or diagnose.seed, and a value")
    kind = meant[0].kind
    try:
        kept: Any = {"true": True, "false": False}[value] if kind is bool else kind(value)
    except (ValueError, KeyError):
        expected = "true or false" if kind is bool else f"a number ({kind.__name__})"
        raise LugreSteeringError(f"config {key}: got '{value}', expected {expected}") from None
    if isinstance(kept, Path):
        kept = str(kept.resolve() if kept.exists() else kept)
    return [kept] if meant[0].several else kept


def _meant(key: str, options: CommandOptions) -> list[Option]:
    """The options of a key: of all commands, or of the one that it names."""
    command, _, name = key.rpartition(".")
    return [of_one[name] for each, of_one in options.items() if command in ("", each) and name in of_one]
