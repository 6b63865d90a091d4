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
from pathlib import Path

import pytest

from lugre_steering.effects.registry import CATALOGUE

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "lugre_steering"
MODULES = {
    ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): file for file in sorted(PACKAGE.rglob("*.py"))
}


def imports(file: Path) -> Iterator[str]:
    """Modules of the package that a file imports, at its top or within functions; those for the type checker too."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(PACKAGE.name):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in MODULES else str(node.module)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)


@cache
def arrows(folders: bool) -> dict[str, set[str]]:
    """Who imports whom; the front door of the package offers what lies behind it and is imported by nobody."""
    found: dict[str, set[str]] = defaultdict(set)
    for module, file in MODULES.items():
        if module == PACKAGE.name:
            continue
        for other in imports(file):
            assert other != PACKAGE.name, f"{module}: imports the package itself"
            a, b = (name.split(".")[1] if folders else name for name in (module, other))
            if a != b:
                found[a].add(b)
    return found


@pytest.mark.parametrize("folders", [True, False], ids=["folders", "files"])
def test_arrows_point_one_way(folders: bool) -> None:
    try:
        tuple(TopologicalSorter(arrows(folders)).static_order())
    except CycleError as error:
        pytest.fail(f"in a circle: {' <- '.join(error.args[1])}")


def test_the_chain_knows_no_vehicle_file_and_the_report_no_program() -> None:
    assert arrows(folders=True)["chain"] <= {"errors", "recording"}
    assert arrows(folders=True)["report"] <= {"errors", "files", "provenance", "recording", "units", "vehicle"}


@cache
def strings() -> dict[Path, set[str]]:
    """Every string in the code of each file of the package."""
    trees = {file: ast.parse(file.read_text(encoding="utf-8")) for file in MODULES.values()}
    return {
        file.relative_to(PACKAGE): {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
        for file, tree in trees.items()
    }


@pytest.mark.parametrize("effect", CATALOGUE)
def test_an_effect_is_named_in_its_own_file_only(effect: str) -> None:
    """No string outside is its id, one of its fields or it with values; the proof's simulators hide effects by name on purpose."""
    own = re.compile(rf"{effect}(_[a-z0-9_]+)?(:.*)?")
    named = {file for file, texts in strings().items() if any(map(own.fullmatch, texts))}
    assert {file for file in named if file.parts[0] not in ("proof", "effects")} == set()
    assert CATALOGUE[effect].id == effect
    assert (PACKAGE / "effects" / f"{effect}.py").exists()
