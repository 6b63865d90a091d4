# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The interactive plots of a diagnosis as plain Plotly figures (data and layout), so that no Python plotting library is
needed to make them."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from lugre_steering.diagnosis.report import shown
from lugre_steering.diagnosis.report.shown import EFFECT_COLOURS
from lugre_steering.diagnosis.result import BagTrace, Diagnosis
from lugre_steering.recording import Array
from lugre_steering.report import words

Spec = dict[str, Any]

CURVE_POINTS = 24_000
"""Points per curve over all bags together: two minutes at 100 Hz twice, undecimated."""
CLOUD_POINTS = 5_000
MEASURED, BASELINE, AUGMENTED = "#111111", "#1f4fb4", "#d62728"
QUIET = "#8a8f98"

_FONT = {"family": "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif", "size": 13}
_GRID = {"gridcolor": "#e6e8eb", "zerolinecolor": "#c4c8ce", "linecolor": "#c4c8ce", "ticks": "outside",
         "tickcolor": "#c4c8ce", "ticklen": 4}  # fmt: skip


def plot_layout(**more: Any) -> Spec:
    return {
        "font": {**_FONT, "color": "#1b1f24"}, "paper_bgcolor": "white", "plot_bgcolor": "white",
        "hovermode": "closest", "margin": {"l": 78, "r": 18, "t": 34, "b": 48}, "legend": _legend(1.0), **more,
    }  # fmt: skip


def _legend(y: float, **more: Any) -> Spec:
    """One line above the plot."""
    return {"orientation": "h", "x": 0, "y": y, "yanchor": "bottom", **more}


def _note(text: str, **place: Any) -> Spec:
    return {"text": text, "xref": "paper", "showarrow": False, "font": {"size": 12, "color": "#5b6169"}, **place}


def plot_axis(title: str, **more: Any) -> Spec:
    return {**_GRID, "title": {"text": html.escape(title), "standoff": 8}, "automargin": True, **more}


def rounded(values: Array, scale: float = 1.0) -> list[float | None]:
    """Numbers for the page: five significant digits of the largest, None where there is none."""
    scaled = values * scale
    top = float(np.nanmax(np.abs(scaled))) if scaled.size and not np.isnan(scaled).all() else 0.0
    decimals = 4 - math.floor(math.log10(top)) if top > 0.0 else 0
    return [None if v != v else v for v in np.round(scaled, decimals).tolist()]


def colours(diagnosis: Diagnosis) -> dict[str, str]:
    """Colour of each named effect and each law found."""
    ids = [found["id"] for key in ("effects", "laws") for found in diagnosis.json.get(key, ())]
    return {name: EFFECT_COLOURS[i % len(EFFECT_COLOURS)] for i, name in enumerate(ids)}


