# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Sections of the report about how it was judged: held-out error, evidence, what is left, the next experiment, limits."""

from __future__ import annotations

from lugre_steering import units
from lugre_steering.counted import counted
from lugre_steering.diagnosis.report import plots
from lugre_steering.diagnosis.report.names import called, parameter_called, place
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.report import words
from lugre_steering.report.markup import Row, bar, code, pairs, table, text

EVIDENCE_SHOWN = 12
"""More rows are folded away."""


def heldout(diagnosis: Diagnosis) -> str:
    """Errors of the two models as bars, per bag where one fit was judged, and the noise."""
    result, vehicle = diagnosis.json, diagnosis.vehicle
    if result["baseline"]["heldout_rmse_Nm"] is None:
        return ""
    rows = plots.heldout_rows(diagnosis)
    largest = max(max(before, after) for _, before, after, _ in rows)
    found = bool(plots.styles(diagnosis))

    def shown(value: float, style: str) -> str:
        return f"{bar(value / largest, style)}{text(words.torque(vehicle, value))}"

    header = ["", "recalibrated baseline", *(["with what was found", "95 % interval"] if found else [])]
    cells = []
    for name, before, after, spread in rows:
        between = " … ".join(text(words.torque(vehicle, end)) for end in spread) if spread else ""
        cells.append([text(name), shown(before, "baseline"), *([shown(after, "augmented"), between] if found else [])])
    on_all = [text(words.torque(vehicle, result[key]["rmse_Nm"])) for key in ("baseline", "augmented")]
    cells.append(["all data, fitted ones too", *on_all, ""][: len(header)])
    return (
        "<p>Root mean square torque error on stretches kept away from both the search and the fit, with a gap to them longer than the "
        f"memory of the friction. Noise alone makes {text(words.torque(vehicle, result['noise_floor_Nm']))}.</p>\n" + table(header, cells)
    )


def evidence(diagnosis: Diagnosis) -> str:
    """Every candidate with its fingerprint, its gain and its outcome."""
    if not diagnosis.evidence:
        return ""
    header = ["candidate", "energy share", "masked", "held-out gain", "p", "outcome"]
    style, rows = plots.styles(diagnosis), []
    for row in diagnosis.evidence:
        known = row.label.split("[")[0]
        mark = f"var(--series-{style[known]})" if row.verdict == "named" and known in style else None
        name = called(diagnosis, row.label)
        if name == text(row.label):  # no entry of the catalogue here
            name = f'{text(row.title)} <code class="id">{text(row.label)}</code>'
        share = f"{bar(row.energy_share)}{text(words.percent(row.energy_share))}"
        numbers = [text(words.percent(row.masked_share)), text(words.percent(row.heldout_gain)), text(words.chance(row.p_value))]
        rows.append(Row([name, share, *numbers, text(row.verdict)], mark))
    numeric = (1, 2, 3, 4)
    rest = rows[EVIDENCE_SHOWN:]
    more = f"<details><summary>{len(rest)} more</summary>{table(header, rest, numeric)}</details>\n" if rest else ""
    return (
        "<p>Every effect of the catalogue was compared with what the recalibrated baseline leaves over. The best were "
        "then fitted inside the simulator together with the baseline and judged on held-out data.</p>\n"
        + table(header, rows[:EVIDENCE_SHOWN], numeric)
        + more
    )


def left(diagnosis: Diagnosis) -> str:
    """What nothing listed explains, where it lives, and a formula for it."""
    found = diagnosis.json["unexplained"]
    where = found["where"] if isinstance(found["where"], list) else []
    description = found["description"] or "Nothing beyond noise."
    formula = (
        "<p>As a formula (a description, not a cause):</p>\n"
        f'<div class="formula">{text(found["formula"])}</div>\n'
        if found["formula"]
        else ""
    )
    return (
        f"<p>{text(description[:1].upper() + description[1:])}{'' if description.endswith('.') else '.'}</p>\n"
        + formula
        + (table(["bag", "during", "98 % of the energy lies along"], [place(diagnosis, entry) for entry in where]) if where else "")
    )


def experiment(diagnosis: Diagnosis) -> str:
    """What to drive next, and why."""
    advice = diagnosis.json["next_experiment"]
    if not advice:
        insufficient = diagnosis.json["verdict"] == "insufficient_data"
        said = "The data come first: put right what is told above." if insufficient else "None is needed to settle what was found."
        return f'<p class="note">{said}</p>'
    return pairs(
        [
            ("manoeuvre", f"<strong>{text(advice['manoeuvre'])}</strong>"),
            ("separates", ", ".join(called(diagnosis, name) for name in advice["separates"])),
            ("why", text(advice["why"])),
        ]
    )


def limits(diagnosis: Diagnosis) -> str:
    """The smallest effect of each kind that would have shown."""
    found = diagnosis.json["detection_limits"]
    if not found:
        return ""
    rows = []
    for name, limit in found.items():
        unit = units.label(diagnosis.vehicle, limit["unit"])
        size = "hidden at any size" if limit["smallest"] is None else words.number(limit["smallest"], 3)
        parameter = parameter_called(name, limit["parameter"])
        rows.append([called(diagnosis, name), parameter, size, text(unit) if unit != "1" and limit["smallest"] else ""])
    made = table(["effect", "parameter", "smallest that would have shown", "unit"], rows, numeric=(2,))
    if len(rows) > EVIDENCE_SHOWN:
        opened = " open" if diagnosis.json["verdict"] == "consistent" else ""
        made = f"<details{opened}><summary>{counted(len(rows), 'effect')}</summary>{made}</details>\n"
    return "<p>An effect smaller than this could be present without these recordings showing it.</p>\n" + made


def quality(diagnosis: Diagnosis) -> str:
    """What was found about the recordings themselves."""
    findings = diagnosis.json["data_quality"]
    if not findings:
        return "<p>No stuck, dropped, spiking, swapped or sign-flipped channel and no clock skew was found.</p>"
    rows = [
        [
            text(f["statement"]), text(f["bag"]), code(f["topic"]) if f["topic"] else "", words.spans(f["intervals_s"]),
            text(f["finding"].replace("_", " ")),
        ]
        for f in findings
    ]
    return table(["what it means", "bag", "topic", "during", "finding"], rows)
