# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Rooms that are named like what they do, and do it when called: ``lugre_steering.replay(...)``."""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import Any


class _Room(ModuleType):
    """A package that is called like the function of its name in its ``library`` module, which is loaded only then."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        library = importlib.import_module(f"{self.__name__}.library")
        return getattr(library, self.__name__.rpartition(".")[2])(*arguments, **options)


def make_callable(room: str) -> None:
    """Let the package of that name be called: importing a part of it would otherwise hide a function of the same name."""
    sys.modules[room].__class__ = _Room
