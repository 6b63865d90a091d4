# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The report of a diagnosis: one HTML page that opens offline, and its pictures beside it."""

from __future__ import annotations

import base64
import html
import json
import math
import re
import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from lugre_steering import units
from lugre_steering.calibration.calibrate import KEYS
from lugre_steering.diagnosis.report import laws, plots
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import DataError, LugreSteeringError
from lugre_steering.files import write_text
from lugre_steering.fitting.problem import calibrations_for
from lugre_steering.report import words
from lugre_steering.vehicle import Vehicle

VERDICTS = {
    "consistent": ("Consistent with the model", "#1a7f37"),
    "missing_physics": ("Physics is missing from the model", "#b42318"),
    "unlisted_physics": ("Structure that no listed effect explains", "#8a3ffc"),
    "insufficient_data": ("The data do not decide", "#8a6100"),
}
STAGES = {
    "motion": "what the contact really does against the measured angle",
    "contact": "friction of rubber on the ground",
    "thermal": "where the friction heat goes",
    "parallel_torque": "torque on the steering axis beside the contact",
    "measurement": "hydraulics and sensors",
}
EVIDENCE_SHOWN = 12
EXACT_LAW = "The intervals take the form of the law as exact; where nature bends it, values lie further off than they say."


@dataclass(frozen=True)
class Section:
    anchor: str
    short: str
    title: str
    content: str


@dataclass(frozen=True)
class Written:
    """Files of a report, the page first, and what could not be made because a plotting library is missing."""

    files: list[Path]
    note: str | None


def write_report(diagnosis: Diagnosis, folder: Path) -> Written:
    """Write ``report.html`` and its PNGs into ``folder``.

    Plots are interactive with plotly, pictures without it, and left out with neither; the words and tables are always
    there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        pictures, notes = _pictures(diagnosis, folder)
        library = _plotly()
        if not library:
            notes.append("interactive plots need plotly")
        page = folder / "report.html"
        write_text(render(diagnosis, library, pictures), page)
    except OSError as error:
        raise DataError(f"{folder}: the report cannot be written ({error.strerror or error})") from error
    note = f"report: {'; '.join(notes)}: install 'lugre_steering[report]'" if notes else None
    return Written([page, *pictures.values()], note)


def _pictures(diagnosis: Diagnosis, folder: Path) -> tuple[dict[str, Path], list[str]]:
    try:
        from lugre_steering.diagnosis.report.figures import draw_all
    except LugreSteeringError:  # raised where matplotlib is missing
        return {}, ["pictures need matplotlib"]
    return draw_all(diagnosis, folder), []


def _plotly() -> str:
    """The source of plotly.js as the Python package ships it; empty where it is missing."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        return ""
    source: str = get_plotlyjs()
    return source


