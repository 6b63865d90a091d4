# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The clocks of an unknown table, guessed from names and numbers, each with its reason."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lugre_steering.importing.channels import unusable
from lugre_steering.importing.evaluate import Columns, times
from lugre_steering.importing.map import READABLE_UNITS, SCHEMA, Clock, ImportMap
from lugre_steering.importing.stated import stated, unfit
from lugre_steering.importing.table import Table
from lugre_steering.importing.words import WORDS, tells, words_of
from lugre_steering.recording import Array

FEW = 5
"""Fewer numbers tell nothing."""
_UNIX_S = 1e8
"""A time above so much counts from 1970."""
_OUR_DAYS_S = (1e9, 2.0**31)
"""Unix times that recordings may have."""
_UNITS = ("s", "ms", "us", "ns")
"""Of times whose unit is not stated."""
_RATES_HZ = (0.1, 5e4)
"""What recordings of machines are sampled at."""
_DAY_S = 86400.0
_COUNTED = (
    (_DAY_S, 25569, "days since 1900, as spreadsheets count them"), (1.0, 2082844800, "seconds since 1904, as LabVIEW counts them"),
    (1e-7, 116444736000000000, "steps of 100 ns since 1601, as Windows counts them"),
    (1e-7, 621355968000000000, "steps of 100 ns since the year 1, as .NET counts them"),
)  # fmt: skip
"""Seconds per step, the step at which 1970 began, and what is counted."""
_LOST = 0.01
"""More samples than this share behind others of their clock are no stray ones."""
_SECONDS, _NANOSECONDS = ("sec", "secs", "s", "seconds"), re.compile(r"(ns|nsecs?|nanosecs?|nanoseconds)$")


@dataclass(frozen=True)
class ClockGuess:
    """Sampling instants, and why: a ``column``, an ``expression`` of several under short ``names``, or rows at ``rate_Hz``."""

    column: str
    unit: str
    why: str
    expression: str | None = None
    names: Mapping[str, str] = field(default_factory=dict)
    rate_Hz: float | None = None
    key: str = "time"

    def source(self) -> dict[str, Any]:
        """As a map has it."""
        if self.rate_Hz is not None:
            return {"rate_Hz": self.rate_Hz}
        way = {"column": self.column} if self.expression is None else {"expression": self.expression}
        return {**way, "unit": self.unit}

    def columns(self) -> set[str]:
        return {self.column, *self.names.values()}

    def seconds(self, table: Table) -> Array:
        """What the columns say (n,) [s], whether they are too coarse or not."""
        column = self.column if self.expression is None else None
        mapping = ImportMap(SCHEMA, {}, names=dict(self.names))
        return times(Columns(table, mapping), Clock(column, self.unit, self.expression), 0)

    def epoch_s(self, table: Table) -> int | None:
        """Unix time of time zero, where the columns tell Unix time."""
        seconds = self.seconds(table)
        if not float(np.nanmedian(seconds)) > _UNIX_S:
            return None
        return 0 if self.rate_Hz is None else int(np.nanmin(seconds))

    def doubt(self, table: Table) -> str | None:
        """What cannot be true of these instants."""
        if self.rate_Hz is not None:
            return None
        seconds = self.seconds(table)
        steps = np.diff(seconds[np.isfinite(seconds)])
        if 10 * int(np.sum(steps == 0.0)) > steps.size:
            return f"{table.file}: time '{self.column}': many stamps repeat the one before, expected one per row, or time: {{rate_Hz: ...}}"
        if steps.size and float(steps.sum()) <= 0.0:
            back = f"ends {-float(steps.sum()):.3g} s before it begins, expected it to rise (over midnight?)"
            return f"{table.file}: time '{self.column}': {back}"
        rate = 1.0 / _step(seconds)
        if not _can_be(rate):
            expected = f"expected {_RATES_HZ[0]:g} to {_RATES_HZ[1]:g}: is it a time, and the unit right?"
            return f"{table.file}: time '{self.column}' in {self.unit}: makes {rate:.3g} samples per second, {expected}"
        lost = unusable(seconds[np.isfinite(seconds)]) - int(np.sum(steps == 0.0))
        if lost > _LOST * steps.size:
            back = f"runs back, after which {lost} of {steps.size + 1} samples are of no use"
            return f"{table.file}: time '{self.column}': {back}, expected it to rise: split the file there, or time: {{rate_Hz: ...}}"
        return None


