# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a table states of the units of its columns, in their names and in rows of units."""

from __future__ import annotations

from lugre_steering.importing.map import READABLE_UNITS
from lugre_steering.importing.table import Table
from lugre_steering.importing.words import stated_in, unit_in


def stated(table: Table, name: str, dimensions: tuple[str, ...] | None) -> str | None:
    """The unit that the file gives, by a row of units or in the name."""
    for text, whole in (*((title, True) for title in table.titles.get(name, ())), (name, False)):
        unit = unit_in(text, whole)
        if unit is not None and (dimensions is None or READABLE_UNITS[unit][0] in dimensions):
            return unit
    return None


def unfit(table: Table, name: str, dimensions: tuple[str, ...]) -> str | None:
    """What is stated in place of a unit, where it is none of these dimensions: a scale would have to be guessed."""
    if stated(table, name, dimensions) is not None:
        return None
    titles = [(title, place == table.row_of_units) for place, title in enumerate(table.titles.get(name, ()))]
    return next((found for text, whole in (*titles, (name, False)) if (found := stated_in(text, whole)) is not None), None)
