# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Titles before identifiers: how effects, places and chances are called in the report of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lugre_steering import units
from lugre_steering.diagnosis.conclude.headline import inside
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.report import words
from lugre_steering.report.markup import text


def called(diagnosis: Diagnosis, name: str, within: bool = False) -> str:
    """The title of an effect (``within`` a sentence), and small behind it the name by which files know it, a line of the hydraulics in
    brackets included."""
    known = name.split("[")[0]
    small = f'<code class="id">{text(name)}</code>'
    if known not in CATALOGUE:
        return text(name)
    title = units.title(diagnosis.vehicle, CATALOGUE[known])
    return f"{text(inside(title) if within else title)} {small}"


def parameter_called(effect: str, name: str) -> str:
    """What a parameter of an effect means, and small behind it the name by which files know it: the line, where each line has one."""
    small = f'<code class="id">{text(name)}</code>'
    if effect not in CATALOGUE:
        return small
    parameters, per_line = CATALOGUE[effect].parameters, CATALOGUE[effect].per_line
    meaning = next((p.meaning for p in parameters if p.name == name), parameters[0].meaning if per_line else "")
    return f"{text(meaning)} {small}"


def place(diagnosis: Diagnosis, entry: Mapping[str, Any]) -> list[str]:
    """Bag, stretches, and range of the coordinate (if one was found), as HTML."""
    along = "-"
    if entry.get("coordinate") and entry.get("range"):
        axis = words.coordinate_axis(diagnosis.vehicle, entry["coordinate"])
        low, high = (words.number(end * axis.scale, 3) if end is not None else "-" for end in entry["range"])
        along = f"{text(axis.label)}: {low} … {high}"
    return [text(entry["bag"]), words.spans(entry["intervals_s"]), along]


def chance(p: float | None) -> str:
    """'p = 0.03', 'p < 0.001'."""
    said = words.chance(p)
    return "p " + (said if said.startswith("<") else f"= {said}")
