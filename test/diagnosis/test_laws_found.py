# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The search of laws: what formulas of this file hide is found again, and where nothing is hidden nothing is. All data are synthetic."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from a_law import a_law
from remembering import remembered
from scipy.signal import lfilter
from small_problem import SIGMA, effect, small_problem, weight, with_torque
from typer.testing import CliRunner

from lugre_steering.cli import app
from lugre_steering.diagnosis import verify
from lugre_steering.diagnosis.conclude.experiment import next_experiment
from lugre_steering.diagnosis.conclude.left_over import beside_laws
from lugre_steering.diagnosis.conclude.stands import standing
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.freedom import Freedom
from lugre_steering.diagnosis.laws import rival
from lugre_steering.diagnosis.laws.cells import Axis, Cell, axes_of, trace
from lugre_steering.diagnosis.laws.find import (
    FoundLaws,
    Tried,
    _loop_gain,
    _sure,
    find,
    heldout_gains,
    leading,
    preferred,
)
from lugre_steering.diagnosis.laws.refine import closed_forms, closed_law, free_law, law_of, with_law
from lugre_steering.diagnosis.laws.rival import (
    _in_place_of_given,
    beside_form,
    evident,
    in_place,
    in_place_of_one,
    keeps_names,
    leaves_names,
)
from lugre_steering.diagnosis.laws.screen import Screen, Screened
from lugre_steering.diagnosis.laws.write import described, entries, formula, law_words, sentence
from lugre_steering.diagnosis.search.search import Search
from lugre_steering.diagnosis.search.surely import deviations
from lugre_steering.effects.law_entry import LawEntry
from lugre_steering.effects.laws import sampled
from lugre_steering.effects.own import read_effects
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import EffectError
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import Candidate, Problem
from lugre_steering.fitting.split import split
from lugre_steering.recording import Array
from lugre_steering.simulate.command import load_vehicle
from lugre_steering.vehicle import save

RATE_HZ = 25.0
"""Quick enough for whole searches."""
NOTHING = small_problem(RATE_HZ)
QUIET = 0.4
"""Size of something hidden, in noise standard deviations, that does not stand out of the noise."""


@remembered
def searched(hidden: Array | float) -> tuple[Problem, FoundLaws | None]:
    problem = with_torque(NOTHING, NOTHING.predict_all(NOTHING.start()) + hidden)
    return problem, in_what_is_left(problem, fitted(problem))


def fitted(problem: Problem, *named: tuple[Candidate, dict[str, float]]) -> Fit:
    return fit(problem, np.where(split(problem).fit, weight(problem), 0.0), named)


def in_what_is_left(problem: Problem, before: Fit) -> FoundLaws | None:
    return find(named(problem, before), before, 1)


def white(problem: Problem) -> Noise:
    draws = SIGMA * np.random.default_rng(7).standard_normal((16, problem.valid.size))
    return Noise(np.full(problem.valid.size, SIGMA), draws, 0.0)


def named(problem: Problem, final: Fit, given: bool = False) -> Finished:
    """A search that came to ``final``; ``given``: to what every joint has."""
    found = (SimpleNamespace(given=given),) * len(final.effects)
    return Finished(problem, white(problem), split(problem), Search(fitted(problem), final, found, (), ()))  # type: ignore[arg-type]


def by_run(part: object) -> Array:
    return np.concatenate([part(run) for run in NOTHING.runs])  # type: ignore[operator]


def beyond_an_angle() -> Array:
    """A loss that begins beyond an angle: what many of these tests look at, and is searched once."""
    return by_run(lambda run: np.sum(run.omega * 2e4 * np.maximum(run.theta - 0.1, 0.0), axis=0))


def fading() -> Array:
    """A torque that fades within the first seconds, which a function of the power resembles."""
    return by_run(lambda run: 200.0 * np.exp(-(run.time - run.time[0]) / 12.0))


def polished() -> Array:
    """Friction that falls where the very same place is rubbed again, by a third of what is left each time."""

    def crossed(angle: Array) -> Array:
        return np.array([np.count_nonzero((angle[1:k] - at) * (angle[: max(k - 1, 0)] - at) < 0.0) for k, at in enumerate(angle)])

    def lost(angle: Array, rate: Array) -> Array:
        return np.asarray(-400.0 * (1.0 - np.exp(-crossed(angle) / 3.0)) * np.tanh(rate / 2e-3))

    return by_run(lambda run: sum(lost(*track) for track in zip(run.theta, run.omega, strict=True)))


