# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Where things live: imports go one way between folders and files, and one effect lives in one file."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import takewhile
from pathlib import Path

import pytest

from lugre_steering.effects.registry import CATALOGUE

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "lugre_steering"
MODULES = {
    ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): file for file in sorted(PACKAGE.rglob("*.py"))
}
FOLDERS = sorted({".".join(file.relative_to(ROOT).parent.parts) for file in MODULES.values()})


def imports(file: Path) -> Iterator[str]:
    """Modules of the package that a file imports, at its top or within functions; those for the type checker too."""
    for node in ast.walk(tree(file)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(PACKAGE.name):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in MODULES else str(node.module)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def imported() -> dict[str, set[str]]:
    """Who imports whom, by module, but for the front door of the package: it offers what lies behind it."""
    return {module: set(imports(file)) - {module} for module, file in MODULES.items() if module != PACKAGE.name}


@cache
def neighbours() -> dict[str, dict[str, set[str]]]:
    """For each folder who imports whom of what lies in it: files, and folders as one with all that is in them."""
    found: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for module, others in imported().items():
        for other in others:
            shared = [a for a, b in takewhile(lambda pair: pair[0] == pair[1], zip(module.split("."), other.split("."), strict=False))]
            rest = module.split(".")[len(shared) :], other.split(".")[len(shared) :]
            if all(rest):  # otherwise one is the front door of a folder that the other lies in
                found[".".join(shared)][rest[0][0]].add(rest[1][0])
    return found


@pytest.mark.parametrize("where", ["files", *FOLDERS])
def test_arrows_point_one_way(where: str) -> None:
    try:
        tuple(TopologicalSorter(imported() if where == "files" else neighbours()[where]).static_order())
    except CycleError as error:
        pytest.fail(f"{where}: in a circle: {' <- '.join(error.args[1])}")


def test_nothing_imports_the_front_door() -> None:
    assert [module for module, others in imported().items() if PACKAGE.name in others] == []


def test_rooms_are_those_of_the_table_and_data_flow_down_it() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("## Rooms")[2].partition("## ")[0]
    rows = [re.findall(r"`(\w+)/`", line.split("|")[1]) for line in text.splitlines() if line.startswith("| `")]
    row = {room: number for number, rooms in enumerate(rows) for room in rooms}
    assert sorted(row) == sorted(folder.parent.name for folder in PACKAGE.glob("*/__init__.py"))
    against = [f"{a} -> {b}" for a, others in neighbours()[PACKAGE.name].items() for b in others if row.get(a, 99) < row.get(b, -1)]
    assert against == []


def test_live_is_ros_only() -> None:
    live = {module: file for module, file in MODULES.items() if module.startswith(f"{PACKAGE.name}.live.")}
    without = [module for module, file in live.items() if not re.search(r"rclpy|_msgs", file.read_text(encoding="utf-8"))]
    assert without == []


def test_the_chain_knows_no_vehicle_file_and_the_report_no_program() -> None:
    arrows = neighbours()[PACKAGE.name]
    assert arrows["chain"] <= {"errors", "recording"}
    assert arrows["report"] <= {"counted", "errors", "files", "provenance", "recording", "units", "vehicle"}


@cache
def strings() -> dict[Path, set[str]]:
    """Every string in the code of each file of the package."""
    return {
        file.relative_to(PACKAGE): {n.value for n in ast.walk(tree(file)) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
        for file in MODULES.values()
    }


@pytest.mark.parametrize("effect", CATALOGUE)
def test_an_effect_is_named_in_its_own_file_only(effect: str) -> None:
    """No string outside is its id, one of its fields or it with values; the proof's simulators hide effects by name on purpose."""
    own = re.compile(rf"{effect}(_[a-z0-9_]+)?(:.*)?")
    named = {file for file, texts in strings().items() if any(text.startswith(effect) and own.fullmatch(text) for text in texts)}
    assert {file for file in named if file.parts[0] not in ("proof", "effects")} == set()
    assert CATALOGUE[effect].id == effect
    assert (PACKAGE / "effects" / f"{effect}.py").exists()
