# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A found law in the report: its facts, and f with its band over what the data say."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from lugre_steering import units
from lugre_steering.diagnosis.found_law import FoundLaw, LawTie
from lugre_steering.diagnosis.law_picture import axis_of, draw, unit_of
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.effects import laws
from lugre_steering.report import words
from lugre_steering.report.chart import Chart, Panel, Series
from lugre_steering.vehicle import Vehicle


def _remembered(law: FoundLaw | LawTie) -> str:
    """Its memory, if it has one, with the size of that in SI units."""
    unit = laws.MEMORIES[law.memory] or laws.COORDINATES[law.coordinate]
    return f", {law.memory} of {law.memory_size:.3g} {unit}" if law.memory != "none" else ""


def facts(vehicle: Vehicle, law: FoundLaw) -> list[tuple[str, str]]:
    """What the report lists of a law, as plain text."""
    _, scale = axis_of(vehicle, law)
    low, high = (words.number(scale * end, 3) for end in law.range)
    unit = vehicle.coordinate.force_unit

    def between(name: str) -> str:
        ends = law.intervals.get(name)
        return f" ({words.number(ends[0], 3)} to {words.number(ends[1], 3)})" if ends else ""

    numbers = ", ".join(f"{name} = {words.number(value, 4)}{between(name)}" for name, value in law.values.items())
    ties = "; ".join(f"{tie.channel} over {tie.coordinate}{_remembered(tie)}" for tie in law.ties)
    return [
        ("channel", words.labelled(law.channel.replace("_", " "), unit_of(vehicle, law))),
        ("depends on", law.coordinate + _remembered(law)),
        ("form, SI units", f"{law.form}: {numbers}" if numbers else f"{law.form}, see augmented.yaml"),
        ("at most", f"{words.number(law.largest_Nm, 3)} {unit}, {words.percent(law.largest_share)} of the torque"),
        ("foretells on held-out data", f"{words.percent(law.heldout_gain)} of the missing energy"),
        ("of what any function of these coordinates could", words.percent(law.share_of_ceiling)),
        ("not to be trusted", f"outside {low} to {high}, which nobody saw" if law.coordinate != "none" else ""),
        ("fits as well", ties),
        ("nearest in the catalogue, which explains less", ", ".join(law.nearest_listed)),
    ]


def chart(vehicle: Vehicle, law: FoundLaw, style: str) -> Chart | None:
    """f with its band, and the data in steps; None for a law of one number."""
    if law.coordinate == "none":
        return None
    (label, scale), f = axis_of(vehicle, law), law.f
    at, value, band = map(np.array, (f.at, f.f, f.band))
    x = scale * at
    series = [
        Series("95 % band of f", style, value + band, x, low=value - band),
        Series("f", style, value, x),
        Series("the data, in steps", "measured", np.array(f.points), scale * np.array(f.points_at), dots=True),
    ]
    return Chart(label, [Panel("f", unit_of(vehicle, law), series, size=3.0)])


def draw_law(diagnosis: Diagnosis, law: FoundLaw, file: Path) -> None:
    """The same as a picture."""
    from lugre_steering.report.style import figure

    caption = f"{law.title}. Line: f with its 95 % band. Points: what the data say within steps of the coordinate."
    with figure(1, 1, caption, file, row_inches=3.4, words=partial(units.words, diagnosis.vehicle), made=diagnosis.provenance) as axes:
        draw(axes[0, 0], diagnosis.vehicle, law)
