# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How sure fitted values are, and which names of a fit may be nothing at all."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from lugre_steering.diagnosis.search.compare import END, NAME_TAKEN
from lugre_steering.diagnosis.search.locate import contribution
from lugre_steering.fitting.doubt import NORMAL
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.split import BLOCK_S, CLUSTER_S, Split
from lugre_steering.fitting.trial import SURE_SIGMA
from lugre_steering.recording import Array

SURE_OF_SIZE = 2.0
"""Standard deviations by which a name on a single joint must be more than nothing."""
ALONG = 0.5
"""Share of the energy of a law's other form that lies along the law itself, and so in its values."""


def deviations(problem: Problem, weight: Array, roles: Split, fitted: Fit) -> Array:
    """Standard deviation of each fitted value (q,): by the doubt about the errors, or by how much whole blocks of the recordings pull it
    apart (Liang and Zeger, Biometrika 73 (1986) 13), whichever is more: a law of another form errs alike for seconds on end."""
    known = np.maximum(np.diag(fitted.covariance), 0.0) * problem.doubt
    error = (problem.measured - fitted.prediction) * weight
    _, block = np.unique(roles.cluster // round(BLOCK_S / CLUSTER_S), return_inverse=True)
    pulls = np.zeros((int(block.max()) + 1, known.size))
    np.add.at(pulls, block, fitted.jacobian * error[:, None])
    moved = pulls @ fitted.covariance
    return np.asarray(np.sqrt(np.maximum(known, np.sum(moved**2, axis=0) * len(pulls) / max(len(pulls) - 1, 1))))


def _columns(problem: Problem, fitted: Fit, index: int) -> slice:
    """Where the values of one effect stand among all that were fitted."""
    first = problem.nuisances + sum(len(own.free) for own, _ in fitted.effects[:index])
    return slice(first, first + len(fitted.effects[index][0].free))


def moved_by_form(problem: Problem, weight: Array, fitted: Fit, index: int) -> dict[str, float]:
    """By how much each value of one effect may be off because its law is of another form; a shape at most as far as matters: some, like
    the end of a rest, hardly act."""
    candidate, _ = fitted.effects[index]
    per_value = np.linalg.norm(fitted.jacobian[:, _columns(problem, fitted, index)], axis=0)
    torque = float(np.sqrt(ALONG * NAME_TAKEN) * np.linalg.norm(contribution(problem, fitted, index) * weight))
    found = {key: torque / max(float(size), 1e-300) for key, size in zip(candidate.free, per_value, strict=True)}
    shapes = {key: candidate.parameter(key).scale for key in found if key not in candidate.effect.amplitudes}
    return {key: min(moved, shapes.get(key, np.inf)) for key, moved in found.items()}


def in_deviations(problem: Problem, weight: Array, roles: Split, fitted: Fit, index: int) -> dict[str, float]:
    """The amplitudes of one effect of a fit in their standard deviations."""
    candidate, values = fitted.effects[index]
    own = zip(candidate.free, deviations(problem, weight, roles, fitted)[_columns(problem, fitted, index)], strict=True)
    return {key: abs(values[key]) / max(float(known), 1e-300) for key, known in own if key in candidate.effect.amplitudes}


def least_sure_part(problem: Problem, weight: Array, roles: Split, fitted: Fit, terms: Iterable[int]) -> tuple[int, str] | None:
    """Which of these ``terms`` of a fit has which part, one of several, that may as well be nothing: the least sure, an optional one before
    any other. What is kept by chance takes as much from the term itself."""
    parts = [(i, in_deviations(problem, weight, roles, fitted, i)) for i in terms]
    unsure = [
        (not fitted.effects[i][0].parameter(name).optional, size, i, name)
        for i, own in parts for name, size in own.items() if size < SURE_SIGMA and len(own) > 1
    ]
    return min(unsure)[2:] if unsure else None


def least_sure_name(problem: Problem, weight: Array, roles: Split, fitted: Fit, names: int) -> int | None:
    """Which of the first ``names`` of a fit, unless it is the only one, may as well be nothing: the least sure."""
    sizes = [max(in_deviations(problem, weight, roles, fitted, i).values(), default=np.inf) for i in range(names)]
    least = int(np.argmin(sizes)) if names > 1 else 0
    return least if names > 1 and sizes[least] < SURE_OF_SIZE else None


def idle(problem: Problem, weight: Array, roles: Split, fitted: Fit, index: int) -> list[str]:
    """Shapes of one effect that may as well be zero and stand at their bound."""
    return [key for key, at_bound in _maybe_zero(problem, weight, roles, fitted, index) if at_bound]


def maybe_idle(problem: Problem, weight: Array, roles: Split, fitted: Fit, index: int) -> list[str]:
    """Shapes of one effect that may as well be zero, wherever they stand."""
    return [key for key, _ in _maybe_zero(problem, weight, roles, fitted, index)]


def _maybe_zero(problem: Problem, weight: Array, roles: Split, fitted: Fit, index: int) -> Iterator[tuple[str, bool]]:
    """Shapes of one effect that may as well be zero, and whether they stand at their bound: at so short a slip or time a law has acted
    before any recording shows it, and is another level of what is there."""
    candidate, values = fitted.effects[index]
    form = moved_by_form(problem, weight, fitted, index)
    for key, known in zip(candidate.free, deviations(problem, weight, roles, fitted)[_columns(problem, fitted, index)], strict=True):
        parameter = candidate.parameter(key)
        if key in candidate.effect.amplitudes or parameter.low < 0.0 < parameter.high:
            continue
        at = parameter.scaled(values[key])
        low, high = sorted((parameter.scaled(parameter.low), parameter.scaled(parameter.high)))
        if abs(values[key]) < float(np.hypot(NORMAL * known, form[key])):
            yield key, not low + END * (high - low) < at < high - END * (high - low)
