# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""YAML files into frozen, typed dataclasses: every refusal names file, key, value and expectation."""

from __future__ import annotations

import ast
import dataclasses
import difflib
import inspect
import math
import textwrap
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any, TypeVar

import yaml

from lugre_steering import yaml_text
from lugre_steering.errors import LugreSteeringError
from lugre_steering.files import read_text

T = TypeVar("T")


UNITS = {
    "Nm_per_deg": "N m/deg", "J_kgK": "J/(kg K)", "W_m2K": "W/(m2 K)", "kg_m3": "kg/m3", "deg_s": "deg/s", "kgm2": "kg m2",
    "degC": "degC", "Nms": "N m s", "deg": "deg", "Nm": "N m", "Pa": "Pa", "Hz": "Hz", "K": "K", "N": "N", "m": "m",
}  # fmt: skip
"""Unit of a key, by its ending."""


def quantity(
    low: float = -math.inf, high: float = math.inf, *, open_low: bool = False, default: Any = dataclasses.MISSING
) -> Any:
    """A dataclass field whose numbers must lie in [low, high] (``open_low``: low itself excluded)."""
    metadata = {"low": low, "high": high, "open_low": open_low}
    if default is dataclasses.MISSING:
        return field(metadata=metadata)
    return field(default=default, metadata=metadata)


def positive(high: float = math.inf, *, default: Any = dataclasses.MISSING) -> Any:
    return quantity(0.0, high, open_low=True, default=default)


def meanings_of(cls: type) -> dict[str, str]:
    """What stands as a text below each attribute of a class."""
    (body,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    assert isinstance(body, ast.ClassDef)
    return {
        attribute.target.id: " ".join(below.value.value.split())
        for attribute, below in zip(body.body, body.body[1:], strict=False)
        if isinstance(attribute, ast.AnnAssign) and isinstance(attribute.target, ast.Name)
        and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant) and isinstance(below.value.value, str)
    }  # fmt: skip


def section_in(hint: Any) -> type | None:
    """The dataclass that a key of this type holds, also as entries of a list or mapping; None for plain values."""
    held = (each for each in (hint, *typing.get_args(hint)) if dataclasses.is_dataclass(each))
    return typing.cast("type | None", next(held, None))


def unit_of(key: str) -> str:
    """Unit that a key's ending names; empty if none does."""
    return next((unit for ending, unit in UNITS.items() if key.endswith(f"_{ending}")), "")


class Reader:
    """Builds dataclasses from plain YAML data; remembers the file for its messages."""

    def __init__(self, file: Path, error: type[LugreSteeringError]) -> None:
        self.file, self.error = file, error

    def load(self) -> object:
        """Plain data of the file."""
        return self.parse(self.text())

    def text(self) -> str:
        """The file as it is."""
        try:
            return read_text(self.file, yaml_text.LONGEST)
        except OSError as error:
            raise self.error(f"{self.file}: cannot be read: {error.strerror or error}") from error
        except ValueError as error:  # not UTF-8, too long, or a NUL in the name
            raise self.error(f"{self.file}: is not valid YAML: {error}") from error

    def parse(self, text: str) -> object:
        """Plain data of the file's text."""
        try:
            return yaml_text.parse(text)
        except (yaml.YAMLError, ValueError) as error:  # ValueError: 2020-13-45
            raise self.error(f"{self.file}: is not valid YAML: {' '.join(str(error).split())}") from error

    def fail(self, key: str, value: object, expected: str) -> LugreSteeringError:
        return self.error(f"{self.file}: key '{key}': got {_short(value)}, expected {expected}")

    def build(self, cls: type[T], data: object, key: str) -> T:
        if not isinstance(data, Mapping):
            raise self.fail(key or "(top level)", data, "a mapping")
        hints = typing.get_type_hints(cls)
        fields = {item.name: item for item in dataclasses.fields(cls)}  # type: ignore[arg-type]
        for name in data:
            if name not in fields:
                raise self.fail(_join(key, name), data[name], f"no such key; {suggestion(str(name), sorted(fields))}")
        values: dict[str, Any] = {}
        for name, item in fields.items():
            path = _join(key, name)
            if name in data and data[name] is not None:
                values[name] = self.convert(hints[name], data[name], path, item.metadata)
            elif item.default is dataclasses.MISSING and item.default_factory is dataclasses.MISSING:
                raise self.fail(path, None, f"this key ({_type_name(hints[name])})")
        return cls(**values)

    def convert(self, hint: Any, value: Any, key: str, bounds: Mapping[str, Any]) -> Any:
        origin, arguments = typing.get_origin(hint), typing.get_args(hint)
        if origin in (typing.Union, types.UnionType):
            return self.convert(next(a for a in arguments if a is not type(None)), value, key, bounds)
        if dataclasses.is_dataclass(hint):
            return self.build(typing.cast(type, hint), value, key)
        if origin is tuple:
            if isinstance(value, str) or not isinstance(value, Sequence):
                raise self.fail(key, value, "a list")
            return tuple(self.convert(arguments[0], item, f"{key}[{i}]", bounds) for i, item in enumerate(value))
        if origin is dict:
            if not isinstance(value, Mapping):
                raise self.fail(key, value, "a mapping")
            return {str(k): self.convert(arguments[1], v, _join(key, k), bounds) for k, v in value.items()}
        if hint is bool and not isinstance(value, bool):
            raise self.fail(key, value, "true or false")
        if hint is float:
            return self.number(value, key, bounds)
        if hint is str:
            if not isinstance(value, str) or not value:
                raise self.fail(key, value, "a text")
            return value
        return value

    def number(self, value: Any, key: str, bounds: Mapping[str, Any]) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.fail(key, value, "a plain number in the unit the key ends in")
        number = math.inf if isinstance(value, int) and abs(value) >= 2**1023 else float(value)
        low, high, open_low = bounds.get("low", -math.inf), bounds.get("high", math.inf), bounds.get("open_low", False)
        if not math.isfinite(number) or number < low or number > high or (open_low and number == low):
            raise self.fail(key, value, f"a finite number {'above' if open_low else 'from'} {low:g} to {high:g}")
        return number


def suggestion(name: str, known: Sequence[str]) -> str:
    """What was probably meant by an unknown name, or else all that it could have been."""
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean '{near[0]}'?" if near else f"one of {', '.join(known) or 'none'}"


def _join(key: str, name: object) -> str:
    return f"{key}.{name}" if key else str(name)


def _short(value: object) -> str:
    if value is None:
        return "nothing"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _type_name(hint: Any) -> str:
    return {float: "a number", str: "a text"}.get(hint, "a list" if typing.get_origin(hint) is tuple else "a mapping")
