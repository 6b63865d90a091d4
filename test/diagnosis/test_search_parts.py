# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Parts of the search on small problems whose answer is known: noise, split, late effects, freer shapes."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from small_problem import SIGMA, effect, small_problem, weight, with_torque

from lugre_steering.diagnosis.conclude import effects, experiment, limits
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.investigate import recalibrate
from lugre_steering.diagnosis.search import compare, propose, search, surely
from lugre_steering.effects.registry import CATALOGUE, leaving_out
from lugre_steering.effects.relief_saturation import CEILINGS
from lugre_steering.fitting import entries, fingerprint, noise, onset, sheet, split, trial
from lugre_steering.fitting.doubt import doubt
from lugre_steering.fitting.fingerprint import Score
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Candidate, Problem, SheetValue
from lugre_steering.fitting.sheet import thinned
from lugre_steering.recording import Array
from lugre_steering.vehicle import EffectEntry


@pytest.fixture(scope="module")
def problem() -> Problem:
    return small_problem(50.0)


@pytest.fixture(scope="module")
def slower() -> Problem:
    """The same drive at 40 Hz, for whole searches."""
    return small_problem(40.0)


@pytest.fixture
def few_sought() -> Iterator[None]:
    """Only what is hidden and what may be taken for it: rounds of them take a fraction of those of the whole catalogue."""
    like_it = {"line_loss_linear", "viscous_friction", "angle_offset", "moment_arm_error"}
    few = {"slope_bias", "line_loss_quadratic", "kingpin_jacking", *like_it}
    with leaving_out(sorted(CATALOGUE.keys() - few)):
        yield


@pytest.mark.parametrize("correlation", [[1.0], [1.0, 0.6, 0.3, 0.1], [1.0, 0.99, -0.99, 0.9]])
def test_drawn_noise_has_the_level_and_stays_finite_for_any_estimate(correlation: list[float]) -> None:
    drawn = noise.QuietNoise(2.0, np.array(correlation)).draw(200_000, np.random.default_rng(1))
    assert np.std(drawn) == pytest.approx(2.0, rel=0.02)
    if correlation[-1] < 0.2:  # a possible one is met at every lag
        seen = [np.mean(drawn[: drawn.size - lag] * drawn[lag:]) / 4.0 for lag in range(len(correlation))]
        assert seen == pytest.approx(correlation, abs=0.02)


def test_fast_noise_that_grows_with_the_load_is_measured(problem: Problem) -> None:
    run = problem.runs[0]
    load = np.abs(run.measured)
    ripple = 0.01 * load * np.sqrt(2.0) * np.sin(2.0 * np.pi * 9.0 * run.time)
    white = 50.0 * np.random.default_rng(2).standard_normal(run.time.size)
    noisy = replace(run, measured=run.measured + ripple + white)
    found = noise.fast_variance(noisy, ripple + white, np.zeros(run.time.size))
    above = 50.0**2 * (1.0 - noise.SPLIT_HZ * 2.0 * (run.time[1] - run.time[0]))
    low, high = load < np.quantile(load, 0.2), load > np.quantile(load, 0.8)
    assert np.mean(found[low]) == pytest.approx(above + np.mean((0.01 * load[low]) ** 2), rel=0.25)
    assert np.mean(found[high]) == pytest.approx(above + np.mean((0.01 * load[high]) ** 2), rel=0.25)


def test_a_residual_without_any_noise_has_none(problem: Problem) -> None:
    run = problem.runs[0]
    assert np.array_equal(noise.fast_variance(run, np.zeros(run.time.size), np.zeros(run.time.size)), np.zeros(run.time.size))


def test_the_split_lets_both_parts_see_a_single_event(problem: Problem) -> None:
    first = split.split(problem)
    excess = np.zeros(problem.valid.size)
    assert np.array_equal(split.balanced(problem, excess).held, first.held)
    blind = np.flatnonzero(first.held)[:300]
    excess[blind] = 100.0  # happens in a held-out block alone
    chosen = split.balanced(problem, excess)
    assert excess[first.fit].sum() == 0.0
    assert excess[chosen.fit].sum() > 0.0
    held = [split.split(problem, phase).held for phase in range(split.CYCLE)]
    assert np.max(np.sum(held, axis=0)) == 1


def test_a_late_effect_acts_from_its_start_and_is_timed(problem: Problem) -> None:
    candidate, values = effect("slope_bias", torque=400.0)
    starts = (30.0, 41.0)
    late = [(replace(candidate, since=starts), values)]
    x = problem.start()
    change = problem.predict_all(x, late) - problem.predict_all(x)
    time = np.concatenate([run.time for run in problem.runs])
    begun = time >= np.array(starts)[problem.bag]
    assert np.allclose(change, np.where(begun, 400.0, 0.0), atol=1e-6)
    hidden = with_torque(problem, problem.predict_all(x, late))
    guess = replace(candidate, since=(20.0, 20.0))
    result = fit(hidden, weight(hidden), [(guess, {"torque": 200.0})])
    score = Score(guess, 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))
    tried = trial.Trial(score, result, trial.cost(hidden, result, weight(hidden)))
    for _ in range(trial.RETIMED):
        tried = trial.retime(hidden, weight(hidden), tried)
    assert tried.candidate.since == pytest.approx(starts, abs=1.0)
    assert tried.fit.effects[0][1]["torque"] == pytest.approx(400.0, rel=0.02)


@pytest.mark.parametrize("acts_always", [False, True])
def test_a_rival_is_tried_from_the_instants_of_the_leader(problem: Problem, acts_always: bool) -> None:
    candidate, values = effect("slope_bias", torque=400.0)
    right, wrong = replace(candidate, since=(30.0, 41.0)), replace(candidate, since=() if acts_always else (5.0, 60.0))
    hidden = with_torque(problem, problem.predict_all(problem.start(), [(right, values)]))
    score, before = Score(candidate, 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4)), fit(hidden, weight(hidden)).cost
    fits = [fit(hidden, weight(hidden), [(own, values)]) for own in (right, wrong)]
    leader, rival = (trial.Trial(score, own, own.cost) for own in fits)
    assert trial.begun_with(hidden, weight(hidden), rival, leader, before).candidate.since == right.since
    assert trial.begun_with(hidden, weight(hidden), leader, rival, before) is leader


def test_what_explains_nearly_as_much_always_is_not_told_to_begin_late(problem: Problem) -> None:
    """It began after a second: not enough to tell it from one that always acted."""
    always, values = effect("slope_bias", torque=400.0)
    late = replace(always, since=(1.0, 1.0))
    hidden = with_torque(problem, problem.predict_all(problem.start(), [(late, values)]))
    score, before = Score(always, 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4)), fit(hidden, weight(hidden)).cost
    leader, rival = (trial.Trial(score, own := fit(hidden, weight(hidden), [(each, values)]), own.cost) for each in (late, always))
    assert leader.cost < rival.cost
    assert trial.begun_with(hidden, weight(hidden), rival, leader, before) is rival


def searched(hidden: Problem) -> search.Search:
    """A search under white noise of the known level."""
    roles = split.split(hidden)
    draws = SIGMA * np.random.default_rng(4).standard_normal((16, hidden.measured.size))
    seen = noise.Noise(np.full(hidden.measured.size, SIGMA), draws, 0.0)
    return search.search(hidden, seen, roles, fit(hidden, np.where(roles.fit, weight(hidden), 0.0)))[1]


def test_two_effects_are_found_together(slower: Problem) -> None:
    truth = [effect("line_loss_quadratic", c=3e4), effect("slope_bias", torque=200.0)]
    found = searched(with_torque(slower, slower.predict_all(slower.start(), truth)))
    assert {candidate.effect.id for candidate, _ in found.final.effects} == {"line_loss_quadratic", "slope_bias"}
    assert len(found.found) == len(found.final.effects)


