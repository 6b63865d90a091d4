# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Where words go, stdout or stderr; letters that it does not know are written as near as it can, never as a
traceback, remarks as points."""

from __future__ import annotations

import codecs
import sys

from rich.console import Console
from rich.table import Table
from rich.text import Text

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


def point(said: str) -> Table:
    """A remark of one or more lines behind a dash."""
    grid = Table.grid(padding=(0, 1))
    grid.add_row("-", Text(said, overflow="fold"))
    return grid


def console() -> Console:
    """Where progress and messages go: stderr, so that stdout carries results only."""
    return Console(stderr=True, markup=False)


def output() -> Console:
    """Where tables go: stdout. Names of files and vehicles are shown as they are, brackets and all."""
    return Console(markup=False)
