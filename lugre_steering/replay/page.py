# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Page of one replay: how well the model agrees, what was found about the recording, and curves to look into.

Its size does not grow with the recording: curves go through the smallest and the largest value of each of a fixed number of bins.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from lugre_steering.counted import counted
from lugre_steering.files import refuse_foreign, write_text
from lugre_steering.online import Curves, r2_words
from lugre_steering.provenance import Provenance
from lugre_steering.recording import Array
from lugre_steering.replay.result import ReplayedBag
from lugre_steering.report import words
from lugre_steering.report.chart import Chart, Panel, Series
from lugre_steering.report.markup import code, facts, table, text
from lugre_steering.report.origin import made_by
from lugre_steering.report.page import Charts, Section, Tone, in_words_of, render
from lugre_steering.vehicle import Vehicle

NOTABLE = 0.03
"""Error over the largest torque from which a diagnosis is worth its time."""


def write_page(bag: ReplayedBag, vehicle: Vehicle, motion: Curves, check: Curves, made: Provenance, file: Path) -> None:
    """``motion``: angle of each side, temperature of each side, estimated torque; ``check``: measured torque, residual."""
    refuse_foreign([file])
    charts = Charts()
    curves = charts.place(_chart(vehicle, motion, check), f"Angles, torques, residual and temperatures of bag {bag.name} over time")
    hint = '<p class="note">Drag or press + to zoom, double-click for everything; a name in the legend hides its curve.</p>\n'
    sections = [
        Section("curves", "Curves", "Torque, measured and estimated", hint + curves),
        Section("findings", "Findings", "About the recording", _findings(bag)),
        Section("samples", "Samples", "Samples used and rejected", _samples(bag)),
        Section("origin", "Origin", "How this result came about", made_by(made)),
    ]
    said = in_words_of(vehicle, [vehicle.name, bag.name])
    tone: Tone = "unsure" if bag.findings or bag.fit is None else "plain"
    page = render(f"Replay of {bag.name}", tone, _head(bag, vehicle), sections, charts, f"{made.tool}, {made.date}", said)
    write_text(page, file)


def _head(bag: ReplayedBag, vehicle: Vehicle) -> str:
    came = f"{counted(bag.estimates, 'torque', show=words.whole)} from {counted(bag.messages, 'message', show=words.whole)}"
    numbers, fit = [("recorded", f"{bag.duration_s:.1f} s", came)], bag.fit
    if fit is None:
        said = str(bag.fit_note)
    else:
        peak = max(abs(fit.peaks.cylinder_torque.max_Nm), abs(fit.peaks.cylinder_torque.min_Nm))
        share = fit.rmse_Nm / peak if peak > 0.0 else 0.0
        said = f"Estimate and measured torque differ by {words.torque(vehicle, fit.rmse_Nm)}, {words.percent(share)} of the largest torque."
        if share > NOTABLE:
            said += " What the model leaves out, or what is wrong with the data, lugre-steering diagnose tells."
        numbers += [
            ("root mean square error", words.torque(vehicle, fit.rmse_Nm), r2_words(fit.r2, "R²").removeprefix(", ")),
            ("mean error", f"{words.tenths(fit.bias_Nm, '+', fit.rmse_Nm)} {vehicle.coordinate.force_unit}", "measured minus estimate"),
            *_ahead(bag, vehicle),
            ("largest torque measured", words.torque(vehicle, peak), ""),
        ]
    more = f'<p class="more">{counted(len(bag.findings), "finding")} below.</p>' if bag.findings else ""
    return (
        f'<header id="verdict"><p class="over">{text(vehicle.name)}</p>\n<h1>{text(bag.name)}</h1>\n'
        f'<div class="verdict"><p>{text(said)}</p>{more}</div>\n{facts(numbers)}</header>'
    )


def _ahead(bag: ReplayedBag, vehicle: Vehicle) -> list[tuple[str, str, str]]:
    error = bag.look_ahead_rmse_Nm
    return [] if error is None else [("looking ahead", words.torque(vehicle, error), "motion known from all samples")]


def _findings(bag: ReplayedBag) -> str:
    rows = [[text(f.statement), code(f.topic) if f.topic else "", text(f.finding.replace("_", " "))] for f in bag.findings]
    return table(["what it means", "topic", "finding"], rows) if rows else "<p>Nothing was damaged, lost or replaced.</p>"


def _samples(bag: ReplayedBag) -> str:
    rows = [
        [text(name.replace("_", " ")), code(counts.topic) if counts.topic else "not recorded", words.whole(counts.used),
         *(text(_listed(some)) for some in (counts.rejected, counts.noted))]
        for name, counts in bag.samples.items()
    ]  # fmt: skip
    return table(["input", "topic", "used", "rejected", "noted"], rows, numeric=(2,))


def _listed(reasons: Mapping[str, int]) -> str:
    return ", ".join(f"{words.whole(n)} {words.named(reason)}" for reason, n in reasons.items())


def _chart(vehicle: Vehicle, motion: Curves, check: Curves) -> Chart:
    time, lines = motion.lines()
    check_time, checked = check.lines()
    sides = vehicle.sides
    angle = words.coordinate_axis(vehicle, "steering angle")
    torque, left = words.torque_axis(vehicle, lines[-1], *checked[:1]), words.torque_axis(vehicle, *checked[1:])

    def of_sides(rows: Array, scale: float) -> list[Series]:
        return [Series(side, str(i), scale * row, time) for i, (side, row) in enumerate(zip(sides, rows, strict=False))]

    estimate = Series("estimate", "augmented", torque.scale * lines[-1], time)
    panels = [
        Panel("torque that the actuators deliver", torque.unit, [estimate], size=3.0),
        Panel(angle.name, angle.unit, of_sides(lines[: len(sides)], angle.scale), size=1.2),
    ]
    if check_time.size:
        panels[0].series.insert(0, Series("measured", "measured", torque.scale * checked[0], check_time))
        residual = Series("measured minus estimate", "before", left.scale * checked[1], check_time)
        panels.insert(1, Panel("residual", left.unit, [residual], size=1.6))
    if vehicle.rubber is not None:
        panels.append(Panel("tread rubber temperature", "degC", of_sides(lines[len(sides) : 2 * len(sides)], 1.0), size=1.2))
    return Chart("time since the first stamp (s)", panels)