def test_a_place_that_is_polished_by_each_passage_is_told_from_wear_with_time_or_slip() -> None:
    _, found = searched(polished())
    assert found is not None
    (law,) = entries(found)
    assert (law.channel, law.coordinate, law.form) == ("coulomb_friction", "passes", "exponential")
    assert law.values["length"] == pytest.approx(3.0, rel=0.2)  # places are of a width, at their ends rubbed in part
    assert law.values["start"] - law.values["end"] == pytest.approx(400.0, rel=0.2)
    assert not found.ties


def test_a_closed_form_is_fitted_as_the_vehicle_file_runs_it() -> None:
    """Also where the vehicle goes beyond the range that the law was seen on: there a straight line goes on."""
    cell = Cell("conservative_torque", Axis("angle"), -0.05, 0.05)
    assert max(float(np.abs(run.theta).max()) for run in NOTHING.runs) > 2.0 * cell.high
    room = Problem(NOTHING.vehicle, NOTHING.runs, more_laws=1)
    law = closed_law(room, cell, 0, "linear", {"value": 0.0}, {"slope": 2e4})
    entry = LawEntry("conservative_torque", "angle", "linear", (cell.low, cell.high), {"value": 0.0, "slope": 2e4})
    written = Problem(NOTHING.vehicle.replace(laws=(entry,)), NOTHING.runs)
    np.testing.assert_allclose(room.predict_all(room.start(), [law]), written.predict_all(written.start()), rtol=1e-9, atol=1e-6)


def test_a_loss_beyond_an_angle_is_found_with_its_place_and_size_and_runs_from_the_vehicle_file() -> None:
    beyond = beyond_an_angle()
    problem, found = searched(beyond)
    assert found is not None
    (entry,) = entries(found)
    assert (entry.channel, entry.coordinate, entry.form) == ("viscous_loss", "angle", "hinge")
    assert entry.values["above"] == pytest.approx(2e4, rel=0.15)
    assert entry.values["at"] == pytest.approx(0.1, abs=0.02)
    assert "only beyond" in sentence(described(found), "{:.0f} N m".format)
    # The file that is written foretells the clean torque as well as the fit does.
    again = Problem(problem.vehicle.replace(laws=(entry,)), problem.runs)
    x = found.fit.x[: again.nuisances]
    assert again.predict_all(x) == pytest.approx(found.fit.prediction, abs=1.0)
    clean = NOTHING.predict_all(NOTHING.start()) + beyond
    assert np.sqrt(np.mean((again.predict_all(x) - clean) ** 2)) < 0.15 * np.sqrt(np.mean(beyond**2))


def test_a_torque_that_remembers_the_rate_is_found_with_its_time_constant() -> None:
    def lagged(run):  # type: ignore[no-untyped-def]
        decay = np.exp(-(run.time[1] - run.time[0]) / 1.5)
        return 6e3 * lfilter([1.0 - decay], [1.0, -decay], run.omega.sum(axis=0))

    _, found = searched(by_run(lagged))
    assert found is not None
    entry = entries(found)[0]
    assert (entry.channel, entry.coordinate, entry.memory) == ("conservative_torque", "rate", "lag")
    assert entry.memory_size == pytest.approx(1.5, rel=0.2)
    assert found.foretold == found.ceiling  # nothing of any shape foretells more


def test_a_loss_that_remembers_where_it_came_from_is_found() -> None:
    """A loss along an angle through a play of 0.1 rad, which nothing but the loss shows."""

    def played(angle: Array) -> Array:
        kept = [angle[0]]
        for now in angle:
            kept.append(min(max(kept[-1], now - 0.1), now + 0.1))
        return np.array(kept[1:])

    _, found = searched(by_run(lambda run: sum(2e4 * omega * played(theta) for theta, omega in zip(run.theta, run.omega, strict=True))))
    assert found is not None
    entry = entries(found)[0]
    assert (entry.channel, entry.coordinate, entry.memory) == ("viscous_loss", "angle", "play")
    assert entry.memory_size == pytest.approx(0.1, rel=0.2)