@pytest.mark.parametrize("last_is_short", [False, True])
def test_three_of_which_each_keeps_the_others_in_doubt_stand_together(
    slower: Problem, monkeypatch: pytest.MonkeyPatch, last_is_short: bool
) -> None:
    """The first two are short of what a name must take; all stand where the third is not, and none where it is."""
    truth = [effect("line_loss_quadratic", c=3e4), effect("kingpin_jacking", amplitude=400.0), effect("slope_bias", torque=200.0)]
    hidden = with_torque(slower, slower.predict_all(slower.start(), truth))

    def step(_: object, current: Fit, names: Sequence[search.Found], weight: Array, *__: object) -> search._Step:
        count = len(names) + 1
        name = search.Found(Score(truth[count - 1][0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4)), (), (), 1e3)
        result = fit(hidden, weight, truth[:count], current.x[: hidden.nuisances])
        return search._Step(hidden, result, name, short=count < 3 or last_is_short)

    monkeypatch.setattr(search, "_step", step)
    monkeypatch.setattr(search, "_round", lambda problem, *_: propose.Proposal(problem, fit(problem, weight(problem)), (), []))
    named = [item.score.candidate.effect.id for item in searched(hidden).found]
    assert named == ([] if last_is_short else [candidate.effect.id for candidate, _ in truth])


def test_the_shape_of_a_law_gets_no_name_of_its_own(slower: Problem) -> None:
    """A loss whose power is not quite that of its entry is that entry alone."""
    rate = np.concatenate([run.omega.mean(axis=0) for run in slower.runs])
    bent = 3e4 * np.abs(rate) ** 1.8 * np.sign(rate) * 0.1**0.2
    found = searched(with_torque(slower, slower.predict_all(slower.start()) + bent))
    assert [candidate.effect.id for candidate, _ in found.final.effects] == ["line_loss_quadratic"]


def test_errors_count_by_how_long_they_last(problem: Problem) -> None:
    """Of noise that keeps a share phi of itself from sample to sample, (1 + phi) / (1 - phi) samples count as one."""
    rng, phi, result = np.random.default_rng(3), 0.8, fit(problem, weight(problem), linearisations=1)
    doubts = []
    for _ in range(20):
        error = np.zeros(problem.measured.size)
        for i in range(1, error.size):
            error[i] = phi * error[i - 1] + rng.standard_normal() * (1.0 - phi**2) ** 0.5
        seen = with_torque(problem, result.prediction)
        seen.measured = result.prediction + 2.0 * error * SIGMA
        doubts.append(doubt(seen, result, weight(problem)))
    # The tail below the least correlation that counts is left out: 5 % of the sum.
    assert np.mean(doubts) == pytest.approx(4.0 * (1.0 + phi) / (1.0 - phi), rel=0.15)


def test_errors_of_recordings_at_several_rates_last_as_long_as_they_do(problem: Problem) -> None:
    """Seconds, not samples: of noise with a memory tau at 50 and at 5 Hz, what comes in 2 tau counts as one."""
    rng, tau = np.random.default_rng(4), 0.3
    mixed = Problem(problem.vehicle, [problem.runs[0], thinned(problem, rate_Hz=5.0)[0].runs[1]])
    used, result = np.ones(mixed.measured.size), fit(mixed, np.ones(mixed.measured.size), linearisations=1)
    doubts = []
    for _ in range(20):
        parts = []
        for run in mixed.runs:
            keeps, error = np.exp(-(run.time[1] - run.time[0]) / tau), np.zeros(run.time.size)
            for i in range(1, error.size):
                error[i] = keeps * error[i - 1] + rng.standard_normal() * (1.0 - keeps**2) ** 0.5
            parts.append(2.0 * error)
        mixed.measured = result.prediction + np.concatenate(parts)
        doubts.append(doubt(mixed, result, used))
    samples_per_s = used.size / sum(run.time[-1] - run.time[0] for run in mixed.runs)
    assert np.mean(doubts) == pytest.approx(4.0 * 2.0 * tau * samples_per_s, rel=0.15)


def replace_bends(problem: Problem, bends: Array) -> Problem:
    return Problem(problem.vehicle, problem.runs, problem.calibrations, bends=bends)


def fit_of(cost: float, *effects: tuple[Candidate, dict[str, float]]) -> Fit:
    """A fit of which only its effects and what it leaves matter."""
    none, square = np.zeros(1), np.zeros((1, 1))
    return Fit(none, effects, none, cost, square, square, none, none, none, none, settled=True)


def test_the_energy_compared_is_the_evidence(slower: Problem) -> None:
    """Minus twice the logarithm of the likelihood with all linear freedoms integrated out, up to what all models share."""
    rng = np.random.default_rng(5)
    few = slower.measured.size
    bent = replace_bends(slower, rng.standard_normal((few, 3)) * 4.0 * SIGMA)
    result = fit(bent, weight(bent), linearisations=30, tolerance=1e-12)
    energies, exact = [], []
    for typical in (0.02, 0.3):
        here = bent.doubted(1.0, typical)
        energies.append(compare._expected(here, weight(bent), result)(here))
        slope = result.jacobian[:, : here.nuisances] * here.scales() / here.prior_weights(True)
        target = (bent.measured - result.prediction) * weight(bent) + result.jacobian[:, : here.nuisances] @ result.x
        keep = slice(0, 400)  # a dense covariance of all samples would be large
        _, size = np.linalg.slogdet(np.eye(400) + slope[keep] @ slope[keep].T)
        exact.append(float(target[keep] @ np.linalg.solve(np.eye(400) + slope[keep] @ slope[keep].T, target[keep])) + size)
        first = np.where(np.arange(few)[:, None] < 400, result.slope, 0.0)
        shown = replace(result, slope=first, gram=first.T @ first)
        part = compare._expected(here, np.where(np.arange(few) < 400, weight(bent), 0.0), shown)(here)
        assert part == pytest.approx(exact[-1], rel=1e-9)
    assert energies[0] != pytest.approx(energies[1], rel=1e-6)


def test_bends_keep_their_columns_and_a_fit_hands_on_its_normal_matrix(slower: Problem) -> None:
    """Whatever steps have corrected on the way: bends are linear, and the normal matrix is that of the columns that are handed on."""
    bent = replace_bends(slower, np.random.default_rng(5).standard_normal((slower.measured.size, 3)) * 4.0 * SIGMA)
    (name,) = [effect("line_loss_quadratic", c=3e4)]
    bent.measured = bent.predict_all(np.append(slower.start(), (0.5, -0.5, 0.2)), [name])
    result = fit(bent, weight(bent), [(name[0], {"c": 1e4})], linearisations=3)
    own = slice(bent.first_bend, bent.nuisances)
    assert np.array_equal(result.slope[:, own], bent.bends * weight(bent)[:, None])
    square = result.slope.T @ result.slope
    np.testing.assert_allclose(result.gram, square, rtol=1e-9, atol=1e-9 * square.max())
    assert result.x[own] == pytest.approx((0.5, -0.5, 0.2), abs=0.01)
    assert result.effects[0][1]["c"] == pytest.approx(3e4, rel=1e-3)


@pytest.mark.parametrize(("wrong", "by"), [(entries.STIFF, 1.4), (entries.LEVEL, 1.0), (entries.LEVEL, -2.0), (entries.CONSERVATIVE, 0.3)])
def test_a_wrong_level_reaches_what_it_makes(slower: Problem, wrong: SheetValue, by: float) -> None:
    """However far it is off, so that it is fitted; what an inertia makes it does not reach."""
    freed = slower.of_sheet(calibrations=[wrong, *(own for own in slower.calibrations if own.name != wrong.name)])
    mistyped = with_torque(slower, freed.predict_all(np.append(by, freed.start()[1:])))
    heavy = with_torque(slower, slower.predict_all(slower.start(), [effect("yaw_inertia", inertia=3000.0)]))
    own, other = (sheet._reach(hidden, sheet._fitted(hidden), [wrong]) for hidden in (mistyped, heavy))
    assert own > 0.99
    assert other < 0.5


