# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A target is never met on fewer cases than its interval allows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lugre_steering.proof.result import Median, Share
from lugre_steering.proof.targets import TARGETS, Target, floor, share_status, status


@pytest.mark.parametrize(
    ("hits", "of", "target", "expected"),
    [
        (8, 8, 0.98, "too few cases"),  # a perfect quick run proves nothing
        (102, 102, 0.98, "met"),  # 0.964 at the lower end
        (100, 102, 0.98, "met"),
        (296, 300, 0.98, "met"),
        (95, 102, 0.98, "not met"),
        (15, 16, 0.98, "too few cases"),  # one miss of sixteen is still possible at 0.98
        (3, 8, 0.98, "not met"),
        (57, 60, 0.95, "met"), (20, 20, 0.95, "too few cases"), (50, 60, 0.95, "not met"), (97, 100, 0.97, "met"),
    ],
)  # fmt: skip
def test_share(hits: int, of: int, target: float, expected: str) -> None:
    assert share_status(hits, of, target) == expected


def test_nulls_need_the_lower_end_too() -> None:
    score = Share(100 / 102, hits=100, of=102, ci95=(0.93, 1.0))
    assert status(TARGETS["nulls_silent"], score) == "too few cases"
    assert status(TARGETS["nulls_silent"], replace(score, hits=297, of=300)) == "met"


def test_floor_of_the_nulls_is_what_is_asked() -> None:
    assert floor(TARGETS["nulls_silent"].value) == pytest.approx(0.95)


def test_at_most_counts_the_misses() -> None:
    extra = Share(0.0, hits=0, of=200, ci95=(0.0, 0.02))
    assert status(TARGETS["extra_names"], extra) == "met"
    assert status(TARGETS["extra_names"], replace(extra, hits=30, share=0.15)) == "not met"
    assert status(TARGETS["extra_names"], replace(extra, of=6)) == "too few cases"


def test_median_needs_six() -> None:
    target = Target("error", 0.1, most=True)
    assert status(target, Median(0.05, (0.01, 0.2), 5)) == "too few cases"
    assert status(target, Median(0.05, (0.01, 0.2), 6)) == "met"
    assert status(target, Median(0.2, (0.01, 0.2), 6)) == "not met"
    assert status(target, Median(None, (None, None), 0)) is None
