# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a replay came to, with the names of ``summary.json``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from lugre_steering.bag.find import Skipped
from lugre_steering.errors import DataError
from lugre_steering.estimator import Options
from lugre_steering.files import earlier_result, write_record
from lugre_steering.gate import Facts, Gate
from lugre_steering.online import Agreement
from lugre_steering.provenance import Provenance
from lugre_steering.recording import Array, Finding
from lugre_steering.result import Result, angle_column, frame, html, of_bag, torque_column, writing_into
from lugre_steering.serialise import ADDED, IN_MEMORY
from lugre_steering.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

SCHEMA: Final = "lugre_steering/replay/1"
RECORD = "summary.json"


def gate(wanted: Sequence[str]) -> Gate:
    """What a replay can be made to fail for."""
    return Gate(wanted, ("skipped", "finding", "no-residual"), ("rmse",))


def facts(summary: Mapping[str, Any]) -> Facts:
    """What of it is so; ``rmse`` [N m] is the largest of any recording."""
    found = [f"{bag['name']}: {finding['finding']}" for bag in summary["bags"] for finding in bag["findings"]]
    bare = [bag["name"] for bag in summary["bags"] if bag["fit"] is None]
    return {
        "skipped": f"{len(summary['skipped'])} skipped" if summary["skipped"] else None,
        "finding": ", ".join(found) or None,
        "no-residual": f"no residual of {', '.join(bare)}" if bare else None,
        "rmse": max((bag["fit"]["rmse_Nm"] for bag in summary["bags"] if bag["fit"]), default=None),
    }


@dataclass(frozen=True, eq=False)
class Series:
    """The estimates of one bag, n of them, and its m residuals; times [s] since the first stamp.

    ``angle`` [rad] and ``rubber_temperature`` [degC] by side, ``torque`` (n,) of all tracks [N m]; ``measured`` (m,) [N m] from
    pressures or a torque sensor and ``residual`` (m,) [N m], measured minus estimate. Of a linear axis ``angle_unit`` and
    ``torque_unit`` are its own, m and N.
    """

    time_s: Array
    angle: Mapping[str, Array]
    torque: Array
    rubber_temperature: Mapping[str, Array]
    residual_time_s: Array
    measured: Array
    residual: Array
    angle_unit: str
    torque_unit: str


@dataclass(frozen=True)
class InputCounts:
    """What came of one input: its topic (None: not recorded), samples used, rejected and noted ones by reason."""

    topic: str | None
    used: int
    rejected: Mapping[str, int]
    noted: Mapping[str, int]


@dataclass(frozen=True)
class ReplayedBag:
    """One bag through the estimator: ``fit`` against the measured torque, or ``fit_note`` why there is none; inputs by name.

    ``series``: the torques themselves, where they were kept in memory rather than written into a bag.
    """

    bag: str
    name: str
    duration_s: float
    messages: int
    estimates: int
    fit: Agreement | None
    fit_note: str | None
    samples: Mapping[str, InputCounts]
    saturated_rubber_table_steps: int
    findings: tuple[Finding, ...]
    picture: str | None = None
    picture_note: str | None = None
    page: str | None = field(default=None, metadata=ADDED)
    """File of the page beside the record."""
    look_ahead_rmse_Nm: float | None = field(default=None, metadata=ADDED)
    """Error of the model with the motion known from all samples, where it was asked for: without what a live motion does not know."""
    series: Series | None = field(default=None, repr=False, compare=False, metadata=IN_MEMORY)

    def kept(self) -> Series:
        """The series, or an error where the results went into a bag."""
        if self.series is None:
            raise DataError(f"{self.name}: the torques were written into a bag and not kept; replay without 'out' to keep them")
        return self.series

    def to_frame(self) -> DataFrame:
        """One row per estimate: time, angles, torque, temperatures, and the residual where there is one of the same instant."""
        s = self.kept()
        columns = {"time_s": s.time_s, **{angle_column(side, s.angle_unit): values for side, values in s.angle.items()}}
        columns[torque_column("torque", s.torque_unit)] = s.torque
        columns |= {f"rubber_{side}_degC": values for side, values in s.rubber_temperature.items()}
        for what, values in (("measured", s.measured), ("residual", s.residual)):
            name = torque_column(what, s.torque_unit)
            columns[name] = np.full(s.time_s.size, np.nan)
            columns[name][np.searchsorted(s.time_s, s.residual_time_s)] = values
        return frame(columns)


