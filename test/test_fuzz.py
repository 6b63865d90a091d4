# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The short form of ``python -m lugre_steering.bench fuzz``: whatever random damage makes of an input is read or refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from lugre_steering import defaults
from lugre_steering.bench import fuzz


def test_the_bench_tells_every_way_to_fail() -> None:
    cases = [fuzz.Case(i, verdict, "", float(i), 100.0 * i) for i, verdict in enumerate([*fuzz.GOOD, *fuzz.FAULTS])]
    board = fuzz.scoreboard(cases)
    assert [board[verdict] for verdict in (*fuzz.GOOD, *fuzz.FAULTS)] == [1] * 7
    assert (board["slowest_s"], board["peak_MB"], len(board["faults"])) == (6.0, 600.0, 5)


@pytest.mark.parametrize(
    ("target", "cases"), [("bag", 25), ("vehicle", 20), ("parameters", 40), ("effects", 25), ("import", 20), ("results", 60)]
)
def test_damaged_inputs_are_read_or_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, target: str, cases: int) -> None:
    monkeypatch.setenv(defaults.VARIABLE, "")  # which one of the targets sets
    module = fuzz.target(target)
    module.corpus(tmp_path)
    verdicts = {case: module.attempt(tmp_path, case) for case in range(10_000, 10_000 + cases)}
    assert {case: verdict for case, verdict in verdicts.items() if verdict[0] not in fuzz.GOOD} == {}
    assert {verdict for verdict, _ in verdicts.values()} == set(fuzz.GOOD)


def test_every_target_is_tried_here() -> None:
    marks = test_damaged_inputs_are_read_or_refused.pytestmark  # type: ignore[attr-defined]
    assert {target for target, _ in marks[0].args[1]} == set(fuzz.TARGETS)
