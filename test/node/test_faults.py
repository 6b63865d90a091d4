# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The short form of the campaign of faults: some of them, over DDS."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from lugre_steering.bench import faults
from lugre_steering.bench.soak import compressed


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Iterator[faults.Campaign]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", "101")
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        patch.setenv("PYTHONPATH", str(Path(faults.__file__).parents[2]))
        made = faults.Campaign(tmp_path_factory.mktemp("campaign"), 1)
        yield made
        made.close()


TRIES = 5
"""A node that is slow is slow each time; a machine that is busy with other tests is so now and then."""


def assert_passed(judge: Callable[[], faults.Score]) -> None:
    """Times are those of the best try; all else holds in each."""
    for _ in range(TRIES):
        score = judge()
        assert replace(score, told_s=0.0, recovered_s=0.0, held_back_s=0.0).passed, score
        if score.passed:
            return
    raise AssertionError(score)


NAMES = (
    "left angle frozen", "noise of one degree", "pressures in bar", "one pressure stuck at zero", "one pressure exchanged",
    "frame of another sensor",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_fault_is_told_limited_and_recovered(campaign: faults.Campaign, name: str) -> None:
    assert_passed(lambda: campaign.samples(name, *faults.faults_of(campaign.vehicle, campaign.rng)[name]))


def test_plans_too_long_for_the_middleware_are_told_as_lost(campaign: faults.Campaign) -> None:
    name = "a flood of huge plans"
    assert_passed(lambda: campaign.judge(name, *faults.events_of(campaign)[name]))


def test_a_node_that_is_killed_comes_back(campaign: faults.Campaign) -> None:
    assert faults.parameters_set_wrongly(campaign)
    last_command_is_zero, _ready_s = faults.killed(campaign, 15)
    assert last_command_is_zero


def test_many_samples_in_compressed_time() -> None:
    came = compressed(400_000, 1)
    assert came["finite"]
    assert came["live_minus_replay_Nm"] == 0.0
