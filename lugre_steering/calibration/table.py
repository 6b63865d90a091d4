# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The result of a calibration on a terminal, and its options as they are typed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from lugre_steering.bag.find import SKIPPED
from lugre_steering.errors import DataError
from lugre_steering.fitting.keys import KEYS
from lugre_steering.report import words
from lugre_steering.terminal import point


def parse_priors(texts: Sequence[str]) -> dict[str, float]:
    """``NAME=SHARE`` options as a mapping."""
    priors: dict[str, float] = {}
    for text in texts:
        name, _, number = text.partition("=")
        try:
            priors[name] = float(number)
        except ValueError:
            raise DataError(f"--prior {text}: expected NAME=SHARE, such as stiffness=0.05") from None
    return priors


def show_calibration(console: Console, result: Mapping[str, Any], unit: str) -> None:
    """Parameters with intervals, what to make of them, and the paragraph; ``unit`` of torques: N m, or the force unit of a linear axis."""
    table = Table(title="calibration (units as in the key)", title_justify="left")
    for column in ("key", "sheet", "fitted", "95 % interval"):
        table.add_column(column, no_wrap=True)
    for row in result["parameters"]:
        interval = " … ".join(f"{end:.5g}" for end in row["ci95"])
        table.add_row(row["key"], f"{row['sheet']:.5g}", f"{row['value']:.5g}", interval)
    console.print(table)
    console.print(_per_bag(result, unit))
    for found in result["data_quality"]:
        if found["finding"] == SKIPPED:
            console.print(f"skipped: {found['bag']}: {found['statement']}", highlight=False, soft_wrap=True)
    for row in result["parameters"]:
        if remark := _remark(row):
            console.print(point(f"{row['key']}: {remark}"))
    remarked = {row["key"] for row in result["parameters"] if _remark(row)}
    told = tuple(key.beginning for key in KEYS if key.key in remarked)
    for sentence in words.sentences(result["statement"]):
        if not sentence.startswith(told):
            console.print(point(sentence))
    if result["picture_note"]:
        console.print(result["picture_note"])


def _per_bag(result: Mapping[str, Any], unit: str) -> Table:
    table = Table(title=f"torque error (RMSE, {unit})", title_justify="left")
    table.add_column("recording", overflow="fold")
    for column in ("seconds", "samples", "sheet", "calibrated"):
        table.add_column(column, justify="right", no_wrap=True)
    for row in result["per_bag"]:
        errors = ("-" if row[key] is None else words.tenths(row[key]) for key in ("sheet", "calibrated"))
        table.add_row(row["bag"], f"{row['duration_s']:.1f}", words.whole(row["samples"]), *errors)
    return table


def _remark(row: Mapping[str, Any]) -> str:
    remarks = [f"at the {row['at_bound']} end of its range"] if row["at_bound"] else []
    if row["prior_dominated"]:
        remarks.append(f"hardly determined by these recordings; drive '{row['advice']}'")
    return ", ".join(remarks)
