# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What every result can do: become JSON, a table of pandas, and a view in a notebook."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from lugre_steering.errors import DataError, LugreSteeringError, reason
from lugre_steering.serialise import as_json, plain

if TYPE_CHECKING:
    from pandas import DataFrame

Row = Mapping[str, Any]


class Result:
    """Base of the typed results; subclasses are frozen dataclasses whose fields carry the names of the JSON."""

    @cached_property
    def json(self) -> dict[str, Any]:
        """The result as plain dicts, lists, numbers and text: what the command writes."""
        tree = plain(self)
        assert isinstance(tree, dict)
        return tree

    def to_json(self) -> str:
        """The text of the result file that the command writes."""
        return as_json(self.json)


class HasName(Protocol):
    """What has the name of a bag."""

    @property
    def name(self) -> str: ...


N = TypeVar("N", bound=HasName)


def of_bag(parts: Sequence[N], bag: int | str) -> N:
    """The part of one bag, by number from 0 or by name."""
    names = [part.name for part in parts]
    if bag not in names and bag not in range(len(parts)):
        raise DataError(f"bag: got {bag!r}, expected a number below {len(parts)} or one of {', '.join(names)}")
    return parts[names.index(bag) if isinstance(bag, str) else bag]


def frame(rows: Sequence[Row] | Mapping[str, Any]) -> DataFrame:
    """A pandas table of rows, or of columns by name."""
    try:
        import pandas as pd
    except ImportError as error:
        raise LugreSteeringError("to_frame: needs pandas, which is not installed (pip install pandas)") from error
    return pd.DataFrame(rows)


def angle_column(side: str, unit: str) -> str:
    """The name of a track's angle in tables; of a linear axis its position, in its own unit."""
    return f"angle_{side}_rad" if unit == "rad" else f"position_{side}_{unit}"


def torque_column(name: str, unit: str) -> str:
    """The name of a torque in tables; of a linear axis a force, in its own unit."""
    return f"{name}_Nm" if unit == "N m" else f"{name.replace('torque', 'force')}_{unit.replace(' ', '')}"


@contextmanager
def writing_into(out: str | Path) -> Iterator[Path]:
    """A folder to write results into, made if it is not there; what cannot be written is an error of ours."""
    if not isinstance(out, (str, Path)):
        raise DataError(f"folder: got {out!r}, expected its path")
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield folder
    except OSError as error:
        raise LugreSteeringError(f"{error.filename or folder}: cannot be written: {reason(error)}; expected a writable folder") from error


def html(title: str, text: str, *tables: Sequence[Row]) -> str:
    """A heading, a paragraph and tables, for notebooks; every text is escaped."""
    return f"<h4>{escape(title)}</h4><p>{escape(text)}</p>" + "".join(map(_table, tables))


def _table(rows: Sequence[Row]) -> str:
    if not rows:
        return ""
    names = "".join(f"<th>{escape(str(name))}</th>" for name in rows[0])
    body = "".join(f"<tr>{''.join(f'<td>{_cell(value)}</td>' for value in row.values())}</tr>" for row in rows)
    return f"<table><thead><tr>{names}</tr></thead><tbody>{body}</tbody></table>"


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.5g}" if isinstance(value, float) else escape(str(value))
