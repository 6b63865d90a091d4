# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Where words go, stdout or stderr; letters that it does not know are written as near as it can, never as a
traceback, remarks as points."""

from __future__ import annotations

import codecs
import sys
import textwrap
from typing import Any

from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from lugre_steering.counted import unparted

NEAREST = {
    "…": "...", "→": "->", "–": "-", "—": "-", "−": "-", "·": ".", "±": "+-", "²": "2", "³": "3", "°": " deg", "µ": "u", "\u202f": " ",
    "\u00a0": " ", "•": "*", "✓": "ok", "✗": "x",
}  # fmt: skip
"""Letters of ours and of our libraries, and what stands for them where only ASCII is known."""


def nearest(error: UnicodeError) -> tuple[str, int]:
    """Handler of codec errors: the nearest plain letters, a question mark for what has none."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    missing = error.object[error.start : error.end]
    return "".join(NEAREST.get(letter, "?") for letter in missing), error.end


def forgive_letters() -> None:
    """From now on standard output and error write the nearest letters where their encoding lacks one."""
    codecs.register_error("lugre_steering.nearest", nearest)
    for stream in (sys.stdout, sys.stderr):
        if (reconfigure := getattr(stream, "reconfigure", None)) is not None:
            reconfigure(errors="lugre_steering.nearest")


class Prose:
    """Paragraphs whose lines never end between a number and its unit, as Rich would end them at any space."""

    def __init__(self, said: str) -> None:
        self._lines = said.splitlines()

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for line in self._lines:
            said = textwrap.fill(unparted(line), options.max_width, break_on_hyphens=False)
            yield Text(said.replace("\u00a0", " "), no_wrap=True)

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        return Measurement(1, min(options.max_width, max(map(len, self._lines), default=1)))


def point(said: str) -> Table:
    """A remark of one or more lines behind a dash."""
    grid = Table.grid(padding=(0, 1))
    grid.add_row("-", Prose(said))
    return grid


class Terminal(Console):
    """Letters that the terminal lacks are replaced before a table is laid out, so that its columns stay straight; brackets of file and
    vehicle names are no markup."""

    def __init__(self, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, markup=False)
        self._plain = str.maketrans({letter: plain for letter, plain in NEAREST.items() if not _known(letter, self.encoding)})

    def render_str(self, text: str, **how: Any) -> Text:
        return super().render_str(text.translate(self._plain), **how)


def _known(letter: str, encoding: str) -> bool:
    try:
        letter.encode(encoding)
    except UnicodeEncodeError:
        return False
    return True


def console() -> Console:
    """Where progress and messages go: stderr, so that stdout carries results only."""
    return Terminal(stderr=True)


def output() -> Console:
    """Where tables go: stdout."""
    return Terminal()
