# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Picture of one simulated recording: angles, torque, line pressures, rubber temperature."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from lugre_steering import units
from lugre_steering.provenance import Provenance
from lugre_steering.recording import Kind
from lugre_steering.report.style import IMPROVED, MEASURED, SHOWN, figure
from lugre_steering.simulate.run import Simulated


def draw_simulation(run: Simulated, label: str, file: Path, made: Provenance | None = None) -> None:
    """Write the picture as PNG; ``made``: how it came about."""
    vehicle, truth = run.vehicle, run.truth
    time, coordinate = truth.motion.time, vehicle.coordinate
    scale, unit = SHOWN.get(coordinate.unit, (1.0, coordinate.unit))
    pressures = {c.name: s for c, s in run.signals.items() if c.kind is Kind.PRESSURE}
    torques = [s for c, s in run.signals.items() if c.kind is Kind.TORQUE]
    effects = ", ".join(units.titles(vehicle)) or "none"
    caption = f"SYNTHETIC recording: {label}. Effects added to the baseline: {effects}."
    with figure(4 if pressures else 3, 1, caption, file, row_inches=1.9, words=partial(units.words, vehicle), made=made) as axes:
        rows = iter(axes[:, 0])
        ax = next(rows)
        for side, theta in zip(vehicle.sides, truth.motion.theta, strict=True):
            ax.plot(time, scale * theta, label=side)
        ax.set_title(f"{coordinate.name} (true)")
        ax.set_ylabel(unit)

        ax = next(rows)
        for signal in torques:
            ax.plot(signal.time_s, signal.value * 1e-3, **MEASURED, label="sensor")
        ax.plot(time, truth.torque * 1e-3, **IMPROVED, label="all tracks")
        for side, track in zip(vehicle.sides, truth.tracks, strict=True):
            ax.plot(time, track["torque"] * 1e-3, linewidth=0.9, label=side)
        ax.set_title("torque that the actuators deliver (true)")
        ax.set_ylabel(f"k{coordinate.force_unit}")

        if pressures:
            ax = next(rows)
            for name, signal in pressures.items():
                dashes = "--" if name.startswith("aux") else "-"  # both circuits share the load: their lines coincide
                ax.plot(signal.time_s, signal.value * 1e-6, dashes, linewidth=1.0, label=name)
            ax.set_title(f"line pressures as recorded ({vehicle.sensors.pressure_reference})")
            ax.set_ylabel("MPa")

        ax = next(rows)
        for side, track in zip(vehicle.sides, truth.tracks, strict=True):
            ax.plot(time, track["temperature"], label=side)
        ax.set_title("tread rubber temperature (true)")
        ax.set_ylabel("degC")
        for ax in axes[:, 0]:
            ax.margins(x=0.0)
            ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        axes[-1, 0].set_xlabel("time (s)")
