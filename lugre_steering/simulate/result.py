# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a simulation came to, with the names of the JSON of ``simulate``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lugre_steering.errors import DataError
from lugre_steering.recording import Kind, Recording, Signal
from lugre_steering.result import Result, folder_for, frame, html
from lugre_steering.serialise import IN_MEMORY
from lugre_steering.simulate.run import Simulated
from lugre_steering.simulate.write import START_NS, write_bag

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


@dataclass(frozen=True)
class Simulation(Result):
    """A synthetic recording: its size (angles in deg or as the key says, torque [N m], pressure [Pa], tread rubber [degC]), the
    effects that act in it, and the bag once it is written. ``run`` holds what the sensors saw and the truth behind it."""

    synthetic: bool
    bag: str | None
    picture: str | None
    picture_note: str | None
    duration_s: float
    largest_torque_Nm: float
    largest_angle_deg: float
    largest_pressure_Pa: float | None
    rubber_at_end_degC: tuple[float, ...]
    effects: Mapping[str, Mapping[str, float]]
    name: str = field(repr=False, metadata=IN_MEMORY)
    run: Simulated = field(repr=False, compare=False, metadata=IN_MEMORY)

    @classmethod
    def of(cls, name: str, run: Simulated) -> Simulation:
        """The result of a run that is not written anywhere yet."""
        truth = run.truth
        return cls(
            synthetic=True,
            bag=None,
            picture=None,
            picture_note=None,
            duration_s=float(truth.motion.time[-1]),
            largest_torque_Nm=float(np.abs(truth.torque).max()),
            largest_angle_deg=float(np.degrees(np.abs(truth.motion.theta).max())),
            largest_pressure_Pa=float(run.pressures.max()) if run.pressures.size else None,
            rubber_at_end_degC=tuple(float(t) for t in truth.tracks["temperature"][:, -1]),
            effects={effect.id: dict(effect.parameters) for effect in run.vehicle.effects},
            name=name,
            run=run,
        )

    @property
    def recording(self) -> Recording:
        """What the sensors saw, to replay, calibrate or diagnose."""
        of: dict[Kind, dict[str, Signal]] = {kind: {} for kind in Kind}
        for channel, signal in self.run.signals.items():
            of[channel.kind][channel.name] = signal
        return Recording(
            f"synthetic_{self.name}", START_NS, of[Kind.ANGLE], of[Kind.PRESSURE],
            air_temperature=next(iter(of[Kind.AIR_TEMPERATURE].values()), None),
            measured_torque=next(iter(of[Kind.TORQUE].values()), None),
        )  # fmt: skip

    def save(self, out: str | Path, storage: str = "mcap") -> Simulation:
        """Write the bag ``synthetic_<name>`` into a folder, never over another; the result names it."""
        folder = folder_for(out) / f"synthetic_{self.name}"
        if folder.exists():
            raise DataError(f"{folder}: exists already; recordings are never overwritten, choose another folder")
        write_bag(folder, self.run, f"{self.name}, vehicle '{self.run.vehicle.name}'", storage)
        return replace(self, bag=str(folder))

    def to_frame(self) -> DataFrame:
        """The truth as a pandas table, one row per step: time, angles, torque and rubber temperatures of all tracks."""
        truth, sides = self.run.truth, self.run.vehicle.sides
        columns = {"time_s": truth.motion.time}
        columns |= {f"angle_{side}_rad": theta for side, theta in zip(sides, truth.motion.theta, strict=True)}
        columns["torque_Nm"] = truth.torque
        columns |= {f"rubber_{side}_degC": row for side, row in zip(sides, truth.tracks["temperature"], strict=True)}
        return frame(columns)

    def plot(self) -> Figure:
        """True angles, torque and rubber temperatures."""
        from lugre_steering.report.panels import Curve, Panel, panels

        truth, vehicle = self.run.truth, self.run.vehicle
        time = truth.motion.time
        return panels([
            Panel("angle (true)", vehicle.coordinate.unit, [
                Curve(time, theta, side) for side, theta in zip(vehicle.sides, truth.motion.theta, strict=True)
            ]),
            Panel("torque that the actuators deliver (true)", vehicle.coordinate.force_unit, [
                Curve(time, truth.torque, "all tracks", "improved")
            ]),
            Panel("tread rubber temperature (true)", "degC", [
                Curve(time, row, side) for side, row in zip(vehicle.sides, truth.tracks["temperature"], strict=True)
            ]),
        ])  # fmt: skip

    def _repr_html_(self) -> str:
        rows = [{"quantity": key, "value": value} for key, value in self.json.items() if value is not None]
        return html(f"Simulation of {self.name}", "Synthetic recording.", rows)