def ringing(torque: np.ndarray, dt: float) -> np.ndarray:
    """A tenth of what a mode of 1.2 Hz, damped by 3 %, adds to a torque, in small explicit steps."""
    pulsation, position, speed = 2.0 * np.pi * 1.2, torque[0], 0.0
    answer = np.zeros(torque.size)
    for i in range(answer.size):
        for part in range(20):
            push = torque[max(i - 1, 0)] + (torque[i] - torque[max(i - 1, 0)]) * (part + 0.5) / 20.0
            speed += dt / 20.0 * (pulsation**2 * (push - position) - 0.06 * pulsation * speed)
            position += dt / 20.0 * speed
        answer[i] = 0.1 * (position - torque[i])
    return answer


def ringing_beside(share: float) -> Array:
    """What the mode adds to the torque of nothing, times a share."""
    base = NOTHING.predict_all(NOTHING.start())
    models = np.split(base, NOTHING.edges[1:-1])
    return share * np.concatenate([ringing(model, run.time[1] - run.time[0]) for run, model in zip(NOTHING.runs, models, strict=True)])


def test_what_a_mode_makes_of_the_torque_is_found_with_its_frequency() -> None:
    _, found = searched(ringing_beside(1.0))
    assert found is not None
    entry = entries(found)[0]
    assert (entry.channel, entry.coordinate, entry.memory) == ("conservative_torque", "torque", "ring")
    assert 1.0 / entry.memory_size == pytest.approx(1.2, rel=0.03)
    assert entry.values["slope"] == pytest.approx(0.1, rel=0.1)
    assert "mode of 1.2" in sentence(described(found), "{:.0f} N m".format)


@pytest.mark.parametrize(("share", "verdict"), [(QUIET, "unlisted_physics"), (0.0, "consistent")])
def test_a_law_below_the_noise_is_told_by_its_evidence_alone(share: float, verdict: str) -> None:
    hidden = ringing_beside(1.0)
    hidden *= share * SIGMA / np.std(hidden)
    problem = with_torque(NOTHING, NOTHING.predict_all(NOTHING.start()) + hidden)
    _, stands = standing(named(problem, fitted(problem)), 1, lambda _: None)
    assert not stands.left.structured
    assert stands.verdict == verdict
    if (found := stands.lawful) is not None:  # then the law itself tells where it lives
        told = beside_laws(named(found.problem, found.fitted), stands.left, found.fitted, found.names, "a law", "f").entry
        assert told.structured
        assert told.where


@pytest.mark.parametrize(("known", "stands"), [("angle", False), ("abs_rate", True)])
def test_friction_along_what_its_own_law_depends_on_is_no_law_where_nothing_is_loud(known: str, stands: bool) -> None:
    """A loss beyond an angle, however evident: it is the form of the friction law, where that may be another along the angle."""
    problem, found = searched(beyond_an_angle())
    assert found is not None
    assert entries(found)[0].coordinate == "angle"
    freedom = Freedom("its level along the ground", "friction_level", known, -0.3, 0.3, np.zeros((1, 2)))
    assert evident(replace(named(problem, fitted(problem)), freedoms=(freedom,)), found) == stands


@pytest.mark.parametrize(("range_bar", "stands"), [(10.0, True), (400.0, False)])
def test_what_zeros_of_sensors_may_be_is_no_law(range_bar: float, stands: bool) -> None:
    """A torque that fades after the start, as zeros that settle do."""
    seen, found = searched(fading())
    assert found is not None
    sheet = seen.vehicle.replace(sensors=replace(seen.vehicle.sensors, pressure_range_Pa=1e5 * range_bar))
    problem = Problem(sheet, seen.runs)
    assert evident(named(problem, fitted(problem)), found) == stands


def test_of_laws_that_tie_the_one_that_can_happen_again_is_preferred() -> None:
    """Along the angle or along the way since the start, which no other recording repeats; unless the way explains clearly more."""
    room = Problem(NOTHING.vehicle, NOTHING.runs, more_laws=1)
    plain = fit(room, weight(room))

    def tried(coordinate: str, cost: float) -> Tried:
        cell = Cell("inertia", Axis(coordinate), 0.0, 1.0)
        law = free_law(room, cell, 0, np.zeros(cell.pieces))
        return Tried(Screened(cell, 0.0, np.zeros(1)), replace(plain, effects=(law,), cost=cost))

    again, once, far_better = tried("angle", 120.0), tried("slip", 100.0), tried("slip", 50.0)
    assert preferred([once, again], 1000.0) == [again, once]
    assert preferred([again, far_better], 1000.0) == [far_better, again]


