# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The file in which rubber temperature, bristles and memories survive a restart of the node."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

from lugre_steering.errors import DataError
from lugre_steering.estimator.memory import Memory
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.identity import identity

SCHEMA = "lugre_steering/state/1"
LARGEST_BYTES = 1_000_000
AHEAD_S = 1.0
"""A state may be this much ahead of the clock: clocks are set."""


def write_state(file: Path, vehicle: Vehicle, memory: Memory) -> None:
    """Replace the file as a whole: after a power cut there is the old one or the new one. ``OSError`` if it cannot be."""
    body = {"schema": SCHEMA, "vehicle": identity(vehicle), "memory": memory}
    text = json.dumps({**body, "sha256": _digest(body)}, allow_nan=False)
    handle, name = tempfile.mkstemp(prefix=f".{file.name}.", dir=file.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as part:
            part.write(text)
            part.flush()
            os.fsync(part.fileno())
        os.replace(name, file)
    except BaseException:
        with suppress(OSError):
            os.unlink(name)
        raise


def read_state(file: Path, vehicle: Vehicle, now_ns: int, max_age_s: float) -> Memory:
    """The memory in the file. ``DataError`` says why one is not used: damaged, of another vehicle file, too old, ahead."""
    try:
        with file.open("rb") as stream:
            content: Any = json.loads(stream.read(LARGEST_BYTES))
        found = content.pop("sha256")
        sound = content["schema"] == SCHEMA and found == _digest(content)
        last_ns = max(side["stamp_ns"] for side in content["memory"]["sides"].values())
    except OSError as error:
        raise DataError(f"{file}: cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise DataError(f"{file}: is damaged or no state of this node") from error
    if not sound:
        raise DataError(f"{file}: is damaged or of another version")
    if content["vehicle"] != identity(vehicle):
        raise DataError(f"{file}: is of another vehicle file")
    age_s = (now_ns - last_ns) * 1e-9
    if not -AHEAD_S <= age_s <= max_age_s:
        raise DataError(f"{file}: its last sample is {age_s:.0f} s old, expected at most state_max_age_s ({max_age_s:g})")
    memory: Memory = content["memory"]
    return memory


def _digest(body: object) -> str:
    return hashlib.sha256(json.dumps(body, sort_keys=True).encode()).hexdigest()
