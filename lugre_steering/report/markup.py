# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Words, tables and lists as HTML; on a phone the rows of a table become cards (``static/page.css``)."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from dataclasses import dataclass

from lugre_steering.counted import unparted

_DATE = re.compile(r"\b\d{4}-\d\d-\d\d\b")


def text(value: object) -> str:
    """Any words as HTML; numbers are not parted from their unit."""
    return unparted(html.escape(str(value), quote=True))


def dated(value: object) -> str:
    """Any words as HTML, whose dates are not parted."""
    return _DATE.sub(r'<span class="whole">\g<0></span>', text(value))


def code(value: object) -> str:
    """A name as it stands in files."""
    return f"<code>{text(value)}</code>"


@dataclass(frozen=True)
class Row:
    """Cells (HTML) of one row of a table, and the colour (CSS) of its mark if it stands out."""

    cells: Sequence[str]
    mark: str | None = None


def table(header: Sequence[str], rows: Sequence[Row | Sequence[str]], numeric: Sequence[int] = (), narrow: bool = False) -> str:
    """Cells and ``header`` are HTML already; ``numeric`` columns are set flush right."""
    style = [' class="n"' if i in numeric else "" for i in range(len(header))]
    labels = [html.escape(re.sub("<[^>]*>", "", cell), quote=True) for cell in header]
    head = "".join(f'<th scope="col"{s}>{cell}</th>' for s, cell in zip(style, header, strict=True))
    body = "".join(_row(row if isinstance(row, Row) else Row(row), style, labels) for row in rows)
    kind = ' class="narrow"' if narrow else ""
    return f'<div class="scroll"><table{kind}><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table></div>\n'


def _row(row: Row, style: Sequence[str], labels: Sequence[str]) -> str:
    cells = "".join(
        f'<td{s} data-label="{label}">{f"<span>{cell}</span>" if cell else ""}</td>'
        for s, label, cell in zip(style, labels, row.cells, strict=True)
    )
    marks = f' class="named" style="--row:{row.mark}"' if row.mark else ""
    return f"<tr{marks}>{cells}</tr>\n"


def pairs(rows: Sequence[tuple[str, str]]) -> str:
    """Names (words) and what they mean (HTML), without those that mean nothing."""
    return '<dl class="pairs">' + "".join(f"<dt>{text(name)}</dt><dd>{value}</dd>" for name, value in rows if value) + "</dl>"


def facts(rows: Sequence[tuple[str, str, str]]) -> str:
    """Name, number and a remark each (words), in large type."""
    cells = "".join(f"<div><dt>{text(n)}</dt><dd>{text(v)}<small>{text(small)}</small></dd></div>" for n, v, small in rows)
    return f'<dl class="facts">{cells}</dl>\n' if cells else ""


def bar(share: float, style: str = "") -> str:
    """A bar of a share of 8 em; numbers stand beside it."""
    return f'<span class="bar {style}" style="width:{8.0 * min(max(share, 0.0), 1.0):.2f}em"></span>'
