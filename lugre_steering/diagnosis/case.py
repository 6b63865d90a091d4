# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The recordings that are diagnosed, what was found about them on the way, and the answers where nothing can be concluded."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from lugre_steering.data.quality import Quality
from lugre_steering.diagnosis.conclude import experiment
from lugre_steering.diagnosis.result import SCHEMA, Augmented, Diagnosis, Errors, Experiment, Unexplained
from lugre_steering.errors import DataError
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.sheet import Suspect, WrongSheet, sheet_finding
from lugre_steering.recording import BagFinding, Finding, Recording
from lugre_steering.vehicle import Vehicle

ENTRIES = {
    "swapped_lines": "hydraulics.lines, or cap and rod lines, exchanged: {}", "swapped_angles": "topics.left and .right exchanged: {}",
    "sign_flipped": "sign of {}", "unit_suspect": "unit of {}", "angle_zero": "zero of the angle sensor {}",
}  # fmt: skip
"""What of the vehicle file a fault of the wiring may as well be; in braces: the topics."""


def by_bag(findings: Mapping[str, Finding]) -> list[BagFinding]:
    """Findings by the name of their recording as entries of ``data_quality``."""
    return [finding.in_bag(bag) for bag, finding in findings.items()]


class Case:
    """Recordings of one vehicle as their check left them, with the findings so far."""

    def __init__(self, vehicle: Vehicle, qualities: Sequence[Quality]) -> None:
        self.vehicle, self.qualities = vehicle, qualities
        self.findings = [finding.in_bag(quality.recording.name) for quality in qualities for finding in quality.findings]

    @property
    def usable(self) -> list[Recording]:
        return [quality.recording for quality in self.qualities]

    @property
    def blocking(self) -> list[str]:
        """What makes any verdict about physics meaningless."""
        return [f"{quality.recording.name}: {finding.statement}" for quality in self.qualities for finding in quality.blocking]

    def miswired(self) -> list[BagFinding]:
        """What is connected, or written in the vehicle file, otherwise than the recordings show: no recording can tell which."""
        doubted = {(f.finding, f.topic): f for f in self.findings if f.finding in ENTRIES}
        suspects = [Suspect(ENTRIES[what].format(topic), None, None, math.inf) for what, topic in doubted]
        said = "; ".join(finding.statement for finding in doubted.values())
        return [sheet_finding(f"the vehicle file and the recordings disagree: {said}", suspects)] if suspects else []

    def found(self, findings: Mapping[str, Finding]) -> None:
        """Keep findings by the name of their recording."""
        self.findings += by_bag(findings)

    def doubted(self, wrong: WrongSheet) -> None:
        """Physics is there whatever of the vehicle file is put right; something of it should be."""
        self.findings.append(wrong.finding())

    def undetermined(self, problem: Problem, lacking: str) -> Diagnosis:
        """The recordings lack what determines the baseline; with what to drive."""
        drive = "double-cycle: " + experiment.manoeuvres(problem)["double-cycle"].description
        advice = Experiment(drive, ("friction level", "stiffness"), lacking)
        seconds = sum(float(run.time[-1] - run.time[0]) for run in problem.runs)
        statement = f"The recording of {seconds:.0f} s does not determine the baseline: {lacking}. "
        return self.insufficient(statement + "Nothing can be said about missing physics.", advice)

    def unusable(self, error: DataError) -> Diagnosis:
        """Of a channel too little is left: what the check took out of it is the reason, and told first."""
        said = str(error)
        causes = [f"{f.bag}: {f.statement}" for f in self.findings if f.topic and f"'{f.topic}'" in said and said.startswith(f"{f.bag}: ")]
        if causes:
            return self.insufficient(f"The data must be put right first. {'; '.join(causes)} ({said}).")
        return self.insufficient(f"The data do not allow a diagnosis: {said}.")

    def wrong_sheet(self, wrong: WrongSheet) -> Diagnosis:
        """The vehicle file is another one's."""
        statement = (
            f"The vehicle file is not that of this vehicle, or not of these sensors: {wrong.statement}. "
            "No physics is named before that is put right."
        )
        return self.insufficient(statement, more=[wrong.finding()])

    def insufficient(self, statement: str, advice: Experiment | None = None, more: Sequence[BagFinding] = ()) -> Diagnosis:
        """The verdict when nothing can be concluded: the vehicle stays as it was."""
        vehicle, floor = self.vehicle, 1.0
        if vehicle.hydraulics is not None:
            floor = max(1.0, vehicle.sensors.pressure_noise_Pa * 5e-3)
        return Diagnosis(
            schema=SCHEMA, bags=tuple(recording.name for recording in self.usable), verdict="insufficient_data",
            statement=statement, noise_floor_Nm=floor, baseline=Errors(0.0, None),
            augmented=Augmented(0.0, None, None, None, vehicle), effects=(), unexplained=Unexplained(False, "not examined"),
            detection_limits={}, data_quality=(*self.findings, *more), next_experiment=advice,
        ).in_words()  # fmt: skip
