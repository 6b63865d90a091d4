# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What ``watch`` shows of a live estimator in a terminal: numbers, their last minute as a line, health."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rich.console import Group
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

LEVELS = ("ok", "warning", "error", "stale")
COLOURS = ("green", "yellow", "red", "magenta")
BARS = "▁▂▃▄▅▆▇█"
PLAIN_BARS = "_.-=*#%@"
SHOWN_S, COLUMNS = 60.0, 40
STALE_S = 2.0


@dataclass
class Line:
    """One quantity: its last value and those of the last minute, by time of arrival [s]."""

    unit: str
    values: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=100_000))

    def add(self, now_s: float, value: float) -> None:
        self.values.append((now_s, value))
        while self.values and now_s - self.values[0][0] > SHOWN_S:
            self.values.popleft()

    def columns(self, now_s: float) -> list[float]:
        """The value farthest from zero in each column of the last minute; NaN where nothing came."""
        found = [math.nan] * COLUMNS
        for when, value in self.values:
            k = COLUMNS - 1 - int((now_s - when) / SHOWN_S * COLUMNS)
            if 0 <= k < COLUMNS and not abs(value) <= abs(found[k]):
                found[k] = value
        return found


@dataclass
class State:
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


def spark(values: Sequence[float], bars: str = BARS) -> str:
    """A line of characters between the smallest and the largest value, a blank where there is none."""
    known = [value for value in values if not math.isnan(value)]
    low, span = min(known, default=0.0), max(known, default=0.0) - min(known, default=0.0)
    top = len(bars) - 1
    return "".join(" " if math.isnan(v) else bars[round((v - low) / span * top) if span else top // 2] for v in values)


def view(state: State, now_s: float, ascii_only: bool = False) -> Panel:
    """One screen."""
    numbers = Table(box=None, pad_edge=False)
    for column in ("", "now", "unit", f"last {SHOWN_S:.0f} s", "from", "to"):
        numbers.add_column(column, justify="right" if column in ("now", "from", "to") else "left", no_wrap=True)
    for name, line in sorted(state.lines.items(), key=_order):
        columns = line.columns(now_s)
        known = [value for value in columns if not math.isnan(value)]
        ends = (f"{min(known):.4g}", f"{max(known):.4g}") if known else ("-", "-")
        now = f"{line.values[-1][1]:.4g}" if line.values else "-"
        numbers.add_row(Text(name), now, Text(line.unit), Text(spark(columns, PLAIN_BARS if ascii_only else BARS)), *ends)
    parts: list[Table | Text] = [numbers if state.lines else Text("nothing has come yet: is the node running, under this name?")]
    if state.health:
        parts.append(_health(state.health))
    age = now_s - state.latest_s
    late = f", silent for {age:.0f} s" if STALE_S < age < math.inf else ""
    return Panel(Group(*parts), title=Text(f"{state.node}{late}"), border_style="red" if late else "none")


def _order(item: tuple[str, Line]) -> tuple[int, str]:
    first = ("torque", "cylinder torque", "residual")
    return (first.index(item[0]) if item[0] in first else len(first), item[0])


def _health(health: Mapping[str, tuple[int, str]]) -> Table:
    table = Table(box=None, pad_edge=False)
    for column in ("health", "", ""):
        table.add_column(column, overflow="fold")
    for component, (level, message) in sorted(health.items()):
        known = min(level, len(LEVELS) - 1)
        table.add_row(Text(component), Text(LEVELS[known], style=COLOURS[known]), Text(message))
    return table
