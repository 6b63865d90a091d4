# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The report of a diagnosis: one HTML page that opens offline, and its pictures beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lugre_steering.diagnosis.report import found, head, judged, made
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import DataError
from lugre_steering.files import write_text
from lugre_steering.report import page
from lugre_steering.report.available import no_pictures
from lugre_steering.report.page import Charts, Section


@dataclass(frozen=True)
class Written:
    """Files of a report, the page first, and what could not be made because a plotting library is missing."""

    files: list[Path]
    note: str | None


def write_report(diagnosis: Diagnosis, folder: Path) -> Written:
    """Write ``report.html`` and its PNGs into ``folder``; the page needs no plotting library, the pictures do."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        written, note = folder / "report.html", no_pictures()
        write_text(render(diagnosis), written)
        pictures = [] if note else _pictures(diagnosis, folder)
    except OSError as error:
        raise DataError(f"{folder}: the report cannot be written ({error.strerror or error})") from error
    return Written([written, *pictures], note)


def _pictures(diagnosis: Diagnosis, folder: Path) -> list[Path]:
    from lugre_steering.diagnosis.report.figures import draw_all  # needs matplotlib

    return draw_all(diagnosis, folder)


def render(diagnosis: Diagnosis) -> str:
    """The page."""
    charts, vehicle, result = Charts(), diagnosis.vehicle, diagnosis.json
    own = [vehicle.name, *result["bags"], *(CATALOGUE[effect["id"]].source for effect in result["effects"])]
    by = diagnosis.provenance
    return page.render(
        f"Diagnosis of {vehicle.name}",
        head.VERDICTS[result["verdict"]][1],
        head.head(diagnosis),
        _sections(diagnosis, charts),
        charts,
        f"{by.tool}, {by.date}" if by is not None else "lugre_steering",
        page.in_words_of(vehicle, own),
    )


def _sections(diagnosis: Diagnosis, charts: Charts) -> list[Section]:
    return [
        Section("next", "Next steps", "What to do next", head.next_steps(diagnosis)),
        Section("torque", "Torque", "Torque, measured and modelled", found.torque(diagnosis, charts)),
        Section("effects", "Found", "What was found", found.effects(diagnosis, charts)),
        Section("laws", "Laws", "A law that no entry of the catalogue is", found.found_laws(diagnosis, charts)),
        Section("experiment", "Experiment", "The next experiment", judged.experiment(diagnosis)),
        Section("heldout", "Held out", "Error on held-out data", judged.heldout(diagnosis)),
        Section("evidence", "Evidence", "Evidence for and against each candidate", judged.evidence(diagnosis)),
        Section("left", "Left over", "What is left", judged.left(diagnosis)),
        Section("limits", "Limits", "What could have gone unseen", judged.limits(diagnosis)),
        Section("quality", "Data quality", "Data quality", judged.quality(diagnosis)),
        Section("baseline", "Baseline", "The recalibrated baseline beside the sheet", made.baseline(diagnosis)),
        Section("origin", "Origin", "How this result came about", made.origin(diagnosis)),
        Section("reading", "Reading", "How to read this report", made.GLOSSARY),
    ]
