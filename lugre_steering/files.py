# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Results on disk: whole or not at all, never in place of anybody else's file, and one run at a time into a folder.

What is being written has a name that nobody can foresee and is locked while its run lives. So links that somebody has
laid out are never followed, and what a killed run leaves behind is known as such and taken away by the next one.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from lugre_steering.errors import DataError
from lugre_steering.serialise import as_json

MAKER = "lugre_steering"
COMMENT_MARK = f"# Written by {MAKER}"
"""How the first line of a vehicle file or a table begins that a command wrote."""
MARKS = {
    ".png": f"tEXtSoftware\0{MAKER}".encode(),
    ".html": f'<meta name="generator" content="{MAKER}">'.encode(),
    ".json": f'"schema": "{MAKER}/'.encode(),
    ".yaml": COMMENT_MARK.encode(),
    ".csv": COMMENT_MARK.encode(),
}
"""By kind of file, what stands near the beginning of every one that was written here."""
_HEAD = 4096
LONGEST_RECORD = 1 << 27
"""Bytes of a result: one over many recordings has some kilobytes for each."""
_LOCK = f".{MAKER}.lock"
_TEMPORARY = re.compile(rf"\.{MAKER}_[0-9a-f]{{16}}")


# ------------------------------------------------------------ whole or not at all


@contextmanager
def replacing(file: Path) -> Iterator[IO[bytes]]:
    """A stream whose content takes the place of ``file`` once it is whole and on the disk; if that fails nothing has changed.

    A link at ``file`` is replaced, not followed. ``OSError`` names ``file``.
    """
    try:
        part, descriptor = _new_file(file.parent)
        try:
            with os.fdopen(descriptor, "wb") as stream:
                yield stream
                stream.flush()
                os.fsync(descriptor)
                os.replace(part, file)
        except BaseException:
            with suppress(OSError):
                part.unlink()
            raise
        _sync(file.parent)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(file)) from error


def write_text(text: str, file: Path) -> None:
    """A text, whole or not at all."""
    with replacing(file) as stream:
        stream.write(text.encode())


def write_record(record: Mapping[str, Any], file: Path) -> None:
    """A result as JSON, whole or not at all."""
    write_text(as_json(record) + "\n", file)


@contextmanager
def new_folder(final: Path, *, replace: bool = False) -> Iterator[Path]:
    """Where to make a folder that takes the name ``final`` once it is whole; if that fails nothing has changed.

    The folder given does not exist yet. With ``replace`` an earlier ``final`` gives way, else it is a ``FileExistsError``.
    """
    if not replace:
        _refuse_existing(final)
    with temporary_folder(final.parent) as temporary:
        filling = temporary / final.name
        yield filling
        for path in filling.rglob("*"):
            _sync(path)
        if not replace:
            _refuse_existing(final)
        elif final.exists():
            final.rename(temporary / f"{final.name}.earlier")
        filling.rename(final)
        _sync(final.parent)


def _refuse_existing(file: Path) -> None:
    if os.path.lexists(file):
        raise FileExistsError(errno.EEXIST, "exists already", str(file))


@contextmanager
def temporary_folder(parent: Path) -> Iterator[Path]:
    """An empty folder in ``parent`` that is gone in the end."""
    folder = _unforeseen(parent)
    folder.mkdir(mode=0o700)
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        _try_lock(descriptor)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(descriptor)


def _new_file(folder: Path) -> tuple[Path, int]:
    """Path and descriptor of a file of our own, locked as long as it is open."""
    while True:
        part = _unforeseen(folder)
        descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666)
        _try_lock(descriptor)
        if os.fstat(descriptor).st_nlink:  # else another run took it for a dead one's before it was locked
            return part, descriptor
        os.close(descriptor)


def _unforeseen(folder: Path) -> Path:
    return folder / f".{MAKER}_{secrets.token_hex(8)}"


def _sync(path: Path) -> None:
    """On the disk, not only on its way there."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        with suppress(OSError):  # some file systems know no such thing for folders
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _try_lock(descriptor: int) -> bool:
    """Whether the lock is ours now; false too where the file system knows no locks."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def refuse_irregular(file: Path) -> None:
    """``OSError`` for a device, a pipe or a folder, whose reading might never end; not for a file that is not there."""
    if file.exists() and not file.is_file():
        raise OSError(errno.EINVAL, "is no regular file", str(file))


def read_text(file: Path, longest: int) -> str:
    """The text of a file that somebody names: no device or pipe, which might never end, and at most ``longest`` bytes.

    ``OSError`` or ``ValueError`` (also if it is not UTF-8).
    """
    refuse_irregular(file)
    with file.open("rb") as stream:
        content = stream.read(longest + 1)
    if len(content) > longest:
        raise ValueError(f"more than {longest} bytes")
    return content.decode("utf-8")


# ----------------------------------------------------------- one run at a time


