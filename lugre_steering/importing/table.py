# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers by name, from whatever file. A missing number is NaN."""

from __future__ import annotations

import difflib
import math
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.errors import MapFileError
from lugre_steering.importing.words import tells, unit_in
from lugre_steering.recording import Array

MAX_NUMBERS = 100_000_000
"""Numbers in one table (0.8 GB): what declares or unpacks to more is refused before it fills the memory."""
FEW_NUMBERS, PACKED = 8_000_000, 50
"""So many may come of any file; of more, a file holds the share of ``PACKED``, as no recording can be packed as small."""
MAX_COLUMNS = 10_000
MAX_DEPTH = 64
"""Nested structures."""
UNIT_KEYS = ("unit", "units", "einheit")
"""What the attribute or field is called that states a unit."""


@dataclass(frozen=True)
class Table:
    """Columns (n,) and single numbers of one file; columns may have different lengths.

    ``unusable``: columns that hold no numbers, and why. ``titles``: what the file says of a column beside its name: other header
    rows, the unit of its type. ``left_out``: what was not read, and how often.
    """

    file: Path
    columns: Mapping[str, Array]
    scalars: Mapping[str, float] = field(default_factory=dict)
    unusable: Mapping[str, str] = field(default_factory=dict)
    titles: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    left_out: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def row_of_units(self) -> int | None:
        """Which of the titles is a unit for most of the columns that have any."""
        known = Counter(place for titles in self.titles.values() for place, title in enumerate(titles) if unit_in(title, True))
        place, count = known.most_common(1)[0] if known else (0, 0)
        return place if 2 * count > len(self.titles) else None

    def column(self, name: str) -> Array:
        if name not in self.columns:
            raise self._missing(name, self.columns, "column")
        return self.columns[name]

    def scalar(self, name: str) -> float:
        if name not in self.scalars:
            raise self._missing(name, self.scalars, "single number")
        return self.scalars[name]

    def _missing(self, name: str, known: Mapping[str, Any], what: str) -> MapFileError:
        if name in self.unusable:
            return MapFileError(f"{self.file}: {self.unusable[name]}")
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
        hint = f"did you mean '{near[0]}'?" if near else f"there are: {listed(known)}"
        if not near and self.unusable:
            hint += f"; without numbers: {listed(self.unusable)} ({next(iter(self.unusable.values()))})"
        joined = [other for other in (*self.columns, *self.unusable) if name in re.split(r"\s*[,;|\t]\s*", other)]
        return MapFileError(f"{self.file}: no {what} '{name}'; {hint}{'; is csv.delimiter right?' if joined else ''}")


def listed(names: Mapping[str, Any]) -> str:
    """Names for a message: all of a few, some of many."""
    shown = ", ".join(list(names)[:30])
    return f"{shown} and {len(names) - 30} more" if len(names) > 30 else shown or "none"


def most_numbers(file: Path) -> int:
    """Numbers that a file may hold or unpack to."""
    return min(MAX_NUMBERS, max(FEW_NUMBERS, PACKED * file.stat().st_size // 8))


class Gathering:
    """Collects the numbers of nested data: structures by dots, the columns of a matrix as name[1], name[2], ..., as
    MATLAB counts. The longer side of a matrix is time."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.columns: dict[str, Array] = {}
        self.scalars: dict[str, float] = {}
        self.unusable: dict[str, str] = {}
        self.titles: dict[str, tuple[str, ...]] = {}
        self._count, self._most = 0, most_numbers(file)

    def reserve(self, name: str, count: int) -> None:
        """Refuse what does not fit, before it is read."""
        self._count += count
        if self._count > self._most:
            raise MapFileError(
                f"{self.file}: '{name}': brings the file to {self._count} numbers, expected at most {self._most} in one of this size"
            )

    def refuse(self, name: str, what: str) -> None:
        self.unusable[name] = f"'{name}': holds {what}, expected numbers"

    def add(self, name: str, value: Any) -> None:
        """Numbers of an array of any kind; anything else is kept as unusable."""
        array = np.asarray(value)
        if array.dtype.names:
            for key in array.dtype.names:
                self.add(f"{name}.{key}" if name else key, array[key])
        elif array.dtype.kind in "mM":
            self._add_times(name, array)
        elif array.dtype.kind not in "iufb":
            self.refuse(name, "complex numbers" if array.dtype.kind == "c" else "no plain numbers")
        elif array.size == 1:
            self.scalars[name] = float(array.reshape(-1)[0])
        elif array.ndim > 2 or array.size == 0:
            self.refuse(name, f"an array of size {' x '.join(map(str, array.shape))}")
        elif array.ndim == 1 or 1 in array.shape:
            self.columns[name] = array.reshape(-1).astype(np.float64, copy=False)
        else:
            along = array if array.shape[0] >= array.shape[1] else array.T
            self.columns |= {f"{name}[{i + 1}]": along[:, i].astype(np.float64) for i in range(along.shape[1])}
        if len(self.columns) + len(self.unusable) > MAX_COLUMNS:
            raise MapFileError(f"{self.file}: holds more than {MAX_COLUMNS} columns")

    def _add_times(self, name: str, array: Any) -> None:
        """Dates and durations of NumPy, as ns."""
        nanoseconds = array.astype(f"{array.dtype.kind}8[ns]")
        self.add(name, np.where(np.isnat(nanoseconds), np.nan, nanoseconds.astype(np.int64).astype(np.float64)))
        self.titles[name] = ("ns",)

    def state(self, name: str, texts: Mapping[str, Any]) -> None:
        """Note the unit that attributes, or fields beside, state of what was gathered last, all under ``name``, but for its times."""
        key = next((key for key, text in texts.items() if key.lower() in UNIT_KEYS and isinstance(text, str)), None)
        if key is None:
            return
        self.unusable.pop(f"{name}.{key}", None)
        unit = texts[key].partition(" since ")[0]  # as netCDF has it: seconds since 1970-01-01
        for column in reversed(self.columns):
            if column != name and not column.startswith((f"{name}.", f"{name}[")):
                return
            if tells(name, "time") or not tells(column, "time"):
                self.titles.setdefault(column, (unit,))

    def table(self, titles: Mapping[str, tuple[str, ...]] | None = None) -> Table:
        return Table(self.file, self.columns, self.scalars, self.unusable, {**self.titles, **(titles or {})})


def size_of(shape: tuple[int, ...]) -> int:
    """Numbers in an array of this shape, without overflow."""
    return math.prod(int(n) for n in shape)
