# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The next experiment: which manoeuvre would tell rivals apart, or make a weak effect visible."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lugre_steering import units
from lugre_steering.data.dataset import Run, ideal_run
from lugre_steering.diagnosis.conclude.formed import Formed
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.laws.find import FoundLaws
from lugre_steering.diagnosis.laws.refine import Law
from lugre_steering.diagnosis.laws.write import law_words
from lugre_steering.diagnosis.result import Experiment
from lugre_steering.errors import DataError
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Candidate, Problem, is_rig
from lugre_steering.recording import Array
from lugre_steering.simulate.manoeuvres import (
    BUILT_IN,
    HEATING,
    LIMIT_DEG,
    SAMPLE_S,
    Chirp,
    Manoeuvre,
    Segment,
    Sweep,
    motion_of,
)
from lugre_steering.vehicle import Vehicle

SHORTEST_TRAVEL = 20.0
"""Travel asked of a linear axis that hardly moved, in presliding lengths."""
Named = tuple[Candidate, Mapping[str, float]]


def manoeuvres(problem: Problem) -> Mapping[str, Manoeuvre]:
    """The built-in manoeuvres; for a joint or axis scaled to the travel it was recorded over, as none is known otherwise, and without
    those that warm rubber."""
    if not is_rig(problem.vehicle):
        return BUILT_IN
    low, high = _reach(problem)
    factor = 0.5 * (high - low) / float(np.radians(LIMIT_DEG))
    return {name: _scaled(manoeuvre, factor, problem.vehicle) for name, manoeuvre in BUILT_IN.items() if name not in HEATING}


def _reach(problem: Problem) -> tuple[float, float]:
    """Ends of the recorded travel of a joint or axis, widened if it hardly moved."""
    low, high = min(float(run.theta.min()) for run in problem.runs), max(float(run.theta.max()) for run in problem.runs)
    middle, half = 0.5 * (low + high), 0.5 * max(high - low, SHORTEST_TRAVEL * problem.presliding)
    return middle - half, middle + half


def _scaled(manoeuvre: Manoeuvre, factor: float, vehicle: Vehicle) -> Manoeuvre:
    """Angles and rates multiplied by a factor, in the description too, where they are given in the unit of a linear axis."""
    unit, told = (vehicle.coordinate.unit, factor * float(np.radians(1.0))) if units.is_linear(vehicle) else ("deg", factor)

    def part(segment: Segment) -> Segment:
        if isinstance(segment, Sweep):
            return replace(segment, to_deg=factor * segment.to_deg, rate_deg_s=factor * segment.rate_deg_s)
        return replace(segment, amplitude_deg=factor * segment.amplitude_deg) if isinstance(segment, Chirp) else segment

    def written(degrees: re.Match[str]) -> str:
        return re.sub(r"[\d.]+", lambda n: f"{told * float(n[0]):.2g}", degrees[1]) + f" {unit}"

    description = re.sub(r"([\d.]+(?:(?:, | to | and )[\d.]+)*) deg", written, manoeuvre.description)
    return replace(manoeuvre, description=description, segments=tuple(part(s) for s in manoeuvre.segments))


def _run(problem: Problem, manoeuvre: Manoeuvre, x: Array, sigma: float) -> Run:
    """The manoeuvre as a run whose ideal sensors see the baseline at ``x``: effects of sensors and arms act on that."""
    motion = motion_of(manoeuvre, problem.vehicle)
    keep = slice(None, None, max(1, round(SAMPLE_S / (motion.time[1] - motion.time[0]))))
    time, theta = motion.time[keep], motion.theta[:, keep]
    if is_rig(problem.vehicle):
        theta = theta + 0.5 * sum(_reach(problem))
    omega = np.gradient(theta, time, axis=1)
    rates = omega, np.gradient(omega, time, axis=1)
    at_rest = ideal_run(problem.vehicle, manoeuvre.name, time, theta, rates, np.zeros(time.size), sigma)
    torque = problem.over([at_rest]).predict(0, x)
    return ideal_run(problem.vehicle, manoeuvre.name, time, theta, rates, torque, sigma)


