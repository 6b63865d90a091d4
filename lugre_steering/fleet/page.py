# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The report of a fleet: which effects on which vehicle since when, what they share, trends, outliers, what was left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.files import write_text
from lugre_steering.fleet.claims import DAY_S, Claim, by_vehicle
from lugre_steering.fleet.result import Fleet
from lugre_steering.fleet.work import Record
from lugre_steering.report import words
from lugre_steering.report.chart import Chart, Panel, Series
from lugre_steering.report.markup import Row, code, facts, table, text
from lugre_steering.report.page import Charts, Section, Tone, render

MOST_ROWS, MOST_DOTS, MOST_VEHICLES = 200, 1500, 6
"""Shown in one table, and of one chart; the Parquet files have all of it."""
LEADS = "var(--accent)"


def write_page(fleet: Fleet, records: Sequence[Record], file: Path) -> None:
    """Write the page."""
    charts = Charts()
    tone, title, first = _verdict(fleet)
    sections = [
        Section("effects", "Effects", "What acts on which vehicle", _effects(fleet)),
        Section("since", "Since when", "What changed, and when", _since(fleet)),
        Section("shared", "Shared", "Shared or of one vehicle", _shared(fleet)),
        Section("trends", "Trends", "Error of the model over dates and air temperature", _trends(fleet, records, charts)),
        Section("outliers", "Outliers", "Recordings unlike the others of their vehicle", _outliers(fleet)),
        Section("vehicles", "Vehicles", "The vehicles", _vehicles(fleet)),
        Section("changes", "Changes", "What another version of the program said differently", _changes(fleet)),
        Section("quarantine", "Quarantine", "Recordings that tell nothing", _quarantine(fleet)),
        Section("reading", "Reading", "How to read this", _reading(fleet)),
    ]
    head = (
        f'<header id="verdict"><p class="over">vehicles: {len(fleet.vehicles)} &middot; recordings: {fleet.recordings} &middot; '
        f'{text(fleet.date[:10])}</p>\n<h1>{text(title)}</h1>\n<div class="verdict"><p>{text(first)}</p></div>\n'
        f"{facts(_numbers(fleet))}</header>"
    )
    maker = f"lugre_steering {fleet.version}, {fleet.date}, options {fleet.options}"
    write_text(render("Fleet report", tone, head, sections, charts, maker), file)


def _verdict(fleet: Fleet) -> tuple[Tone, str, str]:
    """Tone, headline and first sentence."""
    having = {claim.vehicle: claim for claim in reversed(fleet.claims) if claim.leads or claim.kind == "recording"}
    alone = [claim for claim in fleet.claims if claim.leads and not claim.named_in]
    if having:
        what = [f"{_title(claim)}{_rivals(claim)} on {vehicle}" for vehicle, claim in sorted(having.items())]
        more = f", and {len(what) - MOST_VEHICLES} vehicles more" if len(what) > MOST_VEHICLES else ""
        weak = ", ".join(sorted({_title(claim) for claim in alone}))
        joint = f" Too weak for any single recording, and seen in all together: {weak}." if weak else ""
        return "found", "Physics is missing from the model", f"{', '.join(what[:MOST_VEHICLES])}{more}.{joint}"
    if not any(vehicle.recordings for vehicle in fleet.vehicles):
        return "unsure", "No recording tells anything", "All of them are in quarantine; the reasons stand below."
    if not fleet.options.diagnose:
        return "unsure", "Checked and replayed, not diagnosed", "Nothing was looked for in what the model leaves."
    none = "No effect stands within the budget of false discoveries, in single recordings or jointly."
    return "good", "Nothing is missing from the model", none


def _numbers(fleet: Fleet) -> list[tuple[str, str, str]]:
    hours = sum(vehicle.hours for vehicle in fleet.vehicles)
    return [
        ("recordings", str(fleet.recordings - len(fleet.quarantine)), f"{words.number(hours, 3)} h"),
        ("in quarantine", str(len(fleet.quarantine)), ""),
        ("claims that stand", str(len(fleet.claims)), f"of {fleet.considered}; at most {fleet.budget:.0%} of them false on average"),
        ("worked on in this run", str(fleet.examined), f"{fleet.cached} were known"),
    ]


def _title(claim: Claim) -> str:
    name = claim.effect.partition("[")[0]
    line = claim.effect[len(name) :].strip("[]")
    return (CATALOGUE[name].title if name in CATALOGUE else name) + (f" ({line})" if line else "")


def _rivals(claim: Claim) -> str:
    """What it may be as well."""
    names = [CATALOGUE[name].title if name in CATALOGUE else name for name in claim.rivals.split(", ") if name]
    return f" (or, not to be told apart: {', '.join(names)})" if names else ""


def _limited(header: Sequence[str], rows: Sequence[Row | Sequence[str]], numeric: Sequence[int], file: str) -> str:
    """A table of the first rows, and where the others are."""
    if not rows:
        return ""
    more = f'<p class="note">{len(rows) - MOST_ROWS} more in {code(file)}.</p>' if len(rows) > MOST_ROWS else ""
    return table(header, rows[:MOST_ROWS], numeric) + more


