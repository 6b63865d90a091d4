# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the site does to a page: tables that the code knows are put in, files of the repository that it shows come along, and cells know
their column, whose title stands before them on a phone (``site.css``)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

from lugre_steering.reference import filled

ABOVE = re.compile(r"\]\(\.\./([^)#]+)\)")
"""A link from a page to a file beside ``docs/``: the site has a copy under the same path."""
TABLE, ROW = re.compile(r"<table>.*?</table>", re.DOTALL), re.compile(r"<tr>.*?</tr>", re.DOTALL)


def on_files(files: Files, config: Any) -> Files:
    docs = Path(config["docs_dir"])
    shown = {name for page in docs.glob("*.md") for name in ABOVE.findall(page.read_text(encoding="utf-8"))}
    for name in sorted(shown):
        files.append(File.generated(config, name, abs_src_path=str(docs.parent / name)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    return filled(ABOVE.sub(r"](\1)", markdown))


def on_page_content(html: str, **_: Any) -> str:
    return TABLE.sub(lambda table: labelled(table[0]), html)


def labelled(table: str) -> str:
    """The table with the title of its column in each cell."""
    titles = [re.sub("<[^>]*>", "", title).replace('"', "&quot;") for title in re.findall(r"<th[^>]*>(.*?)</th>", table, re.DOTALL)]

    def row(found: re.Match[str]) -> str:
        left = iter(titles)
        return re.sub(r"<td([^>]*)>", lambda cell: f'<td{cell[1]} data-label="{next(left)}">', found[0])

    return ROW.sub(row, table)
