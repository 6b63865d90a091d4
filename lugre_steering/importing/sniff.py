# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How a CSV file is written, guessed from its first rows."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from lugre_steering.counted import counted
from lugre_steering.errors import MapFileError
from lugre_steering.importing.map import WHITESPACE, Csv
from lugre_steering.importing.stamps import is_stamp, order_of
from lugre_steering.importing.text import OPEN_QUOTE, Row, check_text, holds_rows, is_comment, number
from lugre_steering.importing.words import unit_in

_BYTES = 1 << 20
_LINES = 400
_DELIMITERS = (",", ";", "\t", "|", WHITESPACE)
_COMMENTS = "#%!"
_RUN = 5
"""The data begin at a row of numbers of which most of so many are, itself included."""


def sniff(file: Path) -> tuple[Csv, list[str]]:
    """Options to read the file with, and a reason for each that is not the default."""
    encoding, text = _decoded(file)
    text = text.rstrip("\0")  # what a recorder leaves that loses power
    lines = list(islice(io.StringIO(text, newline=""), _LINES))  # as the reader has them
    if "\0" in text or not lines:
        raise MapFileError(f"{file}: holds no text, expected a table")
    marks = Counter(line[0] for line in lines if line[:1] and line[0] in _COMMENTS)
    comment = max(marks, key=marks.__getitem__) if marks else "#"
    ways = [(delimiter, decimal) for decimal in (".", ",") for delimiter in _DELIMITERS]
    delimiter, decimal = max(ways, key=lambda way: _score(lines, comment, *way))
    split = _split(lines, comment, delimiter)
    rows = [(i, cells) for i, cells in split if any(cells)]
    begin = _begin(rows, decimal)
    if begin is None:
        raise MapFileError(f"{file}: no row of numbers among the first {len(lines)} lines, expected a table")
    data = [cells for _, cells in rows[begin:] if _is_data(cells, decimal)]
    widths = max(len(_filled(cells)) for cells in data), max(map(len, data))
    top = begin
    while top > 0 and _is_title(rows[top - 1][1], *widths, decimal):
        top -= 1
    header = [cells for _, cells in rows[top:begin]]
    for i, cells in split:
        if not header and i < rows[top][0] and not cells and lines[i - 1].strip():
            raise MapFileError(f"{file}: line {i}: {OPEN_QUOTE}")
    above = lines[: rows[top][0] - 1]
    columns = None if header else _commented(above, comment, delimiter, decimal, widths[0])
    skip = len(above) if any(line.strip() and line[0] != comment for line in above) else 0
    name_row = 1 + max(range(len(header)), key=lambda i: (not _is_units(header[i]), _count(header[i]), -i), default=0)
    dates, why = order_of(cell for cells in data for cell in cells)
    options = Csv(delimiter, decimal, comment, float(skip), float(len(header)), float(name_row), columns, (), encoding, dates)
    return options, _reasons(options, header) + ([why] if why else [])


def _decoded(file: Path) -> tuple[str, str]:
    with file.open("rb") as stream:
        raw = stream.read(_BYTES)
    check_text(file)
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16", raw.decode("utf-16", errors="ignore")
    try:
        with file.open(encoding="utf-8") as text:
            while text.read(_BYTES):
                pass
    except UnicodeDecodeError:
        return "latin-1", raw.decode("latin-1")
    return "utf-8", raw.decode("utf-8-sig", errors="ignore")  # the last letter may be cut


def _split(lines: Sequence[str], comment: str, delimiter: str) -> list[Row]:
    """Line and cells of each row that is no comment; of one that leaves a quote open no cells."""
    if delimiter == WHITESPACE:
        return [(i, line.split()) for i, line in enumerate(lines, 1) if not is_comment(line, comment, delimiter)]
    rows, begin = list[Row](), 0
    while begin < len(lines):
        reader = csv.reader(lines[begin:], delimiter=delimiter, skipinitialspace=True)
        begin += 1
        if is_comment(lines[begin - 1], comment, delimiter):
            continue
        try:
            cells = next(reader)
        except csv.Error:
            cells = []
        if holds_rows(cells, delimiter):
            cells = []
        rows.append((begin, cells))
        if cells:
            begin += reader.line_num - 1
    return rows


