# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a calibration came to, with the names of ``calibration.json``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from lugre_steering.calibration.identify import Assumed, Combination
from lugre_steering.files import earlier_result, write_record
from lugre_steering.gate import Facts, Gate, quality_facts
from lugre_steering.provenance import Provenance
from lugre_steering.recording import BagFinding
from lugre_steering.result import Result, frame, html, writing_into
from lugre_steering.serialise import ADDED, IN_MEMORY, in_order
from lugre_steering.vehicle import Vehicle, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

SCHEMA: Final = "lugre_steering/calibration/1"
RECORD, VEHICLE = "calibration.json", "calibrated.yaml"


@dataclass(frozen=True)
class FittedKey:
    """One key of the vehicle file that the fit decided about; values in ``unit``.

    ``name``: the fitted parameter behind it; ``sheet``: before, ``value`` and ``ci95``: after; ``relative_sd`` and (of the sheet)
    ``prior_relative_sd``: relative standard deviations; ``prior_dominated``: the data add little to the sheet; ``advice``: the
    manoeuvre that would determine it.
    """

    name: str
    key: str
    unit: str
    sheet: float
    value: float
    ci95: tuple[float, float]
    relative_sd: float
    prior_relative_sd: float | None
    at_bound: Literal["low", "high"] | None
    prior_dominated: bool
    advice: str | None


@dataclass(frozen=True)
class Covariance:
    """Of the fitted values: logarithms of factors on the sheet (static_ratio: added to static over sliding friction)."""

    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class FittedErrors:
    """RMSE [N m] of sheet and calibrated vehicle on all samples, and what noise alone would leave."""

    sheet: float
    calibrated: float
    noise_floor: float


@dataclass(frozen=True)
class HeldOutErrors:
    """RMSE [N m] of sheet and calibrated vehicle on stretches that an extra fit did not see; None where there are none."""

    sheet: float | None
    calibrated: float | None


@dataclass(frozen=True)
class BagErrors:
    """One recording (or piece of one, where it is cut): seconds, samples fitted, RMSE [N m] of sheet and calibrated vehicle on them."""

    bag: str
    duration_s: float
    samples: int
    sheet: float | None
    calibrated: float | None


def gate(wanted: Sequence[str]) -> Gate:
    """What a calibration can be made to fail for."""
    return Gate(wanted, ("skipped", "finding", "undetermined", "at-bound"), ("rmse",))


def facts(result: Mapping[str, Any]) -> Facts:
    """What of it is so; ``rmse`` [N m] is that of the calibrated vehicle on held-out stretches, or where there are none on all."""
    bounds = [row["key"] for row in result["parameters"] if row["at_bound"]]
    weak = [row["key"] for row in result["parameters"] if row["prior_dominated"]]
    held = result["heldout_rmse_Nm"]["calibrated"]
    return {
        **quality_facts(result["data_quality"]),
        "undetermined": f"hardly determined: {', '.join(weak)}" if weak else None,
        "at-bound": f"at a bound: {', '.join(bounds)}" if bounds else None,
        "rmse": result["rmse_Nm"]["calibrated"] if held is None else held,
    }


@dataclass(frozen=True)
class Calibration(Result):
    """Fitted keys of a vehicle file with intervals, how well they explain the torque, and what the data cannot tell.

    ``duration_s``: of all recordings [s]; ``undetermined``: combinations that the data leave open; ``assumed``: what errors of sheet
    values taken as exact would move; ``calibrated``: the new vehicle. Errors in N m (the force unit of a linear axis).
    """

    schema: Literal["lugre_steering/calibration/1"]
    tool_version: str
    date: str
    bags: tuple[str, ...]
    vehicle: str
    priors: bool
    duration_s: float
    parameters: tuple[FittedKey, ...]
    covariance: Covariance
    rmse_Nm: FittedErrors
    heldout_rmse_Nm: HeldOutErrors
    undetermined: tuple[Combination, ...]
    assumed: tuple[Assumed, ...]
    data_quality: tuple[BagFinding, ...] = field(metadata=in_order("bag", "finding", "topic", "statement", "intervals_s"))
    statement: str
    calibrated: Vehicle = field(repr=False, metadata=IN_MEMORY)
    seen: Mapping[str, float | list[float]] = field(repr=False, metadata=IN_MEMORY)
    """Largest angle and rate in the recordings: ``angle_deg``, ``rate_deg_s``; of a linear axis ``position_m``, ``rate_m_s``; and
    ``rubber_degC``, the coldest and the warmest rubber."""
    picture: str | None = None
    picture_note: str | None = None
    per_bag: tuple[BagErrors, ...] = field(default=(), metadata=ADDED)
    provenance: Provenance | None = field(default=None, metadata=ADDED)
    """Options, and hashes of the files."""
    vehicle_name: str = field(default="", metadata=ADDED)
    """The name in the vehicle file; ``vehicle`` of earlier results is the file or the name, as the fit was asked for."""
    vehicle_file: str | None = field(default=None, metadata=ADDED)
    """That file as it was named, None where the vehicle was in memory."""

    def with_provenance(self) -> Vehicle:
        """The calibrated vehicle with a note of how its values came about."""
        note: Mapping[str, object] = {
            "tool": f"lugre_steering {self.tool_version} calibrate",
            "date": self.date,
            "data": list(self.bags),
            "sheet": self.vehicle,
            "heldout_rmse_Nm": self.json["heldout_rmse_Nm"],
            "seen": dict(self.seen),
            "ci95": {row.key: list(row.ci95) for row in self.parameters},
            "sheet_values": {row.key: row.sheet for row in self.parameters},
        }
        return self.calibrated.replace(provenance={**self.calibrated.provenance, "calibration": note})

    def save(self, out: str | Path) -> None:
        """Write calibration.json and calibrated.yaml into a folder; replaces only an earlier calibration there."""
        with writing_into(out) as folder:
            earlier_result(folder, RECORD, SCHEMA, (VEHICLE,))
            write_record(self.json, folder / RECORD)
            self.write_vehicle(folder)

    def write_vehicle(self, folder: Path) -> None:
        """The vehicle file into a folder where it may stand."""
        save(self.with_provenance(), folder / VEHICLE, self.provenance.lines() if self.provenance is not None else ())

    def to_frame(self) -> DataFrame:
        """One row per fitted key, as a pandas table."""
        return frame(self.json["parameters"])

    def plot(self) -> Figure:
        """Each fitted key over its sheet value, with its 95 % interval."""
        from lugre_steering.report.panels import intervals

        rows = [(row.key, row.value / row.sheet, (row.ci95[0] / row.sheet, row.ci95[1] / row.sheet)) for row in self.parameters]
        return intervals("95 % intervals", "value over sheet value", rows)

    def _repr_html_(self) -> str:
        rows = [
            {"key": r.key, "unit": r.unit, "sheet": r.sheet, "fitted": r.value, "from": r.ci95[0], "to": r.ci95[1]}
            for r in self.parameters
        ]
        return html(f"Calibration of {self.calibrated.name}", self.statement, rows)
