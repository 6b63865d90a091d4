# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Parts of the conclusion on a small problem whose answer is known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_problem import SIGMA, effect, small_problem, weight, with_torque

from lugre_steering.data.dataset import Run
from lugre_steering.diagnosis.conclude import experiment, left_over, limits
from lugre_steering.diagnosis.conclude.augmented import augmented_vehicle
from lugre_steering.diagnosis.conclude.evidence import evidence, traces
from lugre_steering.diagnosis.conclude.statement import _gain, at_end, calibrations_at_bounds
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.freedom import Freedom
from lugre_steering.diagnosis.loudness import excess
from lugre_steering.diagnosis.result import FittedValue, NamedEffect, Unexplained
from lugre_steering.diagnosis.search import locate, surely
from lugre_steering.diagnosis.search.search import Search
from lugre_steering.diagnosis.verify import Judged, rmse
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fitting import fingerprint, split
from lugre_steering.fitting.fingerprint import Score
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import Candidate, Problem

FREEDOM = Freedom("level", "friction_level", "rate", -1.0, 1.0, np.ones((1, 2)))
OFFSET = (Candidate(CATALOGUE["pressure_offset"], line="main_a", free=("offset",)), {"offset": 3e5})


@pytest.fixture(scope="module")
def problem() -> Problem:
    return small_problem()


def finished(problem: Problem, baseline: Fit, scores: tuple[Score, ...] = ()) -> Finished:
    noise = Noise(np.full(problem.valid.size, SIGMA), SIGMA * np.random.default_rng(4).standard_normal((4, problem.valid.size)), 0.0)
    found = Search(baseline, baseline, (), scores, ())
    return Finished(problem, noise, split.split(problem), found)


def beginning(run: Run, count: int) -> Run:
    """Its first samples."""
    parts = {name: value[..., :count] for name, value in vars(run).items() if isinstance(value, np.ndarray)}
    return replace(run, name="short", **parts)


def test_the_line_that_is_named_stands_alone_in_the_evidence(problem: Problem) -> None:
    hidden = with_torque(problem, problem.predict_all(problem.start(), [OFFSET]))
    baseline = fit(hidden, weight(hidden))
    draws = SIGMA * np.random.default_rng(4).standard_normal((8, hidden.measured.size))
    scores = fingerprint.screen(hidden, baseline, weight(hidden), draws)
    entry = named("pressure_offset", "main_a", 3e5, "Pa")
    rows = {row.label: row.verdict for row in evidence(finished(hidden, baseline, tuple(scores)), [entry])}
    assert {label for label, verdict in rows.items() if verdict == "named"} == {"pressure_offset[main_a]"}
    assert {f"pressure_offset[{line}]" for line in ("main_a", "main_b", "aux_a", "aux_b")} <= set(rows)


@pytest.mark.parametrize("free", [("offset",), ()])
def test_the_error_of_a_line_is_written_though_its_value_was_held(problem: Problem, free: tuple[str, ...]) -> None:
    """As names are beside laws when the form of the friction was fitted last."""
    hidden = with_torque(problem, problem.predict_all(problem.start(), [OFFSET]))
    own = replace(OFFSET[0], free=free), OFFSET[1]
    entry = named("pressure_offset", "main_a", 3e5, "Pa")
    written = augmented_vehicle(finished(hidden, fit(hidden, weight(hidden))), fit(hidden, weight(hidden), [own]), [entry], 80.0)
    (found,) = written.effects
    assert (found.id, found.parameters) == ("pressure_offset", {"main_a": pytest.approx(3e5, rel=0.05)})


def test_a_name_keeps_its_capital_where_recalibration_stops_at_a_bound(problem: Problem) -> None:
    (place,) = (i for i, calibration in enumerate(problem.calibrations) if calibration.name == "stribeck_speed")
    baseline = fit(problem, weight(problem))
    bound = baseline.x.copy()
    bound[place] = problem.bounds()[1][place]
    assert calibrations_at_bounds(finished(problem, replace(baseline, x=bound))) == ["Stribeck speed"]


def test_an_interval_within_one_percent_is_told_with_a_digit_more() -> None:
    told = _gain(SimpleNamespace(torque="{:.0f} N m".format), Judged(1000.0, 20.0, 0.98, (0.978, 0.981), False), "it")  # type: ignore[arg-type]
    assert told.endswith("(improvement 98 %, 95 % interval 97.8 to 98.1 %).")


def named(effect: str, parameter: str, value: float, unit: str) -> NamedEffect:
    """An effect with one fitted value; nothing else is known about it."""
    return NamedEffect(effect, "motion", "", 0.0, {parameter: FittedValue(value, (value, value), unit)}, (), 0.0, 0.0, ())


@pytest.mark.parametrize(("value", "ends"), [(0.15, 1), (-0.15, 1), (0.149, 0), (0.0, 0)])
def test_a_parameter_at_the_end_of_its_range_is_told(value: float, ends: int) -> None:
    assert len(at_end(named("angle_offset", "offset", value, "rad"))) == ends


def test_an_end_of_a_line_is_told_and_that_of_a_shape_is_not() -> None:
    (end,) = at_end(named("pressure_offset", "main_a", 5e6, "Pa"))
    assert end == ("main_a", 5e6, "Pa")
    (shape,) = (p for p in CATALOGUE["end_stop"].parameters if p.name == "engage_angle")
    assert not at_end(named("end_stop", "engage_angle", shape.low, "rad"))


