# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Figures and tables of the published experiments, in the paper's style."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from lugre_steering.files import COMMENT_MARK, comments, write_text
from lugre_steering.provenance import Provenance
from lugre_steering.report import words
from lugre_steering.simulate.paper.outcome import Outcome
from lugre_steering.terminal import Prose


def draw_outcome(outcome: Outcome, file: Path, made: Provenance | None = None) -> None:
    """All panels one below the other; what was calibrated, what was checked and where it disagrees stands in the
    picture, and in its metadata how it came about (``made``)."""
    from lugre_steering.report.style import (  # needs matplotlib
        IMPROVED,
        MEASURED,
        ORIGINAL,
        family,
        figure,
        whole_ticks,
    )

    styles: dict[str, dict[str, Any]] = {
        "test": MEASURED,
        "improved": IMPROVED,
        "original": ORIGINAL,
        "points": {"color": "black", "linestyle": "none", "marker": "o", "markersize": 5},
        "series": {},
    }
    with figure(len(outcome.panels), 1, outcome.caption, file, made=made) as axes:
        for ax, panel in zip(axes[:, 0], outcome.panels, strict=True):
            colours = iter(family([curve.label for curve in panel.curves if not styles[curve.style]]))
            for curve in panel.curves:
                style = styles[curve.style] or {"color": next(colours)}
                marker = {"marker": "o", "markersize": 4} if 2 < len(curve.x) < 10 and curve.style != "points" else {}
                ax.plot(curve.x, curve.y, label=curve.label, **style, **marker)
            if all(float(x).is_integer() for curve in panel.curves for x in curve.x):
                whole_ticks(ax.xaxis)  # what is counted has no halves
            ax.set_title(panel.title)
            ax.set_xlabel(panel.x_label)
            ax.set_ylabel(panel.y_label)
            if len(panel.curves) > 1:
                ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def write_table(outcome: Outcome, file: Path, made: Provenance | None = None) -> None:
    """The table as CSV; comments before it say that it is simulated, and how it came about (``made``)."""
    text = io.StringIO()
    text.write(f"{COMMENT_MARK}; simulated\n{comments(made.lines() if made else ())}")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(outcome.columns)
    writer.writerows([[f"{cell:.6g}" if isinstance(cell, float) else cell for cell in row] for row in outcome.rows])
    write_text(text.getvalue(), file)


def outcome_table(outcome: Outcome) -> Table:
    """The table for a terminal."""
    table = Table(title=f"{outcome.title} (simulated)", title_justify="left", title_style="bold")
    for column in outcome.columns:
        table.add_column(column, justify="right")
    for row in outcome.rows:
        table.add_row(*(_number(cell) if isinstance(cell, float) else str(cell) for cell in row))
    return table


def checks_table(outcomes: Sequence[Outcome]) -> Table:
    """Pass or fail of every published statement."""
    table = Table(title="Published behaviour", title_justify="left", title_style="bold", show_lines=True)
    table.add_column("experiment", no_wrap=True)
    for column in ("statement", "published", "ours"):
        table.add_column(column, overflow="fold")
    table.add_column("", no_wrap=True)
    for outcome in outcomes:
        for check in outcome.checks:
            verdict = Text("pass", "green") if check.passed else Text("FAIL", "red")
            table.add_row(outcome.name.removeprefix("paper-"), check.claim, check.published, Prose(check.ours), verdict)
    return table


def _number(value: float) -> str:
    return words.number(value, 5 if abs(value) >= 1000.0 else 3)
