# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The result of a replay on a terminal: one table over all recordings, what is to be known about each, what was left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from lugre_steering.bag.find import told_apart
from lugre_steering.bag.reader import bag_name
from lugre_steering.report import words


def show_replay(console: Console, summary: Mapping[str, Any]) -> None:
    """The summary as a table, and remarks below it."""
    unit = summary["torque_unit"]
    look: Any = {"box": None, "padding": (0, 2, 0, 0), "header_style": "bold"}  # names whole at 80 columns
    table = Table(title="replay: estimate against measured torque", title_justify="left", **look)
    table.add_column("recording", overflow="fold")
    for column in ("seconds", "torques", f"RMSE ({unit})", "R2", f"bias ({unit})"):
        table.add_column(column, justify="right", no_wrap=True)
    if ahead := _looked_ahead(summary):
        table.add_column(f"ahead ({unit})", justify="right", no_wrap=True)
    shown = told_apart([bag["bag"] for bag in summary["bags"]])
    for bag, path in zip(summary["bags"], shown, strict=True):
        # Of several recordings of one name, where each lies and what its results are called.
        label = f"{path} -> {bag['name']}" if "/" in path or bag_name(Path(bag["bag"])) != bag["name"] else bag["name"]
        table.add_row(label, f"{bag['duration_s']:.1f}", words.whole(bag["estimates"]), *_fit(bag["fit"]), *_ahead(bag) * ahead)
    if len(summary["bags"]) > 1:
        seconds, torques = (sum(bag[key] for bag in summary["bags"]) for key in ("duration_s", "estimates"))
        table.add_row("all", f"{seconds:.1f}", words.whole(torques), *_fit(summary["overall"]))
    console.print(table)
    for line in _remarks(summary):
        console.print(line, highlight=False, soft_wrap=True)


def _looked_ahead(summary: Mapping[str, Any]) -> bool:
    return any(bag["look_ahead_rmse_Nm"] is not None for bag in summary["bags"])


def _ahead(bag: Mapping[str, Any]) -> tuple[str, ...]:
    error = bag["look_ahead_rmse_Nm"]
    return ("-" if error is None else words.tenths(error),)


def _fit(fit: Mapping[str, Any] | None) -> tuple[str, str, str]:
    if fit is None:
        return "-", "-", "-"
    r2 = "-" if fit["r2"] is None else f"{fit['r2']:.4f}"
    return words.tenths(fit["rmse_Nm"]), r2, words.tenths(fit["bias_Nm"], "+", fit["rmse_Nm"])


def _remarks(summary: Mapping[str, Any]) -> Iterator[str]:
    for bag in summary["bags"]:
        if bag["fit_note"]:
            yield f"{bag['name']}: {bag['fit_note']}"
        for label, counts in bag["samples"].items():
            if counts["rejected"]:
                reasons = ", ".join(f"{count} {reason}" for reason, count in counts["rejected"].items())
                yield f"{bag['name']}: {label}: {counts['used']} used; rejected: {reasons}"
        for finding in bag["findings"]:
            yield f"{bag['name']}: {finding['finding']}: {finding['topic']} {finding['statement']}".replace(":  ", ": ")
    if _looked_ahead(summary):
        yield "ahead: RMSE of the model with the motion known from all samples, as diagnose has it"
    for left in summary["skipped"]:
        yield f"skipped: {left['bag']}: {left['reason']}"
