# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Naming: refit what the screen suggests inside the simulator, build up effects one at a time, keep rivals that cannot be told apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from lugre_steering.diagnosis import flexible, onset
from lugre_steering.diagnosis.fingerprint import Score, screen
from lugre_steering.diagnosis.fit import Fit, fit
from lugre_steering.diagnosis.foreign import Pattern, strongest
from lugre_steering.diagnosis.noise import Noise
from lugre_steering.diagnosis.problem import Candidate, Problem, Values
from lugre_steering.diagnosis.split import Split
from lugre_steering.recording import Array

MAX_EFFECTS, MAX_ROUNDS = 3, 8
SHORTLIST, PROMISING, CLOSE = 7, (3, 5), 0.1
"""Effects fitted, how many of them with care at least and at most, and the share of the gain within which they deserve it."""
FALSE_DISCOVERY_RATE = 0.01
OWN_ERROR = 0.05
"""Energy, in noise variances per sample, that simulation and smoothing may leave with nothing hidden (measured on nulls)."""
WHOLE = (0.75, 0.09, 0.93)
"""Share of the excess that named physics must explain together, else it is unlisted: at an excess of one noise variance, per
decade above, and at most. Strong signals show more of their shape, so a right name must leave less."""
LAST = 0.5
"""Share of what was left that the last accepted effect must explain."""
SLIGHT, SURE = 0.02, 0.3
"""Share of the whole excess that a further effect must explain (no law of the first is truer than that), unless its energy
is so large against the noise."""
FREER = 0.7
"""Share of a further effect's gain that a freer shape of an earlier one may have at most."""
RETIMED = 2
"""Rounds of timing a late effect."""
PARTIAL = 0.1
"""Share by which an effect in one bag only, or from a time on, must explain more than the same everywhere."""
VARIANT, VARIANTS = 0.5, 2
"""Share of the best shape's screened energy, and number, of further shapes from which a promising effect is fitted."""
PATTERN_EXCESS, PATTERN_MARGIN = 0.1, 0.1
"""Excess from which patterns outside the catalogue compete with names, and share of their gain that counts as a difference."""
MEMORY = 4.0
"""Samples that count as one, roughly: errors have a memory."""
TRIAL_TOLERANCE = 1e-4
SURE_SIGMA = 4.0
"""Standard deviations that keep an optional part of a law, or as much for each of several that only matter together."""
TIE_T = 2.5
TIE_MISFIT, TIE_ENERGY = 0.5, 0.02
"""A tied rival may leave more than the best by so much of what the best itself leaves, and of the noise energy."""
LAW = 0.01
"""Share of what an effect explains that tells of the form of its law only: nature is not truer to any."""


@dataclass(frozen=True)
class Trial:
    """A screened candidate after its joint fit."""

    score: Score
    fit: Fit
    cost: float
    deep: bool = False
    """Whether it was fitted from several starts and refined."""

    @property
    def candidate(self) -> Candidate:
        return self.fit.effects[-1][0]


@dataclass(frozen=True)
class Found:
    """An accepted effect: its screen score, its rivals that fit as well, and the cost before it."""

    score: Score
    rivals: tuple[str, ...]
    trials: tuple[Trial, ...]
    gain: float
    """Energy it took away when it was added, in noise variances."""


@dataclass(frozen=True)
class Search:
    """What the search came to. ``evidence`` lists every trial of the first round for the report."""

    baseline: Fit
    final: Fit
    found: tuple[Found, ...]
    excess: float
    explained: float
    listed: bool
    first_scores: tuple[Score, ...]
    trials: tuple[Trial, ...]
    pattern: Pattern | None
    """The strongest pattern that no entry makes, unless what names explain was hardly there."""


def cost(problem: Problem, result: Fit, weight: Array) -> float:
    """Weighted sum of squared errors over the samples with weight, in noise variances."""
    return float(np.sum(((problem.measured - result.prediction) * weight) ** 2))


