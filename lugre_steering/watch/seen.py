# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What has come from a live estimator of late."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

SHOWN_S, COLUMNS = 60.0, 15
MOST = 100_000
"""Values of one quantity in memory."""


@dataclass
class Line:
    """One quantity: its last value and those of the last minute, by time of arrival [s]."""

    unit: str
    values: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=MOST))

    def add(self, now_s: float, value: float) -> None:
        self.values.append((now_s, value))
        while self.values and now_s - self.values[0][0] > SHOWN_S:
            self.values.popleft()

    def ends(self, now_s: float) -> tuple[float, float]:
        """Smallest and largest value of the last minute; NaN where nothing came."""
        known = [value for when, value in self.values if now_s - when <= SHOWN_S and not math.isnan(value)]
        return min(known, default=math.nan), max(known, default=math.nan)

    def columns(self, now_s: float) -> list[float]:
        """The value farthest from zero in each column of the last minute; NaN where nothing came."""
        found = [math.nan] * COLUMNS
        for when, value in self.values:
            k = COLUMNS - 1 - int((now_s - when) / SHOWN_S * COLUMNS)
            if 0 <= k < COLUMNS and not abs(value) <= abs(found[k]):
                found[k] = value
        return found


@dataclass
class Arrived:
    """All that has come: lines by name, health by component as level and message, and when the last message came [s]."""

    node: str
    lines: dict[str, Line] = field(default_factory=dict)
    health: dict[str, tuple[int, str]] = field(default_factory=dict)
    latest_s: float = -math.inf

    def add(self, name: str, unit: str, now_s: float, value: float) -> None:
        self.latest_s = now_s
        self.lines.setdefault(name, Line(unit)).add(now_s, value)

    def diagnosed(self, now_s: float, statuses: Sequence[tuple[str, int, str]]) -> None:
        """Component, level and message of each status."""
        self.latest_s = now_s
        self.health.update({component: (level, message) for component, level, message in statuses})
