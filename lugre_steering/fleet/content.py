# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a result hangs on: the bytes of the bag, the vehicle, the options, the program."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from lugre_steering.bag.reader import SUFFIXES
from lugre_steering.effects.registry import ORIGINS
from lugre_steering.version import __version__

_PACKAGE = Path(__file__).resolve().parents[1]
_SHOWN = ("bench", "fleet", "live", "report", "config")
"""Rooms that only show or arrange what others compute, and examples, which are beside the package until it is installed."""
_STEP = 1 << 20

State = list[list[Any]]
"""Name, size and time of change [ns] of each file of a bag."""


def files_of(bag: Path) -> list[Path]:
    """The files whose bytes are the recording."""
    if not bag.is_dir():
        return [bag]
    named = (file for file in bag.iterdir() if file.name.endswith(SUFFIXES) or file.name == "metadata.yaml")
    return sorted(file for file in named if file.is_file())


def state(bag: Path) -> State:
    """How its files stand now: while this stays, so do their bytes."""
    found = []
    for file in files_of(bag):
        status = file.stat()
        found.append([file.name, status.st_size, status.st_mtime_ns])
    return found


def digests_of(bag: Path) -> dict[str, str]:
    """SHA-256 of each file of a bag, by name."""
    found = {}
    for file in files_of(bag):
        part = hashlib.sha256()
        with file.open("rb") as stream:
            while piece := stream.read(_STEP):
                part.update(piece)
        found[file.name] = part.hexdigest()
    return found


def digest_of(digests: Mapping[str, str]) -> str:
    """One SHA-256 of those of all files of a bag, wherever it lies and whatever the folder is called."""
    return hashlib.sha256(b"".join(bytes.fromhex(digest) for digest in digests.values())).hexdigest()


def foreign() -> dict[str, str]:
    """SHA-256 of the users' physics that this process knows, by name."""
    return {name: origin.sha256 for name, origin in ORIGINS.items()}


def key_of(bag_sha256: str | Sequence[str], vehicle_sha256: str, options: Mapping[str, Any]) -> str:
    """The name under which results of these inputs (one bag, or several together) are kept, those of every version."""
    inputs = [bag_sha256, vehicle_sha256, dict(options), foreign()]
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()[:40]


@lru_cache(maxsize=1)
def code_version() -> str:
    """The version and, as that stands still between releases, a hash of the code that computes."""
    code = hashlib.sha256()
    for file in sorted(_PACKAGE.rglob("*.py")):
        if file.relative_to(_PACKAGE).parts[0] not in _SHOWN:
            code.update(file.read_bytes())
    return f"{__version__}+{code.hexdigest()[:10]}"
