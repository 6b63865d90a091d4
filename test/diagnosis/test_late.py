# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A name that began when nobody fitted it is timed by all data; one that was always there stays as it is. All data are synthetic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_problem import SIGMA, effect, small_problem, weight, with_torque

from lugre_steering.diagnosis.conclude.late import begun_late, timed_by_all
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.search.search import Search
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.split import split

NOTHING = small_problem(33.0)
STOP = effect("end_stop", engage_angle=0.26, stiffness=2e5)
BEGUN_S = 18.0


def begun_unseen(late: bool, told: tuple[float, ...]) -> Finished:
    """A stop, told to act from ``told`` on, whose drives before BEGUN_S nobody fitted; ``late``: it begins then."""
    since = tuple(BEGUN_S if late else 0.0 for _ in NOTHING.runs)
    hidden = [(replace(STOP[0], since=since), STOP[1])]
    problem = with_torque(NOTHING, NOTHING.predict_all(NOTHING.start(), hidden))
    # Before it begins, all that was driven to the stop is held out.
    early = np.concatenate([(run.time < BEGUN_S) & (np.abs(run.theta).max(axis=0) > 0.2) for run in problem.runs])
    roles = replace(split(problem), fit=problem.valid & ~early, held=problem.valid & early)
    fitted = np.where(roles.fit, weight(problem), 0.0)
    noise = Noise(np.full(problem.valid.size, SIGMA), np.zeros((1, problem.valid.size)), 0.0)
    named = fit(problem, fitted, [(replace(STOP[0], since=told), STOP[1])])
    return Finished(problem, noise, roles, Search(fit(problem, fitted), named, (), (), ()))


def is_when_it_began(since: tuple[float, ...]) -> bool:
    """From the first drive to the stop after it began; it may have begun at any time since the one before."""
    before = [float(run.time[(run.time < BEGUN_S) & (np.abs(run.theta).max(axis=0) > 0.26)][-1]) for run in NOTHING.runs]
    return all(low - 0.5 < start < BEGUN_S + 0.5 for low, start in zip(before, since, strict=True))


@pytest.mark.parametrize("late", [True, False])
def test_a_stop_that_only_held_out_data_show_to_have_begun_late(late: bool) -> None:
    since = begun_late(begun_unseen(late, ())).found.final.effects[0][0].since
    assert is_when_it_began(since) if late else since == ()


def test_a_late_stop_told_too_early_is_timed_by_what_was_held_out() -> None:
    told = (1.0,) * len(NOTHING.runs)
    assert not is_when_it_began(told)
    timed = timed_by_all(begun_unseen(True, told)).found.final.effects[0][0].since
    assert is_when_it_began(timed)
