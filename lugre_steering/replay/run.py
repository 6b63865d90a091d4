# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The ``replay`` command: bags in, one folder of bags, pages, pictures and a summary out."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from lugre_steering.bag.find import Skipped
from lugre_steering.bag.reader import shortened
from lugre_steering.effects.registry import made
from lugre_steering.errors import BagError, ImplausibleWarning
from lugre_steering.estimator import Options
from lugre_steering.files import output_folder, write_record
from lugre_steering.online import Comparison
from lugre_steering.pool import Progress, WorkerDiedError, in_processes
from lugre_steering.provenance import Provenance
from lugre_steering.replay.earlier import names_for
from lugre_steering.replay.passage import AIR, Passage, degrees
from lugre_steering.replay.result import RECORD, Replay, ReplayedBag
from lugre_steering.vehicle import Vehicle, load


def replay(
    bags: Sequence[Path],
    vehicle_file: Path,
    out: Path,
    options: Options | None = None,
    progress: Progress | None = None,
    initial_temperature: str | None = None,
    *,
    jobs: int = 1,
    look_ahead: bool = False,
    skipped: Sequence[Skipped] = (),
) -> dict[str, Any]:
    """Run the estimator over each bag anew, ``jobs`` at a time; write bags, pictures and summary.json into ``out``.

    ``initial_temperature``: of the rubber at the start of each bag, a number [degC] or ``air`` for the first recorded air; without it that
    of the vehicle file. ``look_ahead``: tell the error with the motion known from all samples, too; ``skipped``: what has been left out
    before.
    Returns the summary. Of several bags, one that gives no torque is left out with the reason; ``BagError`` or ``VehicleFileError`` for
    input of which nothing is of use.
    """
    vehicle = load(vehicle_file)
    names = names_for(bags, out)  # before anything is made
    options = options or Options()
    if initial_temperature not in (None, AIR):
        degrees(initial_temperature)
    asked = {**asdict(options), "initial_temperature": initial_temperature, "look_ahead": look_ahead}
    origin = made("replay", asked, vehicle_file, bags)
    tasks = [
        _Task(path, name, vehicle_file, out, options, initial_temperature, look_ahead, origin)
        for path, name in zip(bags, names, strict=True)
    ]
    done: dict[int, ReplayedBag | Skipped] = {}
    overall = Comparison()
    summary = Replay.begun(vehicle, vehicle_file, options, origin, skipped)
    try:
        with output_folder(out):
            for number, (result, fit) in _results(tasks, vehicle, jobs, progress):
                done[number] = result
                overall.merge(fit)
                in_order = [done[key] for key in sorted(done)]
                written = tuple(bag for bag in in_order if isinstance(bag, ReplayedBag))
                left = tuple(bag for bag in in_order if isinstance(bag, Skipped))
                summary = replace(summary, bags=written, overall=overall.result(), skipped=(*skipped, *left))
                if written:
                    write_record(summary.json, out / RECORD)
            if not summary.bags:
                raise BagError(_nothing([bag for bag in done.values() if isinstance(bag, Skipped)]))
    except OSError as error:
        raise BagError(f"{error.filename or out}: cannot be written ({error.strerror or error})") from error
    return summary.json


@dataclass(frozen=True)
class _Task:
    """What a process needs to replay one bag."""

    path: Path
    name: str
    vehicle_file: Path
    out: Path
    options: Options
    initial_temperature: str | None
    look_ahead: bool
    origin: Provenance


_Answer = tuple["ReplayedBag | Skipped", Comparison]


def _results(
    tasks: Sequence[_Task], vehicle: Vehicle, jobs: int, progress: Progress | None
) -> Iterator[tuple[int, _Answer]]:
    """Number and outcome of each bag as it ends; in this process if there is one job only."""
    if min(jobs, len(tasks)) <= 1:
        for number, task in enumerate(tasks):
            yield number, _passed(task, vehicle, progress)
        return
    for done, (number, answer) in enumerate(in_processes(_alone, tasks, jobs), 1):
        if isinstance(answer, WorkerDiedError):
            answer = Skipped(str(tasks[number].path), str(answer)), Comparison()
        if progress is not None:
            progress("recordings", done, len(tasks))
        yield number, answer


def _alone(task: _Task) -> _Answer:
    """One bag in a process of its own; doubts about the vehicle file are told by the one that started it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ImplausibleWarning)
        return _passed(task, load(task.vehicle_file), None)


def _passed(task: _Task, vehicle: Vehicle, progress: Progress | None) -> _Answer:
    """One bag written, or why not."""
    run = Passage(task.path, task.name, vehicle, task.options, task.initial_temperature, look_ahead=task.look_ahead)
    try:
        return run.write(task.out, task.origin, progress), run.fit
    except BagError as error:
        return Skipped(str(task.path), str(error).removeprefix(f"{task.path}: ")), Comparison()


def _nothing(skipped: Sequence[Skipped]) -> str:
    """What to say where no bag was of use: of several, the reasons of the first few."""
    reasons = [f"{one.bag}: {one.reason}" for one in skipped]
    if len(reasons) == 1:
        return reasons[0]
    return f"none of {len(reasons)} recordings gave a torque: {shortened(reasons, 3)}"
