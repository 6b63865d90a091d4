# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How a result came about, as the last section of its page."""

from __future__ import annotations

from collections.abc import Mapping, Sized

from lugre_steering.provenance import Provenance
from lugre_steering.report import words
from lugre_steering.report.markup import code, pairs, table, text


def made_by(by: Provenance, note: str = "") -> str:
    """Version, date, options, and the files with their hashes; ``note`` (HTML) below them."""
    files = [("vehicle file", by.vehicle)] if by.vehicle is not None else []
    files += [("bag", bag) for bag in by.bags]
    rows = [[text(kind), text(source.path), text(name), code(digest)] for kind, source in files for name, digest in source.sha256.items()]
    run = pairs([("made by", text(f"{by.tool} {by.command}")), ("date (UTC)", text(by.date)), ("options", plain_words(by.options))])
    below = f'<p class="note">{note}</p>\n' if note else ""
    return run + (table(["", "given as", "file", "SHA-256"], rows) if rows else "") + below


def plain_words(value: object) -> str:
    """Anything that JSON holds as words (HTML); 'none' where there is nothing."""
    if value is None or (isinstance(value, Sized) and len(value) == 0):
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Mapping):
        return ", ".join(f"{text(key)}: {plain_words(item)}" for key, item in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(plain_words(item) for item in value)
    return words.number(value) if isinstance(value, float) else text(value)