def test_a_second_law_is_sought_beside_the_first_as_it_was_fitted() -> None:
    """Pieces of the first that only the samples show that are left out must not run away."""
    often = small_problem()  # at 100 Hz there are samples enough for so many pieces
    nothing = with_torque(often, often.predict_all(often.start()))
    problem = Problem(nothing.vehicle, nothing.runs, more_laws=2)
    used = np.where(split(problem).fit, weight(problem), 0.0)
    short = Cell("inertia", Axis("time"), 0.0, float(problem.runs[0].time[-1]), pieces=36)
    first = with_law(problem, used, fitted(problem), free_law(problem, short, 0, np.zeros(short.pieces)))
    screen = Screen(problem, first, used, split(problem), white(problem).draws, trace(problem, first, 1, [Axis("angle")]), 1)
    assert screen.beside.left[0] < 1.2 * first.cost


def test_each_of_two_has_its_own_gain_on_held_out_data() -> None:
    """One of ten times the noise, and one as large as that: without it half is missing, less what recalibration makes up for."""
    large, small = effect("slope_bias", torque=10.0 * SIGMA), effect("kingpin_jacking", amplitude=1.0)
    there = NOTHING.predict_all(NOTHING.start())
    shape = NOTHING.predict_all(NOTHING.start(), [small]) - there
    small[1]["amplitude"] = SIGMA / float(np.sqrt(np.mean(shape[split(NOTHING).held] ** 2)))
    problem = with_torque(NOTHING, NOTHING.predict_all(NOTHING.start(), [large, small]))
    result, plain = fitted(problem, large, small), fitted(problem)
    done = named(problem, result)
    judged = verify.judged_once(problem, plain, result, done.roles, 1)
    gains = heldout_gains(done, problem, result, 0, judged, 1)
    assert gains[0] == pytest.approx(0.99, abs=0.01)
    assert 0.05 < gains[1] < 0.5


def screen_of(problem: Problem, before: Fit) -> Screen:
    used = np.where(split(problem).fit, weight(problem), 0.0)
    return Screen(problem, before, used, split(problem), white(problem).draws, trace(problem, before, 0, axes_of(problem)), 1)


def test_an_inertia_that_follows_the_angle_is_found_by_what_it_does_at_constant_rate_too() -> None:
    hidden = by_run(lambda run: np.sum(3e4 * np.sin(8.0 * run.theta) * run.alpha + 1.2e5 * np.cos(8.0 * run.theta) * run.omega**2, axis=0))
    problem = with_torque(NOTHING, NOTHING.predict_all(NOTHING.start()) + hidden)
    room = Problem(problem.vehicle, problem.runs, more_laws=2)
    found = screen_of(room, fitted(room)).search()
    assert (found[0].cell.channel, found[0].cell.axis) == ("linked_inertia", Axis("angle"))


def test_a_law_of_the_direction_is_said_as_one() -> None:
    cell = Cell("viscous_loss", Axis("direction"), -1.0, 1.0, 3)
    law = closed_law(Problem(NOTHING.vehicle, NOTHING.runs, more_laws=1), cell, 0, "linear", {"value": 0.0}, {"slope": 3e3})
    said = law_words(law_of(law[0].effect), law[1], NOTHING.vehicle)
    assert said == "a loss in proportion to the rate, another one in either direction"


def test_the_constant_of_a_law_is_left_to_what_is_named() -> None:
    room = Problem(NOTHING.vehicle, NOTHING.runs, more_laws=1, beside_names=True)
    before = fitted(room, effect("slope_bias", torque=100.0))
    screen = screen_of(room, before)
    torque, loss = (Cell(channel, Axis("angle"), -0.3, 0.3) for channel in ("conservative_torque", "viscous_loss"))
    assert screen.is_named(screen.traces, torque)
    assert not screen.is_named(screen.traces, loss)
    pieces = np.linspace(900.0, 1100.0, torque.pieces)
    (whole, values), (centred, _) = (free_law(room, torque, 0, pieces, centred=each) for each in (False, True))
    assert whole.effect.fields(values)["law_1_f"].mean() == pytest.approx(1000.0, rel=0.01)
    assert centred.effect.fields(values)["law_1_f"].mean() == pytest.approx(0.0, abs=10.0)


