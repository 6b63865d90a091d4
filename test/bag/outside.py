# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Where data lie that are no part of the project; tests that need them are skipped without."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def outside(name: str) -> Path:
    """``name`` in any folder beside the project or beside one that it lies in; a place where nothing is, if there is none."""
    return next((found for parent in ROOT.parents for found in sorted(parent.glob(f"*/{name}"))), ROOT / "outside" / name)
