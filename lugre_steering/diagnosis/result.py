# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis came to, with the names of the contract's JSON, and beside it the arrays that the report draws."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, get_args

from lugre_steering import units
from lugre_steering.diagnosis import law_picture
from lugre_steering.diagnosis.found_law import FoundLaw, Interval
from lugre_steering.errors import DataError
from lugre_steering.files import earlier_result, is_ours, write_record
from lugre_steering.gate import Facts, Gate, quality_facts
from lugre_steering.provenance import Provenance
from lugre_steering.recording import Array, BagFinding, unused_name
from lugre_steering.result import Result, frame, html, of_bag, writing_into
from lugre_steering.serialise import ADDED, IN_MEMORY, finite, mapped
from lugre_steering.vehicle import Vehicle, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

SCHEMA: Final = "lugre_steering/diagnosis/1"
AUGMENTED, FORMED = "augmented.yaml", "formed.yaml"
"""Vehicle files of a result: with what was found; and, where nothing was, with the form of the friction as laws."""

Verdict = Literal["consistent", "missing_physics", "unlisted_physics", "insufficient_data"]
Stage = Literal["motion", "contact", "thermal", "parallel_torque", "measurement"]
Share = Annotated[float, {"minimum": 0, "maximum": 1}]


def picture_names(names: Sequence[str]) -> list[str]:
    """File names of a report's pictures, in order: safe everywhere, and each its own."""
    stems: list[str] = []
    for name in names:
        stems.append(unused_name(re.sub(r"[^\w.-]+", "_", name), stems))
    return [f"{stem}.png" for stem in stems]


@dataclass(frozen=True)
class BagTrace:
    """One bag for the report, all (n,): time [s], measured torque, recalibrated baseline, augmented model [N m], and what
    each named effect contributes; coordinates by name for residual pictures."""

    name: str
    time: Array
    measured: Array
    baseline: Array
    augmented: Array
    held: Array
    contributions: Mapping[str, Array]
    intervals: Mapping[str, tuple[tuple[float, float], ...]]
    coordinates: Mapping[str, Array]
    heldout_Nm: tuple[float, float] | None = None
    """Held-out errors of the baseline and with the named effects, where one fit that saw none of these data was judged."""


@dataclass(frozen=True)
class Evidence:
    """One candidate in the table of evidence."""

    label: str
    title: str
    energy_share: float
    masked_share: float
    p_value: float
    heldout_gain: float | None
    verdict: str


@dataclass(frozen=True)
class Errors:
    """How well a model explains the torque: RMSE [N m] over all valid samples, and over those held out (None: none were)."""

    rmse_Nm: float
    heldout_rmse_Nm: float | None


@dataclass(frozen=True)
class Augmented(Errors):
    """The recalibrated model with the effects found; ``improvement`` is 1 - its held-out RMSE over the baseline's, with its
    95 % interval (None where nothing could be judged)."""

    improvement: float | None
    improvement_ci95: Interval | None
    vehicle: Vehicle = field(repr=False, metadata=IN_MEMORY)
    """The vehicle file of it, to replay, simulate or run live."""
    causal_rmse_Nm: float | None = field(default=None, metadata=ADDED)
    """On all valid samples, without looking ahead and with bristles relaxed at the start, as the live node must."""

    def save(self, path: str | Path, notes: Sequence[str] = ()) -> None:
        """Write the vehicle file (augmented.yaml of the command) with ``notes`` as comments."""
        save(self.vehicle, path, notes)


@dataclass(frozen=True)
class FrictionForm:
    """The form of this machine's friction as laws, where they hold on held-out data: in which vehicle ``file``, and how it does there;
    ``improvement`` over the same without them, with its 95 % interval."""

    file: str
    heldout_rmse_Nm: float | None
    improvement: float | None
    improvement_ci95: Interval | None
    causal_rmse_Nm: float | None
    """On all valid samples, without looking ahead and with bristles relaxed at the start, as the live node must."""
    laws: tuple[str, ...]
    """What each law changes, and along what."""
    vehicle: Vehicle = field(repr=False, metadata=IN_MEMORY)
    """The vehicle file of it."""


@dataclass(frozen=True)
class FittedValue:
    """One fitted parameter with its 95 % interval, in ``unit``."""

    value: float | None
    ci95: Interval
    unit: str


@dataclass(frozen=True)
class Place:
    """Where something acts in one bag: stretches [s] since its first stamp, and the range of the telling coordinate in ``unit``."""

    bag: str
    intervals_s: tuple[tuple[float, float], ...]
    coordinate: str
    range: Interval
    unit: str


