# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The one way in which results become JSON: finite numbers or null, tuples as lists, dataclasses as their fields in order."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import Field, fields, is_dataclass, replace
from os import PathLike, fspath
from typing import Any

Leaf = Callable[[Any, str], Any]


IN_MEMORY = {"written": False}
"""Metadata of a dataclass field that is no part of the JSON: arrays, vehicles."""
ADDED = {"required": False}
"""Metadata of a dataclass field that results of earlier versions lack."""


def key(name: str) -> dict[str, Any]:
    """Metadata of a dataclass field whose key in the file is no name of Python."""
    return {"key": name}


def key_of(item: Field[Any]) -> str:
    """The key of a dataclass field in the file."""
    return str(item.metadata.get("key", item.name))


def in_order(*names: str) -> dict[str, Any]:
    """Metadata of a dataclass field that holds dataclasses whose keys the file has in this order."""
    return {"order": names}


def written(result: Any) -> list[Field[Any]]:
    """The fields of a dataclass (or an instance) that are part of its JSON, in order."""
    return [item for item in fields(result) if item.metadata.get("written", True)]


def plain(tree: Any) -> Any:
    """The tree as JSON holds it: dicts, lists, text, finite numbers, true, false and null."""
    if is_dataclass(tree):
        return {key_of(item): _ordered(plain(getattr(tree, item.name)), item) for item in written(tree)}
    if isinstance(tree, Mapping):
        return {str(key): plain(item) for key, item in tree.items()}
    if isinstance(tree, (list, tuple)):
        return [plain(item) for item in tree]
    return finite(tree)


def _ordered(rows: Any, item: Field[Any]) -> Any:
    names = item.metadata.get("order")
    return rows if names is None else [{name: row[name] for name in names} | row for row in rows]


def finite(value: Any) -> Any:
    """A leaf as JSON holds it: a number of NumPy as a plain one, one that is not finite as None, a path as text."""
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, PathLike):
        return fspath(value)
    number = float(value)
    return number if math.isfinite(number) else None


def mapped(tree: Any, leaf: Leaf, key: str = "") -> Any:
    """The same tree of dataclasses, mappings and sequences with ``leaf(value, key of it)`` at every leaf that is written."""
    if is_dataclass(tree) and not isinstance(tree, type):
        return replace(tree, **{item.name: mapped(getattr(tree, item.name), leaf, item.name) for item in written(tree)})
    if isinstance(tree, Mapping):
        return {name: mapped(item, leaf, name) for name, item in tree.items()}
    if isinstance(tree, (list, tuple)):
        return type(tree)(mapped(item, leaf, key) for item in tree)
    return leaf(tree, key)


def as_json(tree: Any) -> str:
    """The text of a JSON file or of ``--json``."""
    return json.dumps(plain(tree), indent=2, allow_nan=False)