def clocks(table: Table) -> list[ClockGuess]:
    """Two columns that are a time together, and time columns by their name; else the first column that only rises."""
    joined = _joined(table)
    taken = {column for clock in joined for column in clock.columns()}
    fit = [name for name in table.columns if name not in taken and unfit(table, name, ("time",)) is None]
    named = [name for name in fit if is_named(name) and _advances(table, name)]
    if joined or named:
        shorts = ["count", *(f"count_{i}" for i in range(2, len(named) + 1))]
        return joined + [_clock(table, name, "named so", short) for name, short in zip(named, shorts, strict=False)]
    other = ("angle", "rate", "pressure", "torque", "temperature")
    unnamed = [name for name in fit if not any(tells(name, kind) for kind in other)]
    rising = [name for name in unnamed if _rises(table.columns[name]) and not counts(table.columns[name])]
    return [_clock(table, name, "GUESSED: the first column that only rises", "count") for name in rising[:1]]


def is_named(name: str) -> bool:
    """Whether a column is called a time."""
    return tells(name, "time") and not any(tells(name, kind) for kind in ("command", "state", "temperature", "air"))


def counts(values: Array) -> bool:
    """Whether a column numbers the rows."""
    return values.size > 1 and bool(np.all(np.diff(values) == 1.0))