@dataclass(frozen=True)
class NamedEffect:
    """One effect of the catalogue that the baseline leaves out.

    ``energy_share``: share of the baseline's residual energy that it explains; ``masked_share``: share of its signature that
    recalibrating the baseline had absorbed; both 0 to 1. ``parameters``: values by name (by line for an effect of a line).
    """

    id: Annotated[str, {"pattern": "^[a-z][a-z0-9_]*$"}]
    stage: Stage
    statement: str
    p_value: Share
    parameters: Mapping[str, FittedValue]
    where: tuple[Place, ...]
    energy_share: Share
    masked_share: Share
    indistinguishable_from: Annotated[tuple[str, ...], {"maxItems": 6}]
    largest_Nm: float | None = field(default=None, metadata=ADDED)
    """Largest torque it makes in the recordings [N m]."""
    largest_share: float | None = field(default=None, metadata=ADDED)
    """The same over the amplitude of the measured torque."""
    bends: bool = field(default=False, metadata=ADDED)
    """Whether it is only the nearest entry: what is left is structure, and more than its law may bend to."""


@dataclass(frozen=True)
class Unexplained:
    """What is left: whether it is structure, where, and the formula of the laws found for it; effects of which one alone would do what
    friction of another form than the model's does."""

    structured: bool
    description: str
    formula: str | None = None
    where: tuple[Place, ...] | None = None
    indistinguishable_from: tuple[str, ...] = field(default=(), metadata=ADDED)


@dataclass(frozen=True)
class Limit:
    """Smallest ``parameter`` of an effect, in ``unit``, that these recordings would have revealed; None: none that is possible."""

    parameter: str
    smallest: float | None
    unit: str


@dataclass(frozen=True)
class Experiment:
    """What to drive next, what that separates, and why."""

    manoeuvre: str
    separates: tuple[str, ...]
    why: str


def gate(wanted: Sequence[str]) -> Gate:
    """What a diagnosis can be made to fail for."""
    return Gate(wanted, ("skipped", "finding", *get_args(Verdict)))


def facts(result: Mapping[str, Any]) -> Facts:
    """What of it is so."""
    verdicts = {verdict: f"verdict {verdict}" if verdict == result["verdict"] else None for verdict in get_args(Verdict)}
    return {**quality_facts(result["data_quality"]), **verdicts}


