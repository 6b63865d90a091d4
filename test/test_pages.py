# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Every page on a phone and on a desktop, on light and on dark ground, as a real browser lays it out. All data are synthetic."""

from __future__ import annotations

import html
import json
import re
import subprocess
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from test_fleet_statistics import fleet_of_two
from test_replay_page import write_hour
from test_report import CHROMIUM, VEHICLE_FILE, missing, needs_chromium

from lugre_steering.diagnosis.report.page import render
from lugre_steering.fleet.run import run
from lugre_steering.serialise import as_json
from lugre_steering.vehicle import load

PHONE, DESKTOP, HIGH = 390, 1280, 3000
LEAST_LETTERS = 6
"""On the average line of a text of more than a dozen letters: a column may be narrow, not one of letters below each other."""
LEAST_TEXT, LEAST_CURVE = 4.5, 3.0
"""Contrast of text, and of what a chart draws, after WCAG 2.1 (1.4.3, 1.4.11)."""
LEAST_TARGET = 24
"""Height [pixels] of what a finger meets, after WCAG 2.2 (2.5.8)."""
LEAST_DIFFERENCE = 4.0 * 2.3
"""Between two colours in CIELAB; 2.3 is just noticeable (Mahy et al., Color Res. Appl. 19 (1994) 105)."""
SIGHTS = {
    "common": np.eye(3),
    "without red cones": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "without green cones": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "without blue cones": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
"""How linear red, green and blue are seen (Machado et al., IEEE Trans. Vis. Comput. Graph. 15 (2009) 1291)."""
BAD = """<!doctype html><body style="margin:0;background:#fff"><table style="width:700px"><tr><td>wide</td></tr></table>
<div style="width:1em;overflow-wrap:anywhere;color:#ccc">one letter wide and pale</div><button style="height:12px;font-size:8px">x</button>
<svg class="chart"><path class="curve" stroke="#eee" d="M0,0H99"/></svg></body>"""
MEASURE = """
<script>
function over(upper, lower) {  // one colour [r, g, b, alpha] on another
  return [0, 1, 2].map(function (i) { return upper[3] * upper[i] + (1 - upper[3]) * lower[i]; }).concat([1]);
}
function colour(said, opacity) {
  var parts = (said.match(/[\\d.]+/g) || [0, 0, 0, 0]).map(Number);
  return [parts[0], parts[1], parts[2], (parts.length > 3 ? parts[3] : 1) * opacity];
}
function luminance(c) {  // WCAG 2
  return c.slice(0, 3).map(function (n) { n /= 255; return n <= 0.04045 ? n / 12.92 : Math.pow((n + 0.055) / 1.055, 2.4); })
    .reduce(function (sum, n, i) { return sum + n * [0.2126, 0.7152, 0.0722][i]; }, 0);
}
function contrast(a, b) { var l = [luminance(a), luminance(b)]; return (Math.max(l[0], l[1]) + 0.05) / (Math.min(l[0], l[1]) + 0.05); }
function labels(d) { return Array.from(d.querySelectorAll("svg.chart text")).map(function (t) { return t.textContent; }).join(" "); }
function told(frame) {
  var d = frame.contentDocument, w = frame.contentWindow, style = function (e) { return w.getComputedStyle(e); };
  var ground = function (e) { for (; e; e = e.parentElement) { var c = colour(style(e).backgroundColor, 1); if (c[3] > 0.99) return c; } };
  var seen = function (e) { var r = e.getBoundingClientRect(); return r.width > 1 && r.right > 0 && style(e).visibility !== "hidden"; };
  var texts = [], walker = d.createTreeWalker(d.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    var node = walker.currentNode, e = node.parentElement, said = node.nodeValue.trim(), range = d.createRange();
    if (!said || /^(SCRIPT|STYLE|NOSCRIPT)$/.test(e.tagName) || !seen(e)) continue;
    range.selectNodeContents(node);
    var lines = new Set(Array.from(range.getClientRects()).map(function (r) { return Math.round(r.top); })).size;
    var ink = over(colour(e.closest("svg.chart") ? style(e).fill : style(e).color, 1), ground(e));
    var letters = said.length / Math.max(lines, 1);
    texts.push({ said: said.slice(0, 60), letters: letters, length: said.length, contrast: contrast(ink, ground(e)) });
  }
  var curves = Array.from(d.querySelectorAll("svg.chart path.curve, svg.chart path.dots")).map(function (p) {
    var s = style(p), g = ground(p);
    return { look: p.getAttribute("class"), contrast: contrast(over(colour(s.stroke, Number(s.opacity)), g), g) };
  });
  return {
    needs: d.documentElement.scrollWidth, ground: luminance(ground(d.body)), texts: texts, curves: curves,
    cut: Array.from(d.querySelectorAll(".scroll, figure, .formula, .verdict, .card")).filter(function (e) {
      return e.scrollWidth > e.clientWidth + 1; }).map(function (e) { return e.textContent.slice(0, 60); }),
    charts: Array.from(d.querySelectorAll("svg.chart")).map(function (s) { return s.getBoundingClientRect().width; }),
    small: Array.from(d.querySelectorAll("button, summary, nav a")).filter(function (b) {
      return seen(b) && b.getBoundingClientRect().height < 24; }).map(function (b) { return b.textContent; }),
    at_first: labels(d), zoomed: ["+", "Home"].map(function (key) {
      var chart = d.querySelector("figure [tabindex='0'][aria-label]");
      if (chart) chart.dispatchEvent(new w.KeyboardEvent("keydown", { key: key, bubbles: true }));
      return labels(d);
    })
  };
}
window.addEventListener("load", function () {
  document.body.setAttribute("data-told", JSON.stringify(Array.from(document.querySelectorAll("iframe")).map(told)));
});
</script>"""


@dataclass(frozen=True)
class Seen:
    """What a browser made of each page by its name and width, what of the bad one, and the screenshots (rows, columns, 3), 0 to 1."""

    dark: bool
    told: dict[tuple[str, int], dict[str, Any]]
    bad: dict[str, Any]
    screenshots: dict[tuple[str, int], np.ndarray]


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The page of a diagnosis, of a replay and of a fleet."""
    folder, vehicle = tmp_path_factory.mktemp("pages"), load(VEHICLE_FILE)
    write_hour(vehicle, folder / "replay.html")
    rows = [
        {**row, "effects": [], "recordings": 1, "duration_s": 60.0, "bag_sha256": row["inputs"], "seconds": 1.0,
         "files": {f"{row['inputs']}_a_recording_of_a_long_name.mcap": "f" * 64}}
        for row in fleet_of_two()
    ]  # fmt: skip
    (folder / "map.yaml").write_text(as_json({"vehicles": {name: {"file": VEHICLE_FILE, "bags": ["*"]} for name in ("A", "B")}}))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lugre_steering.fleet.run._work", lambda *_: iter(rows))
        patch.setattr("lugre_steering.fleet.run.in_processes", lambda *_: iter(()))
        run([], folder / "map.yaml", folder / "fleet", jobs=1)
    return {
        "diagnosis": render(missing(vehicle, "a_long_name_of_a_run_2026-05-04")),
        "replay": (folder / "replay.html").read_text(encoding="utf-8"),
        "fleet": (folder / "fleet" / "report.html").read_text(encoding="utf-8"),
    }


@pytest.fixture(scope="module", params=["light", "dark"])
def seen(pages: dict[str, str], tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Seen:
    """All pages at both widths, in frames side by side: a window of Chromium itself is never as narrow as a phone."""
    image = pytest.importorskip("matplotlib.image")
    folder, frames, left, end = tmp_path_factory.mktemp(request.param), "", {}, 0
    for name, width in [*((name, width) for name in pages for width in (PHONE, DESKTOP)), ("bad", PHONE)]:
        frames += f'<iframe style="left:{end}px;width:{width}px" srcdoc="{html.escape((pages | {"bad": BAD})[name])}"></iframe>'
        left[name, width], end = end, end + width
    style = f"<style>body {{ margin: 0 }} iframe {{ position: absolute; top: 0; height: {HIGH}px; border: 0 }}</style>"
    (folder / "all.html").write_text(f"<!doctype html><body>{style}{frames}{MEASURE}</body>", encoding="utf-8")
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", f"--user-data-dir={folder / 'profile'}",
        f"--blink-settings=preferredColorScheme={int(request.param == 'light')}", f"--window-size={end},{HIGH}", "--hide-scrollbars",
        "--virtual-time-budget=10000", f"--screenshot={folder / 'all.png'}", "--dump-dom", (folder / "all.html").as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=240)
    found = re.search(r'data-told="([^"]*)"', done.stdout)
    assert found is not None, done.stderr
    told, picture = dict(zip(left, json.loads(html.unescape(found[1])), strict=True)), image.imread(folder / "all.png")[..., :3]
    bad = told.pop(("bad", PHONE))
    return Seen(request.param == "dark", told, bad, {key: picture[:, left[key] : left[key] + key[1]] for key in told})


def narrow(told: dict[str, Any]) -> list[str]:
    return [text["said"] for text in told["texts"] if text["length"] > 12 and text["letters"] < LEAST_LETTERS]


def pale(told: dict[str, Any]) -> list[str]:
    texts = [text["said"] for text in told["texts"] if text["contrast"] < LEAST_TEXT]
    return texts + [curve["look"] for curve in told["curves"] if curve["contrast"] < LEAST_CURVE]


@needs_chromium
def test_nothing_is_cut_off_narrow_pale_or_too_small_for_a_finger(seen: Seen) -> None:
    for (name, width), told in seen.told.items():
        page = f"{name} {width}"
        assert told["needs"] <= width, page
        assert told["cut"] == [], page
        assert narrow(told) == [], page
        assert pale(told) == [], page
        assert told["small"] == [], page
        assert len(told["texts"]) > 50, page
        assert told["charts"], page
        assert min(told["charts"]) > 0.6 * min(width, 780), page
        assert (told["ground"] < 0.05) == seen.dark, page


@needs_chromium
def test_what_is_cut_off_narrow_pale_or_small_would_be_seen(seen: Seen) -> None:
    assert seen.bad["needs"] > PHONE
    assert narrow(seen.bad) == ["one letter wide and pale"]
    assert pale(seen.bad) == ["one letter wide and pale", "curve"]
    assert seen.bad["small"] == ["x"]


@needs_chromium
def test_keys_zoom_a_chart_and_show_all_of_it_again(seen: Seen) -> None:
    for page, told in seen.told.items():
        assert told["zoomed"][0] != told["zoomed"][1], page
        assert told["zoomed"][1] == told["at_first"], page


@needs_chromium
def test_screenshots_show_curves_on_their_ground(seen: Seen) -> None:
    for page, picture in seen.screenshots.items():
        ground = np.abs(picture - picture[0, 0]).max(axis=2) < 0.05  # the corner is empty
        assert ground.mean() > 0.5, page
        assert (picture[ground].mean() < 0.2) == seen.dark, page
        coloured = np.ptp(picture, axis=2) > 0.3
        assert coloured.sum() > 1000, page
        assert coloured[:, -2:].sum() == 0, page  # nothing runs off the edge


@pytest.mark.parametrize("sight", SIGHTS)
def test_colours_of_a_family_of_curves_are_told_apart_by_all_eyes(pages: dict[str, str], sight: str) -> None:
    style = pages["replay"][: pages["replay"].index("</style>")]
    for i, ground in enumerate(style.split("prefers-color-scheme: dark")[:2]):
        colours = np.array([lab(SIGHTS[sight] @ linear(code)) for code in re.findall(r"--series-\d: #([0-9a-f]{6})", ground)])
        assert len(colours) == 6
        apart = np.linalg.norm(colours[:, None] - colours, axis=2)[np.triu_indices(6, 1)]
        assert apart.min() > LEAST_DIFFERENCE, i


def linear(code: str) -> np.ndarray:
    """Linear red, green and blue of six hexadecimal digits (IEC 61966-2-1)."""
    parts = np.array([int(code[i : i + 2], 16) for i in (0, 2, 4)]) / 255.0
    return np.asarray(np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4))


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIELAB of linear red, green and blue under D65."""
    to_xyz = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])
    xyz = to_xyz @ np.clip(rgb, 0.0, 1.0) / [0.95047, 1.0, 1.08883]
    x, y, z = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16.0) / 116.0)
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])
