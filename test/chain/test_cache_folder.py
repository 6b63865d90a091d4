# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Where compiled code is kept: in the user's cache, and in the temporary folder where there is none; once for all copies of a source."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import lugre_steering
from lugre_steering.chain.compiled import law
from lugre_steering.chain.lag import lag_weights

NOWHERE = "/proc/nowhere"
"""No user, not even root, can make this folder."""
SAY = "import numba, lugre_steering.chain.compiled; print(numba.config.CACHE_DIR)"


@pytest.mark.parametrize(
    ("given", "folder"),
    [
        ({"XDG_CACHE_HOME": "{tmp}/cache", "HOME": NOWHERE}, "{tmp}/cache/lugre_steering"),
        ({"HOME": "{tmp}/home"}, "{tmp}/home/.cache/lugre_steering"),
        ({"XDG_CACHE_HOME": NOWHERE, "HOME": "{tmp}/home"}, "{tmp}/home/.cache/lugre_steering"),
        ({"HOME": NOWHERE}, f"{{tmp}}/lugre_steering-{os.getuid()}"),
    ],
)
def test_the_first_folder_that_can_be_written_is_used(tmp_path: Path, given: dict[str, str], folder: str) -> None:
    kept = {key: value for key, value in os.environ.items() if key not in ("XDG_CACHE_HOME", "HOME", "NUMBA_CACHE_DIR")}
    env = {**kept, "TMPDIR": str(tmp_path), **{key: value.format(tmp=tmp_path) for key, value in given.items()}}
    done = subprocess.run([sys.executable, "-c", SAY], env=env, capture_output=True, text=True, timeout=600, check=True)
    assert Path(done.stdout.strip()).parent == Path(folder.format(tmp=tmp_path))


USE = """
import numba
from lugre_steering.chain import compiled, lag

used = numba.njit(cache=True)(lag.lag_weights.py_func)
used(0.01, 0.1)
print(lag.__file__, sum(used.stats.cache_hits.values()))
"""


def test_copies_of_the_package_share_what_they_compile_and_an_edited_one_does_not(tmp_path: Path) -> None:
    source = Path(lugre_steering.__file__).parent
    copies = [tmp_path / name / "lugre_steering" for name in ("first", "second", "edited")]
    for copy in copies:
        shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__"))
    with (copies[-1] / "chain" / "lag.py").open("a") as file:
        file.write("# An edit.\n")
    hits = []
    for copy in copies:
        env = {**os.environ, "PYTHONPATH": str(copy.parent), "NUMBA_CACHE_DIR": str(tmp_path / "kept")}
        done = subprocess.run([sys.executable, "-c", USE], env=env, cwd=tmp_path, capture_output=True, text=True, timeout=600, check=True)
        file, used = done.stdout.split()
        assert file == str(copy / "chain" / "lag.py")
        hits.append(int(used))
    assert hits == [0, 1, 0]


def test_laws_of_the_package_are_kept_and_those_of_users_are_not() -> None:
    """Numba sees no change of what a law calls: it is followed in the package (its folder is of all sources) and nowhere else."""
    def users(x: float) -> float:
        return x

    assert lag_weights.stats.cache_path.startswith(numba.config.CACHE_DIR)
    assert law(users).stats.cache_path is None


TWO_FORMS = """
import math

from numba import njit
from numba.extending import overload

import lugre_steering.chain.compiled


def effect(p):
    pass


@overload(effect)
def _effect(p):
    size = 1.0 if "with_effect" in p.fields else 0.0
    scope = {"math": math}
    lines = ["def effect(p):", " x = p.torque", *100 * [" x += math.sin(x)"], f" return {size} * math.cos(x)"]  # too long to be inlined
    exec(chr(10).join(lines), scope)
    return scope["effect"]


@njit(cache=True)
def run(p):
    return effect(p[0])
"""
RUN = """
import sys

import numpy as np
from two_forms import run

print(*(run(np.zeros(1, [("torque", float), (name, float)])) for name in sys.argv[1:]))
"""


def test_a_process_that_loads_what_two_others_kept_runs_each_in_its_place(tmp_path: Path) -> None:
    (tmp_path / "two_forms.py").write_text(TWO_FORMS)
    paths = os.pathsep.join([str(tmp_path), str(Path(lugre_steering.__file__).parents[1])])
    env = {**os.environ, "PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    printed = [
        subprocess.run([sys.executable, "-c", RUN, *names], env=env, capture_output=True, text=True, timeout=600, check=True).stdout.split()
        for names in (["plain"], ["with_effect"], ["plain", "with_effect"])
    ]
    assert printed == [["0.0"], ["1.0"], ["0.0", "1.0"]]
