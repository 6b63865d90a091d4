# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A campaign's journal: finished cases are kept line by line, so that an interrupted run goes on where it stopped."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence, Set
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import TextIO

from lugre_steering.errors import LugreSteeringError
from lugre_steering.pool import begin, processors
from lugre_steering.proof.blind import Job, Row, run, source_version
from lugre_steering.proof.campaign import PEERS_EVERY, Hiding


def finished(journal: Path, version: str, compared: Set[str]) -> dict[str, Row]:
    """Cases that a run of the same code has finished, by name and seed; a line cut off by an interruption is left out.

    ``compared``: names of the cases that need the answers of the peers too.
    """
    rows: dict[str, Row] = {}
    if not journal.exists():
        return rows
    for line in journal.read_text(encoding="utf-8").splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        if row["version"] == version and row["error"] is None and ("peers" in row or row["name"] not in compared):
            rows[f"{row['name']} {row['seed']}"] = row
    return rows


def run_all(
    cases: Sequence[Hiding],
    sheet_file: Path,
    journal: Path,
    *,
    peers: bool = False,
    budget_s: float | None = None,
    progress: Callable[[str, int, int | None], None] = lambda *_: None,
) -> list[Row]:
    """Run what the journal does not have yet, one process per core; no case is begun once ``budget_s`` has passed.

    An interruption (Ctrl-C) ends it with the cases finished so far.
    """
    version, begun = source_version(), time.monotonic()
    # By the seed of the case, so that a part of a campaign compares the same cases as the whole.
    compared = {case.name for case in cases if peers and case.seed % PEERS_EVERY == 0}
    known: Mapping[str, Row] = finished(journal, version, compared)
    rows = [known[f"{case.name} {case.seed}"] for case in cases if f"{case.name} {case.seed}" in known]
    waiting = [case for case in cases if f"{case.name} {case.seed}" not in known]
    progress("cases", len(rows), len(cases))
    with journal.open("a", encoding="utf-8") as log:
        if journal.stat().st_size and not journal.read_bytes().endswith(b"\n"):
            log.write("\n")  # a line cut off by an interruption must not swallow the next one
        late = (lambda: False) if budget_s is None else (lambda: time.monotonic() - begun > budget_s)
        jobs = [Job(case, sheet_file, version, case.name in compared) for case in waiting]
        _work_through(jobs, late, rows, log, lambda: progress("cases", len(rows), len(cases)))
    return rows


def _work_through(jobs: list[Job], late: Callable[[], bool], rows: list[Row], log: TextIO, tell: Callable[[], None]) -> None:
    """Run the jobs, one process per core, and keep each row as it comes; none is begun once it is ``late``."""
    workers = processors()
    # A fresh interpreter per worker: forking a process that has compiled code and threads is not safe.
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=begin, initargs=(1,)) as pool:
        running: set[Future[Row]] = set()
        while jobs or running:
            if late():
                jobs = []
            while jobs and len(running) < workers:
                running.add(pool.submit(run, jobs.pop(0)))
            if not running:
                break
            try:
                done, running = wait(running, return_when=FIRST_COMPLETED)
            except KeyboardInterrupt:  # score what is there; the same command goes on later
                pool.shutdown(wait=False, cancel_futures=True)
                break
            for future in done:
                try:
                    rows.append(future.result())
                except BrokenProcessPool as error:
                    raise LugreSteeringError("prove: a worker died, perhaps for want of memory; finished cases are kept") from error
                log.write(json.dumps(rows[-1]) + "\n")
                log.flush()
            tell()
