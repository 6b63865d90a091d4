# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Charts of a page as plain data: panels one below the other over one x axis. ``static/charts.js`` draws them.

Colours are names of styles in ``static/page.css`` (measured, baseline, augmented, ..., or a number of the series), so that a page is
right on light and on dark ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np

from lugre_steering.recording import Array
from lugre_steering.report import words

DOT_ROOM = 0.03
"""Share of the x range left free on either side of points, which would be cut in halves at its ends."""


@dataclass(frozen=True)
class Series:
    """A curve (``line``), points (``dots``) or a band (``area``, from ``low`` to ``y``), each (n,); without x in even steps of ``dx``."""

    name: str
    style: str
    y: Array
    x: Array | None = None
    start: float = 0.0
    dx: float = 1.0
    low: Array | None = None
    dots: bool = False

    def plain(self) -> dict[str, Any]:
        at = {"x0": round(self.start, 4), "dx": self.dx} if self.x is None else {"x": rounded(self.x)}
        lower = {} if self.low is None else {"low": rounded(self.low)}
        kind = "area" if self.low is not None else "dots" if self.dots else "line"
        return {"name": self.name, "kind": kind, "style": self.style, **at, "y": rounded(self.y), **lower}


@dataclass(frozen=True)
class Panel:
    """Axes of ``size`` times the usual height; ``band``: half the height of a grey band about zero; ``like``: the panel whose y range
    it takes."""

    title: str
    unit: str
    series: list[Series]
    size: float = 2.0
    band: float | None = None
    like: int | None = None

    def plain(self) -> dict[str, Any]:
        extra = {key: value for key, value in (("band", self.band), ("like", self.like)) if value is not None}
        series = [series.plain() for series in self.series]
        return {"label": words.labelled(self.title, self.unit), "size": self.size, "series": series, **extra}


@dataclass(frozen=True)
class Spans:
    """Stretches of x marked on top of the panels and, if wanted, shaded in them."""

    name: str
    style: str
    at: Sequence[tuple[float, float]]
    shade: bool = False


@dataclass(frozen=True)
class Chart:
    """Panels over one x axis; ``label`` has its unit; ``since``: instant from which x counts days, shown as dates."""

    label: str
    panels: list[Panel]
    spans: list[Spans] = field(default_factory=list)
    since: datetime | None = None

    def plain(self) -> dict[str, Any]:
        """As the page holds it."""
        ends = [end for panel in self.panels for series in panel.series for end in _ends(series)]
        spans = [
            {"name": s.name, "style": s.style, "shade": s.shade, "at": [[round(a, 3), round(b, 3)] for a, b in s.at]}
            for s in self.spans
            if s.at
        ]
        low, high = min(ends, default=0.0), max(ends, default=1.0)
        aside = DOT_ROOM * (high - low) * any(series.dots and series.x is not None for panel in self.panels for series in panel.series)
        since = {} if self.since is None else {"since": round(1e3 * self.since.timestamp())}
        return {"label": self.label, "range": [low - aside, high + aside], **since,
                "panels": [panel.plain() for panel in self.panels], "spans": spans}  # fmt: skip


def curve(name: str, style: str, time: Array, values: Array, scale: float, limit: int) -> Series:
    """A curve over even steps of time [s] in at most about ``limit`` points, peaks kept; values in SI times ``scale``."""
    points, width = words.thin(values, limit)
    return Series(name, style, points * scale, start=float(time[0]), dx=width * float(time[1] - time[0]))


def rounded(values: Array) -> list[float | None]:
    """Numbers for the page: five significant digits of the largest, None where there is none."""
    top = float(np.nanmax(np.abs(values))) if values.size and not np.isnan(values).all() else 0.0
    decimals = 4 - math.floor(math.log10(top)) if top > 0.0 else 0
    return [None if v != v else v for v in np.round(values, decimals).tolist()]


def _ends(series: Series) -> tuple[float, ...]:
    if series.x is None:
        return series.start, series.start + series.dx * (series.y.size - 1)
    return (float(np.nanmin(series.x)), float(np.nanmax(series.x))) if np.isfinite(series.x).any() else ()
