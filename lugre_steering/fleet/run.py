# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A fleet from paths to tables and a page. Killed at any time, the same command goes on where it was."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from lugre_steering.bag.find import Skipped
from lugre_steering.bag.reader import must_exist
from lugre_steering.effects.registry import made
from lugre_steering.errors import DataError
from lugre_steering.files import earlier_result, output_folder, write_record
from lugre_steering.fleet.changes import differences
from lugre_steering.fleet.claims import BUDGET, Claim, by_vehicle, claims, shared, unusual, worth_pooling
from lugre_steering.fleet.cluster import on_cluster
from lugre_steering.fleet.content import code_version, foreign
from lugre_steering.fleet.page import write_page
from lugre_steering.fleet.result import PAGE, RECORD, SCHEMA, DiagnosedTogether, Fleet, VehicleSummary
from lugre_steering.fleet.store import Store
from lugre_steering.fleet.tables import KINDS, need_parquet, rows, write_tables
from lugre_steering.fleet.together import known, pooled
from lugre_steering.fleet.together import process as diagnose_together
from lugre_steering.fleet.vehicles import Member, member_of, read_members
from lugre_steering.fleet.work import FleetOptions, Record, Task, nothing, process
from lugre_steering.pool import Progress, WorkerDiedError, in_processes, processors
from lugre_steering.provenance import Provenance, Source, source

STORE = "recordings"
T = TypeVar("T")


def run(
    bags: Sequence[Path],
    vehicles: Path,
    out: Path,
    *,
    options: FleetOptions | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    skipped: Sequence[Skipped] = (),
    progress: Progress = lambda *_: None,
    version: str = "",
) -> Fleet:
    """Examine the bags that have not been, in ``jobs`` processes or on the Dask cluster ``scheduler``; judge all of them together.

    Writes fleet.json, report.html and the Parquet tables into ``out``, and a record of each bag into ``out``/recordings.
    ``skipped``: what has been left out before; ``version``: that of the program, under which records are kept.
    """
    need_parquet()
    if bags and not any(bag.exists() for bag in bags):
        must_exist(bags[0])
    options, version, begun = options or FleetOptions(), version or code_version(), time.perf_counter()
    members = read_members(vehicles)
    jobs = jobs or processors()
    with output_folder(out):
        _refuse_foreign(out, vehicles)
        try:
            (out / STORE).mkdir(exist_ok=True)
            write_record(_summary([], members, [*skipped], options, version).json, out / RECORD)  # whose folder this is, from now on
            store = Store(out / STORE, version, options)
            records, tasks = _sorted(bags, members, store)
            progress("recordings", len(records), len(bags))
            for record in _work(tasks, jobs, scheduler):
                records.append(record)
                progress("recordings", len(records), len(bags))
            records.sort(key=lambda record: (record["member"], record["recorded"] or "", record["bag"]))
            together = list(_diagnosed_together(records, members, store, jobs, scheduler, progress))
            found = claims(records, options.seed, together)
            fleet = _summary(
                records, members, skipped, options, version, found, earlier=store.earlier(records), together=together, workers=jobs,
                seconds=time.perf_counter() - begun,
            )  # fmt: skip
            made = _provenance(vehicles, members, options, records)
            fleet = replace(fleet, provenance=made)
            write_tables(rows(records, found, fleet.changes), out, made)
            write_page(fleet, records, out / PAGE)
            write_record(fleet.json, out / RECORD)
        except OSError as error:
            raise DataError(f"{error.filename or out}: cannot be written ({error.strerror or error})") from error
    return fleet


def _refuse_foreign(out: Path, vehicles: Path) -> None:
    """Only an earlier fleet's files are replaced; ``fleet.json`` tells that they are."""
    known = earlier_result(out, RECORD, SCHEMA, (PAGE,), vehicles)
    for name in (STORE, *(f"{kind}.parquet" for kind in KINDS)):
        if known is None and (out / name).exists():
            raise DataError(f"{out / name}: exists and is not part of an earlier result; choose another --out")


def _sorted(bags: Sequence[Path], members: list[Member], store: Store) -> tuple[list[Record], list[Task]]:
    """What is known of the bags already, and the work that is left."""
    records: list[Record] = []
    tasks: list[Task] = []
    for bag in bags:
        member = member_of(bag, members)
        if isinstance(member, str):
            records.append({"bag": str(bag), "member": "", "version": store.version, "cached": True, **nothing(member)})
            continue
        known = store.known(bag, member.name, member.sha256)
        if known is not None:
            records.append(known)
        else:
            tasks.append(Task(bag, member.name, member.file, store.folder, store.version, store.options, foreign()))
    return records, tasks


