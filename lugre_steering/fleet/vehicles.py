# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Which vehicle made which recording: one file for all, or a map of vehicles with the paths of their bags.

    vehicles:
      truck_07: {file: truck_07.yaml, bags: ["*/truck_07/*", "*_T07_*"]}
      truck_09: {file: truck_09.yaml, bags: ["*/truck_09/*"]}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from lugre_steering.errors import VehicleFileError
from lugre_steering.schema import Reader
from lugre_steering.vehicle import Vehicle, load
from lugre_steering.vehicle.identity import identity


@dataclass(frozen=True)
class Entry:
    """One vehicle of a map: its file (relative to the map), and patterns that the paths of its bags fit."""

    file: str
    bags: tuple[str, ...]


@dataclass(frozen=True)
class _Map:
    vehicles: dict[str, Entry]


@dataclass(frozen=True)
class Member:
    """One vehicle of the fleet; ``patterns`` is empty where it is the only one."""

    name: str
    file: Path
    vehicle: Vehicle
    sha256: str
    patterns: tuple[str, ...] = ()

    def made(self, bag: Path) -> bool:
        path = bag.resolve().as_posix()
        return not self.patterns or any(fnmatchcase(path, pattern) or fnmatchcase(bag.name, pattern) for pattern in self.patterns)


def read_members(file: Path) -> list[Member]:
    """The vehicles of a vehicle file (one) or of a map of them."""
    reader = Reader(file, VehicleFileError)
    content = reader.load()
    if not isinstance(content, Mapping) or "vehicles" not in content:
        vehicle = load(file)
        return [Member(vehicle.name, file, vehicle, identity(vehicle))]
    members = []
    for name, entry in reader.build(_Map, content, "").vehicles.items():
        if not entry.bags or not all(isinstance(pattern, str) and pattern for pattern in entry.bags):
            raise reader.fail(f"vehicles.{name}.bags", list(entry.bags), "a list of patterns such as '*/truck_07/*'")
        path = file.parent / entry.file
        vehicle = load(path)
        members.append(Member(name, path, vehicle, identity(vehicle), entry.bags))
    if not members:
        raise reader.fail("vehicles", {}, "a mapping of at least one vehicle")
    return members


def member_of(bag: Path, members: list[Member]) -> Member | str:
    """The vehicle that made a bag, or why that is not known."""
    found = [member for member in members if member.made(bag)]
    if len(found) == 1:
        return found[0]
    names = " and ".join(member.name for member in found)
    return f"its path fits {names} of the map of vehicles, expected one" if found else "its path fits no vehicle of the map"
