# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What an import found, as a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table

from lugre_steering.counted import counted
from lugre_steering.report import words
from lugre_steering.terminal import point


def show_import(console: Console, result: Mapping[str, Any]) -> None:
    """One row per channel: samples, rate, range; below, what is worth a look."""
    look: Any = {"box": None, "padding": (0, 2, 0, 0), "header_style": "bold"}  # rows whole at 80 columns
    table = Table(title=f"{result['table']} -> {result['bag']}", title_justify="left", **look)
    for heading in ("channel", "samples", "rate", "time", "range"):
        table.add_column(heading, overflow="fold", no_wrap=heading == "channel")
    for channel in result["channels"]:
        rate = "-" if channel["rate_Hz"] is None else f"{channel['rate_Hz']:.4g} Hz"
        time = f"{channel['from_s']:.4g} ... {channel['to_s']:.4g} s"
        value = f"{channel['lowest']:.4g} ... {channel['highest']:.4g} {channel['unit']}"
        table.add_row(channel["channel"], words.whole(channel["samples"]), rate, time, value)
    console.print(table)
    for channel in result["channels"]:
        for note in _notes(channel):
            console.print(point(f"{channel['channel']}: {note}"))
    for what, count in result["left_out"].items():
        console.print(f"left out: {count} {what}")


def show_proposal(console: Console, result: Mapping[str, Any]) -> None:
    """What was taken for what, and why; what was not used; what is still to be done."""
    table = Table(title=f"{result['table']} -> {result['map']}", title_justify="left")
    for heading in ("taken for", "column", "unit", "why"):
        table.add_column(heading, overflow="fold")
    for guess in (*result["clocks"], *result["channels"]):
        table.add_row(guess["key"], guess["column"], guess["unit"], guess["why"])
    for column, bits in result["signed"].items():
        table.add_row("signed", column, f"{bits} bits", "whole numbers near zero and near the largest, nothing between")
    for row in result["unused"]:
        table.add_row("-", row["column"], "-", row["why"])
    console.print(table)
    for reason in result["format"]:
        console.print(reason)
    console.print(f"not yet usable: {result['problem']}" if result["problem"] else "the map can be used; check each line of it first")


def _notes(channel: Mapping[str, Any]) -> list[str]:
    counts = (
        ("missing", channel["missing"]),
        ("outside start and stop", channel["outside_start_stop"]),
        ("not increasing in time", channel["not_increasing"]),
        ("of no use, as their time repeats or runs back", channel["unusable"]),
    )
    notes = [f"{count} {what}" for what, count in counts if count]
    if gaps := channel["gaps_s"]:
        begin, end = max(gaps, key=lambda gap: gap[1] - gap[0])
        notes.append(f"{counted(len(gaps), 'gap')}, longest {end - begin:.3g} s at {begin:.4g} s")
    if spikes := channel["outliers_s"]:
        notes.append(f"{counted(len(spikes), 'outlier')}, first at {spikes[0]:.4g} s")
    return [*notes, *channel["doubts"]]
