# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Parameter files of the node to be damaged."""

from __future__ import annotations

from pathlib import Path

from lugre_steering.bench import fuzz_text
from lugre_steering.estimator.node_parameters import read_options

_FILE = "estimator_parameters.yaml"


def corpus(folder: Path) -> None:
    """The shipped parameter file."""
    fuzz_text.copied([_FILE], folder)


def attempt(folder: Path, case: int) -> tuple[str, str]:
    """Read the options of a damaged parameter file."""
    return fuzz_text.tried(folder, case, [_FILE], lambda place: read_options(place / _FILE))
