# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What every published experiment gives: a table, checks against the published behaviour, curves to draw, honest
notes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from lugre_steering.recording import Array

Style = Literal["test", "improved", "original", "series", "points"]
Cell = str | float


@dataclass(frozen=True)
class Curve:
    """One line of a panel; ``test``, ``improved`` and ``original`` are the paper's black, red dashed and blue
    dash-dot."""

    label: str
    x: Array
    y: Array
    style: Style = "series"


@dataclass(frozen=True)
class Panel:
    """One diagram: curves over a common axis."""

    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]


@dataclass(frozen=True)
class Check:
    """One published statement, what ours says, and whether it is accepted."""

    claim: str
    published: str
    ours: str
    passed: bool


@dataclass(frozen=True)
class Outcome:
    """Result of one experiment. ``calibrated`` names every parameter that was fitted and its value; ``notes`` say
    where our
    curves and the published text disagree and what had to be assumed."""

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    checks: tuple[Check, ...]
    panels: tuple[Panel, ...]
    calibrated: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        return all(check.passed for check in self.checks)

    @property
    def caption(self) -> str:
        """Text under the figure: what it is, what was calibrated, what was checked, where it disagrees."""
        fitted = ", ".join(f"{name} = {value:.5g}" for name, value in self.calibrated.items())
        lines = [f"{self.title}. Simulated (synthetic). Calibrated to the four published extremes: {fitted}."]
        lines += [
            f"{'PASS' if c.passed else 'FAIL'}: {c.claim} (published: {c.published}; ours: {c.ours})."
            for c in self.checks
        ]
        return "\n".join(lines + [f"Note: {note}" for note in self.notes])
