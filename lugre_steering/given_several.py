# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One thing or several of a kind that a program gives: whatever else stands in their place is an error of ours."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lugre_steering.errors import DataError


def texts(name: str, given: object, expected: str = "a text or several") -> list[str]:
    """A text, or those of a list."""
    return _several(name, given, str, expected)


def paths(name: str, given: object) -> list[Path]:
    """A path, or those of a list."""
    return [Path(one) for one in _several(name, given, (str, Path), "the path of a file, or several")]


def _several(name: str, given: object, kind: type | tuple[type, ...], expected: str) -> list[Any]:
    items = list(given) if isinstance(given, Iterable) and not isinstance(given, (str, bytes, Path)) else [given]
    for item in items:
        if not isinstance(item, kind):
            raise DataError(f"{name}: got {item!r}, expected {expected}")
    return items