def _commented(lines: Sequence[str], comment: str, delimiter: str, decimal: str, width: int) -> tuple[str, ...] | None:
    """Names in one of the two comments right above the data (the other may hold units), of which the mark itself may be one."""
    found = []
    for line in reversed([line for line in lines if is_comment(line, comment, delimiter)][-2:]):
        for text in (line.lstrip(f"{comment} "), line):
            cells = [cell.strip() for _, row in _split([text], "", delimiter) for cell in row]
            if len(set(cells)) == len(cells) == width and all(number(cell, decimal) is None for cell in cells):
                found.append(tuple(cells))
                break
    return next((cells for cells in found if not _is_units(cells)), found[-1] if found else None)


def _score(lines: Sequence[str], comment: str, delimiter: str, decimal: str) -> int:
    """Numbers less other text, in rows of the usual number of cells; one column is no table."""
    rows = [cells for _, cells in _split(lines, comment, delimiter)]
    width = Counter(len(_filled(cells)) for cells in rows if _is_data(cells, decimal)).most_common(1)
    if not width or width[0][0] < 2:
        return -1
    # Of rows of numbers only: names with blanks would speak for blanks as delimiter, and against tabs.
    data = [row for row in rows if len(_filled(row)) == width[0][0] and _is_data(row, decimal)]
    cells = [cell for row in data for cell in row if cell.strip()]
    return sum(1 if number(cell, decimal) is not None else -1 for cell in cells)


def _filled(cells: Sequence[str]) -> list[str]:
    """Without what trailing commas make."""
    end = max((i for i, cell in enumerate(cells, 1) if cell.strip()), default=0)
    return list(cells[:end])


def _told(cells: Sequence[str]) -> list[str]:
    """Without those that say nothing: a dash is a missing number, and as well no unit."""
    return [cell for cell in cells if cell.strip(" -?")]


def _is_data(cells: Sequence[str], decimal: str) -> bool:
    filled = [cell for cell in _told(cells) if not is_stamp(cell)]  # dates stand among remarks as well
    return bool(filled) and 2 * sum(number(cell, decimal) is not None for cell in filled) >= len(filled)


def _all_numbers(cells: Sequence[str], decimal: str) -> bool:
    """Whether a row holds several numbers and nothing else, as the rows of the faster of two rates."""
    values = [number(cell, decimal) for cell in _told(cells)]
    return len(values) > 1 and None not in values


def _begin(rows: Sequence[tuple[int, list[str]]], decimal: str) -> int | None:
    """Index of the first of several rows of numbers. 'Serial, 12345' is none where rows of numbers begin with a number."""
    first = [_is_first(cells[0], decimal) for _, cells in rows if _is_data(cells, decimal)]
    by_number = 2 * sum(first) > len(first)
    for i, (_, cells) in enumerate(rows):
        if by_number and not _is_first(cells[0], decimal):
            continue
        run = [cells for _, cells in rows[i : i + _RUN]]
        widest = max(len(_filled(cells)) for cells in run)
        data = [_is_data(cells, decimal) and (2 * len(_filled(cells)) > widest or _all_numbers(cells, decimal)) for cells in run]
        if data[0] and 2 * sum(data) > len(run):
            return i
    return None


def _is_first(cell: str, decimal: str) -> bool:
    return number(cell, decimal) is not None or is_stamp(cell)


def _is_title(cells: Sequence[str], numbers: int, width: int, decimal: str) -> bool:
    """A row of words as wide as the data, whose ``numbers`` may end before their ``width``; remarks of a logger are narrower."""
    filled = _told(cells)
    wide = len(cells) >= numbers and 2 * len(filled) >= numbers and len(_filled(cells)) <= width
    return wide and all(number(cell, decimal) is None for cell in filled)


def _is_units(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell.strip(" -[]()")]
    return bool(filled) and 2 * sum(unit_in(cell, whole=True) is not None for cell in filled) > len(filled)


def _count(cells: Sequence[str]) -> int:
    return sum(bool(cell.strip()) for cell in cells)


def _reasons(options: Csv, header: Sequence[Sequence[str]]) -> list[str]:
    found = []
    if options.delimiter != "," or options.decimal != ".":
        found.append(f"delimiter {options.delimiter!r} and decimal '{options.decimal}' make the most cells numbers")
    if options.encoding != "utf-8":
        found.append(f"encoding {options.encoding}: the file is not UTF-8")
    if options.skip_rows:
        found.append(f"{counted(int(options.skip_rows), 'line')} above the column names left out")
    if options.columns is not None:
        found.append("the column names stand in a comment")
    elif not header:
        found.append("the first row holds numbers, so the columns are called c1, c2, ...: name them with csv.columns")
    if len(header) > 1:
        found.append(f"{len(header)} header rows, names in row {options.name_row:.0f} of them")
    return found
