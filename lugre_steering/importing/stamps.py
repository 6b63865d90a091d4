# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Dates and times of the day as loggers write them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import UTC, datetime

ORDERS = ("dmy", "mdy")
"""What 5/6/2026 may be: the fifth of June, or the sixth of May."""
FORMS = "2026-11-22 05:30:00.25+01:00, 22.11.2026 05:30:00.25 or 05:30:00.25 (by slashes or dashes with csv.dates)"
"""For messages."""
_DAY = (
    r"(?:(?P<iso>\d{4}(?P<apart>[-/.])\d\d(?P=apart)\d\d)|"
    r"(?P<one>\d{1,2})(?P<sign>[-/.])(?P<two>\d{1,2})(?P=sign)(?P<year>\d{4}))"
)
_FRACTION = r"(?:[.,](?P<fraction>\d{1,9})|:(?P<milliseconds>\d{3}))?"
_CLOCK = rf"(?P<hour>\d{{1,2}}):(?P<minute>\d\d):(?P<second>\d\d){_FRACTION}(?:\s*(?P<half>[AP]M))?"
_ZONE = r"(?:\s*(?P<zone>Z|UTC|GMT|[-+]\d\d(?::?\d\d)?))?"
_STAMP = re.compile(rf"{_DAY}(?:(?:T|,? +){_CLOCK}{_ZONE})?", re.ASCII | re.IGNORECASE)
_TIME = re.compile(_CLOCK, re.ASCII | re.IGNORECASE)


def stamp(text: str, order: str | None = None) -> float | None:
    """Unix time [s] of a date, UTC unless it says otherwise, or seconds of the day of a time; nothing if it is neither.

    ``order``: of day and month apart by slashes or dashes, which tell nothing without it.
    """
    if found := _TIME.fullmatch(text):
        return _of_day(found)
    found = _STAMP.fullmatch(text)
    day = _day(found, order) if found else None
    if found is None or day is None:
        return None
    clock = _of_day(found) if found["hour"] else 0.0
    return None if clock is None else day - _offset(found["zone"]) + clock


def is_stamp(text: str) -> bool:
    """Whether a cell is written as a date or time, of whatever order."""
    return bool(_TIME.fullmatch(text.strip()) or _STAMP.fullmatch(text.strip()))


def order_of(cells: Iterable[str]) -> tuple[str | None, str | None]:
    """The order of day and month in dates by slashes or dashes, and why: what exceeds 12 is a day, and AM and PM are said where
    months come first."""
    found = [match for cell in cells if (match := _STAMP.fullmatch(cell.strip())) and match["sign"] in ("/", "-")]
    if not found:
        return None, None
    fitting = [order for order in ORDERS if all(_day(match, order) is not None for match in found)]
    if len(fitting) == 1:
        return fitting[0], f"dates like {found[0][0]!r} are {fitting[0]}: in the other order they would not all be dates"
    if any(match["half"] for match in found):
        return "mdy", f"dates like {found[0][0]!r}: GUESSED mdy, as they count hours by AM and PM"
    return None, f"dates like {found[0][0]!r} are ambiguous: say csv.dates: dmy or mdy"


def _day(found: re.Match[str], order: str | None) -> float | None:
    """Unix time of its beginning; nothing if there is no such day."""
    order = "dmy" if found["sign"] == "." else order
    if found["iso"] is None and order is None:
        return None
    day, month = (found["one"], found["two"]) if order == "dmy" else (found["two"], found["one"])
    try:
        date = datetime.fromisoformat(re.sub("[/.]", "-", found["iso"] or "") or f"{found['year']}-{month:0>2}-{day:0>2}")
    except ValueError:
        return None
    return date.replace(tzinfo=UTC).timestamp()


def _of_day(found: re.Match[str]) -> float | None:
    """Seconds since midnight; nothing if no clock shows it."""
    hour, minute, second = (int(found[part]) for part in ("hour", "minute", "second"))
    if found["half"]:
        if not 1 <= hour <= 12:
            return None
        hour = hour % 12 + (12 if found["half"].upper() == "PM" else 0)
    if hour > 23 or minute > 59 or second > 59:
        return None
    return 3600.0 * hour + 60.0 * minute + second + float(f"0.{found['fraction'] or found['milliseconds'] or 0}")


def _offset(zone: str | None) -> float:
    """Seconds by which a zone is ahead of UTC."""
    if zone is None or zone[0] not in "+-":
        return 0.0
    ahead = 3600.0 * int(zone[1:3]) + 60.0 * int(zone[3:].lstrip(":") or 0)
    return -ahead if zone[0] == "-" else ahead
