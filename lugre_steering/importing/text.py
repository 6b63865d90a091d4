# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables of text: CSV and its kin. What a row may lack is said in the map; any other text among numbers is refused."""

from __future__ import annotations

import csv
import re
from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import repeat
from pathlib import Path
from typing import TextIO

import numpy as np

from lugre_steering.errors import MapFileError
from lugre_steering.importing.map import WHITESPACE, Csv
from lugre_steering.importing.stamps import FORMS, is_stamp, stamp
from lugre_steering.importing.table import MAX_COLUMNS, MAX_NUMBERS, Table

Row = tuple[int, list[str]]

_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)(e[-+]?\d+)?|[-+]?inf(inity)?", re.IGNORECASE | re.ASCII)
"""A number as loggers write it; float() would take the underscores of Python too."""
_GROUPED = re.compile(r"[-+]?\d{1,3}(?:(?:,\d{3})+\.\d*|(?:,\d{3}){2,})", re.ASCII)
"""Thousands in groups, where nothing else can be meant: 1,234.5 and 1,234,567, but not 1,234."""
_MISSING = ("", "nan", "-nan", "na", "n/a", "null", "none")
_NO_VALUE = re.compile(r"-+(\.-+)?|\?+|#n/a|#nv|#div/0!|[-+]?1[.,]#(ind|inf|[qs]?nan)0*", re.IGNORECASE)
"""What loggers and spreadsheets write where there is none."""
_NO_TEXT = (
    (b"\x1f\x8b", "is packed (gzip), expected a table: unpack it"),
    (b"PK\x03\x04", "is packed, or a spreadsheet, expected a table: unpack it, or save it as CSV"),
    (b"\x93NUMPY", "is an array without names, expected a table: save it by names, as .npz"),
)
"""How files begin that hold a table, but no text."""
OPEN_QUOTE = 'a cell begins with a quote that its row does not close, expected "..." or none'
_NUL = "\0"
_MAX_LINE = 1 << 20
_DATED = re.compile(r"\d+[-/.:]\d+[-/.:]\d|\d+:\d\d", re.ASCII)
"""What may be meant as a date or time, of whatever form."""
_LINE_BREAK = re.compile(r"\s*[\r\n]\s*")
_BLOCK = 4096


def number(text: str, decimal: str = ".", dates: str | None = None) -> float | None:
    """A cell as a number, NaN if it says that there is none, nothing if it is other text. A date is its Unix time [s], a time
    alone the seconds of its day; ``dates``: the order of day and month, where slashes or dashes are between them."""
    text = text.strip()
    # With another decimal character a point groups thousands, or the map is wrong.
    plain = text if decimal == "." else text.replace(".", "?").replace(decimal, ".").replace("?", ",")
    if _NUMBER.fullmatch(plain):
        return float(plain)
    if _GROUPED.fullmatch(plain):
        return float(plain.replace(",", ""))
    if text.lower() in _MISSING or _NO_VALUE.fullmatch(text):
        return float("nan")
    return stamp(text, dates)


def check_text(file: Path) -> None:
    """Refuse what is no text, but known."""
    with file.open("rb") as stream:
        begin = stream.read(8)
    for magic, what in _NO_TEXT:
        if begin.startswith(magic):
            raise MapFileError(f"{file}: {what}")


def read_text(file: Path, options: Csv) -> Table:
    """The columns of a CSV file."""
    check_text(file)
    rows = read_rows(file, options)
    filled = (row for row in rows if any(map(str.strip, row[1])))
    count = int(options.header_rows)
    header = [row for _, row in zip(range(count), filled, strict=False)]
    first = next(filled, None)
    if first is None:
        wanted = f"{count} header rows and rows of numbers" if count != 1 else "a row of column names and rows of numbers"
        raise MapFileError(f"{file}: has {len(header)} rows, expected {wanted}")
    titles = _titles(file, options, header, first)
    return _Columns(file, options, titles, header).read(first, _samples(rows, len(titles)))


def read_rows(file: Path, options: Csv) -> Iterator[Row]:
    """Line number and cells of each row below ``skip_rows`` that is no comment; a blank line has no cells."""
    with file.open(encoding="utf-8-sig" if options.encoding == "utf-8" else options.encoding, newline="") as stream:
        lines = (
            (i, line) for i, line in enumerate(_lines(file, stream), 1)
            if i > options.skip_rows and not is_comment(line, options.comment, options.delimiter)
        )  # fmt: skip
        try:
            if options.delimiter == WHITESPACE:
                yield from ((i, line.split()) for i, line in lines)
            else:
                yield from _split(file, lines, options.delimiter)
        except UnicodeDecodeError as error:
            hint = "expected csv.encoding latin-1, cp1252 or utf-16 in the map"
            raise MapFileError(f"{file}: cannot be read as {options.encoding}: {error.reason}; {hint}") from error


