# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a simulation came to, with the names of the JSON of ``simulate``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from lugre_steering import units
from lugre_steering.errors import DataError
from lugre_steering.recording import Kind, Recording, Signal
from lugre_steering.result import Result, angle_column, frame, html, torque_column, writing_into
from lugre_steering.serialise import IN_MEMORY
from lugre_steering.simulate.run import Simulated
from lugre_steering.simulate.write import START_NS, check_storage, write_bag

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


SCHEMA: Final = "lugre_steering/simulation/1"


@dataclass(frozen=True)
class Simulation(Result):
    """A synthetic recording: its size (torque in ``torque_unit``, angle or position in ``coordinate_unit``, and angles in deg too,
    pressure [Pa], tread rubber [degC]), the effects that act in it, and the bag once it is written. ``run`` holds what the sensors saw
    and the truth behind it."""

    schema: Literal["lugre_steering/simulation/1"]
    synthetic: bool
    bag: str | None
    picture: str | None
    picture_note: str | None
    duration_s: float
    largest_torque_Nm: float
    torque_unit: str
    largest_angle_deg: float | None
    """None for a linear axis, which has no angle."""
    largest_coordinate: float
    coordinate_unit: str
    largest_pressure_Pa: float | None
    rubber_at_end_degC: tuple[float, ...]
    effects: Mapping[str, Mapping[str, float]]
    name: str = field(repr=False, metadata=IN_MEMORY)
    run: Simulated = field(repr=False, compare=False, metadata=IN_MEMORY)

    @classmethod
    def of(cls, name: str, run: Simulated) -> Simulation:
        """The result of a run that is not written anywhere yet."""
        truth, coordinate = run.truth, run.vehicle.coordinate
        largest = float(np.abs(truth.motion.theta).max())
        return cls(
            schema=SCHEMA,
            synthetic=True,
            bag=None,
            picture=None,
            picture_note=None,
            duration_s=float(truth.motion.time[-1]),
            largest_torque_Nm=float(np.abs(truth.torque).max()),
            torque_unit=coordinate.force_unit,
            largest_angle_deg=math.degrees(largest) if coordinate.unit == "rad" else None,
            largest_coordinate=largest,
            coordinate_unit=coordinate.unit,
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
        check_storage(storage)
        with writing_into(out) as parent:
            folder = parent / f"synthetic_{self.name}"
            if folder.exists():
                raise DataError(f"{folder}: exists already; recordings are never overwritten, choose another folder")
            write_bag(folder, self.run, f"{self.name}, vehicle '{self.run.vehicle.name}'", storage)
        return replace(self, bag=str(folder))

    def to_frame(self) -> DataFrame:
        """The truth as a pandas table, one row per step: time, angles, torque and rubber temperatures of all tracks."""
        truth, sides, coordinate = self.run.truth, self.run.vehicle.sides, self.run.vehicle.coordinate
        columns = {"time_s": truth.motion.time}
        columns |= {angle_column(side, coordinate.unit): theta for side, theta in zip(sides, truth.motion.theta, strict=True)}
        columns[torque_column("torque", coordinate.force_unit)] = truth.torque
        columns |= {f"rubber_{side}_degC": row for side, row in zip(sides, truth.tracks["temperature"], strict=True)}
        return frame(columns)

    def plot(self) -> Figure:
        """True angles, torque and rubber temperatures."""
        from lugre_steering.report.panels import Curve, Panel, panels

        truth, vehicle = self.run.truth, self.run.vehicle
        time = truth.motion.time
        return panels([
            Panel(units.words(vehicle, "angle (true)"), vehicle.coordinate.unit, [
                Curve(time, theta, side) for side, theta in zip(vehicle.sides, truth.motion.theta, strict=True)
            ]),
            Panel(units.words(vehicle, "torque that the actuators deliver (true)"), vehicle.coordinate.force_unit, [
                Curve(time, truth.torque, "all tracks", "improved")
            ]),
            Panel("tread rubber temperature (true)", "degC", [
                Curve(time, row, side) for side, row in zip(vehicle.sides, truth.tracks["temperature"], strict=True)
            ]),
        ])  # fmt: skip

    def _repr_html_(self) -> str:
        rows = [{"quantity": key, "value": value} for key, value in self.json.items() if value is not None]
        return html(f"Simulation of {self.name}", "Synthetic recording.", rows)
