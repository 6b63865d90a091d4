# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The report of a diagnosis, read as HTML and in a real browser. All data are synthetic."""

from __future__ import annotations

import dataclasses
import importlib.util
import io
import json
import math
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from a_law import a_law
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rich.console import Console
from typer.testing import CliRunner

from lugre_steering.cli import app
from lugre_steering.counted import counted
from lugre_steering.diagnosis import effect_card as card
from lugre_steering.diagnosis.report import head, plots
from lugre_steering.diagnosis.report.page import Written, render, write_report
from lugre_steering.diagnosis.result import (
    SCHEMA,
    Augmented,
    BagTrace,
    Diagnosis,
    Errors,
    Evidence,
    Experiment,
    FittedValue,
    Limit,
    NamedEffect,
    Place,
    Unexplained,
)
from lugre_steering.diagnosis.show import show_diagnosis
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.provenance import provenance as made
from lugre_steering.recording import BagFinding
from lugre_steering.report import words
from lugre_steering.report.chart import Chart, Series
from lugre_steering.vehicle import EffectEntry, Vehicle, load

VEHICLE_FILE = Path(__file__).resolve().parents[1] / "config" / "test_vehicle.yaml"
HOSTILE = '<script>alert("x")</script><img src="http://example.org/x.png" onerror="alert(1)">&amp; ü'
SECTIONS = {"verdict", "next", "torque", "effects", "heldout", "evidence", "left", "experiment", "limits", "quality",
            "baseline", "origin", "reading"}  # fmt: skip
ENGAGE, STIFFNESS, NOISE = 0.4, 60e3, 80.0
CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)


