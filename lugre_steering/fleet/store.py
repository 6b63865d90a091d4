# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The records of a fleet on disk: what need not be done again, and what an earlier version said of the same inputs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path

from lugre_steering.files import read_record
from lugre_steering.fleet.content import key_of
from lugre_steering.fleet.work import SCHEMA, FleetOptions, Record, unchanged


class Store:
    """All records in a folder; ``version``: of the program that asks."""

    def __init__(self, folder: Path, version: str, options: FleetOptions) -> None:
        self.folder, self.version, self.options = folder, version, options
        self._of_bag: dict[str, list[Record]] = {}
        for record in self._read():
            self._of_bag.setdefault(record["bag"], []).append(record)

    def _read(self) -> Iterator[Record]:
        for file in sorted(self.folder.glob("*/*.json")):
            record = read_record(file, SCHEMA)
            if record is not None:
                yield record

    def known(self, bag: Path, member: str, vehicle_sha256: str) -> Record | None:
        """The record of a bag that lies there as it lay then, by this version; its bytes are not read for that."""
        for record in self._of_bag.get(str(bag), []):
            inputs = key_of(record["bag_sha256"], vehicle_sha256, asdict(self.options))
            if (record["version"], record["inputs"]) == (self.version, inputs) and unchanged(record, bag):
                return {**record, "member": member, "cached": True}
        return None

    def earlier(self, records: Iterable[Record]) -> dict[str, Record]:
        """By inputs: what another version, the last one that was asked, said of the same."""
        versions: dict[str, str] = {}
        others: dict[str, dict[str, Record]] = {}
        wanted = {record["inputs"] for record in records if "inputs" in record}
        for kept in self._of_bag.values():
            for record in kept:
                if record["version"] != self.version and record["inputs"] in wanted:
                    versions[record["version"]] = max(versions.get(record["version"], ""), record["made"])
                    others.setdefault(record["version"], {})[record["inputs"]] = record
        return others[max(versions, key=lambda version: versions[version])] if versions else {}