def search(
    problem: Problem, noise: Noise, split: Split, baseline: Fit, progress: Callable[[str], None] = lambda _: None
) -> Search:
    """Add effects while they are significant, larger than our own error, and explain what is left."""
    weight = np.where(split.fit, 1.0 / noise.sigma, 0.0)
    samples = float(split.fit.sum())
    start_cost = cost(problem, baseline, weight)
    excess = start_cost - samples
    steps: list[tuple[Fit, Found, float]] = []
    current, restarts = baseline, 0
    first_scores: tuple[Score, ...] = ()
    all_trials: list[Trial] = []
    for _ in range(MAX_ROUNDS):
        if len(steps) == MAX_EFFECTS:
            break
        progress("fingerprints")
        taken = [candidate.effect.id for candidate, _ in current.effects]
        scores = screen(problem, current, weight, noise.draws, taken)
        if steps:
            scores = _always(scores)
        else:
            first_scores = tuple(scores)
        trials = _tried(problem, weight, current, scores, samples, progress)
        if not trials:
            break
        best, before = trials[0], cost(problem, current, weight)
        # A trial may have led the calibration out of a local minimum: then the gain is not the effect's, so look again.
        again = fit(problem, weight, current.effects, best.fit.x, linearisations=12)
        regained = before - cost(problem, again, weight)
        if regained > max(FREER * (before - best.cost), OWN_ERROR * samples) and restarts < MAX_EFFECTS:
            current, restarts = again, restarts + 1
            if steps:
                _, last, gained = steps[-1]
                steps[-1] = (again, replace(last, gain=last.gain + regained), gained)
            else:
                baseline, start_cost = again, before - regained
                excess = start_cost - samples
            continue
        all_trials += trials
        if before - best.cost < (_slight(start_cost, samples) if steps else OWN_ERROR * samples):
            break
        freer = max((flexible.explained(problem, current, weight, i) for i in range(len(current.effects))), default=0.0)
        if freer > FREER * (before - best.cost):
            break
        rivals = tied(problem, weight, split, best, trials[1:], before, samples)
        best, rivals = simplest(best, rivals, before)
        gained = (before - best.cost) / max(before - samples, before - best.cost)
        names = tuple(dict.fromkeys(rival.candidate.effect.id for rival in rivals))[:6]
        steps.append((best.fit, Found(best.score, names, tuple(trials), before - best.cost), gained))
        current = best.fit
        steps, current = _prune(steps, problem, weight, samples, start_cost, current)
        if best.cost - samples < OWN_ERROR * samples:
            break
    kept = _keep(steps, problem, weight, start_cost, samples, OWN_ERROR + noise.slow_doubt)
    final, found = _confirmed(problem, noise, weight, split, baseline, steps[:kept], samples, progress)
    # What rings on at standstill passes for noise, so a pattern may be there though nothing seems left over.
    pattern = strongest(problem, baseline, weight) if not found or excess > PATTERN_EXCESS * samples else None
    if pattern is not None and found:
        named = [cost(problem, steps[0][0], weight), cost(problem, final, weight)][-len(found) :]
        if _foreign(pattern.cost(problem, weight), named, start_cost):
            final, found = baseline, []
    explained = (start_cost - cost(problem, final, weight)) / max(excess, 1e-9)
    return Search(
        baseline, final, tuple(found), excess / samples, float(np.clip(explained, 0.0, 1.0)), bool(found) or not steps,
        first_scores, tuple(all_trials), pattern,
    )  # fmt: skip


def _tried(
    problem: Problem, weight: Array, current: Fit, scores: Sequence[Score], samples: float, progress: Callable[[str], None]
) -> list[Trial]:
    """One round: the shortlist fitted, what leads it also from an instant on and then with care; best first."""
    before = cost(problem, current, weight)
    trials = []
    for score in choose(scores, samples):
        progress(f"fitting {score.candidate.label}")
        trials.append(_everywhere(problem, weight, current, try_effect(problem, weight, current, score), scores))
    trials = _ranked(trials, before)
    trials[: PROMISING[0]] = [_late(problem, weight, current, trial, scores) for trial in trials[: PROMISING[0]]]
    trials = _ranked(trials, before)
    if trials and _timed(trials[0]):
        trials = _ranked([_late(problem, weight, current, trial, scores) for trial in trials], before)
    close = sum(trial.cost < trials[0].cost + CLOSE * (before - trials[0].cost) for trial in trials)
    promising = int(np.clip(close, *PROMISING))
    trials[:promising] = [deepen(problem, weight, current, trial, scores) for trial in trials[:promising]]
    return _ranked(trials, before)


