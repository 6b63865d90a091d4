# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings among what a user names: bags, folders of bags, patterns; and what is left out, with the reason."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from glob import glob, has_magic
from pathlib import Path
from typing import Any

import yaml

from lugre_steering import yaml_text
from lugre_steering.bag.reader import SUFFIXES
from lugre_steering.errors import BagError
from lugre_steering.files import read_text
from lugre_steering.recording import BagFinding

REPLAYED = {"lugre_steering": "replay"}
"""In metadata.yaml of every bag that a replay wrote: a result, no measurement of its own."""
SKIPPED = "skipped_recording"
"""How what was left out is called among the findings about the data."""
_METADATA = "metadata.yaml"


@dataclass(frozen=True)
class Skipped:
    """What was named or found and is not used: its path, and why."""

    bag: str
    reason: str

    def finding(self) -> BagFinding:
        """The same among the findings about the data."""
        return BagFinding(SKIPPED, "", self.bag, (), self.reason)


@dataclass(frozen=True)
class FoundBag:
    """Paths of recordings, each once, and what was left out."""

    bags: tuple[Path, ...]
    skipped: tuple[Skipped, ...] = ()


def find(given: Sequence[Path], out: Path | None = None) -> FoundBag:
    """The recordings that ``given`` means: bags as they are, folders with all that is in them, patterns (``**`` too).

    Left out: results of a replay that lie in a folder, and whatever is in ``out``. ``BagError`` for what is not there, for a
    folder or pattern without a recording, and for an ``out`` in which results would lie among recordings.
    """
    bags: list[Path] = []
    skipped: list[Skipped] = []
    for path in given:
        if not os.path.lexists(path) and has_magic(str(path)):
            matches = [Path(name) for name in sorted(glob(str(path), recursive=True))]
            inside = [bag for match in matches if is_recording(match) or match.is_dir() for bag in _inside(match, out)]
        elif is_folder_of_recordings(path):
            if out is not None and path.resolve() == out.resolve():
                raise _mixed(out, "the folder of the recordings")
            inside = list(_inside(path, out))
        else:
            bags.append(path)
            continue
        results = [bag for bag in inside if is_replayed(bag)]
        skipped += [Skipped(str(bag), "is the result of a replay") for bag in results]
        recordings = [bag for bag in inside if bag not in results]
        if not recordings:
            raise BagError(f"{path}: no recording in it; expected rosbag2 folders or files ({', '.join(SUFFIXES[:2])})")
        bags += recordings
    bags = list({bag.resolve(): bag for bag in reversed(bags)}.values())[::-1]
    if out is not None:
        _refuse_among(bags, out)
    return FoundBag(tuple(bags), tuple(skipped))


def is_recording(path: Path) -> bool:
    """Whether it looks like a bag, by names alone: a file of one, or a folder that rosbag2 made."""
    if path.is_file():
        return path.name.endswith(SUFFIXES)
    return path.is_dir() and ((path / _METADATA).is_file() or (_is_split(_files(path)) and not _folders(path)))


def is_folder_of_recordings(path: Path) -> bool:
    """Whether it is a folder that is no recording itself."""
    return path.is_dir() and not is_recording(path) and any(_inside(path, None))


def is_replayed(bag: Path) -> bool:
    """Whether a replay wrote this folder."""
    return REPLAYED.items() <= (custom_data(bag) or {}).items()


def custom_data(bag: Path) -> Mapping[str, Any] | None:
    """What its writer has noted in the metadata of a bag; None where there is nothing to read."""
    try:
        content: Any = yaml_text.parse(read_text(bag / _METADATA, yaml_text.LONGEST))
        noted = content["rosbag2_bagfile_information"]["custom_data"]
    except (OSError, ValueError, yaml.YAMLError, LookupError, TypeError):
        return None
    return noted if isinstance(noted, Mapping) else None


def told_apart(paths: Sequence[str]) -> list[str]:
    """Each path by as many of its last parts as tell it from all others: 'run_1', but 'monday/run_1' beside 'tuesday/run_1'."""
    parts = [Path(path).parts for path in paths]
    return ["/".join(own[-_telling(own, [other for other in parts if other != own]) :]) for own in parts]


def _telling(own: tuple[str, ...], others: Sequence[tuple[str, ...]]) -> int:
    return next((count for count in range(1, len(own)) if all(other[-count:] != own[-count:] for other in others)), len(own))


def _inside(path: Path, out: Path | None) -> Iterator[Path]:
    """Every recording in a folder, however deep, in order of names; hidden folders and links to folders are not entered."""
    if is_recording(path):
        yield path
        return
    if out is not None and out.exists() and path.samefile(out):
        return
    yield from _files(path)
    for folder in _folders(path):
        yield from _inside(folder, out)


def _folders(folder: Path) -> list[Path]:
    entries = (entry for entry in folder.iterdir() if entry.is_dir() and not entry.is_symlink())
    return sorted(entry for entry in entries if not entry.name.startswith("."))


def _files(folder: Path) -> list[Path]:
    return sorted(file for file in folder.iterdir() if file.is_file() and file.name.endswith(SUFFIXES))


def _is_split(files: Sequence[Path]) -> bool:
    """Whether these are the parts of one recording, of which rosbag2 numbers all names: run_0.mcap, run_1.mcap."""
    return bool(files) and len({re.sub(r"(_\d+)?\.(mcap|db3)(\.zstd?)?$", "", file.name) for file in files}) == 1


def _refuse_among(bags: Sequence[Path], out: Path) -> None:
    """Results between recordings are hard to find again, and to tell apart."""
    for bag in bags:
        if bag.exists() and out.resolve() in (bag.resolve(), bag.resolve().parent):
            raise _mixed(out, f"where the recording {bag.name} lies")


def _mixed(out: Path, what: str) -> BagError:
    told = "results would be mixed with recordings; choose another --out, such as"
    return BagError(f"--out {out}: is {what}, and {told} {out}_results")
