# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The report of a fleet: which effects on which vehicle since when, what they share, trends, outliers, what was left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime, timezone
from math import floor
from pathlib import Path

import numpy as np

from lugre_steering.counted import counted
from lugre_steering.diagnosis.report.head import VERDICTS
from lugre_steering.files import write_text
from lugre_steering.fleet.claims import ACTING, DAY_S, Claim, by_vehicle
from lugre_steering.fleet.result import Fleet
from lugre_steering.fleet.told import ALL, best, commands, day, size, title, told
from lugre_steering.fleet.work import Record
from lugre_steering.report import words
from lugre_steering.report.chart import Chart, Panel, Series
from lugre_steering.report.markup import Row, code, dated, facts, table, text
from lugre_steering.report.origin import made_by
from lugre_steering.report.page import Charts, Section, Tone, render

MOST_ROWS, MOST_DOTS, MOST_VEHICLES = 200, 1500, 6
"""Shown in one table, and of one chart; the Parquet files have all of it."""
LEADS = "var(--accent)"


def write_page(fleet: Fleet, records: Sequence[Record], file: Path) -> None:
    """Write the page."""
    charts = Charts()
    tone, title, first = _verdict(fleet)
    sections = [
        Section("closer", "Look closer", "Look closer", _closer(fleet)),
        Section("trends", "Trends", "Error of the model over dates and air temperature", _trends(fleet, records, charts)),
        Section("vehicles", "Vehicles", "The vehicles", _vehicles(fleet)),
        Section("outliers", "Outliers", "Recordings unlike the others of their vehicle", _outliers(fleet)),
        Section("quarantine", "Quarantine", "Recordings that tell nothing", _quarantine(fleet)),
        Section("effects", "Effects", "All that stands, with its statistics", _effects(fleet)),
        Section("since", "Changes", "What changed, and when", _since(fleet)),
        Section("shared", "Shared", "Shared or of one vehicle", _shared(fleet)),
        Section("versions", "Versions", "What another version of the program said differently", _changes(fleet)),
        Section("reading", "Reading", "How to read this", _reading(fleet)),
        Section("origin", "Origin", "How this result came about", _origin(fleet)),
    ]
    head = (
        f'<header id="verdict"><p class="over">{text(_scope(fleet))}</p>\n<h1>{text(title)}</h1>\n'
        f'<div class="verdict"><p>{dated(first)}</p></div>\n{_acting(fleet)}{facts(_numbers(fleet))}</header>'
    )
    maker = f"lugre_steering {fleet.version}, {fleet.date}"
    write_text(render("Fleet report", tone, head, sections, charts, maker), file)


def _scope(fleet: Fleet) -> str:
    dates = sorted({day(date) for vehicle in fleet.vehicles for date in (vehicle.first, vehicle.last) if date is not None})
    when = f", recorded {dates[0]}" + (f" to {dates[-1]}" if len(dates) > 1 else "") if dates else ""
    return f"{counted(len(fleet.vehicles), 'vehicle')}, {counted(fleet.recordings, 'recording')}{when}"


def _verdict(fleet: Fleet) -> tuple[Tone, str, str]:
    """Tone, headline and first sentence."""
    found = told(fleet)
    if found:
        having = {one.vehicle for one in found}
        of = ALL if ALL in having else f"{len(having)} of {len(fleet.vehicles)} vehicles"
        most = found[0]
        where = f" on {most.vehicle}" if len(fleet.vehicles) > 1 else ""
        largest = f"{'The largest: ' if len(found) > 1 else ''}{most.what}{where}, {most.size}, since {most.since}."
        return "found", "Physics is missing from the model" + (f" of {of}" if len(fleet.vehicles) > 1 else ""), largest
    sound = [vehicle for vehicle in fleet.vehicles if vehicle.recordings]
    if not sound:
        return "unsure", "No recording tells anything", "All of them are in quarantine; the reasons stand below."
    if not fleet.options.diagnose:
        return "unsure", "Checked and replayed, not diagnosed", "Nothing was looked for in what the model leaves."
    none = "No effect stands, in single recordings or in all together: the model leaves nothing that could be told from chance."
    return "good", "No missing physics is seen", none


def _acting(fleet: Fleet) -> str:
    """The first table: what an engineer acts on."""
    rows = [Row([dated(cell) for cell in (one.vehicle, one.what, one.size, one.since, one.seen, one.do)], LEADS) for one in told(fleet)]
    return _limited(("vehicle", "what the model leaves out", "how much", "since", "seen in", "what to do"), rows, (), "claims.parquet")


