# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A name that began when nobody fitted it is timed by all data; one that was always there stays as it is. All data are synthetic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_problem import SIGMA, effect, small_problem, weight, with_torque

from lugre_steering.diagnosis.conclude.late import begun_late, timed_by_all
from lugre_steering.diagnosis.conclude.stands import standing
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.search.search import Found, Search
from lugre_steering.fitting.fingerprint import Score
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.split import split

NOTHING = small_problem(33.0)
STOP = effect("end_stop", engage_angle=0.26, stiffness=2e5)
BEGUN_S, LATER_S = 18.0, 29.0
DRAWS = SIGMA * np.random.default_rng(3).standard_normal((16, NOTHING.valid.size))


def begun_unseen(late: bool, told: tuple[float, ...], begun_s: float = BEGUN_S) -> Finished:
    """A stop, told to act from ``told`` on, whose drives before ``begun_s`` nobody fitted; ``late``: it begins then."""
    since = tuple(begun_s if late else 0.0 for _ in NOTHING.runs)
    hidden = [(replace(STOP[0], since=since), STOP[1])]
    problem = with_torque(NOTHING, NOTHING.predict_all(NOTHING.start(), hidden))
    # Before it begins, all that was driven to the stop is held out.
    early = np.concatenate([(run.time < begun_s) & (np.abs(run.theta).max(axis=0) > 0.2) for run in problem.runs])
    roles = replace(split(problem), fit=problem.valid & ~early, held=problem.valid & early)
    fitted = np.where(roles.fit, weight(problem), 0.0)
    noise = Noise(np.full(problem.valid.size, SIGMA), DRAWS, 0.0)
    named = fit(problem, fitted, [(replace(STOP[0], since=told), STOP[1])])
    return Finished(problem, noise, roles, Search(fit(problem, fitted), named, (), (), ()))


def is_when_it_began(since: tuple[float, ...], begun_s: float = BEGUN_S) -> bool:
    """From the first drive to the stop after it began; it may have begun at any time since the one before."""
    before = [float(run.time[(run.time < begun_s) & (np.abs(run.theta).max(axis=0) > 0.26)][-1]) for run in NOTHING.runs]
    return all(low - 0.5 < start < begun_s + 0.5 for low, start in zip(before, since, strict=True))


@pytest.mark.parametrize("late", [True, False])
def test_a_stop_that_only_held_out_data_show_to_have_begun_late(late: bool) -> None:
    since = begun_late(begun_unseen(late, ())).found.final.effects[0][0].since
    assert is_when_it_began(since) if late else since == ()


def test_a_late_stop_told_too_early_is_timed_by_what_was_held_out() -> None:
    told = (1.0,) * len(NOTHING.runs)
    assert not is_when_it_began(told)
    timed = timed_by_all(begun_unseen(True, told)).found.final.effects[0][0].since
    assert is_when_it_began(timed)


def test_a_late_name_told_too_early_stands_once_all_data_have_timed_it() -> None:
    """Where it is told to act before it does it makes one recording far worse, and would be no name."""
    told = begun_unseen(True, (1.0,) * len(NOTHING.runs), LATER_S)
    named = Found(Score(STOP[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.zeros(1)), (), (), 1000.0)
    done, stands = standing(replace(told, found=replace(told.found, found=(named,))), 1, lambda _: None)
    assert stands.named
    assert is_when_it_began(done.found.final.effects[0][0].since, LATER_S)
