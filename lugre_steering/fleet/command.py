# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The result of a fleet on a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

MOST_LINES = 20


def show_fleet(console: Console, result: Mapping[str, Any], out: Path) -> None:
    """Vehicles, what stands, what was left out, and how the time went."""
    table = Table(title="fleet", title_justify="left")
    table.add_column("vehicle", overflow="fold")
    for column in ("recordings", "quarantine", "hours", "RMSE [N m]"):
        table.add_column(column, justify="right")
    table.add_column("stands within the budget", overflow="fold")
    for one in result["vehicles"]:
        error = "-" if one["median_rmse_Nm"] is None else f"{one['median_rmse_Nm']:.1f}"
        stands = _standing(result, one["name"])
        table.add_row(one["name"], str(one["recordings"]), str(one["quarantined"]), f"{one['hours']:.2f}", error, stands)
    console.print(table)
    for left in result["quarantine"][:MOST_LINES]:
        console.print(f"quarantine: {left['bag']}: {left['reason']}", highlight=False, soft_wrap=True)
    if len(result["quarantine"]) > MOST_LINES:
        console.print(f"quarantine: {len(result['quarantine']) - MOST_LINES} more in {out / 'scores.parquet'}")
    if result["other_version"] is not None:
        console.print(f"{len(result['changes'])} differences to {result['other_version']}", highlight=False)
    how = f"in {result['seconds']:.1f} s with {result['workers']} worker{'s' * (result['workers'] != 1)}"
    console.print(f"{result['examined']} recordings examined, {result['cached']} known, {how}", highlight=False, soft_wrap=True)


def _standing(result: Mapping[str, Any], vehicle: str) -> str:
    """Effects of one vehicle: leaders and names, then dates and trends."""
    told = []
    for claim in result["claims"]:
        if claim["vehicle"] != vehicle:
            continue
        if claim["leads"] or claim["kind"] == "recording":
            told.append(claim["effect"] + (f" (or {claim['rivals']})" if claim["rivals"] else ""))
        elif claim["kind"] == "since":
            told.append(f"{claim['effect']} since {claim['since'][:10]}")
        elif claim["kind"].startswith("trend"):
            told.append(f"{claim['kind']} of {claim['effect']}")
    return ", ".join(dict.fromkeys(told)) or "-"
