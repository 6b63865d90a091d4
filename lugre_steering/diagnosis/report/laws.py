# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A found law in the report: its facts, and f with its band over what the data say."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering import units
from lugre_steering.diagnosis.report import shown
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.effects import laws
from lugre_steering.report import words
from lugre_steering.report.chart import Chart, Panel, Series
from lugre_steering.vehicle import Vehicle

_DEGREES = 180.0 / np.pi


def _axis(vehicle: Vehicle, law: Mapping[str, Any]) -> tuple[str, float]:
    """Label of the coordinate and factor from SI."""
    unit, name = laws.COORDINATES[law["coordinate"]], law["coordinate"].replace("_", " ")
    if law["memory"] == "relay":
        return f"relay of the {name}", 1.0
    if law["memory"] == "ring":
        name = f"ringing of the {name}"
    if unit.startswith("rad") and not units.is_linear(vehicle):
        return f"{name} (deg{unit[3:]})", _DEGREES
    return f"{name} ({units.label(vehicle, unit)})", 1.0


def _remembered(law: Mapping[str, Any]) -> str:
    """Its memory, if it has one, with the size of that in SI units."""
    unit = laws.MEMORIES[law["memory"]] or laws.COORDINATES[law["coordinate"]]
    return f", {law['memory']} of {law['memory_size']:.3g} {unit}" if law["memory"] != "none" else ""


def facts(vehicle: Vehicle, law: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What the report lists of a law, as plain text."""
    _, scale = _axis(vehicle, law)
    low, high = (words.number(scale * end, 3) for end in law["range"])
    unit = vehicle.coordinate.force_unit

    def between(name: str) -> str:
        ends = law["intervals"].get(name)
        return f" ({words.number(ends[0], 3)} to {words.number(ends[1], 3)})" if ends else ""

    numbers = ", ".join(f"{name} = {words.number(value, 4)}{between(name)}" for name, value in law["values"].items())
    ties = "; ".join(f"{tie['channel']} over {tie['coordinate']}{_remembered(tie)}" for tie in law["ties"])
    return [
        ("channel", words.labelled(law["channel"].replace("_", " "), units.label(vehicle, laws.CHANNELS[law["channel"]]))),
        ("depends on", law["coordinate"] + _remembered(law)),
        ("form, SI units", f"{law['form']}: {numbers}" if numbers else f"{law['form']}, see augmented.yaml"),
        ("at most", f"{words.number(law['largest_Nm'], 3)} {unit}, {words.percent(law['largest_share'])} of the torque"),
        ("foretells on held-out data", f"{words.percent(law['heldout_gain'])} of the missing energy"),
        ("of what any function of these coordinates could", words.percent(law["share_of_ceiling"])),
        ("not to be trusted", f"outside {low} to {high}, which nobody saw" if law["coordinate"] != "none" else ""),
        ("fits as well", ties),
        ("nearest in the catalogue, which explains less", ", ".join(law["nearest_listed"])),
    ]


def chart(vehicle: Vehicle, law: Mapping[str, Any], style: str) -> Chart | None:
    """f with its band, and the data in steps; None for a law of one number."""
    if law["coordinate"] == "none":
        return None
    (label, scale), f = _axis(vehicle, law), law["f"]
    at, value, band = (np.array(f[key]) for key in ("at", "f", "band"))
    x = scale * at
    series = [
        Series("95 % band of f", style, value + band, x, low=value - band),
        Series("f", style, value, x),
        Series("the data, in steps", "measured", np.array(f["points"]), scale * np.array(f["points_at"]), dots=True),
    ]
    return Chart(label, [Panel("f", units.label(vehicle, laws.CHANNELS[law["channel"]]), series, size=3.0)])


def draw_law(diagnosis: Diagnosis, law: Mapping[str, Any], file: Path) -> None:
    """The same as a picture."""
    from lugre_steering.report.style import figure

    (label, scale), f = _axis(diagnosis.vehicle, law), law["f"]
    at, value, band = (np.array(f[key]) for key in ("at", "f", "band"))
    caption = f"{law['title']}. Line: f with its 95 % band. Points: what the data say within steps of the coordinate."
    with figure(1, 1, caption, file, row_inches=3.4, words=partial(units.words, diagnosis.vehicle), made=diagnosis.provenance) as axes:
        ax = axes[0, 0]
        ax.plot(scale * np.array(f["points_at"]), f["points"], "o", markersize=4, color=shown.MEASURED, label="the data, in steps")
        ax.plot(scale * at, value, color=shown.AUGMENTED, label="f with its 95 % band")
        ax.fill_between(scale * at, value - band, value + band, color=shown.AUGMENTED, alpha=0.2, linewidth=0)
        ax.set_xlabel(label)
        ax.set_ylabel(f"f ({units.label(diagnosis.vehicle, laws.CHANNELS[law['channel']])})")
        ax.legend(loc="best")
