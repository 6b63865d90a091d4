# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Compiled code kept between runs, sealed: what a power cut or a full disk leaves of it is told and made anew, never run.

Numba believes whatever lies in its cache: an empty or cut file stops every later start, a flipped byte in the machine code may
do anything. So each file ends with the hash of its name and of what stands before it, which Numba, a reader of pickles, does not see.
Of processes that start together, one compiles and the others wait for what it keeps. Copies of the package (a source tree,
what is installed from it) share what they keep: it lies under the content of its source, not under the path.

Symbols of compiled functions end with a number that Numba counts from 1 in every process. Code that two processes kept may then have
one symbol for two functions, and a third process that loads both runs the first for either (numba issue 10486): a model without the
effect that it was given. Here the numbers are random.
"""

from __future__ import annotations

import fcntl
import gc
import hashlib
import os
import secrets
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import numba
from numba.core import bytecode, caching, ccallback, dispatcher
from numba.core import event as events

_SEAL = hashlib.sha256
_SEAL_BYTES = _SEAL().digest_size
_FORM = b"sealed with the name"
"""How files are kept: those of earlier versions are neither used nor taken for damaged."""
_told: set[str] = set()
_listener: Callable[[str], None] | None = None
COMPILING = "compiling the model, once for this computer and these effects; this takes up to a minute"
LONGEST_COMPILE_S = 180.0


class _DamagedError(Exception):
    """A kept file is not what was written."""


class _SealedFile(caching.IndexDataCacheFile):
    """Index and data files of one function, each sealed when written and looked at before it is read.

    Numba numbers the data files: two processes that keep two forms at once would give both one number, and run each other's code. Here
    a form has a name of its own, is there before the index tells of it, and one process at a time adds to the index.
    """

    def save(self, key: Any, data: Any) -> None:
        name = f"{_SEAL(f'{self._index_name} {key!r}'.encode()).hexdigest()[:24]}.nbc"
        self._save_data(name, data)
        turn = _Turn(f"{self._index_path}.turn")
        try:
            turn.wait()
            forms = self._load_index()
            forms[key] = name
            self._save_index(forms)
        finally:
            turn.end()

    def _load_index(self) -> Any:
        _check(self._index_path)
        return super()._load_index()

    def _load_data(self, name: str) -> Any:
        _check(self._data_path(name))
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[IO[bytes]]:
        with super()._open_for_write(filepath) as file:
            yield file
            file.flush()
            file.write(_seal(filepath, Path(file.name).read_bytes()))
            file.flush()
            os.fsync(file.fileno())

    def discard(self) -> None:
        """Without its index nothing of a function counts as kept."""
        with suppress(OSError):
            os.unlink(self._index_path)


class _Turn:
    """One process at a time compiles one form of a function."""

    def __init__(self, path: str) -> None:
        self._file = os.open(path, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC)

    def wait(self) -> bool:
        """Until nobody else compiles it, or for so long that something is wrong there; whether that took any time."""
        begin, waited = time.monotonic(), False
        while not self._free() and time.monotonic() < begin + LONGEST_COMPILE_S:
            waited = True
            time.sleep(0.05)
        return waited

    def _free(self) -> bool:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

    def end(self) -> None:
        os.close(self._file)


class _ByContent(caching.UserProvidedCacheLocator):
    """The place of a function's code, named by the content of its file."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        super().__init__(function, file)
        self._content = hashlib.sha256(_FORM + Path(file).read_bytes()).hexdigest()
        self._cache_path = os.path.join(_folder(), f"{function.__module__}_{self._content[:16]}")

    def get_source_stamp(self) -> str:
        return self._content


class _Forms(caching.CompileResultCacheImpl):
    """Kept there or not at all: elsewhere Numba would run stale code after an edit of what a function calls."""

    _locator_classes = [_ByContent]  # noqa: RUF012 (as Numba has it)