def test_the_next_experiment_compares_what_the_sensors_would_show(problem: Problem) -> None:
    """An offset of one line acts through its arm, a slope does not: the difference is neither nothing nor the whole of either."""
    result = fit(problem, weight(problem))
    slope = effect("slope_bias", torque=1000.0)
    assert max(experiment.separation(problem, result, [OFFSET], [], SIGMA).values()) > 1.0
    arm = effect("moment_arm_error", linear=0.1, quadratic=0.0)
    apart = experiment.separation(problem, result, [arm], [slope], SIGMA)
    alone = experiment.separation(problem, result, [arm], [], SIGMA)
    assert set(apart) == set(alone) == set(experiment.manoeuvres(problem))
    assert any(abs(apart[name] - alone[name]) > 0.01 * alone[name] for name in apart)
    assert min(alone.values()) > 0.0


def test_what_leaves_no_trace_has_no_limit_and_is_told(problem: Problem) -> None:
    result, draws = fit(problem, weight(problem)), SIGMA * np.random.default_rng(4).standard_normal((8, problem.measured.size))
    scores = [score for score in fingerprint.screen(problem, result, weight(problem), draws) if score.candidate.effect.id != "end_stop"]
    found = limits.smallest(problem, result, weight(problem), scores, ["slope_bias"])
    assert found["end_stop"][1] is None
    assert found["viscous_friction"][1] is not None
    assert not {"slope_bias", "relief_saturation"} & set(found)  # named; without an amplitude of its own


@pytest.mark.parametrize(("beside", "bends"), [(0.0, False), (0.04, False), (0.2, True)])
def test_a_name_that_leaves_more_than_its_law_may_bend_to_is_only_the_nearest(problem: Problem, beside: float, bends: bool) -> None:
    """What no freedom and no name does here is a torque that alternates, with a share of the energy of what the name does."""
    name = effect("end_stop", stiffness=4e4, engage_angle=0.2)
    baseline = fit(problem, weight(problem))
    done = finished(problem, baseline)
    there = replace(done, problem=with_torque(problem, problem.predict_all(problem.start(), [name])), freedoms=(FREEDOM,))
    plain = replace(there, found=Search(fit(there.problem, weight(problem)), fit(there.problem, weight(problem), [name]), (), (), ()))
    took = excess(there.problem, plain.found.baseline, plain.fitted) - excess(there.problem, plain.found.final, plain.fitted)
    assert took > 1.0
    flicker = SIGMA * np.sqrt(beside * took) * np.where(np.arange(problem.valid.size) // 20 % 2, 1.0, -1.0)
    final = replace(plain.found.final, prediction=plain.found.final.prediction - flicker)
    structured = left_over.LeftOver(Unexplained(True, "", None), "left", True)
    left = replace(plain, found=replace(plain.found, final=final))
    assert left_over.only_nearest(left, structured) is bends
    assert not left_over.only_nearest(left, structured._replace(structured=False))
    assert not left_over.only_nearest(replace(left, freedoms=()), structured)  # of a single joint


@pytest.mark.parametrize("count", [20, 45])
def test_structure_is_located_in_a_recording_shorter_than_the_window(problem: Problem, count: int) -> None:
    runs = [problem.runs[0], beginning(problem.runs[1], count)]
    both = Problem(problem.vehicle, runs)
    residual = np.where(both.bag == 1, 10.0 * SIGMA, 0.0)
    done = finished(both, fit(both, weight(both)))
    (entry,) = left_over._where(done, [locate.coordinates(run, run.measured) for run in runs], "time", residual)
    assert entry.bag == "short"
    assert entry.intervals_s[0] == pytest.approx([runs[1].time[0], runs[1].time[-1]], abs=0.05)


def test_held_out_errors_of_a_bag_are_those_of_the_fit_that_was_judged(problem: Problem) -> None:
    baseline = fit(problem, weight(problem))
    done = finished(problem, baseline)
    other = replace(baseline, prediction=baseline.prediction + 500.0)  # fitted to all data, say
    for bag, trace in enumerate(traces(done, other, other, baseline)):
        own = rmse(problem, baseline, done.roles.held & (problem.bag == bag))
        assert trace.heldout_Nm == (own, own)
    assert {trace.heldout_Nm for trace in traces(done, other, other, None)} == {None}


@pytest.mark.parametrize(("doubt", "expected"), [(1.0, np.sqrt(1.0 / 9.0)), (200.0, np.sqrt(200.0 / 800.0))])
def test_a_value_is_no_surer_than_blocks_agree(doubt: float, expected: float) -> None:
    """A mean of 800 samples whose errors are one with alternating sign in each of ten blocks: the standard error of ten, unless the
    doubt says more."""
    cluster = np.repeat(np.arange(40), 20)
    measured = np.where(cluster // 4 % 2 == 0, 1.0, -1.0)
    problem, roles = SimpleNamespace(measured=measured, doubt=doubt), SimpleNamespace(cluster=cluster)
    mean = SimpleNamespace(prediction=np.zeros(800), jacobian=np.ones((800, 1)), covariance=np.array([[1.0 / 800.0]]))
    found = surely.deviations(problem, np.ones(800), roles, mean)  # type: ignore[arg-type]
    assert found[0] == pytest.approx(expected, rel=1e-9)