def torque_plot(diagnosis: Diagnosis, trace: BagTrace) -> Spec:
    """One bag over time: torque, residual, and what each effect adds; stretches where an effect acts are shaded."""
    vehicle, colour = diagnosis.vehicle, colours(diagnosis)
    limit = CURVE_POINTS // len(diagnosis.traces)
    before, after = trace.measured - trace.baseline, trace.measured - trace.augmented
    torque = words.torque_axis(vehicle, trace.measured)
    left = words.torque_axis(vehicle, before)
    parts = {name: part for name, part in trace.contributions.items() if name in colour}
    added = words.torque_axis(vehicle, *parts.values())
    step = float(trace.time[1] - trace.time[0])

    def curve(values: Array, scale: float, axis: str, name: str, line: Spec, **more: Any) -> Spec:
        points, width = words.thin(values, limit)
        x = {"x0": round(float(trace.time[0]), 4), "dx": step * width}
        return {"type": "scatter", "mode": "lines", "name": name, "line": line, "xaxis": "x", "yaxis": axis, **x,
                "y": rounded(points, scale), "hoverlabel": {"namelength": -1}, **more}  # fmt: skip

    rows = [(0.56, 1.0), (0.27, 0.49), (0.0, 0.20)] if parts else [(0.42, 1.0), (0.0, 0.34)]
    old, new = {"color": BASELINE, "width": 1.3, "dash": "dashdot"}, {"color": AUGMENTED, "width": 1.5, "dash": "dash"}
    thin = {"width": 1.0, "dash": "solid"}
    data = [
        curve(trace.measured, torque.scale, "y", "measured", {"color": MEASURED, "width": 1.6}),
        curve(trace.baseline, torque.scale, "y", "recalibrated baseline", old),
        curve(before, left.scale, "y2", "before", old | thin, showlegend=False),
    ]
    if parts:
        data.insert(2, curve(trace.augmented, torque.scale, "y", "with the effects found", new))
        data.append(curve(after, left.scale, "y2", "after", new | thin, showlegend=False))
    shapes = _strip(0, stretches(trace.time, trace.held), QUIET)
    data += [_key(QUIET, 0.55, "held out from search and fit")] if shapes else []
    for lane, (name, part) in enumerate(parts.items(), 1):
        line = {"color": colour[name], "width": 1.5}
        data.append(curve(part, added.scale, "y3", f"torque of {html.escape(name)}", line, showlegend=False))
        data.append(_key(colour[name], 0.6, f"{html.escape(name)} acts"))
        shapes += _strip(lane, trace.intervals.get(name, ()), colour[name])
        if shown.is_local(trace, name):
            shapes += [_band(span, colour[name], 0.14) for span in trace.intervals[name]]
    time = plot_axis("time since the first stamp [s]", anchor="y3" if parts else "y2", domain=[0, 1])
    titles = [f"torque [{torque.label}]", f"residual [{left.label}]", f"effect [{added.label}]"]
    axes = {
        f"yaxis{'' if i == 0 else i + 1}": plot_axis(title, domain=list(row), fixedrange=False)
        for i, (title, row) in enumerate(zip(titles, rows, strict=False))
    }
    height = 740 if parts else 560
    return {
        "data": data,
        "layout": plot_layout(xaxis=time, **axes, shapes=shapes, height=height, hovermode="x unified",
                          legend=_legend(1.03 + 0.016 * len(parts)), margin={"l": 78, "r": 18, "t": 84, "b": 48}),
    }  # fmt: skip


