# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How every figure of the project looks: white ground, open frame, units on every axis, captions inside the picture."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.counted import unparted
from lugre_steering.errors import LugreSteeringError
from lugre_steering.files import MAKER, refuse_foreign, replacing
from lugre_steering.provenance import Provenance, provenance

try:
    import matplotlib as mpl
    from cycler import cycler
    from matplotlib.figure import Figure
    from matplotlib.text import Text
    from matplotlib.ticker import MaxNLocator
except ImportError as error:
    raise LugreSteeringError("pictures need matplotlib: install 'lugre_steering[report]'") from error

MEASURED = {"color": "black", "linestyle": "-", "linewidth": 1.4}
IMPROVED = {"color": "#d62728", "linestyle": "--", "linewidth": 1.4}
ORIGINAL = {"color": "#1f4fb4", "linestyle": "-.", "linewidth": 1.4}
"""The paper's three curves: test black, improved LuGre red dashed, original LuGre blue dash-dot."""

SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#222222")
"""Colours for any other family of curves; told apart by readers with colour-deficient sight too (Okabe and Ito)."""

def whole_ticks(axis: Any) -> None:
    """Ticks at whole numbers only, for what is counted."""
    axis.set_major_locator(MaxNLocator(integer=True))


def family(labels: Sequence[str]) -> list[str]:
    """Colours for a family of curves: from dark to light where their labels begin with the numbers of an ordered quantity (rates,
    temperatures), else each its own."""
    if len(labels) > 2 and all(re.match(r"[-+]?\d", label) for label in labels):
        shades = mpl.colormaps["viridis"](np.linspace(0.0, 0.88, len(labels)))
        return [str(mpl.colors.to_hex(shade)) for shade in shades]
    return [SERIES[i % len(SERIES)] for i in range(len(labels))]


SHOWN = {"rad": (180.0 / math.pi, "deg"), "m": (1000.0, "mm")}
"""Coordinates on axes: factor and unit."""

RC: Any = {
    "figure.dpi": 110,
    "savefig.dpi": 130,
    "font.size": 10,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.prop_cycle": cycler(color=SERIES),
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.3,
    "text.parse_math": False,  # names may hold any character
}

_CAPTION_SIZE = 8.5
_LINE_INCHES = 0.165


@contextmanager
def figure(
    rows: int,
    columns: int,
    caption: str,
    file: Path,
    row_inches: float = 3.0,
    width: float = 10.0,
    words: Callable[[str], str] = str,
    made: Provenance | None = None,
) -> Iterator[Any]:
    """Axes (rows, columns) to draw on; on leaving, the caption is set below them and the picture is written to
    ``file``.

    The caption is also the description inside the file, which says who made it: a picture of anybody else is never
    replaced (``DataError``). ``words`` is applied to all text (a linear axis has forces where
    others have torques); ``made``, how the result came about, goes into the file. The figure grows with its caption, so no
    line of it is ever cut off.
    """
    refuse_foreign([file])
    said = unparted(words(caption))
    lines = [line for paragraph in said.split("\n") for line in textwrap.wrap(paragraph, int(width * 15.5)) or [""]]
    below = _LINE_INCHES * len(lines) + 0.15
    height = rows * row_inches + below
    with mpl.rc_context(RC):
        fig = Figure(figsize=(width, height))  # without pyplot, whose windows and backend are the user's
        yield fig.subplots(rows, columns, squeeze=False)
        for axis in (axis for ax in fig.axes for axis in (ax.xaxis, ax.yaxis) if axis.get_scale() == "log"):
            axis.set_major_formatter("{x:g}")  # the usual one writes mathematics, which is not parsed here
            low, high = sorted(axis.get_view_interval())
            decades = math.floor(math.log10(high)) - math.ceil(math.log10(low)) + 1
            axis.set_minor_formatter("" if decades > 1 else "{x:g}")  # one number alone is no scale
        for text in fig.findobj(Text):
            text.set_text(words(text.get_text()))
        fig.tight_layout(rect=(0.0, below / height, 1.0, 1.0))
        fig.set_layout_engine(None)  # it is laid out: with an engine left in place, all would be drawn once more before it is saved
        fig.text(0.015, (below - 0.05) / height, "\n".join(lines), fontsize=_CAPTION_SIZE, va="top", color="#333333")
        with replacing(file) as stream:
            origin = "\n".join((made or provenance("figure", {})).lines())
            metadata = {"Software": MAKER, "Description": words(caption), "Comment": origin}
            fig.savefig(stream, format="png", metadata=metadata)