def _confirmed(
    problem: Problem, noise: Noise, weight: Array, split: Split, baseline: Fit, steps: Sequence[tuple[Fit, Found, float]],
    samples: float, progress: Callable[[str], None],
) -> tuple[Fit, list[Found]]:
    """The steps that stand, each effect held against its rivals in the final model."""
    final, found = steps[-1][0] if steps else baseline, [item for _, item, _ in steps]
    for index in range(len(found)):
        progress(f"rivals of {found[index].score.candidate.label}")
        final, found[index] = _confront(problem, noise, weight, split, final, index, found[index], samples)
    return final, found


def _foreign(with_pattern: float, named: Sequence[float], start: float) -> bool:
    """Whether one pattern outside the catalogue explains the recording better than a name, or as well as several.

    ``named``: cost with the only name, or with the first of several and with all of them.
    """
    margin = PATTERN_MARGIN * (start - named[-1])
    if len(named) == 1:
        return with_pattern < named[0] - margin
    return with_pattern < min(named[0], named[-1] + margin)


def _confront(
    problem: Problem, noise: Noise, weight: Array, split: Split, final: Fit, index: int, item: Found, samples: float
) -> tuple[Fit, Found]:
    """One accepted effect against its known and met rivals, everything else of the final model in place."""
    own, values = final.effects[index]
    rest = [effect for i, effect in enumerate(final.effects) if i != index]
    without = fit(problem, weight, rest, final.x, linearisations=6)
    scores = screen(problem, without, weight, noise.draws, [candidate.effect.id for candidate, _ in rest])
    scores = _always(scores) if index else scores
    leading = [score.candidate.effect.id for score in scores[:3]]
    names = {*own.effect.rivals, *item.rivals, *leading} - {own.effect.id}
    best: dict[str, Score] = {}
    for score in scores:
        best.setdefault(score.candidate.effect.id, score)
    before = cost(problem, without, weight)
    # The effect under question stands last, where trials keep theirs.
    ordered = replace(final, effects=(*rest, (own, values)))
    seen = best.get(own.effect.id)
    champion = Trial(seen if seen is not None and seen.explained > 0.0 else item.score, ordered, cost(problem, final, weight))

    def fitted(score: Score) -> Trial:
        trial = _everywhere(problem, weight, without, try_effect(problem, weight, without, score), scores)
        return deepen(problem, weight, without, trial, scores)

    # Where nothing stands beside it, these have been fitted as deeply before.
    known = {trial.candidate.effect.id: trial for trial in item.trials if trial.deep and len(trial.fit.effects) == 1}
    trials = [
        known[name]
        if name in known and not rest
        else fitted(best[name])
        for name in sorted(names)
        if name in best and best[name].explained > 0.3 * champion.score.explained
    ]
    group = _ranked([champion, *trials], before)
    rivals = tied(problem, weight, split, group[0], group[1:], before, samples)
    chosen, rivals = simplest(group[0], rivals, before)
    names_left = tuple(dict.fromkeys(rival.candidate.effect.id for rival in rivals))[:6]
    effects = list(chosen.fit.effects)
    effects.insert(index, effects.pop())
    found = Found(chosen.score, names_left, (*item.trials, *trials), before - chosen.cost)
    if chosen is champion:
        return final, found
    return fit(problem, weight, effects, chosen.fit.x, tolerance=TRIAL_TOLERANCE), found