def trace(name: str, seed: int) -> BagTrace:
    """Two minutes at 100 Hz: a stop beyond ENGAGE that a baseline has half absorbed."""
    time = np.arange(12_000) * 0.01
    angle = 0.55 * np.sin(0.2 * time)
    stop = STIFFNESS * np.sign(angle) * np.maximum(np.abs(angle) - ENGAGE, 0.0)
    friction = 45e3 * np.tanh(8.0 * np.cos(0.2 * time))
    measured = friction + stop + NOISE * np.random.default_rng(seed).standard_normal(time.size)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (stop != 0.0).astype(int), [0]])))
    spans = tuple((float(time[a]), float(time[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True))
    return BagTrace(
        name=name, time=time, measured=measured, baseline=friction * 1.02, augmented=friction + stop,
        held=(time % 20.0) < 5.0, contributions={"end_stop": stop}, intervals={"end_stop": spans},
        coordinates={"steering angle": angle, "direction": np.sign(np.cos(0.2 * time)), "time": time},
        heldout_Nm=(2000.0 + seed, 80.0 + seed),
    )  # fmt: skip


def missing(vehicle: Vehicle, text: str = "run") -> Diagnosis:
    """An end stop found in two bags; every free text is ``text``."""
    traces = (trace(f"{text} a", 1), trace(f"{text} b", 2))
    evidence = (
        Evidence("end_stop", "Elastic end stop", 0.9, 0.4, 1e-9, 0.96, "named"),
        *(Evidence(f"rival {i}", text, 0.01 * i, 0.5, 0.3, None, text) for i in range(20)),
    )
    provenance = {"made_by": text, "numbers": [1.25, 2.0], "nested": {"key": text}}
    changed = vehicle.replace(name=text, provenance=provenance)
    where = tuple(Place(t.name, tuple(t.intervals["end_stop"]), "steering angle", (0.4, 0.55), "rad") for t in traces)
    return Diagnosis(
        schema=SCHEMA, bags=tuple(t.name for t in traces), verdict="missing_physics",
        statement=f"{text} stands in the statement.", noise_floor_Nm=NOISE, baseline=Errors(2000.0, 2100.0),
        augmented=Augmented(80.0, 84.0, 0.96, (0.94, 0.97), changed),
        effects=(NamedEffect(
            "end_stop", "parallel_torque", text, 1e-9,
            {
                "engage_angle": FittedValue(0.4, (0.3996, 0.4004), "rad"),
                "stiffness": FittedValue(60e3, (59.9e3, 60.1e3), "N m/rad"),
            },
            where, 0.93, 0.41, ("soil_shear",),
        ),),
        unexplained=Unexplained(True, text, f"M = {text}", where),
        detection_limits={"yaw_inertia": Limit("inertia", 321.0, "kg m2")},
        data_quality=(BagFinding("stuck_sensor", text, text, ((0.0, 1.0),), text),),
        next_experiment=Experiment(text, ("end_stop", text), text),
        traces=traces, evidence=evidence, coordinate_of={"end_stop": "steering angle"},
        provenance=made("diagnose", {"seed": 1}),
    )  # fmt: skip


def consistent(vehicle: Vehicle) -> Diagnosis:
    full = missing(vehicle)
    return dataclasses.replace(
        full, verdict="consistent", effects=(), next_experiment=None, data_quality=(),
        augmented=Augmented(full.baseline.rmse_Nm, full.baseline.heldout_rmse_Nm, 0.0, (0.0, 0.0), vehicle),
        unexplained=Unexplained(False, ""), evidence=full.evidence[1:], coordinate_of={},
        traces=tuple(dataclasses.replace(t, contributions={}, intervals={}) for t in full.traces),
    )  # fmt: skip


def unlisted(vehicle: Vehicle) -> Diagnosis:
    return dataclasses.replace(consistent(vehicle), verdict="unlisted_physics", unexplained=missing(vehicle).unexplained)


def insufficient(vehicle: Vehicle) -> Diagnosis:
    return dataclasses.replace(
        consistent(vehicle), verdict="insufficient_data", baseline=Errors(0.0, None), detection_limits={},
        augmented=Augmented(0.0, None, None, None, vehicle), traces=(), evidence=(),
    )  # fmt: skip


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return load(VEHICLE_FILE)


@pytest.fixture(scope="module")
def hostile(vehicle: Vehicle) -> Diagnosis:
    return missing(vehicle, HOSTILE)


@pytest.fixture(scope="module")
def written(hostile: Diagnosis, tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_report(hostile, tmp_path_factory.mktemp("report"))


class Page(HTMLParser):
    """What a browser would see: elements, ids, text outside scripts and styles, and everything that could be loaded."""

    def __init__(self, source: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.handlers: list[str] = []
        self.text = ""
        self.scripts: list[str] = []
        self._raw = ""
        self.feed(source)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self._raw = tag if tag in ("script", "style") else self._raw
        if tag == "script":
            self.scripts.append("")
        for name, value in attributes:
            if name == "id":
                self.ids.append(str(value))
            elif name in ("src", "href", "srcset", "data", "action", "poster"):
                self.links.append(str(value))
            elif name.startswith("on"):
                self.handlers.append(name)

    def handle_endtag(self, tag: str) -> None:
        if tag == self._raw:
            self._raw = ""

    def handle_data(self, data: str) -> None:
        if self._raw == "script":
            self.scripts[-1] += data
        elif not self._raw:
            self.text += data


def specs(page: Page) -> dict[str, Any]:
    result = json.loads(page.scripts[0])
    assert isinstance(result, dict)
    return result


def page_of(diagnosis: Diagnosis) -> Page:
    return Page(render(diagnosis))


# ----------------------------------------------------------------- the page


def test_page_has_every_section_and_every_link_leads_somewhere(written: Written) -> None:
    page = Page(written.files[0].read_text(encoding="utf-8"))
    assert set(page.ids) >= SECTIONS | {"charts"}
    assert len(page.ids) == len(set(page.ids))
    assert {link.removeprefix("#") for link in page.links} <= set(page.ids)


def test_text_from_outside_is_shown_as_it_is_and_never_becomes_markup(written: Written) -> None:
    page = Page(written.files[0].read_text(encoding="utf-8"))
    harmless = Page(render(missing(load(VEHICLE_FILE), "XYZ")))
    assert page.tags == harmless.tags  # the same elements, whatever the texts say
    assert page.handlers == []
    assert page.text.count(HOSTILE) == harmless.text.count("XYZ")
    assert f"{HOSTILE} stands in the statement." in page.text


def test_charts_hold_names_as_they_are_and_no_end_of_their_script(vehicle: Vehicle) -> None:
    full = missing(vehicle)
    law = a_law(title=HOSTILE, channel="gain", coordinate="none", form="constant", values={}, intervals={})
    traces = tuple(dataclasses.replace(t, contributions={"law_1": t.measured}, intervals={}) for t in full.traces)
    page = page_of(dataclasses.replace(full, verdict="unlisted_physics", effects=(), laws=(law,), traces=traces))
    assert len(page.scripts) == 2  # the charts and what draws them
    assert {panel["series"][0]["name"] for panel in specs(page)["chart-0"]["panels"]} >= {HOSTILE}


def test_nothing_is_loaded_from_anywhere(written: Written) -> None:
    source = written.files[0].read_text(encoding="utf-8")
    page = Page(source)
    assert all(link.startswith("#") for link in page.links)
    assert "link" not in page.tags
    assert "default-src 'none'" in source
    known = source.replace("http://example.org/x.png", "").replace("http://www.w3.org/2000/svg", "")
    assert not re.search(r"url\((?!#)|@import|https?://|fetch\(|XMLHttp|import\(", known.replace('url(#" + id', ""))


def test_numbers_stand_in_the_text(written: Written) -> None:
    text = Page(written.files[0].read_text(encoding="utf-8")).text.replace("\u00a0", " ")
    for number in ("96 %", "94 to 97 %", "93 %", "41 %", "22.918°", "0.3996 … 0.4004", "< 0.001", "321"):
        assert number in text, number
    for name in ("soil_shear", "inertia of one track about its hinge", "track angle at which the stop begins"):
        assert name in text, name


def test_the_meaning_of_a_parameter_stands_alone() -> None:
    """It is shown in the place of its name."""
    for effect in CATALOGUE.values():
        for parameter in effect.parameters:
            assert parameter.meaning.split()[0] not in ("of", "between", "over", "while", "until", "positive:"), (effect.id, parameter.name)


def test_page_is_small_enough_to_send(written: Written, vehicle: Vehicle) -> None:
    """Two bags; and a dozen with six findings, whose curves are thinned."""
    assert written.files[0].stat().st_size < 1.5e6
    full = missing(vehicle)
    ids = [name for name in CATALOGUE if not CATALOGUE[name].per_line][:6]
    effects = tuple(dataclasses.replace(full.effects[0], id=name) for name in ids)
    one = full.traces[0]
    trace = dataclasses.replace(
        one, contributions=dict.fromkeys(ids, one.contributions["end_stop"]), intervals=dict.fromkeys(ids, one.intervals["end_stop"])
    )
    many = tuple(dataclasses.replace(trace, name=f"bag {i}") for i in range(12))
    page = render(dataclasses.replace(full, traces=many, effects=effects, bags=tuple(t.name for t in many)))
    assert len(page.encode()) < 2e6
    for chart in list(specs(Page(page)).values())[:12]:
        measured = chart["panels"][0]["series"][0]["y"]
        assert max(measured) == pytest.approx(one.measured.max() * 1e-3, abs=2e-3)  # the peak has stayed


def test_the_page_suits_phone_dark_ground_print_and_keyboard(written: Written) -> None:
    source = written.files[0].read_text(encoding="utf-8")
    assert '<meta name="viewport" content="width=device-width, initial-scale=1">' in source
    for query in ("screen and (prefers-color-scheme: dark)", "(max-width: 640px)", "print", "(prefers-reduced-motion"):
        assert f"@media {query}" in source
    assert "focus-visible" in source
    body = source[source.index("<body") : source.index('<script type="application/json"')]
    assert not re.search(r"#[0-9a-f]{3,6}\b(?!;)|rgb\(", re.sub(r"href=\"#[^\"]*\"", "", body))  # colours are those of the style
    assert body.count("<th ") == body.count('scope="col"')
    tables = re.findall(r"<table.*?</table>", body, re.DOTALL)
    assert len(tables) > 5
    assert all(cell.startswith(" data-label=") or ' data-label="' in cell for t in tables for cell in re.findall(r"<td([^>]*)>", t))
    assert max(t.split("</thead>")[0].count("<th ") for t in tables) <= 6


def test_every_colour_of_a_chart_is_in_the_style_on_both_grounds(written: Written) -> None:
    source = written.files[0].read_text(encoding="utf-8")
    styles = {s["style"] for chart in specs(Page(source)).values() for panel in chart["panels"] for s in panel["series"]}
    styles |= {span["style"] for chart in specs(Page(source)).values() for span in chart["spans"]}
    assert styles >= {"measured", "baseline", "augmented", "held", "0"}
    for style in styles:
        assert re.search(rf"\.s-{style} {{ stroke: var\(--[\w-]+\)", source), style


def test_the_first_screen_says_what_where_how_much_and_what_to_do(vehicle: Vehicle) -> None:
    effect = dataclasses.replace(missing(vehicle).effects[0], largest_Nm=9_746.0, largest_share=0.165)
    headline = "Missing from the model: X, beyond 23 deg, up to 9750 N m (17 % of the torque). Use augmented.yaml."
    diagnosis = dataclasses.replace(missing(vehicle), effects=(effect,), headline=headline, statement=f"{headline} Then numbers.")
    source = render(diagnosis)
    head = Page(source[source.index("<header") : source.index("</header>")]).text.replace("\u00a0", " ")
    assert head.index(headline) < head.index("Then numbers.") < head.index("Elastic end stop of the steering")
    assert head.count(headline) == 1
    for number in ("up to 9750 N m", "17 % of the torque", "2100 N m → 84 N m", "96 %"):
        assert number in head, number


@pytest.mark.parametrize(("end", "live"), [("time_start", "do not give it to the live node"), ("angle_low", "vehicle_file:=augmented")])
def test_what_holds_at_the_times_of_a_recording_is_not_for_the_live_node(vehicle: Vehicle, end: str, live: str) -> None:
    patch = dataclasses.replace(missing(vehicle).effects[0], id="surface_patch", parameters={end: FittedValue(0.1, (0.0, 0.2), "s")})
    changed = vehicle.replace(effects=(EffectEntry("surface_patch", {"change": 0.1, end: 0.1}),))
    found = Augmented(80.0, 84.0, 0.96, (0.94, 0.97), changed)
    source = render(dataclasses.replace(missing(vehicle), effects=(patch,), traces=(), augmented=found))
    assert live in source[source.index('<section id="next">') : source.index('<section id="torque">')]


def test_a_name_that_is_only_the_nearest_is_where_to_look(vehicle: Vehicle) -> None:
    named = missing(vehicle)
    nearest = dataclasses.replace(named, effects=(dataclasses.replace(named.effects[0], bends=True),))
    told = "as where to look, not as the cause"
    assert told in page_of(nearest).text
    assert told not in page_of(named).text


def test_sheet_values_stand_beside_fitted_ones(vehicle: Vehicle) -> None:
    assert vehicle.friction is not None
    fitted = vehicle.replace(friction=dataclasses.replace(vehicle.friction, coulomb=0.6))
    source = render(dataclasses.replace(missing(fitted), sheet=vehicle))
    section = Page(source[source.index('<section id="baseline">') : source.index('<section id="origin">')]).text.replace("\u00a0", " ")
    assert re.search(r"friction\.coulomb\s*0\.75\s*0\.6\s*-20\.0 %", section)


def test_the_origin_is_that_of_the_file_given_not_once_more_of_the_result(vehicle: Vehicle) -> None:
    sheet = vehicle.replace(provenance={"measured_by": "<i>me</i>", "sent": [1.5, None]})
    found = dataclasses.replace(missing(vehicle, "a result"), sheet=sheet)
    source = render(found)
    section = source[source.index('<section id="origin">') : source.index('<section id="reading">')]
    assert "<i>" not in section
    said = Page(section).text
    assert all(words in said for words in ("measured by", "<i>me</i>", "1.5, none"))
    assert "a result" not in said
    assert "says of itself" not in render(dataclasses.replace(found, sheet=vehicle))


def test_pictures_are_beside_the_page(written: Written) -> None:
    names = [file.name for file in written.files]
    assert names[0] == "report.html"
    assert {"residual_end_stop.png", "evidence.png", "heldout.png"} < set(names)
    assert sum(name.startswith("before_after_") for name in names) == 2
    assert all(file.parent == written.files[0].parent and file.stat().st_size > 5000 for file in written.files)
    assert written.note is None


def test_bags_of_one_name_do_not_overwrite_each_others_pictures(vehicle: Vehicle, tmp_path: Path) -> None:
    one = consistent(vehicle)
    same = dataclasses.replace(one, traces=tuple(dataclasses.replace(t, name="run/../x") for t in one.traces))
    pictures = [file for file in write_report(same, tmp_path).files if file.name.startswith("before_after")]
    assert len(set(pictures)) == 2
    assert all(file.parent == tmp_path and file.is_file() for file in pictures)


@pytest.mark.parametrize("make", [consistent, unlisted, insufficient])
def test_every_verdict_has_a_page(vehicle: Vehicle, make: Callable[[Vehicle], Diagnosis]) -> None:
    diagnosis = make(vehicle)
    page = page_of(diagnosis)
    assert diagnosis.json["verdict"].replace("_", " ") in page.text
    assert "effects" not in page.ids
    assert len(specs(page)) == len(diagnosis.traces)  # torque only: nothing was found that could be drawn
    assert "nan" not in re.sub(r"\w{4,}", "", page.text).lower()


def test_linear_axes_have_their_own_units(vehicle: Vehicle) -> None:
    coordinate = dataclasses.replace(vehicle.coordinate, name="position", unit="m", force_unit="N")
    page = page_of(missing(vehicle.replace(coordinate=coordinate)))
    assert "N/m" in page.text
    assert "N m" not in page.text.replace("\u00a0", " ")
    assert "position (mm)" in page.text
    assert "position (mm)" in page.scripts[0]


# ----------------------------------------------------------------- the plots


def series_of(chart: Chart, panel: int) -> dict[str, Series]:
    return {series.name: series for series in chart.panels[panel].series}


def test_drawn_curves_are_the_data(vehicle: Vehicle) -> None:
    diagnosis = missing(vehicle)
    one = diagnosis.traces[0]
    drawn = page_of(diagnosis)
    chart = specs(drawn)["chart-0"]
    stop = "Elastic end stop of the steering"
    for panel, name, values in (
        (0, "measured", one.measured), (0, "recalibrated baseline", one.baseline), (0, "with what was found", one.augmented),
        (1, "recalibrated baseline", one.measured - one.baseline), (1, "with what was found", one.measured - one.augmented),
        (2, stop, one.contributions["end_stop"]),
    ):  # fmt: skip
        (curve,) = (series for series in chart["panels"][panel]["series"] if series["name"] == name)
        assert "(kN m)" in chart["panels"][panel]["label"]
        np.testing.assert_allclose(curve["y"], values * 1e-3, atol=1.1e-4 * np.abs(values).max() * 1e-3)
        assert (curve["x0"], curve["dx"]) == (0.0, pytest.approx(0.01))
    (acts,) = (span for span in chart["spans"] if span["name"] == stop)
    assert acts["shade"]
    assert acts["at"] == [pytest.approx(span, abs=1e-3) for span in one.intervals["end_stop"]]


def test_fitted_law_lies_on_what_the_rest_of_the_model_leaves(vehicle: Vehicle) -> None:
    diagnosis = missing(vehicle)
    data = series_of(plots.residual_chart(diagnosis, diagnosis.json["effects"][0]), 0)
    law, partial = data["its fitted law"], data["what the rest of the model leaves to this effect"]
    assert partial.x is not None
    assert law.x is not None
    expected = STIFFNESS * np.sign(partial.x) * np.maximum(np.abs(np.radians(partial.x)) - ENGAGE, 0.0) * 1e-3
    assert np.sqrt(np.mean((partial.y - expected) ** 2)) == pytest.approx(NOISE * 1e-3, rel=0.05)
    x, y = law.x[np.isfinite(law.x)], law.y[np.isfinite(law.x)]
    np.testing.assert_allclose(
        y, STIFFNESS * np.sign(x) * np.maximum(np.abs(np.radians(x)) - ENGAGE, 0.0) * 1e-3, atol=3e-3
    )


def test_a_patch_between_two_instants_is_drawn_over_time_and_one_of_the_angle_over_the_angle(vehicle: Vehicle) -> None:
    diagnosis = missing(vehicle)
    traces = tuple(
        dataclasses.replace(t, contributions={"surface_patch": t.contributions["end_stop"]}, coordinates={**t.coordinates, "time": t.time})
        for t in diagnosis.traces
    )  # fmt: skip
    diagnosis = dataclasses.replace(diagnosis, traces=traces, coordinate_of={"surface_patch": "steering angle"})
    for ends, unit, label in ((("time_start", "time_end"), "s", "time (s)"), (("angle_low", "angle_high"), "rad", "steering angle (deg)")):
        window = {name: FittedValue(value, None, unit) for name, value in zip(ends, (0.1, 0.3), strict=True)}
        patch = dataclasses.replace(diagnosis.effects[0], id="surface_patch", parameters={"change": FittedValue(0.5, None, "1"), **window})
        told = dataclasses.replace(diagnosis, effects=(patch,))
        cloud = plots.Cloud.of(told, told.json["effects"][0])
        chart = plots.residual_chart(told, told.json["effects"][0])
        assert chart.label == label
        shown = np.concatenate([t.coordinates[cloud.name] for t in traces])
        assert set(cloud.x) <= set(shown)
        assert np.ptp(cloud.x) == pytest.approx(np.ptp(shown), rel=0.01)


@pytest.mark.parametrize(
    ("low", "high", "told"),
    [
        (0.968, 0.982, "97 to 98 %"), (0.978, 0.981, "97.8 to 98.1 %"), (0.9801, 0.9804, "about 98 %"), (0.98, 0.98, "about 98 %"),
        (-0.031, 0.2, "-3 to 20 %"), (-0.003, 0.004, "-0.3 to 0.4 %"), (-0.0001, 0.0001, "about 0 %"), (0.9996, 0.9999, "about 100 %"),
        (0.9981, 0.9999, "99.8 to 100.0 %"), (None, 0.5, "-"), (math.nan, 0.5, "-"),
    ],
)  # fmt: skip
def test_the_ends_of_an_interval_are_told_apart_or_as_one(low: float | None, high: float | None, told: str) -> None:
    assert words.percents(low, high) == told


def test_page_and_screen_tell_an_interval_of_one_percent_with_a_digit_more(vehicle: Vehicle) -> None:
    diagnosis = missing(vehicle)
    close = dataclasses.replace(diagnosis.augmented, improvement_ci95=(0.978, 0.981))
    diagnosis = dataclasses.replace(diagnosis, augmented=close)
    assert "95 % interval 97.8 to 98.1 %" in re.sub(r"&nbsp;|&#160;|\u00a0", " ", head.head(diagnosis))
    console = Console(width=100, record=True, file=io.StringIO())
    show_diagnosis(console, diagnosis)
    assert "97.8 to 98.1 %" in console.export_text().replace("\u00a0", " ")


def test_heldout_bars_are_the_errors_that_were_judged(vehicle: Vehicle) -> None:
    diagnosis = missing(vehicle)
    rows = plots.heldout_rows(diagnosis)
    assert rows[0] == ("all bags", 2100.0, 84.0, (pytest.approx(63.0), pytest.approx(126.0)))
    assert rows[1:] == [(one.name, 2000.0 + seed, 80.0 + seed, None) for seed, one in enumerate(diagnosis.traces, 1)]
    rotated = dataclasses.replace(diagnosis, traces=tuple(dataclasses.replace(one, heldout_Nm=None) for one in diagnosis.traces))
    assert plots.heldout_rows(rotated) == rows[:1]


@given(arrays(np.float64, st.integers(1, 400), elements=st.floats(-1e6, 1e6)), st.integers(2, 50))
def test_thinned_curves_keep_their_peaks(values: np.ndarray, limit: int) -> None:
    points, width = words.thin(values, limit)
    assert points.size <= limit + 1
    assert (points.min(), points.max()) == (values.min(), values.max())
    assert points.size * width >= values.size > (points.size - 2) * width


@pytest.mark.parametrize(("value", "beside", "text"), [
    (137.284, 0.0, "137.3"), (0.01634, 0.0, "0.0163"), (0.0, 0.0, "0.0"), (0.00642, 4740.3, "0.0"), (-0.0017, 0.105, "-0.002"),
    (9.876, 0.0, "9.88"),
])  # fmt: skip
def test_errors_have_the_digits_of_their_machine(value: float, beside: float, text: str) -> None:
    assert words.tenths(value, "", beside) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (None, "-"), (float("inf"), "-"), (1.0, "1"), (-0.41999, "-0.42"), (12345.6, "12\u202f350"), (3317.4, "3317"),
     (3.1234e-7, "3.123e-07"), (99999.0, "100\u202f000"), (0.00123456, "0.001235")],
)  # fmt: skip
def test_numbers_are_readable(value: float | None, text: str) -> None:
    assert words.number(value) == text


@pytest.mark.parametrize(("count", "text"), [(0, "0"), (3317, "3317"), (42_727, "42\u202f727"), (-1_000_000, "-1\u202f000\u202f000")])
def test_counts_are_exact_in_the_groups_of_numbers(count: int, text: str) -> None:
    assert words.whole(count) == text


@pytest.mark.parametrize(
    ("share", "said"),
    [(0.0, "0 %"), (1e-6, "less than 0.1 %"), (0.0006, "0.1 %"), (0.084, "8.4 %"), (0.996, "100 %"), (-1e-6, "0 %"), (None, "-")],
)
def test_a_small_share_is_not_none(share: float | None, said: str) -> None:
    assert words.percent(share) == said
    assert counted(1, "recording") == "1 recording"
    assert counted(2, "message is lost", "messages are lost") == "2 messages are lost"


def test_intervals_show_digits_that_differ() -> None:
    value, ends = words.estimate(0.4200123, [0.4199921, 0.4200325])
    low, high = (float(end) for end in ends.split(" … "))
    assert high - low == pytest.approx(0.4200325 - 0.4199921, rel=0.05)
    assert low < float(value) < high
    assert words.estimate(1.006e7, [6.48e6, 1.362e7]) == ("1.01e+07", "6.48e+06 … 1.36e+07")  # one notation


# ----------------------------------------------------------------- missing libraries


def test_without_matplotlib_the_page_is_whole(vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    for name in ("matplotlib", "lugre_steering.report.style", "lugre_steering.diagnosis.report.figures"):
        monkeypatch.setitem(sys.modules, name, None)
    result = write_report(missing(vehicle), tmp_path)
    assert [file.name for file in result.files] == ["report.html"]
    page = Page(result.files[0].read_text(encoding="utf-8"))
    assert len(specs(page)) == 3
    assert set(page.ids) >= SECTIONS
    assert "matplotlib" in str(result.note)
    assert "lugre_steering[report]" in str(result.note)


# ----------------------------------------------------------------- a real browser


@dataclasses.dataclass
class Seen:
    dom: str
    console: list[str]
    requests: set[str]


def browse(file: Path, folder: Path) -> Seen:
    """Open a page in headless Chromium: the document after its scripts ran, console messages, addresses asked for."""
    assert CHROMIUM is not None
    log = folder / "net.json"
    command = [
        CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
        "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
        f"--user-data-dir={folder / 'profile'}", "--enable-logging=stderr", "--v=0", f"--log-net-log={log}",
        "--virtual-time-budget=10000", "--window-size=1280,1200", "--dump-dom", file.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=240)
    # Read as text: Chromium may end before it closes the list. Its own requests have no page as their initiator.
    asked = set(re.findall(r'"initiator":"(?!not an origin").*?"url":"([^"]+)"', log.read_text(encoding="utf-8")))
    return Seen(done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line], asked)


needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")


@needs_chromium
def test_browser_draws_every_plot_without_an_error_or_a_request(written: Written, tmp_path: Path) -> None:
    seen = browse(written.files[0], tmp_path)
    page = Page(written.files[0].read_text(encoding="utf-8"))
    assert seen.console == []
    assert {address for address in seen.requests if not address.startswith("file:")} == set()
    for name in specs(page):
        at = seen.dom.index(f'id="{name}"')
        assert '<path d="M' in seen.dom[at : seen.dom.index("</figure>", at)], name
    assert seen.dom.count('class="chart"') == len(specs(page)) == 3
    assert seen.dom.count("<script>alert") == 0


@needs_chromium
def test_what_is_folded_on_a_screen_is_on_paper_too(written: Written, tmp_path: Path) -> None:
    file = tmp_path / "printed.html"
    asked = """<details><summary>2 more</summary><p>one</p><p>two</p></details><script>
      function folded() { return document.querySelectorAll("details:not([open])").length; }
      var told = [folded()];
      ["beforeprint", "afterprint"].forEach(function (name) { window.dispatchEvent(new Event(name)); told.push(folded()); });
      document.body.setAttribute("data-folded", told.map(Boolean).join(" "));
    </script></body>"""
    file.write_text(written.files[0].read_text(encoding="utf-8").replace("</body>", asked), encoding="utf-8")
    assert 'data-folded="true false true"' in browse(file, tmp_path).dom


@needs_chromium
def test_browser_check_would_see_errors_and_requests(tmp_path: Path) -> None:
    """The check itself can fail: a page that throws and that loads something is caught."""
    file = tmp_path / "bad.html"
    file.write_text('<img src="http://127.0.0.1:9/x.png"><script>throw new Error("broken")</script>', encoding="utf-8")
    seen = browse(file, tmp_path)
    assert any("broken" in line for line in seen.console)
    assert "http://127.0.0.1:9/x.png" in seen.requests


# ----------------------------------------------------------------- the catalogue on the command line


def effects(*arguments: str | Path) -> Any:
    return CliRunner().invoke(app, ["effects", *map(str, arguments)], env={"COLUMNS": "160"})


def test_list_names_every_effect_and_what_the_unobservable_ones_need() -> None:
    done = effects()
    assert done.exit_code == 0
    words = " ".join(done.stdout.split())
    assert all(name in words for name in CATALOGUE)
    assert "not observable: needs the drive speed" in words
    listed = json.loads(effects("--json").stdout)
    assert [entry["id"] for entry in listed] == list(CATALOGUE)
    assert all(entry["source"] and entry["equation"] for entry in listed)


def test_unknown_effect_is_refused_with_a_suggestion() -> None:
    done = effects("endstop")
    assert done.exit_code == 2
    assert "did you mean 'end_stop'?" in done.output


def test_a_picture_needs_an_effect(tmp_path: Path) -> None:
    assert effects("--out", tmp_path).exit_code == 2


def test_one_effect_is_explained_with_its_picture(tmp_path: Path) -> None:
    done = effects("end_stop", "--out", tmp_path)
    assert done.exit_code == 0, done.output
    entry = CATALOGUE["end_stop"]
    for text in (entry.title, "Hunt and Crossley", "engage_angle", "N m/rad", "soil_shear", "varied-rates"):
        assert text in done.stdout, text
    assert (tmp_path / "end_stop.png").stat().st_size > 20_000


DRAWN = {(entry.coordinate, entry.per_line): name for name, entry in CATALOGUE.items() if entry.observable}.values()
"""Of each coordinate along which a trace is drawn one effect: pictures along the same differ in numbers alone."""


@pytest.mark.parametrize("effect_id", sorted(CATALOGUE))
def test_every_effect_is_explained_and_every_kind_of_trace_drawn(effect_id: str, tmp_path: Path) -> None:
    entry = CATALOGUE[effect_id]
    drawn = effect_id in DRAWN or not entry.observable
    done = effects(effect_id, "--json", *(["--out", tmp_path] if drawn else []))
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    if not entry.observable:
        assert (result["shown_by"], result["picture"]) == ([], None)
        assert result["needs"]
        return
    assert (result["picture"] is not None) == drawn
    assert not drawn or Path(result["picture"]).stat().st_size > 20_000
    sizes = [row["visible_rms_Nm"] for row in result["shown_by"]]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] > 0.0
    assert all(row["visible_rms_Nm"] <= row["rms_Nm"] * (1 + 1e-9) for row in result["shown_by"])
    assert set(result["example"]) <= {p.name for p in entry.parameters}


def test_drawn_differences_follow_the_laws() -> None:
    """Closed forms: a stop adds k (|theta| - engage) at each track, a slope its torque, a late stamp a shift of the curve."""
    for found in card.traces(CATALOGUE["end_stop"]):
        values = found.values
        beyond = np.maximum(np.abs(found.run.theta) - values["engage_angle"], 0.0)
        expected = (values["stiffness"] * np.sign(found.run.theta) * beyond).sum(axis=0)
        np.testing.assert_allclose(found.difference, expected, atol=1e-6 * values["stiffness"])
    chirp = next(t for t in card.traces(CATALOGUE["end_stop"]) if t.manoeuvre.name == "chirp")
    assert chirp.visible_rms < 1e-9  # 10 deg never reach the stop: but for rounding [N m]
    for found in card.traces(CATALOGUE["slope_bias"]):
        np.testing.assert_allclose(found.difference, found.values["torque"], rtol=1e-9)
    for found in card.traces(CATALOGUE["time_delay"]):
        late = np.interp(found.run.time - found.values["delay"], found.run.time, found.without)
        np.testing.assert_allclose(found.difference, late - found.without, atol=1e-6)


def test_logarithmic_axes_carry_plain_numbers(tmp_path: Path) -> None:
    """Names may hold any character, so nothing is read as mathematics; what Matplotlib writes there must not look like it."""
    plt = pytest.importorskip("matplotlib.pyplot")
    from lugre_steering.report.style import figure

    with figure(1, 1, "", tmp_path / "log.png") as axes:
        axes[0, 0].plot([0.01, 10.0], [1.0, 1000.0])
        axes[0, 0].set(xscale="log", yscale="log")
    shown = [label.get_text() for labels in ("xticklabels", "yticklabels") for label in plt.getp(axes[0, 0], labels)]
    assert {"0.01", "1", "10", "1000"} <= set(shown)
    assert not [text for text in shown if "$" in text]
    with figure(1, 1, "", tmp_path / "short.png") as axes:
        axes[0, 0].plot([0.09, 0.5], [0.0, 1.0])
        axes[0, 0].set(xscale="log")
    assert {"0.2", "0.3", "0.4", "0.5"} <= {label.get_text() for label in axes[0, 0].get_xticklabels(which="minor")}


# ----------------------------------------------------------------- the verdict on a terminal


def test_the_verdict_on_a_terminal_is_a_table_of_80_columns_with_the_first_sentence_first(vehicle: Vehicle) -> None:
    headline = "Missing from the model: X, beyond 23 deg, up to 9750 N m (17 % of the torque). Use augmented.yaml."
    statement = f"{headline} With it the held-out error falls. Look here."
    diagnosis = dataclasses.replace(missing(vehicle), headline=headline, statement=statement)
    console = Console(width=80, file=io.StringIO(), markup=False)
    show_diagnosis(console, diagnosis)
    lines = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
    text = " ".join(" ".join(lines).split())
    assert max(map(len, lines)) <= 80
    assert text.startswith(f"MISSING PHYSICS {headline} what was found")
    assert "unit Elastic end stop of the steering engage angle 0.4 0.3996 … 0.4004 rad" in text
    assert "held-out data 2100 N m 84 N m 80 N m" in text
    assert "improvement 96 % 94 to 97 %" in text
    assert "- Look here." in text


def test_a_finding_that_the_verdict_has_told_is_not_told_again_on_a_terminal(vehicle: Vehicle) -> None:
    full, long = insufficient(vehicle), "the sign is flipped, as far as can be told."
    findings = (
        BagFinding("sign_flipped", "/topic", "a bag", ((0.0, 1.0),), long),
        BagFinding("wrong_sheet", "", "", (), f"the vehicle file and the recordings disagree: {long}"),
        BagFinding("lost_messages", "", "a bag", (), "12 messages are lost"),
    )
    console = Console(width=80, file=io.StringIO(), markup=False)
    show_diagnosis(console, dataclasses.replace(full, statement=f"Put it right. a bag: {long}", data_quality=findings))
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert text.count(long) == 1
    assert "- wrong sheet: the vehicle file and the recordings disagree: see above" in text
    assert "- a bag: lost messages: 12 messages are lost" in text


@pytest.mark.parametrize(("make", "code"), [(consistent, 0), (missing, 3), (unlisted, 4), (insufficient, 5)])
def test_the_verdict_is_the_exit_code_on_request(
    vehicle: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make: Callable[[Vehicle], Diagnosis], code: int
) -> None:
    monkeypatch.setattr("lugre_steering.diagnosis.command.run", lambda *_, **__: make(vehicle))
    arguments = ["diagnose", "bag", "--vehicle", str(VEHICLE_FILE), "--out", str(tmp_path)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert CliRunner().invoke(app, [*arguments, "--exit-code"]).exit_code == code
