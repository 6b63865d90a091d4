# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What README says of the shipped recordings, and the pictures beside them, against what the commands say today."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("matplotlib")

from PIL import Image
from typer.testing import CliRunner

from lugre_steering.cli import app

ROOT = Path(__file__).resolve().parents[1]
BAGS = ROOT / "bags"
README = (ROOT / "README.md").read_text(encoding="utf-8")


def command(name: str, bags: list[str], out: Path) -> None:
    arguments = [name, *(str(BAGS / bag) for bag in bags), "--vehicle", str(ROOT / "config/test_vehicle.yaml"), "--out", str(out)]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("diagnosis")
    command("diagnose", ["synthetic_hidden_stop_a", "synthetic_hidden_stop_b"], out)
    return out


def assert_alike(told: str, today: str) -> None:
    """The same words; numbers to 1 %, as libraries and processors differ in the last digits."""
    number = r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?"
    assert re.sub(number, "#", told) == re.sub(number, "#", today)
    assert [float(n) for n in re.findall(number, told)] == pytest.approx([float(n) for n in re.findall(number, today)], rel=0.01)


def test_the_sentence_of_the_bundled_pair(diagnosed: Path) -> None:
    told = " ".join(line.removeprefix("> ") for line in README.splitlines() if line.startswith("> "))
    assert_alike(told, json.loads((diagnosed / "diagnosis.json").read_text())["statement"])


def test_the_parameters_of_the_bundled_pair(diagnosed: Path) -> None:
    """The shipped bags hide 0.5 rad, 1.2e5 N m/rad, 1e7 N m/rad^3 and 20 %: README's numbers, and near what is hidden."""
    (effect,) = json.loads((diagnosed / "diagnosis.json").read_text())["effects"]
    found: dict[str, Any] = {name: entry["value"] for name, entry in effect["parameters"].items()}
    told = re.search(r"engagement at (\S+) rad .*?stiffness (\S+) N.*?cubic stiffness\s+(\S+) N.*?loss (\S+) %", README, re.DOTALL)
    assert told is not None
    values = [found["engage_angle"], found["stiffness"], found["cubic_stiffness"], 100.0 * found["loss"]]
    assert [float(text) for text in told.groups()] == pytest.approx(values, rel=0.01)
    assert values == pytest.approx([0.5, 1.2e5, 1e7, 20.0], rel=0.03)


def description(picture: Path) -> str:
    with Image.open(picture) as image:
        return str(image.info["Description"])


def test_the_shipped_pictures_are_those_of_today(diagnosed: Path, tmp_path: Path) -> None:
    today = description(diagnosed / "before_after_synthetic_hidden_stop_a.png")
    assert_alike(description(BAGS / "synthetic_hidden_stop_found.png"), today)
    command("replay", ["synthetic_hidden_stop_a"], tmp_path)
    assert_alike(description(BAGS / "synthetic_hidden_stop_a.png"), description(tmp_path / "synthetic_hidden_stop_a.png"))
