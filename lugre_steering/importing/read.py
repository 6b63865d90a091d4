# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A table from a file, by its ending."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from lugre_steering.errors import MapFileError
from lugre_steering.importing.arrays import read_hdf5, read_mat, read_npz, read_parquet
from lugre_steering.importing.map import Csv
from lugre_steering.importing.structured import read_json
from lugre_steering.importing.table import Table
from lugre_steering.importing.text import read_text

Format = tuple[str, Callable[[Path], Table]]

_JSON: Format = ("JSON", read_json)
_PARQUET: Format = ("Parquet", read_parquet)
_HDF5: Format = ("HDF5", read_hdf5)
FORMATS: Mapping[str, Format] = {
    ".mat": ("MATLAB", read_mat), ".npz": ("npz", read_npz), ".parquet": _PARQUET, ".pq": _PARQUET, ".h5": _HDF5,
    ".hdf5": _HDF5, ".json": _JSON, ".jsonl": _JSON, ".ndjson": _JSON,
}  # fmt: skip
"""Ending -> name of the format and its reader; any other ending is CSV."""


def read_table(file: Path, options: Csv | None = None) -> Table:
    """All columns of numbers of a file; ``options`` count for CSV only."""
    if not file.is_file():
        raise MapFileError(f"{file}: {'is no regular file' if file.exists() else 'no such file'}")
    if file.suffix.lower() not in FORMATS:
        try:
            return read_text(file, options or Csv())
        except (OSError, UnicodeError) as error:
            raise MapFileError(f"{file}: cannot be read: {error}") from error
    name, read = FORMATS[file.suffix.lower()]
    try:
        return read(file)
    except MapFileError:
        raise
    except Exception as error:  # damaged files raise many kinds
        raise MapFileError(f"{file}: is not a readable {name} file: {error}") from error