def _numbers(fleet: Fleet) -> list[tuple[str, str, str]]:
    hours = sum(vehicle.hours for vehicle in fleet.vehicles)
    return [
        ("recordings used", str(sum(vehicle.recordings for vehicle in fleet.vehicles)), f"{hours:.2f} h"),
        ("in quarantine", str(len(fleet.quarantine)), "reasons below" if fleet.quarantine else ""),
        ("worked on in this run", str(fleet.examined), f"{fleet.cached} known from earlier runs"),
    ]


def _closer(fleet: Fleet) -> str:
    """The commands that examine one vehicle."""
    found = commands(fleet)
    if not found:
        return ""
    said = "<p>The diagnosis of one vehicle says where and when it acts, and writes a vehicle file that has it.</p>\n"
    rows = [f'<h3>{text(vehicle)}</h3><p class="formula">{text(command)}</p>\n' for vehicle, command in list(found.items())[:MOST_ROWS]]
    return said + "".join(rows)


def _limited(header: Sequence[str], rows: Sequence[Row | Sequence[str]], numeric: Sequence[int], file: str) -> str:
    """A table of the first rows, and where the others are."""
    if not rows:
        return ""
    more = f'<p class="note">{len(rows) - MOST_ROWS} more in {code(file)}.</p>' if len(rows) > MOST_ROWS else ""
    return table(header, rows[:MOST_ROWS], numeric) + more


def _effects(fleet: Fleet) -> str:
    """A row for every effect of every vehicle that stands: those that lead or are named first."""
    groups: dict[tuple[str, str], list[Claim]] = {}
    for claim in fleet.claims:
        if claim.kind in ACTING:
            groups.setdefault((claim.vehicle, claim.effect), []).append(claim)
    rows: list[Row | Sequence[str]] = []
    for (vehicle, _), claims in sorted(groups.items(), key=lambda item: (item[0][0], _rank(item[1]))):
        shown = best(claims)
        value, ends = words.estimate(shown.value, None if shown.low is None else (shown.low, shown.high))
        of_value = f"{shown.parameter.replace('_', ' ')} {value} {'' if shown.unit == '1' else shown.unit}"
        naming = {claim.bag for claim in claims if claim.kind == "recording"}
        leads, named = any(claim.leads for claim in claims), bool(naming)
        cells = (
            text(vehicle or ALL), text(title(fleet, shown)), "leads" if leads else "named" if named else "fits too",
            text(of_value), text(ends), text(size(fleet, shown)), str(max(len(naming), *(claim.recordings for claim in claims))),
            text(words.chance(min(claim.q_value for claim in claims))),
        )  # fmt: skip
        rows.append(Row(cells, LEADS if leads or named else None))
    header = ("vehicle", "effect", "", "value", "95 % interval", "torque", "recordings", "q")
    return _limited(header, rows, (6, 7), "claims.parquet")


def _rank(claims: Sequence[Claim]) -> tuple[bool, int, float]:
    named = sum(claim.kind == "recording" for claim in claims)
    return not any(claim.leads for claim in claims), -named, claims[0].p_value


def _since(fleet: Fleet) -> str:
    rows = [
        (text(claim.vehicle), text(title(fleet, claim)), dated(day(claim.since)),
         f"{text(claim.parameter.replace('_', ' '))} by {_slope(claim)}",
         text(size(fleet, claim)), str(claim.recordings), text(words.chance(claim.q_value)))
        for claim in fleet.claims if claim.kind == "since"
    ]  # fmt: skip
    return _limited(("vehicle", "effect", "since", "changed", "torque", "recordings", "q"), rows, (5, 6), "claims.parquet")


def _slope(claim: Claim) -> str:
    return text(words.quantity(claim.value, claim.unit))


def _shared(fleet: Fleet) -> str:
    rows = []
    for one in fleet.shared:
        claim = next(claim for claim in fleet.claims if claim.kind == "joint" and claim.effect == one.effect)
        said = "alike on all vehicles" if one.common else "differs between vehicles"
        between = text(words.quantity(one.between, one.unit))
        rows.append((text(title(fleet, claim)), said, text(", ".join(one.vehicles)), between, text(words.chance(one.alike_p))))
    return _limited(("effect", "", "stands on", "spread between vehicles", "p that there is none"), rows, (3, 4), "claims.parquet")


