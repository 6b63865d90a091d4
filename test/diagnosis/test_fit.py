# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The joint fit against an independent optimiser, what its Jacobian takes out of a residual, and when effects began."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear
from small_problem import SIGMA, effect, small_problem, weight, with_torque

from lugre_steering.fitting import onset
from lugre_steering.fitting.fingerprint import score_columns, screen
from lugre_steering.fitting.fit import Fit, bounded_minimum, fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.split import split

TRUTH = (0.12, -0.05, 0.08, 0.2, 0.1, -0.1)
"""Changes of the calibration values from the sheet."""


@pytest.fixture(scope="module")
def problem() -> Problem:
    return small_problem()


@pytest.mark.parametrize("robust", [False, True])
def test_reaches_the_minimum_that_scipy_reaches(problem: Problem, robust: bool) -> None:
    x = problem.start()
    x[: len(TRUTH)] = TRUTH
    hidden = with_torque(problem, problem.predict_all(x, [effect("line_loss_quadratic", c=2e4)]))
    if robust:
        hidden.measured[::50] += 3000.0
    found = fit(hidden, weight(hidden), [effect("line_loss_quadratic", c=1e4)], robust=robust, priors=False)

    scales = np.append(hidden.scales(), 1e4)
    wide = hidden.prior_weights(False)

    def residuals(p: np.ndarray) -> np.ndarray:
        values = p * scales
        predicted = hidden.predict_all(values[:-1], [effect("line_loss_quadratic", c=float(values[-1]))])
        error = (predicted - hidden.measured) * weight(hidden)
        if robust:  # soft L1 beyond three standard deviations, as a root
            error = np.sqrt(18.0 * (np.sqrt(1.0 + (error / 3.0) ** 2) - 1.0))
        return np.concatenate([error, wide * p[:-1]])

    start = np.append(found.x, found.effects[0][1]["c"]) / scales
    best = least_squares(residuals, start + 0.05, x_scale=1.0, diff_step=1e-4, xtol=1e-10, ftol=1e-10)
    own = float(np.sum(residuals(start) ** 2))
    assert own < 2.0 * best.cost * (1.0 + 1e-4)
    assert found.effects[0][1]["c"] == pytest.approx(2e4, rel=0.05)
    deviations = np.sqrt(np.diag(found.covariance))[: len(TRUTH)]
    assert np.abs((found.x[: len(TRUTH)] - TRUTH) / deviations).max() < 4.0
    assert deviations[:3].max() < 0.02


@pytest.mark.parametrize("seed", range(20))
def test_bounded_steps_are_those_of_bounded_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((60, 12)) @ (np.eye(12) + rng.standard_normal((12, 12)))
    target = columns @ rng.uniform(-3.0, 3.0, 12)
    low, high = -rng.uniform(0.0, 2.0, 12), rng.uniform(0.0, 2.0, 12)  # some on the point of leaving their range
    found = bounded_minimum(columns.T @ columns, -columns.T @ target, low, high)
    wanted = lsq_linear(columns, target, (low, high + 1e-12), method="bvls", tol=1e-14, max_iter=1000).x
    assert np.any(wanted <= low + 1e-9)
    assert found == pytest.approx(wanted, abs=1e-7)


def test_a_fit_gone_on_with_ends_where_one_from_the_start_does(problem: Problem) -> None:
    hidden = with_torque(problem, problem.predict_all(problem.start(), [effect("viscous_friction", sigma_2=3e3)]))
    before, viscous = fit(hidden, weight(hidden)), effect("viscous_friction", sigma_2=1e3)
    anew, gone_on = fit(hidden, weight(hidden), [viscous]), fit(hidden, weight(hidden), [viscous], before)
    assert gone_on.cost == pytest.approx(anew.cost, rel=1e-4)
    assert gone_on.effects[0][1]["sigma_2"] == pytest.approx(anew.effects[0][1]["sigma_2"], rel=1e-3)
    # Other weights have another linearisation, and nothing is taken for settled that is not.
    half = np.where(np.arange(hidden.measured.size) % 2, weight(hidden), 0.0)
    assert fit(hidden, half, [viscous], before).cost == pytest.approx(fit(hidden, half, [viscous]).cost, rel=1e-4)
    stuck = replace(before, x=before.x + 0.1 * problem.scales(), settled=True)
    assert fit(hidden, weight(hidden), start=stuck).cost == pytest.approx(before.cost, rel=1e-3)