def _work(tasks: Sequence[Task], jobs: int, scheduler: str | None) -> Iterator[Record]:
    """The record of each task as it ends; a worker that died twice over a bag is told, and tried again by the next run."""
    for number, result in _in_parallel(process, tasks, jobs, scheduler):
        if isinstance(result, WorkerDiedError):
            task = tasks[number]
            result = {"bag": str(task.bag), "member": task.member, "version": task.version, **nothing(str(result))}
        yield result


def _in_parallel(
    function: Callable[[T], Record], tasks: Sequence[T], jobs: int, scheduler: str | None
) -> Iterator[tuple[int, Record | WorkerDiedError]]:
    if not tasks:
        return iter(())
    return on_cluster(function, tasks, scheduler) if scheduler is not None else in_processes(function, tasks, jobs)


def _diagnosed_together(
    records: Sequence[Record], members: Sequence[Member], store: Store, jobs: int, scheduler: str | None, progress: Progress
) -> Iterator[Record]:
    """Diagnoses of several recordings of one vehicle, where they are worth it; one whose worker died is tried again by the next run."""
    chosen = worth_pooling(records)
    tasks = [pooled(member, chosen[member.name], store) for member in members if member.name in chosen]
    kept = [record for record in map(known, tasks) if record is not None]
    yield from kept
    done = {record["inputs"] for record in kept}
    left = [task for task in tasks if task.inputs not in done]
    for count, (_, result) in enumerate(_in_parallel(diagnose_together, left, jobs, scheduler), 1):
        progress("vehicles", count, len(left))
        if not isinstance(result, WorkerDiedError):
            yield result


def _summary(
    records: Sequence[Record], members: Sequence[Member], skipped: Sequence[Skipped], options: FleetOptions, version: str,
    found: Sequence[Claim] = (), *, earlier: dict[str, Record] | None = None, together: Sequence[Record] = (), workers: int = 0,
    seconds: float = 0.0,
) -> Fleet:  # fmt: skip
    """What all records came to; without ``earlier``, that a run has begun."""
    worked = [record for record in records if not record.get("cached")]
    bad = [Skipped(record["bag"], record["quarantine"]) for record in records if record["quarantine"] is not None]
    return Fleet(
        schema=SCHEMA,
        finished=earlier is not None,
        version=version,
        date=datetime.now(timezone.utc).isoformat(timespec="seconds"),
        options=options,
        vehicles=tuple(_vehicle(member, records) for member in members),
        recordings=len(records),
        examined=len(worked),
        cached=len(records) - len(worked),
        quarantine=(*skipped, *bad),
        budget=BUDGET,
        considered=len(found),
        claims=tuple(claim for claim in found if claim.stands),
        shared=tuple(shared(records, found)),
        outliers=tuple(unusual(records)),
        other_version=next((record["version"] for record in (earlier or {}).values()), None),
        changes=tuple(differences(records, earlier or {})),
        workers=workers,
        seconds=seconds,
        work_seconds=sum(record.get("seconds", 0.0) for record in (*worked, *together) if not record.get("cached")),
        together=tuple(
            DiagnosedTogether(
                record["member"], tuple(record["bags"]), record["verdict"], record["statement"],
                tuple(effect["id"] for effect in record["effects"]),
            )
            for record in together
        ),
    )  # fmt: skip


def _provenance(vehicles: Path, members: Sequence[Member], options: FleetOptions, records: Sequence[Record]) -> Provenance:
    """Of the whole fleet; what was read of a bag is known from its record, and none is read again."""
    made_by = made("fleet", asdict(options), vehicles, ())
    sheets = {str(member.file): digest for member in members for digest in source(member.file).sha256.values()}
    map_of = {} if made_by.vehicle is None else made_by.vehicle.sha256
    bags = tuple(Source(record["bag"], record.get("files", {})) for record in records)
    return replace(made_by, vehicle=Source(str(vehicles), {**map_of, **(sheets if str(vehicles) not in sheets else {})}), bags=bags)


def _vehicle(member: Member, records: Sequence[Record]) -> VehicleSummary:
    own: list[dict[str, Any]] = by_vehicle(records).get(member.name, [])
    errors = [record["score"]["rmse_Nm"] for record in own if record["score"] is not None]
    return VehicleSummary(
        name=member.name,
        file=str(member.file),
        sha256=member.sha256,
        recordings=len(own),
        quarantined=sum(record["member"] == member.name and record["quarantine"] is not None for record in records),
        hours=sum(record["duration_s"] for record in own) / 3600.0,
        first=own[0]["recorded"] if own else None,
        last=own[-1]["recorded"] if own else None,
        median_rmse_Nm=float(np.median(errors)) if errors else None,
        verdicts=dict(Counter(record["verdict"] for record in own if record["verdict"] is not None)),
        vehicle=member.vehicle,
        identity=member.sha256,
    )
