# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Friction of another form than the model's is no missing physics, and what hides beside it is named. All data are synthetic."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from small_problem import effect, small_problem, weight, with_torque

from lugre_steering.data.dataset import Run
from lugre_steering.diagnosis.conclude.augmented import augmented_vehicle
from lugre_steering.diagnosis.conclude.experiment import next_experiment
from lugre_steering.diagnosis.conclude.formed import formed
from lugre_steering.diagnosis.conclude.left_over import left_over
from lugre_steering.diagnosis.conclude.stands import standing
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.form import bent
from lugre_steering.diagnosis.investigate import investigate
from lugre_steering.diagnosis.loudness import FORM_LEFT, form_energy
from lugre_steering.diagnosis.search import compare
from lugre_steering.fitting.apply import apply_calibration
from lugre_steering.fitting.fingerprint import Score
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.split import CYCLE
from lugre_steering.fitting.trial import Trial, cost
from lugre_steering.fitting.weather import initial_of
from lugre_steering.recording import Array
from lugre_steering.simulate.manoeuvres import Manoeuvre, Sweep
from lugre_steering.vehicle import Vehicle

NOTHING = small_problem(25.0)
RECORD = NOTHING.model.parameters[0][0]


def friction(run: Run, sharpness: float, strengthening: float, uneven: float) -> Array:
    """Torque (n,) of tracks whose bristles yield by a power law, on ground that is not even, and stronger when faster."""
    level, stiffness, total = float(RECORD["coulomb_torque"]), float(RECORD["sigma_0"]), np.zeros(run.time.size)
    for theta in run.theta:
        bristle, torque = 0.0, np.zeros(theta.size)
        for i in range(1, theta.size):
            rate = abs(theta[i] - theta[i - 1]) / (run.time[i] - run.time[i - 1])
            strength = level * (1.0 + uneven * np.sin(14.0 * theta[i]) + strengthening * np.log1p(rate / 0.005))
            for step in np.full(4, (theta[i] - theta[i - 1]) / 4.0):
                share = stiffness * bristle / strength
                bristle += step - abs(step) * np.sign(share) * abs(share) ** sharpness
            torque[i] = stiffness * bristle
        total += torque
    return total


KNOWN = NOTHING.predict_all(NOTHING.start())
RUBBED = KNOWN + np.concatenate([friction(run, 1.4, 0.02, 0.02) - friction(run, 1.0, 0.0, 0.0) for run in NOTHING.runs])
"""The model's torque with friction of another form."""
STOP = np.concatenate([
    np.sum(2e5 * np.sign(run.theta) * np.maximum(np.abs(run.theta) - 0.22, 0.0), axis=0) for run in NOTHING.runs
])  # fmt: skip


@cache
def rubbed() -> Finished:
    """What an investigation of such friction alone comes to."""
    return investigate(with_torque(NOTHING, RUBBED), 1)


def left_beside_freedoms(known: Problem, torque: Array) -> float:
    """Share of what a recalibration leaves that stays beside the freedoms too."""
    problem = with_torque(known, torque)
    plain = fit(problem, weight(problem))
    freer, words, _ = bent(problem, plain)
    assert len(words) == freer.bends.shape[1]
    beside = fit(freer, weight(problem), start=np.concatenate([plain.x, np.zeros(len(words))]))
    return cost(freer, beside, weight(problem)) / cost(problem, plain, weight(problem))


def test_friction_of_another_form_is_explained_by_the_freedoms_and_a_stop_is_not() -> None:
    assert left_beside_freedoms(NOTHING, RUBBED) < FORM_LEFT < left_beside_freedoms(NOTHING, KNOWN + STOP)


@pytest.mark.parametrize("sharpness", [0.6, 1.5])
def test_presliding_that_yields_by_another_power_is_explained_in_part_strokes_too(sharpness: float) -> None:
    angles = np.cumsum([4.0, -1.5, 3.0, -6.0, 2.0, -4.0, 8.0, -2.0, 5.0, -12.0, 3.0])
    strokes = small_problem(25.0, Manoeuvre("strokes", "", tuple(Sweep(angle, 3.0, 0.5) for angle in angles)))
    other = np.concatenate([friction(run, sharpness, 0.0, 0.0) - friction(run, 1.0, 0.0, 0.0) for run in strokes.runs])
    assert left_beside_freedoms(strokes, strokes.predict_all(strokes.start()) + other) < 0.2 * FORM_LEFT


