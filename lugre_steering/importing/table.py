# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables of numbers by column name: CSV, Parquet, MATLAB. A missing cell is NaN; any other text is refused."""

from __future__ import annotations

import csv
import difflib
import importlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from lugre_steering.errors import MapFileError
from lugre_steering.importing.map import Csv
from lugre_steering.recording import Array

N = TypeVar("N", Array, float)

_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)(e[-+]?\d+)?|[-+]?inf(inity)?", re.IGNORECASE | re.ASCII)
"""A number as loggers write it; float() would take the underscores of Python too."""
_MISSING = ("", "nan", "-nan", "na", "n/a", "null", "none")


@dataclass(frozen=True)
class Table:
    """Columns (n,) and single numbers of one file; columns may have different lengths in a MATLAB file."""

    file: Path
    columns: Mapping[str, Array]
    scalars: Mapping[str, float]

    def column(self, name: str) -> Array:
        return self._get(self.columns, name, "column")

    def scalar(self, name: str) -> float:
        return self._get(self.scalars, name, "single number")

    def _get(self, table: Mapping[str, N], name: str, what: str) -> N:
        if name not in table:
            near = difflib.get_close_matches(name, table, n=1, cutoff=0.6)
            hint = f"did you mean '{near[0]}'?" if near else f"there are: {', '.join(table) or 'none'}"
            raise MapFileError(f"{self.file}: no {what} '{name}'; {hint}")
        return table[name]


def read_table(file: Path, options: Csv | None = None) -> Table:
    """Read a table by its ending: .mat, .parquet (or .pq), anything else as CSV."""
    if not file.is_file():
        raise MapFileError(f"{file}: no such file")
    kind = file.suffix.lower()
    try:
        if kind == ".mat":
            return _read_mat(file)
        if kind in (".parquet", ".pq"):
            return _read_parquet(file)
        return _read_csv(file, options or Csv())
    except (OSError, UnicodeDecodeError) as error:
        raise MapFileError(f"{file}: cannot be read: {error}") from error


# ------------------------------------------------------------------ CSV


def _read_csv(file: Path, options: Csv) -> Table:
    with file.open(encoding="utf-8-sig", newline="") as stream:
        rows = csv.reader(stream, delimiter=options.delimiter, skipinitialspace=True)
        numbered = ((rows.line_num, row) for row in rows)
        try:
            kept = [
                (line, row) for line, row in numbered
                if line > options.skip_rows and any(row) and not row[0].startswith(options.comment)
            ]  # fmt: skip
        except csv.Error as error:
            raise MapFileError(f"{file}: line {rows.line_num}: is not CSV: {error}") from error
    if len(kept) < 2:
        raise MapFileError(f"{file}: has {len(kept)} rows, expected a row of column names and rows of numbers")
    names = [name.strip() for name in kept[0][1]]
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise MapFileError(f"{file}: line {kept[0][0]}: column '{twice}' occurs twice; expected distinct column names")
    for line, row in kept[1:]:
        if len(row) != len(names):
            raise MapFileError(f"{file}: line {line}: has {len(row)} cells, expected {len(names)} as in the header")
    lines = [line for line, _ in kept[1:]]
    columns = zip(*(row for _, row in kept[1:]), strict=True)
    return Table(file, _LazyColumns(file, options.decimal, lines, dict(zip(names, columns, strict=True))), {})


class _LazyColumns(Mapping[str, Array]):
    """Columns of text turned into numbers when asked for: a column of remarks that nobody asks for does no harm."""

    def __init__(self, file: Path, decimal: str, lines: Sequence[int], cells: Mapping[str, Sequence[str]]) -> None:
        self._file, self._decimal, self._lines, self._cells = file, decimal, lines, cells
        self._read: dict[str, Array] = {}

    def __contains__(self, name: object) -> bool:
        return name in self._cells

    def __iter__(self) -> Any:
        return iter(self._cells)

    def __len__(self) -> int:
        return len(self._cells)

    def __getitem__(self, name: str) -> Array:
        if name not in self._read:
            self._read[name] = self._numbers(name)
        return self._read[name]

    def _numbers(self, name: str) -> Array:
        cells = self._cells[name]
        values = np.empty(len(cells))
        for i, cell in enumerate(cells):
            text = cell.strip()
            # With another decimal character a point groups thousands, or the map is wrong: no number either way.
            number = text if self._decimal == "." else text.replace(".", "?").replace(self._decimal, ".")
            if _NUMBER.fullmatch(number):
                values[i] = float(number)
            elif text.lower() in _MISSING:
                values[i] = np.nan
            else:
                where, decimal = f"{self._file}: line {self._lines[i]}, column '{name}'", f"decimal '{self._decimal}'"
                raise MapFileError(f"{where}: got '{cell}', expected a number ({decimal}) or an empty cell")
        return values


# -------------------------------------------------------------- Parquet


def _read_parquet(file: Path) -> Table:
    try:
        parquet: Any = importlib.import_module("pyarrow.parquet")
    except ImportError:
        raise MapFileError(f"{file}: needs pyarrow to be read (pip install 'lugre_steering[import]')") from None
    try:
        table = parquet.read_table(file)
    except Exception as error:  # damaged files raise many kinds
        raise MapFileError(f"{file}: is not a readable Parquet file: {error}") from error
    columns = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        array = column.to_numpy()
        if array.dtype.kind in "iufb":
            columns[name] = array.astype(np.float64)
    return Table(file, columns, {})


# --------------------------------------------------------------- MATLAB


def _read_mat(file: Path) -> Table:
    from scipy.io import loadmat

    try:
        content = loadmat(file, simplify_cells=True)
    except NotImplementedError:
        raise MapFileError(f"{file}: is a MATLAB 7.3 file; expected an older format (in MATLAB: save -v7)") from None
    except Exception as error:  # damaged files raise many kinds
        raise MapFileError(f"{file}: is not a readable MATLAB file: {error}") from error
    columns: dict[str, Array] = {}
    scalars: dict[str, float] = {}
    _collect("", {k: v for k, v in content.items() if not k.startswith("__")}, columns, scalars)
    return Table(file, columns, scalars)


def _collect(name: str, value: Any, columns: dict[str, Array], scalars: dict[str, float]) -> None:
    """Numbers of a variable: structures by dots, the columns of a matrix as name[1], name[2], ... as MATLAB counts."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            _collect(f"{name}.{key}" if name else key, inner, columns, scalars)
        return
    if isinstance(value, list):  # a cell array of several kinds
        return
    array = np.asarray(value)
    if array.dtype.kind not in "iufb":
        return
    if array.ndim == 0 or array.size == 1:
        scalars[name] = float(array.reshape(-1)[0])
    elif array.ndim == 1 or (array.ndim == 2 and 1 in array.shape):
        columns[name] = array.reshape(-1).astype(np.float64)
    elif array.ndim == 2:
        columns |= {f"{name}[{i + 1}]": array[:, i].astype(np.float64) for i in range(array.shape[1])}
