# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Propose: the candidates whose fingerprints a residual shows, each fitted in the chain beside all that stands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from lugre_steering.effects.registry import rivals
from lugre_steering.fitting.fingerprint import Score
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Problem
from lugre_steering.fitting.trial import (
    PARTIAL,
    TRIAL_TOLERANCE,
    Round,
    Trial,
    begun_with,
    is_timed,
    rank,
    ranked,
    refine,
    shaped,
    worth_of,
)
from lugre_steering.recording import Array

SHORTLIST, SHORT = 7, 0.08
"""Effects fitted at most, and the share of the best one's screened energy that each must have."""
PROMISING, CLOSE = (3, 5), 0.1
"""Of these how many are fitted with care at least and at most, and the share of the gain within which they deserve it."""
FALSE_DISCOVERY_RATE = 0.01
"""Of the fingerprints that are fitted: a screen, the comparison decides."""
LEADING = 0.5
"""Share of the best one's energy from which a trial is looked at more closely."""


@dataclass(frozen=True)
class Proposal:
    """One round: the fit without a further name, what the screen says beside it, and the trials, best first."""

    problem: Problem
    current: Fit
    scores: tuple[Score, ...]
    trials: list[Trial]

    @property
    def before(self) -> float:
        """Energy that is left without a further name."""
        return self.current.cost

    @property
    def best(self) -> Fit:
        return self.trials[0].fit if self.trials else self.current


def proposed(
    problem: Problem, weight: Array, current: Fit, scores: Sequence[Score], progress: Callable[[str], None]
) -> list[Trial]:
    """The shortlist fitted, what leads it also from an instant on and then with care; best first."""
    before = current.cost
    trials, tried = [], Round(problem, weight, current, scores)
    for score in choose(scores):
        progress(f"fitting {score.candidate.label}")
        trials.append(tried.everywhere(tried.try_effect(score)))
    trials = ranked(trials, before)
    trials[: PROMISING[0]] = [tried.begun_late(trial) for trial in trials[: PROMISING[0]]]
    trials = ranked(trials, before)
    if trials and is_timed(trials[0]):
        trials = ranked([tried.begun_late(trial) for trial in trials], before)
    close = sum(trial.cost < trials[0].cost + CLOSE * (before - trials[0].cost) for trial in trials)
    promising = int(np.clip(close, *PROMISING))
    trials[:promising] = [tried.deepen(trial) for trial in trials[:promising]]
    return ranked(trials, before)


def closer(problem: Problem, weight: Array, seen: Sequence[Proposal]) -> Proposal:
    """What leads in some rounds once more, with all parts of its laws, in one world."""
    current = fit(problem, weight, seen[0].current.effects, seen[0].current)
    leading = list[Trial]()
    for own in seen:
        best = own.before - own.trials[0].cost if own.trials else 0.0
        leading += [trial for trial in own.trials if own.before - trial.cost > LEADING * best]
    # Worlds may find one claim in places far from each other: from each of them.
    fitted, best = dict[tuple[tuple[str, ...], tuple[int, ...] | None], Trial](), current.cost
    for trial in sorted(leading, key=lambda each: each.cost):
        again = fit(problem, weight, trial.fit.effects, trial.fit, tolerance=TRIAL_TOLERANCE, worth=worth_of(current.cost, best))
        here = fitted.setdefault((trial.candidate.claim, trial.candidate.bags), replace(trial, fit=again, cost=again.cost))
        if again.cost < here.cost:
            fitted[trial.candidate.claim, trial.candidate.bags] = replace(trial, fit=again, cost=again.cost)
        best = min(best, again.cost)
    trials = list(fitted.values())
    # Which law has the better simplest form says little about their whole forms.
    near, best = worth_of(current.cost, best), current.cost
    for i, trial in enumerate(trials):
        if trial.cost <= near:
            trials[i] = refine(problem, weight, trial, worth_of(current.cost, best))
            best = min(best, trials[i].cost)
    if trials:
        leads = min(trials, key=lambda each: rank(each, current.cost))
        known = {*rivals(leads.candidate.effect)}
        trials = [
            begun_with(problem, weight, trial, leads, current.cost) if trial.cost <= near or trial.candidate.effect.id in known else trial
            for trial in trials
        ]
    return Proposal(problem, current, seen[0].scores, ranked(_one_of_each(trials, current.cost), current.cost))


def in_its_place(problem: Problem, weight: Array, seen: Proposal, leads: Trial) -> list[Trial]:
    """Known rivals of what leads that nobody has tried to the end, from where it stands: all else is known there, as it was not before."""
    *earlier, (champion, _) = leads.fit.effects
    best = dict[str, Score]()
    for score in sorted(seen.scores, key=lambda score: -score.explained):
        if (score.candidate.bags, bool(score.candidate.since)) == (champion.bags, bool(champion.since)):
            best.setdefault(score.candidate.effect.id, score)
    least = LEADING * best[champion.effect.id].explained if champion.effect.id in best else 0.0
    found = []
    for name in sorted({*rivals(champion.effect)} - {trial.candidate.effect.id for trial in seen.trials}):
        own = best.get(name)
        if own is None or own.explained < least:
            continue
        effects = [*earlier, (replace(shaped(own.candidate), since=champion.since), own.values)]
        tried = fit(problem, weight, effects, leads.fit.x, linearisations=12, tolerance=TRIAL_TOLERANCE)
        found.append(refine(problem, weight, Trial(own, tried, tried.cost)))
    return found


def _one_of_each(trials: Sequence[Trial], before: float) -> list[Trial]:
    """Of what worlds claim of different recordings the simpler, unless the other takes clearly more of the energy ``before``."""
    chosen: dict[tuple[str, ...], Trial] = {}
    for trial in sorted(trials, key=lambda each: (each.candidate.bags is not None, each.cost)):
        simpler = chosen.setdefault(trial.candidate.claim, trial)
        if trial.cost < simpler.cost - PARTIAL * (before - trial.cost):
            chosen[trial.candidate.claim] = trial
    return list(chosen.values())


def choose(scores: Sequence[Score]) -> list[Score]:
    """Shortlist: the best variant of each effect, at places of either kind, that is significant across the catalogue."""
    best: dict[tuple[str, ...], Score] = {}
    for score in sorted(scores, key=lambda score: -score.explained):
        best.setdefault((score.candidate.effect.id, *score.candidate.claim[1:]), score)
    if not best:
        return []
    adjusted = stats.false_discovery_control([score.p_value for score in best.values()], method="by")
    significant = [
        score for score, p in zip(best.values(), adjusted, strict=True)
        if p < FALSE_DISCOVERY_RATE and score.explained > SHORT * next(iter(best.values())).explained
    ]  # fmt: skip
    return significant[:SHORTLIST]
