# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Files of physics of one's own to be damaged (YAML; Python files are run as they are), one with a law that was kept."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from lugre_steering.bench import fuzz_text
from lugre_steering.chain.compose import check
from lugre_steering.effects.own import add_law, read_effects

_FILES = ["own_physics/chain_ripple.yaml", "own_physics/thixotropic_grease.yaml"]
_LAW = "kept.yaml"
_KEPT: dict[str, Any] = {"channel": "gain", "coordinate": "angle", "form": "table", "range": [-1.0, 1.0], "knots": [0.0, 0.1, 0.0]}


def corpus(folder: Path) -> None:
    """The shipped examples."""
    (folder / "own_physics").mkdir()
    fuzz_text.copied(_FILES, folder)
    add_law(folder / _LAW, "kept_drag", "a drag", "invented", _KEPT)


def _use(name: str, place: Path) -> None:
    for effect in read_effects(place / name)[0]:
        check(effect)


def attempt(folder: Path, case: int) -> tuple[str, str]:
    """Read damaged effects and check their wiring."""
    return fuzz_text.tried(folder, case, {name: partial(_use, name) for name in [*_FILES, _LAW]})
