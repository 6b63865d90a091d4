# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables of others and their import maps to be damaged."""

from __future__ import annotations

import json
import math
from pathlib import Path

from lugre_steering.bench import fuzz_text
from lugre_steering.importing.write import import_table

_MAP = """schema: lugre_steering/import/1
time: {column: t, unit: s}
channels:
  angle/left: {column: q, unit: rad}
  measured_torque: {column: f, unit: N m}
"""


def corpus(folder: Path) -> None:
    """One small table in three forms, with its map."""
    rows = [(0.01 * i, 0.3 * math.sin(0.02 * i), 100.0 * math.cos(0.02 * i)) for i in range(300)]
    (folder / "table.csv").write_text("t,q,f\n" + "".join(f"{t:.3f},{q:.6f},{f:.4f}\n" for t, q, f in rows))
    (folder / "table.json").write_text(json.dumps([dict(zip("tqf", row, strict=True)) for row in rows]))
    (folder / "map.yaml").write_text(_MAP)


def attempt(folder: Path, case: int) -> tuple[str, str]:
    """Import a damaged table, or by a damaged map."""
    table = ("table.csv", "table.json")[case % 2]

    def use(place: Path) -> None:
        import_table(place / table, place / "map.yaml", place / "bag")

    return fuzz_text.tried(folder, case, {"map.yaml": use, table: use})
