# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Results of earlier runs, which a new one may replace; nothing else is touched."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from lugre_steering import yaml_text
from lugre_steering.bag.find import REPLAYED
from lugre_steering.bag.reader import bag_name, must_exist
from lugre_steering.errors import BagError
from lugre_steering.files import is_ours, read_record, read_text
from lugre_steering.recording import unused_name
from lugre_steering.replay.result import RECORD, SCHEMA


def names_for(bags: Sequence[Path], out: Path) -> list[str]:
    """A name for the result of each bag; refuses to touch an input or anything that is not an earlier result."""
    names: list[str] = []
    for path in bags:
        must_exist(path)
        names.append(unused_name(bag_name(path), names))
    for name in names:
        result = (out / name).resolve()
        for path in bags:
            source = path.resolve()
            if source == result or source in result.parents or result in source.parents:
                raise BagError(f"{path}: the result {out / name} would touch this bag; choose another --out")
        refuse_foreign(out / name)
        for beside in (out / f"{name}.png", out / f"{name}.html"):
            if beside.exists() and not is_ours(beside):
                raise _not_ours(beside)
    if (out / RECORD).exists() and read_record(out / RECORD, SCHEMA) is None:
        raise _not_ours(out / RECORD)
    return names


def _not_ours(path: Path) -> BagError:
    return BagError(f"{path}: exists and is not an earlier result of replay; choose another --out")


def refuse_foreign(folder: Path) -> None:
    """``BagError`` unless nothing is there, or a bag written here and not one file beside it."""
    if not os.path.lexists(folder):
        return
    try:
        content: Any = yaml_text.parse(read_text(folder / "metadata.yaml", yaml_text.LONGEST))
        described = content["rosbag2_bagfile_information"]
        own = {"metadata.yaml", *described["relative_file_paths"]}
        ours = REPLAYED.items() <= described["custom_data"].items()
    except (OSError, ValueError, yaml.YAMLError, LookupError, TypeError, AttributeError):
        ours = False
    if not ours or folder.is_symlink():
        raise _not_ours(folder)
    for path in folder.iterdir():
        if path.name not in own:
            raise _not_ours(path)
