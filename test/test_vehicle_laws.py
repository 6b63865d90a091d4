# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Laws in vehicle files: kept whole, and every mistake refused by file and key."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from lugre_steering.effects.law_entry import law_fields
from lugre_steering.errors import VehicleFileError
from lugre_steering.vehicle import from_mapping, load, save

FILE = Path(__file__).resolve().parents[1] / "config" / "single_joint_example.yaml"
LAW: dict[str, Any] = {
    "channel": "conservative_torque", "coordinate": "rate", "form": "step", "range": [-1.0, 1.0], "memory": "lag", "memory_size": 2.0,
    "values": {"before": 0.0, "after": 3.0, "at": 0.2, "width": 0.05}, "title": "a drag that remembers the rate",
    "intervals": {"after": [2.5, 3.5]}, "heldout_gain": 0.9,
}  # fmt: skip
TABLE: dict[str, Any] = {"channel": "gain", "coordinate": "angle", "form": "table", "range": [-1.0, 1.0], "knots": [0.0, 0.1, 0.0]}


def made(*laws: dict[str, Any]) -> Any:
    sheet = yaml.safe_load(FILE.read_text())
    return from_mapping({**copy.deepcopy(sheet), "laws": list(laws)}, FILE)


def test_laws_are_written_and_read_again(tmp_path: Path) -> None:
    vehicle = made(LAW, TABLE)
    save(vehicle, tmp_path / "with_laws.yaml")
    assert load(tmp_path / "with_laws.yaml") == vehicle
    assert len(vehicle.laws) == 2


@pytest.mark.parametrize(
    ("base", "change", "told"),
    [
        (LAW, {"channel": "frction_level"}, ("laws[0].channel", "friction_level")),
        (LAW, {"coordinate": "angel"}, ("laws[0].coordinate", "angle")),
        (LAW, {"form": "stepp"}, ("laws[0].form", "step")),
        (LAW, {"memory": "lagg"}, ("laws[0].memory", "lag")),
        (LAW, {"memory_size": 0.0}, ("laws[0].memory_size", "above 0")),
        (LAW, {"memory": "ring"}, ("laws[0].memory", "ring", "conservative_torque over torque")),
        (LAW, {"channel": "linked_inertia", "coordinate": "rate"}, ("laws[0].channel", "linked_inertia", "angle")),
        (LAW, {"channel": "linked_inertia", "coordinate": "angle", "memory": "lag", "memory_size": 1.0}, ("laws[0].channel", "memory")),
        (LAW, {"memory": "ring", "coordinate": "torque", "memory_size": 1e-200}, ("laws[0].memory_size", "0.001 s")),
        (LAW, {"coordinate": "rubber_temperature"}, ("laws[0].coordinate", "rubber")),
        (LAW, {"range": [1.0, -1.0]}, ("laws[0].range", "ascending")),
        (LAW, {"range": [1.0]}, ("laws[0].range", "ascending")),
        (LAW, {"values": {"before": 0.0, "after": 3.0, "at": 0.2}}, ("laws[0].values", "width")),
        (LAW, {"values": {**LAW["values"], "width": 0.0}}, ("laws[0].values.width", "above 0")),
        (LAW, {"values": {**LAW["values"], "high": 0.0}}, ("laws[0].values.high", "before, after, at, width")),
        (LAW, {"knots": [1.0, 2.0]}, ("laws[0].knots", "no knots")),
        (LAW, {"form": "power", "values": {"value": 1.0, "scale": 1e-3, "exponent": 1e4}}, ("laws[0].values", "finite")),
        # Finite where it was seen, and not half as far again.
        (LAW, {"form": "linear", "values": {"value": 0.0, "slope": 1.5e308}}, ("laws[0].values", "finite", "beyond")),
        (LAW, {"range": [-1e308, 1e308]}, ("laws[0].range", "apart")),
        (LAW, {"range": [0.0, 1e-308]}, ("laws[0].range", "apart")),
        (TABLE, {"knots": [1e308, -1e308, 0.0]}, ("laws[0].knots", "finite")),
        (LAW, {"values": {**LAW["values"], "after": float("nan")}}, ("laws[0].values.after", "finite")),
        (TABLE, {"knots": [1.0]}, ("laws[0].knots", "at least two")),
        (TABLE, {"values": {"value": 1.0}}, ("laws[0].knots", "values")),
        (TABLE, {"knotz": [1.0]}, ("laws[0].knotz", "knots")),
        (TABLE, {"knots": [0.0] * 514}, ("laws[0].knots", "at most 513")),
        (TABLE, {"knots": [-1.0, -5.0]}, ("laws[0].knots", "-1 takes all")),
        (TABLE, {"channel": "friction_level", "knots": [-3.0, -3.0]}, ("laws[0].knots", "-1 takes all")),
        (TABLE, {"channel": "coulomb_friction", "coordinate": "abs_torque", "knots": [0.0, 2.5]}, ("laws[0].knots", "drive itself")),
        (LAW, {"coordinate": "torque", "form": "linear", "values": {"value": 0.0, "slope": -3.0}}, ("laws[0].values", "drive itself")),
        (LAW, {"form": "window", "values": {"outside": 0.0, "inside": 1.0, "start": 0.5, "end": -0.5}},
         ("laws[0].values.end", "at least the start (0.5)")),
        (LAW, {"form": "sinusoid", "values": {"value": 0.0, "sine": 1.0, "cosine": 0.0, "period": 0.02}},
         ("laws[0].values.period", "at least 0.0234", "513 places")),
        (LAW, {"intervals": {"aftr": [2.5, 3.5]}}, ("laws[0].intervals.aftr", "before, after, at, width, memory_size")),
        (LAW, {"intervals": {"after": [2.5]}}, ("laws[0].intervals.after", "two ascending numbers")),
        (LAW, {"heldout_gain": 5.0}, ("laws[0].heldout_gain", "at most 1")),
    ],
)  # fmt: skip
def test_a_mistake_in_a_law_is_refused_with_its_key(base: dict[str, Any], change: dict[str, Any], told: tuple[str, ...]) -> None:
    with pytest.raises(VehicleFileError) as error:
        made({**base, **change})
    for text in (FILE.name, *told):
        assert text in str(error.value)


