# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Picture of one replay: angles, both torques, residual, rubber temperatures."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering import units
from lugre_steering.online import Agreement, Curves, r2_words
from lugre_steering.provenance import Provenance
from lugre_steering.recording import Array
from lugre_steering.report import words
from lugre_steering.report.style import IMPROVED, MEASURED, SERIES, SHOWN, figure
from lugre_steering.vehicle import Vehicle


def draw_replay(
    name: str, vehicle: Vehicle, motion: Curves, check: Curves, fit: Agreement | None, made: Provenance, file: Path
) -> None:
    """Write the picture as PNG.

    ``motion``: angle of each side, temperature of each side, estimated torque; ``check``: cylinder torque, residual.
    """
    rows, said = 4 if vehicle.rubber else 3, partial(units.words, vehicle)
    with figure(rows, 1, _caption(name, vehicle, fit), file, row_inches=1.9, words=said, made=made) as axes:
        (time, lines), (check_time, checked) = motion.lines(), check.lines()
        measured = "sensor torque" if vehicle.torque_sensor is not None else "cylinder torque"
        sides, force = len(vehicle.sides), vehicle.coordinate.force_unit
        _angles(axes[0, 0], vehicle, time, lines[:sides])
        _torques(axes[1, 0], force, (time, lines[-1]), (check_time, checked[0]), measured)
        _residual(axes[2, 0], force, check_time, checked[1], f"{measured} minus estimate")
        if vehicle.rubber:
            _temperatures(axes[3, 0], vehicle, time, lines[sides : 2 * sides])
        for ax in axes[:, 0]:
            ax.set_xlim(0.0, float(time[~np.isnan(time)][-1]) or 1.0)
            if ax.get_legend_handles_labels()[0]:
                ax.legend(ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
        axes[-1, 0].set_xlabel("time since the first stamp (s)")


def _angles(ax: Any, vehicle: Vehicle, time: Array, angles: Array) -> None:
    scale, unit = SHOWN.get(vehicle.coordinate.unit, (1.0, vehicle.coordinate.unit))
    for side, angle, colour in zip(vehicle.sides, angles, SERIES, strict=False):
        ax.plot(time, scale * angle, label=side, color=colour)
    ax.set_title(vehicle.coordinate.name)
    ax.set_ylabel(unit)


def _torques(ax: Any, unit: str, estimate: tuple[Array, Array], checked: tuple[Array, Array], measured: str) -> None:
    if checked[0].size:
        ax.plot(checked[0], checked[1] * 1e-3, **MEASURED, label=measured)
    ax.plot(estimate[0], estimate[1] * 1e-3, **IMPROVED, label="estimate")
    ax.set_title("torque that the actuators deliver")
    ax.set_ylabel(f"k{unit}")


def _residual(ax: Any, unit: str, time: Array, residual: Array, label: str) -> None:
    if time.size:
        ax.plot(time, residual * 1e-3, color=SERIES[2], label=label)
    else:
        ax.text(0.5, 0.5, "not available", transform=ax.transAxes, ha="center", color="#777777")
    ax.set_title("residual")
    ax.set_ylabel(f"k{unit}")


def _temperatures(ax: Any, vehicle: Vehicle, time: Array, temperatures: Array) -> None:
    for side, temperature, colour in zip(vehicle.sides, temperatures, SERIES, strict=False):
        ax.plot(time, temperature, label=side, color=colour)
    ax.set_title("tread rubber temperature (estimate)")
    ax.set_ylabel("degC")


def _caption(name: str, vehicle: Vehicle, fit: Agreement | None) -> str:
    text = f"Bag {name}. Vehicle: {vehicle.name}. "
    if vehicle.effects:
        text += f"Effects added to the baseline: {', '.join(units.titles(vehicle))}. "
    if fit is None:
        return text + "No residual: the torque was not measured."
    unit = vehicle.coordinate.force_unit
    return text + (
        f"Residual over {fit.samples} samples: RMSE {words.tenths(fit.rmse_Nm)} {unit}{r2_words(fit.r2, 'R²')}, "
        f"bias {words.tenths(fit.bias_Nm, '+', fit.rmse_Nm)} {unit}."
    )
