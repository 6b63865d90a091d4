# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A candidate on trial: fitted inside the simulator beside what was found before, from several shapes, instants and starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lugre_steering.fitting import onset
from lugre_steering.fitting.fingerprint import Score
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Candidate, Effects, Problem, Values
from lugre_steering.recording import Array

RETIMED = 2
"""Rounds of timing a late effect."""
PARTIAL = 0.1
"""Share by which an effect in one bag only, or from a time on, must explain more than the same everywhere."""
VARIANT, VARIANTS = 0.5, 2
"""Share of the best shape's screened energy, and number, of further shapes from which a promising effect is fitted."""
TRIAL_TOLERANCE = 1e-4
"""Relative fall of the cost that ends a trial: enough to rank it."""
START, GO_ON, NEAR = 3, 5, 0.3
"""Linearisations of a trial from each start and beyond, and the share of the best trial's gain within which it must be able to come:
what ties or follows a name is far nearer."""
SURE_SIGMA = 4.0
"""Standard deviations that keep an optional part of a law, or as much for each of several that only matter together."""


@dataclass(frozen=True)
class Trial:
    """A screened candidate after its joint fit."""

    score: Score
    fit: Fit
    cost: float

    @property
    def candidate(self) -> Candidate:
        return self.fit.effects[-1][0]


def cost(problem: Problem, result: Fit, weight: Array) -> float:
    """Weighted sum of squared errors over the samples with weight, in noise variances."""
    return float(np.sum(((problem.measured - result.prediction) * weight) ** 2))


class Round:
    """Trials beside one fit: what has been tried is kept, and what cannot come near the best any more is left unfinished."""

    def __init__(self, problem: Problem, weight: Array, current: Fit, scores: Sequence[Score]) -> None:
        self.problem, self.weight, self.current, self.scores = problem, weight, current, scores
        self.before = self.best = current.cost
        self._tried: dict[Candidate, Trial] = {}

    def try_effect(self, score: Score) -> Trial:
        """Joint fit of calibration, earlier effects and this candidate."""
        if score.candidate not in self._tried:
            trial = self._joint(score)
            self._tried[score.candidate] = trial
            self.best = min(self.best, trial.cost)
        return self._tried[score.candidate]

    @property
    def worth(self) -> float:
        """Cost that a trial must be able to reach to matter."""
        return worth_of(self.before, self.best)

    def _joint(self, score: Score) -> Trial:
        if not _cornered(self.problem, self.current):
            return self._fitted(score, self.current, linearisations=START + GO_ON, worth=self.worth)
        # Recalibration was bent to imitate what is missing; from there the way back may be closed.
        started = [self._fitted(score, x, linearisations=START) for x in (self.current, self.problem.start())]
        ahead = min(started, key=lambda each: each.cost)
        gone_on = fit(
            self.problem, self.weight, ahead.fit.effects, ahead.fit, linearisations=GO_ON, tolerance=TRIAL_TOLERANCE,
            worth=self.worth,
        )
        return Trial(score, gone_on, gone_on.cost)

    def _fitted(self, score: Score, start: Array | Fit, *, linearisations: int = START + GO_ON, worth: float = np.inf) -> Trial:
        """One joint fit of nuisances (from ``start``), earlier effects and the candidate, its shapes set free as well."""
        effects = [*self.current.effects, (shaped(score.candidate), score.values)]
        result = fit(
            self.problem, self.weight, effects, start, linearisations=linearisations, tolerance=TRIAL_TOLERANCE, worth=worth
        )
        return Trial(score, result, result.cost)

    def everywhere(self, trial: Trial) -> Trial:
        """A trial of an effect in one bag only, or from a time on, against the same everywhere, which is the simpler claim."""
        if not _partial(trial.score):
            return trial
        claim = trial.score.candidate.claim
        whole = next((s for s in self.scores if s.candidate.claim == claim and not _partial(s)), None)
        if whole is None or whole.explained <= 0.0:
            return trial
        simpler = self.try_effect(whole)
        return simpler if simpler.cost < trial.cost + PARTIAL * (self.before - trial.cost) else trial

    def begun_late(self, trial: Trial) -> Trial:
        """A trial of an effect that is always there against the same from an instant on, which must explain clearly more."""
        tried = trial.score.candidate
        late = next((s for s in self.scores if (c := s.candidate).label == tried.label and c.bags is None and c.since), None)
        if late is None or late.explained <= 0.0 or _partial(trial.score):
            return trial
        begun = retime(self.problem, self.weight, self.try_effect(late))
        return begun if begun.cost < trial.cost - PARTIAL * (self.before - begun.cost) else trial

    def deepen(self, trial: Trial) -> Trial:
        """A promising trial also from its next best shapes, and at its typical size from the sheet.

        Valleys are narrow, and a linear guess far from the truth may lie beyond the next hill.
        """
        tried = trial.score.candidate
        variants = [
            score for score in self.scores
            if (c := score.candidate).claim == tried.claim and (c.bags, c.since) == (tried.bags, tried.since)
            and c.shapes != tried.shapes and score.explained > VARIANT * trial.score.explained
        ]  # fmt: skip
        typical = replace(trial.score, coefficients=tuple(float(np.sign(c)) for c in trial.score.coefficients))
        starts: list[tuple[Score, Array | Fit]] = [(score, trial.fit) for score in variants[:VARIANTS]]
        starts.append((typical, self.problem.start()))
        best = trial
        for score, x in starts:
            best = min([best, self._fitted(score, x, worth=best.cost)], key=lambda each: each.cost)
        for _ in range(RETIMED if tried.since else 0):
            best = retime(self.problem, self.weight, best)
        return self._moved(best)

    def _moved(self, trial: Trial) -> Trial:
        """The trial with each end of its window where it explains most of the places that the screen has tried: the fit sees only what
        is at an end, and stops at the next hill."""
        *earlier, (candidate, _) = trial.fit.effects
        alike = [score.values for score in self.scores if score.candidate.claim == candidate.claim]
        places = {name: sorted({own[name] for own in alike}) for name in candidate.claim[1:] if name in candidate.free}
        ends = {name: tried for name, tried in places.items() if len(tried) > 1}
        if not ends:
            return trial
        moved = onset.placed(self.problem, self.weight, trial.fit, len(earlier), ends)
        result = fit(self.problem, self.weight, [*earlier, (candidate, moved)], trial.fit, linearisations=GO_ON, tolerance=TRIAL_TOLERANCE)
        return Trial(trial.score, result, result.cost) if result.cost < trial.cost else trial


