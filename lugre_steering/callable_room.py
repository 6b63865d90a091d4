# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Rooms that are named like what they do, and do it when called: ``lugre_steering.replay(...)``."""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any


class _Room(ModuleType):
    """A package that is called like the function of its name in its ``library`` module, which is loaded only then."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self._function(*arguments, **options)

    @property
    def _function(self) -> Callable[..., Any]:
        library = importlib.import_module(f"{self.__name__}.library")
        function: Callable[..., Any] = getattr(library, self.__name__.rpartition(".")[2])
        return function

    @property
    def __doc__(self) -> str | None:  # type: ignore[override]
        # No text of its own: it would stand in the place of this one.
        return self._function.__doc__

    @property
    def __signature__(self) -> inspect.Signature:
        """As help and editors show it."""
        return inspect.signature(self._function)


def make_callable(room: str) -> None:
    """Let the package of that name be called: importing a part of it would otherwise hide a function of the same name."""
    sys.modules[room].__class__ = _Room
