# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A first import map for an unknown table: channels and units guessed from names and numbers, each with its reason."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lugre_steering.errors import LugreSteeringError, MapFileError
from lugre_steering.importing.channels import read_channels
from lugre_steering.importing.clocks import FEW, ClockGuess, clocks, counts, is_named
from lugre_steering.importing.evaluate import signed
from lugre_steering.importing.map import DIMENSIONS, READABLE_UNITS, SCHEMA, Csv, load_map, to_si
from lugre_steering.importing.plausible import check_units
from lugre_steering.importing.read import FORMATS, read_table
from lugre_steering.importing.sniff import sniff
from lugre_steering.importing.stated import stated, unfit
from lugre_steering.importing.table import Table
from lugre_steering.importing.words import WORDS, parts_of, remark_in, side_alone, spaced, tells, unit_in, words_of
from lugre_steering.importing.write import header_stamps
from lugre_steering.provenance import hashed, provenance
from lugre_steering.recording import Array

_PRESSURE = "|".join(sorted(WORDS["pressure"]))
_OF_PRESSURE, _PRESSURE_OF = re.compile(rf"^(?:{_PRESSURE})_(?=[a-z]{{2}})"), re.compile(rf"(?<=[a-z_][a-z])_(?:{_PRESSURE})$")
_CONTAINERS = ("data", "fluid_pressure", "samples", "signals", "value", "values")
"""Parts of paths that name nothing."""
_STROKE = "a length in {}: by 'pivots' or a 'polynomial' an angle, on a linear axis the angle itself"
_AIR_DEGC = 60.0
"""Hottest, and coldest below zero, that air is."""
_FOLLOWS = 0.9
"""Correlation of the sum of a rate over time with an angle, from which it is the rate of this angle."""


@dataclass(frozen=True)
class Guess:
    """What a column is taken for, and why."""

    key: str
    column: str
    unit: str
    why: str
    time: ClockGuess | None = None


