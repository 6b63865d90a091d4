# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle file amounts to, as tables and as a picture of the footprint of one track."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from lugre_steering.errors import DataError
from lugre_steering.files import output_folder
from lugre_steering.provenance import Provenance
from lugre_steering.report import words
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.footprint import contact_lengths, ground_pressure, peak_pressure


def show_vehicle(console: Console, result: Mapping[str, Any]) -> None:
    """Quantities, inputs and effects as tables."""
    table = Table(title=f"{result['vehicle']}: one side", title_justify="left")
    for heading in ("quantity", "value", "unit"):
        table.add_column(heading, overflow="fold")
    for row in result["quantities"]:
        values = row["value"] if isinstance(row["value"], list) else [row["value"]]
        table.add_row(row["quantity"], ", ".join(words.number(value) for value in values), row["unit"])
    console.print(table)
    inputs = Table(title="inputs", title_justify="left")
    for heading in ("channel", "topic", "joint"):
        inputs.add_column(heading, overflow="fold")
    for row in result["inputs"]:
        inputs.add_row(row["channel"] + (" (optional)" if row["optional"] else ""), row["topic"], row["joint"] or "")
    console.print(inputs)
    for effect in result["effects"]:
        parameters = ", ".join(f"{name} = {words.number(value)}" for name, value in effect["parameters"].items())
        console.print(f"effect {effect['id']}: {parameters} (SI)")
    for warning in result["warnings"]:
        console.print(f"warning: {warning['statement']}")
    if result["picture"]:
        console.print(f"picture in {result['picture']}", highlight=False, soft_wrap=True)


def draw_footprint(vehicle: Vehicle, out: Path, made: Provenance) -> Path:
    """Picture, in the folder ``out``, of the ground pressure under the left track from above; the right one is its mirror image."""
    from lugre_steering.report.style import SERIES, figure  # needs matplotlib

    axle, track, rubber = vehicle.axle, vehicle.track, vehicle.rubber
    if axle is None or track is None or rubber is None:
        raise DataError(f"{vehicle.name}: a footprint needs the sections 'axle', 'track' and 'rubber'")
    file = out / "footprint.png"
    area = rubber.contact_area_m2
    lengths, centres = contact_lengths(axle, track, area), np.array(track.rollers.x_m)
    x = np.linspace(float((centres - lengths).min()), float((centres + lengths).max()), 600)
    y = np.linspace(-0.5 * track.width_m, 0.5 * track.width_m, 120)
    pressure = ground_pressure(axle, track, area, x, y)
    caption = (
        f"Vehicle: {vehicle.name}. From the vehicle file alone, nothing here is measured: load per roller, exponent "
        f"{track.ground_pressure_exponent:g} along the track, linear across it; peak {peak_pressure(axle, track, area) / 1e5:.3g} bar. "
        "The torque counts each roller's load at its centre (lines from the hinge)."
    )
    with output_folder(out), figure(1, 1, caption, file, row_inches=3.6, made=made) as axes:
        ax = axes[0, 0]
        filled = ax.contourf(x, track.hinge_offset_m + y, pressure / 1e5, levels=12, cmap="Blues")
        ax.figure.colorbar(filled, ax=ax, label="ground pressure (bar)")
        for centre in centres:
            ax.plot([0.0, centre], [0.0, track.hinge_offset_m], color="#888888", linewidth=0.9)
        ax.plot(centres, np.full(centres.size, track.hinge_offset_m), "o", color=SERIES[1], label="roller centres")
        ax.plot(0.0, 0.0, "s", color="black", label="steering hinge")
        ax.set_aspect("equal", adjustable="datalim")
        ax.set_title("footprint of one track")
        ax.set_xlabel("along the track, from the hinge, forward (m)")
        ax.set_ylabel("from the hinge, outward (m)")
        ax.legend(loc="lower right")
    return file
