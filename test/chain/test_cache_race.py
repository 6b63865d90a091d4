# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Compiled forms of one function, kept at the same moment by several processes, never take each other's place."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from lugre_steering.chain.cache import _SealedFile

FORMS = range(24)


def test_forms_kept_at_once_are_found_again_each_as_itself(tmp_path: Path) -> None:
    def keep(form: int) -> None:
        _SealedFile(str(tmp_path), "function", "stamp").save(("form", form), {"code of": form})

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(keep, FORMS))
    kept = _SealedFile(str(tmp_path), "function", "stamp")
    assert [kept.load(("form", form)) for form in FORMS] == [{"code of": form} for form in FORMS]
