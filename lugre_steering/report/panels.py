# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Pictures for a program or a notebook: figures of pyplot, on whatever backend its user has chosen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lugre_steering.recording import Array
from lugre_steering.report import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLES: dict[str, dict[str, Any]] = {"measured": style.MEASURED, "improved": style.IMPROVED, "original": style.ORIGINAL}


@dataclass(frozen=True)
class Curve:
    """A line: ``x`` (n,), ``y`` (n,), its name, and one of ``STYLES`` if it has a fixed one."""

    x: Array
    y: Array
    label: str
    style: str = ""


@dataclass(frozen=True)
class Panel:
    """One pair of axes over time: title, unit, curves, and stretches [s] to shade."""

    title: str
    unit: str
    curves: list[Curve]
    shaded: Sequence[tuple[float, float]] = ()


def panels(rows: Sequence[Panel], below: Sequence[Callable[[Axes], None]] = ()) -> Figure:
    """Panels one below the other, over time [s], and ``below`` them what draws itself; the figure."""
    count = len(rows) + len(below)
    with _figure(count, 2.1 * count) as (fig, axes):
        for draw, ax in zip(below, axes[len(rows) :], strict=True):
            draw(ax)
        for ax, panel in zip(axes, rows, strict=False):
            for curve in panel.curves:
                ax.plot(curve.x, curve.y, label=curve.label, **STYLES.get(curve.style, {}))
            for start, end in panel.shaded:
                ax.axvspan(start, end, color=style.SERIES[2], alpha=0.13, linewidth=0)
            ax.set_title(panel.title)
            ax.set_ylabel(panel.unit)
            ax.margins(x=0.0)
            ax.legend(ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
        axes[len(rows) - 1].set_xlabel("time (s)")
    return fig


def intervals(title: str, label: str, rows: Sequence[tuple[str, float, tuple[float, float]]]) -> Figure:
    """A named value with its interval per row, and a line at one; the figure."""
    with _figure(1, 1.2 + 0.4 * len(rows)) as (fig, (ax,)):
        for i, (_, value, (low, high)) in enumerate(rows):
            ax.errorbar(value, i, xerr=[[value - low], [high - value]], fmt="o", color=style.SERIES[0], capsize=4)
        ax.axvline(1.0, color="#888888", linewidth=0.8)
        ax.set_yticks(range(len(rows)), [name for name, _, _ in rows])
        ax.set_ylim(len(rows) - 0.5, -0.5)
        ax.set_title(title)
        ax.set_xlabel(label)
    return fig


@contextmanager
def _figure(rows: int, height: float) -> Iterator[tuple[Figure, Any]]:
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    with mpl.rc_context(style.RC):
        fig, axes = plt.subplots(rows, 1, figsize=(10.0, height), squeeze=False, layout="constrained")
        yield fig, axes[:, 0]
    if "inline" in mpl.get_backend():
        plt.close(fig)  # a notebook shows the value of the cell; left open, it would show the figure a second time
