# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One HTML page that opens offline on any screen: sections of words and tables, and charts that draw themselves."""

from __future__ import annotations

import json
import re
import string
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from typing import Any, Literal

from lugre_steering import units
from lugre_steering.report.chart import Chart
from lugre_steering.report.markup import text
from lugre_steering.vehicle import Vehicle

Tone = Literal["plain", "good", "found", "new", "unsure"]
"""Whether the page brings numbers only, good news, a finding, one that nobody has listed, or doubt: its accent."""


@dataclass(frozen=True)
class Section:
    """``anchor`` and ``short`` for the line of links, ``title`` (words) and ``content`` (HTML); left out where that is empty."""

    anchor: str
    short: str
    title: str
    content: str


@dataclass
class Charts:
    """The charts of a page in the order in which they were given their places."""

    specs: dict[str, dict[str, Any]] = field(default_factory=dict)

    def place(self, chart: Chart | None, said: str, half: bool = False) -> str:
        """``said``: what is to be seen, for those who cannot see it."""
        if chart is None:
            return ""
        name = f"chart-{len(self.specs)}"
        self.specs[name] = chart.plain()
        kind = ' class="half"' if half else ""
        note = "<noscript><p>Charts need scripts to be allowed; the pictures beside this page show the same.</p></noscript>"
        return f'<figure id="{name}"{kind} data-words="{text(said)}">{note}</figure>\n'


def render(
    title: str, tone: Tone, head: str, sections: Sequence[Section], charts: Charts, maker: str, said: Callable[[str], str] = str
) -> str:
    """The page. ``head``: its first screen; ``maker``: program and version; ``said``: puts the words of HTML and charts into those of a
    vehicle."""
    kept = [section for section in sections if section.content]
    links = [("verdict", "Verdict"), *((section.anchor, section.short) for section in kept)]
    body = [head, *(f'<section id="{s.anchor}"><h2>{text(s.title)}</h2>\n{s.content}</section>' for s in kept)]
    files = resources.files(__package__).joinpath("static")
    style, script, page = (files.joinpath(name).read_text(encoding="utf-8") for name in ("page.css", "charts.js", "page.html"))
    return string.Template(page).substitute(
        title=text(title),
        tone=tone,
        style=style.strip(),
        nav=said("".join(f'<a href="#{anchor}">{text(words)}</a>' for anchor, words in links)),
        body=said("\n".join(body)),
        maker=text(maker),
        # Inside a script element only the letters of its end tag would be dangerous.
        charts=json.dumps(_named(charts.specs, said), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
        script=script.strip(),
    )


def in_words_of(vehicle: Vehicle, own: Sequence[str]) -> Callable[[str], str]:
    """What puts the words of a page into those of a linear axis; tags, code and the user's ``own`` names stay."""
    if not units.is_linear(vehicle):
        return str
    kept = "|".join(["<code[^>]*>.*?</code>", "<[^>]*>", *(re.escape(text(name)) for name in own if name)])

    def said(page: str) -> str:
        parts = re.split(f"({kept})", page, flags=re.DOTALL)
        return "".join(part if i % 2 else units.words(vehicle, part) for i, part in enumerate(parts))

    return said


def _named(tree: Any, said: Callable[[str], str]) -> Any:
    """Charts with their labels and names in other words."""
    if isinstance(tree, Mapping):
        return {key: said(item) if key in ("name", "label") else _named(item, said) for key, item in tree.items()}
    return [_named(item, said) for item in tree] if isinstance(tree, list) and tree and isinstance(tree[0], dict) else tree
