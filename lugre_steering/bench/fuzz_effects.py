# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Files of physics of one's own to be damaged (YAML; Python files are run as they are)."""

from __future__ import annotations

from pathlib import Path

from lugre_steering.bench import fuzz_text
from lugre_steering.chain.compose import check
from lugre_steering.effects.own import read_effects

_FILES = ["own_physics/chain_ripple.yaml", "own_physics/thixotropic_grease.yaml"]


def corpus(folder: Path) -> None:
    """The shipped examples."""
    (folder / "own_physics").mkdir()
    fuzz_text.copied(_FILES, folder)


def attempt(folder: Path, case: int) -> tuple[str, str]:
    """Read damaged effects and check their wiring."""

    def use(place: Path) -> None:
        for name in _FILES:
            for effect in read_effects(place / name)[0]:
                check(effect)

    return fuzz_text.tried(folder, case, _FILES, use)
