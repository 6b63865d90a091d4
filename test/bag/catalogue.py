# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The catalogue of physics, kept as it is while tests add to it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def put_back() -> Iterator[None]:
    """Physics that is added meanwhile is gone afterwards."""
    from lugre_steering.effects import registry

    known = [(table, dict(table)) for table in (registry.CATALOGUE, registry.ORIGINS)]
    files = os.environ.get(registry.VARIABLE)
    try:
        yield
    finally:
        for table, before in known:
            table.clear()
            table.update(before)  # type: ignore[arg-type]
        os.environ.pop(registry.VARIABLE, None)
        if files is not None:
            os.environ[registry.VARIABLE] = files