@contextmanager
def output_folder(out: Path) -> Iterator[Path]:
    """The folder ``out`` for this run alone, made if it is not there, without what killed runs left in it.

    ``DataError`` if another run is writing there or the folder cannot be written. Folders made for a run that fails
    are taken away again if they are empty.
    """
    made = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        out.mkdir(parents=True, exist_ok=True)
        descriptor = lock_file(out / _LOCK)
    except HeldError as error:
        message = f"{out}: process {error.process} is writing its results there; wait for its end, or choose another --out"
        raise DataError(message) from None
    except OSError as error:
        _take_away_empty(made)
        raise DataError(f"{out}: cannot be written ({error.strerror or error}); expected a writable folder") from error
    try:
        _clear_dead(out)
        yield out
    except BaseException:
        unlock_file(out / _LOCK, descriptor)
        _take_away_empty(made)
        raise
    unlock_file(out / _LOCK, descriptor)


def _take_away_empty(folders: Iterable[Path]) -> None:
    """From the innermost outwards."""
    with suppress(OSError):
        for folder in folders:
            folder.rmdir()


class HeldError(DataError):
    """Another process holds a lock file."""

    def __init__(self, file: Path, process: str) -> None:
        super().__init__(f"{file}: process {process} holds it")
        self.process = process


def lock_file(file: Path) -> int:
    """Descriptor of a lock file, made if it is not there, which names this process; ours until ``unlock_file`` or the process' end.

    ``HeldError`` if another has it, ``DataError`` if it is no lock file, ``OSError``.
    """
    while True:
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
        opened = os.fstat(descriptor)
        if not stat.S_ISREG(opened.st_mode) or opened.st_nlink > 1:  # laid out by somebody else
            os.close(descriptor)
            raise DataError(f"{file}: is not a lock file of ours; remove it, or choose another folder")
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            process = os.read(descriptor, 20).decode(errors="replace").strip() or "another"
            os.close(descriptor)
            raise HeldError(file, process) from None
        except OSError:  # a file system without locks
            return descriptor
        with suppress(FileNotFoundError):
            if os.path.samestat(os.stat(file), opened):  # else its last owner has just taken it away
                os.ftruncate(descriptor, 0)
                with suppress(OSError):  # on a full disk it holds no less without our number
                    os.write(descriptor, f"{os.getpid()}\n".encode())
                return descriptor
        os.close(descriptor)


def unlock_file(file: Path, descriptor: int) -> None:
    """Let others have what ``lock_file`` gave."""
    with suppress(OSError):
        file.unlink()
    os.close(descriptor)


def _clear_dead(out: Path) -> None:
    """Take away temporary files and folders that nobody holds any more."""
    for path in out.iterdir():
        if not _TEMPORARY.fullmatch(path.name):
            continue
        with suppress(OSError):
            descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
            try:
                if _try_lock(descriptor):
                    shutil.rmtree(path) if path.is_dir() else path.unlink()
            finally:
                os.close(descriptor)


# -------------------------------------------------------------- whose it is


def is_ours(file: Path) -> bool:
    """Whether the file carries the mark of those written here, by its kind."""
    mark = MARKS.get(file.suffix)
    return mark is not None and mark in head(file)


def comments(notes: Iterable[str]) -> str:
    """Lines of a comment, one for each note, whatever names of files may hold."""
    return "".join(f"# {''.join(c if c.isprintable() else '?' for c in note)}\n" for note in notes)


def head(file: Path) -> bytes:
    """The beginning of a file; nothing if it is none, or cannot be read."""
    try:
        if not file.is_file():
            return b""
        with file.open("rb") as stream:
            return stream.read(_HEAD)
    except OSError:
        return b""


def refuse_foreign(files: Iterable[Path]) -> None:
    """``DataError`` if one of the files to be written is there and not ours."""
    for file in files:
        if os.path.lexists(file) and not is_ours(file):
            raise not_ours(file)


def earlier_result(
    out: Path, record: str, schema: str, others: Iterable[str], vehicle_file: Path | None = None
) -> dict[str, Any] | None:
    """The record of an earlier run in ``out``, if there is one, whose files may then be replaced.

    ``DataError`` if the ``record`` there is of another ``schema``, if one of the ``others`` to be written is not ours, or if
    writing would replace the vehicle file that is read.
    """
    others = list(others)
    for name in (record, *others):
        if vehicle_file is not None and (out / name).resolve() == vehicle_file.resolve():
            raise DataError(f"{vehicle_file}: would be replaced by the result; choose another --out")
    old = None
    if os.path.lexists(out / record):
        old = read_record(out / record, schema)
        if old is None:
            raise not_ours(out / record)
    refuse_foreign(out / name for name in others)
    return old


def read_record(file: Path, schema: str) -> dict[str, Any] | None:
    """The content of a JSON file of this ``schema``; None for anything else."""
    try:
        content = json.loads(read_text(file, LONGEST_RECORD))
        return dict(content) if content["schema"] == schema else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def not_ours(file: Path) -> DataError:
    """The refusal to replace a file."""
    return DataError(f"{file}: exists and is not part of an earlier result; choose another --out")
