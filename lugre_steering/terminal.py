# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Terminals that know fewer letters than we use: what they cannot show is written as near as they can, never as a traceback."""

from __future__ import annotations

import codecs
import sys

NEAREST = {
    "…": "...", "→": "->", "–": "-", "—": "-", "−": "-", "·": ".", "±": "+-", "²": "2", "³": "3", "°": " deg", "µ": "u", "\u2009": " ",
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
