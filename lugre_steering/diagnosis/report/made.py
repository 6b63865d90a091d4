# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Sections of the report about the baseline it was judged against, how the result came about, and how to read it."""

from __future__ import annotations

from lugre_steering import units
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.fitting.keys import KEYS
from lugre_steering.fitting.problem import calibrations_for
from lugre_steering.report import words
from lugre_steering.report.markup import pairs, table, text
from lugre_steering.report.origin import made_by, plain_words


def baseline(diagnosis: Diagnosis) -> str:
    """Recalibrated values beside those of the sheet; where nothing was fitted, those of the sheet."""
    vehicle, sheet, rows = diagnosis.vehicle, diagnosis.sheet, []
    fitted = diagnosis.json["verdict"] != "insufficient_data"
    calibrated = {calibration.name for calibration in calibrations_for(vehicle)}
    for key in KEYS:
        now = key.read(vehicle)
        if key.calibration not in calibrated or now is None:
            continue
        unit, before = units.label(vehicle, key.unit), key.read(sheet) if sheet is not None else None
        change = f"{100.0 * (now / before - 1.0):+.1f} %" if before else ""
        name = f'{text(key.title)} <code class="id">{text(key.key)}</code>'
        values = [words.number(before), words.number(now), text(change)] if fitted else [words.number(now)]
        rows.append([name, *values, "" if unit == "1" else text(unit)])
    sentence = (
        "The published model with the fitted values is what missing physics was judged against, so that a wrong friction "
        "level is never reported as physics. They stand in <code>augmented.yaml</code>."
        if fitted
        else "Nothing was fitted: these are the values of the vehicle file, as they were."
    )
    header = ["value of the vehicle file", *(["sheet", "fitted", "change"] if fitted else ["sheet"]), "unit"]
    return f"<p>{sentence}</p>\n" + (table(header, rows, range(1, len(header) - 1), narrow=True) if rows else "")


def origin(diagnosis: Diagnosis) -> str:
    """Version, date, options and hashes, and what the vehicle file that was given says of itself."""
    said = diagnosis.sheet.provenance if diagnosis.sheet is not None else {}
    own = pairs([(name.replace("_", " "), plain_words(value)) for name, value in said.items()])
    return ("" if diagnosis.provenance is None else made_by(diagnosis.provenance)) + (
        f"<p>What the vehicle file says of itself:</p>\n{own}" if said else ""
    )


GLOSSARY = pairs(
    [
        ("recalibrated baseline", "the published model with friction level, stiffness and heat values fitted to these recordings"),
        ("augmented", "the recalibrated baseline with the found effects in it"),
        ("residual", "measured torque minus the model's torque"),
        ("of the torque", "share of the amplitude of the measured torque, which one sample in a hundred exceeds"),
        ("held out", "stretches that neither the search nor the fit saw; only they say whether a finding is real"),
        ("noise alone", "what sensor noise and the error of the estimated motion alone would leave as residual"),
        ("energy share", "share of the residual's energy that the effect explains"),
        ("masked share", "share of an effect's trace that recalibrating the baseline imitates, and so hides"),
        ("held-out gain", "by how much the fit that tried it, with the effects accepted before it, lowers the held-out error"),
        ("p", "chance that noise of this kind explains as much, all variants of the effect tried being paid for"),
        ("95 % interval", "from the scatter between stretches of the recording, so that slowly varying errors count in full"),
    ]
)