def render(diagnosis: Diagnosis, library: str, pictures: Mapping[str, Path] | None = None) -> str:
    """The page. ``library`` is the source of plotly.js; without it the PNGs in ``pictures`` take the place of plots."""
    drawing = _Drawing(bool(library), pictures or {})
    sections = [section for section in _sections(diagnosis, drawing) if section.content]
    body = [_head(diagnosis)]
    body += [f'<section id="{s.anchor}"><h2>{s.title}</h2>\n{s.content}</section>' for s in sections]
    vehicle = diagnosis.vehicle
    own = [vehicle.name, *diagnosis.json["bags"], *(CATALOGUE[e["id"]].source for e in diagnosis.json["effects"])]
    specs = _named_for(vehicle, drawing.specs) if units.is_linear(vehicle) else drawing.specs
    links = [("verdict", "Verdict"), *((section.anchor, section.short) for section in sections)]
    page = resources.files(__package__).joinpath("diagnosis.html").read_text(encoding="utf-8")
    return string.Template(page).substitute(
        title=_text(f"Diagnosis of {diagnosis.vehicle.name}"),
        accent=VERDICTS[diagnosis.json["verdict"]][1],
        nav=_in_words(vehicle, "".join(f'<a href="#{anchor}">{words}</a>' for anchor, words in links)),
        body=_in_words(vehicle, "\n".join(body), own),
        # Inside a script element only the letters of its end tag would be dangerous.
        plots=json.dumps(specs, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
        library=library.replace("</script", "<\\/script") or "var Plotly = {};",
    )


def _in_words(vehicle: Vehicle, page: str, own: Sequence[str] = ()) -> str:
    """The words of a page in those of a linear axis; tags, code and the user's ``own`` names stay."""
    if not units.is_linear(vehicle):
        return page
    kept = "|".join(["<code>.*?</code>", "<[^>]*>", *(re.escape(_text(name)) for name in own if name)])
    parts = re.split(f"({kept})", page, flags=re.DOTALL)
    return "".join(part if i % 2 else units.words(vehicle, part) for i, part in enumerate(parts))


def _named_for(vehicle: Vehicle, tree: Any) -> Any:
    """Plots with their titles and names in the words of this vehicle."""
    if isinstance(tree, dict):
        return {key: _named_for(vehicle, item) for key, item in tree.items()}
    if isinstance(tree, list):
        return [_named_for(vehicle, item) for item in tree]
    return units.words(vehicle, tree) if isinstance(tree, str) else tree


class _Drawing:
    """Places for plots, and their figures; or pictures in their stead."""

    def __init__(self, interactive: bool, pictures: Mapping[str, Path]) -> None:
        self.interactive, self.pictures = interactive, pictures
        self.specs: dict[str, plots.Spec] = {}

    def place(self, key: str, spec: plots.Spec | None, words: str, style: str = "") -> str:
        """``words`` say what is to be seen, for those who cannot see it."""
        if spec is None:
            return ""
        classes = f"plot {style}".strip()
        if self.interactive:
            name = f"plot-{len(self.specs)}"
            self.specs[name] = spec
            height = spec["layout"]["height"]
            about = f'id="{name}" role="img" aria-label="{_text(words)}" style="height:{height}px"'
            return f'<div class="{classes}" {about}></div>'
        if key in self.pictures:
            data = base64.b64encode(self.pictures[key].read_bytes()).decode()
            return f'<div class="{classes}"><img alt="{_text(words)}" src="data:image/png;base64,{data}"></div>'
        return '<p class="note">No plot: neither plotly nor matplotlib is installed.</p>'


def _sections(diagnosis: Diagnosis, drawing: _Drawing) -> list[Section]:
    return [
        Section("next", "Next steps", "What to do next", _next_steps(diagnosis)),
        Section("torque", "Torque", "Torque, measured and modelled", _torque(diagnosis, drawing)),
        Section("effects", "Found", "What was found", _effects(diagnosis, drawing)),
        Section("laws", "Laws", "A law that no entry of the catalogue is", _laws(diagnosis, drawing)),
        Section("heldout", "Held out", "Error on held-out data", _heldout(diagnosis, drawing)),
        Section("evidence", "Evidence", "Evidence for and against each candidate", _evidence(diagnosis)),
        Section("left", "Left over", "What is left", _left(diagnosis)),
        Section("experiment", "Experiment", "The next experiment", _experiment(diagnosis)),
        Section("limits", "Limits", "What could have gone unseen", _limits(diagnosis)),
        Section("quality", "Data quality", "Data quality", _quality(diagnosis)),
        Section("baseline", "Baseline", "The recalibrated baseline", _baseline(diagnosis)),
        Section("reading", "Reading", "How to read this report", _GLOSSARY),
    ]


# ----------------------------------------------------------------- words


def _text(value: object) -> str:
    """Any words as HTML; numbers are not parted from their unit."""
    return html.escape(str(value), quote=True).replace(" N m", "\u00a0N\u00a0m").replace(" %", "\u00a0%")


def _table(
    header: Sequence[str], rows: Sequence[Sequence[str]], numeric: Sequence[int] = (), narrow: bool = False
) -> str:
    """Cells are HTML already; ``numeric`` columns are set flush right."""
    return _table_of(header, [("", row) for row in rows], numeric, narrow)


def _table_of(
    header: Sequence[str],
    rows: Sequence[tuple[str, Sequence[str]]],
    numeric: Sequence[int] = (),
    narrow: bool = False,
) -> str:
    """The same with attributes for each row."""
    style = [' class="n"' if i in numeric else "" for i in range(len(header))]
    head = "".join(f"<th{s}>{cell}</th>" for s, cell in zip(style, header, strict=True))
    body = "".join(
        f"<tr{marks}>{''.join(f'<td{s}>{cell}</td>' for s, cell in zip(style, row, strict=True))}</tr>\n"
        for marks, row in rows
    )
    style_of_table = ' class="narrow"' if narrow else ""
    return f"<table{style_of_table}><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table>\n"


def _pairs(rows: Sequence[tuple[str, str]]) -> str:
    return '<dl class="pairs">' + "".join(f"<dt>{name}</dt><dd>{value}</dd>" for name, value in rows if value) + "</dl>"


def _head(diagnosis: Diagnosis) -> str:
    result, unit = diagnosis.json, diagnosis.vehicle.coordinate.force_unit
    words, _ = VERDICTS[result["verdict"]]
    bags = ", ".join(_text(bag) for bag in result["bags"])
    return (
        f'<header id="verdict"><p class="over">{_text(diagnosis.vehicle.name)} &middot; {bags}</p>\n'
        f'<h1>{words}</h1>\n<div class="verdict"><span class="chip">{_text(result["verdict"])}</span>\n'
        f"<p>{_text(result['statement'])}</p></div>\n{_facts(result, unit)}</header>"
    )


def _facts(result: Mapping[str, Any], unit: str) -> str:
    before, after = result["baseline"]["heldout_rmse_Nm"], result["augmented"]["heldout_rmse_Nm"]
    facts = []
    if before is not None:
        facts.append(
            ("held-out error, baseline", f"{words.number(before, 3)} {_text(unit)}", "recalibrated on the same data")
        )
    if result["effects"]:
        facts.append(("held-out error, with what was found", f"{words.number(after, 3)} {_text(unit)}", ""))
        ends = result["augmented"]["improvement_ci95"]
        between = f"95 % interval {words.percent(ends[0])} to {words.percent(ends[1])}" if ends else ""
        facts.append(("improvement", words.percent(result["augmented"]["improvement"]), between))
    if before is not None:
        facts.append(
            (
                "noise floor",
                f"{words.number(result['noise_floor_Nm'], 3)} {_text(unit)}",
                "noise and motion error alone",
            )
        )
    for effect in result["effects"]:
        small = (
            "or " + ", ".join(map(_text, effect["indistinguishable_from"])) if effect["indistinguishable_from"] else ""
        )
        facts.append(("effect found", _text(effect["id"]), small))
    cells = "".join(f"<div><dt>{name}</dt><dd>{value}<small>{small}</small></dd></div>" for name, value, small in facts)
    return f'<dl class="facts">{cells}</dl>\n' if cells else ""


def _next_steps(diagnosis: Diagnosis) -> str:
    result, steps = diagnosis.json, []
    bad = len(result["data_quality"])
    if result["verdict"] == "insufficient_data":
        steps.append("Put the data right or record again; nothing about the physics can be concluded from these.")
    if bad:
        steps.append(
            f'Look at the {bad} finding{"s" if bad > 1 else ""} under <a href="#quality">data quality</a> first.'
        )
    for effect in result["effects"]:
        if effect["indistinguishable_from"]:
            rivals = ", ".join(map(_text, effect["indistinguishable_from"]))
            steps.append(
                f"Do not rely on the name <code>{_text(effect['id'])}</code> alone: with these data {rivals} would "
                "explain the same. The augmented model predicts well either way."
            )
    if {effect["id"] for effect in result["effects"]} & {entry.id for entry in diagnosis.vehicle.effects}:
        steps.append(
            "Use the found physics: <code>augmented.yaml</code> beside this page is the vehicle file with it. "
            "<code>lugre-steering replay BAG --vehicle augmented.yaml --out DIR</code> shows the smaller residual, and "
            "the live node publishes the better torque with <code>vehicle_file:=augmented.yaml</code>."
        )
        steps.append("Check it on the machine: the stretches and ranges below say where and when it acts.")
    if result.get("laws"):
        steps.append(
            "Use the law that was found: <code>augmented.yaml</code> has it under <code>laws</code>, and replay, the live node and the "
            "next diagnosis run it. Replay tells where its coordinate leaves the range seen (finding <code>law_left</code>)."
        )
        steps.append("To keep it under a name of your own: <code>lugre-steering effects --add augmented.yaml --id NAME</code>.")
    if result["verdict"] == "consistent":
        steps.append(
            "Keep the recalibrated baseline (<code>augmented.yaml</code>). What is below the "
            '<a href="#limits">detection limits</a> of these data may still be there.'
        )
    if result["unexplained"]["structured"]:
        steps.append('Look at <a href="#left">what is left</a>: part of the residual is structure, not noise.')
    if result["next_experiment"]:
        steps.append(
            f'Drive the <a href="#experiment">next experiment</a>: {_text(result["next_experiment"]["manoeuvre"])}.'
        )
    return "<ol>" + "".join(f"<li>{step}</li>" for step in steps) + "</ol>\n"


def _torque(diagnosis: Diagnosis, drawing: _Drawing) -> str:
    if not diagnosis.traces:
        return '<p class="note">No model was fitted, so there is nothing to draw.</p>'
    found = bool(diagnosis.json["effects"])
    coloured = "; coloured, where an effect acts, shaded below unless that is nearly everywhere" if found else ""
    note = (
        '<p class="note">Drag to zoom, double-click to go back; click a legend entry to hide a curve. '
        f"Bars on top: grey, stretches that neither search nor fit saw{coloured}.</p>\n"
    )
    parts = [note] if drawing.interactive else []
    for i, trace in enumerate(diagnosis.traces):
        words = f"Measured torque of bag {trace.name}, the models' torque and the residuals over time"
        parts.append(
            f"<h3>{_text(trace.name)}</h3>\n"
            + drawing.place(f"bag {i}", plots.torque_plot(diagnosis, trace), words)
            + "\n"
        )
    return "".join(parts)


def _effects(diagnosis: Diagnosis, drawing: _Drawing) -> str:
    return "".join(_effect(diagnosis, effect, drawing) for effect in diagnosis.json["effects"])


def _laws(diagnosis: Diagnosis, drawing: _Drawing) -> str:
    vehicle = diagnosis.vehicle
    return "".join(
        f'<div class="effect"><h3>{_text(law["title"])}</h3>\n{_pairs([(name, _text(value)) for name, value in laws.facts(vehicle, law)])}'
        + drawing.place(f"law {law['id']}", laws.plot(vehicle, law), f"f of {law['title']} with its band and the data", "half")
        + "</div>\n"
        for law in diagnosis.json.get("laws", ())
    )


def _effect(diagnosis: Diagnosis, effect: Mapping[str, Any], drawing: _Drawing) -> str:
    vehicle, entry = diagnosis.vehicle, CATALOGUE[effect["id"]]
    colour = plots.colours(diagnosis)[effect["id"]]
    meaning = {p.name: p.meaning for p in entry.parameters}
    per_line = entry.parameters[0].meaning if entry.per_line and entry.parameters else ""
    angular = "" if units.is_linear(vehicle) else "in degrees"
    header = ["parameter", "value", "95 % interval", "unit", angular, "meaning"]
    rows = []
    for name, parameter in effect["parameters"].items():
        unit, ends = units.label(vehicle, parameter["unit"]), parameter["ci95"]
        value, between = words.estimate(parameter["value"], ends)
        degrees = _degrees(parameter["value"], ends) if unit == "rad" else ""
        meant = _text(meaning.get(name, per_line))
        row = [f"<code>{_text(name)}</code>", value, between, _text(unit), degrees, meant]
        rows.append([cell for cell, title in zip(row, header, strict=True) if title])
    law = ""
    if any(effect["id"] in trace.contributions for trace in diagnosis.traces):
        caption = f"Residual along the telling coordinate of {effect['id']}, with its fitted law, before and after"
        law = drawing.place(f"effect {effect['id']}", plots.residual_plot(diagnosis, dict(effect)), caption)
    rivals = ", ".join(f"<code>{_text(rival)}</code>" for rival in effect["indistinguishable_from"])
    facts = _pairs(
        [
            ("where in the chain", f"{_text(effect['stage'])}: {STAGES.get(effect['stage'], '')}"),
            ("law", f"<code>{_text(units.law(vehicle, entry.equation))}</code>"),
            ("source", _text(entry.source)),
            ("how it shows", _text(entry.trace)),
            ("chance that noise does this", f"p {_p(effect['p_value'])}"),
            ("share of the baseline residual's energy it explains", words.percent(effect["energy_share"])),
            ("share that recalibration had hidden", words.percent(effect["masked_share"])),
            ("cannot be told from", rivals),
        ]
    )
    where = [_place(diagnosis, entry) for entry in effect["where"]]
    return (
        f'<div class="effect"><h3><span class="swatch" style="background:{colour}"></span>{_text(units.title(vehicle, entry))} '
        f"(<code>{_text(effect['id'])}</code>)</h3>\n<p>{_text(effect['statement'])}</p>\n"
        + _table([title for title in header if title], rows, numeric=(1, 2, 4) if angular else (1, 2))
        + f"<p>{EXACT_LAW}</p>\n"
        + facts
        + (_table(["bag", "acts during", "98 % of its energy lies along"], where) if where else "")
        + law
        + "</div>\n"
    )


def _p(p: float | None) -> str:
    text = words.chance(p)
    return _text(text if text.startswith("<") else f"= {text}")


def _degrees(value: float | None, ends: Sequence[float] | None) -> str:
    if value is None:
        return ""
    return words.estimate(math.degrees(value), ends and [math.degrees(end) for end in ends])[0] + "°"


def _place(diagnosis: Diagnosis, entry: Mapping[str, Any]) -> list[str]:
    """Bag, stretches, and range of the coordinate (if one was found)."""
    along = "-"
    if entry.get("coordinate") and entry.get("range"):
        axis = words.coordinate_axis(diagnosis.vehicle, entry["coordinate"])
        low, high = (words.number(end * axis.scale, 3) if end is not None else "-" for end in entry["range"])
        along = f"{_text(axis.label)}: {low} … {high}"
    return [_text(entry["bag"]), words.spans(entry["intervals_s"]), along]


def _heldout(diagnosis: Diagnosis, drawing: _Drawing) -> str:
    before, after = diagnosis.json["baseline"], diagnosis.json["augmented"]
    if before["heldout_rmse_Nm"] is None:
        return ""
    unit = _text(diagnosis.vehicle.coordinate.force_unit)
    rows = [["recalibrated baseline", words.number(before["rmse_Nm"]), words.number(before["heldout_rmse_Nm"])]]
    if diagnosis.json["effects"]:
        rows.append(["with the effects found", words.number(after["rmse_Nm"]), words.number(after["heldout_rmse_Nm"])])
    rows.append(["noise floor", words.number(diagnosis.json["noise_floor_Nm"]), ""])
    spec = plots.heldout_plot(diagnosis)
    return (
        "<p>Root mean square torque error on stretches kept away from both the search and the fit, with a gap to them "
        f"longer than the memory of the friction.{' Bar: 95 % interval of the improvement.' if spec else ''}</p>\n"
        + drawing.place("heldout", spec, "Held-out error before and after", "half")
        + _table(["", f"RMSE, all data [{unit}]", f"RMSE, held out [{unit}]"], rows, (1, 2), narrow=True)
    )


def _evidence(diagnosis: Diagnosis) -> str:
    if not diagnosis.evidence:
        return ""
    header = ["candidate", "", "energy share", "masked", "held-out gain", "p", "outcome"]
    colour, rows = plots.colours(diagnosis), []
    for row in diagnosis.evidence:
        named = row.verdict == "named"
        mark = f' class="named" style="--row:{colour.get(row.label.split("[")[0], "var(--accent)")}"' if named else ""
        width = 6.0 * min(max(row.energy_share, 0.0), 1.0)
        share = f'<span class="bar" style="width:{width:.2f}em"></span>{words.percent(row.energy_share)}'
        numbers = [words.percent(row.masked_share), words.percent(row.heldout_gain), _text(words.chance(row.p_value))]
        rows.append((mark, [f"<code>{_text(row.label)}</code>", _text(row.title), share, *numbers, _text(row.verdict)]))
    numeric = (2, 3, 4, 5)
    rest = rows[EVIDENCE_SHOWN:]
    more = f"<details><summary>{len(rest)} more</summary>{_table_of(header, rest, numeric)}</details>\n" if rest else ""
    return (
        "<p>Every effect of the catalogue was compared with what the recalibrated baseline leaves over. The best were "
        "then fitted inside the simulator together with the baseline and judged on held-out data.</p>\n"
        + _table_of(header, rows[:EVIDENCE_SHOWN], numeric)
        + more
    )


def _left(diagnosis: Diagnosis) -> str:
    left = diagnosis.json["unexplained"]
    formula = f'<div class="formula">{_text(left["formula"])}</div>\n' if left["formula"] else ""
    where = left["where"] if isinstance(left["where"], list) else []
    rows = [_place(diagnosis, entry) for entry in where]
    description = left["description"] or "Nothing beyond noise."
    return (
        f"<p>{_text(description[:1].upper() + description[1:])}{'' if description.endswith('.') else '.'}</p>\n"
        + (
            "<p>The shortest formula that lowers the held-out error (a description, not a cause):</p>\n" + formula
            if formula
            else ""
        )
        + (_table(["bag", "during", "98 % of the energy lies along"], rows) if rows else "")
    )


def _experiment(diagnosis: Diagnosis) -> str:
    advice = diagnosis.json["next_experiment"]
    if not advice:
        insufficient = diagnosis.json["verdict"] == "insufficient_data"
        words = "The data come first: put right what is told above." if insufficient else "None is needed to settle what was found."
        return f'<p class="note">{words}</p>'
    return _pairs(
        [
            ("manoeuvre", f"<strong>{_text(advice['manoeuvre'])}</strong>"),
            ("separates", ", ".join(f"<code>{_text(name)}</code>" for name in advice["separates"])),
            ("why", _text(advice["why"])),
        ]
    )


def _limits(diagnosis: Diagnosis) -> str:
    limits = diagnosis.json["detection_limits"]
    if not limits:
        return ""
    rows = []
    for name, limit in limits.items():
        unit = units.label(diagnosis.vehicle, limit["unit"])
        title = units.title(diagnosis.vehicle, CATALOGUE[name]) if name in CATALOGUE else ""
        rows.append([f"<code>{_text(name)}</code>", _text(title), f"<code>{_text(limit['parameter'])}</code>",
                     "hidden at any size" if limit["smallest"] is None else words.number(limit["smallest"], 3), _text(unit)])  # fmt: skip
    table = _table(["effect", "", "parameter", "smallest that would have shown", "unit"], rows, numeric=(3,))
    if len(rows) > EVIDENCE_SHOWN:
        opened = " open" if diagnosis.json["verdict"] == "consistent" else ""
        table = f"<details{opened}><summary>{len(rows)} effects</summary>{table}</details>\n"
    return "<p>An effect smaller than this could be present without these recordings showing it.</p>\n" + table


def _quality(diagnosis: Diagnosis) -> str:
    findings = diagnosis.json["data_quality"]
    if not findings:
        return "<p>No stuck, dropped, spiking, swapped or sign-flipped channel and no clock skew was found.</p>"
    rows = [
        [_text(f["finding"]), _text(f["topic"]), _text(f["bag"]), words.spans(f["intervals_s"]), _text(f["statement"])]
        for f in findings
    ]
    return _table(["finding", "topic", "bag", "during", "what it means"], rows)


def _baseline(diagnosis: Diagnosis) -> str:
    vehicle, rows = diagnosis.vehicle, []
    calibrated = {calibration.name for calibration in calibrations_for(vehicle)}
    for key in KEYS:
        if key.calibration in calibrated and (value := key.read(vehicle)) is not None:
            unit = units.label(vehicle, key.unit)
            rows.append([f"<code>{_text(key.key)}</code>", words.number(value), "" if unit == "1" else _text(unit)])
    made = [(_text(name.replace("_", " ")), _plain(value)) for name, value in vehicle.provenance.items()]
    sentence = (
        "Nothing was fitted: these are the values of the vehicle file, as they were."
        if diagnosis.json["verdict"] == "insufficient_data"
        else "The published model with these values is what missing physics was judged against, so that a wrong friction "
        "level is never reported as physics. They stand in <code>augmented.yaml</code>."
    )
    return (
        f"<p>{sentence}</p>\n"
        + (_table(["key of the vehicle file", "value", "unit"], rows, (1,), narrow=True) if rows else "")
        + (_pairs(made) if made else "")
    )


def _plain(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{_text(key)}: {_plain(item)}" for key, item in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(_plain(item) for item in value)
    return words.number(value) if isinstance(value, float) else _text(value)


_GLOSSARY = _pairs(
    [
        (
            "recalibrated baseline",
            "the published model with friction level, stiffness and heat values fitted to these recordings",
        ),
        ("augmented", "the recalibrated baseline with the found effects in it"),
        ("residual", "measured torque minus the model's torque"),
        ("held out", "stretches that neither the search nor the fit saw; only they say whether a finding is real"),
        ("noise floor", "what sensor noise and the error of the estimated motion alone would leave as residual"),
        ("energy share", "share of the residual's energy that the effect explains"),
        ("masked share", "share of an effect's trace that recalibrating the baseline imitates, and so hides"),
        (
            "held-out gain",
            "by how much the fit that tried it, with the effects accepted before it, lowers the held-out error",
        ),
        ("p", "chance that noise of this kind explains as much, all variants of the effect tried being paid for"),
        (
            "95 % interval",
            "from the scatter between stretches of the recording, so that slowly varying errors count in full",
        ),
    ]
)
