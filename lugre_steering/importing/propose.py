# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A first import map for an unknown table: channels and units guessed from names and numbers, each with its reason."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lugre_steering.errors import LugreSteeringError, MapFileError
from lugre_steering.importing.channels import read_channels
from lugre_steering.importing.map import DIMENSIONS, READABLE_UNITS, SCHEMA, Csv, load_map
from lugre_steering.importing.plausible import DEGREES, check_units
from lugre_steering.importing.read import FORMATS, read_table
from lugre_steering.importing.sniff import sniff
from lugre_steering.importing.table import Table
from lugre_steering.importing.words import WORDS, tells, unit_in
from lugre_steering.provenance import hashed, provenance
from lugre_steering.recording import Array

_FEW = 5
_UNIX = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"), (1e8, "s"))
"""Above so much a time counts from 1970, in this unit."""
_OF_PRESSURE = re.compile(rf"^(?:{'|'.join(WORDS['pressure'])})_(?=[a-z]{{2}})")


@dataclass(frozen=True)
class Guess:
    """What a column is taken for, and why."""

    key: str
    column: str
    unit: str
    why: str
    time: str | None = None


def propose(file: Path, map_file: Path) -> dict[str, Any]:
    """Write a map for ``file``; returns what was guessed, what was not used, and whether the map works."""
    options, reasons = Csv(), list[str]()
    if file.is_file() and file.suffix.lower() not in FORMATS:
        options, reasons = sniff(file)
        options, more = _allowances(file, options)
        reasons += more
    table = read_table(file, options)
    clocks = _clocks(table)
    guesses, unused = _channels(table, clocks)
    signed = {name: bits for name, values in table.columns.items() if (bits := _signed_bits(values))}
    text = _map_text(file, options, reasons, clocks, guesses, unused, signed, table)
    try:
        with map_file.open("x", encoding="utf-8") as stream:
            stream.write(text)
    except FileExistsError:
        raise MapFileError(f"{map_file}: exists already; name another with --map") from None
    return {
        "table": str(file),
        "map": str(map_file),
        "format": reasons,
        "clocks": [asdict(clock) for clock in clocks],
        "channels": [asdict(guess) for guess in guesses],
        "signed": signed,
        "unused": unused,
        "problem": _problem(file, map_file),
    }


def _allowances(file: Path, options: Csv) -> tuple[Csv, list[str]]:
    """What the rows need to be read at all."""
    table = read_table(file, replace(options, allow=("short_rows", "text_rows")))
    allow = tuple(
        what for what, sign in (("short_rows", "short rows"), ("text_rows", "without a number"))
        if any(sign in counted for counted in table.left_out)
    )  # fmt: skip
    return replace(options, allow=allow), [f"{count} {what}" for what, count in table.left_out.items()]


def _problem(file: Path, map_file: Path) -> str | None:
    """What still keeps the map from working."""
    try:
        mapping = load_map(map_file)
        check_units(file, mapping, read_channels(read_table(file, mapping.csv), mapping))
    except LugreSteeringError as error:
        return str(error)
    return None


# --------------------------------------------------------------- clocks


def _clocks(table: Table) -> list[Guess]:
    """Time columns: by their name, else the first column that only rises."""
    rising = [name for name, values in table.columns.items() if _rises(values)]
    named = [name for name in rising if tells(name, "time") and not tells(name, "command")]
    return [_clock(table, name, name in named) for name in named or rising[:1]]


