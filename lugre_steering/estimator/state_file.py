# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The file in which rubber temperature, bristles and memories survive a restart of the node."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from lugre_steering.errors import DataError, LugreSteeringError
from lugre_steering.estimator.memory import Memory
from lugre_steering.files import HeldError, lock_file, refuse_irregular, unlock_file
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.identity import identity

SCHEMA = "lugre_steering/state/1"
LARGEST_BYTES = 1_000_000
AHEAD_S = 1.0
"""A state may be this much ahead of the clock: clocks are set."""
RETRY_S = 0.05


class Ownership:
    """The state file that one node has for itself: of two with one file, each would take the other's past for its own."""

    def __init__(self) -> None:
        self._file: Path | None = None
        self._descriptor = -1

    def take(self, file: Path, patience_s: float = 0.0) -> str:
        """Make the file ours, in place of the one before, or wait so long for who has it; "" or why it cannot be ours."""
        if file == self._file:
            return ""
        self.release()
        end = time.monotonic() + patience_s
        trouble, held = self._tried(file)
        while held and time.monotonic() < end:
            time.sleep(RETRY_S)
            trouble, held = self._tried(file)
        return trouble

    def _tried(self, file: Path) -> tuple[str, bool]:
        """"" once the file is ours, or why it is not; and whether it is another's now."""
        try:
            self._descriptor = lock_file(_lock_of(file))
        except HeldError as error:
            return f"{file}: process {error.process} keeps its state there; expected a state_file of its own for each node", True
        except LugreSteeringError as error:
            return str(error), False
        except OSError as error:
            return f"{file}: cannot be written ({error.strerror or error})", False
        self._file = file
        return "", False

    def release(self) -> None:
        """Let another node have it."""
        if self._file is not None:
            unlock_file(_lock_of(self._file), self._descriptor)
            self._file = None


def _lock_of(file: Path) -> Path:
    return file.with_name(f".{file.name}.lock")


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
        refuse_irregular(file)
        with file.open("rb") as stream:
            content: Any = json.loads(stream.read(LARGEST_BYTES))
        found = content.pop("sha256")
        sound = content["schema"] == SCHEMA and found == _digest(content)
        stamps_ns = [side["stamp_ns"] for side in content["memory"]["sides"].values()]
        sound = sound and all(abs(stamp_ns) < 2**63 for stamp_ns in stamps_ns)
        last_ns = max(stamps_ns)
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