class _Uncollected(events.Listener):
    """No garbage collection while Numba compiles this package: of the millions of objects that it makes nearly all live until it is
    done, and to look through them takes an eighth of its time."""

    def __init__(self) -> None:
        self._depth, self._was_on = 0, False

    def on_start(self, event: events.Event) -> None:
        if _is_ours(event.data["dispatcher"].py_func):
            if self._depth == 0:
                self._was_on = gc.isenabled()
                gc.disable()
            self._depth += 1

    def on_end(self, event: events.Event) -> None:
        if _is_ours(event.data["dispatcher"].py_func):
            self._depth -= 1
            if self._depth == 0 and self._was_on:
                gc.enable()


def _is_ours(function: Callable[..., Any]) -> bool:
    return (function.__module__ or "").startswith("lugre_steering")


class _KeptCode(caching.FunctionCache):
    """Numba's cache of one function; no trouble with its files ever reaches the caller, who then compiles."""

    _impl_class = _Forms

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file: _SealedFile = _SealedFile(self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp())
        self._turns: dict[str, _Turn] = {}

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            kept = super().load_overload(sig, target_context)
            if kept is None and self._begin(sig):
                kept = super().load_overload(sig, target_context)
            if kept is not None:
                self._end(sig)
            if kept is None:
                _tell_waiting()
            return kept
        except Exception:  # unpickling what another version has sealed may raise anything
            _tell(f"the code kept in {_folder()} is damaged or cannot be read: it is compiled anew")
            self._cache_file.discard()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except (OSError, _DamagedError) as error:
            _tell(f"compiled code cannot be kept in {_folder()} ({getattr(error, 'strerror', error)}): every start compiles")
        finally:
            self._end(sig)

    def _begin(self, sig: Any) -> bool:
        """This process compiles now; True if another one has just done so."""
        self._end(sig)  # an attempt that failed
        name = hashlib.sha256(f"{self._impl.filename_base} {sig}".encode()).hexdigest()[:24]
        with suppress(OSError):  # as save_overload will tell
            self._turns[str(sig)] = _Turn(os.path.join(self._cache_path, f"{name}.turn"))
            return self._turns[str(sig)].wait()
        return False

    def _end(self, sig: Any) -> None:
        if turn := self._turns.pop(str(sig), None):
            turn.end()


def keep_safely() -> None:
    """Let Numba keep the functions of this package sealed and with symbols of their own, and do without where no place is."""
    plain = caching.FunctionCache

    def cache_of(function: Callable[..., Any]) -> Any:
        if not _is_ours(function):
            return plain(function)
        with suppress(RuntimeError, OSError):  # no folder can be written
            return _KeptCode(function)
        _tell(f"compiled code cannot be kept in {_folder() or 'any folder'}: every start compiles")
        return caching.NullCache()

    events.register("numba:compile", _Uncollected())
    bytecode.FunctionIdentity._unique_ids = iter(lambda: secrets.randbits(64), None)  # type: ignore[assignment]
    ccallback.FunctionCache = dispatcher.FunctionCache = cache_of  # type: ignore[attr-defined]


def _folder() -> str:
    return str(numba.config.CACHE_DIR)  # type: ignore[attr-defined]


def _seal(path: str, content: bytes) -> bytes:
    """With the name: what a repaired file system puts in the place of another file is whole, and yet not what was written there."""
    return _SEAL(os.path.basename(path).encode() + b"\0" + content).digest()


def _check(path: str) -> None:
    """Nothing if the file is whole; ``_DamagedError`` if not. One that is not there is Numba's business."""
    try:
        content = Path(path).read_bytes()
    except FileNotFoundError:
        return
    if len(content) <= _SEAL_BYTES or _seal(path, content[:-_SEAL_BYTES]) != content[-_SEAL_BYTES:]:
        raise _DamagedError(f"{path}: damaged")


def tell_compiling(listener: Callable[[str], None]) -> None:
    """Tell ``listener`` when code is compiled because none is kept, once from now on."""
    global _listener
    _listener = listener
    _told.discard(COMPILING)


def _tell_waiting() -> None:
    """Somebody may wait and wonder: at a terminal, or before a log."""
    if _listener is None:
        if sys.stderr.isatty():
            _tell(COMPILING)
    elif COMPILING not in _told:
        _told.add(COMPILING)
        _listener(COMPILING)


def _tell(text: str) -> None:
    """One line, once: all functions lie in one folder."""
    if text not in _told:
        _told.add(text)
        print(f"lugre-steering: {text}", file=sys.stderr)