@dataclass(frozen=True)
class Replay(Result):
    """Torques that the estimator gives for recordings; ``overall``: agreement with the measured torque over all of them.

    ``vehicle_name``: the name in the vehicle file; ``vehicle_file``: that file as it was named, None where the vehicle was in memory;
    ``vehicle``: the file, or where there is none the name (kept for readers of earlier results); ``torque_unit``: N m, or the force
    unit of a linear axis; ``options``: the timing rules that were used; ``skipped``: what was named and gave no torque, with the reason.
    """

    schema: Literal["lugre_steering/replay/1"]
    vehicle: str
    torque_unit: str
    options: Options
    bags: tuple[ReplayedBag, ...]
    overall: Agreement | None
    provenance: Provenance | None = field(default=None, metadata=ADDED)
    skipped: tuple[Skipped, ...] = field(default=(), metadata=ADDED)
    vehicle_name: str = field(default="", metadata=ADDED)
    vehicle_file: str | None = field(default=None, metadata=ADDED)

    @classmethod
    def begun(cls, vehicle: Vehicle, file: str | Path | None, options: Options, origin: Provenance, skipped: Sequence[Skipped]) -> Replay:
        """Of no recording yet."""
        said = None if file is None else str(file)
        return cls(
            SCHEMA, said or vehicle.name, vehicle.coordinate.force_unit, options, (), None, origin, tuple(skipped),
            vehicle_name=vehicle.name, vehicle_file=said,
        )  # fmt: skip

    def save(self, out: str | Path) -> None:
        """Write summary.json into a folder; replaces only an earlier one there."""
        with writing_into(out) as folder:
            earlier_result(folder, RECORD, SCHEMA, ())
            write_record(self.json, folder / RECORD)

    def to_frame(self) -> DataFrame:
        """One row per estimate of all bags, as a pandas table; the column ``bag`` tells them apart."""
        tables = [bag.to_frame().assign(bag=bag.name) for bag in self.bags]
        import pandas as pd

        return pd.concat(tables, ignore_index=True)

    def plot(self, bag: int | str = 0) -> Figure:
        """Angles, torques and residual of one bag, by number or name."""
        from lugre_steering.report.panels import Curve, Panel, panels

        s, unit = of_bag(self.bags, bag).kept(), self.torque_unit
        angle_name, torque_name = ("angle", "torque") if s.angle_unit == "rad" else ("position", "force")
        torque = Panel(f"{torque_name} that the actuators deliver", unit, [Curve(s.time_s, s.torque, "estimate", "improved")])
        if s.measured.size:
            torque.curves.insert(0, Curve(s.residual_time_s, s.measured, "measured", "measured"))
        return panels([
            Panel(angle_name, s.angle_unit, [Curve(s.time_s, angle, side) for side, angle in s.angle.items()]),
            torque,
            Panel("residual", unit, [Curve(s.residual_time_s, s.residual, "measured minus estimate")]),
        ])  # fmt: skip

    def _repr_html_(self) -> str:
        rows = [
            {"bag": bag.name, "duration (s)": bag.duration_s, "estimates": bag.estimates}
            | ({f"RMSE ({self.torque_unit})": bag.fit.rmse_Nm, "R2": bag.fit.r2} if bag.fit else {"note": bag.fit_note})
            for bag in self.bags
        ]
        return html(f"Replay with {self.vehicle_name or self.vehicle}", f"Vehicle file: {self.vehicle_file or 'none, in memory'}", rows)