def _rises(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return known.size >= _FEW and float(np.mean(np.diff(known) > 0.0)) > 0.9


def _clock(table: Table, name: str, named: bool) -> Guess:
    values = table.columns[name][np.isfinite(table.columns[name])]
    step = float(np.median(np.diff(values)))
    how = "named so" if named else "the first column that only rises"
    unit = _stated(table, name, ("time",))
    unix = next((unit for least, unit in _UNIX if float(np.median(values)) > least), None)
    if unit is not None:
        why = "unit as stated"
    elif unix is not None:
        unit, why = unix, "as Unix time it lies in our days"
    else:
        unit = "s" if step < 0.5 else "ms" if step < 500.0 else "us" if step < 1e5 else "ns"
        why = f"steps of {step:.3g}: {_rate(step, unit)}"
    return Guess("time", name, unit, f"{how}; {why}")


def _rate(step: float, unit: str) -> str:
    return f"{1.0 / (step * READABLE_UNITS[unit][1]):.4g} samples per second"


def _unix(table: Table, clock: Guess) -> bool:
    seconds = np.nanmedian(table.columns[clock.column]) * READABLE_UNITS[clock.unit][1]
    return bool(seconds > _UNIX[-1][0])


def _clock_of(table: Table, clocks: Sequence[Guess], name: str) -> str | None:
    """The time column next to the left among those of the same length."""
    order = list(table.columns)
    fitting = [clock.column for clock in clocks if table.columns[clock.column].size == table.columns[name].size]
    left = [column for column in fitting if order.index(column) < order.index(name)]
    return left[-1] if left else fitting[0] if fitting else None


# ------------------------------------------------------------- channels


def _channels(table: Table, clocks: Sequence[Guess]) -> tuple[list[Guess], list[dict[str, str]]]:
    """Guesses by channel, and the columns that are none."""
    taken: dict[str, Guess] = {}
    unused = [{"column": name, "why": why} for name, why in table.unusable.items()]
    times = {clock.column for clock in clocks}
    ordered = sorted((name for name in table.columns if name not in times), key=lambda name: _kind(table, name) == "rate")
    for name in ordered:  # rates after the angles they belong to
        key, why = _key(table, name)
        if key is not None and (obstacle := _obstacle(key, taken)):
            key, why = None, obstacle
        if key is None:
            unused.append({"column": name, "why": f"{why}; {_span(table.columns[name])}"})
            continue
        unit, reason = _unit(table, name, key, taken)
        taken[key] = Guess(key, name, unit, f"{why}; {reason}", _clock_of(table, clocks, name))
    return list(taken.values()), unused


def _obstacle(key: str, taken: Mapping[str, Guess]) -> str | None:
    """Why a channel cannot be had from one more column."""
    if key in taken:
        return f"may be {key} too, as '{taken[key].column}'"
    angle = key.replace("rate/", "angle/")
    return None if angle == key or angle in taken else "a rate without its angle"


def _kind(table: Table, name: str) -> str | None:
    """What a column holds, by its words, else by its unit."""
    if tells(name, "command"):
        return "command"
    if tells(name, "temperature"):
        return "air_temperature" if tells(name, "air") else "temperature"
    for kind in ("rate", "torque", "pressure", "angle"):
        if tells(name, kind):
            return kind
    dimension = READABLE_UNITS[unit][0] if (unit := _stated(table, name, None)) else None
    if dimension == "temperature" and tells(name, "air"):
        return "air_temperature"
    by_unit = {"angle": "angle", "angular speed": "rate", "pressure": "pressure", "torque": "torque", "force": "torque"}
    return by_unit.get(dimension or "")


def _key(table: Table, name: str) -> tuple[str | None, str]:
    """The channel of a column, with the reason, or why it is none."""
    kind = _kind(table, name)
    if np.isfinite(table.columns[name]).sum() < _FEW:
        return None, "hardly any numbers"
    if kind in ("angle", "rate"):
        side = next((side for side in ("left", "right") if tells(name, side)), None)
        return f"{kind}/{side or 'left'}", f"the name tells of {kind}" + ("" if side else ", of no side: called left")
    if kind == "pressure":
        plain = re.sub(r"[\[(].*?[\])]", "", name.rsplit(".", 1)[-1]).strip()
        if unit_in(plain) is not None:  # 'p_left_cap_bar' is the line left_cap
            plain = re.sub(r"[\s_]+[^\W_]+$", "", plain)
        line = re.sub(r"\W+", "_", plain, flags=re.ASCII).strip("_").lower()
        line = _OF_PRESSURE.sub("", line)  # 'p main A' and 'pressure_main_a' are the line main_a of a vehicle file
        return f"pressure/{line if line[:1].isalpha() else f'line_{line}'}", "the name or unit tells of pressure"
    if kind == "torque":
        return "measured_torque", "the name or unit tells of torque or force"
    if kind == "air_temperature":
        return kind, "the name tells of air temperature"
    none = {"command": "a command or state, nothing measured", "temperature": "a temperature, but not said to be of the air"}
    if kind is None and (unit := _stated(table, name, ("length",))) is not None:
        return None, f"a length in {unit}: by 'pivots' or a 'polynomial' an angle, on a linear axis the angle itself"
    return None, none.get(kind or "", "the name tells nothing known")


def _stated(table: Table, name: str, dimensions: tuple[str, ...] | None) -> str | None:
    """The unit that the file gives, by a row of units or in the name."""
    for text, whole in (*((title, True) for title in table.titles.get(name, ())), (name, False)):
        unit = unit_in(text, whole)
        if unit is not None and (dimensions is None or READABLE_UNITS[unit][0] in dimensions):
            return unit
    return None


def _unit(table: Table, name: str, key: str, taken: Mapping[str, Guess]) -> tuple[str, str]:
    kind, _, side = key.partition("/")
    stated = _stated(table, name, DIMENSIONS[kind])
    if stated is not None:
        return stated, "unit as stated"
    values = table.columns[name][np.isfinite(table.columns[name])]
    most = float(np.quantile(np.abs(values), 0.99))
    if kind == "angle":
        return _angle_unit(most, float(np.ptp(values)))
    if kind == "rate":
        return _rate_unit(table, name, taken[f"angle/{side}"])
    if kind == "pressure":
        return _pressure_unit(most)
    if kind == "measured_torque":
        unit = "N" if tells(name, "force") else "N m"
        return unit, f"GUESSED: up to {most:.3g}, nothing says more"
    return ("K", f"{most:.0f} can only be K") if float(np.median(values)) > 150.0 else ("degC", f"up to {most:.3g}")


def _angle_unit(most: float, travel: float) -> tuple[str, str]:
    if most > 2.0 * np.pi:
        return "deg", f"up to {most:.4g}: radians would be more than a turn"
    return "rad", f"GUESSED: up to {most:.3g}; as deg it would travel {travel:.2g} deg only. A linear axis would be m"


def _rate_unit(table: Table, name: str, angle: Guess) -> tuple[str, str]:
    """By the slope of the angle over the rate times time: 57 where one is in deg and the other in rad."""
    plain = {"deg": "deg/s", "rad": "rad/s", "mrad": "rad/s", "m": "m/s", "mm": "mm/s", "cm": "m/s"}[angle.unit]
    if angle.time is None or angle.unit not in ("deg", "rad"):
        return plain, f"GUESSED, as the angle is in {angle.unit}"
    time, value, rate = (table.columns[column] for column in (angle.time, angle.column, name))
    if not time.size == value.size == rate.size:
        return plain, f"GUESSED, as the angle is in {angle.unit}"
    known = np.isfinite(time) & np.isfinite(value) & np.isfinite(rate)
    turned = value[known] - value[known].mean()
    seconds = time[known] * (READABLE_UNITS[_clock(table, angle.time, True).unit][1])
    summed = np.concatenate([[0.0], np.cumsum(0.5 * (rate[known][1:] + rate[known][:-1]) * np.diff(seconds))])
    summed -= summed.mean()
    ratio = abs(float(summed @ turned) / float(turned @ turned)) if turned.any() else 0.0
    for factor, other in ((DEGREES, "deg/s"), (1.0 / DEGREES, "rad/s")):
        if abs(ratio / factor - 1.0) < 0.2:
            return other, f"its sum over time is {ratio:.3g} times the angle in {angle.unit}"
    return plain, f"its sum over time is {ratio:.3g} times the angle" if 0.8 < ratio < 1.25 else "GUESSED, as the angle"


def _pressure_unit(most: float) -> tuple[str, str]:
    ranges = ((3e4, "Pa", "kPa"), (1e3, "kPa", "psi"), (60.0, "bar", "psi"), (0.0, "MPa", "bar"))
    unit, other = next((unit, other) for least, unit, other in ranges if most >= least)
    return unit, f"GUESSED: up to {most:.4g}; if not, then {other}"


def _signed_bits(values: Array) -> int | None:
    """Bits of whole numbers that lie near zero and near 2**bits, with nothing between: minus one is written 2**bits - 1."""
    known = values[np.isfinite(values)]
    if not known.size or np.any(known < 0.0) or np.any(known != np.round(known)):
        return None
    for bits in (8, 16, 32):
        full, between = 2.0**bits, (known > 0.25 * 2.0**bits) & (known < 0.75 * 2.0**bits)
        if known.max() < full:
            low, high = np.unique(known[known < 0.25 * full]).size, np.unique(known[known > 0.75 * full]).size
            return bits if low >= _FEW and high >= _FEW and not between.any() else None
    return None


def _span(values: Array) -> str:
    known = values[np.isfinite(values)]
    return f"{known.min():.4g} ... {known.max():.4g}" if known.size else "no numbers"


# ------------------------------------------------------------- the file


def _map_text(
    file: Path,
    options: Csv,
    reasons: Sequence[str],
    clocks: Sequence[Guess],
    guesses: Sequence[Guess],
    unused: Sequence[Mapping[str, str]],
    signed: Mapping[str, int],
    table: Table,
) -> str:
    """The map, with the reasons as comments."""
    lines = [f"# Proposed for {_flat(file.name)}. Check every line: names and units are guesses."]
    lines += [f"# {_flat(line)}" for line in provenance("import --propose", {"table": hashed(file)}).lines()]
    lines.append(f"schema: {SCHEMA}")
    lines += [f"# {_flat(reason)}" for reason in reasons]
    default = asdict(Csv())
    if changed := {key: _plain(value) for key, value in asdict(options).items() if value != default[key]}:
        lines.append(f"csv: {_flow(changed)}")
    if clocks:
        lines.append(f"time: {_flow({'column': clocks[0].column, 'unit': clocks[0].unit})}  # {_flat(clocks[0].why)}")
        if _unix(table, clocks[0]):
            lines.append("epoch_s: 0  # the time is Unix time already")
    else:
        lines.append("# time: {rate_Hz: 100}  # no column rises like a time: give the samples per second")
    if signed:
        lines.append(f"signed: {_flow(signed)}  # whole numbers near zero and near the largest, nothing between")
    lines.append("channels:" if guesses else "channels: {}  # none guessed: choose from the columns below")
    for guess in guesses:
        source: dict[str, Any] = {"column": guess.column, "unit": guess.unit}
        if clocks and guess.time not in (None, clocks[0].column):
            source["time"] = {"column": guess.time, "unit": next(c.unit for c in clocks if c.column == guess.time)}
        lines.append(f"  {guess.key}: {_flow(source)}  # {_flat(guess.why)}")
    if unused:
        lines.append("# Not used:")
        lines += [f"#   {_flat(row['column'])}: {_flat(row['why'])}" for row in unused]
    if table.scalars:
        lines.append("# Single numbers, for expressions and scale_by:")
        lines += [f"#   {_flat(name)} = {value:g}" for name, value in table.scalars.items()]
    return "\n".join(lines) + "\n"


def _plain(value: Any) -> Any:
    """As a map has it: whole numbers without a point, lists."""
    if isinstance(value, float):
        return int(value)
    return list(value) if isinstance(value, tuple) else value


def _flow(content: Mapping[str, Any]) -> str:
    return str(yaml.safe_dump(dict(content), default_flow_style=True, sort_keys=False, width=10**6, allow_unicode=True)).strip()


def _flat(text: str) -> str:
    """One line of printable text: a name from a file must not end the comment it stands in."""
    return "".join(letter if letter.isprintable() else " " for letter in text)[:200]
