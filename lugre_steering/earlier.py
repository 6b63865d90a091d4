# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What lies in an output folder before a command writes there: its own earlier result, or files of others."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lugre_steering.errors import DataError
from lugre_steering.serialise import as_json


def earlier_result(
    out: Path, record: str, schema: str, others: Sequence[str], vehicle_file: Path | None = None
) -> dict[str, Any] | None:
    """The record of an earlier run in ``out``, if there is one, so that its files may be replaced.

    ``DataError`` if the ``record`` there is of another ``schema``, if one of the ``others`` to be written exists without a
    record, or if writing would replace the vehicle file that is read.
    """
    for name in (record, *others):
        if vehicle_file is not None and (out / name).resolve() == vehicle_file.resolve():
            raise DataError(f"{vehicle_file}: would be replaced by the result; choose another --out")
    file = out / record
    if file.exists():
        try:
            old = json.loads(file.read_bytes())
            if old["schema"] == schema:
                return dict(old)
        except (OSError, ValueError, KeyError, TypeError):
            pass
        raise not_ours(file, record)
    for name in others:
        if (out / name).exists():
            raise not_ours(out / name, record)
    return None


def write_record(record: Mapping[str, Any], file: Path) -> None:
    """As JSON, whole or not at all: half a record would pass for a file of others."""
    part = file.with_name(f".{file.name}.part")
    part.write_text(as_json(record) + "\n", encoding="utf-8")
    part.replace(file)


def not_ours(file: Path, record: str) -> DataError:
    """The refusal of a file that belongs to no ``record`` of ours."""
    return DataError(f"{file}: exists and is not part of an earlier result ({record}); choose another --out")
