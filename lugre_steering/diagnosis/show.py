# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A diagnosis on a terminal of 80 columns: the verdict for an engineer, what was found in tables, remarks one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from lugre_steering import units
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.report import words
from lugre_steering.terminal import Prose, point

EXIT_CODES = {"consistent": 0, "missing_physics": 3, "unlisted_physics": 4, "insufficient_data": 5}
"""Of ``diagnose --exit-code``; 1 and 2 are those of failures and bad input."""


IN_TABLE = (
    "With it the held-out", "With them the held-out", "With it and the form", "With them and the form", "With the law the held-out",
    "With the law and the form", "Noise alone",
)  # fmt: skip
"""How sentences begin whose numbers stand in the table."""


def show_diagnosis(console: Console, diagnosis: Diagnosis) -> None:
    """Verdict, findings, errors, remarks, next experiment."""
    result = diagnosis.json
    first = result["headline"] or result["statement"]
    console.print(Text(f"{result['verdict'].replace('_', ' ').upper()}\n", "bold"))
    console.print(Prose(first), "")
    if result["effects"]:
        console.print(_found(diagnosis), "")
    if result["baseline"]["heldout_rmse_Nm"] is not None:
        console.print(_errors(diagnosis), "")
    for remark in words.sentences(result["statement"].removeprefix(first).strip()):
        if not remark.startswith(IN_TABLE):
            console.print(point(remark))
    for remark in _findings(result):
        console.print(point(remark))
    if result["next_experiment"]:
        console.print(point(f"Next experiment: {result['next_experiment']['manoeuvre']}"))


def _findings(result: Mapping[str, Any]) -> Iterator[str]:
    """What was found about the recordings, each once: the verdict, or a finding before, may have said it in full."""
    said = []
    for finding in result["data_quality"]:
        statement = finding["statement"]
        if statement in result["statement"]:
            said.append(statement)
            continue
        for before in said:
            statement = statement.replace(before, "see above")
        yield ": ".join(part for part in (finding["bag"], finding["finding"].replace("_", " "), statement) if part)


def _found(diagnosis: Diagnosis) -> Table:
    vehicle = diagnosis.vehicle
    table = Table("what was found", box=None, padding=(0, 2, 0, 0), header_style="bold")
    for column in ("value", "95 % interval"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for effect in diagnosis.json["effects"]:
        table.add_row(units.title(vehicle, CATALOGUE[effect["id"]]))
        for name, parameter in effect["parameters"].items():
            value, between = words.estimate(parameter["value"], parameter["ci95"])
            unit = units.label(vehicle, parameter["unit"])
            table.add_row(f"  {name.replace('_', ' ')}", value, between, "" if unit == "1" else unit)
    return table


def _errors(diagnosis: Diagnosis) -> Table:
    result, vehicle = diagnosis.json, diagnosis.vehicle
    better = bool(diagnosis.found)
    table = Table(units.words(vehicle, "torque error"), box=None, padding=(0, 2, 0, 0), header_style="bold")
    for column in ("baseline", *(["with what was found"] if better else []), "noise alone"):
        table.add_column(column, justify="right")
    for label, key in (("held-out data", "heldout_rmse_Nm"), ("all data", "rmse_Nm")):
        errors = [words.torque(vehicle, result[model][key]) for model in (("baseline", "augmented") if better else ("baseline",))]
        table.add_row(label, *errors, words.torque(vehicle, result["noise_floor_Nm"]))
    if better:
        between = words.percents(*result["augmented"]["improvement_ci95"])
        table.add_row("improvement", "", words.percent(result["augmented"]["improvement"]), between)
    return table
