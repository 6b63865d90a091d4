# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether two trees say the same: replays and diagnoses of one keeps, those of the other compares.

``--keep FOLDER`` simulates recordings, writes them there as bags and keeps every number of their replays and diagnoses;
``--against FOLDER``, by the other tree, repeats both from these bags and prints the largest relative difference of each quantity.
Leaves with 1 where one is above the limit, or where anything that is no number differs.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.diagnosis.library import diagnose
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import DataError, LugreSteeringError
from lugre_steering.files import output_folder, read_record, write_record
from lugre_steering.replay.library import replay
from lugre_steering.resources import config_folder
from lugre_steering.serialise import as_json, finite
from lugre_steering.simulate.library import simulate
from lugre_steering.vehicle import load

SCHEMA = "lugre_steering/same/1"
RECORD = "same.json"
RATE_HZ = 20.0
LIMIT = 1e-9
ASIDE = ("provenance", "bag", "bags.bag", "vehicle", "vehicle_file")
"""How and from where, which two runs may differ in."""
Leaf = tuple[str, Any]
Numbers = Mapping[str, Mapping[str, Sequence[Any]]]
"""Leaves by case and quantity."""


def cases(count: int) -> list[str]:
    """What acts in each recording: nothing, then an effect of the catalogue at its typical size, spread over its stages."""
    acting = [effect for effect in CATALOGUE.values() if effect.hooks and not effect.per_line]
    chosen = [acting[k * len(acting) // max(count - 1, 1)] for k in range(count - 1)]
    return ["", *(f"{one.id}:" + ",".join(f"{p.name}={p.typical!r}" for p in one.parameters) for one in chosen)]


def write_bags(folder: Path, count: int) -> list[Path]:
    """The recordings, as bags."""
    bags = []
    for number, effect in enumerate(cases(count)):
        made = simulate(
            "double-cycle", effects=[effect] if effect else [], angle_rate_Hz=RATE_HZ, pressure_rate_Hz=RATE_HZ, seed=number
        )  # fmt: skip
        bags.append(Path(str(made.save(folder / f"{number:02d}").bag)))
    return bags


def told(bag: Path) -> dict[str, list[Any]]:
    """All that replay and diagnosis say of a bag, by quantity: the place in their results without the numbers of list entries."""
    vehicle = load(config_folder() / "test_vehicle.yaml")
    replayed = replay(bag, vehicle)
    series = replayed.bags[0].kept()
    found: dict[str, list[Any]] = defaultdict(list)
    for what, tree in (("replay", {**replayed.json, "series": vars(series)}), ("diagnosis", diagnose(bag, vehicle).json)):
        for place, value in leaves(tree):
            if not any(place == aside or place.startswith(f"{aside}.") for aside in ASIDE):
                found[f"{what} {place}"].append(value)
    return dict(found)


def leaves(tree: Any, place: str = "") -> Iterator[Leaf]:
    """Every value of plain data with its place."""
    if isinstance(tree, Mapping):
        for name, item in tree.items():
            yield from leaves(item, f"{place}.{name}" if place else str(name))
    elif isinstance(tree, (list, tuple, np.ndarray)):
        for item in tree:
            yield from leaves(item, place)
    else:
        yield place, finite(tree)


def difference(one: Sequence[Any], other: Sequence[Any]) -> float | None:
    """Largest difference over the largest value of a quantity in one case; None where it is no number that differs, or one is missing."""
    scale = max((abs(value) for value in (*one, *other) if _is_number(value)), default=0.0)
    largest = 0.0
    for a, b in zip_longest(one, other):
        if a == b:
            continue
        if not (_is_number(a) and _is_number(b)):
            return None
        largest = max(largest, abs(a - b) / scale)
    return largest


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def compared(kept: Numbers, now: Numbers) -> dict[str, float | None]:
    """By quantity that was kept the largest difference over all cases, None where one of them has none in numbers.

    What only the newer tree says is no difference: keys are added, never taken away.
    """
    found: dict[str, float | None] = {}
    for case, one in kept.items():
        for quantity, values in one.items():
            size = difference(values, now.get(case, {}).get(quantity, ()))
            before = found.get(quantity, 0.0)
            found[quantity] = None if size is None or before is None else max(before, size)
    return found


def run(argv: Sequence[str]) -> None:
    """Command line of this benchmark."""
    parser = argparse.ArgumentParser(prog="python -m lugre_steering.bench same", description=__doc__)
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="write recordings and all that is said of them there")
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="compare with what stands there")
    parser.add_argument("--cases", type=int, default=10, help="recordings to make [10]")
    parser.add_argument("--limit", type=float, default=LIMIT, help="largest relative difference [1e-9]")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    options = parser.parse_args(argv)
    if (options.keep is None) == (options.against is None):
        parser.error("compares two trees; expected one of --keep FOLDER and --against FOLDER")
    try:
        if options.keep is not None:
            keep(options.keep, options.cases)
            return
        found = against(options.against)
    except LugreSteeringError as error:
        print(f"same: {error}", file=sys.stderr)
        sys.exit(2)
    apart = {name: size for name, size in found.items() if size is None or size > options.limit}
    if options.json:
        print(as_json({"limit": options.limit, "quantities": found, "apart": sorted(apart)}))
    else:
        for name in sorted(found, key=lambda name: (found[name] is not None, -(found[name] or 0.0), name)):
            print(f"{'differs' if found[name] is None else format(found[name], '.1e'):>8s}  {name}")
        print(f"{len(found)} quantities, {len(apart)} of them apart by more than {options.limit:g}")
    if apart:
        sys.exit(1)


def keep(folder: Path, count: int) -> None:
    """Make the recordings and keep what is said of them; ``DataError`` if anything is there."""
    if folder.exists() and any(folder.iterdir()):
        raise DataError(f"{folder}: is not empty; expected a new folder for --keep")
    with output_folder(folder):
        numbers = {str(bag.relative_to(folder)): told(bag) for bag in write_bags(folder, count)}
        write_record({"schema": SCHEMA, "told": numbers}, folder / RECORD)
    print(f"{count} recordings and what is said of them in {folder}")


def against(folder: Path) -> dict[str, float | None]:
    """The differences to what was kept, by quantity."""
    record = read_record(folder / RECORD, SCHEMA)
    if record is None:
        raise DataError(f"{folder}: holds no {RECORD} of --keep")
    kept: Numbers = record["told"]
    return compared(kept, {bag: told(folder / bag) for bag in kept})