@pytest.mark.parametrize(
    "change",
    [
        {"intervals": {"memory_size": [1.0, 3.0]}, "heldout_gain": -0.1},
        {"form": "sinusoid", "values": {"value": 0.0, "sine": 1.0, "cosine": 0.0, "period": 2.0 / 70.0}},
        {"coordinate": "torque", "form": "linear", "values": {"value": 0.0, "slope": 3.0}, "memory": "ring"},
        {"channel": "gain", "form": "linear", "values": {"value": 0.0, "slope": 1.5}},
        {"coordinate": "torque", "range": [-10.0, 10.0]},
    ],
)
def test_a_law_as_a_diagnosis_may_write_it_is_read(change: dict[str, Any]) -> None:
    """The finest period that it seeks, what rings (nothing that it adds itself drives it), shares below -1 in a part, a steep step."""
    made({**LAW, "intervals": {}, **change})


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize(
    ("form", "values"),
    [
        ("step", {"before": 0.0, "after": 3.0, "at": 0.2, "width": 1e-308}),
        ("bump", {"value": 0.0, "height": 3.0, "at": 0.2, "width": 1e-308}),
        ("exponential", {"start": 0.0, "end": 3.0, "length": 1e-308}),
    ],
)
def test_widths_of_nothing_make_jumps_without_a_word(form: str, values: dict[str, float]) -> None:
    (law,) = made({**LAW, "form": form, "values": values, "intervals": {}}).laws
    f = np.asarray(law_fields(law)["f"])
    assert set(f) <= {0.0, 3.0}
    assert f[0] == 0.0


def test_too_many_laws_are_refused() -> None:
    with pytest.raises(VehicleFileError, match=r"laws.*at most 16"):
        made(*[LAW] * 17)