def test_a_fit_that_bends_have_joined_since_is_gone_on_with(problem: Problem) -> None:
    """As where a name was given up whose law could bend: the fit has a place for these bends, and no slope."""
    wave = 50.0 * np.sin(np.arange(problem.measured.size) / 40.0)
    earlier, freer = fit(problem, weight(problem)), problem.bent([wave[:, None]])
    known = replace(earlier, x=np.append(earlier.x, 0.0))
    gone_on, anew = (fit(freer, weight(problem), start=start) for start in (known, known.x))
    assert gone_on.cost == pytest.approx(anew.cost, rel=1e-9)
    assert gone_on.slope.shape[1] == gone_on.x.size


def test_the_jacobian_at_the_end_is_that_of_the_end(problem: Problem) -> None:
    """However small the last step was: intervals, screens and onsets are computed from it."""
    trial = [effect("end_stop", engage_angle=0.25, stiffness=5e4)]
    hidden = with_torque(problem, problem.predict_all(problem.start(), trial))
    found = fit(hidden, weight(hidden), [effect("end_stop", engage_angle=0.24, stiffness=4e4)])
    for _ in range(2):  # again from where it ended, so that hardly anything is left to step
        found = fit(hidden, weight(hidden), found.effects, found.x)
    fresh = fit(hidden, weight(hidden), found.effects, found.x, linearisations=1)
    sizes = {"engage_angle": 0.1, "stiffness": 1e4}
    for j, scale in enumerate([*hidden.scales(), *(sizes[key] for key in found.effects[0][0].free)]):
        up, down = (fit_prediction(hidden, found, j, sign * 0.02 * scale) for sign in (1.0, -1.0))
        central = (up - down) / (0.04 * scale) * weight(hidden)
        for result in (found, fresh):
            error = np.linalg.norm(result.jacobian[:, j] - central)
            assert error < 0.15 * np.linalg.norm(central), (j, error / np.linalg.norm(central))


def fit_prediction(problem: Problem, result: Fit, column: int, change: float) -> np.ndarray:
    x, (candidate, values) = result.x.copy(), result.effects[0]
    values = dict(values)
    if column < x.size:
        x[column] += change
    else:
        values[candidate.free[column - x.size]] += change
    return problem.predict_all(x, [(candidate, values)])


@pytest.mark.parametrize(
    ("id_", "values"),
    [
        ("pressure_drift", {"drift": 2e3}),
        ("wear_polishing", {"amount": 0.05, "slip_scale": 1.0}),
        ("heat_partition", {"ground_share": 0.2}),
    ],
)
def test_late_effects_are_screened_by_the_trace_that_they_leave(problem: Problem, id_: str, values: dict[str, float]) -> None:
    candidate, values = effect(id_, **values)
    candidate = replace(candidate, line=problem.vehicle.hydraulics.lines[0] if id_ == "pressure_drift" else "")
    since = tuple(0.45 * max(float(run.time[-1]) for run in problem.runs) for _ in problem.runs)
    late = replace(candidate, since=since)
    hidden = with_torque(problem, problem.predict_all(problem.start(), [(late, values)]))
    baseline = fit(hidden, weight(hidden))
    draws = SIGMA * np.random.default_rng(4).standard_normal((4, hidden.measured.size))
    # A drift of one line and the opposite one of its partner are nearly the same: each line is asked for its own.
    screened = screen(hidden, baseline, weight(hidden), draws)
    scores = [s for s in screened if (s.candidate.effect.id, s.candidate.line) == (id_, candidate.line)]
    best = max(scores, key=lambda score: score.explained)
    assert best.candidate.since == since
    # The linear guess is as large as what is hidden, so the trace is of the right size and kind.
    amplitude = best.candidate.free[0]
    assert best.values[amplitude] == pytest.approx(values[amplitude], rel=0.3)


