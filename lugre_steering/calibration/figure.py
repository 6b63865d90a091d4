# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Picture of a calibration: each parameter with its interval, and the torque of each bag before and after."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering import units
from lugre_steering.calibration.calibrate import Calibrated
from lugre_steering.fitting.doubt import NORMAL
from lugre_steering.fitting.keys import KEYS
from lugre_steering.report.style import IMPROVED, MEASURED, ORIGINAL, SERIES, figure

BAGS_SHOWN = 3


def draw_calibration(done: Calibrated, file: Path) -> None:
    """Write the picture as PNG."""
    problem, result = done.problem, done.result
    unit = problem.vehicle.coordinate.force_unit
    sheet = problem.predict_all(problem.start())
    runs = problem.runs[:BAGS_SHOWN]
    caption = f"Vehicle: {problem.vehicle.name}. {result['statement']}"
    if len(problem.runs) > len(runs):
        caption += f" {len(problem.runs) - len(runs)} more bags were fitted and are not drawn."
    with figure(
        1 + 2 * len(runs), 1, caption, file, row_inches=2.1, words=partial(units.words, problem.vehicle), made=done.calibration.provenance
    ) as axes:
        _parameters(axes[0, 0], result["parameters"])
        for bag, run in enumerate(runs):
            torque, residual = axes[1 + 2 * bag, 0], axes[2 + 2 * bag, 0]
            part = slice(problem.edges[bag], problem.edges[bag + 1])
            time = run.time - run.time[0]
            calibrated = done.estimate.fit.prediction[part]
            torque.plot(time, run.measured * 1e-3, **MEASURED, label="measured")
            torque.plot(time, sheet[part] * 1e-3, **ORIGINAL, label="sheet")
            torque.plot(time, calibrated * 1e-3, **IMPROVED, label="calibrated")
            torque.set_title(f"torque, bag {run.name}")
            # Broad and pale below, thin above: where both run along each other, both are seen.
            residual.plot(time, (run.measured - sheet[part]) * 1e-3, color=ORIGINAL["color"], lw=3.0, alpha=0.4, label="sheet")
            residual.plot(time, (run.measured - calibrated) * 1e-3, color=IMPROVED["color"], lw=0.8, label="calibrated")
            residual.set_title(f"residual, bag {run.name}")
            for ax in (torque, residual):
                ax.set_xlim(0.0, float(time[-1]))
                ax.set_xlabel("time (s)")
                ax.set_ylabel(f"k{unit}")
                ax.legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)


def _parameters(ax: Any, rows: list[dict[str, Any]]) -> None:
    """Value over sheet with 95 % interval, where the sheet has one; grey: the sheet's own 95 %."""
    rows = [row for row in rows if row["sheet"]]
    for i, row in enumerate(rows):
        value, (low, high) = row["value"] / row["sheet"], sorted(end / row["sheet"] for end in row["ci95"])
        if row["prior_relative_sd"]:
            reach = np.exp(NORMAL * row["prior_relative_sd"])
            ax.plot([1.0 / reach, reach], [i, i], color="#dddddd", linewidth=9.0, solid_capstyle="butt")
        weak = row["at_bound"] or row["prior_dominated"]
        colour = SERIES[1] if weak else SERIES[0]
        ax.errorbar(value, i, xerr=[[value - low], [high - value]], fmt="o", color=colour, markersize=5, capsize=4)
    ax.axvline(1.0, color="#888888", linewidth=0.8)
    titles = {key.key: key.title for key in KEYS}
    ax.set_yticks(range(len(rows)), [titles.get(row["key"], row["key"]) for row in rows])
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ends = [end / row["sheet"] for row in rows for end in (row["value"], *row["ci95"])]
    ends += [np.exp(sign * NORMAL * row["prior_relative_sd"]) for row in rows if row["prior_relative_sd"] for sign in (-1, 1)]
    ax.set_xlim(max(0.2, min(0.6, min(ends) - 0.05)), min(3.0, max(1.4, max(ends) + 0.05)))
    sheet = ", grey: the sheet's own" if any(row["prior_relative_sd"] for row in rows) else ""
    ax.set_title(f"95 % intervals{sheet}; orange: hardly determined, or at a bound")
    ax.set_xlabel("value over sheet value")
