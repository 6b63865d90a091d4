# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Compare models by one number: the energy that one takes more than the other, against two doubts.

What a fit leaves is no white noise: errors are larger than those of the sensors and last, so that many samples count as one. And no
law is true to a percent: what the friction law and the effects already named may do by bending (their freedoms, with priors
of the size that real ones show) is given to every model that is compared, and of what these freedoms do some part is
always beyond them. A name must take more than both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lugre_steering.diagnosis.loudness import FORM_LEFT, OWN_ERROR, beyond_calibration, excess, form_energy
from lugre_steering.diagnosis.search.locate import contribution
from lugre_steering.diagnosis.search.propose import Proposal
from lugre_steering.effects.entry import Effect
from lugre_steering.fitting.doubt import doubt
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import TYPICAL, Problem
from lugre_steering.fitting.sheet import gone_too_far
from lugre_steering.fitting.split import Split
from lugre_steering.fitting.trial import TRIAL_TOLERANCE, Trial, rank
from lugre_steering.recording import Array

SURE = 25.0
"""Energy, in doubts, that a name must take: by chance one of some hundred candidates does so once in a thousand searches."""
SURE_OF_LEFT = 2.0
"""Standard deviations by which more may be left beyond noise than a fit shows."""
OWN_SHARE = 0.1
"""Share of the simulation's own error that may look like one name beside freedoms, which take up most of it."""
NAME_TAKEN, TAKEN_OF_SLOW, DONE_BY_INERTIA = 0.04, 0.06, 0.01
"""What another form of names than nature's may make, of what they take: the energy of an error of a fifth of their torque; of those that
settle with time, or follow the acceleration: how rubber, oil and sensors settle is known less well than how they act; and of all that the
inertia of every joint does: an acceleration is known only as smoothed as the angles ask for."""
SHOWN = 20.0
"""Times what the bends of names themselves do that their laws may be wrong by at most: of an error, places along a name's own coordinate
take more than a twentieth."""
ROUNDS, ALIKE = 3, 0.1
"""Most refits until doubt and size of the bends stay, the doubt within so much of itself."""
SIZES = (0.01, 0.03, 0.1, 0.3, 1.0)
"""Sizes of bends that are tried, in what is typical of real rubber."""
TIE_T, TIE = 2.5, 10.0
"""Models are tied within so many standard errors block by block unless they are SURE apart, or within so many doubts."""
PER_VALUE = 4.0
"""Doubts that a free value costs where models are tied."""
HALF = 0.5
"""Share of the best one's energy that a rival must take."""
END = 0.01
"""Share of a bound within which a value stands at it."""
MARGIN = 0.1
"""Share of what names take that laws must take more: a name wins a draw."""


def settled(problem: Problem, weight: Array, result: Fit, own_doubt: float | None = None) -> tuple[Problem, Fit]:
    """The problem with the doubt that its own fit leaves (or a given one) and bends as large as the data ask for, and its fit.

    Both decide how much priors weigh. Where the law is that of the recording, bends are worth nothing and are none.
    """
    for _ in range(ROUNDS):
        now = doubt(problem, result, weight) if own_doubt is None else own_doubt
        before, sizes = problem, [problem.doubted(now, TYPICAL * share) for share in SIZES]
        problem = min(sizes, key=_expected(problem, weight, result))
        result = fit(problem, weight, result.effects, result, tolerance=TRIAL_TOLERANCE)
        if problem.typical == before.typical and abs(problem.doubt - before.doubt) < ALIKE * before.doubt:
            break
    return problem, result


def worlds(problem: Problem) -> list[Problem]:
    """The problem, and the same with hardly any bends: where much is missing they stand for it, and would make small what it is."""
    exact = problem.doubted(problem.doubt, TYPICAL * SIZES[0])
    return [problem, exact] if problem.typical > exact.typical else [problem]


def clearest(weight: Array, proposals: Sequence[Proposal]) -> tuple[Problem, Fit]:
    """Of the best models of several worlds the one with most evidence, settled by the doubt of the one that leaves least in doubt."""
    models = [settled(own.problem, weight, own.best) for own in proposals]
    least = min(there.doubt for there, _ in models)
    return min((settled(there, weight, best, least) for there, best in models), key=lambda model: left(*model))


def left(problem: Problem, result: Fit) -> float:
    """Energy, in noise variances, by which models are compared: what a fit leaves, and what its freedoms are worth.

    Minus twice the logarithm of the evidence (MacKay, Neural Computation 4 (1992) 415), times the doubt.
    """
    return result.cost + problem.doubt * _volume(problem, _gram(problem, result))


def _expected(problem: Problem, weight: Array, result: Fit) -> Callable[[Problem], float]:
    """What ``left`` would be of a model that is linear about a fit, by the doubt and the sizes of bends that the problem has."""
    error, x, gram = (problem.measured - result.prediction) * weight, result.x, _gram(problem, result)
    pull = result.slope[:, : problem.nuisances].T @ error / result.natural[: problem.nuisances]
    along, energy = pull + gram @ x, float(error @ error + 2.0 * pull @ x + x @ gram @ x)

    def expected(each: Problem) -> float:
        prior = (each.prior_weights(True) / each.scales()) ** 2
        cost = energy - float(along @ np.linalg.solve(gram + np.diag(prior), along))
        return cost + each.doubt * _volume(each, gram)

    return expected


