# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Sections of the report about what was found: torque over time, each named effect, each law."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lugre_steering import units
from lugre_steering.diagnosis.report import laws, plots
from lugre_steering.diagnosis.report.names import called, chance, parameter_called, place
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.report import words
from lugre_steering.report.markup import pairs, table, text
from lugre_steering.report.page import Charts

STAGE_WORDS = {
    "motion": "what the contact really does against the measured angle",
    "contact": "friction of rubber on the ground",
    "thermal": "where the friction heat goes",
    "parallel_torque": "torque on the steering axis beside the contact",
    "measurement": "hydraulics and sensors",
}
EXACT_LAW = "The intervals take the form of the law as exact; where nature bends it, values lie further off than they say."


def torque(diagnosis: Diagnosis, charts: Charts) -> str:
    """A chart per bag."""
    if not diagnosis.traces:
        return '<p class="note">No model was fitted, so there is nothing to draw.</p>'
    acts = "; coloured, where a finding acts, shaded below unless that is nearly everywhere" if diagnosis.json["effects"] else ""
    parts = [
        '<p class="note">Drag or press + to zoom, double-click for everything; a name in the legend hides its curve. '
        f"Bars on top: grey, stretches that neither search nor fit saw{acts}.</p>\n"
    ]
    for trace in diagnosis.traces:
        said = f"Measured torque of bag {trace.name}, the models' torque and the residuals over time"
        parts.append(f"<h3>{text(trace.name)}</h3>\n" + charts.place(plots.torque_chart(diagnosis, trace), said))
    return "".join(parts)


def effects(diagnosis: Diagnosis, charts: Charts) -> str:
    """A card per named effect."""
    return "".join(_effect(diagnosis, effect, charts) for effect in diagnosis.json["effects"])


def found_laws(diagnosis: Diagnosis, charts: Charts) -> str:
    """A card per law."""
    vehicle, style = diagnosis.vehicle, plots.styles(diagnosis)
    return "".join(
        f'<div class="card"><h3>{text(law.title)}</h3>\n{pairs([(name, text(value)) for name, value in laws.facts(vehicle, law)])}'
        + charts.place(laws.chart(vehicle, law, style[law.id]), f"f of {law.title} with its band and the data", half=True)
        + "</div>\n"
        for law in diagnosis.laws
    )


def _effect(diagnosis: Diagnosis, effect: Mapping[str, Any], charts: Charts) -> str:
    entry = CATALOGUE[effect["id"]]
    style = plots.styles(diagnosis)[effect["id"]]
    drawn = ""
    if any(effect["id"] in trace.contributions for trace in diagnosis.traces):
        said = f"Residual along the telling coordinate of {entry.title}, with its fitted law, before and after"
        drawn = charts.place(plots.residual_chart(diagnosis, effect), said)
    facts = pairs([
        ("where in the chain", text(STAGE_WORDS.get(effect["stage"], effect["stage"]))),
        ("source", text(entry.source)),
        ("how it shows", text(entry.trace)),
        ("chance that noise does this", text(chance(effect["p_value"]))),
        ("share of the baseline residual's energy it explains", text(words.percent(effect["energy_share"]))),
        ("share that recalibration had hidden", text(words.percent(effect["masked_share"]))),
        ("cannot be told from", ", ".join(called(diagnosis, rival) for rival in effect["indistinguishable_from"])),
    ])  # fmt: skip
    where = [place(diagnosis, entry) for entry in effect["where"]]
    return (
        f'<div class="card"><h3><span class="swatch s-{style}"></span>{called(diagnosis, effect["id"])}</h3>\n'
        f"<p>{text(effect['statement'])}</p>\n{_parameters(diagnosis, effect)}<p class=\"note\">{EXACT_LAW}</p>\n"
        + (table(["bag", "acts during", "98 % of its energy lies along"], where) if where else "")
        + drawn
        + facts
        + "</div>\n"
    )


def _parameters(diagnosis: Diagnosis, effect: Mapping[str, Any]) -> str:
    vehicle = diagnosis.vehicle
    angular = "" if units.is_linear(vehicle) else "in degrees"
    header = ["parameter", "fitted", "95 % interval", "unit", angular]
    rows = []
    for name, parameter in effect["parameters"].items():
        unit, ends = units.label(vehicle, parameter["unit"]), parameter["ci95"]
        value, between = words.estimate(parameter["value"], ends)
        degrees = _degrees(parameter["value"], ends) if unit == "rad" else ""
        row = [parameter_called(effect["id"], name), value, between, "" if unit == "1" else text(unit), degrees]
        rows.append([cell for cell, title in zip(row, header, strict=True) if title])
    return table([title for title in header if title], rows, numeric=(1, 2, 4) if angular else (1, 2))


def _degrees(value: float | None, ends: Sequence[float] | None) -> str:
    if value is None:
        return ""
    return words.estimate(math.degrees(value), ends and [math.degrees(end) for end in ends])[0] + "°"
