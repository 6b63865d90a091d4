# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The shipped layouts of PlotJuggler and Foxglove show topics and fields that the node has, and nothing else."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from jsonschema import validate
from rosbags.typesys import Stores, get_typestore

from lugre_steering.bag import Bag
from lugre_steering.bench.replay import write_cycle
from lugre_steering.replay.outputs import PREFIX
from lugre_steering.replay.run import replay
from lugre_steering.resources import config_folder
from lugre_steering.vehicle import load

LAYOUTS = config_folder() / "layouts"
VEHICLE = config_folder() / "test_vehicle.yaml"
STORE = get_typestore(Stores.ROS2_JAZZY)
TEXT, FLAG, NUMBER = {"type": "string"}, {"type": "boolean"}, {"type": "number"}


def exactly(optional: Mapping[str, Any] | None = None, /, **required: Any) -> dict[str, Any]:
    """A JSON schema of an object with these members and no others."""
    members = {**required, **(optional or {})}
    return {"type": "object", "properties": members, "required": list(required), "additionalProperties": False}


CURVE = exactly(
    {"color": {"type": "string", "pattern": "^#[0-9a-f]{6}$"}, "label": TEXT}, value=TEXT, enabled=FLAG,
    timestampMethod={"enum": ["receiveTime", "headerStamp"]},
)  # fmt: skip
PANELS = {
    "Plot": exactly(
        {"followingViewWidth": NUMBER}, foxglovePanelTitle=TEXT, paths={"type": "array", "minItems": 1, "items": CURVE}, showLegend=FLAG,
        legendDisplay={"enum": ["floating", "top", "left", "none"]}, showPlotValuesInLegend=FLAG, showXAxisLabels=FLAG,
        showYAxisLabels=FLAG, isSynced=FLAG, xAxisVal={"enum": ["timestamp", "index", "custom", "currentCustom"]}, sidebarDimension=NUMBER,
    ),
    "DiagnosticSummary": exactly(
        foxglovePanelTitle=TEXT, topicToRender=TEXT, minLevel={"enum": [0, 1, 2, 3]}, pinnedIds={"type": "array", "items": TEXT},
        hardwareIdFilter=TEXT, sortByLevel=FLAG,
    ),
}  # fmt: skip
"""Settings of a panel: PlotConfig, DiagnosticSummaryConfig and PANEL_TITLE_CONFIG_KEY of Foxglove Studio 1.48."""
LAYOUT = exactly(
    configById={
        "type": "object", "patternProperties": {f"^{panel}!": schema for panel, schema in PANELS.items()}, "additionalProperties": False,
    },
    globalVariables={"type": "object"}, userNodes={"type": "object"}, playbackConfig=exactly(speed=NUMBER), layout={"type": "object"},
)  # fmt: skip
"""LayoutData of the same; no other schemas are published."""
PARTS = {
    "root": ((), ("tabbed_widget", "use_relative_time_offset", "Plugins", "previouslyLoaded_Datafiles", "previouslyLoaded_Streamer",
                  "customMathEquations", "snippets")),
    "tabbed_widget": (("parent", "name"), ("Tab", "currentTabIndex")),
    "Tab": (("tab_name", "containers"), ("Container",)),
    "Container": ((), ("DockSplitter",)),
    "DockSplitter": (("orientation", "count", "sizes"), ("DockArea",)),
    "DockArea": (("name",), ("plot",)),
    "plot": (("mode", "style", "flip_x", "flip_y"), ("range", "limitY", "curve")),
    "range": (("left", "right", "top", "bottom"), ()),
    "curve": (("name", "color"), ()),
    "currentTabIndex": (("index",), ()),
    "use_relative_time_offset": (("enabled",), ()),
    "previouslyLoaded_Streamer": (("name",), ()),
}  # fmt: skip
"""Elements of a layout of PlotJuggler 3, their attributes and what may stand in them, as xmlSaveState of its widgets writes them."""


@pytest.fixture(scope="module")
def topics(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, str]:
    """Topics of the estimator and their types, as a replay of it records them."""
    folder = tmp_path_factory.mktemp("replay")
    write_cycle(folder / "run", 2.0)
    replay([folder / "run"], VEHICLE, folder / "out")
    with Bag(folder / "out" / "run") as bag:
        return {topic: kind for topic, kind in bag.topics.items() if topic.startswith(PREFIX)}


def fields(msgtype: str, prefix: str = "") -> Iterator[str]:
    """Numbers of a message by their path; the members of a sequence as [0], [1]."""
    for name, (kind, what) in STORE.fielddefs[msgtype][1]:
        if kind.name == "NAME":
            yield from fields(what, f"{prefix}{name}.")
        elif kind.name == "BASE":
            yield f"{prefix}{name}"
        else:
            yield from (f"{prefix}{name}[{i}]" for i in range(2))


def test_foxglove(topics: Mapping[str, str]) -> None:
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    validate(layout, LAYOUT)
    known = {f"{topic}.{path}" for topic, kind in topics.items() for path in fields(kind)}
    shown = [path["value"] for panel in layout["configById"].values() for path in panel.get("paths", [])]
    assert set(shown) <= known
    assert {path.partition(".")[0] for path in shown} == set(topics)
    placed = list(places(layout["layout"]))
    assert sorted(placed) == sorted(layout["configById"])
    assert {name.partition("!")[0] for name in placed} == {"Plot", "DiagnosticSummary"}


def places(part: Any) -> Iterator[str]:
    """Panels in the mosaic: names, or a row or column of two."""
    if isinstance(part, str):
        yield part
        return
    assert part["direction"] in ("row", "column")
    assert 0 < part["splitPercentage"] < 100
    yield from places(part["first"])
    yield from places(part["second"])


def test_plotjuggler(topics: Mapping[str, str]) -> None:
    """It names the numbers of a JointState by joint, in place of their index."""
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    for part in root.iter():
        attributes, inside = PARTS.get(part.tag, ((), ()))
        assert set(part.attrib) == set(attributes), part.tag
        assert {inner.tag for inner in part} <= set(inside), part.tag
    joints = [getattr(load(VEHICLE).topics, f"{side}_joint") for side in ("left", "right")]
    known = set()
    for topic, kind in topics.items():
        for path in fields(kind):
            array = re.fullmatch(r"(position|velocity|effort)\[(\d)\]", path)
            known.add(f"{topic}/{joints[int(array[2])]}/{array[1]}" if array else f"{topic}/{path.replace('.', '/')}")
    shown = [curve.attrib["name"] for curve in root.iter("curve")]
    assert set(shown) <= known
    assert all(any(name.startswith(f"{topic}/") for name in shown) for topic in topics)
    assert root.tag == "root"
    (splitter,) = root.iter("DockSplitter")
    assert splitter.attrib["orientation"] in ("|", "-")
    assert int(splitter.attrib["count"]) == len(splitter) == len(splitter.attrib["sizes"].split(";"))


def test_both_are_named_where_a_user_looks() -> None:
    said = (LAYOUTS / "README.md").read_text()
    for file in LAYOUTS.iterdir():
        assert file.name in said or file.name == "README.md"
        assert Path(file).stat().st_size > 100
    assert "[layouts for PlotJuggler and Foxglove](config/layouts/README.md)" in (Path(__file__).parents[1] / "README.md").read_text()