def _gram(problem: Problem, result: Fit) -> Array:
    """Square (k, k) of the change of the weighted prediction per unit of each nuisance."""
    own = slice(0, problem.nuisances)
    return np.asarray(result.gram[own, own] / np.outer(result.natural[own], result.natural[own]))


def _volume(problem: Problem, gram: Array) -> float:
    """Logarithm of the squared ratio of the volumes of all freedoms before and after the data."""
    prior = problem.prior_weights(True) / problem.scales()  # weighed against one doubt, as the data are
    return float(np.linalg.slogdet(np.eye(prior.size) + gram / np.outer(prior, prior))[1])


def needed(problem: Problem, result: Fit, weight: Array, stands: float = 0.0, shapes: int = 1) -> float:
    """Energy that a name must take to be believed, where ``result`` has it; ``stands``: ``may_differ`` of the names before it.

    Of what freedoms and names do, some part is always of another form than nature; of the freedoms as much as may be left at most, and as
    many times that as there are ``shapes`` to take it: a law whose values make its shape takes of any error what as many names would.
    """
    samples = float(np.count_nonzero(weight))
    own = OWN_ERROR * problem.mean_of * samples * (OWN_SHARE if problem.bends.shape[1] else 1.0)
    most_left = max(excess(problem, result, weight) * samples, 0.0) + SURE_OF_LEFT * float(np.sqrt(2.0 * samples * problem.doubt))
    form = min(shapes * most_left, FORM_LEFT * form_energy(problem, result, weight))
    return SURE * problem.doubt + form + stands + own


def may_differ(problem: Problem, result: Fit, older: int, gains: Sequence[float]) -> float:
    """Energy that another form of the ``older`` effects of ``result`` may make; ``gains``: what each of the last of these took.

    Shares of these, as beside a name its own law may bend along its coordinate, but no more than SHOWN by how far it does, unless time
    or acceleration is that. Of the inertia that every joint has a share of all that its torque does beyond a recalibration.
    """
    first, slow, found = older - len(gains), 0.0, 0.0
    for i, (candidate, _) in enumerate(result.effects[:older]):
        if i < first:
            if _slow(candidate.effect):
                slow += DONE_BY_INERTIA * beyond_calibration(problem, result, contribution(problem, result, i))
        elif _slow(candidate.effect):
            slow += TAKEN_OF_SLOW * gains[i - first]
        else:
            found += NAME_TAKEN * gains[i - first]
    own = slice(problem.nuisances - problem.shapes, problem.nuisances)
    bent = problem.bends[:, problem.bends.shape[1] - problem.shapes :] @ result.x[own]
    return slow + min(found, SHOWN * beyond_calibration(problem, result, bent))


def _slow(effect: Effect) -> bool:
    return effect.coordinate in ("dwell", "steering acceleration") or "lag" in effect.hooks


def tied(
    problem: Problem, weight: Array, split: Split, best: Trial, others: Sequence[Trial], before: float, *, exact: bool = False
) -> list[Trial]:
    """Rivals that this data cannot tell from the best.

    What recalibration must go too far for could not be named alone, nor in place of what does without.
    """
    found, sound = [], not gone_too_far(problem, best.fit.x)
    for other in others:
        if other.candidate.label == best.candidate.label or before - other.cost < HALF * (before - best.cost):
            continue
        if sound and gone_too_far(problem, other.fit.x):
            continue
        if ties(problem, weight, split, best.fit, other, before, exact=exact):
            found.append(other)
    return found


def ties(
    problem: Problem, weight: Array, split: Split, best: Fit, other: Trial, before: float, *, exact: bool = False
) -> bool:
    """Whether this data cannot tell another model from the best fit; ``before``: energy without either.

    Either no clear difference block by block (Vuong 1989), or one smaller than the doubts and what another form of its law than
    nature's may leave of what the best takes; nothing where the law is ``exact``.
    """
    error = ((problem.measured - best.prediction) * weight) ** 2
    difference = np.bincount(split.cluster, ((problem.measured - other.fit.prediction) * weight) ** 2 - error)
    t = difference.sum() / max(np.sqrt(np.sum(difference**2)), 1e-9)
    apart = other.cost - best.cost
    law = 0.0 if exact else TAKEN_OF_SLOW if _slow(other.candidate.effect) else NAME_TAKEN
    return bool((apart < SURE * problem.doubt and t < TIE_T) or apart < TIE * problem.doubt + law * (before - best.cost))


def as_far_as_it_may(current: Fit, names: int) -> bool:
    """Whether one of the last ``names`` of a fit acts as strongly as it ever does: it makes up for what is something else."""
    for candidate, values in current.effects[len(current.effects) - names :]:
        for name in candidate.effect.amplitudes:
            parameter, value = candidate.parameter(name), values.get(name, 0.0)
            if value and not (1.0 - END) * parameter.low < value < (1.0 - END) * parameter.high:
                return True
    return False


def simplest(best: Trial, rivals: list[Trial], before: float, own_doubt: float) -> tuple[Trial, list[Trial]]:
    """Of effects that fit equally well the one with the fewest free parameters stands for the group, before any that must go as far as it
    may to do so."""
    group = [best, *rivals]

    def plainness(trial: Trial) -> tuple[bool, float]:
        return as_far_as_it_may(trial.fit, 1), rank(trial, before) + PER_VALUE * own_doubt * len(trial.candidate.free)

    chosen = min(group, key=plainness)
    return chosen, [trial for trial in group if trial is not chosen]
