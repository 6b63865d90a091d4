# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""``--fail-on``: what a script wants a command to fail for, although it could do its work."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lugre_steering.bag.find import SKIPPED
from lugre_steering.errors import DataError

Facts = Mapping[str, "str | float | None"]
"""By word: what is so, as a sentence, or a number; None where it is not so, or there is no number."""


def quality_facts(findings: Sequence[Mapping[str, str]]) -> dict[str, str | None]:
    """``skipped`` and ``finding`` of the findings about the data."""
    told: dict[bool, list[str]] = {True: [], False: []}
    for found in findings:
        told[found["finding"] == SKIPPED].append(f"{found['bag']}: {found['finding']}")
    return {"skipped": ", ".join(told[True]) or None, "finding": ", ".join(told[False]) or None}


class Gate:
    """What was asked for, checked before the work begins."""

    def __init__(self, wanted: Sequence[str], words: Sequence[str], numbers: Sequence[str] = ()) -> None:
        """``wanted`` as typed: one of ``words``, or one of ``numbers`` as WORD=LIMIT."""
        self._words: list[str] = []
        self._limits: list[tuple[str, float]] = []
        for text in wanted:
            word, equals, limit = text.partition("=")
            if not equals and word in words:
                self._words.append(word)
                continue
            try:
                if word not in numbers:
                    raise ValueError
                self._limits.append((word, float(limit)))
            except ValueError:
                expected = ", ".join([*words, *(f"{number}=LIMIT" for number in numbers)])
                raise DataError(f"--fail-on {text}: expected one of {expected}") from None

    def failures(self, facts: Facts) -> list[str]:
        """What of it is so, in words."""
        met = [str(facts[word]) for word in self._words if facts[word]]
        for word, limit in self._limits:
            value = facts[word]
            if value is not None and not float(value) <= limit:
                met.append(f"{word} is {float(value):.6g}, above {limit:g}")
        return met
