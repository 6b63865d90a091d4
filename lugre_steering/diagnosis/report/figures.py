# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The pictures of a diagnosis as PNG."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering import units
from lugre_steering.diagnosis.report import plots, shown
from lugre_steering.diagnosis.report.laws import draw_law
from lugre_steering.diagnosis.result import BagTrace, Diagnosis, picture_names
from lugre_steering.report import words
from lugre_steering.report.style import IMPROVED, MEASURED, ORIGINAL, figure

EVIDENCE_ROWS = 14
"""As many as a picture shows legibly."""
POINTS = 6000
"""Of a curve: more than a picture has pixels."""


def draw_all(diagnosis: Diagnosis, folder: Path) -> list[Path]:
    """Every picture that this diagnosis has something to show in."""
    wanted: list[tuple[str, Callable[[Path], None]]] = [
        (f"before_after_{trace.name}", partial(_before_after, diagnosis, trace)) for trace in diagnosis.traces
    ]
    wanted += [
        (f"residual_{effect['id']}", partial(_residual, diagnosis, effect))
        for effect in diagnosis.json["effects"]
        if any(effect["id"] in trace.contributions for trace in diagnosis.traces)
    ]
    if diagnosis.evidence:
        wanted.append(("evidence", partial(_evidence, diagnosis)))
    wanted += [(f"law_{law.id}", partial(draw_law, diagnosis, law)) for law in diagnosis.laws]
    if plots.styles(diagnosis) and plots.heldout_rows(diagnosis):
        wanted.append(("heldout", partial(_heldout, diagnosis)))
    found = []
    for (_, picture), file in zip(wanted, picture_names([name for name, _ in wanted]), strict=True):
        picture(folder / file)
        found.append(folder / file)
    return found


def _colours(diagnosis: Diagnosis) -> dict[str, str]:
    return shown.effect_colours(list(plots.styles(diagnosis)))