def test_what_recalibration_can_do_explains_nothing_under_uneven_noise(problem: Problem) -> None:
    """A residual that is a calibration column is masked wholly, however the noise varies along the recording."""
    time = np.concatenate([run.time for run in problem.runs])
    uneven = weight(problem) * (1.0 + 0.8 * np.sin(0.3 * time))
    result = fit(problem, uneven)
    draws = SIGMA * np.random.default_rng(4).standard_normal((4, time.size))
    column = result.jacobian[:, 0] / np.where(uneven > 0.0, uneven, 1.0)
    moved = replace(result, prediction=result.prediction - 100.0 * column / np.max(np.abs(column)))
    still = {s.candidate: s.explained for s in screen(problem, result, uneven, draws)}
    shifted = {s.candidate: s.explained for s in screen(problem, moved, uneven, draws) if s.candidate in still}
    shared = [(still[key], value) for key, value in shifted.items() if not key.since]
    assert len(shared) > 100
    # Signs allowing, a candidate sees exactly what it saw before.
    assert np.max([abs(a - b) / (1.0 + a) for a, b in shared]) < 1e-3


def test_wrong_signs_are_no_physics() -> None:
    candidate, _ = effect("viscous_friction", sigma_2=1.0)
    column = np.ones((10, 1))
    residual = np.vstack([-np.ones(10), np.ones((2, 10))])
    basis = np.zeros((10, 0))
    wrong, right = (score_columns(candidate, column, basis, sign * residual, 10.0) for sign in (1.0, -1.0))
    assert wrong is not None
    assert right is not None
    assert (wrong.explained, wrong.coefficients, wrong.p_value) == (0.0, (0.0,), 1.0)
    assert right.explained == pytest.approx(10.0)
    assert wrong.visible == right.visible == pytest.approx(10.0)  # its detection limit is the same


def test_all_instants_at_once_are_told_as_each_is_alone(problem: Problem) -> None:
    """Of an effect that remembers nothing; strokes end between instants that are tried one by one."""
    late, values = effect("line_loss_linear", b=4e3)
    hidden = with_torque(problem, problem.predict_all(problem.start(), [(replace(late, since=(31.0, 12.0)), values)]))
    since = (40.0, 12.0)
    trials = onset._Late(hidden, weight(hidden), fit(hidden, weight(hidden), [(replace(late, since=since), values)]), 0)
    time = hidden.runs[0].time
    each = trials.at_each(since, 0, float(time[0]))
    some = np.arange(0, time.size, 97)
    alone = np.array([trials.left((float(time[i]), 12.0)) for i in some])
    assert each[some] == pytest.approx(alone, abs=1e-3 * np.ptp(alone))
    assert float(time[np.argmin(each)]) == pytest.approx(31.0, abs=0.5)


def test_an_onset_that_the_fitted_data_hardly_see_is_called_undetermined(problem: Problem) -> None:
    roles = split(problem)
    candidate, values = effect("slope_bias", torque=400.0)
    held = [run.time[roles.held[problem.bag == i]] for i, run in enumerate(problem.runs)]
    blocks = [times[np.flatnonzero(np.diff(times) > 2.0)[0] + 1 :] for times in held]  # from the second held block on
    within = float(blocks[0][200])
    plain = 0.5 * float(blocks[0][0] + held[0][0])
    for start, hardly in ((within, True), (plain, False)):
        truth = replace(candidate, since=(start, np.inf))
        hidden = with_torque(problem, problem.predict_all(problem.start(), [(truth, values)]))
        fitted = np.where(roles.fit, weight(hidden), 0.0)
        result = fit(hidden, fitted, [(truth, values)])
        unsure = onset.undetermined(hidden, fitted, result)
        assert unsure[problem.bag == 1].mean() < 0.1  # it never begins there: at the very end it could
        first = unsure[problem.bag == 0]
        block = roles.held[problem.bag == 0] & (np.abs(hidden.runs[0].time - start) < 4.0)
        assert first[block].mean() > 0.9 if hardly else first.sum() * 0.02 < 3.0


def test_the_suggested_instant_is_where_errors_begin_to_grow(problem: Problem) -> None:
    rng = np.random.default_rng(6)
    time = np.concatenate([run.time for run in problem.runs])
    begun = time >= np.array([25.0, 50.0])[problem.bag]
    found = onset.suggested(problem, rng.standard_normal(time.size) * np.where(begun, 3.0, 1.0))
    assert found == pytest.approx((25.0, 50.0), abs=2.0)