def separation(
    problem: Problem, fit: Fit, first: Sequence[Named], second: Sequence[Named], sigma: float
) -> dict[str, float]:
    """Energy per manoeuvre that the cylinders can drive, by which two explanations would differ there, after recalibration, in noise
    variances."""
    found = {}
    # Where and when they began belongs to the recordings, not to what is driven next.
    first, second = ([(replace(candidate, since=(), bags=None), values) for candidate, values in side] for side in (first, second))
    x = problem.one_bag(fit.x)
    for manoeuvre in manoeuvres(problem).values():
        try:
            trial = problem.over([_run(problem, manoeuvre, x, sigma)])
        except DataError:  # these cylinders cannot drive it
            continue
        difference = trial.predict(0, x, first) - trial.predict(0, x, second)
        base = trial.predict(0, x, first)
        tangent = np.column_stack([_moved(trial, x, j, first) - base for j in range(len(problem.calibrations))])
        kept = tangent[:, np.linalg.norm(tangent, axis=0) > 0.0]
        visible = difference - kept @ np.linalg.lstsq(kept, difference, rcond=None)[0]
        found[manoeuvre.name] = float(visible @ visible) / sigma**2
    return found


def _moved(problem: Problem, x: Array, j: int, effects: Sequence[Named]) -> Array:
    moved = x.copy()
    moved[j] += 0.02
    return problem.predict(0, moved, effects)


def recommend(problem: Problem, energies: Mapping[str, float]) -> tuple[str, str, float]:
    """Name, description and separation of the manoeuvre that tells most."""
    best = max(energies, key=lambda name: energies[name])
    return best, manoeuvres(problem)[best].description, energies[best]


def next_experiment(
    done: Finished, verdict: str, whole: Fit, laws: FoundLaws | None = None, form: Formed | None = None
) -> Experiment | None:
    """For a tie of names, of laws, or of a name and the ``form`` of the friction the manoeuvre that separates the rivals best; for
    unlisted structure those that vary one quantity at a time."""
    for index, item in enumerate(done.found.found if verdict == "missing_physics" else ()):
        rivals = [trial for trial in item.trials if trial.candidate.effect.id in item.rivals]
        if rivals:
            chosen = whole.effects[index]
            energies = separation(done.problem, whole, [chosen], [rivals[0].fit.effects[-1]], done.noise.floor)
            if energies:
                return _between(done.problem, energies, (chosen[0].effect.id, rivals[0].candidate.effect.id))
    if laws is not None and laws.ties:
        sides = laws.fitted.effects[: laws.names + 1], laws.ties[0].fit.effects
        energies = separation(laws.problem, laws.fitted, *sides, done.noise.floor)
        if energies:
            return _between(laws.problem, energies, tuple(_in_words(side[-1], done.problem.vehicle) for side in sides))
    if verdict == "consistent" and form is not None and (instead := done.compared.found.instead):
        name, problem = instead[0].fit.effects[-1], form.problem.with_names()
        energies = separation(problem, form.whole, form.whole.effects, [name], done.noise.floor)
        if energies:
            return _between(problem, energies, ("friction of another form", name[0].effect.id))
    if verdict == "unlisted_physics":
        return Experiment(
            "varied-rates, then small-loops and hold-and-rest: each changes one of rate, amplitude and dwell only",
            ("dependence on rate", "on amplitude", "on dwell"),
            "the structure follows none of the catalogue's laws; runs that vary one quantity at a time show which it depends on",
        )
    return None


def _between(problem: Problem, energies: Mapping[str, float], rivals: tuple[str, ...]) -> Experiment:
    """The manoeuvre that separates two rivals best."""
    best, description, energy = recommend(problem, energies)
    others = ", ".join(f"{key} {np.sqrt(value):.0f}" for key, value in energies.items() if key != best)
    return Experiment(
        f"{best}: {description}", rivals,
        f"there the two explanations differ by {np.sqrt(energy):.0f} standard deviations in all after recalibration, "
        f"more than in any other manoeuvre tried ({others})",
    )  # fmt: skip


def _in_words(law: Named, vehicle: Vehicle) -> str:
    candidate, values = law
    assert isinstance(candidate.effect, Law)
    return law_words(candidate.effect, values, vehicle)
