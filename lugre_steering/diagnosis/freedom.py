# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One freedom of the friction law's form."""

from __future__ import annotations

from typing import NamedTuple

from lugre_steering.recording import Array


class Freedom(NamedTuple):
    """Shapes f (k, KNOTS) that a channel may have along a coordinate, at their largest; ``words``: what that is of the friction."""

    words: str
    channel: str
    coordinate: str
    low: float
    high: float
    shapes: Array
