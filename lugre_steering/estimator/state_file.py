# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The file in which rubber temperature, bristles, memories and what the watch has learned survive a restart of the node."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import time
from collections.abc import Mapping
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
Learned = Mapping[str, str]
"""Texts, made and read by who has learned (``watch.detector``)."""


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


def write_state(file: Path, vehicle: Vehicle, memory: Memory, learned: Learned | None = None) -> None:
    """Replace the file as a whole: after a power cut there is the old one or the new one. ``OSError`` if it cannot be.

    ``learned``: what else has been learned of this vehicle; it has a hash of its own, so that damage costs one or the other.
    """
    body = {"schema": SCHEMA, "vehicle": identity(vehicle), "memory": memory}
    parts: dict[str, object] = {**body, "sha256": _digest(body)}
    if learned is not None:
        parts["learned"] = {**learned, "sha256": _digest(learned)}
    text = json.dumps(parts, allow_nan=False)
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
    content = _content(file, vehicle)
    content.pop("learned", None)
    try:
        sound = content.pop("sha256") == _digest(content)
        stamps_ns = [side["stamp_ns"] for side in content["memory"]["sides"].values()]
        sound = sound and all(abs(stamp_ns) < 2**63 for stamp_ns in stamps_ns)
        last_ns = max(stamps_ns)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise _damaged(file) from error
    if not sound:
        raise _damaged(file)
    age_s = (now_ns - last_ns) * 1e-9
    if not -AHEAD_S <= age_s <= max_age_s:
        raise DataError(f"{file}: its last sample is {age_s:.0f} s old, expected at most state_max_age_s ({max_age_s:g})")
    memory: Memory = content["memory"]
    return memory


def read_learned(file: Path, vehicle: Vehicle) -> Learned | None:
    """What else has been learned of the vehicle, however long ago; None in a file of an earlier version. ``DataError`` if it is damaged
    or of another vehicle file."""
    learned = _content(file, vehicle).get("learned")
    if learned is None:
        return None
    try:
        sound = learned.pop("sha256") == _digest(learned)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise _damaged(file) from error
    if not sound:
        raise _damaged(file)
    return {str(key): str(text) for key, text in learned.items()}


def _content(file: Path, vehicle: Vehicle) -> dict[str, Any]:
    """All that is in the file, if it is of this vehicle; the hashes of its parts are not looked at."""
    try:
        refuse_irregular(file)
        with file.open("rb") as stream:
            content: dict[str, Any] = json.loads(stream.read(LARGEST_BYTES))
        known, owner = content["schema"] == SCHEMA, content["vehicle"]
    except OSError as error:
        raise DataError(f"{file}: cannot be read ({error.strerror})") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise _damaged(file) from error
    if not known:
        raise _damaged(file)
    if owner != identity(vehicle):
        raise DataError(f"{file}: is of another vehicle file")
    return content


def _damaged(file: Path) -> DataError:
    return DataError(f"{file}: is damaged, of another version, or no state of this node")


def _digest(body: object) -> str:
    return hashlib.sha256(json.dumps(body, sort_keys=True).encode()).hexdigest()