def shaped(candidate: Candidate) -> Candidate:
    """A screened candidate with the shapes of its law free as well, but for optional parts."""
    shapes = dict(candidate.shapes)
    free = (p.name for p in candidate.effect.parameters if p.name in candidate.free or (p.name in shapes and not p.optional))
    return replace(candidate, free=tuple(free))


def worth_of(before: float, best: float) -> float:
    """Cost that a trial must be able to reach to matter beside the best one."""
    return best + NEAR * (before - best)


def _partial(score: Score) -> bool:
    return score.candidate.bags is not None or bool(score.candidate.since)


def _cornered(problem: Problem, current: Fit) -> bool:
    """Whether a calibration value lies implausibly far from the sheet."""
    prior = np.array([calibration.prior for calibration in problem.calibrations])
    return bool(np.any(np.abs(current.x[: prior.size]) > 2.0 * prior))


def retime(problem: Problem, weight: Array, trial: Trial) -> Trial:
    """A late effect from the instants that fit best, one per bag, with its values fitted anew."""
    again = _begun(problem, weight, trial, onset.timed(problem, weight, trial.fit, len(trial.fit.effects) - 1))
    return again if again.cost < trial.cost else trial


def begun_with(problem: Problem, weight: Array, trial: Trial, other: Trial, before: float) -> Trial:
    """An effect from the instants of a late one, where it explains more from these: timing sees only what is near its own. One that acts
    always must explain clearly more of the cost ``before``."""
    since, own = other.candidate.since, trial.candidate
    if not since or own.since == since or own.bags is not None:
        return trial
    again = _begun(problem, weight, trial, since)
    clearly = 0.0 if own.since else PARTIAL * (before - again.cost)
    return again if again.cost < trial.cost - clearly else trial


def _begun(problem: Problem, weight: Array, trial: Trial, since: tuple[float, ...]) -> Trial:
    """A late effect from other instants, fitted anew."""
    *earlier, (candidate, values) = trial.fit.effects
    effects = [*earlier, (replace(candidate, since=since), values)]
    result = fit(problem, weight, effects, trial.fit, linearisations=8, tolerance=TRIAL_TOLERANCE)
    return Trial(trial.score, result, result.cost)


