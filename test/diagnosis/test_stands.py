# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What stands of the names that a search found is judged on held-out data beside the friction law's freedoms. All data are synthetic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_problem import SIGMA, effect, small_problem, weight, with_torque

from lugre_steering.diagnosis import engine, verify
from lugre_steering.diagnosis.conclude.formed import Formed
from lugre_steering.diagnosis.conclude.stands import _acting, _clock, _missed_by, _of_one_vehicle, _tested
from lugre_steering.diagnosis.fewer import fewer
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.loudness import beyond_calibration
from lugre_steering.diagnosis.search.search import Found, Search
from lugre_steering.fitting.fingerprint import Score
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.split import split
from lugre_steering.fitting.trial import Trial

NOTHING = small_problem(33.0)
SLOPE = effect("slope_bias", torque=60.0)


@pytest.mark.parametrize(("there", "freed", "period_s", "named"), [
    (60.0, True, 11.0, True), (0.0, True, 11.0, False), (60.0, False, 11.0, False), (60.0, True, 16.0, False),
])  # fmt: skip
def test_a_name_is_judged_beside_the_freedoms_that_it_was_compared_beside(there: float, freed: bool, period_s: float, named: bool) -> None:
    """A friction level that waves by 60 sigma hides a slope of less than one on held-out data, but not beside that freedom; where no
    slope is, none is named; nor where the waves lead its size so far astray that a vehicle file would get worse by it."""
    waves = 60.0 * SIGMA * np.concatenate([np.sin(2.0 * np.pi * run.time / period_s) for run in NOTHING.runs])
    slope = [(SLOPE[0], {"torque": there})]
    problem = with_torque(NOTHING, NOTHING.predict_all(NOTHING.start(), slope) + waves)
    roles, noise = split(problem), Noise(np.full(problem.valid.size, SIGMA), np.zeros((1, problem.valid.size)), 0.0)
    fitted = np.where(roles.fit, weight(problem), 0.0)

    def finished(own, **more):  # type: ignore[no-untyped-def]
        names = (Found(Score(SLOPE[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.zeros(1)), (), (), 100.0),)
        return Finished(own, noise, roles, Search(fit(own, fitted), fit(own, fitted, [SLOPE]), names, (), ()), **more)

    beside = finished(problem.bent([(120.0 * SIGMA * waves / np.abs(waves).max())[:, None]]), form=("its level along the ground",))
    done = finished(problem, **({"beside_form": beside} if freed else {}))
    assert done.needs_form
    assert _tested(done, 1).named == named


@pytest.mark.parametrize(("torque", "loss", "acting"), [(0.0, 3e4, [1]), (60.0, 3e4, [0, 1]), (60.0, 10.0, [0]), (1.0, 0.0, [])])
def test_names_that_do_nothing_beside_the_form_of_the_friction_in_the_chain_are_not_told(
    torque: float, loss: float, acting: list[int]
) -> None:
    roles, noise = split(NOTHING), Noise(np.full(NOTHING.valid.size, SIGMA), np.zeros((1, NOTHING.valid.size)), 0.0)
    fitted = np.where(roles.fit, weight(NOTHING), 0.0)
    names = [effect("slope_bias", torque=torque), effect("line_loss_quadratic", c=loss)]
    baseline, inside = fit(NOTHING, fitted), fit(NOTHING, fitted, [(replace(candidate, free=()), values) for candidate, values in names])
    item = Found(Score(SLOPE[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.zeros(1)), (), (), 100.0)
    done = Finished(NOTHING, noise, roles, Search(baseline, inside, (item, item), (), ()))
    judged = verify.judged_once(NOTHING, baseline, inside, roles, 1)
    assert _acting(done, Formed(NOTHING, inside, inside, (), judged, judged)) == acting


@pytest.mark.parametrize(("doubts", "acts"), [(20.0, False), (35.0, True)])
def test_a_name_must_do_as_much_on_all_samples_as_where_names_are_compared_on_means(doubts: float, acts: bool) -> None:
    """A third as many means hold the same energy: 25 doubts are as many on all samples."""
    draws = SIGMA * np.random.default_rng(4).standard_normal((16, NOTHING.valid.size))
    roles, noise = split(NOTHING), Noise(np.full(NOTHING.valid.size, SIGMA), draws, 0.0)
    used, rate_Hz = np.where(roles.fit, weight(NOTHING), 0.0), 1.0 / float(NOTHING.runs[0].time[1] - NOTHING.runs[0].time[0])
    baseline = fit(NOTHING, used)
    means, less, there = fewer(NOTHING, noise, roles, baseline, NOTHING.valid.size, rate_Hz / 3.0, means=True)
    energy = beyond_calibration(NOTHING, baseline, np.ones(NOTHING.valid.size))
    inside = fit(NOTHING, used, [(replace(SLOPE[0], free=()), {"torque": float(np.sqrt(doubts / energy))})])
    found = Search(baseline, inside, (Found(Score(SLOPE[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.zeros(1)), (), (), 100.0),), (), ())
    done = Finished(NOTHING, noise, roles, found, beside_form=Finished(means, less, there, found))
    judged = verify.judged_once(NOTHING, baseline, inside, roles, 1)
    assert _acting(done, Formed(NOTHING, inside, inside, (), judged, judged)) == [0] * acts


@pytest.mark.parametrize(("named", "left_sigmas", "sought"), [(False, 0.8, False), (True, 0.8, True), (False, 2.0, True)])
def test_no_entry_is_sought_where_nothing_but_noise_is_left(
    named: bool, left_sigmas: float, sought: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """More is left than noise, as much as an entry would be worth, but not loud, and no name stands."""
    random = np.random.default_rng(5)
    roles, draws = split(NOTHING), SIGMA * random.standard_normal((16, NOTHING.valid.size))
    left = NOTHING.predict_all(NOTHING.start()) + left_sigmas * SIGMA * random.standard_normal(NOTHING.valid.size)
    problem, fitted = with_torque(NOTHING, left), np.where(roles.fit, weight(NOTHING), 0.0)
    baseline = fit(problem, fitted)
    names = (Found(Score(SLOPE[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.zeros(1)), (), (), 100.0),) if named else ()
    done = Finished(problem, Noise(np.full(NOTHING.valid.size, SIGMA), draws, 0.0), roles, Search(baseline, baseline, names, (), ()))
    asked = list[Problem]()
    monkeypatch.setattr(engine, "wrong_entry", lambda problem, *_: asked.append(problem))
    assert engine._wrong_entry(done) is None
    assert bool(asked) == sought


@pytest.mark.parametrize(("received", "late_s", "apart"), [(True, 0.02, True), (False, 0.02, False), (True, 0.2, False)])
def test_what_clocks_may_be_apart_is_no_delay_of_the_machine_where_stamps_are_given_on_receipt(
    received: bool, late_s: float, apart: bool
) -> None:
    """Also where a slow sensor led and a delay ties with it; not where all recordings with sound stamps show it, nor ever so long a one."""
    torque = np.split(NOTHING.predict_all(NOTHING.start()), NOTHING.edges[1:-1])
    late = [np.interp(run.time - late_s, run.time, part) for run, part in zip(NOTHING.runs, torque, strict=True)]
    recorded = with_torque(NOTHING, np.concatenate(late))
    problem = Problem(recorded.vehicle, [replace(run, on_receipt=received) for run in recorded.runs])
    roles, noise = split(problem), Noise(np.full(problem.valid.size, SIGMA), np.zeros((1, problem.valid.size)), 0.0)
    fitted = np.where(roles.fit, weight(problem), 0.0)

    def trial(name: str, **values: float) -> Trial:
        found = fit(problem, fitted, [effect(name, **values)])
        return Trial(Score(found.effects[0][0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.zeros(1)), found, found.cost)

    slow, delay = trial("pressure_lag", tau=late_s), trial("time_delay", delay=late_s)
    names = (Found(slow.score, ("time_delay",), (slow, delay), 100.0),)
    told = _clock(Finished(problem, noise, roles, Search(fit(problem, fitted), slow.fit, names, (), ())))
    assert (told is not None) == apart
    if told is not None:
        assert told.late_s == pytest.approx(late_s, abs=5e-3)
        assert 0.0 < told.deviation_s < late_s


@pytest.mark.parametrize(("first", "second", "stand"), [((0,), (1,), False), ((0,), None, True), (None, None, True), ((0,), (0, 1), True)])
def test_names_that_no_recording_shows_together_do_not_stand(
    first: tuple[int, ...] | None, second: tuple[int, ...] | None, stand: bool
) -> None:
    names = [replace(SLOPE[0], bags=first), replace(effect("kingpin_jacking", amplitude=1.0)[0], bags=second)]
    assert _of_one_vehicle(names, 2) == stand


@pytest.mark.parametrize(("hidden_in", "missed"), [((0, 1), False), ((0,), True)])
def test_a_late_name_that_one_recording_contradicts_does_not_stand(hidden_in: tuple[int, ...], missed: bool) -> None:
    """Said to act in both from an instant on, it is hidden in both or in one alone."""
    candidate, values = effect("slope_bias", torque=400.0)
    since = tuple(float(run.time[0]) + 20.0 for run in NOTHING.runs)
    there = replace(candidate, since=tuple(start if bag in hidden_in else np.inf for bag, start in enumerate(since)))
    problem = with_torque(NOTHING, NOTHING.predict_all(NOTHING.start(), [(there, values)]))
    said = [(replace(candidate, since=since, free=()), values)]
    assert _missed_by(problem, fit(problem, weight(problem)), fit(problem, weight(problem), said)) == missed