def _prune(
    steps: list[tuple[Fit, Found, float]], problem: Problem, weight: Array, samples: float, start: float, current: Fit
) -> tuple[list[tuple[Fit, Found, float]], Fit]:
    """Drop earlier effects that the latest one has made superfluous: they had only filled in for its shape."""
    for index in range(len(steps) - 2, -1, -1):
        rest = [effect for i, effect in enumerate(current.effects) if i != index]
        without = fit(problem, weight, rest, current.x, linearisations=20, tolerance=1e-5)
        after = cost(problem, current, weight)
        if cost(problem, without, weight) - after < _slight(start, samples):
            dropped = steps[index][1]
            current = without
            last = steps[-1][1]
            # Together they explained what the latest now explains alone, so the energy is its own.
            steps = [
                *steps[:index],
                *steps[index + 1 : -1],
                (without, replace(last, gain=last.gain + dropped.gain), steps[-1][2]),
            ]
    return steps, current


def _slight(start: float, samples: float) -> float:
    """Energy below which an effect beside others is not believed."""
    return max(OWN_ERROR * samples, min(SLIGHT * (start - samples), SURE * samples))


def _keep(
    steps: Sequence[tuple[Fit, Found, float]], problem: Problem, weight: Array, start: float, samples: float, doubt: float
) -> int:
    """How many steps of the build-up stand: the fewest that explain the whole, unless the next explains most of the rest.

    ``doubt``: energy per sample, in noise variances, that may be left over with nothing hidden.
    """
    kept = 0
    excess = max((start - samples) / samples, 1.0)
    needed = min(WHOLE[0] + WHOLE[1] * float(np.log10(excess)), WHOLE[2])
    for i, (result, _, gained) in enumerate(steps):
        after = cost(problem, result, weight)
        whole = (start - after) / max(start - samples * (1.0 + doubt), start - after, 1e-9)
        if whole >= needed and gained >= LAST:
            kept = i + 1
    return kept


def choose(scores: Sequence[Score], samples: float) -> list[Score]:
    """Shortlist: the best variant of each effect and line that is significant across the catalogue and not negligible."""
    best: dict[str, Score] = {}
    for score in sorted(scores, key=lambda score: -score.explained):
        best.setdefault(score.candidate.label, score)
    if not best:
        return []
    labels = list(best)
    adjusted = stats.false_discovery_control([best[label].p_value for label in labels], method="by")
    significant = [
        best[label] for label, p in zip(labels, adjusted, strict=True)
        if p < FALSE_DISCOVERY_RATE and best[label].explained > 0.5 * OWN_ERROR * samples
    ]  # fmt: skip
    significant.sort(key=lambda score: -score.explained)
    per_effect: dict[str, int] = {}
    chosen = []
    for score in significant:
        name = score.candidate.effect.id
        if per_effect.get(name, 0) < 1:
            chosen.append(score)
            per_effect[name] = per_effect.get(name, 0) + 1
    return [score for score in chosen if score.explained > 0.08 * chosen[0].explained][:SHORTLIST]


def try_effect(problem: Problem, weight: Array, current: Fit, score: Score) -> Trial:
    """Joint fit of calibration, earlier effects and this candidate; again from the sheet if the calibration is cornered."""
    trial = _fitted(problem, weight, current, score, current.x)
    if not _cornered(problem, current):
        return trial
    # Recalibration was bent to imitate what is missing; from there the way back may be closed.
    return min([trial, _fitted(problem, weight, current, score, problem.start())], key=lambda each: each.cost)


def _fitted(problem: Problem, weight: Array, current: Fit, score: Score, start: Array) -> Trial:
    """One joint fit of nuisances (from ``start``), earlier effects and the candidate, its shapes set free as well."""
    candidate = score.candidate
    shapes = dict(candidate.shapes)
    free = tuple(
        p.name for p in candidate.effect.parameters if p.name in candidate.free or (p.name in shapes and not p.optional)
    )
    effects = [*current.effects, (replace(candidate, free=free), score.values)]
    result = fit(problem, weight, effects, start, linearisations=8, tolerance=TRIAL_TOLERANCE)
    return Trial(score, result, cost(problem, result, weight))


