# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One recording of a fleet, from its bytes to a record on disk; what stops it is part of the record, never of the rest."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.bag import read_recording
from lugre_steering.bag.batch import missing
from lugre_steering.calibration.calibrate import check_motion
from lugre_steering.data.pieces import in_pieces
from lugre_steering.data.quality import Quality, inspect
from lugre_steering.diagnosis.engine import diagnose_recordings
from lugre_steering.diagnosis.signed import Signed, signed
from lugre_steering.effects.registry import VARIABLE
from lugre_steering.errors import BagError, DataError, ImplausibleWarning, LugreSteeringError
from lugre_steering.files import read_record, write_record
from lugre_steering.fitting.clocks import synchronised
from lugre_steering.fleet.content import State, digest_of, digests_of, foreign, key_of, state
from lugre_steering.recording import Recording
from lugre_steering.replay.library import replay
from lugre_steering.serialise import plain
from lugre_steering.vehicle import Vehicle, load
from lugre_steering.vehicle.identity import identity

SCHEMA = "lugre_steering/fleet_recording/2"

Record = dict[str, Any]
"""As JSON holds it. ``inputs`` to ``state``: what was examined (``files``: SHA-256 by name); ``quarantine``: why it tells nothing, or
None; ``score``: replay against measured torque [N m]; ``verdict``, ``effects``, ``estimates``: of the diagnosis; ``air_degC``,
``rubber_degC``: means."""


@dataclass(frozen=True)
class FleetOptions:
    """What decides about a result beside bag, vehicle and program."""

    diagnose: bool = True
    seed: int = 1


@dataclass(frozen=True)
class Task:
    """What a worker needs for one recording; ``store``: the folder of records, which all workers share; ``physics``: SHA-256 of the
    users' physics that it must know, by name."""

    bag: Path
    member: str
    vehicle_file: Path
    store: Path
    version: str
    options: FleetOptions
    physics: Mapping[str, str]


def record_file(store: Path, inputs: str, version: str) -> Path:
    """Where the record of some inputs by one version of the program is kept."""
    return store / inputs / f"{version}.json"


def process(task: Task) -> Record:
    """The record of one recording, from the store if it is there, else made and stored.

    A bag that changes meanwhile is told to, and nothing about it is kept.
    """
    refuse_other_physics(task.physics)
    begun = time.perf_counter()
    head: Record = {
        "schema": SCHEMA, "bag": str(task.bag), "member": task.member, "version": task.version, "options": asdict(task.options),
        "made": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }  # fmt: skip
    try:
        before = state(task.bag)
        files, vehicle = digests_of(task.bag), quietly(task.vehicle_file)
        sha256 = digest_of(files)
        inputs = key_of(sha256, identity(vehicle), asdict(task.options))
        file = record_file(task.store, inputs, task.version)
        known = read_record(file, SCHEMA)
        if known is not None:
            record = {**known, "bag": str(task.bag), "member": task.member, "files": files, "state": before}
        else:
            record = {**head, "inputs": inputs, "bag_sha256": sha256, "files": files, "state": before, **_examined(task, vehicle)}
        if state(task.bag) != before:
            return {**head, **nothing("is still being written: it changed while it was read")}
        record["seconds"] = time.perf_counter() - begun
        file.parent.mkdir(parents=True, exist_ok=True)
        write_record(record, file)
        return {**record, "cached": known is not None}
    except OSError as error:
        return {**head, **nothing(f"cannot be read ({error.strerror or error})")}


def nothing(reason: str) -> Record:
    """What a record holds of a recording that tells nothing."""
    return {
        "quarantine": reason, "recorded": None, "duration_s": 0.0, "air_degC": None, "rubber_degC": None, "score": None, "findings": [],
        "verdict": None, "statement": None, "effects": [], "estimates": [],
    }  # fmt: skip


def refuse_other_physics(physics: Mapping[str, str]) -> None:
    """A worker may have been started without the users' physics that the command knows."""
    if physics != foreign():
        here, wanted = (", ".join(known) or "none" for known in (foreign(), physics))
        raise LugreSteeringError(
            f"a worker knows other physics of users ({here}) than this command ({wanted}); start the workers with {VARIABLE} naming the "
            "same files, or leave --scheduler out"
        )


def quietly(file: Path) -> Vehicle:
    """Doubts about the sheet are told once, by the command."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ImplausibleWarning)
        return load(file)


def _examined(task: Task, vehicle: Vehicle) -> Record:
    """Checked, replayed and, if wanted, diagnosed."""
    try:
        recording = read_recording(task.bag, vehicle.channels)
        if lacking := missing(recording, vehicle.channels):
            raise BagError(lacking)
        done = replay(task.bag, vehicle)
    except LugreSteeringError as error:
        return nothing(str(error).removeprefix(f"{task.bag}: "))
    except Exception as error:  # one recording must never stop a fleet, whatever is in it
        return nothing(f"{type(error).__name__}: {error}")
    bag = done.bags[0]
    series = bag.kept()
    quality = inspect(recording, vehicle)
    warm = [values.mean() for values in series.rubber_temperature.values()]
    record: Record = {
        **nothing(""), "quarantine": None,
        "recorded": datetime.fromtimestamp(recording.start_ns * 1e-9, timezone.utc).isoformat(timespec="seconds"),
        "duration_s": bag.duration_s,
        "air_degC": None if recording.air_temperature is None else float(recording.air_temperature.value.mean()),
        "rubber_degC": float(np.mean(warm)) if warm else None,
        "score": bag.fit and plain(bag.fit),
        "findings": plain([*bag.findings, *(found for found in quality.findings if found not in bag.findings)]),
    }  # fmt: skip
    return record | _diagnosed(recording, quality, vehicle, task.options) if task.options.diagnose else record


def _diagnosed(recording: Recording, quality: Quality, vehicle: Vehicle, options: FleetOptions) -> Record:
    """What a diagnosis of the recording alone says, and how much of each effect it shows."""
    try:
        found = diagnose_recordings([recording], vehicle, seed=options.seed)
        told = {"verdict": found.verdict, "statement": found.statement, "effects": plain(found.effects)}
        return {**told, "estimates": plain(_estimates(quality, vehicle, options.seed))}
    except Exception as error:  # the replay stands; what failed is told in place of a verdict
        return {"verdict": "failed", "statement": f"{type(error).__name__}: {error}"}


def _estimates(quality: Quality, vehicle: Vehicle, seed: int) -> Sequence[Signed]:
    """None where the recording is faulty or does not determine a baseline."""
    if quality.blocking:
        return ()
    try:
        problem = synchronised(in_pieces([quality.recording])[0], vehicle).problem
        check_motion(problem)
    except DataError:
        return ()
    return signed(problem, seed)


def unchanged(record: Record, bag: Path) -> bool:
    """Whether a bag is, by names, sizes and times, the one that a record is about."""
    try:
        now: State = state(bag)
    except OSError:
        return False
    return record.get("state") == now
