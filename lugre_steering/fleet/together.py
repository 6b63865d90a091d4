# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Several recordings of one vehicle diagnosed as one, where they hint jointly at what hardly any of them shows alone."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path

from lugre_steering.diagnosis.engine import diagnose
from lugre_steering.files import read_record, write_record
from lugre_steering.fleet.content import digest_of, digests_of, foreign, key_of
from lugre_steering.fleet.store import Store
from lugre_steering.fleet.vehicles import Member
from lugre_steering.fleet.work import FleetOptions, Record, quietly, record_file, refuse_other_physics
from lugre_steering.serialise import plain

SCHEMA = "lugre_steering/fleet_together/1"


@dataclass(frozen=True)
class Together:
    """What a worker needs; ``bags`` by path, with the SHA-256 that their records are about; ``inputs``: name of the result."""

    member: str
    vehicle_file: Path
    bags: Mapping[str, str]
    recorded: str
    inputs: str
    store: Path
    version: str
    options: FleetOptions
    physics: Mapping[str, str]


def pooled(member: Member, records: Sequence[Record], store: Store) -> Together:
    """The work of diagnosing these recordings together."""
    bags = {record["bag"]: record["bag_sha256"] for record in records}
    inputs = key_of(list(bags.values()), member.sha256, asdict(store.options))
    first = min(record["recorded"] for record in records)
    return Together(member.name, member.file, bags, first, inputs, store.folder, store.version, store.options, foreign())


def known(task: Together) -> Record | None:
    """Its record, if it is in the store."""
    record = read_record(record_file(task.store, task.inputs, task.version), SCHEMA)
    return record and {**record, "member": task.member, "bags": list(task.bags), "cached": True}


def process(task: Together) -> Record:
    """The record of one diagnosis, made and stored; one that fails says why and is not kept."""
    refuse_other_physics(task.physics)
    begun = time.perf_counter()
    head: Record = {
        "schema": SCHEMA, "inputs": task.inputs, "member": task.member, "bags": list(task.bags), "recorded": task.recorded,
        "version": task.version, "made": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }  # fmt: skip
    try:
        for bag, sha256 in task.bags.items():
            if digest_of(digests_of(Path(bag))) != sha256:
                return {**head, **failed(f"{bag}: has changed since it was examined; the next run sees it")}
        found = diagnose([Path(bag) for bag in task.bags], quietly(task.vehicle_file), seed=task.options.seed)
    except Exception as error:  # what the recordings tell one by one stands
        return {**head, **failed(f"{type(error).__name__}: {error}")}
    told = {"verdict": found.verdict, "statement": found.statement, "effects": plain(found.effects)}
    record = {**head, **told, "seconds": time.perf_counter() - begun}
    file = record_file(task.store, task.inputs, task.version)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_record(record, file)
    return record


def failed(reason: str) -> Record:
    """What a record holds of a diagnosis that came to nothing."""
    return {"verdict": "failed", "statement": reason, "effects": []}