def test_what_a_law_adds_of_a_change_of_the_torque_counts_how_often_it_does() -> None:
    """Half of each newton metre everywhere; twice as much as the change beyond a knee that hardly any sample passes."""
    room = Problem(NOTHING.vehicle, NOTHING.runs, more_laws=1)
    before, axis = fitted(room), Axis("torque")
    traces = trace(room, before, 0, [axis])
    largest = max(float(np.abs(bag).max()) for bag in traces.axes[axis])
    cell = Cell("conservative_torque", axis, -largest, largest)

    def gain(form: str, fixed: dict[str, float], start: dict[str, float]) -> float:
        law = closed_law(room, cell, 0, form, fixed, start)
        return _loop_gain(room, traces, axis, replace(before, effects=(law,)))

    assert gain("linear", {"value": 0.0}, {"slope": -0.5}) == pytest.approx(0.5, rel=0.01)
    assert gain("hinge", {"value": 0.0, "below": 0.0}, {"above": 2.0, "at": 0.999 * largest}) < 0.1


def test_free_and_periodic_functions_of_the_same_are_both_tried() -> None:
    free = Cell("conservative_torque", Axis("angle"), -0.3, 0.3, 36)
    cells = [free, replace(free, pieces=2, period=0.1), replace(free, pieces=2, period=0.2), replace(free, pieces=10)]
    found = leading([Screened(cell, 10.0 - i, np.zeros(1)) for i, cell in enumerate(cells)])
    assert [one.cell for one in found] == cells[:2]


def test_what_no_law_of_one_coordinate_can_be_shows_in_its_share_of_the_ceiling() -> None:
    """A wave that runs along angle and rate at once: a law of the angle is the best there is, and a black box foretells clearly more."""
    _, found = searched(by_run(lambda run: np.sum(1500.0 * np.cos(9.0 * run.theta + 25.0 * run.omega), axis=0)))
    assert found is not None
    assert 0.3 < found.foretold / found.ceiling < 0.9
    assert described(found)[0].share_of_ceiling == found.foretold / found.ceiling


def wandering_for_seconds(size: int, seed: int) -> Array:
    """Errors (size,) of unit deviation that last two seconds."""
    slow = lfilter([1.0], [1.0, -np.exp(-1.0 / (2.0 * RATE_HZ))], np.random.default_rng(seed).standard_normal(size))
    return np.asarray(slow / np.std(slow))


def test_the_band_of_a_law_holds_it_where_errors_last() -> None:
    """A periodic torque below errors that wander for seconds, four times as large as those of the sensors."""
    hidden = by_run(lambda run: np.sum(900.0 * np.sin(2.0 * np.pi * run.theta / 0.3), axis=0))
    _, found = searched(hidden + 4.0 * SIGMA * wandering_for_seconds(hidden.size, 2))
    assert found is not None
    curve = described(found)[0].f
    at, f, band = map(np.array, (curve.at, curve.f, curve.band))
    assert np.mean(np.abs(f - 900.0 * np.sin(2.0 * np.pi * at / 0.3)) < band) > 0.9
    assert np.median(band) < 450.0  # and says more than that nothing is known


@pytest.mark.parametrize(("wandering", "sure"), [(0.0, True), (15.0, False)])
def test_a_law_takes_more_than_one_more_of_the_errors_that_are_left(wandering: float, sure: bool) -> None:
    """A spring beyond an angle, alone and where a torque that wanders for seconds is left that is several times as large."""
    spring = by_run(lambda run: np.sum(4e3 * np.maximum(run.theta - 0.1, 0.0), axis=0))
    slow = wandering * SIGMA * wandering_for_seconds(spring.size, 11)
    problem = with_torque(NOTHING, NOTHING.predict_all(NOTHING.start()) + spring + slow)
    room = Problem(problem.vehicle, problem.runs, more_laws=1)
    cell = Cell("conservative_torque", Axis("angle"), -0.3, 0.3)
    law = closed_law(room, cell, 0, "hinge", {"value": 0.0, "below": 0.0}, {"at": 0.1, "above": 4e3})
    done = named(problem, fitted(problem))
    assert _sure(done, fit(room, done.fitted, [law]), 0) == sure


def test_laws_that_tie_are_separated_by_the_next_experiment() -> None:
    """A loss beyond an angle against one at every angle: each differs from the other by the whole of it where the tracks turn fastest."""
    problem, found = searched(beyond_an_angle())
    assert found is not None
    cell = Cell("viscous_loss", Axis("none"), -1.0, 1.0, 1)
    rival = with_law(found.problem, weight(problem), fitted(problem), free_law(found.problem, cell, 0, np.array([1e3])))
    tied = replace(found, ties=(Tried(Screened(cell, 0.0, np.zeros(1)), rival),))
    done = named(problem, fitted(problem))
    advice = next_experiment(done, "unlisted_physics", found.fit, tied)
    assert advice is not None
    first, second = advice.separates
    assert "only beyond" in first
    assert "angle" not in second
    best, others = float(re.search(r"differ by (\d+)", advice.why)[1]), re.search(r"tried \((.*)\)", advice.why)[1]  # type: ignore[index]
    assert all(best >= float(other.rsplit(" ", 1)[1]) for other in others.split(", "))
    alone = next_experiment(done, "unlisted_physics", found.fit, replace(found, ties=()))
    assert alone is not None
    assert "dependence on rate" in alone.separates


