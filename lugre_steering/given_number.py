# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Numbers that a program gives: whatever else stands in their place is an error of ours, not one from the depths of arithmetic."""

from __future__ import annotations

import math
from numbers import Integral, Real

from lugre_steering.errors import DataError


def check_number(name: str, value: object, low: float, high: float = math.inf, *, whole: bool = False) -> None:
    """Refuse what is no number from ``low`` to ``high``, nan among it."""
    kind: type[Integral] | type[Real] = Integral if whole else Real
    if isinstance(value, kind) and not isinstance(value, bool) and low <= value <= high:  # type: ignore[operator]
        return
    above = f" to {high:g}" if high < math.inf else ""
    raise DataError(f"{name}: got {value!r}, expected a {'whole ' if whole else ''}number from {low:g}{above}")
