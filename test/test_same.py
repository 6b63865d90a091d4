# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""``bench same`` finds what two trees say differently, by quantity, and nothing where they say the same."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from lugre_steering.bench import same
from lugre_steering.effects.registry import CATALOGUE


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ([1.0, 2.0], [1.0, 2.0], 0.0), ([1.0, -4.0], [1.0, -4.0 - 4e-8], 1e-8), ([0.0, 100.0], [1e-6, 100.0], 1e-8),
        (["end_stop"], ["end_stop"], 0.0), (["end_stop"], ["backlash"], None), ([1.0], [None], None), ([True], [1.5], None),
        ([1.0], [], None), ([None], [None], 0.0), ([0.0], [0.0], 0.0),
    ],
)  # fmt: skip
def test_a_difference_is_a_share_of_the_largest_value(one: list[Any], other: list[Any], expected: float | None) -> None:
    for found in (same.difference(one, other), same.difference(other, one)):
        assert found == (expected if expected is None else pytest.approx(expected, rel=1e-6, abs=0.0))


def test_the_worst_case_counts_and_what_was_added_does_not() -> None:
    kept = {"a": {"rmse": [10.0], "verdict": ["consistent"]}, "b": {"rmse": [10.0], "verdict": ["consistent"]}}
    now = {"a": {"rmse": [10.0], "verdict": ["consistent"]}, "b": {"rmse": [10.0 + 1e-7], "verdict": ["consistent"], "new": [1.0]}}
    assert same.compared(kept, now) == {"rmse": pytest.approx(1e-8), "verdict": 0.0}
    del now["b"]["verdict"]
    assert same.compared(kept, now)["verdict"] is None


def test_cases_begin_with_none_and_differ() -> None:
    chosen = same.cases(10)
    names = [case.partition(":")[0] for case in chosen[1:]]
    assert (chosen[0], len(set(names))) == ("", 9)
    assert {CATALOGUE[name].stage for name in names} >= {"motion", "contact", "parallel_torque"}
    assert same.cases(1) == [""]


def test_a_tree_says_what_it_said_and_changes_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "kept"
    same.run(["--keep", str(folder), "--cases", "1"])
    monkeypatch.setattr(same, "told", cache(same.told))  # said anew once; the third look is at the comparison alone
    same.run(["--against", str(folder)])
    assert "0 of them apart" in capsys.readouterr().out
    file = folder / same.RECORD
    record = json.loads(file.read_text())
    (told,) = record["told"].values()
    assert len(told["replay series.torque"]) > 1000
    told["replay series.torque"][700] += 1e-7 * max(map(abs, told["replay series.torque"]))
    told["diagnosis verdict"] = ["missing_physics"]
    file.write_text(json.dumps(record))
    with pytest.raises(SystemExit) as ended:
        same.run(["--against", str(folder), "--json"])
    assert ended.value.code == 1
    found = json.loads(capsys.readouterr().out)
    assert found["apart"] == ["diagnosis verdict", "replay series.torque"]
    assert found["quantities"]["diagnosis verdict"] is None
    assert found["quantities"]["replay series.torque"] == pytest.approx(1e-7, rel=1e-3)


def test_what_it_cannot_do_is_said_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "theirs").write_text("")
    for words, expected in ((["--keep", str(tmp_path)], "is not empty"), (["--against", str(tmp_path)], "holds no same.json")):
        with pytest.raises(SystemExit) as ended:
            same.run(words)
        assert (ended.value.code, expected in capsys.readouterr().err) == (2, True)
    with pytest.raises(SystemExit) as ended:
        same.run([])
    assert (ended.value.code, "--keep FOLDER and --against FOLDER" in capsys.readouterr().err) == (2, True)
