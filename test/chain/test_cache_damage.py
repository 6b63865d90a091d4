# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Whatever a power cut or a full disk makes of kept compiled code: the same results, and one line that says so."""

from __future__ import annotations

import builtins
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numba
import pytest
from numba.core import caching

from lugre_steering.chain import cache, compiled  # noqa: F401 (the chain as it keeps its code)
from lugre_steering.chain.lag import lag_weights as law

DAMAGED = "is damaged or cannot be read: it is compiled anew"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(cache, "_told", set())
    return tmp_path


def start() -> int:
    """What the next process would do with a law of the chain; returns how often kept code was used."""
    started = numba.njit(cache=True)(law.py_func)
    started(0.01, 0.1)
    return sum(started.stats.cache_hits.values())


def flip(content: bytes) -> bytes:
    i = len(content) // 2
    return content[:i] + bytes([content[i] ^ 0x10]) + content[i + 1 :]


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
@pytest.mark.parametrize(
    "damage",
    [
        lambda _: b"",
        lambda content: content[: len(content) // 2],
        lambda content: content[:-1],
        lambda content: bytes(len(content)),
        lambda content: os.urandom(len(content)),
        lambda content: content[:64] + bytes(len(content) - 64),
        flip,
    ],
    ids=["empty", "half", "one_less", "zeros", "garbage", "zeros_from_64", "one_bit"],
)
def test_damaged_code_is_made_anew(
    folder: Path, capsys: pytest.CaptureFixture[str], kind: str, damage: Callable[[bytes], bytes]
) -> None:
    assert [start(), start()] == [0, 1]
    (file,) = folder.rglob(f"*.{kind}")
    file.write_bytes(damage(file.read_bytes()))
    assert capsys.readouterr().err == ""
    assert start() == 0
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert DAMAGED in said
    assert start() == 1


def test_code_of_another_form_in_its_place_is_not_run(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file system put right after a power cut may give a file the content of another: whole, and wrong."""

    def started(*arguments: float) -> None:
        numba.njit(cache=True)(law.py_func)(*arguments)

    started(0.01, 0.1)
    started(1, 0.1)
    first, second = folder.rglob("*.nbc")
    contents = first.read_bytes(), second.read_bytes()
    first.write_bytes(contents[1])
    second.write_bytes(contents[0])
    started(0.01, 0.1)
    assert DAMAGED in capsys.readouterr().err


def test_a_lost_file_is_made_anew_without_a_word(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    start()
    next(folder.rglob("*.nbc")).unlink()
    assert [start(), start()] == [0, 1]
    assert capsys.readouterr().err == ""


START = """
import sys, time
from pathlib import Path
import numba
from lugre_steering.chain import compiled
from lugre_steering.chain.lag import lag_weights as law

started = numba.njit(cache=True)(law.py_func)
print("here", flush=True)
sys.stdin.readline()
started(0.01, 0.1)
print(sum(started.stats.cache_hits.values()))
"""


def test_of_processes_that_start_together_one_compiles(tmp_path: Path) -> None:
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", START]
    started = [subprocess.Popen(command, env=env, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE) for _ in range(3)]
    for process in started:
        assert process.stdout is not None
        assert process.stdout.readline() == "here\n"
    for process in started:
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    assert sorted(process.communicate(timeout=600.0)[0] for process in started) == ["0\n", "1\n", "1\n"]


@pytest.mark.usefixtures("folder")
def test_compiling_is_told_once_and_loading_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    monkeypatch.setattr(cache, "_listener", None)
    cache.tell_compiling(told.append)
    assert [start(), len(told)] == [0, 1]
    cache.tell_compiling(told.append)
    assert [start(), len(told)] == [1, 1]


def test_a_disk_that_is_full_costs_the_cache_only(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(name: str, mode: str = "r") -> object:
        return builtins.open("/dev/full" if "w" in mode else name, mode)

    monkeypatch.setattr(caching, "open", full, raising=False)
    assert [start(), start()] == [0, 0]
    said = capsys.readouterr().err
    assert said == f"lugre-steering: compiled code cannot be kept in {folder} (No space left on device): every start compiles\n"


def test_without_a_folder_the_program_runs_and_says_so() -> None:
    code = "import lugre_steering.chain.step; print('ready')"
    env = {**os.environ, "NUMBA_CACHE_DIR": "/proc/nowhere"}  # no user, not even root, can make it
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=600, check=True)
    assert done.stdout == "ready\n"
    assert done.stderr == "lugre-steering: compiled code cannot be kept in /proc/nowhere: every start compiles\n"