def rank(trial: Trial, before: float) -> float:
    """Cost by which trials compete: an onset is a freedom that fits many an event, so a late effect must explain clearly more."""
    return trial.cost + PARTIAL * max(before - trial.cost, 0.0) * bool(trial.candidate.since)


def ranked(trials: Sequence[Trial], before: float) -> list[Trial]:
    """Best first."""
    return sorted(trials, key=lambda trial: rank(trial, before))


def is_timed(trial: Trial) -> bool:
    """Whether what a trial found begins or ends within the recordings."""
    return bool(trial.candidate.since) or any(trial.fit.effects[-1][1].get(edge) for edge in ("time_start", "time_end"))


def refine(problem: Problem, weight: Array, trial: Trial, worth: float = np.inf) -> Trial:
    """Let the effect have the optional parts of its family; those that do not earn their place go again.

    A trial that even so cannot come to a cost ``worth`` anything is left unfinished.
    """
    trial = _set_free(problem, weight, trial)
    *earlier, (candidate, values) = trial.fit.effects
    kept = [p.name for p in candidate.effect.parameters if p.optional and p.name not in candidate.free]
    start = {**{name: 0.2 * candidate.parameter(name).scale for name in kept}, **values}
    richer = replace(candidate, free=(*candidate.free, *kept))
    result = fit(problem, weight, [*earlier, (richer, start)], trial.fit, linearisations=12, tolerance=TRIAL_TOLERANCE, worth=worth)
    left = result.cost
    if left > worth:
        return trial
    while weak := _weak(result, values, kept, problem.doubt):
        # Two that do the same work are both weak, yet not both superfluous.
        for dropped in (weak, weak[:1]) if len(weak) > 1 else (weak,):
            leaner = _without(problem, weight, result, values, dropped)
            after = leaner.cost
            if after < left + SURE_SIGMA**2 * problem.doubt * len(dropped):
                break
        else:
            break
        result, left, kept = leaner, after, [name for name in kept if name not in dropped]
    return Trial(trial.score, result, left) if left < trial.cost else trial


def _set_free(problem: Problem, weight: Array, trial: Trial) -> Trial:
    """The trial with those optional parts free that its shape began with, where that earns its place."""
    *earlier, (candidate, values) = trial.fit.effects
    begun = [name for name, _ in candidate.shapes if candidate.parameter(name).optional and name not in candidate.free]
    if not begun:
        return trial
    freed = replace(candidate, free=(*candidate.free, *begun))
    result = fit(problem, weight, [*earlier, (freed, values)], trial.fit, linearisations=12, tolerance=TRIAL_TOLERANCE)
    return Trial(trial.score, result, result.cost) if result.cost < trial.cost - SURE_SIGMA**2 * problem.doubt * len(begun) else trial


def _weak(result: Fit, values: Values, optional: Sequence[str], doubt: float) -> list[str]:
    """Parameters of the last effect that left their value in ``values`` by less than some standard deviations, weakest first."""
    if not optional:
        return []
    deviation = np.sqrt(np.maximum(np.diag(result.covariance), 0.0) * doubt)[-len(optional) :]
    fitted = result.effects[-1][1]
    moved = {n: abs(fitted[n] - values.get(n, 0.0)) / max(float(sd), 1e-300) for n, sd in zip(optional, deviation, strict=True)}
    return sorted((name for name in optional if moved[name] < SURE_SIGMA), key=moved.__getitem__)


def without_part(effects: Effects, index: int, part: str) -> Effects:
    """The effects, one of which lacks a part."""
    candidate, values = effects[index]
    free = tuple(name for name in candidate.free if name != part)
    leaner = replace(candidate, free=free), {name: value for name, value in values.items() if name != part}
    return [*effects[:index], leaner, *effects[index + 1 :]]


def _without(problem: Problem, weight: Array, result: Fit, values: Values, dropped: Sequence[str]) -> Fit:
    """The fit with parameters of its last effect back at their value in ``values``, or gone."""
    *earlier, (candidate, fitted) = result.effects
    leaner = replace(candidate, free=tuple(name for name in candidate.free if name not in dropped))
    start = {**values, **{name: value for name, value in fitted.items() if name not in dropped}}
    return fit(problem, weight, [*earlier, (leaner, start)], result, linearisations=8)