def _effects(fleet: Fleet) -> str:
    """A row for every effect of every vehicle: those that lead or are named first."""
    total = {vehicle.name: vehicle.recordings for vehicle in fleet.vehicles}
    rows: list[Row | Sequence[str]] = []
    for (vehicle, effect), claims in sorted(_acting(fleet).items(), key=lambda item: (item[0][0], _rank(item[1]))):
        named = [claim for claim in claims if claim.kind == "recording"]
        shown = next((claim for claim in claims if claim.kind == "joint"), named[0] if named else claims[0])
        first = min((claim.since or "" for claim in named), default="")[:10] or "-"
        value, ends = words.estimate(shown.value, None if shown.low is None else (shown.low, shown.high))
        size = f"{code(shown.parameter)} {text(value)} {text(shown.unit)}"
        leads, role = any(claim.leads for claim in claims), "fits too" if not named else "named"
        cells = (
            text(vehicle), f"{text(_title(shown) + _rivals(shown))} ({code(effect)})", "leads" if leads else role,
            f"{len(named)} of {total[vehicle]}", text(first), size, text(ends), text(words.chance(min(claim.q_value for claim in claims))),
        )  # fmt: skip
        rows.append(Row(cells, LEADS if leads or named else None))
    header = ("vehicle", "effect", "", "named in", "first on", "size", "95 % interval", "q")
    return _limited(header, rows, (3, 7), "claims.parquet")


def _acting(fleet: Fleet) -> dict[tuple[str, str], list[Claim]]:
    """Names and joint evidence by vehicle and effect, the surest first."""
    found: dict[tuple[str, str], list[Claim]] = {}
    for claim in fleet.claims:
        if claim.kind in ("recording", "joint"):
            found.setdefault((claim.vehicle, claim.effect), []).append(claim)
    return found


def _rank(claims: Sequence[Claim]) -> tuple[bool, int, float]:
    named = sum(claim.kind == "recording" for claim in claims)
    return not any(claim.leads for claim in claims), -named, claims[0].p_value


def _since(fleet: Fleet) -> str:
    rows = [
        (text(claim.vehicle), text(_title(claim)), text((claim.since or "")[:10]), f"{code(claim.parameter)} by {_slope(claim)}",
         str(claim.recordings), text(words.chance(claim.q_value)))
        for claim in fleet.claims if claim.kind == "since"
    ]  # fmt: skip
    return _limited(("vehicle", "effect", "since", "changed", "recordings", "q"), rows, (4, 5), "claims.parquet")


def _slope(claim: Claim) -> str:
    return text(f"{words.number(claim.value, 3)} {claim.unit}")


def _shared(fleet: Fleet) -> str:
    rows = []
    for one in fleet.shared:
        said = "alike on all vehicles" if one.common else "differs between vehicles"
        title = CATALOGUE[one.effect.partition("[")[0]].title
        between = text(f"{words.number(one.between, 3)} {one.unit}")
        name = f"{text(title)} ({code(one.effect)})"
        rows.append((name, said, text(", ".join(one.vehicles)), between, text(words.chance(one.alike_p))))
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
    start = min(dates)
    begun = datetime.fromtimestamp(start * DAY_S).date()
    over_dates = _chart(scored, lambda record: _days(record) - start, f"days since {begun}")
    warm = {vehicle: [record for record in own if record["air_degC"] is not None] for vehicle, own in scored.items()}
    over_air = _chart(warm, lambda record: float(record["air_degC"]), "air temperature (degC)")
    left = f'<p class="note">The first {MOST_VEHICLES} vehicles.</p>' if len(fleet.vehicles) > MOST_VEHICLES else ""
    said = "Root mean square of measured minus estimated torque of every recording"
    return found + charts.place(over_dates, f"{said} over its date") + charts.place(over_air, f"{said} over the air temperature") + left


def _days(record: Record) -> float:
    return datetime.fromisoformat(record["recorded"]).timestamp() / DAY_S


def _chart(of: dict[str, list[Record]], x: Callable[[Record], float], label: str) -> Chart | None:
    """A dot for every recording; None without any."""
    series = []
    for i, (vehicle, own) in enumerate(of.items()):
        every = sorted(own, key=x)[:: max(1, len(own) // MOST_DOTS)]
        if every:
            errors = np.array([record["score"]["rmse_Nm"] for record in every])
            series.append(Series(vehicle, str(i), errors, np.array([x(record) for record in every]), dots=True))
    return Chart(label, [Panel("RMSE", "N m", series)]) if series else None


def _outliers(fleet: Fleet) -> str:
    rows = [
        (text(one.vehicle), text(one.bag), text(f"{words.number(one.rmse_Nm)} N m"), text(f"{words.number(one.median_Nm)} N m"))
        for one in fleet.outliers
    ]
    return _limited(("vehicle", "recording", "RMSE", "median of the vehicle"), rows, (2, 3), "scores.parquet")


def _vehicles(fleet: Fleet) -> str:
    rows = [
        (text(one.name), str(one.recordings), str(one.quarantined), text(words.number(one.hours, 3)), text((one.first or "-")[:10]),
         text((one.last or "-")[:10]), text("-" if one.median_rmse_Nm is None else f"{words.number(one.median_rmse_Nm)} N m"),
         text(", ".join(f"{count} {verdict}" for verdict, count in one.verdicts.items()) or "-"))
        for one in fleet.vehicles
    ]  # fmt: skip
    header = ("vehicle", "recordings", "in quarantine", "hours", "first", "last", "median RMSE", "verdicts of single recordings")
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


def _reading(fleet: Fleet) -> str:
    return (
        f"<p>All claims of this page share one budget: on average at most {fleet.budget:.0%} of those that stand are false, however "
        "they hang together (Benjamini and Yekutieli); q is the share at which a claim would just stand. What was looked for in vain "
        "counts.</p>\n<p>Joint evidence adds up how much of an effect each recording shows, with sign and error, whether or not it is "
        "enough to be named there; recordings may differ by more than their errors (random effects). Effects are taken one at a time, "
        "so what is there shows in its rivals too: the strongest of a vehicle leads, others that fit are no second finding.</p>\n"
    )
