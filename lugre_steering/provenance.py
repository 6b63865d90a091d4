# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How a result came about: version, date, options, and the files it was made from with their hashes (those of ``sha256sum``)."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from lugre_steering.serialise import plain
from lugre_steering.version import __version__

_CHUNK = 1 << 20
EPOCH = "SOURCE_DATE_EPOCH"
"""Environment variable, see reproducible-builds.org."""
MADE = "made"
"""Under this key the metadata of a bag tells it."""


@dataclass(frozen=True)
class Source:
    """A file, or a folder of files, as it was given; ``sha256`` by the names of the files."""

    path: str
    sha256: Mapping[str, str]


@dataclass(frozen=True)
class Provenance:
    """``tool``: program and version, ``date``: UTC, ``options``: all that the result depends on, seed included."""

    tool: str
    command: str
    date: str
    options: Mapping[str, Any]
    vehicle: Source | None
    bags: tuple[Source, ...]

    def lines(self) -> list[str]:
        """The same in lines of text, for comments and pages."""
        options = ", ".join(f"{name} = {value}" for name, value in self.options.items())
        files = [("vehicle file", self.vehicle)] if self.vehicle is not None else []
        files += [("bag", bag) for bag in self.bags]
        return [
            f"{self.tool} {self.command}, {self.date}",
            *([f"options: {options}"] if options else []),
            *(f"{kind} {source.path}: {name} sha256 {digest}" for kind, source in files for name, digest in source.sha256.items()),
        ]


def provenance(
    command: str, options: Mapping[str, Any], vehicle: Path | Source | None = None, bags: Sequence[Path] = ()
) -> Provenance:
    """Of a result that ``command`` makes now from these files; ``vehicle`` as it was when it was read, if that was before."""
    date = _now().isoformat(timespec="seconds")
    sheet = source(vehicle) if isinstance(vehicle, Path) else vehicle
    return Provenance(f"lugre_steering {__version__}", command, date, plain(options), sheet, tuple(map(source, bags)))


def _now() -> datetime:
    """Now, or the time that SOURCE_DATE_EPOCH gives [s since 1970] to those who want the same bytes again."""
    given = os.environ.get(EPOCH, "")
    return datetime.fromtimestamp(int(given), timezone.utc) if given.isdecimal() else datetime.now(timezone.utc)


def source(path: Path) -> Source:
    """A file, or a folder with all files in it; one that cannot be read has no hash, as it was not used either."""
    files = [path] if path.is_file() else sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else []
    return Source(str(path), {file.name: digest for file in files if (digest := _sha256(file)) is not None})


def hashed(file: Path) -> str:
    """A single file with its hash, as one of the options."""
    return f"{file} sha256 {source(file).sha256.get(file.name)}"


def _sha256(file: Path) -> str | None:
    digest = hashlib.sha256()
    try:
        with file.open("rb") as stream:
            while chunk := stream.read(_CHUNK):
                digest.update(chunk)
    except OSError:
        return None
    return digest.hexdigest()
