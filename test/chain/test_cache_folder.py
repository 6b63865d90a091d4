# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Where compiled code is kept: in the user's cache, and in the temporary folder where there is none."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

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
    done = subprocess.run([sys.executable, "-c", SAY], env=env, capture_output=True, text=True, timeout=60, check=True)
    assert Path(done.stdout.strip()).parent == Path(folder.format(tmp=tmp_path))