def stretches(time: Array, mask: Array) -> list[tuple[float, float]]:
    """Intervals [s] over which a mask is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(mask).astype(int), [0]])))
    return [(float(time[a]), float(time[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _band(span: tuple[float, float], colour: str, opacity: float, y0: float = 0.0, y1: float = 1.0) -> Spec:
    return {
        "type": "rect", "xref": "x", "yref": "paper", "x0": round(span[0], 3), "x1": round(span[1], 3), "y0": y0,
        "y1": y1, "fillcolor": colour, "opacity": opacity, "line": {"width": 0}, "layer": "below",
    }  # fmt: skip


def _strip(lane: int, spans: Sequence[tuple[float, float]], colour: str) -> list[Spec]:
    """Solid bars above the plot, one lane per subject, so that overlapping stretches stay apart."""
    return [_band(span, colour, 0.6, y0=1.004 + 0.016 * lane, y1=1.016 + 0.016 * lane) for span in spans]


def _key(colour: str, opacity: float, name: str) -> Spec:
    """A legend entry for shaded bands."""
    marker = {"symbol": "square", "size": 13, "color": colour, "opacity": opacity}
    return {"type": "scatter", "mode": "markers", "x": [None], "y": [None], "marker": marker, "name": name}


def residual_plot(diagnosis: Diagnosis, effect: dict[str, Any]) -> Spec:
    """What one effect has to explain along its telling coordinate with the fitted law, and what is left with it."""
    cloud = Cloud.of(diagnosis, effect)
    colour = colours(diagnosis)[effect["id"]]

    def dots(y: Array, axis: str, name: str, mark: str) -> Spec:
        marker = {"color": mark, "size": 3.5, "opacity": 0.55}
        return {"type": "scatter", "mode": "markers", "name": name, "marker": marker, "xaxis": f"x{axis}",
                "yaxis": f"y{axis}", "x": rounded(cloud.x, cloud.axis.scale), "y": rounded(y, cloud.torque.scale),
                "hoverinfo": "skip"}  # fmt: skip

    x, y = words.broken(cloud.x, cloud.law)
    law = {
        "type": "scatter", "mode": "lines", "name": f"fitted law of {html.escape(effect['id'])}",
        "x": rounded(x, cloud.axis.scale), "y": rounded(y, cloud.torque.scale), "xaxis": "x", "yaxis": "y",
        "line": {"color": colour, "width": 2.2},
    }  # fmt: skip
    data = [
        dots(cloud.before, "", "residual of the recalibrated baseline", "#a9bce6"),
        dots(cloud.partial, "", "what the rest of the augmented model leaves to this effect", "#5b6169"),
        law,
        dots(cloud.after, "2", "residual with everything found", AUGMENTED),
    ]
    floor = diagnosis.json["noise_floor_Nm"] * cloud.torque.scale
    band = {"type": "rect", "xref": "paper", "yref": "y2", "x0": 0.55, "x1": 1, "y0": -2 * floor, "y1": 2 * floor,
            "fillcolor": QUIET, "opacity": 0.2, "line": {"width": 0}, "layer": "below"}  # fmt: skip
    note = _note("grey band: ± 2 noise floors", yref="paper", x=1, y=1.0, xanchor="right", yanchor="bottom")
    layout = plot_layout(
        xaxis=plot_axis(cloud.axis.label, domain=[0, 0.46], anchor="y"),
        xaxis2=plot_axis(cloud.axis.label, domain=[0.55, 1], anchor="y2", matches="x"),
        yaxis=plot_axis(f"before [{cloud.torque.label}]"),
        yaxis2=plot_axis(f"after [{cloud.torque.label}]", anchor="x2", matches="y"),
        height=430, shapes=[band], annotations=[note], legend=_legend(1.08, itemsizing="constant"),
        margin={"l": 78, "r": 18, "t": 70, "b": 48},
    )  # fmt: skip
    return {"data": data, "layout": layout}


class Cloud:
    """Samples of all bags along the telling coordinate of one effect, few enough to draw; all (n,)."""

    def __init__(self, name: str, axis: words.Axis, torque: words.Axis, columns: Array) -> None:
        self.name, self.axis, self.torque = name, axis, torque
        self.x, self.before, self.partial, self.after, self.law = columns

    @classmethod
    def of(cls, diagnosis: Diagnosis, effect: dict[str, Any]) -> Cloud:
        """Every k-th sample of each bag in which the effect has a torque."""
        key = effect["id"]
        traces = [trace for trace in diagnosis.traces if key in trace.contributions]
        told_by = diagnosis.coordinate_of.get(key, "")
        name = shown.law_coordinate(effect, told_by, traces[0].coordinates)
        stride = max(1, math.ceil(sum(trace.time.size for trace in traces) / CLOUD_POINTS))
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


def heldout_plot(diagnosis: Diagnosis) -> Spec | None:
    """Bars of the held-out error before and after, the noise floor as a line."""
    rows, unit = heldout_rows(diagnosis), diagnosis.vehicle.coordinate.force_unit
    if not rows or not colours(diagnosis):
        return None
    names = [html.escape(row[0]) for row in rows]
    reach = [
        (0.0, 0.0) if row[3] is None else (max(row[3][1] - row[2], 0.0), max(row[2] - row[3][0], 0.0)) for row in rows
    ]
    spread = {
        "type": "data",
        "array": [up for up, _ in reach],
        "arrayminus": [down for _, down in reach],
        "thickness": 2,
        "width": 7,
    }

    def bars(name: str, values: list[float], colour: str, **more: Any) -> Spec:
        text = [words.number(v, 3) for v in values]
        return {"type": "bar", "name": name, "x": names, "y": values, "marker": {"color": colour}, "text": text,
                "textposition": "outside", "textangle": 0, "cliponaxis": False, **more}  # fmt: skip

    data = [
        bars("recalibrated baseline", [row[1] for row in rows], BASELINE),
        bars("with the effects found", [row[2] for row in rows], AUGMENTED, error_y=spread),
    ]
    floor = diagnosis.json["noise_floor_Nm"]
    line = {"type": "line", "xref": "paper", "yref": "y", "x0": 0, "x1": 1, "y0": floor, "y1": floor,
            "line": {"color": MEASURED, "width": 1.3, "dash": "dot"}}  # fmt: skip
    text = f"noise floor<br>{words.number(floor, 3)} {html.escape(unit)}"
    note = _note(text, yref="y", x=1.01, y=floor, xanchor="left", yanchor="middle")
    layout = plot_layout(xaxis=plot_axis("", type="category", range=[-0.6, max(len(rows) - 0.4, 1.6)]),
                     yaxis=plot_axis(f"held-out RMSE [{unit}]", rangemode="tozero"), height=360,
                     shapes=[line], annotations=[note], bargap=0.35, margin={"l": 78, "r": 100, "t": 34, "b": 48})  # fmt: skip
    return {"data": data, "layout": layout}