@dataclass(frozen=True)
class Diagnosis(Result):
    """What a diagnosis came to, with the names of ``diagnosis.json``; torques in N m (the vehicle's force unit for a linear axis).

    ``noise_floor_Nm``: RMSE that noise alone would leave; ``detection_limits``: by effect; ``augmented.vehicle``: the vehicle with
    the effects in it. ``traces`` and ``evidence`` are kept in memory for pictures.
    """

    schema: Literal["lugre_steering/diagnosis/1"]
    bags: Annotated[tuple[str, ...], {"minItems": 1}]
    verdict: Verdict
    statement: Annotated[str, {"minLength": 20}]
    noise_floor_Nm: Annotated[float, {"exclusiveMinimum": 0}]
    baseline: Errors
    augmented: Augmented
    effects: tuple[NamedEffect, ...]
    unexplained: Unexplained
    detection_limits: Mapping[str, Limit]
    data_quality: tuple[BagFinding, ...]
    next_experiment: Experiment | None
    laws: tuple[FoundLaw, ...] = field(default=(), metadata=ADDED)
    """Found where no entry of the catalogue explains what is left; ``augmented.yaml`` runs them."""
    friction_form: FrictionForm | None = field(default=None, metadata=ADDED)
    """Laws that augmented.yaml has beside the effects, or formed.yaml where nothing is named; None where friction has the form of the
    model's, or no law of it holds."""
    headline: str = field(default="", metadata=ADDED)
    """How the statement begins: what, where, how much of the torque, what to do."""
    provenance: Provenance | None = field(default=None, metadata=ADDED)
    """By what version, when, with what options and from which files it was made; None for data in memory."""
    traces: tuple[BagTrace, ...] = field(default=(), repr=False, compare=False, metadata=IN_MEMORY)
    evidence: tuple[Evidence, ...] = field(default=(), repr=False, metadata=IN_MEMORY)
    coordinate_of: Mapping[str, str] = field(default_factory=dict, repr=False, metadata=IN_MEMORY)
    sheet: Vehicle | None = field(default=None, repr=False, metadata=IN_MEMORY)
    """The vehicle as it was given."""

    @property
    def vehicle(self) -> Vehicle:
        """The augmented vehicle."""
        return self.augmented.vehicle

    @property
    def found(self) -> tuple[NamedEffect | FoundLaw, ...]:
        """Named effects, then laws."""
        return *self.effects, *self.laws

    def in_words(self) -> Diagnosis:
        """The same in the words of the vehicle's coordinate, with None for every number that does not exist."""
        finished: Diagnosis = mapped(self, lambda value, _: finite(value))
        told: Diagnosis = units.in_words(self.vehicle, finished)
        return replace(told, laws=finished.laws)  # whose coordinates are keys, as in the vehicle file

    def save(self, out: str | Path) -> None:
        """Write diagnosis.json, augmented.yaml and, if there is a form of the friction, formed.yaml into a folder; replaces only an
        earlier diagnosis there."""
        with writing_into(out) as folder:
            earlier_result(folder, "diagnosis.json", SCHEMA, (AUGMENTED, FORMED))
            self.write(folder)

    def write(self, folder: Path) -> None:
        """The files into a folder where they may stand; that of an earlier diagnosis without a successor goes."""
        notes = self.provenance.lines() if self.provenance is not None else ()
        write_record(self.json, folder / "diagnosis.json")
        self.augmented.save(folder / AUGMENTED, notes)
        if self.friction_form is not None and self.friction_form.file == FORMED:
            save(self.friction_form.vehicle, folder / FORMED, notes)
        elif is_ours(folder / FORMED):
            (folder / FORMED).unlink()

    def to_frame(self, of: Literal["effects", "laws"] = "effects") -> DataFrame:
        """A pandas table: one row per fitted parameter of every named effect, or one row per law."""
        rows = {"effects": self._effect_rows, "laws": self._law_rows}
        if of not in rows:
            raise DataError(f"of: got {of!r}, expected 'effects' or 'laws'")
        return frame(rows[of]())

    def plot(self, bag: int | str = 0) -> Figure:
        """Torque and residual of one bag, by number or name, before and after, what each finding adds, and f of each law with its 95 % band
        over what the data say; shaded: where the effects act."""
        from lugre_steering.report.panels import Curve, Panel, panels

        if not self.traces:
            raise DataError(f"plot: there is nothing to draw, as the verdict is {self.verdict}: {self.statement}")
        trace = of_bag(self.traces, bag)
        unit, time, said = self.vehicle.coordinate.force_unit, trace.time, partial(units.words, self.vehicle)
        shaded = [span for effect in self.effects for span in trace.intervals.get(effect.id, ())]
        before, after = trace.measured - trace.baseline, trace.measured - trace.augmented
        rows = [
            Panel(f"{said('torque')}, bag {trace.name}", unit, [
                Curve(time, trace.measured, "measured", "measured"),
                Curve(time, trace.baseline, "recalibrated baseline", "original"),
                Curve(time, trace.augmented, "with what was found", "improved"),
            ]),
            Panel("residual", unit, [Curve(time, before, "before"), Curve(time, after, "after")], shaded),
        ]  # fmt: skip
        if self.found:
            rows.append(Panel("what each finding adds", unit, [Curve(time, trace.contributions[one.id], one.id) for one in self.found]))
        return panels(rows, [partial(self._draw_law, law) for law in self.laws])

    def _draw_law(self, law: FoundLaw, ax: Axes) -> None:
        law_picture.draw(ax, self.vehicle, law)
        ax.set_title(f"{law.id}: {law.title}")

    def _effect_rows(self) -> list[dict[str, object]]:
        return [
            {"effect": effect.id, "stage": effect.stage, "parameter": name, "value": found.value, "low": found.ci95[0],
             "high": found.ci95[1], "unit": found.unit, "energy_share": effect.energy_share, "masked_share": effect.masked_share,
             "p_value": effect.p_value}
            for effect in self.effects
            for name, found in effect.parameters.items()
        ]  # fmt: skip

    def _law_rows(self) -> list[dict[str, object]]:
        return [
            {"law": law.id, "title": law.title, "channel": law.channel, "coordinate": law.coordinate, "memory": law.memory,
             "memory_size": law.memory_size, "form": law.form, "values": dict(law.values), "low": law.range[0], "high": law.range[1],
             "largest_Nm": law.largest_Nm, "largest_share": law.largest_share, "heldout_gain": law.heldout_gain,
             "share_of_ceiling": law.share_of_ceiling}
            for law in self.laws
        ]  # fmt: skip

    def _repr_html_(self) -> str:
        return html(f"{self.vehicle.name}: {self.verdict}", self.statement, self._effect_rows(), self._law_rows())