def test_every_level_is_sought_from_where_the_baseline_stands_too(slower: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """From elsewhere alone a fit with more freedom may end where more is left."""
    hidden = with_torque(slower, 1.2 * slower.predict_all(slower.start()))
    baseline, begun = sheet._fitted(hidden), list[Array]()

    def fitted(problem: Problem, start: Array) -> Fit:
        begun.append(problem.predict_all(start))
        return fit(problem, problem.sensor_weight, start=start, linearisations=1)

    monkeypatch.setattr(sheet, "_fitted", fitted)
    found = list(sheet._levels(hidden, baseline))
    there = sum(np.allclose(each, baseline.prediction, rtol=1e-9, atol=1e-6) for each in begun)
    assert there == len(found) > 5


@pytest.mark.parametrize("by", [0.62, -0.6, 0.0])
def test_a_wrong_level_is_told_beside_friction_of_another_form(slower: Problem, by: float) -> None:
    """A tenth more and less along the ground, which no entry explains; the torque is one that a sensor measures, without cylinders."""
    bare = Problem(slower.vehicle.replace(hydraulics=None), slower.runs, slower.calibrations)
    freed = bare.of_sheet(calibrations=[entries.LEVEL, *(own for own in bare.calibrations if own.name != entries.LEVEL.name)])
    along = np.concatenate([run.theta.mean(axis=0) for run in bare.runs])
    uneven = freed.predict_all(np.append(by, freed.start()[1:])) * (1.0 + 0.1 * np.sin(60.0 * along))
    told = sheet.wrong_sheet(with_torque(bare, uneven))
    assert (told is None) == (by == 0.0)
    if told is not None:
        assert "friction.coulomb" in [suspect.key for suspect in told.suspects[:2]]
        assert told.rest > 0.5  # most of what is left stays
        assert not told.certain


def test_an_entry_beside_which_the_sheet_stays_a_surprise_is_no_first_suspect(slower: Problem) -> None:
    """Friction and kingpin arm are off, beside friction of another form: with less sticking a little less is left, but the level is as far
    off as before."""
    bare = Problem(slower.vehicle.replace(hydraulics=None), slower.runs, slower.calibrations)
    levels = [entries.LEVEL, entries.CONSERVATIVE]
    freed = bare.of_sheet(calibrations=[*levels, *(own for own in bare.calibrations if own.name != entries.LEVEL.name)])
    along = np.concatenate([run.theta.mean(axis=0) for run in bare.runs])
    uneven = freed.predict_all(np.concatenate([[0.55, 0.1], freed.start()[2:]])) * (1.0 + 0.02 * np.sin(60.0 * along))
    told = sheet.wrong_sheet(with_torque(bare, uneven))
    assert told is not None
    keys = [suspect.key for suspect in told.suspects]
    assert {"axle.load_N", "friction.coulomb"} < set(keys[:3])
    assert not {"friction.static", "axle.kingpin_lever_arm_m"} & set(keys[:3])


def test_bends_are_as_large_as_the_data_ask_for(slower: Problem) -> None:
    """None where the torque is the model's; as large as real rubber shows where it is bent by that."""
    shapes = np.random.default_rng(6).standard_normal((slower.measured.size, 4)) * 20.0 * SIGMA
    sizes = []
    for torque in (0.0, shapes @ np.array([0.3, -0.4, 0.2, 0.3])):
        bent = replace_bends(with_torque(slower, slower.predict_all(slower.start()) + torque), shapes)
        sizes.append(compare.settled(bent, weight(bent), fit(bent, weight(bent)))[0].typical)
    assert sizes == pytest.approx([0.01 / 3.0, 1.0 / 3.0])


def test_a_name_that_only_filled_in_for_the_shape_of_another_goes(problem: Problem) -> None:
    linear, quadratic = effect("line_loss_linear", b=2e4), effect("line_loss_quadratic", c=2e5)
    hidden = with_torque(problem, problem.predict_all(problem.start(), [quadratic]))
    both = fit(hidden, weight(hidden), [linear, quadratic])
    score = Score(linear[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))
    steps = [search.Found(replace(score, candidate=candidate), (), (), gain) for (candidate, _), gain in ((linear, 5.0), (quadratic, 2.0))]
    steps[0] = replace(steps[0], rivals=("viscous_friction", "line_loss_quadratic"))
    there, kept, current = search._pruned(hidden, hidden, weight(hidden), steps, both)
    assert there.nuisances == current.x.size
    assert [candidate.effect.id for candidate, _ in current.effects] == ["line_loss_quadratic"]
    assert [(item.score.candidate.effect.id, item.gain) for item in kept] == [("line_loss_quadratic", 7.0)]
    assert kept[0].rivals == ("line_loss_linear", "viscous_friction")  # which may explain it as well


@pytest.mark.usefixtures("few_sought")
def test_a_stand_in_that_was_chosen_first_is_exchanged_for_what_is_there(slower: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """A loss of the wrong power, fitted beside what else was found, is the right one once that is known, unless that would have to act as
    strongly as it ever does; what is right stays."""
    right, stand_in = effect("line_loss_quadratic", c=2e5), effect("line_loss_linear", b=2e4)
    other = effect("kingpin_jacking", amplitude=400.0)
    hidden = with_torque(slower, slower.predict_all(slower.start(), [right, other]))
    draws = SIGMA * np.random.default_rng(4).standard_normal((16, hidden.measured.size))
    quiet = noise.Noise(np.full(hidden.measured.size, SIGMA), draws, 0.0)
    for first, stays, named in ((stand_in, False, right), (right, True, right), (stand_in, True, stand_in)):
        if named is stand_in:
            monkeypatch.setattr(search, "as_far_as_it_may", lambda *_: True)
        both = fit(hidden, weight(hidden), [first, other])
        score = Score(first[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))
        names = [search.Found(replace(score, candidate=candidate), (), (), 1e3) for candidate, _ in (first, other)]
        _, found, current = search._exchanged(hidden, quiet, weight(hidden), split.split(hidden), names, both, 0, lambda _: None)
        assert [item.score.candidate.effect.id for item in found] == [candidate.effect.id for candidate, _ in current.effects]
        assert {item.score.candidate.effect.id for item in found} == {named[0].effect.id, "kingpin_jacking"}
        assert (found == names) == stays


@pytest.mark.parametrize("exchanged", [False, True])
def test_a_name_that_an_exchange_makes_superfluous_goes(slower: Problem, monkeypatch: pytest.MonkeyPatch, exchanged: bool) -> None:
    """A loss of the wrong power stands beside a load, and goes where the right one comes in place of that."""
    first, right = effect("line_loss_linear", b=2e4), effect("line_loss_quadratic", c=2e5)
    other = effect("kingpin_jacking", amplitude=400.0)
    hidden = with_torque(slower, slower.predict_all(slower.start(), [right, other] if exchanged else [first, other]))

    def named(one: tuple[Candidate, dict[str, float]]) -> search.Found:
        score = Score(one[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))
        return search.Found(score, (), (trial.Trial(score, fit(hidden, weight(hidden), [one]), 0.0),), 1e3)

    def step(_: object, current: Fit, names: Sequence[search.Found], weight: Array, *__: object) -> search._Step | None:
        both = [first, other][: len(names) + 1]
        result = fit(hidden, weight, both, current.x[: hidden.nuisances])
        done = len(names) == 2 or (names and names[0].score.candidate is right[0])
        return None if done else search._Step(hidden, result, named(both[-1]), short=False)

    def swap(there: Problem, _: object, weight: Array, __: object, found: Sequence[search.Found], current: Fit, *___: object) -> object:
        if not exchanged:
            return there, list(found), current
        return hidden, [found[0], named(right)], fit(hidden, weight, [first, right], current.x[: hidden.nuisances])

    monkeypatch.setattr(search, "_step", step)
    monkeypatch.setattr(search, "_exchanged", swap)
    monkeypatch.setattr(search, "_of_sensors", lambda *_: None)  # which would take it away at the end
    monkeypatch.setattr(search, "_round", lambda problem, *_: propose.Proposal(problem, fit(problem, weight(problem)), (), []))
    told = [item.score.candidate.effect.id for item in searched(hidden).found]
    assert told == (["line_loss_quadratic"] if exchanged else ["line_loss_linear", "kingpin_jacking"])


def test_a_name_does_not_go_because_its_own_bends_could_stand_in_for_it(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "BENT", 1.0)
    linear, slow = effect("line_loss_linear", b=2e4), effect("pressure_lag", tau=0.05)
    hidden = with_torque(problem, problem.predict_all(problem.start(), [linear, slow]))
    exact = fit(hidden, weight(hidden), [linear, slow])
    beside, x = search._shaped(hidden, hidden, exact, [0])
    both = fit(beside, weight(hidden), exact.effects, x)
    without = fit(beside, weight(hidden), both.effects[1:], both.x)
    needed = compare.needed(beside, both, weight(hidden))
    assert without.cost - both.cost < 3.0 * needed  # nearly all that it does, its bends do
    score = Score(linear[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))
    steps = [search.Found(replace(score, candidate=candidate), (), (), 5.0) for candidate, _ in (linear, slow)]
    _, kept, current = search._pruned(hidden, beside, weight(hidden), steps, both)
    assert len(kept) == len(current.effects) == 2


@pytest.mark.parametrize("given", [False, True])
@pytest.mark.parametrize("last", [False, True])
def test_what_is_of_no_sure_size_goes_what_every_joint_may_have_last(problem: Problem, given: bool, last: bool) -> None:
    """A loss that is there, and an offset that is not."""
    loss, nothing = effect("line_loss_linear", b=2e4), effect("slope_bias", torque=0.0)
    hidden = with_torque(problem, problem.predict_all(problem.start(), [loss]))
    both = fit(hidden, weight(hidden), [nothing, loss])
    hidden = hidden.doubted(doubt(hidden, both, weight(hidden)), hidden.typical)
    score = Score(loss[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))
    found = [search.Found(replace(score, candidate=candidate), (), (), 1.0, given=given) for candidate, _ in (nothing, loss)]
    kept, current = search._of_sure_size(hidden, weight(hidden), split.split(hidden), both, found, given=last)
    names = ["slope_bias", "line_loss_linear"] if given and not last else ["line_loss_linear"]
    assert [item.score.candidate.effect.id for item in kept] == names
    assert [candidate.effect.id for candidate, _ in current.effects] == names


def test_an_optional_part_that_may_be_nothing_goes_alone(problem: Problem) -> None:
    hidden = with_torque(problem, problem.predict_all(problem.start(), [effect("kingpin_jacking", amplitude=2e3)]))
    whole = effect("kingpin_jacking", amplitude=2e3, second_harmonic=0.0)
    both = fit(hidden, weight(hidden), [whole])
    hidden = hidden.doubted(doubt(hidden, both, weight(hidden)), hidden.typical)
    found = [search.Found(Score(whole[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4)), (), (), 1.0, given=True)]
    kept, current = search._of_sure_size(hidden, weight(hidden), split.split(hidden), both, found, given=True)
    assert len(kept) == 1
    ((candidate, values),) = current.effects
    assert candidate.free == ("amplitude",)
    assert values["amplitude"] == pytest.approx(2e3, rel=0.1)


def test_of_two_parts_that_do_the_same_one_goes_and_what_they_are_parts_of_stays(problem: Problem) -> None:
    """Within a few degrees a torque of the sine of the angle and one of its double are one, so that neither is sure."""
    narrow = problem.over([replace(run, theta=0.2 * run.theta) for run in problem.runs])
    hidden = with_torque(narrow, narrow.predict_all(narrow.start(), [effect("kingpin_jacking", amplitude=1e4)]))
    both = fit(hidden, weight(hidden), [effect("kingpin_jacking", amplitude=1e3, second_harmonic=4.5e3)])
    hidden = hidden.doubted(doubt(hidden, both, weight(hidden)), hidden.typical)
    sizes = surely.in_deviations(hidden, weight(hidden), split.split(hidden), both, 0)
    assert max(sizes.values()) < surely.SURE_OF_SIZE
    found = [search.Found(Score(both.effects[0][0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4)), (), (), 1.0, given=True)]
    kept, current = search._of_sure_size(hidden, weight(hidden), split.split(hidden), both, found, given=True)
    assert len(kept) == 1
    assert current.effects[0][1]["amplitude"] == pytest.approx(1e4, rel=0.1)


@pytest.mark.parametrize("slip_scale", [0.05, 1.0])
def test_a_law_that_has_acted_before_any_recording_shows_it_is_no_name(slower: Problem, slip_scale: float) -> None:
    """Polishing within the shortest slip that it may take is another level of friction."""
    polished = effect("wear_polishing", amount=0.1, slip_scale=slip_scale)
    hidden = with_torque(slower, slower.predict_all(slower.start(), [polished]))
    named = fit(hidden, weight(hidden), [polished])
    found = [search.Found(Score(polished[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4)), (), (), 1.0)]
    kept, _ = search._of_sure_size(hidden, weight(hidden), split.split(hidden), named, found)
    assert bool(kept) == (slip_scale > 0.05)


@pytest.mark.parametrize(("range_bar", "torque", "names"), [
    (10.0, 60.0, ["slope_bias", "viscous_friction"]), (250.0, 60.0, ["viscous_friction"]), (1000.0, 240.0, ["viscous_friction"]),
])  # fmt: skip
def test_what_zeros_of_sensors_may_be_is_no_name(slower: Problem, range_bar: float, torque: float, names: list[str]) -> None:
    """A constant in recordings of a minute, where zeros settle by as much, slowly; a loss is none, and stays as sure as it was
    beside a constant that is far larger."""
    sheet = slower.vehicle.replace(sensors=replace(slower.vehicle.sensors, pressure_range_Pa=1e5 * range_bar))
    hidden = [effect("slope_bias", torque=torque), effect("viscous_friction", sigma_2=4e2)]
    problem = with_torque(Problem(sheet, slower.runs), slower.predict_all(slower.start(), hidden))
    current = fit(problem, weight(problem), hidden)
    score = Score(hidden[0][0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))
    found = [search.Found(replace(score, candidate=candidate), (), (), 1.0) for candidate, _ in hidden]
    _, current, found = search._without_those_of_sensors(problem, problem, weight(problem), current, found)
    assert [item.score.candidate.effect.id for item in found] == names
    assert [candidate.effect.id for candidate, _ in current.effects] == names


@pytest.mark.parametrize("given", [False, True])
def test_a_value_is_no_surer_than_the_form_of_its_law(problem: Problem, given: bool) -> None:
    """White noise leaves a small part of a loss in doubt; that of a name may be off by the share that laws have wrong."""
    loss = effect("line_loss_linear", b=2e4)
    hidden = with_torque(problem, problem.predict_all(problem.start(), [loss]))
    named = fit(hidden, weight(hidden), [loss])
    item = search.Found(Score(loss[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4)), (), (), 1.0, given=given)
    white = noise.Noise(np.full(hidden.valid.size, SIGMA), np.zeros((1, hidden.valid.size)), 0.0)
    done = Finished(hidden, white, split.split(hidden), search.Search(fit(hidden, weight(hidden)), named, (item,), (), ()))
    low, high = effects._intervals(done, named, named)[0]["b"].ci95
    share = 0.5 * (high - low) / named.effects[0][1]["b"]
    assert share < 0.05 if given else 0.02**0.5 < share < 0.02**0.5 + 0.05


def test_a_place_in_time_is_tried_beside_a_place_in_the_angle() -> None:
    patch = Candidate(CATALOGUE["surface_patch"], free=("change",))
    angle, wider, time = (
        replace(patch, shapes=shapes)
        for shapes in (
            (("angle_low", 0.0), ("angle_high", 0.1)), (("angle_low", 0.0), ("angle_high", 0.2)), (("time_start", 5.0), ("time_end", 9.0)),
        )
    )  # fmt: skip
    chance, energies = np.arange(1.0, 5.0), ((angle, 900.0), (wider, 800.0), (time, 500.0))
    scores = [Score(candidate, energy, 0.5, 0.0, 1.0, (1.0,), chance) for candidate, energy in energies]
    assert [score.candidate for score in propose.choose(scores)] == [angle, time]


@pytest.mark.parametrize("everywhere", [True, False])
def test_what_seemed_to_act_in_one_recording_acts_in_all_once_the_reason_is_named(problem: Problem, everywhere: bool) -> None:
    linear, offset = effect("line_loss_linear", b=2e4), effect("slope_bias", torque=600.0)
    partial = replace(linear[0], bags=(0,)), linear[1]
    hidden = with_torque(problem, problem.predict_all(problem.start(), [linear if everywhere else partial, offset]))
    seemed = fit(hidden, weight(hidden), [partial, offset])
    name = search.Found(Score(partial[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4)), (), (), 1000.0)
    (candidate, values), _ = search._everywhere(hidden, weight(hidden), seemed, [name]).effects
    assert candidate.bags == (None if everywhere else (0,))
    assert values["b"] == pytest.approx(2e4, rel=0.1)


def test_what_stands_is_named_though_as_much_again_is_unlisted(slower: Problem) -> None:
    """A loss of the lines stays beside a torque that no entry makes and that is nearly half of it; alone, that torque is no name."""
    theta, omega = (np.concatenate([getattr(run, key).mean(axis=0) for run in slower.runs]) for key in ("theta", "omega"))
    ripple = 350.0 * np.sin(2.0 * np.pi * theta / np.radians(3.7)) * np.sign(omega)
    listed = slower.predict_all(slower.start(), [effect("line_loss_quadratic", c=3e4)])
    for torque, names in ((listed + ripple, {"line_loss_quadratic"}), (slower.predict_all(slower.start()) + ripple, set())):
        found = searched(with_torque(slower, torque))
        assert {item.score.candidate.effect.id for item in found.found} == names


def uneven_loss(slower: Problem, size: float, uneven: float) -> Problem:
    """A loss that is stronger or weaker by stretches of time, beside freedoms that can be that of each stretch by itself."""
    base = slower.predict_all(slower.start())
    loss = slower.predict_all(slower.start(), [effect("line_loss_quadratic", c=size)]) - base
    stretch = np.arange(loss.size) * 16 // loss.size
    pieces = np.where(stretch[:, None] == np.arange(16), loss[:, None], 0.0)
    torque = pieces @ (1.0 + uneven * np.random.default_rng(7).choice([-1.0, 1.0], 16))
    return replace_bends(with_torque(slower, base + torque), 3.0 * pieces)


@pytest.mark.usefixtures("few_sought")
@pytest.mark.parametrize(("uneven", "names"), [(0.2, ["line_loss_quadratic"]), (0.9, [])])
def test_one_name_stands_for_freedoms_that_it_does_nearly_all_of(slower: Problem, uneven: float, names: list[str]) -> None:
    """Where it is nearly of one law in all, and by far not."""
    found = searched(uneven_loss(slower, 1e5, uneven))
    assert [item.score.candidate.effect.id for item in found.found] == names
    assert all(item.in_place for item in found.found)


@pytest.mark.usefixtures("few_sought")
@pytest.mark.parametrize(
    ("uneven", "names", "instead"), [(0.2, ["line_loss_quadratic"], []), (0.3, [], ["line_loss_quadratic"]), (0.5, [], [])]
)
def test_a_name_that_ties_with_freedoms_is_told_in_their_place(
    slower: Problem, uneven: float, names: list[str], instead: list[str]
) -> None:
    """Of a weak loss: it stands, the data cannot tell it from the freedoms, or these do clearly better."""
    found = searched(uneven_loss(slower, 3e3, uneven))
    assert [item.score.candidate.effect.id for item in found.found] == names
    assert [trial.candidate.effect.id for trial in found.instead] == instead


@pytest.mark.parametrize(
    ("beside", "stretches", "uneven", "waves", "wavy_draws", "stand"),
    [
        ("true", 16, 0.02, 0.0, 0, True), ("true", 16, 0.9, 0.0, 0, False), ("true", 40, 0.02, 0.5, 0, False),
        ("true", 40, 0.02, 0.5, 16, True), ("true", 40, 0.02, 0.5, 2, True), ("in vain", 16, 0.02, 0.0, 0, False),
        ("", 4, 0.02, 0.0, 0, False), ("", 16, 0.02, 0.0, 0, True),
    ],
)  # fmt: skip
def test_names_stand_for_freedoms_beside_which_they_are_short(
    slower: Problem, beside: str, stretches: int, uneven: float, waves: float, wavy_draws: int, stand: bool
) -> None:
    """Freedoms may do what two do in each stretch of time by itself, nearly of one law in all or by far not; the two do not stand where
    they leave slow waves, unless noise has such too, if only now and then, nor beside a name that does nothing, nor alone where not so
    many freedoms are evidence for two names."""
    stands = [effect("slope_bias", torque=400.0)] if beside else []
    others = [effect("line_loss_quadratic", c=1e5), effect("kingpin_jacking", amplitude=900.0)]
    base = slower.predict_all(slower.start(), stands if beside == "true" else [])
    both = slower.predict_all(slower.start(), others) - slower.predict_all(slower.start())
    stretch = np.arange(both.size) * stretches // both.size
    pieces = np.where(stretch[:, None] == np.arange(stretches), both[:, None], 0.0)
    torque = base + pieces @ (1.0 + uneven * np.random.default_rng(7).choice([-1.0, 1.0], stretches))
    slow = lfilter([0.3], [1.0, -0.95], np.random.default_rng(6).standard_normal((17, both.size)))
    wave = SIGMA * slow[-1]
    hidden = replace_bends(with_torque(slower, torque + waves * wave), 3.0 * np.column_stack([pieces, wave]))
    hidden = hidden.doubted(1.0, hidden.typical)
    roles = split.split(hidden)
    fitted = np.where(roles.fit, weight(hidden), 0.0)
    draws = SIGMA * np.random.default_rng(4).standard_normal((16, hidden.measured.size))
    draws[:wavy_draws] += waves * SIGMA * slow[:wavy_draws]
    seen = noise.Noise(np.full(hidden.measured.size, SIGMA), draws, 0.0)
    names = [search.Found(Score(one[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4)), (), (), 1000.0) for one in stands]
    sure = names, hidden, fit(hidden, fitted, stands)
    found = search._in_place(hidden, seen, fitted, roles, sure, lambda _: None)
    assert (found is not None) == stand
    if found is not None:
        both_beside = {candidate.effect.id for candidate, _ in [*stands, *others]}
        assert {candidate.effect.id for candidate, _ in found[2][2].effects} == both_beside
        assert [item.in_place for item in found[2][0]] == [*[False] * len(stands), True, True]
        assert found[0].typical < hidden.typical


@pytest.mark.parametrize(("width", "grows"), [(0.001, 0.0), (0.001, 2.0), (0.004, 0.0)])
def test_of_names_for_freedoms_none_may_have_acted_before_it_shows(slower: Problem, width: float, grows: float) -> None:
    """A softening that is over within the shortest way, or may be by all that is known of it, is nothing but another stiffness; that a part
    of a law which need not be there is none says nothing against the law."""
    shortest = effect("mullins_softening", amplitude=0.8, width=width)
    stop = effect("soil_shear", torque=900.0, span=0.1, growth=grows)
    weights = np.where(split.split(slower).fit, weight(slower), 0.0)
    both = slower.predict_all(slower.start(), [shortest, stop])
    found = fit(with_torque(slower, both), weights, [shortest, stop])
    refused = [search._acts_before_it_shows(slower, weights, split.split(slower), found, i) for i in (0, 1)]
    assert refused == [True, False]


@pytest.mark.parametrize("settles", [False, True])
def test_names_are_doubted_by_what_they_took_as_far_as_their_laws_bend(problem: Problem, settles: bool) -> None:
    """A twenty-fifth of it; more of those that settle with time, bent or not; of what every joint has a hundredth of all that it does."""
    one = effect("pressure_lag", tau=0.05) if settles else effect("line_loss_quadratic", c=3e5)
    torque, base = (problem.predict_all(problem.start(), effects) for effects in ([one], []))
    bent = with_torque(problem, torque).bent([0.3 * (torque - base)[:, None]])
    result = fit(bent, weight(problem), [one])
    of_bends = (np.arange(result.x.size) == problem.nuisances) * 0.5
    little, much, straight = (
        compare.may_differ(bent, replace(result, x=result.x + size * of_bends), 1, [gain]) for gain, size in ((1e3, 1), (1e9, 1), (1e9, 0))
    )
    does = float(np.sum(((torque - base) * weight(problem)) ** 2))
    if settles:
        assert (little, much, straight) == pytest.approx((60.0, 6e7, 6e7))
        assert 0.0 < compare.may_differ(bent, result, 1, []) <= 0.0101 * does
    else:
        assert straight < 1e-6 * does
        assert little == pytest.approx(40.0, abs=1.0)
        assert 0.0 < much <= 20.0 * 0.15**2 * does


def test_a_track_is_asked_for_nothing_that_only_joints_show(problem: Problem) -> None:
    """Each candidate has all parameters by which its entry says that it acts: their bounds are looked up."""
    offered = fingerprint.candidates(problem)
    (jacking,) = (candidate for candidate in offered if candidate.effect.id == "kingpin_jacking")
    assert jacking.free == ("amplitude",)
    assert "cosine" not in jacking.effect.amplitudes
    (viscous,) = (candidate for candidate in offered if candidate.effect.id == "viscous_friction")
    assert viscous.parameter("thinning").low == 0.0
    assert all(candidate.parameter(name) for candidate in offered for name in candidate.effect.amplitudes)


def test_the_error_of_an_arm_counts_in_the_torque_as_measured(problem: Problem) -> None:
    """With both tracks at one angle the true torque is the measured one times the factor; its error is divided by it again."""
    alike = replace(problem.runs[0], theta=np.repeat(problem.runs[0].theta[:1], 2, axis=0))
    alone = Problem(problem.vehicle, [replace(alike, measured=alike.side_torque.sum(axis=0))])
    model = alone.predict_all(alone.start())
    for linear in (0.1, -2.0):
        factor = 1.0 + linear * alike.theta[0]
        seen = alone.predict_all(alone.start(), [effect("moment_arm_error", linear=linear)])
        np.testing.assert_allclose(alone.measured - seen, (factor * alone.measured - model) / factor, rtol=1e-9, atol=1e-6)


def test_relief_ceilings_follow_the_arms_of_the_sheet(problem: Problem) -> None:
    relief = CATALOGUE["relief_saturation"]
    assert relief.variants is not None
    found = relief.variants(fingerprint._seen(problem))
    assert len(found) == len(CEILINGS)
    shapes = found[-1]
    run = problem.runs[0]
    pushed = np.maximum(run.torque_per_line, 0.0).sum(axis=0)
    theta = run.theta.mean(axis=0)
    arm = 1.0 + theta * (shapes["arm_slope"] + theta * shapes["arm_curvature"])
    assert np.ptp(pushed / arm) < 0.01 * pushed.mean()  # one pressure makes this torque at every angle
    # One line alone pushes in one direction only, and says nothing about the other.
    single = [replace(each, gains=np.where(np.arange(each.gains.shape[1])[:, None] == 0, each.gains, 0.0)) for each in problem.runs]
    for variant in relief.variants(fingerprint._seen(Problem(problem.vehicle, single))):
        assert all(np.isfinite(value) for value in variant.values())


def test_the_next_experiment_does_not_depend_on_when_an_effect_began(problem: Problem) -> None:
    result = fit(problem, weight(problem))
    energies = []
    for since, bags in (((), None), ((np.inf, 30.0), (1,))):
        sides = [effect("line_loss_linear", b=2e4), effect("line_loss_quadratic", c=2e5)]
        first, second = ([(replace(candidate, since=since, bags=bags), values)] for candidate, values in sides)
        energies.append(experiment.separation(problem, result, first, second, SIGMA))
    assert energies[0] == energies[1]
    assert max(energies[0].values()) > 100.0


def test_detection_limits_are_sizes_at_which_so_much_can_be_seen(problem: Problem) -> None:
    """The trace at the limit keeps its energy after the best recalibration; some laws are linear in their size, some are not."""
    result, draws = fit(problem, weight(problem)), SIGMA * np.random.default_rng(4).standard_normal((8, problem.measured.size))
    scores = fingerprint.screen(problem, result, weight(problem), draws)
    found = limits.smallest(problem, result, weight(problem), scores, ["slope_bias"])
    assert "slope_bias" not in found
    assert {"viscous_friction", "distributed_contact", "yaw_inertia", "end_stop"} <= set(found)
    for id_ in ("viscous_friction", "distributed_contact", "yaw_inertia"):
        parameter, size = found[id_]
        shown = visible_energy(problem, result, weight(problem), effect(id_, **{parameter.name: size}))
        assert shown == pytest.approx(limits.REVEALED * problem.valid.sum(), rel=0.15)


def visible_energy(problem: Problem, result: Fit, seen: np.ndarray, *effects: tuple) -> float:
    """What recalibration cannot imitate of a trace, or only at the cost of its priors, by least squares with these as further rows."""
    columns = np.vstack([result.jacobian, np.diag(result.pull)])
    trace = np.append((problem.predict_all(result.x, effects) - problem.predict_all(result.x)) * seen, np.zeros(result.pull.size))
    left = trace - columns @ np.linalg.lstsq(columns, trace, rcond=1e-10)[0]
    return float(np.sum(left**2))


@pytest.mark.parametrize("blunter", [4.0, 16.0, 30.0])
def test_no_shape_and_no_sign_shows_at_half_a_limit(problem: Problem, blunter: float) -> None:
    """In blunter recordings the sizes are large, where traces bend, other shapes are better seen, and a sign makes a difference."""
    blunt = weight(problem) / blunter
    result, draws = fit(problem, blunt), blunter * SIGMA * np.random.default_rng(4).standard_normal((8, problem.measured.size))
    scores = fingerprint.screen(problem, result, blunt, draws)
    found = limits.smallest(problem, result, blunt, scores, [])
    needed = limits.REVEALED * problem.valid.sum()
    for id_ in ("static_ageing", "wear_polishing", "angle_scale", "linkage_compliance"):
        parameter, size = found[id_]
        shapes = {s.candidate.shapes for s in scores if s.candidate.effect.id == id_ and not s.candidate.since}
        largest = max(abs(parameter.high), abs(parameter.low))
        for sign, bound in ((1.0, parameter.high), (-1.0, -parameter.low)):
            half = largest if size is None else 0.5 * size
            for shape in shapes if bound > 0.0 else ():
                values = {**dict(shape), parameter.name: sign * min(half, bound)}
                assert visible_energy(problem, result, blunt, effect(id_, **values)) < 1.2 * needed


def test_what_no_size_could_show_has_no_limit(problem: Problem) -> None:
    blunt = weight(problem) / 1e3
    result, draws = fit(problem, blunt), 1e3 * SIGMA * np.random.default_rng(4).standard_normal((8, problem.measured.size))
    found = limits.smallest(problem, result, blunt, fingerprint.screen(problem, result, blunt, draws), [])
    assert found["heat_partition"][1] is None


def test_a_name_that_must_go_as_far_as_it_may_does_not_stand_for_a_group() -> None:
    named = [effect("slope_bias", torque=1.0), effect("kingpin_jacking", amplitude=1.0)]
    score = Score(named[0][0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))
    most = named[0][0].parameter("torque").high

    def made_up(candidate: Candidate, cost: float, **values: float) -> trial.Trial:
        made = fit_of(cost, (candidate, values))
        return trial.Trial(score, made, cost)

    within, other = made_up(named[0][0], 480.0, torque=0.5 * most), made_up(named[1][0], 500.0, amplitude=1.0)
    at_end = made_up(named[0][0], 480.0, torque=most)
    assert compare.simplest(within, [other], 1000.0, 1.0)[0] is within
    assert compare.simplest(at_end, [other], 1000.0, 1.0) == (other, [at_end])


def test_an_onset_must_explain_clearly_more_to_stand_for_a_group() -> None:
    before, candidates = 1000.0, [effect("slope_bias", torque=1.0)[0], effect("kingpin_jacking", amplitude=1.0)[0]]
    score = Score(candidates[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))

    def made_up(candidate: Candidate, cost: float, since: tuple[float, ...] = ()) -> trial.Trial:
        named = ((replace(candidate, since=since), {}),)
        made = fit_of(cost, *named)
        return trial.Trial(score, made, cost)

    always, late = made_up(candidates[0], 500.0), made_up(candidates[1], 480.0, (10.0, 10.0))
    much_better = made_up(candidates[1], 300.0, (10.0, 10.0))
    assert trial.ranked([late, always], before)[0] is always
    assert compare.simplest(always, [late], before, 1.0)[0] is always
    assert trial.ranked([always, much_better], before)[0] is much_better
    assert compare.simplest(much_better, [always], before, 1.0)[0] is much_better


def test_laws_that_differ_by_less_than_their_own_form_are_tied(problem: Problem) -> None:
    """Nature is true to no law to four hundredths of its energy; lines of the same law are another matter."""
    roles, x = split.split(problem), problem.start()
    truth = effect("slope_bias", torque=2000.0)
    hidden = with_torque(problem, problem.predict_all(x, [truth]))
    seen = np.where(roles.fit, weight(hidden), 0.0)
    score = Score(truth[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))
    before = trial.cost(hidden, fit(hidden, seen), seen)

    def made_up(id_: str, off: float) -> trial.Trial:
        right = fit(hidden, seen, [truth])
        wrong = replace(right, prediction=right.prediction + off, effects=((effect(id_, torque=1.0)[0], {}),))
        return trial.Trial(score, wrong, trial.cost(hidden, wrong, seen))

    best = made_up("slope_bias", 0.0)
    far = np.sqrt(before - best.cost) / np.linalg.norm(seen)  # an error as large as all that the best takes
    for share, id_, exact, tied in (
        (0.03, "back_pressure", False, True), (0.03, "back_pressure", True, False), (0.05, "back_pressure", False, False),
        (0.05, "stress_relaxation", False, True), (0.08, "stress_relaxation", False, False),
    ):  # fmt: skip
        other = made_up(id_, far * share**0.5)
        rivals = compare.tied(hidden, seen, roles, best, [other], before, exact=exact)
        assert bool(rivals) == tied


def test_what_needs_recalibration_at_its_bounds_ties_with_nothing(problem: Problem) -> None:
    """It could not be named alone either; beside a best one that needs the same it may be as good."""
    roles, x = split.split(problem), problem.start()
    truth, rival = effect("slope_bias", torque=2000.0), effect("back_pressure", torque=1.0)
    hidden = with_torque(problem, problem.predict_all(x, [truth]))
    seen = np.where(roles.fit, weight(hidden), 0.0)
    score, right = Score(truth[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4)), fit(hidden, seen, [truth])
    before = trial.cost(hidden, fit(hidden, seen), seen)
    level = next(i for i, c in enumerate(hidden.calibrations) if c.name == "friction_level")
    far = right.x.copy()
    far[level] = hidden.calibrations[level].high

    def tried(own: tuple[Candidate, dict[str, float]], x: Array) -> trial.Trial:
        return trial.Trial(score, replace(right, x=x, effects=(own,)), right.cost)

    sound, too_far = tried(rival, right.x), tried(rival, far)
    for best, other, tied in ((right.x, sound, True), (right.x, too_far, False), (far, too_far, True)):
        assert bool(compare.tied(hidden, seen, roles, tried(truth, best), [other], before)) == tied


def test_a_rival_comes_with_all_parts_of_its_law(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that it had when it was found to fit as well, when that is asked again with more known."""
    compared: list[trial.Trial] = []

    def tied(*given: object, **_: object) -> list[trial.Trial]:
        compared.extend(given[4])  # type: ignore[arg-type]
        return []

    monkeypatch.setattr(search, "tied", tied)
    truth, rival = effect("linkage_compliance", compliance=1e-6), effect("backlash", width=0.01, softness=900.0)
    hidden = with_torque(problem, problem.predict_all(problem.start(), [truth]))
    seen, roles = weight(hidden), split.split(hidden)
    own, other = (fit(hidden, seen, [one]) for one in (truth, rival))
    score = Score(truth[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))
    item = search.Found(score, ("backlash",), (trial.Trial(score, other, other.cost),), 1.0)
    none = noise.Noise(np.full(hidden.measured.size, SIGMA), np.zeros((4, hidden.measured.size)), 0.0)
    search._rivals(hidden, none, seen, roles, own, item, 0)
    assert [(each.candidate.effect.id, each.candidate.free) for each in compared] == [("backlash", ("width", "softness"))]


def test_a_known_rival_is_tried_where_the_leader_stands_with_the_shapes_of_its_law(problem: Problem) -> None:
    """Payne softening for which several bristles led: its angle is no place of the grid, and that it is a rival the other one says."""
    hidden = with_torque(problem, problem.predict_all(problem.start(), [effect("payne_softening", amplitude=0.2, angle=0.034)]))
    seen = weight(hidden)
    current = fit(hidden, seen)
    draws = SIGMA * np.random.default_rng(1).standard_normal((8, hidden.measured.size))
    scores = sorted(fingerprint.screen(hidden, current, seen, draws), key=lambda score: -score.explained)
    whole = [score for score in scores if score.candidate.bags is None and not score.candidate.since]
    bristles = next(score for score in whole if score.candidate.effect.id == "distributed_contact")
    leads = trial.Round(hidden, seen, current, scores).try_effect(bristles)
    (found,) = propose.in_its_place(hidden, seen, propose.Proposal(hidden, current, tuple(scores), [leads]), leads)
    assert found.candidate.effect.id == "payne_softening"
    assert found.fit.effects[-1][1]["angle"] == pytest.approx(0.034, rel=0.1)
    assert found.cost < leads.cost - 1e3
    assert search.ranked([leads, found], current.cost)[0] is found


def test_of_one_claim_about_different_recordings_the_simpler_is_kept_unless_the_other_takes_clearly_more() -> None:
    def tried(id_: str, cost: float, bags: tuple[int, ...] | None) -> trial.Trial:
        named = ((replace(effect(id_)[0], bags=bags), {}),)
        made = fit_of(cost, *named)
        return trial.Trial(Score(named[0][0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4)), made, cost)

    whole, little, much = tried("backlash", 500.0, None), tried("backlash", 480.0, (0,)), tried("backlash", 300.0, (0,))
    other = tried("linkage_compliance", 700.0, (1,))
    assert propose._one_of_each([little, whole, other], 1000.0) == [whole, other]
    assert propose._one_of_each([much, whole, other], 1000.0) == [much, other]


def test_of_one_claim_at_places_far_apart_the_better_leads_whichever_world_found_it(problem: Problem) -> None:
    """A patch at 12 to 17 deg, sought from there and from the other side of the travel, where a fit stays."""
    seen, patch = weight(problem), Candidate(CATALOGUE["surface_patch"], free=("change", "angle_low", "angle_high"))
    truth = patch, {"change": -0.1, "angle_low": 0.21, "angle_high": 0.3}
    hidden = with_torque(problem, problem.predict_all(problem.start(), [truth]))
    current, tried = fit(hidden, seen), []
    for low, high, change in ((0.2, 0.28, -0.08), (-0.3, -0.2, 0.03)):
        values = {"change": change, "angle_low": low, "angle_high": high}
        one = fit(hidden, seen, [(patch, values)], current, linearisations=3)
        tried.append(trial.Trial(Score(patch, 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(3)), one, one.cost))
    near, far = (propose.Proposal(hidden, current, (), [each]) for each in tried)
    for worlds in ([near, far], [far, near]):
        (best,) = propose.closer(hidden, seen, worlds).trials
        assert best.fit.effects[-1][1]["angle_low"] == pytest.approx(0.21, abs=0.01)


def test_an_event_in_one_block_is_seen_by_what_fits_and_by_what_judges(slower: Problem) -> None:
    """Recalibration that was fitted to the event would leave its error elsewhere, and it would be split by that."""
    torque = slower.predict_all(slower.start())
    run, clipped = slower.runs[1], torque.copy()
    elapsed = run.time - run.time[0]
    event = np.append(np.zeros(slower.edges[1], bool), (elapsed > 35.0) & (elapsed < 40.0))
    highest = 0.85 * np.abs(torque[event]).max()
    clipped[event] = np.clip(torque[event], -highest, highest)
    hidden = with_torque(slower, clipped)
    _, roles, _ = recalibrate(hidden, noise.repeated_motion(hidden, 8, 1), 1)
    energy = (torque - clipped) ** 2
    assert energy[roles.fit].sum() > 0.3 * energy.sum()
    assert energy[roles.held].sum() > 0.05 * energy.sum()


def test_sensor_effects_of_the_vehicle_file_are_in_the_baseline(problem: Problem) -> None:
    """And count once where they are given again."""
    for id_, values in (("pressure_offset", {"main_a": 5e4}), ("time_delay", {"delay": 0.2}), ("moment_arm_error", {"linear": 0.1})):
        knowing = Problem(problem.vehicle.replace(effects=(EffectEntry(id_, values),)), problem.runs)
        line, key = (next(iter(values)), "offset") if CATALOGUE[id_].per_line else ("", next(iter(values)))
        given = replace(effect(id_, **{key: 1.0})[0], line=line)
        plain, x = problem.predict_all(problem.start()), problem.start()
        expected = problem.predict_all(x, [(given, {key: next(iter(values.values()))})])
        assert np.abs(expected - plain).max() > 50.0
        np.testing.assert_allclose(knowing.predict_all(x), expected, atol=1e-9)
        other = [(given, {key: 0.5 * next(iter(values.values()))})]
        np.testing.assert_allclose(knowing.predict_all(x, other), problem.predict_all(x, other), atol=1e-9)


def test_two_parts_of_a_law_that_do_the_same_work_are_not_both_dropped(problem: Problem) -> None:
    """Growth with the flow and a softer change of sign are each uncertain beside the other, but needed together."""
    truth = effect("back_pressure", torque=150.0, flow=4.0, rate_scale=0.012)
    hidden = with_torque(problem, problem.predict_all(problem.start(), [truth]))
    plain = effect("back_pressure", torque=150.0)
    score = Score(plain[0], 1.0, 1.0, 0.0, 1.0, (1.0,), np.ones(4))
    result = fit(hidden, weight(hidden), [plain])
    refined = trial.refine(hidden, weight(hidden), trial.Trial(score, result, trial.cost(hidden, result, weight(hidden))))
    assert refined.cost < 1.02 * hidden.valid.sum()  # without either 1.09
    # Where the law is plain, nothing is added to it.
    hidden = with_torque(problem, problem.predict_all(problem.start(), [plain]))
    result = fit(hidden, weight(hidden), [plain])
    lean = trial.refine(hidden, weight(hidden), trial.Trial(score, result, trial.cost(hidden, result, weight(hidden))))
    assert lean.candidate.free == ("torque",)


def test_short_standstills_leave_more_doubt_about_slow_noise(problem: Problem) -> None:
    run = problem.runs[0]
    rest = noise.standstill(run)
    shorter = replace(run, valid=np.where(np.arange(run.time.size) < rest[-1].start, False, run.valid))
    assert noise.slow_doubt(shorter) > 1.3 * noise.slow_doubt(run) > 0.0


@pytest.fixture(scope="module")
def patched(slower: Problem) -> tuple[Problem, Fit]:
    """Ground that changes in one recording, fitted with a window that ends too early."""
    candidate = Candidate(CATALOGUE["surface_patch"], free=("change", "time_start", "time_end"), bags=(1,))
    truth = {"change": -0.1, "time_start": 11.0, "time_end": 44.0}  # in mid-sweep, as at rest nothing shows them
    hidden = with_torque(slower, slower.predict_all(slower.start(), [(candidate, truth)]))
    return hidden, fit(hidden, weight(hidden), [(candidate, {**truth, "time_start": 24.0, "time_end": 30.0})], linearisations=1)


def test_a_window_ends_where_it_explains_most(patched: tuple[Problem, Fit]) -> None:
    hidden, wrong = patched
    assert wrong.effects[0][1]["time_end"] < 44.0 - 5.0
    places = np.linspace(-1.0, 59.0, 9).tolist()
    values = onset.placed(hidden, weight(hidden), wrong, 0, {"time_start": places, "time_end": places})
    assert [values["time_start"], values["time_end"]] == pytest.approx([11.0, 44.0], abs=1.0)


def test_where_nothing_was_fitted_a_window_may_end_anywhere(patched: tuple[Problem, Fit]) -> None:
    hidden, _ = patched
    second = np.arange(hidden.measured.size) >= hidden.edges[1]
    elapsed = np.concatenate([run.time - run.time[0] for run in hidden.runs])
    gap = second & (elapsed > 38.0) & (elapsed < 50.0)
    felt = second & (elapsed > 46.5)  # bristles carry the change on from here
    seen = np.where(gap, 0.0, weight(hidden))
    candidate = Candidate(CATALOGUE["surface_patch"], free=("change", "time_start", "time_end"), bags=(1,))
    fitted = fit(hidden, seen, [(candidate, {"change": -0.1, "time_start": 11.0, "time_end": 44.0})])
    unsure = onset.undetermined(hidden, seen, fitted)
    assert unsure[gap & ~felt].all()
    assert not unsure[~second].any()
    assert not unsure[second & (elapsed > 13.0) & (elapsed < 35.0)].any()
    known = onset.undetermined(hidden, weight(hidden), fit(hidden, weight(hidden), fitted.effects, fitted))
    assert known.sum() < 0.5 * unsure.sum()


def test_a_window_with_one_place_to_end_or_with_one_end_is_no_trouble(patched: tuple[Problem, Fit]) -> None:
    """As physics of one's own may have it."""
    hidden, wrong = patched
    candidate, values = wrong.effects[0]
    one = replace(candidate, shapes=(("time_start", 24.0), ("time_end", 30.0)))
    result = replace(wrong, effects=((one, values),))
    score = Score(one, 1.0, 1.0, 0.0, 1.0, (1.0,) * 3, np.ones(4))
    tried = trial.Trial(score, result, result.cost)
    assert trial.Round(hidden, weight(hidden), result, [score])._moved(tried) is tried
    half = {name: value for name, value in values.items() if name != "time_start"}
    alone = replace(wrong, effects=((replace(candidate, free=("change", "time_end")), half),))
    moved = onset.placed(hidden, weight(hidden), alone, 0, {"time_end": [20.0, 40.0]})
    assert moved.keys() == half.keys()