def _before_after(diagnosis: Diagnosis, trace: BagTrace, file: Path) -> None:
    colour, vehicle = _colours(diagnosis), diagnosis.vehicle
    parts = {name: part for name, part in trace.contributions.items() if name in colour}
    torque, left = (words.torque_axis(vehicle, v) for v in (trace.measured, trace.measured - trace.baseline))
    added = words.torque_axis(vehicle, *parts.values())
    caption = f"Bag {trace.name}. {diagnosis.json['statement']}"
    if parts:
        caption += " Shaded: where an effect acts (unless it acts nearly everywhere)."

    def line(ax: Any, values: Any, scale: float, **style: Any) -> None:
        points, width = words.thin(values, POINTS)
        ax.plot(
            trace.time[0] + np.arange(points.size) * width * (trace.time[1] - trace.time[0]), points * scale, **style
        )

    said = partial(units.words, vehicle)
    with figure(3 if parts else 2, 1, caption, file, row_inches=2.2, words=said, made=diagnosis.provenance) as axes:
        top, middle = axes[0, 0], axes[1, 0]
        line(top, trace.measured, torque.scale, **MEASURED, label="measured")
        line(top, trace.baseline, torque.scale, **ORIGINAL, label="recalibrated baseline")
        line(
            middle,
            trace.measured - trace.baseline,
            left.scale,
            **{**ORIGINAL, "linestyle": "-", "linewidth": 0.9},
            label="before",
        )
        if parts:
            line(top, trace.augmented, torque.scale, **IMPROVED, label="with the effects found")
            after = trace.measured - trace.augmented
            line(middle, after, left.scale, **{**IMPROVED, "linestyle": "-", "linewidth": 0.9}, label="after")
        for ax, title, unit in ((top, "torque", torque.unit), (middle, "residual", left.unit)):
            ax.set_title(title)
            ax.set_ylabel(unit)
        for name, part in parts.items():
            line(axes[2, 0], part, added.scale, color=colour[name], label=plots.titles(diagnosis)[name])
            for ax in axes[:, 0] if shown.is_local(trace, name) else ():
                for start, end in trace.intervals[name]:
                    ax.axvspan(start, end, color=colour[name], alpha=0.13, linewidth=0)
        if parts:
            axes[2, 0].set_title("what each effect adds")
            axes[2, 0].set_ylabel(added.unit)
        for ax in axes[:, 0]:
            ax.set_xlim(float(trace.time[0]), float(trace.time[-1]))
            ax.legend(ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
        axes[-1, 0].set_xlabel("time since the first stamp (s)")


def _residual(diagnosis: Diagnosis, effect: dict[str, Any], file: Path) -> None:
    cloud, colour = plots.Cloud.of(diagnosis, effect), _colours(diagnosis)[effect["id"]]
    x, scale = cloud.x * cloud.axis.scale, cloud.torque.scale
    lx, ly = words.broken(x, cloud.law)
    caption = (
        f"{effect['statement']} Left: blue, what the recalibrated baseline leaves over; grey, what the rest of the "
        "augmented model leaves to this effect; line, its fitted law. Right: what is left with everything found; band, "
        "two noise floors."
    )
    with figure(1, 2, caption, file, row_inches=3.4, words=partial(units.words, diagnosis.vehicle), made=diagnosis.provenance) as axes:
        before, after = axes[0]
        before.plot(x, cloud.before * scale, ".", markersize=2, color="#a9bce6", rasterized=True)
        before.plot(x, cloud.partial * scale, ".", markersize=2, color="#5b6169", rasterized=True)
        before.plot(lx, ly * scale, color=colour, linewidth=1.8)
        after.plot(x, cloud.after * scale, ".", markersize=2, color=shown.AUGMENTED, rasterized=True)
        floor = 2.0 * diagnosis.json["noise_floor_Nm"] * scale
        after.axhspan(-floor, floor, color=shown.QUIET, alpha=0.25, linewidth=0)
        after.set_ylim(before.get_ylim())
        for ax, title in ((before, "before, with the fitted law"), (after, "after")):
            ax.set_title(title)
            ax.set_xlabel(cloud.axis.label)
            ax.set_ylabel(cloud.torque.unit)


def _evidence(diagnosis: Diagnosis, file: Path) -> None:
    rows = diagnosis.evidence[:EVIDENCE_ROWS]
    colour = _colours(diagnosis)
    caption = (
        "Share of the residual's energy that each candidate's fingerprint could explain before any fit (bar), and by "
        "how much the fit that tried it lowered the held-out error (diamond; at 0: not at all; none: not tried)."
    )
    with figure(1, 1, caption, file, row_inches=0.7 + 0.42 * len(rows), made=diagnosis.provenance) as axes:
        ax = axes[0, 0]
        for i, row in enumerate(rows):
            shade = colour.get(row.label.split("[")[0], "#c4c8ce") if row.verdict == "named" else "#c4c8ce"
            ax.barh(i, 100.0 * row.energy_share, color=shade, height=0.6)
            if row.heldout_gain is not None:
                ax.plot(100.0 * max(row.heldout_gain, 0.0), i, "D", color="black", markersize=5, clip_on=False)
        ax.set_yticks(range(len(rows)), [f"{row.title} {''.join(row.label.partition('[')[1:])}\n({row.verdict})" for row in rows])
        ax.set_ylim(len(rows) - 0.4, -0.6)
        ax.set_xlim(left=0.0)
        ax.set_xlabel("%")
        ax.grid(axis="y", visible=False)
        ax.set_title("evidence")


def _wrapped(name: str) -> str:
    """The name of a bag in short lines, broken behind its underscores."""
    return "\n".join(line.replace("_ ", "_") for line in textwrap.wrap(name.replace("_", "_ "), 22))


def _heldout(diagnosis: Diagnosis, file: Path) -> None:
    rows, unit = plots.heldout_rows(diagnosis), diagnosis.vehicle.coordinate.force_unit
    floor = diagnosis.json["noise_floor_Nm"]
    caption = (
        "Error on stretches that neither search nor fit saw, before and after; bar: 95 % interval of the improvement."
    )
    with figure(1, 1, caption, file, row_inches=3.4, width=min(max(7.0, 2.0 * len(rows)), 20.0), made=diagnosis.provenance) as axes:
        ax = axes[0, 0]
        for i, (_, before, after, spread) in enumerate(rows):
            ax.bar(i - 0.18, before, 0.34, color=shown.BASELINE, label="recalibrated baseline" if i == 0 else None)
            ax.bar(i + 0.18, after, 0.34, color=shown.AUGMENTED, label="with the effects found" if i == 0 else None)
            if spread is not None:
                ends = [[max(after - spread[0], 0.0)], [max(spread[1] - after, 0.0)]]
                ax.errorbar(i + 0.18, after, yerr=ends, color="black", capsize=5, linewidth=1.4)
        ax.axhline(
            floor, color="black", linestyle=":", linewidth=1.2, label=f"noise floor {words.number(floor, 3)} {unit}"
        )
        ax.set_xticks(range(len(rows)), [_wrapped(row[0]) for row in rows])
        ax.set_xlim(-0.7, max(len(rows) - 0.3, 0.7))
        ax.set_ylabel(f"held-out RMSE ({unit})")
        ax.grid(axis="x", visible=False)
        ax.legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
