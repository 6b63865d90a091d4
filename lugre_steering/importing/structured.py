# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""JSON, as a document or one object per line: lists of records, or lists by name, at any depth."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.errors import MapFileError
from lugre_steering.importing.stamps import is_stamp
from lugre_steering.importing.table import MAX_DEPTH, Gathering, Table
from lugre_steering.importing.text import number
from lugre_steering.recording import Array

MAX_MEMORY = 1_000_000_000
_COST = {b"{": 256, b"[": 96, b",": 48}
"""Bytes that an object, a list and a value take in Python and as numbers, at most, told from the text."""
_COPIES = 3
"""Of the text itself: as bytes, as characters, as texts within."""


def read_json(file: Path) -> Table:
    """All numbers of a JSON file by their path."""
    size = file.stat().st_size
    raw = file.read_bytes() if size < MAX_MEMORY else b""
    memory = _COPIES * size + sum(cost * raw.count(sign) for sign, cost in _COST.items())
    if memory > MAX_MEMORY:
        raise MapFileError(f"{file}: would take {memory / 1e9:.1f} GB as JSON, expected at most 1 GB; split it, or write CSV or Parquet")
    try:
        content, cut = _parsed(raw.decode("utf-8-sig").rstrip("\0"))
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise MapFileError(f"{file}: is not readable JSON: {reason}") from error
    found = Gathering(file)
    _collect(found, "", content, 0)
    return replace(found.table(), left_out={"records that the end of the file cuts off": cut} if cut else {})


def _parsed(text: str) -> tuple[Any, int]:
    """What a file holds, and how many records at its end are cut off, as a recorder does that loses power."""
    try:
        return json.loads(text), 0
    except json.JSONDecodeError as error:
        if not error.msg.startswith("Extra data"):
            raise
    *lines, last = re.split(r"\r\n|\r|\n", text)
    records = [_record(line, row) for line, row in enumerate(lines, 1) if row.strip()]
    try:
        return records + ([json.loads(last)] if last.strip() else []), 0
    except json.JSONDecodeError as error:
        if not records or error.msg.startswith("Extra data"):
            raise ValueError(f"line {len(lines) + 1}: {error.msg} at character {error.colno}") from None
        return records, 1


def _record(line: int, row: str) -> Any:
    try:
        return json.loads(row)
    except json.JSONDecodeError as error:
        raise ValueError(f"line {line}: {error.msg} at character {error.colno}") from None


def _collect(found: Gathering, name: str, value: Any, depth: int) -> None:
    if depth > MAX_DEPTH:
        raise MapFileError(f"{found.file}: '{name[:60]}': nested more than {MAX_DEPTH} deep")
    if isinstance(value, dict):
        for key, inner in value.items():
            _collect(found, _join(name, key), inner, depth + 1)
        found.state(name, value)
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        collect_records(found, name, value)
    elif isinstance(value, list) and value and all(isinstance(item, list) for item in value):
        titles, width = value[0], len(value[0])
        if any(len(item) != width for item in value):
            found.refuse(name, "lists of different lengths")
        elif all(isinstance(title, str) and number(title) is None for title in titles) and len(set(titles)) == width > 0:
            for title, *cells in zip(*value, strict=True):
                _collect(found, _join(name, title), cells, depth + 1)
        elif (rows := [_numbers(found, name, item) for item in value]) and all(row is not None for row in rows):
            found.add(name, np.array(rows))
    elif isinstance(value, list):
        if (numbers := _numbers(found, name, value)) is not None:
            found.add(name, numbers)
    elif (numbers := _numbers(found, name, [value])) is not None:
        found.add(name, numbers)


def collect_records(found: Gathering, name: str, records: Sequence[Any]) -> None:
    """One column per key; where a record lacks it, a number is missing."""
    places: dict[str, list[int]] = {}
    values: dict[str, list[Any]] = {}
    for place, record in enumerate(records):
        for key, leaf in _leaves(name, record, 0):
            places.setdefault(key, []).append(place)
            values.setdefault(key, []).append(leaf)
        found.reserve(name, len(values))  # as all keys become columns of all records
    for key, leaves in values.items():
        if (numbers := _numbers(found, key, leaves)) is not None:
            column = np.full(len(records), np.nan)
            column[places[key]] = numbers
            found.columns[key] = column


def _leaves(name: str, value: Any, depth: int) -> Iterator[tuple[str, Any]]:
    """Path and value of everything in one record; elements of a list by their place, from 1."""
    if depth > MAX_DEPTH:
        raise RecursionError
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(_join(name, key), inner, depth + 1)
    elif isinstance(value, list):
        for place, inner in enumerate(value, 1):
            yield from _leaves(f"{name}[{place}]", inner, depth + 1)
    else:
        yield name, value


def _numbers(found: Gathering, name: str, values: Sequence[Any]) -> Array | None:
    """Values (n,); nothing if one of them is no number, which is noted."""
    if set(map(type, values)) == {float}:
        return np.array(values)
    if any(isinstance(value, str) and is_stamp(value) for value in values):
        found.titles[name] = ("s",)
    numbers = np.empty(len(values))
    for place, value in enumerate(values):
        single = _number(value)
        if single is None:
            text = repr(value)
            found.unusable[name] = f"'{name}': value {place + 1} is {text[:60]}, expected a number or null"
            return None
        numbers[place] = single
    return numbers


def _number(value: Any) -> float | None:
    """A number, also one written as text; NaN for null; nothing for anything else."""
    if value is None:
        return float("nan")
    if isinstance(value, str):
        return number(value)
    if isinstance(value, (int, float)):
        try:
            return float(value)
        except OverflowError:
            return None
    return None


def _join(name: str, key: str) -> str:
    return f"{name}.{key}" if name else key