def _rises(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return known.size >= FEW and float(np.mean(np.diff(known) > 0.0)) > 0.9


def _advances(table: Table, name: str) -> bool:
    """Rises, or is called more than t and stands still between its steps: few, where a unit of time is stated."""
    known = table.columns[name][np.isfinite(table.columns[name])]
    if _rises(known) or known.size < FEW:
        return known.size >= FEW
    plain = words_of(name) == ["t"] or any(word in WORDS["time"] and word != "t" for word in words_of(name))
    enough = np.unique(known).size >= (FEW if stated(table, name, ("time",)) is None else 2)
    return plain and enough and bool(known[-1] > known[0]) and float(np.mean(np.diff(known) >= 0.0)) > 0.9


def _step(values: Array) -> float:
    steps = np.diff(values[np.isfinite(values)])
    return float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else float("nan")


def _clock(table: Table, name: str, how: str, short: str) -> ClockGuess:
    """By the unit that is stated, else by the numbers; ``short``: what expressions call the column."""
    values = table.columns[name][np.isfinite(table.columns[name])]
    step, middle = _step(values), float(np.median(values))
    unit = stated(table, name, ("time",))
    unix = [unit for unit in _UNITS if _in_our_days(middle * READABLE_UNITS[unit][1])]
    counted = [way for way in _COUNTED if _in_our_days(way[0] * (middle - way[1])) and _can_be(1.0 / (step * way[0]))]
    if unit is not None:
        guess = ClockGuess(name, unit, f"{how}; unit as stated")
    elif unix:
        guess = ClockGuess(name, unix[0], f"{how}; as Unix time it lies in our days")
    elif counted:
        length, begin, what = counted[0]
        why = f"{how}; {what}: {_rate(step * length, 's')}"
        guess = ClockGuess(name, "s", why, f"{length:g} * ({short} - {begin})", {short: name})
    elif 1.0 / step > _RATES_HZ[1] and values.min() >= 0.0 and values.max() <= 1.0:
        why = f"{how}; GUESSED: parts of a day, as spreadsheets keep times: {_rate(step, 'd')}; if not, then h"
        guess = ClockGuess(name, "d", why)
    else:
        unit = "s" if step < 0.5 else "ms" if step < 500.0 else "us" if step < 1e5 else "ns"
        others = [other for other in _UNITS if other != unit and _can_be(1.0 / (step * READABLE_UNITS[other][1]))]
        sure, doubt = ("GUESSED: ", f"; if not, then {others[0]}") if others else ("", "")
        guess = ClockGuess(name, unit, f"{how}; {sure}steps of {step:.3g}: {_rate(step, unit)}{doubt}")
    return _noted(table, guess)


def _in_our_days(unix_s: float) -> bool:
    return _OUR_DAYS_S[0] < unix_s < _OUR_DAYS_S[1]


def _can_be(rate_Hz: float) -> bool:
    return _RATES_HZ[0] <= rate_Hz <= _RATES_HZ[1]


def _rate(step: float, unit: str) -> str:
    return f"{1.0 / (step * READABLE_UNITS[unit][1]):.4g} samples per second"


def _noted(table: Table, guess: ClockGuess) -> ClockGuess:
    """What is odd about the stamps, and a rate in place of those that many rows share."""
    seconds = guess.seconds(table)
    steps = np.diff(seconds[np.isfinite(seconds)])
    repeated, back = int(np.sum(steps == 0.0)), steps[steps < 0.0]
    why = guess.why + (f"; goes back {back.size} times, by up to {-back.min():.3g} s" if back.size else "")
    if 10 * repeated <= steps.size:
        return replace(guess, why=why)
    rate = _rate_of(seconds[np.isfinite(seconds)])
    evenly = f": GUESSED {rate:g} rows per second, evenly apart" if rate else ""
    why += f"; {repeated} of {steps.size + 1} stamps repeat the one before{evenly}"
    return replace(guess, why=why, rate_Hz=rate)


def _rate_of(seconds: Array) -> float | None:
    """Rows per second, where about as many share each stamp and none goes back."""
    first = np.flatnonzero(np.diff(seconds) != 0.0) + 1
    rows = np.diff(first)
    if not rows.size or np.any(np.diff(seconds) < 0.0):
        return None
    if float(np.mean(np.abs(rows - np.median(rows)) <= 1.0 + 0.1 * np.median(rows))) < 0.9:
        return None
    return float(f"{float(np.sum(rows)) / float(seconds[first[-1]] - seconds[first[0]]):.4g}")


def _joined(table: Table) -> list[ClockGuess]:
    """Whole seconds beside nanoseconds ('stamp.sec', 'stamp.nanosec'), and days beside times of the day."""
    found: list[ClockGuess] = []
    for other, nanoseconds in table.columns.items():
        ending = _NANOSECONDS.search(other)
        wanted = [other[: ending.start()] + word for word in _SECONDS] if ending else []
        for name in (name for name in wanted if name in table.columns):
            if table.columns[name].size == nanoseconds.size and _all_within(nanoseconds, 1e9) and _whole(table.columns[name], 1.0):
                turn = f"_{len(found) + 1}" if found else ""
                names = {f"sec{turn}": name, f"nsec{turn}": other}
                why = "seconds and nanoseconds of one clock"
                found.append(_noted(table, ClockGuess(name, "s", why, f"sec{turn} + 1e-9 * nsec{turn}", names)))
    return found or _day_and_time(table)


def _day_and_time(table: Table) -> list[ClockGuess]:
    named = {name: values for name, values in table.columns.items() if is_named(name) and _all_within(values, np.inf)}
    days = [name for name, values in named.items() if _whole(values, _DAY_S) and values.min() > _UNIX_S]
    for day in days[:1]:
        same = [name for name, values in named.items() if values.size == named[day].size and _all_within(values, _DAY_S)]
        for name in same[:1]:
            why = "days, and beside them the time of the day"
            return [_noted(table, ClockGuess(name, "s", why, "day + clock", {"day": day, "clock": name}))]
    return []


def _all_within(values: Array, end: float) -> bool:
    known = values[np.isfinite(values)]
    return known.size >= FEW and bool(np.all((known >= 0.0) & (known < end)))


def _whole(values: Array, step: float) -> bool:
    known = values[np.isfinite(values)]
    return known.size >= FEW and bool(np.all(known % step == 0.0))
