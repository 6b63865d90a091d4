# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The result of a fleet on a terminal of 80 columns: what the model leaves out on which vehicle, then the rest."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from lugre_steering.counted import counted
from lugre_steering.fleet.result import Fleet
from lugre_steering.fleet.told import Told, told
from lugre_steering.terminal import point

MOST_LINES = 20


def show_fleet(console: Console, fleet: Fleet, out: Path) -> None:
    """What stands, vehicles, what was left out, and how the time went."""
    found = told(fleet)
    for one in found[:MOST_LINES]:
        console.print(point(_sentence(one)))
    if len(found) > MOST_LINES:
        console.print(f"{len(found) - MOST_LINES} more in {out / 'report.html'}", highlight=False)
    if not any(vehicle.recordings for vehicle in fleet.vehicles):
        console.print(point("No recording tells anything; the reasons stand below."))
    elif not found and fleet.options.diagnose:
        console.print(point("No missing physics is seen, in single recordings or in all together."))
    console.print(Text(""), _vehicles(fleet))
    for claim in fleet.claims:
        if claim.kind.startswith("trend"):
            console.print(point(f"{claim.vehicle}: {claim.kind} of the model's {'error' if claim.effect == 'rmse' else 'bias'}"))
    for left in fleet.quarantine[:MOST_LINES]:
        console.print(f"quarantine: {left.bag}: {left.reason}", highlight=False, soft_wrap=True)
    if len(fleet.quarantine) > MOST_LINES:
        console.print(f"quarantine: {len(fleet.quarantine) - MOST_LINES} more in {out / 'scores.parquet'}", highlight=False)
    if fleet.other_version is not None:
        console.print(f"{counted(len(fleet.changes), 'difference')} to {fleet.other_version}", highlight=False)
    how = f"in {fleet.seconds:.1f} s with {counted(fleet.workers, 'worker')}"
    console.print(f"{counted(fleet.examined, 'recording')} examined, {fleet.cached} known, {how}", highlight=False, soft_wrap=True)


def _vehicles(fleet: Fleet) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    table.add_column("vehicle", overflow="fold")
    for column in ("recordings", "quarantine", "hours", "RMSE (N m)"):
        table.add_column(column, justify="right", no_wrap=True)
    for one in fleet.vehicles:
        error = "-" if one.median_rmse_Nm is None else f"{one.median_rmse_Nm:.1f}"
        table.add_row(one.name, str(one.recordings), str(one.quarantined), f"{one.hours:.2f}", error)
    return table


def _sentence(one: Told) -> str:
    return f"{one.vehicle}: {one.what}, {one.size}, since {one.since}; seen in {one.seen}; {one.do}"