def test_no_name_is_given_to_friction_of_another_form() -> None:
    done = rubbed()
    assert done.needs_form  # it is seen
    assert not done.found.found
    assert done.beside_form is not None
    there, baseline = done.beside_form, done.beside_form.found.baseline
    left = left_over(there, baseline, done.needs_form)
    assert not left.structured
    assert "form" in left.entry.description
    # The form does as much on the samples held out, where no law may make up for it.
    per_sample = [form_energy(there.problem, baseline, used) / np.count_nonzero(used) for used in (there.fitted, there.held)]
    assert per_sample[1] == pytest.approx(per_sample[0])
    assert per_sample[0] > 1.0


def test_a_name_that_would_do_as_much_is_told_with_the_manoeuvre_that_separates_them() -> None:
    done, spring = rubbed(), effect("linkage_compliance", compliance=2e-6)
    there = done.compared
    alone = fit(there.problem, there.fitted, [spring])
    trial = Trial(Score(spring[0], 0.0, 0.0, 0.0, 0.0, (), np.zeros(0)), alone, alone.cost)
    told = replace(done, beside_form=replace(there, found=replace(there.found, instead=(trial,))))
    for each, names in ((done, ()), (told, ("linkage_compliance",))):
        entry = left_over(each.compared, there.found.baseline, each.needs_form).entry
        assert entry.indistinguishable_from == names
        assert ("linkage" in entry.description) == bool(names)
    advice = next_experiment(told, "consistent", done.found.baseline, form=formed(told, False, 1))
    assert advice is not None
    assert advice.separates == ("friction of another form", "linkage_compliance")
    assert next_experiment(done, "consistent", done.found.baseline, form=formed(done, False, 1)) is None


def test_what_a_name_must_take_is_what_is_left_until_all_of_it_may_be_the_form() -> None:
    """However much the freedoms do: where they leave nothing, a name need not take a share of that; noise of known energy adds itself."""
    done = rubbed()
    assert done.beside_form is not None
    there, used = done.beside_form, done.beside_form.fitted
    baseline, sigma = there.found.baseline, np.divide(1.0, used, out=np.zeros(used.size), where=used > 0.0)
    signs = np.random.default_rng(5).choice([-1.0, 1.0], used.size)
    worse = {size: replace(baseline, prediction=baseline.prediction + size * signs * sigma) for size in (0.0, 1.0, 10.0, 20.0)}
    asked = {size: compare.needed(there.problem, result, used) for size, result in worse.items()}
    whole = form_energy(there.problem, baseline, used)
    assert asked[0.0] < 0.002 * whole
    left = float(np.sum(((there.problem.measured - worse[1.0].prediction) * used) ** 2)) - np.count_nonzero(used)
    assert asked[1.0] - asked[0.0] == pytest.approx(left)  # the errors of the baseline itself are within noise
    assert asked[10.0] == asked[20.0] == pytest.approx(FORM_LEFT * whole, rel=0.01)
    more = [compare.needed(there.problem, worse[1.0], used, shapes=count) for count in (1, 2, 3, 10**6)]
    assert more[1] - more[0] == pytest.approx(more[2] - more[1])  # one share of what is left for each shape that may take it
    assert more[1] - more[0] > left
    assert more[3] == asked[10.0]  # but never more than all of the form that may be left


def error_elsewhere(vehicle: Vehicle) -> float:
    """RMSE [N m] of a vehicle file on strokes that were not recorded, of tracks whose friction has the other form; without noise."""
    strokes = small_problem(25.0, Manoeuvre("strokes", "", tuple(Sweep(angle, 5.0, 1.0) for angle in (9.0, -3.0, 14.0, -10.0, 12.0, 0.0))))
    other = np.concatenate([friction(run, 1.4, 0.02, 0.02) - friction(run, 1.0, 0.0, 0.0) for run in strokes.runs])
    known = Problem(vehicle, strokes.runs)
    error = strokes.predict_all(strokes.start()) + other - known.predict_all(known.start())
    return float(np.sqrt(np.mean(error[known.valid] ** 2)))