def _trends(fleet: Fleet, records: Sequence[Record], charts: Charts) -> str:
    rows = [
        (text(claim.vehicle), text({"rmse": "error (RMSE)", "bias": "bias"}[claim.effect]), text(claim.kind), _slope(claim),
         str(claim.recordings), text(words.chance(claim.q_value)))
        for claim in fleet.claims if claim.kind.startswith("trend")
    ]  # fmt: skip
    found = _limited(("vehicle", "of", "", "slope", "recordings", "q"), rows, (3, 4, 5), "claims.parquet")
    scored = {
        vehicle: [record for record in own if record["score"] is not None]
        for vehicle, own in list(by_vehicle(records).items())[:MOST_VEHICLES]
    }
    dates = [_days(record) for own in scored.values() for record in own]
    if not dates:
        return found
    start = floor(min(dates))
    over_dates = _chart(scored, lambda record: _days(record) - start, "date", datetime.fromtimestamp(start * DAY_S, timezone.utc))
    warm = {vehicle: [record for record in own if record["air_degC"] is not None] for vehicle, own in scored.items()}
    over_air = _chart(warm, lambda record: float(record["air_degC"]), "air temperature (degC)")
    left = f'<p class="note">The first {MOST_VEHICLES} vehicles.</p>' if len(fleet.vehicles) > MOST_VEHICLES else ""
    said = "Root mean square of measured minus estimated torque of every recording"
    return found + charts.place(over_dates, f"{said} over its date") + charts.place(over_air, f"{said} over the air temperature") + left


def _days(record: Record) -> float:
    return datetime.fromisoformat(record["recorded"]).timestamp() / DAY_S


def _chart(of: dict[str, list[Record]], x: Callable[[Record], float], label: str, since: datetime | None = None) -> Chart | None:
    """A dot for every recording; None without any, or where there is only one place to put them. ``since``: day from which x counts."""
    series = []
    for i, (vehicle, own) in enumerate(of.items()):
        every = sorted(own, key=x)[:: max(1, len(own) // MOST_DOTS)]
        if every:
            errors = np.array([record["score"]["rmse_Nm"] for record in every])
            series.append(Series(vehicle, str(i), errors, np.array([x(record) for record in every]), dots=True))
    places = {x(record) for own in of.values() for record in own}
    return Chart(label, [Panel("error (RMSE)", "N m", series)], since=since) if len(places) > 1 else None


def _outliers(fleet: Fleet) -> str:
    rows = [
        (text(one.vehicle), text(one.bag), text(words.quantity(one.rmse_Nm, "N m")), text(words.quantity(one.median_Nm, "N m")))
        for one in fleet.outliers
    ]
    return _limited(("vehicle", "recording", "RMSE", "median of the vehicle"), rows, (2, 3), "scores.parquet")


def _vehicles(fleet: Fleet) -> str:
    rows = [
        (text(one.name), str(one.recordings), str(one.quarantined), text(f"{one.hours:.2f}"), dated(day(one.first)),
         dated(day(one.last)), text("-" if one.median_rmse_Nm is None else words.torque(one.vehicle, one.median_rmse_Nm)),
         text(", ".join(f"{VERDICTS[verdict][0].lower() if verdict in VERDICTS else verdict}: {count}"
                        for verdict, count in one.verdicts.items()) or "-"))
        for one in fleet.vehicles
    ]  # fmt: skip
    header = ("vehicle", "recordings", "in quarantine", "hours", "first", "last", "median error", "verdicts of single recordings")
    return _limited(header, rows, (1, 2, 3, 6), "scores.parquet")


def _changes(fleet: Fleet) -> str:
    if fleet.other_version is None:
        return ""
    said = f"<p>{code(fleet.other_version)} against {code(fleet.version)}, on the same recordings, vehicle files and options.</p>"
    rows = [(text(one.vehicle), text(Path(one.bag).name), text(one.what), text(one.before), text(one.after)) for one in fleet.changes]
    return said + (_limited(("vehicle", "recording", "what", "before", "now"), rows, (), "changes.parquet") or "<p>Nothing differs.</p>")


def _quarantine(fleet: Fleet) -> str:
    rows = [(text(one.bag), text(one.reason)) for one in fleet.quarantine]
    return _limited(("recording", "reason"), rows, (), "scores.parquet")


def _origin(fleet: Fleet) -> str:
    by = fleet.provenance
    return "" if by is None else made_by(replace(by, bags=by.bags[:MOST_ROWS]), f"{code('fleet.json')} names every bag.")


def _reading(fleet: Fleet) -> str:
    return (
        f"<p>All claims of this page share one budget: on average at most {100.0 * fleet.budget:.0f}&nbsp;% of those that stand "
        f"({len(fleet.claims)} of {fleet.considered}) are false, however they hang together (Benjamini and Yekutieli); q is the share at "
        "which a claim would just stand. What was looked for in vain counts.</p>\n"
        "<p>Joint evidence adds up how much of an effect each recording shows, with sign and error, whether or not it is enough to be "
        "named there. Where all hint at something and most name nothing, the recordings that say most are diagnosed together. Effects are "
        "taken one at a time in joint evidence, so what is there shows in its rivals too: what leads is the finding, others that fit are "
        "no second one. The torque of joint evidence is that of its value, in proportion.</p>\n"
    )