def is_comment(line: str, comment: str, delimiter: str) -> bool:
    """Whether a line is left out; one that begins with '#N/A' is not."""
    if not comment or comment not in line:
        return False
    first = line.split(None if delimiter == WHITESPACE else delimiter, 1)[0].lstrip(' "')
    return first.startswith(comment) and not _NO_VALUE.fullmatch(first.rstrip(' "\r\n'))


def holds_rows(row: Sequence[str], delimiter: str) -> bool:
    """Whether a cell goes on over what are rows: its quote is not closed."""
    return any(delimiter in line for cell in row for line in _LINE_BREAK.split(cell)[1:])


def _split(file: Path, lines: Iterator[tuple[int, str]], delimiter: str) -> Iterator[Row]:
    """Rows, each of one line unless a cell in quotes goes on."""
    taken: list[int] = []

    def texts() -> Iterator[str]:
        for i, line in lines:
            taken.append(i)
            yield line

    try:
        for row in csv.reader(texts(), delimiter=delimiter, skipinitialspace=True):
            if len(taken) > 1 and holds_rows(row, delimiter):
                raise MapFileError(f"{file}: line {taken[0]}: {OPEN_QUOTE}")
            yield taken[0], row
            taken.clear()
    except csv.Error as error:
        raise MapFileError(f"{file}: line {taken[0]}: {OPEN_QUOTE if len(taken) > 1 else f'is not CSV: {error}'}") from error


def _samples(rows: Iterator[Row], width: int) -> Iterator[Row]:
    """An empty row holds the place of a sample, if others follow; a blank line does so only in a table of one column."""
    empty = 0
    for line, row in rows:
        if any(row):
            yield from repeat((line, [""] * width), empty)
            empty = 0
            yield line, row
        elif row or width == 1:
            empty += 1


def _lines(file: Path, stream: TextIO) -> Iterator[str]:
    """Lines, none of which fills the memory."""
    count = 0
    while line := stream.readline(_MAX_LINE):
        count += 1
        if _NUL in line and not line.strip(f"{_NUL}\r\n"):
            line = _NUL  # of any length
        if len(line) == _MAX_LINE:
            raise MapFileError(f"{file}: line {count}: is longer than {_MAX_LINE} characters, expected a table")
        yield line


def _titles(file: Path, options: Csv, header: Sequence[Row], first: Row) -> list[str]:
    """A name for each column, as written; trailing commas make no column."""
    cells = _trimmed(header[0][1]) if header else []
    values = [number(cell, options.decimal, options.dates) for cell in cells]
    plain = options.columns is None and all(cell.isdigit() for cell in cells)  # 1, 2, 3 may be names
    if None not in values and not plain and np.isfinite(np.array(values, np.float64)).any():
        wanted = "expected names of columns, or csv.header_rows: 0 in the map"
        raise MapFileError(f"{file}: line {header[0][0]}: the header holds numbers, {wanted}")
    if options.columns is not None:
        return list(options.columns)
    if not header:
        return [f"c{i + 1}" for i in range(len(_trimmed(first[1])))]
    line, row = header[int(options.name_row) - 1]
    titles = _trimmed(row)
    if len(titles) > MAX_COLUMNS:
        raise MapFileError(f"{file}: line {line}: has {len(titles)} columns, expected at most {MAX_COLUMNS}")
    return titles


def _trimmed(row: Sequence[str]) -> list[str]:
    """Cells without what trailing commas make, each as one line."""
    cells = [_LINE_BREAK.sub(" ", cell.strip()) for cell in row]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _distinct(titles: Sequence[str]) -> list[str]:
    """Names by which columns are asked for: an unnamed one by its place, [3]; one of several alike by its turn, a[2]."""
    counts, turn, names = Counter(titles), Counter[str](), []
    for place, title in enumerate(titles, 1):
        turn[title] += 1
        names.append(f"[{place}]" if not title else f"{title}[{turn[title]}]" if counts[title] > 1 else title)
    return names