def test_the_form_of_the_friction_is_written_as_laws_that_foretell_another_manoeuvre() -> None:
    done = rubbed()
    form = formed(done, False, 1)
    assert form is not None
    assert form.better.interval[0] > 0.0
    assert {law.coordinate for law in form.laws} >= {"abs_rate", "angle", "opposing_torque", "since_reversal"}
    plain = augmented_vehicle(done, done.found.baseline, (), 0.0)
    there = replace(done, problem=form.problem)
    written = augmented_vehicle(there, form.whole, (), 0.0).replace(laws=form.laws)
    assert error_elsewhere(written) < 0.5 * error_elsewhere(plain)


def test_errors_of_the_model_do_not_lead_a_vehicle_file_away_from_its_sheet() -> None:
    """The sheet is that of the vehicle, whose friction has another form: by the noise of the sensors alone, values would go far from it,
    and the rubber would begin 16 K warmer; beside the errors of the model they stay nearer."""
    done = rubbed()
    near, far = done.problem.vehicle, apply_calibration(done.problem.vehicle, done.problem, done.found.baseline.x)
    far = far.replace(initial=initial_of(done.problem, done.found.baseline))
    written = augmented_vehicle(done, done.found.baseline, (), 0.0)

    def away(vehicle: Vehicle) -> float:
        pairs = [(own.rubber.heat_transfer_W_m2K, own.rubber.specific_heat_J_kgK) for own in (vehicle, near)]  # type: ignore[union-attr]
        warmer = abs(vehicle.initial.rubber_temperature_degC - near.initial.rubber_temperature_degC)  # type: ignore[union-attr]
        return float(np.abs(np.log(np.array(pairs[0]) / np.array(pairs[1]))).sum()) + warmer / 50.0

    assert away(written) < 0.5 * away(far)


def test_friction_of_the_model_has_no_form_of_its_own() -> None:
    assert formed(investigate(with_torque(NOTHING, KNOWN), 1), False, 1) is None


def test_freedoms_that_err_where_they_were_not_fitted_are_no_structure() -> None:
    """Of most of a recording lost, held-out samples lie where no fitted ones do."""
    whole, rng, runs = with_torque(NOTHING, KNOWN + 2.0 * (RUBBED - KNOWN)), np.random.default_rng(4), []
    for run in whole.runs:
        second = round(1.0 / (run.time[1] - run.time[0]))
        kept = np.repeat(rng.random(run.time.size // second + 1) < 0.15, second)[: run.time.size]
        kept[:second] = True
        runs.append(replace(run, valid=run.valid & kept))
    done = investigate(Problem(whole.vehicle, runs), 1)
    there = done.compared
    assert left_over(there, there.found.baseline, done.needs_form).structured
    _, stands = standing(done, 1, lambda _: None)
    assert stands.verdict == "consistent"


def test_a_stop_beside_it_is_named_alone_and_fitted_as_a_vehicle_file_can_hold_it() -> None:
    done = investigate(with_torque(NOTHING, RUBBED + STOP), 1)
    assert done.beside_form is not None
    (found,) = done.found.final.effects
    assert found[0].effect.id == "end_stop"
    assert found[1]["engage_angle"] == pytest.approx(0.22, abs=0.02)
    assert done.found.final.x.size == NOTHING.nuisances
    # Its values are those beside the freedoms; others explain more only because they make up for the form of the friction.
    assert done.around
    assert found[1] == done.beside_form.found.final.effects[0][1]
    ((_, freely),) = done.freely.effects
    assert done.freely.cost < done.found.final.cost
    for key, true in (("stiffness", 2e5), ("engage_angle", 0.22)):
        assert abs(found[1][key] - true) < 0.5 * abs(freely[key] - true)
    for phase in range(CYCLE):  # without a third of the data others, around which the rest is fitted
        ((_, again),) = done.refitted(phase).effects
        assert again != found[1]
        assert again["engage_angle"] == pytest.approx(0.22, abs=0.03)