def _everywhere(problem: Problem, weight: Array, current: Fit, trial: Trial, scores: Sequence[Score]) -> Trial:
    """A trial of an effect in one bag only, or from a time on, against the same everywhere, which is the simpler claim."""
    if not _partial(trial.score):
        return trial
    whole = next((s for s in scores if s.candidate.label == trial.score.candidate.label and not _partial(s)), None)
    if whole is None or whole.explained <= 0.0:
        return trial
    simpler = try_effect(problem, weight, current, whole)
    gain = cost(problem, current, weight) - trial.cost
    return simpler if simpler.cost < trial.cost + PARTIAL * gain else trial


def _partial(score: Score) -> bool:
    return score.candidate.bags is not None or bool(score.candidate.since)


def _cornered(problem: Problem, current: Fit) -> bool:
    """Whether a calibration value lies implausibly far from the sheet."""
    prior = np.array([calibration.prior for calibration in problem.calibrations])
    return bool(np.any(np.abs(current.x[: prior.size]) > 2.0 * prior))


def deepen(problem: Problem, weight: Array, current: Fit, trial: Trial, scores: Sequence[Score]) -> Trial:
    """A promising trial also from its next best shapes, and at its typical size from the sheet; then refined.

    Valleys are narrow, and a linear guess far from the truth may lie beyond the next hill.
    """
    tried = trial.score.candidate
    variants = [
        score for score in scores
        if (c := score.candidate).label == tried.label and (c.bags, c.since) == (tried.bags, tried.since)
        and c.shapes != tried.shapes and score.explained > VARIANT * trial.score.explained
    ]  # fmt: skip
    others = [_fitted(problem, weight, current, score, trial.fit.x) for score in variants[:VARIANTS]]
    typical = replace(trial.score, coefficients=tuple(float(np.sign(c)) for c in trial.score.coefficients))
    others.append(_fitted(problem, weight, current, typical, problem.start()))
    best = min([trial, *others], key=lambda each: each.cost)
    for _ in range(RETIMED if tried.since else 0):
        best = retime(problem, weight, best)
    return replace(refine(problem, weight, best), deep=True)


def retime(problem: Problem, weight: Array, trial: Trial) -> Trial:
    """A late effect from the instants that fit best, one per bag, with its values fitted anew."""
    *earlier, (candidate, values) = trial.fit.effects
    since = onset.timed(problem, weight, trial.fit, len(earlier))
    effects = [*earlier, (replace(candidate, since=since), values)]
    result = fit(problem, weight, effects, trial.fit.x, linearisations=8, tolerance=TRIAL_TOLERANCE)
    better = cost(problem, result, weight)
    return Trial(trial.score, result, better) if better < trial.cost else trial


def _late(problem: Problem, weight: Array, current: Fit, trial: Trial, scores: Sequence[Score]) -> Trial:
    """A trial of an effect that is always there against the same from an instant on, which must explain clearly more."""
    tried = trial.score.candidate
    late = next((s for s in scores if (c := s.candidate).label == tried.label and c.bags is None and c.since), None)
    if late is None or late.explained <= 0.0 or _partial(trial.score):
        return trial
    begun = retime(problem, weight, try_effect(problem, weight, current, late))
    gain = cost(problem, current, weight) - begun.cost
    return begun if begun.cost < trial.cost - PARTIAL * gain else trial


def _always(scores: Sequence[Score]) -> list[Score]:
    """Without late variants, for a second effect: a wrong shape of the first shows at some events, which those fit like a glove."""
    return [score for score in scores if not score.candidate.since]


def _rank(trial: Trial, before: float) -> float:
    """Cost by which trials compete: an onset is a freedom that fits many an event, so a late effect must explain clearly more."""
    return trial.cost + PARTIAL * max(before - trial.cost, 0.0) * bool(trial.candidate.since)


def _ranked(trials: Sequence[Trial], before: float) -> list[Trial]:
    """Best first."""
    return sorted(trials, key=lambda trial: _rank(trial, before))


def _timed(trial: Trial) -> bool:
    """Whether what a trial found begins or ends within the recordings."""
    return bool(trial.candidate.since) or any(trial.fit.effects[-1][1].get(edge) for edge in ("time_start", "time_end"))


