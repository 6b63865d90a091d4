# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The charts of a diagnosis: torque over time, and the residual along the coordinate that tells an effect."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from lugre_steering import units
from lugre_steering.diagnosis.report import shown
from lugre_steering.diagnosis.result import BagTrace, Diagnosis
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.recording import Array
from lugre_steering.report import words
from lugre_steering.report.chart import Chart, Panel, Series, Spans, curve

PAGE_POINTS = 150_000
"""Points of all curves over time on one page, which keeps it small enough to send."""
CURVE_POINTS = 12_000
"""Of one curve: two minutes at 100 Hz undecimated."""
CLOUD_POINTS = 3_000
"""Of one effect; those of all together are at most three times as many."""


def styles(diagnosis: Diagnosis) -> dict[str, str]:
    """Style of each named effect and each law found: the number of its colour."""
    return {found.id: str(i % len(shown.EFFECT_COLOURS)) for i, found in enumerate(diagnosis.found)}


def titles(diagnosis: Diagnosis) -> dict[str, str]:
    """What people call each named effect and each law found."""
    named = {effect.id: units.title(diagnosis.vehicle, CATALOGUE[effect.id]) for effect in diagnosis.effects}
    return named | {law.id: law.title for law in diagnosis.laws}


def torque_chart(diagnosis: Diagnosis, trace: BagTrace) -> Chart:
    """One bag over time: torque, residual, and what each effect adds; stretches where an effect acts are shaded."""
    vehicle, style, title = diagnosis.vehicle, styles(diagnosis), titles(diagnosis)
    parts = {name: part for name, part in trace.contributions.items() if name in style}
    limit = min(CURVE_POINTS, PAGE_POINTS // (len(diagnosis.traces) * (5 + len(parts))))
    before, after = trace.measured - trace.baseline, trace.measured - trace.augmented
    torque, left = words.torque_axis(vehicle, trace.measured), words.torque_axis(vehicle, before)
    added = words.torque_axis(vehicle, *parts.values())

    def over_time(name: str, look: str, values: Array, axis: words.Axis) -> Series:
        return curve(name, look, trace.time, values, axis.scale, limit)

    panels = [
        Panel("torque", torque.unit, [
            over_time("measured", "measured", trace.measured, torque),
            over_time("recalibrated baseline", "baseline", trace.baseline, torque),
        ], size=3.0),
        Panel("residual", left.unit, [over_time("recalibrated baseline", "before", before, left)], size=1.6),
    ]  # fmt: skip
    if parts:
        panels[0].series.append(over_time("with what was found", "augmented", trace.augmented, torque))
        panels[1].series.append(over_time("with what was found", "after", after, left))
        panels.append(Panel("what each finding adds", added.unit, [
            over_time(title[name], style[name], part, added) for name, part in parts.items()
        ], size=1.4))  # fmt: skip
    spans = [Spans("held out from search and fit", "held", stretches(trace.time, trace.held))]
    spans += [Spans(title[name], style[name], trace.intervals.get(name, ()), shown.is_local(trace, name)) for name in parts]
    return Chart("time since the first stamp (s)", panels, spans)


def stretches(time: Array, mask: Array) -> list[tuple[float, float]]:
    """Intervals [s] over which a mask is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(mask).astype(int), [0]])))
    return [(float(time[a]), float(time[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def residual_chart(diagnosis: Diagnosis, effect: Mapping[str, Any]) -> Chart:
    """What one effect has to explain along its telling coordinate with the fitted law, and what is left with it."""
    cloud, style = Cloud.of(diagnosis, effect), styles(diagnosis)[effect["id"]]
    x, y = words.broken(cloud.x, cloud.law)
    scale, along = cloud.torque.scale, cloud.x * cloud.axis.scale
    before = [
        Series("residual of the recalibrated baseline", "cloud", cloud.before * scale, along, dots=True),
        Series("what the rest of the model leaves to this effect", "rest", cloud.partial * scale, along, dots=True),
        Series("its fitted law", style, y * scale, x * cloud.axis.scale),
    ]
    after = [Series("residual with everything found", "after", cloud.after * scale, along, dots=True)]
    floor = 2.0 * diagnosis.json["noise_floor_Nm"] * scale
    return Chart(cloud.axis.label, [
        Panel("before", cloud.torque.unit, before, size=2.4),
        Panel("after; grey: two noise floors", cloud.torque.unit, after, size=2.4, band=floor, like=0),
    ])  # fmt: skip


class Cloud:
    """Samples of all bags along the telling coordinate of one effect, few enough to draw; all (n,)."""

    def __init__(self, name: str, axis: words.Axis, torque: words.Axis, columns: Array) -> None:
        self.name, self.axis, self.torque = name, axis, torque
        self.x, self.before, self.partial, self.after, self.law = columns

    @classmethod
    def of(cls, diagnosis: Diagnosis, effect: Mapping[str, Any]) -> Cloud:
        """Every k-th sample of each bag in which the effect has a torque."""
        key = effect["id"]
        traces = [trace for trace in diagnosis.traces if key in trace.contributions]
        told_by = diagnosis.coordinate_of.get(key, "")
        name = shown.law_coordinate(effect, told_by, traces[0].coordinates)
        points = min(CLOUD_POINTS, 3 * CLOUD_POINTS // len(diagnosis.json["effects"]))
        stride = max(1, math.ceil(sum(trace.time.size for trace in traces) / points))
        columns = np.concatenate(
            [
                np.stack([t.coordinates[name], t.measured - t.baseline, t.measured - t.augmented + t.contributions[key],
                          t.measured - t.augmented, t.contributions[key]])[:, ::stride]
                for t in traces
            ],
            axis=1,
        )  # fmt: skip
        axis = words.coordinate_axis(diagnosis.vehicle, name)
        return cls(name, axis, words.torque_axis(diagnosis.vehicle, *columns[1:]), columns)


def heldout_rows(diagnosis: Diagnosis) -> list[tuple[str, float, float, tuple[float, float] | None]]:
    """Held-out RMSE before and after: name, before, after, 95 % interval of after given before (for all bags only)."""
    json, rows = diagnosis.json, []
    before, after = json["baseline"]["heldout_rmse_Nm"], json["augmented"]["heldout_rmse_Nm"]
    if before is not None and after is not None:
        ends, spread = json["augmented"]["improvement_ci95"], None
        if ends is not None and None not in ends:
            spread = (before * (1.0 - ends[1]), before * (1.0 - ends[0]))
        rows.append(("all bags" if len(diagnosis.traces) > 1 else "held-out data", before, after, spread))
    if len(diagnosis.traces) > 1:
        rows += [(trace.name, *trace.heldout_Nm, None) for trace in diagnosis.traces if trace.heldout_Nm is not None]
    return rows