def propose(file: Path, map_file: Path) -> dict[str, Any]:
    """Write a map for ``file``; returns what was guessed, what was not used, and whether the map works."""
    options, reasons = Csv(), list[str]()
    if file.is_file() and file.suffix.lower() not in FORMATS:
        options, reasons = sniff(file)
        options, more = _allowances(file, options)
        reasons += more
    table = read_table(file, options)
    bits_of = {name: bits for name, values in table.columns.items() if (bits := _signed_bits(values))}
    as_meant = {name: signed(table.columns[name], bits, name) for name, bits in bits_of.items()}
    table = replace(table, columns={**table.columns, **as_meant})
    times = clocks(table)
    guesses, unused = _channels(table, times)
    text = _map_text(file, options, reasons, times, guesses, unused, bits_of, table)
    try:
        with map_file.open("x", encoding="utf-8") as stream:
            stream.write(text)
    except FileExistsError:
        raise MapFileError(f"{map_file}: exists already; name another with --map") from None
    return {
        "table": str(file),
        "map": str(map_file),
        "format": reasons,
        "clocks": [asdict(clock) for clock in times],
        "channels": [asdict(guess) | {"time": guess.time.column if guess.time else None} for guess in guesses],
        "signed": bits_of,
        "unused": unused,
        "problem": _problem(file, map_file) or next(filter(None, (clock.doubt(table) for clock in times)), None),
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
        channels = read_channels(read_table(file, mapping.csv), mapping)
        check_units(file, mapping, channels)
        for channel in channels.values():
            header_stamps(file, map_file, mapping, channel)
    except LugreSteeringError as error:
        return str(error)
    return None


def _clock_of(table: Table, times: Sequence[ClockGuess], name: str) -> ClockGuess | None:
    """The clock next to the left among those of the same length."""
    order = list(table.columns)
    fitting = [clock for clock in times if table.columns[clock.column].size == table.columns[name].size]
    left = [clock for clock in fitting if order.index(clock.column) < order.index(name)]
    return left[-1] if left else fitting[0] if fitting else None


# ------------------------------------------------------------- channels


def _channels(table: Table, times: Sequence[ClockGuess]) -> tuple[list[Guess], list[dict[str, str]]]:
    """Guesses by channel, and the columns that are none."""
    taken: dict[str, Guess] = {}
    unused = [{"column": name, "why": why} for name, why in table.unusable.items()]
    of_time = {column for clock in times for column in clock.columns()}
    kinds = {name: _kind(table, name) for name in table.columns if name not in of_time}
    # What tells a side, and the most of an angle, before what may be of anything; a side alone after all quantities.
    of_angle = {name: sum(word in WORDS["angle"] for word in words_of(name)) for name in kinds}
    ordered = sorted(kinds, key=lambda name: (kinds[name] is None, _side(name) is None, -of_angle[name]))
    for rates in (False, True):  # rates after the angles they belong to
        chosen: dict[str, tuple[str, str]] = {}
        for name in (name for name in ordered if (kinds[name] == "rate") is rates):
            key, why = _key(table, name)
            if key is not None and (obstacle := _obstacle(table, name, key, chosen, taken)):
                key, why = None, obstacle
            if key is None:
                unused.append({"column": name, "why": f"{why}; {_span(table.columns[name])}"})
            else:
                chosen[key] = name, why
        for key, (name, why) in chosen.items():
            alike = [other for of, (other, _) in chosen.items() if of.partition("/")[0] == key.partition("/")[0]]
            unit, reason = _unit(table, name, key, alike, taken)
            if "GUESSED" in reason and (remark := remark_in(name)) is not None:
                reason += f"; what '{remark}' says is not known"
            taken[key] = Guess(key, name, unit, f"{why}; {reason}", _clock_of(table, times, name))
    return sorted(taken.values(), key=lambda guess: list(kinds).index(guess.column)), unused


def _obstacle(
    table: Table, name: str, key: str, chosen: Mapping[str, tuple[str, str]], taken: Mapping[str, Guess]
) -> str | None:
    """Why a channel cannot be had from one more column."""
    if key in chosen:
        return f"may be {key} too, as '{chosen[key][0]}'"
    kind, _, side = key.partition("/")
    if kind == "angle" and _side(name) is None and "angle/right" in chosen:
        return f"of no side, while '{chosen['angle/right'][0]}' is of the right"
    dimensions, angle = DIMENSIONS[kind], taken.get(f"angle/{side}")
    if kind == "rate":
        if angle is None:
            return "a rate without its angle"
        dimensions = ("speed",) if READABLE_UNITS[angle.unit][0] == "length" else ("angular speed",)
    fitting = stated(table, name, dimensions)
    if fitting is None and (text := unfit(table, name, dimensions) or stated(table, name, DIMENSIONS[kind])):
        return f"may be {key}, but it is stated in '{text}', which is none of its units: give scale and unit"
    return None if angle is None else _rate_obstacle(table, name, angle, fitting, dimensions)


def _rate_obstacle(table: Table, name: str, angle: Guess, unit: str | None, dimensions: tuple[str, ...]) -> str | None:
    """Why a column is not the rate of an angle: of no side it must follow the angle, and without a ``unit`` have a known one."""
    if unit is not None and _side(name) is not None:
        return None
    ratio = _summed(table, name, angle)
    if ratio is None:
        return None if _side(name) else f"a rate of no side, and its sum over time does not follow '{angle.column}'"
    if unit is not None or angle.time is None or _rate_units(ratio, dimensions):
        return None
    return f"its sum over time is {ratio:.3g} times '{angle.column}' in SI, as in no unit known: give scale and unit"


def _side(name: str) -> str | None:
    return next((side for side in ("left", "right") if tells(name, side)), None)


def _kind(table: Table, name: str) -> str | None:
    """What a column holds, by its words, else by its unit."""
    if tells(name, "command") or tells(name, "state"):
        return "command"
    if tells(name, "temperature"):
        return "air_temperature" if tells(name, "air") else "temperature"
    for kind in ("rate", "torque", "pressure", "angle"):
        if tells(name, kind):
            return kind
    dimension = READABLE_UNITS[unit][0] if (unit := stated(table, name, None)) else None
    if tells(name, "air") and (dimension == "temperature" or (dimension is None and _is_air(table, name))):
        return "air_temperature"
    if dimension == "angle" and _side(name) is None:  # headings and latitudes are in deg as well
        return None
    by_unit = {"angle": "angle", "angular speed": "rate", "pressure": "pressure", "torque": "torque", "force": "torque"}
    return by_unit.get(dimension or "")


def _is_air(table: Table, name: str) -> bool:
    """Whether a column that says nothing but air holds what the temperature of air can be."""
    values = table.columns[name][np.isfinite(table.columns[name])]
    return set(words_of(name)) <= WORDS["air"] and bool(values.size) and bool(np.all(np.abs(values) < _AIR_DEGC))


def _line(name: str) -> str:
    """The pressure line that a name tells, as vehicle files call it: main_a of 'p main A', 'pressure_main_a', 'PressMainA'."""
    parts = parts_of(name)
    told = [part for part in parts if part.strip().lower() not in _CONTAINERS] or parts[-1:]
    first = max((place for place, part in enumerate(told) if tells(part, "pressure")), default=len(told) - 1)
    plain = " ".join(told[first:]).strip()
    if READABLE_UNITS[unit_in(plain) or "s"][0] == "pressure":  # 'p_left_cap_bar' is the line left_cap
        plain = re.sub(r"[\s_]+[^\W_]+$", "", plain)
    line = re.sub(r"\W+", "_", spaced(plain), flags=re.ASCII).strip("_").lower()
    return _PRESSURE_OF.sub("", _OF_PRESSURE.sub("", line))


def _key(table: Table, name: str) -> tuple[str | None, str]:
    """The channel of a column, with the reason, or why it is none."""
    kind = _kind(table, name)
    if np.isfinite(table.columns[name]).sum() < FEW:
        return None, "hardly any numbers"
    if kind in ("angle", "rate"):
        length = kind == "angle" and stated(table, name, ("angle",)) is None and stated(table, name, ("length",))
        if length and not _is_linear(table, name):
            return None, _STROKE.format(length)
        side = _side(name)
        return f"{kind}/{side or 'left'}", f"the name tells of {kind}" + ("" if side else ", of no side: called left")
    if kind == "pressure":
        line = _line(name)
        return f"pressure/{line if line[:1].isalpha() else f'line_{line}'}", "the name or unit tells of pressure"
    if kind == "torque":
        return "measured_torque", "the name or unit tells of torque or force"
    if kind == "air_temperature":
        said = tells(name, "temperature") or stated(table, name, ("temperature",)) is not None
        return kind, "the name tells of air temperature" if said else "the name tells of air: GUESSED to be its temperature in degC"
    if kind is None and (side := side_alone(name)) is not None:
        return f"angle/{side}", "named by its side alone: GUESSED to be the angle"
    if kind is None and is_named(name):
        text = unfit(table, name, ("time",))
        return None, f"called a time, but {f'stated in {text!r}, no unit of time known' if text else 'it does not rise as one'}"
    if kind is None and counts(table.columns[name]):
        return None, "counts the rows: as a time it needs their rate"
    none = {"command": "a command or state, nothing measured", "temperature": "a temperature, but not said to be of the air"}
    if kind is None and (unit := stated(table, name, ("length",))) is not None:
        return None, _STROKE.format(unit)
    if kind is None and (unit := stated(table, name, ("angle",))) is not None:
        return None, f"in {unit}, but the name tells neither of an angle nor of a side"
    return None, none.get(kind or "", "the name tells nothing known")


def _is_linear(table: Table, name: str) -> bool:
    """Whether a column is the position of a linear axis: such a file holds a force."""
    of_force = (other for other in table.columns if tells(other, "force") or stated(table, other, ("force",)))
    return tells(name, "position") and any(of_force)


def _unit(table: Table, name: str, key: str, alike: Sequence[str], taken: Mapping[str, Guess]) -> tuple[str, str]:
    """Unit and reason; a guessed one is that of the columns ``alike``, of the same kind: stated, or of the largest numbers."""
    kind, _, side = key.partition("/")
    unit = stated(table, name, DIMENSIONS[kind])
    if unit is not None:
        return unit, "unit as stated"
    if kind == "rate":
        return _rate_unit(table, name, taken[f"angle/{side}"])
    unit, reason = _unit_of_range(table, name, kind)
    of_others = {other: stated(table, other, DIMENSIONS[kind]) for other in alike}
    like = min(alike, key=lambda other: (of_others[other] is None, -_most(table, other)))
    shared = of_others[like] or _unit_of_range(table, like, kind)[0]
    return (unit, reason) if unit == shared else (shared, f"GUESSED: as '{like}'; if not, then {unit}")


def _unit_of_range(table: Table, name: str, kind: str) -> tuple[str, str]:
    """Unit and reason by the numbers of one column."""
    most, values = _most(table, name), table.columns[name][np.isfinite(table.columns[name])]
    if kind == "angle":
        return _axis_unit(most) if _is_linear(table, name) else _angle_unit(values, most)
    if kind == "pressure":
        return _pressure_unit(most)
    if kind == "measured_torque":
        unit = "N" if tells(name, "force") else "N m"
        return unit, f"GUESSED: up to {most:.3g}, no unit known is stated"
    kelvin = float(np.median(values)) > 150.0
    return ("K", f"{most:.0f} can only be K") if kelvin else ("degC", f"GUESSED: up to {most:.3g}; if not, then degF")


def _most(table: Table, name: str) -> float:
    """Below so much lie all magnitudes but for outliers."""
    return float(np.quantile(np.abs(table.columns[name][np.isfinite(table.columns[name])]), 0.99))


def _axis_unit(most: float) -> tuple[str, str]:
    unit = "mm" if most > 5.0 else "m"
    return unit, f"GUESSED: up to {most:.4g} and a force in the file, so a linear axis; if not, then {'deg' if unit == 'mm' else 'rad'}"


def _angle_unit(values: Array, most: float) -> tuple[str, str]:
    if most <= 2.0 * np.pi:
        return "rad", f"GUESSED: up to {most:.3g}; as deg it would travel {np.ptp(values):.2g} deg only. A linear axis would be m"
    if most <= 360.0 or np.any(values != np.round(values)):
        return "deg", f"up to {most:.4g}: radians would be more than a turn"
    unit = "0.1 deg" if most <= 1800.0 else "0.01 deg"
    return unit, f"GUESSED: whole numbers up to {most:.4g}: deg would be more than a turn"


def _rate_unit(table: Table, name: str, angle: Guess) -> tuple[str, str]:
    """By the sum over time: 57 times the angle where one is in deg and the other in rad."""
    linear = READABLE_UNITS[angle.unit][0] == "length"
    ratio = _summed(table, name, angle) if angle.time is not None else None
    if ratio is None:
        small = "mm/s" if angle.unit == "mm" else "deg/s" if angle.unit.endswith("deg") else None
        return small or ("m/s" if linear else "rad/s"), f"GUESSED, as the angle is in {angle.unit}"
    return _rate_units(ratio, ("speed",) if linear else ("angular speed",))[0], f"its sum over time is {ratio:.3g} times the angle in SI"


def _rate_units(ratio: float, dimensions: tuple[str, ...]) -> list[str]:
    """Units in which a rate is that of an angle of which its sum over time is ``ratio`` times as much."""
    factors = {unit: factor for unit, (dimension, factor, _) in READABLE_UNITS.items() if dimension in dimensions}
    return [unit for unit, factor in factors.items() if abs(ratio * factor - 1.0) < 0.2]


def _summed(table: Table, name: str, angle: Guess) -> float | None:
    """How many times an angle [SI] the sum of a rate over time is, nothing where it does not follow the angle; without a
    time the rows are counted."""
    value, rate = to_si(table.columns[angle.column], angle.unit), table.columns[name]
    time = np.arange(float(value.size)) if angle.time is None else angle.time.seconds(table)
    if not time.size == value.size == rate.size:
        return None
    known = np.isfinite(time) & np.isfinite(value) & np.isfinite(rate)
    if known.sum() < FEW:
        return None
    turned = value[known] - value[known].mean()
    summed = np.concatenate([[0.0], np.cumsum(0.5 * (rate[known][1:] + rate[known][:-1]) * np.diff(time[known]))])
    summed -= summed.mean()
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows follows nothing
        both, alone, squared = abs(float(summed @ turned)), float(turned @ turned), float(summed @ summed)
    return both / alone if both > _FOLLOWS * math.sqrt(alone * squared) else None


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
            return bits if low >= FEW and high >= FEW and not between.any() else None
    return None


def _span(values: Array) -> str:
    known = values[np.isfinite(values)]
    return f"{known.min():.4g} ... {known.max():.4g}" if known.size else "no numbers"


# ------------------------------------------------------------- the file


def _map_text(
    file: Path,
    options: Csv,
    reasons: Sequence[str],
    times: Sequence[ClockGuess],
    guesses: Sequence[Guess],
    unused: Sequence[Mapping[str, str]],
    bits_of: Mapping[str, int],
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
    if times:
        lines.append(f"time: {_flow(times[0].source())}  # {_flat(times[0].why)}")
        if (epoch := times[0].epoch_s(table)) is not None:
            lines.append(f"epoch_s: {epoch}  # the time is Unix time{' of the first row' if epoch else ' already'}")
        if names := {short: name for clock in times if clock.rate_Hz is None for short, name in clock.names.items()}:
            lines.append(f"names: {_flow(names)}")
    else:
        lines.append("# time: {rate_Hz: 100}  # no column rises like a time: give the samples per second")
    if bits_of:
        lines.append(f"signed: {_flow(bits_of)}  # whole numbers near zero and near the largest, nothing between")
    lines.append("channels:" if guesses else "channels: {}  # none guessed: choose from the columns below")
    for guess in guesses:
        source: dict[str, Any] = {"column": guess.column, "unit": guess.unit}
        if guess.time is not None and guess.time != times[0]:
            source["time"] = guess.time.source()
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