@pytest.mark.parametrize("everywhere", [False, True])
def test_a_law_stands_in_place_of_a_name_that_only_resembles_it(everywhere: bool) -> None:
    """Viscous friction is that name where a loss begins beyond an angle, and is right where it acts everywhere."""
    problem, found = searched(by_run(lambda run: 4e3 * np.sum(run.omega, axis=0)) if everywhere else beyond_an_angle())
    assert found is not None
    viscous = named(problem, fitted(problem, effect("viscous_friction", sigma_2=1e3)))
    assert in_place(viscous, found, None) == (not everywhere)


@pytest.mark.parametrize(("count", "stands"), [(1, False), (2, False), (12, True)])
def test_names_win_a_draw_unless_they_are_more_and_have_more_values(count: int, stands: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A law of a few values that takes a twentieth more than names does not stand in the place of two of one value each, but of many."""
    problem, found = searched(fading())
    assert found is not None
    assert len(found.gains) == 1
    assert 2 < len(found.fitted.effects[-1][0].free) <= 12
    monkeypatch.setattr(rival, "_energies", lambda *_: [95.0, 100.0, 200.0])
    viscous = named(problem, fitted(problem, effect("viscous_friction", sigma_2=1e3)))
    final = replace(viscous.found.final, effects=viscous.found.final.effects * count)
    done = replace(viscous, found=replace(viscous.found, found=(SimpleNamespace(given=False),) * count, final=final))
    assert in_place(done, found, None) == stands


@pytest.mark.parametrize("bent", [False, True])
def test_what_a_name_may_bend_by_is_free_beside_laws_only_where_it_is_asked(bent: bool) -> None:
    """Laws alone have no names that could bend; a name in the place of one of them may, as where it was found."""
    problem, found = searched(beyond_an_angle())
    assert found is not None
    wave = 50.0 * SIGMA * np.sin(np.arange(problem.measured.size) / 300.0)
    waving = with_torque(problem, problem.measured + wave).bent([wave[:, None]])
    done = replace(named(waving, fitted(waving)), form=("",))
    _, _, result = beside_form(done, found, bent=bent)
    assert (result.cost < 10.0 * np.count_nonzero(done.fitted)) == bent


def test_a_law_is_found_beside_a_name_which_keeps_its_place() -> None:
    """Viscous friction, and a torque that remembers the rate: a law alone would have to be both."""

    def both(run):  # type: ignore[no-untyped-def]
        decay = np.exp(-(run.time[1] - run.time[0]) / 1.5)
        return np.sum(run.omega, axis=0) * 6e3 + 4e3 * lfilter([1.0 - decay], [1.0, -decay], run.omega.sum(axis=0))

    problem, alone = searched(by_run(both))
    assert alone is not None
    viscous = fitted(problem, effect("viscous_friction", sigma_2=3e3))
    beside = in_what_is_left(problem, viscous)
    assert beside is not None
    assert beside.names == 1
    (entry,) = entries(beside)
    assert (entry.channel, entry.coordinate, entry.memory) == ("conservative_torque", "rate", "lag")
    assert [law.title for law in described(beside)] == [entry.title]
    assert not in_place(named(problem, viscous), alone, beside)  # far truer than the law alone
    assert leaves_names(named(problem, viscous), beside)
    assert keeps_names(named(problem, viscous), beside, alone)  # though it is two parts, and the law alone is one
    as_true = replace(alone, problem=beside.problem, fitted=beside.fitted)
    assert not keeps_names(named(problem, viscous), beside, as_true)
    assert beside.fit.effects[0][1]["sigma_2"] == pytest.approx(6e3, rel=0.1)
    _, _, again = beside_form(named(problem, viscous), beside)  # of which there is none here
    assert again.cost == pytest.approx(beside.fitted.cost, rel=0.02)
    # Two laws that are both together explain no more than the name and one of them; of one law none can be spared.
    room = Problem(problem.vehicle, problem.runs, more_laws=2)
    loss = free_law(room, Cell("viscous_loss", Axis("none"), -1.0, 1.0, 1), 1, np.array([6e3]))
    used = np.where(split(problem).fit, weight(problem), 0.0)
    laws = fit(room, used, [loss, *beside.fitted.effects[1:]], beside.fitted.x[: room.nuisances])
    swapped = in_place_of_one(named(problem, viscous), replace(beside, problem=room, fitted=laws, fit=laws, gains=(1.0, 1.0)), 1)
    assert swapped is not None
    assert swapped.names == 1
    assert [law.title for law in described(swapped)] == [entry.title]
    assert in_place_of_one(named(problem, viscous), alone, 1) is None


def test_a_name_that_the_law_makes_superfluous_does_not_stand_beside_it() -> None:
    """A loss beyond an angle, and an offset of one pressure sensor that is not there: fitted beside the law, it is not needed."""
    problem, alone = searched(beyond_an_angle())
    assert alone is not None
    line = fitted(problem, (Candidate(CATALOGUE["pressure_offset"], line="main_a", free=("offset",)), {"offset": 2e4}))
    room = Problem(problem.vehicle, problem.runs, more_laws=2, beside_names=True)
    used = np.where(split(problem).fit, weight(problem), 0.0)
    both = fit(room, used, [*line.effects, *alone.fit.effects], line.x, linearisations=20)
    beside = replace(alone, problem=room, fitted=both, fit=both)
    assert beside.names == 1
    assert not leaves_names(named(problem, line), beside)
    assert leaves_names(named(problem, line, given=True), beside)  # what every joint has was not looked for
    assert not keeps_names(named(problem, line), beside, alone)


@pytest.mark.parametrize(
    ("channel", "moved", "given", "in_its_place"),
    [
        ("conservative_torque", 10.0, True, True), ("conservative_torque", 10.0, False, False),
        ("conservative_torque", 1.0, True, False), ("viscous_loss", 10.0, True, False),
    ],
)  # fmt: skip
def test_a_law_that_does_what_every_joint_has_is_in_its_place(channel: str, moved: float, given: bool, in_its_place: bool) -> None:
    """A constant torque does what an offset does; a loss does not, and where it moves the offset, this was another for want of it."""
    problem = with_torque(NOTHING, NOTHING.predict_all(NOTHING.start()) + 400.0)
    offset = fitted(problem, effect("slope_bias", torque=400.0))
    room, used = Problem(problem.vehicle, problem.runs, more_laws=1, beside_names=True), np.where(split(problem).fit, weight(problem), 0.0)
    law = free_law(room, Cell(channel, Axis("none"), -1.0, 1.0, 1), 0, np.zeros(1))
    beside = fit(room, used, [*offset.effects, law], offset.x)
    (spread,) = deviations(problem, used, split(problem), offset)[problem.nuisances :]
    candidate, values = offset.effects[0]
    elsewhere = candidate, {**values, "torque": values["torque"] + moved * float(spread)}
    beside = replace(beside, effects=(elsewhere, *beside.effects[1:]))
    assert _in_place_of_given(named(problem, offset, given), room, used, beside) == in_its_place


def test_a_line_is_found_where_the_data_show_only_a_part_of_the_pieces() -> None:
    """One direction of the pieces is not seen at all, and rounding has made its variance negative."""
    cell, places = Cell("gain", Axis("angle"), -0.5, 0.5), np.linspace(-0.5, 0.5, 401)
    pieces = np.linalg.lstsq(cell.basis(places), 0.2 * places, rcond=None)[0]
    spread = np.append(np.geomspace(1e-2, 1e-11, pieces.size - 1), -1e-18)
    for seed in range(10):
        turned = np.linalg.qr(np.random.default_rng(seed).standard_normal((pieces.size, pieces.size)))[0]
        line = next(found for found in closed_forms(cell, pieces, (turned * spread) @ turned.T) if found[1] == "linear")
        assert line[0] < 1e-6
        assert line[3]["slope"] == pytest.approx(0.2)


def test_no_closed_form_of_a_law_beside_a_constant_can_be_that_constant() -> None:
    """Else neither is sure, and the name of the constant may go."""
    cell = Cell("conservative_torque", Axis("time"), 0.0, 60.0)
    pieces = np.linspace(-0.2, 0.3, cell.pieces)
    sure = 1e-4 * np.eye(cell.pieces)

    def left(form: str, fixed: dict[str, float], free: dict[str, float]) -> float:
        """What the sizes of a form leave of a constant, at best."""
        bends = {"at", "width", "length", "period", "exponent"} | ({"start", "end"} if form == "window" else set())
        sizes = [name for name in free if name not in bends]
        at_zero = {**fixed, **free, **dict.fromkeys(sizes, 0.0)}
        columns = np.column_stack([sampled(form, {**at_zero, name: 1.0}, (), 0.0, 60.0) for name in sizes])
        flat = np.ones(len(columns))
        return float(np.sqrt(np.mean((flat - columns @ np.linalg.lstsq(columns, flat, rcond=None)[0]) ** 2)))

    whole = [left(*found[1:]) for found in closed_forms(cell, pieces, sure)]
    assert min(whole) < 1e-9
    assert min(left(*found[1:]) for found in closed_forms(cell, pieces, sure, centred=True)) > 0.02


def test_nothing_hidden_gives_no_law() -> None:
    assert searched(0.0)[1] is None


def test_a_law_is_kept_under_a_name_and_what_stood_in_the_file_stays(tmp_path: Path) -> None:
    law = LawEntry("gain", "angle", "table", (-0.5, 0.5), knots=(0.0, 0.1, 0.05), title="worn arms")
    save(load_vehicle(None).replace(laws=(law,)), tmp_path / "augmented.yaml")
    catalogue = tmp_path / "own.yaml"
    catalogue.write_text("# mine\neffects:\n  - {id: first, title: First, law: {channel: gain, coordinate: none, form: constant, "
                         "range: [0.0, 1.0], values: {value: 0.1}}}\n")  # fmt: skip
    command = ["effects", "--add", str(tmp_path / "augmented.yaml"), "--id", "worn_arms", "--to", str(catalogue)]
    assert CliRunner().invoke(app, command).exit_code == 0
    assert catalogue.read_text().startswith("# mine\n")
    effects, _ = read_effects(catalogue)
    assert [effect.id for effect in effects] == ["first", "worn_arms"]
    f = effects[1].fields({"size": 1.0})["worn_arms_f"]
    assert np.asarray(f)[[0, 256, 512]] == pytest.approx([0.0, 0.1, 0.05])
    before = catalogue.read_text()
    for change, told in (([], "worn_arms"), (["--id", "law_1"], "laws of a vehicle file"), (["--id", "x", "--title", "a\nb"], "one line")):
        refused = CliRunner().invoke(app, [*command, *change])
        assert refused.exit_code != 0
        assert told in " ".join(refused.output.split())
    assert catalogue.read_text() == before


def test_a_bad_law_in_a_catalogue_is_refused_by_key(tmp_path: Path) -> None:
    file = tmp_path / "own.yaml"
    law = "{channel: gian, coordinate: none, form: constant, range: [0.0, 1.0], values: {value: 0.1}}"
    file.write_text(f"{{id: bad, title: Bad, law: {law}}}\n")
    with pytest.raises(EffectError, match=r"own.yaml: key 'law.channel'.*gain"):
        read_effects(file)

@pytest.mark.parametrize(
    ("form", "values", "said"),
    [
        ("hinge", {"value": 0.0, "below": 0.0, "above": 1.2e5, "at": 0.5}, "(+1.2e+05 max(theta - 0.5, 0))"),
        ("step", {"before": 0.0, "after": 30.0, "at": 0.2, "width": 0.01}, "(+15 (1 + tanh((theta - 0.2) / 0.01)))"),
        ("window", {"outside": 0.0, "inside": 9.0, "start": 0.1, "end": 0.3}, "(9 from theta = 0.1 to 0.3, else 0)"),
        ("bump", {"value": 1.0, "height": 3.0, "at": 0.2, "width": 0.1}, "(+1 +3 exp(-((theta - 0.2) / 0.1)^2 / 2))"),
        ("exponential", {"start": 4.0, "end": 1.0, "length": 0.1}, "(+1 +3 exp(-(theta - -0.6) / 0.1))"),
    ],
)
def test_a_formula_has_its_numbers_and_a_sentence_what_fits_as_well(form: str, values: dict[str, float], said: str) -> None:
    law = a_law(form=form, values=values)
    assert formula([law], load_vehicle(None)) == f"torque [N m] = {said}"
    assert sentence([law], lambda torque: f"{torque:g} N m").endswith("of the torque; not to be told from a gain or a loss)")