class _Columns:
    """Takes rows by blocks: text costs ten times the memory of numbers."""

    def __init__(self, file: Path, options: Csv, titles: Sequence[str], header: Sequence[Row]) -> None:
        self.file, self.options, self.titles = file, options, list(titles)
        self.names = _distinct(titles)
        self.header = [_trimmed(row) for _, row in header]
        self.leads = {row[0] for row in self.header if row}
        self.values = [array("d") for _ in self.names]
        self.unusable: dict[str, str] = {
            title: f"column '{title}' occurs twice; expected '{title}[1]', '{title}[2]', ... in the map"
            for title, count in Counter(titles).items() if count > 1 and title
        }  # fmt: skip
        self.stamped: set[str] = set()
        self.left_out: Counter[str] = Counter()
        self.rows = 0

    def read(self, first: Row, rows: Iterator[Row]) -> Table:
        block = [kept] if (kept := self._row(first)) else []
        for row in rows:
            if kept := self._row(row):
                block.append(kept)
            if len(block) == _BLOCK:
                self._take(block)
                block = []
        if block:
            self._take(block)
        if not self.rows:
            raise MapFileError(f"{self.file}: has no rows of numbers below the header")
        columns = {
            name: np.frombuffer(column, np.float64)
            for name, column in zip(self.names, self.values, strict=True) if name not in self.unusable
        }  # fmt: skip
        return Table(self.file, columns, {}, self.unusable, self._titles(), dict(self.left_out))

    def _row(self, found: Row) -> Row | None:
        """The cells of the columns; nothing if the row is to be left out."""
        line, row = found
        width = len(self.titles)
        if row[0] == _NUL:
            self.left_out["lines of NUL (was the power lost?)"] += 1
            return None
        if len(row) > width and not any(cell.strip() for cell in row[width:]):
            row = row[:width]  # trailing commas
        if row[0].strip() in self.leads and _trimmed(row) in self.header:
            self.left_out["repeated header rows"] += 1
            return None
        filled = [cell for cell in row if cell.strip()]
        numbers = (number(cell, self.options.decimal, self.options.dates) for cell in filled)
        if "text_rows" in self.options.allow and filled and all(value is None for value in numbers):
            self.left_out["rows without a number"] += 1
            return None
        if len(row) < width and "short_rows" in self.options.allow:
            self.left_out["short rows (what they lack counts as missing)"] += 1
            row = row + [""] * (width - len(row))
        if len(row) != width:
            hint = "; csv.allow: [short_rows] takes what is lacking as missing" if len(row) < width else ""
            raise MapFileError(f"{self.file}: line {line}: has {len(row)} cells, expected {width} as in the header{hint}")
        return line, row

    def _take(self, block: Sequence[Row]) -> None:
        self.rows += len(block)
        for place, cells in enumerate(zip(*(row for _, row in block), strict=True)):
            if self.names[place] not in self.unusable:
                self.values[place].extend(self._numbers(place, cells, block))
        if sum(map(len, self.values)) > MAX_NUMBERS:
            raise MapFileError(f"{self.file}: has more than {MAX_NUMBERS} cells; split it")

    def _numbers(self, place: int, cells: Sequence[str], block: Sequence[Row]) -> Sequence[float]:
        """The cells of one column. One that holds text is unusable, which does no harm unless somebody asks for it."""
        text, decimal = "".join(cells), self.options.decimal
        if decimal == "." and text.isascii() and "_" not in text:
            try:
                return list(map(float, cells))
            except ValueError:
                pass
        if not self.values[place] and any(map(is_stamp, cells)):
            self.stamped.add(self.names[place])
        found = []
        for (line, _), cell in zip(block, cells, strict=True):
            value = number(cell, decimal, self.options.dates)
            if _NO_VALUE.fullmatch(cell.strip()):
                self.left_out["cells of '-', '?', '#N/A' and the like (count as missing)"] += 1
            if value is None:
                if "text_cells" not in self.options.allow:
                    where = f"line {line}, column '{self.names[place]}'"
                    hint = "" if any(map(str.isdigit, cell)) else "; csv.allow: [text_cells] takes text as missing"
                    date = f", a date or time as {FORMS}," if _DATED.match(cell.strip()) else ""
                    expected = f"expected a number (decimal '{decimal}'){date} or an empty cell{hint}"
                    self.unusable[self.names[place]] = f"{where}: got '{_LINE_BREAK.sub(' ', cell)[:60]}', {expected}"
                    self.values[place] = array("d", self.values[place][:0])
                    return []
                self.left_out["cells of text (count as missing)"] += 1
                value = float("nan")
            found.append(value)
        return found

    def _titles(self) -> dict[str, tuple[str, ...]]:
        """The unit of dates and times, and what the other header rows say; which are units is for the proposal to find out."""
        others = [row for i, row in enumerate(self.header, 1) if i != self.options.name_row]
        columns = zip(self.names, *(row + [""] * (len(self.names) - len(row)) for row in others), strict=False)
        found = {name: tuple(filter(None, cells)) for name, *cells in columns if any(cells)}
        return found | {name: ("s", *found.get(name, ())) for name in self.stamped}