def refine(problem: Problem, weight: Array, trial: Trial) -> Trial:
    """Let the effect have the optional parts of its family; those that do not earn their place go again."""
    *earlier, (candidate, values) = trial.fit.effects
    kept = [p.name for p in candidate.effect.parameters if p.optional and p.name not in candidate.free]
    start = {**{name: 0.2 * candidate.parameter(name).scale for name in kept}, **values}
    richer = replace(candidate, free=(*candidate.free, *kept))
    result = fit(problem, weight, [*earlier, (richer, start)], trial.fit.x, linearisations=20, tolerance=1e-5)
    left = cost(problem, result, weight)
    # What the model leaves over makes its numbers less sure than noise alone would.
    misfit = max(left / max(float(np.count_nonzero(weight)), 1.0), 1.0)
    while weak := _weak(result, values, kept, misfit):
        # Two that do the same work are both weak, yet not both superfluous.
        for dropped in (weak, weak[:1]) if len(weak) > 1 else (weak,):
            leaner = _without(problem, weight, result, values, dropped)
            after = cost(problem, leaner, weight)
            if after < left + SURE_SIGMA**2 * MEMORY * misfit * len(dropped):
                break
        else:
            break
        result, left, kept = leaner, after, [name for name in kept if name not in dropped]
    return Trial(trial.score, result, left) if left < trial.cost else trial


def _weak(result: Fit, values: Values, optional: Sequence[str], misfit: float) -> list[str]:
    """Parameters of the last effect that left their value in ``values`` by less than some standard deviations, weakest first."""
    if not optional:
        return []
    deviation = np.sqrt(np.maximum(np.diag(result.covariance), 0.0) * misfit * MEMORY)[-len(optional) :]
    fitted = result.effects[-1][1]
    moved = {n: abs(fitted[n] - values.get(n, 0.0)) / max(float(sd), 1e-300) for n, sd in zip(optional, deviation, strict=True)}
    return sorted((name for name in optional if moved[name] < SURE_SIGMA), key=moved.__getitem__)


def _without(problem: Problem, weight: Array, result: Fit, values: Values, dropped: Sequence[str]) -> Fit:
    """The fit with parameters of its last effect back at their value in ``values``, or gone."""
    *earlier, (candidate, fitted) = result.effects
    leaner = replace(candidate, free=tuple(name for name in candidate.free if name not in dropped))
    start = {**values, **{name: value for name, value in fitted.items() if name not in dropped}}
    return fit(problem, weight, [*earlier, (leaner, start)], result.x, linearisations=8)


def tied(
    problem: Problem, weight: Array, split: Split, best: Trial, others: Sequence[Trial], before: float, samples: float,
    law: float = LAW,
) -> list[Trial]:
    """Rivals that this data cannot tell from the best.

    Either no clear difference block by block (Vuong 1989), or one smaller than a tenth of what even the best leaves over and the
    share ``law`` of what it explains.
    """
    found = []
    error = ((problem.measured - best.fit.prediction) * weight) ** 2
    misfit = max(best.cost - samples, 0.0)
    for other in others:
        if other.candidate.label == best.candidate.label or before - other.cost < 0.5 * (before - best.cost):
            continue
        difference = np.bincount(split.cluster, ((problem.measured - other.fit.prediction) * weight) ** 2 - error)
        t = difference.sum() / max(np.sqrt(np.sum(difference**2)), 1e-9)
        close = other.cost - best.cost < TIE_MISFIT * misfit + TIE_ENERGY * samples
        if (close and t < TIE_T) or other.cost - best.cost < 0.1 * misfit + law * (before - best.cost) + 10.0:
            found.append(other)
    return found


def simplest(best: Trial, rivals: list[Trial], before: float) -> tuple[Trial, list[Trial]]:
    """Of effects that fit equally well the one with the fewest free parameters stands for the group."""
    group = [best, *rivals]
    chosen = min(group, key=lambda trial: _rank(trial, before) + 10.0 * len(trial.candidate.free))
    return chosen, [trial for trial in group if trial is not chosen]
