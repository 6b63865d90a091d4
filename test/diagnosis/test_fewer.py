# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Means in place of single samples: less noise, the same physics, nothing that was held out."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from small_problem import SIGMA, effect, small_problem, weight, with_torque

from lugre_steering.data.dataset import averaged
from lugre_steering.diagnosis.fewer import fewer
from lugre_steering.fitting import split
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import Problem


class Seen(NamedTuple):
    """A problem with its noise and roles."""

    problem: Problem
    noise: Noise
    roles: split.Split


@pytest.fixture(scope="module")
def problem() -> Problem:
    return small_problem()


def in_white_noise(problem: Problem) -> Seen:
    draws = SIGMA * np.random.default_rng(4).standard_normal((16, problem.measured.size))
    return Seen(problem, Noise(np.full(problem.measured.size, SIGMA), draws, 0.5), split.split(problem))


def in_steps_of(count: int, seen: Seen, means: bool = True) -> Seen:
    problem, noise, roles = seen
    baseline, rate_Hz = fit(problem, weight(problem)), 1.0 / float(problem.runs[0].time[1] - problem.runs[0].time[0])
    return Seen(*fewer(problem, noise, roles, baseline, problem.measured.size, rate_Hz / count, means=means))


@pytest.mark.parametrize("count", [2, 3, 5])
def test_noise_is_that_of_means(problem: Problem, count: int) -> None:
    """Of n samples the mean has a variance of one n-th; of an even n half of the outer ones belong to the neighbours."""
    less = in_steps_of(count, in_white_noise(problem))
    energy = 1.0 / count if count % 2 else (count - 0.5) / count**2
    assert less.problem.measured.size == pytest.approx(problem.measured.size / count, abs=2)
    assert less.problem.mean_of == pytest.approx(1.0 / energy, rel=0.02)
    assert less.noise.floor == pytest.approx(SIGMA * energy**0.5, rel=0.02)
    assert np.std(less.noise.draws) == pytest.approx(SIGMA * energy**0.5, rel=0.02)
    assert less.noise.slow_doubt == pytest.approx(0.5 / energy, rel=0.02)  # slow noise is no less in a mean
    left = less.problem.measured - fit(less.problem, 1.0 / less.noise.sigma).prediction
    assert np.std(left) == pytest.approx(SIGMA * energy**0.5, rel=0.05)


def test_of_samples_that_are_all_taken_nothing_changes(problem: Problem) -> None:
    seen = in_white_noise(problem)
    same = in_steps_of(1, seen)
    assert np.allclose(same.problem.measured, problem.measured, atol=1e-6 * SIGMA)
    assert np.array_equal(same.roles.fit, seen.roles.fit)
    assert same.problem.mean_of == pytest.approx(1.0)
    assert np.array_equal(averaged(same.problem.runs[0], problem.runs[0].measured), problem.runs[0].measured)


@pytest.mark.parametrize(
    ("id_", "values"),
    [("slope_bias", {"torque": 150.0}), ("line_loss_quadratic", {"c": 8e3}), ("end_stop", {"engage_angle": 0.2, "stiffness": 4e3})],
)
def test_an_effect_takes_as_much_evidence_as_of_all_samples_in_a_fifth_of_them(
    problem: Problem, id_: str, values: dict[str, float]
) -> None:
    truth = effect(id_, **values)
    seen = in_white_noise(with_torque(problem, problem.predict_all(problem.start(), [truth])))

    def taken(seen: Seen) -> float:
        used = np.where(seen.problem.valid, 1.0 / seen.noise.sigma, 0.0)
        return fit(seen.problem, used).cost - fit(seen.problem, used, [truth]).cost

    assert taken(in_steps_of(5, seen)) == pytest.approx(taken(seen), rel=0.1)
    assert taken(in_steps_of(5, seen, means=False)) < 0.4 * taken(seen)


def test_no_mean_holds_a_sample_that_is_held_out_or_not_valid(problem: Problem) -> None:
    """Wherever such samples are put out of reach by an error of their own, the means that may fit do not know."""
    gap = np.zeros(problem.measured.size, bool)
    gap[1000:1100] = True
    runs = [replace(run, valid=~part) for run, part in zip(problem.runs, np.split(gap, problem.edges[1:-1]), strict=True)]
    seen = in_white_noise(Problem(problem.vehicle, runs))
    unseen = gap | ~seen.roles.fit
    measured = np.split(np.where(unseen, 1e6, seen.problem.measured), problem.edges[1:-1])
    spoiled = Problem(problem.vehicle, [replace(run, measured=part) for run, part in zip(runs, measured, strict=True)])
    baseline = fit(seen.problem, np.where(seen.roles.fit, weight(seen.problem), 0.0))
    clean, foul = (
        fewer(each, seen.noise, seen.roles, baseline, problem.measured.size, 10.0, means=True) for each in (seen.problem, spoiled)
    )
    used = clean[2].fit & clean[0].valid
    assert used.sum() > 0.5 * used.size
    assert np.array_equal(clean[0].measured[used], foul[0].measured[used])
