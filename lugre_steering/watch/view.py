# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What ``watch`` shows of a live estimator in a terminal: numbers, their last minute as a line, health. Knows no ROS."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from rich.console import Console, Group
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from lugre_steering.report.words import number
from lugre_steering.watch.seen import SHOWN_S, Arrived, Line

LEVELS = ("ok", "warning", "error", "stale")
COLOURS = ("green", "yellow", "red", "magenta")
BARS = "▁▂▃▄▅▆▇█"
PLAIN_BARS = "_.-=*#%@"
STALE_S = 2.0
REFRESH_S = 0.25


def spark(values: Sequence[float], bars: str = BARS) -> str:
    """A line of characters between the smallest and the largest value, a blank where there is none."""
    known = [value for value in values if not math.isnan(value)]
    low, span = min(known, default=0.0), max(known, default=0.0) - min(known, default=0.0)
    top = len(bars) - 1
    return "".join(" " if math.isnan(v) else bars[round((v - low) / span * top) if span else top // 2] for v in values)


def view(seen: Arrived, now_s: float, ascii_only: bool = False) -> Panel:
    """One screen."""
    numbers = Table(box=None, pad_edge=False)
    for column in ("", "now", "unit", f"last {SHOWN_S:.0f} s", "from", "to"):
        numbers.add_column(column, justify="right" if column in ("now", "from", "to") else "left", no_wrap=column != "")
    for name, line in sorted(seen.lines.items(), key=_order):
        columns = line.columns(now_s)
        now = number(line.values[-1][1], 3) if line.values else "-"
        ends = (number(end, 3) for end in line.ends(now_s))
        numbers.add_row(Text(name), now, Text(line.unit), Text(spark(columns, PLAIN_BARS if ascii_only else BARS)), *ends)
    parts: list[Table | Text] = [numbers if seen.lines else Text("nothing has come yet: is the node running, under this name?")]
    if seen.health:
        parts.append(_health(seen.health))
    age = now_s - seen.latest_s
    late = f", silent for {age:.0f} s" if STALE_S < age < math.inf else ""
    return Panel(Group(*parts), title=Text(f"{seen.node}{late}"), border_style="red" if late else "none")


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


@contextmanager
def showing(console: Console) -> Iterator[Callable[[Arrived], None]]:
    """Call it as often as wanted: a terminal shows the newest screen in place, a pipe gets the last one in the end."""
    ascii_only = not console.encoding.startswith("utf")
    if not console.is_terminal:
        last: deque[Arrived] = deque(maxlen=1)
        yield last.append
        for seen in last:
            console.print(view(seen, time.monotonic(), ascii_only))
        return
    with Live(console=console, auto_refresh=False) as live:
        shown = -math.inf

        def show(seen: Arrived) -> None:
            nonlocal shown
            now_s = time.monotonic()
            if now_s - shown > REFRESH_S:
                shown = now_s
                live.update(view(seen, now_s, ascii_only), refresh=True)

        yield show
