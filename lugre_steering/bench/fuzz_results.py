# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Files that an earlier run has left to be damaged: the state of a node, a window of its watch, the record of a fleet."""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache
from pathlib import Path

import numpy as np

from lugre_steering.bench import fuzz_text
from lugre_steering.bench.replay import VEHICLE
from lugre_steering.estimator import Estimator
from lugre_steering.estimator.state_file import read_state, write_state
from lugre_steering.files import read_record
from lugre_steering.provenance import provenance
from lugre_steering.vehicle import Vehicle, load
from lugre_steering.watch.window import SAMPLE, read_window, write_window

_STATE, _WINDOW, _RECORD = "state.json", "window.npz", "record.json"
_NOW_NS, _AGE_S = 1_780_000_000 * 10**9, 1e6


@lru_cache(maxsize=1)
def _vehicle() -> Vehicle:
    return load(VEHICLE)


def corpus(folder: Path) -> None:
    """Of the test vehicle, a second long."""
    vehicle = _vehicle()
    estimator = Estimator(vehicle)
    samples = np.zeros(200, SAMPLE)
    for i in range(200):
        channel, stamp_ns, angle = i % 2, _NOW_NS - (200 - i // 2 * 2) * 10**7, 1e-3 * i
        estimator.push(channel, stamp_ns, angle)
        samples[i] = channel, stamp_ns, angle, np.nan
    write_state(folder / _STATE, vehicle, estimator.memory)
    write_window(folder / _WINDOW, vehicle, "torque", samples, provenance("node", {}))
    (folder / _RECORD).write_text('{"schema": "record/1", "values": [1.0, 2.0, {"a": "b"}]}', encoding="utf-8")


def _resume(place: Path) -> None:
    Estimator(_vehicle()).resume(read_state(place / _STATE, _vehicle(), _NOW_NS, _AGE_S))


def _resume_sealed(place: Path) -> None:
    """As if whoever wrote the damage had known the checksum."""
    file = place / _STATE
    try:
        content = json.loads(file.read_bytes())
        content.pop("sha256")
        content["sha256"] = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
        file.write_text(json.dumps(content), encoding="utf-8")
    except (ValueError, AttributeError, KeyError, RecursionError):
        pass  # no state at all
    _resume(place)


def attempt(folder: Path, case: int) -> tuple[str, str]:
    """Go on from a damaged state, with and without its checksum, or read a damaged window or record."""
    uses = {
        _STATE: _resume_sealed if case % 4 else _resume,
        _WINDOW: lambda place: read_window(place / _WINDOW, _vehicle().channels),
        _RECORD: lambda place: read_record(place / _RECORD, "record/1"),
    }
    return fuzz_text.tried(folder, case, uses)
