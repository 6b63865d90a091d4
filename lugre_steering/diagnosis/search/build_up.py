# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Naming: build up effects one at a time from what the screen suggests, and keep those that stand against all others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from lugre_steering.diagnosis.loudness import FORM_TAKEN, form_energy
from lugre_steering.diagnosis.search import flexible, rig
from lugre_steering.diagnosis.search.fingerprint import Score, screen
from lugre_steering.diagnosis.search.foreign import Pattern, strongest
from lugre_steering.diagnosis.search.ties import simplest, tied
from lugre_steering.diagnosis.search.trial import (
    TRIAL_TOLERANCE,
    Round,
    Trial,
    cost,
    ranked,
    timed,
)
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import Problem, is_rig
from lugre_steering.fitting.split import Split
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
MOST = 0.5
"""Share of the excess, fitted and held out, from which names stand although more is there; and of their own gain that a pattern
outside the catalogue must leave them."""
SLIGHT, SURE = 0.02, 0.3
"""Share of the whole excess that a further effect must explain (no law of the first is truer than that), unless its energy
is so large against the noise."""
FREER, BEYOND = 0.7, 0.5
"""Share of a further effect's gain that a freer shape of an earlier one (or recalibration alone, of any gain) may have at most; for a
shape, unless it leaves so much of that gain."""
AGAIN, AGAIN_EFFECTS, AGAIN_EXCESS = 2, 2, 0.3
"""How many other first effects to build up from where none stands, up to how many effects, and the excess from which."""
PATTERN_EXCESS, PATTERN_MARGIN = 0.1, 0.1
"""Excess from which patterns outside the catalogue compete with names, and share of their gain that counts as a difference."""


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


def search(
    problem: Problem, noise: Noise, split: Split, baseline: Fit, progress: Callable[[str], None] = lambda _: None,
    *, enough: float | None = None,
) -> Search:
    """Build up from the best first effect, and where that does not stand from those with the best fingerprints.

    ``enough``: only one name is of interest, which by itself leaves no more than this excess per sample, or hardly more than noise.
    """
    weight = np.where(split.fit, 1.0 / noise.sigma, 0.0)
    samples, doubt, alone = float(split.fit.sum()), OWN_ERROR + noise.slow_doubt, enough is not None
    least = 1.0 + max(1.0 + doubt, enough or 0.0)

    def standing(built: _Built) -> int:
        if alone and built.steps and cost(problem, built.steps[-1][0], weight) > least * samples:
            return len(given)
        return max(len(given), _keep(built.steps, problem, weight, cost(problem, built.baseline, weight), samples, doubt))

    given = _rig_steps(problem, noise, weight, baseline, samples, progress) if is_rig(problem.vehicle) else []
    built = _build_up(problem, noise, split, baseline, None, progress, given, most=1 if alone else MAX_EFFECTS)
    first, tried, needed, kept = built.first, built.trials, bool(built.steps), standing(built)
    builds = [built]
    for opening in _others(problem, weight, built) if needed and not kept and not alone else ():
        progress(f"building up again from {opening.trials[0].candidate.label}")
        built = _build_up(problem, noise, split, built.baseline, opening, progress)
        tried, kept = tried + built.trials, standing(built)
        builds.append(built)
        if kept:
            break
    if needed and not kept and not alone:
        kept, built = max(((_most(problem, noise, split, each), each) for each in builds), key=lambda found: found[0])
    baseline, start_cost = built.baseline, cost(problem, built.baseline, weight)
    excess = start_cost - samples
    final, found = _confirmed(problem, noise, weight, split, baseline, built.steps[:kept], samples, len(given), progress)
    while len(found) > len(given) and min(item.gain for item in found[len(given) :]) < FORM_TAKEN * form_energy(problem, final, weight):
        kept -= 1  # one that takes no more than the form of the friction law may leave
        final, found = _confirmed(problem, noise, weight, split, baseline, built.steps[:kept], samples, len(given), progress)
    # What rings on at standstill passes for noise, so a pattern may be there though nothing seems left over.
    pattern = strongest(problem, baseline, weight) if not found or excess > PATTERN_EXCESS * samples else None
    if pattern is not None and found:
        named = [cost(problem, built.steps[0][0], weight), cost(problem, final, weight)][-len(found) :]
        if _foreign(pattern.cost(problem, weight), named, start_cost) and not _beside(problem, weight, pattern, final, start_cost):
            final, found = (built.steps[len(given) - 1][0], found[: len(given)]) if given else (baseline, [])
    explained = (start_cost - cost(problem, final, weight)) / max(excess, 1e-9)
    return Search(
        baseline, final, tuple(found), excess / samples, float(np.clip(explained, 0.0, 1.0)), bool(found) or not needed,
        first.scores, tuple(tried), pattern,
    )  # fmt: skip


_Step = tuple[Fit, Found, float]
"""A fit, what was added last, and the share of what was left that this took."""


def _rig_steps(
    problem: Problem, noise: Noise, weight: Array, baseline: Fit, samples: float, progress: Callable[[str], None]
) -> list[_Step]:
    """Steps of a build-up that begins with what every joint or axis may have."""
    progress("inertia, viscous friction, offset and gravity")
    start = before = cost(problem, baseline, weight)
    steps: list[_Step] = []
    for result, score in rig.carried(problem, noise, weight, baseline, _slight(start, samples)):
        after = cost(problem, result, weight)
        steps.append((result, Found(score, (), (), before - after), (before - after) / max(before - samples, before - after)))
        before = after
    return steps


@dataclass(frozen=True)
class _First:
    """What one round of the build-up tried: the screen's scores, and the trials, best first."""

    scores: tuple[Score, ...] = ()
    trials: tuple[Trial, ...] = ()


@dataclass(frozen=True)
class _Built:
    """A build-up: the baseline it left from, its first round, its steps and every trial it took into account."""

    baseline: Fit
    first: _First
    steps: list[_Step]
    trials: list[Trial]


def _others(problem: Problem, weight: Array, built: _Built) -> list[_First]:
    """Other first effects to build up from: those with the best fingerprints, each before the trials it does not lose to.

    Of several effects a wrong one may fit best alone by its freedom, whereas a fingerprint is of the place in the motion.
    """
    samples = float(np.count_nonzero(weight))
    if cost(problem, built.baseline, weight) < (1.0 + AGAIN_EXCESS) * samples:
        return []
    scores, trials = built.first.scores, built.first.trials
    others = sorted(range(1, len(trials)), key=lambda i: -trials[i].score.explained)
    return [_First(scores, trials[i:]) for i in others[:AGAIN]]


def _build_up(
    problem: Problem, noise: Noise, split: Split, baseline: Fit, opening: _First | None, progress: Callable[[str], None],
    given: Sequence[_Step] = (), most: int = MAX_EFFECTS,
) -> _Built:
    """Add effects (``most`` of them) while they are significant, larger than our own error, and explain what is left.

    ``opening``: a first round to go on from; without it the shortlist of the screen is fitted. ``given``: steps that stand already.
    """
    weight = np.where(split.fit, 1.0 / noise.sigma, 0.0)
    samples = float(split.fit.sum())
    start_cost = cost(problem, baseline, weight)
    steps: list[_Step] = list(given)
    current, restarts = given[-1][0] if given else baseline, 0
    first, first_choice = opening or _First(), opening is None
    all_trials: list[Trial] = []
    for _ in range(MAX_ROUNDS):
        if len(steps) >= len(given) + (most if first_choice else AGAIN_EFFECTS):
            break
        if opening is not None and not steps:
            scores, trials = list(opening.scores), list(opening.trials)
        else:
            progress("fingerprints")
            taken = [candidate.effect.id for candidate, _ in current.effects]
            scores = screen(problem, current, weight, noise.draws, taken)
            scores = _always(scores) if len(steps) > len(given) else scores
            hidden = cost(problem, current, weight) - samples > FORM_TAKEN * form_energy(problem, current, weight)
            trials = _tried(problem, weight, current, scores, samples, progress) if hidden else []
        if len(steps) == len(given):
            first = _First(tuple(scores), tuple(trials))
        if not trials:
            break
        best, before = trials[0], cost(problem, current, weight)
        # A trial may have led the calibration out of a local minimum: then the gain is not the effect's, so look again.
        again = fit(problem, weight, current.effects, best.fit.x, linearisations=12)
        regained = before - cost(problem, again, weight)
        if regained > max(FREER * (before - best.cost), OWN_ERROR * samples) and restarts < MAX_EFFECTS:
            current, restarts, opening = again, restarts + 1, None
            if steps:
                _, last, gained = steps[-1]
                steps[-1] = (again, replace(last, gain=last.gain + regained), gained)
            else:
                baseline, start_cost = again, before - regained
            continue
        all_trials += trials
        least = _slight(start_cost, samples) if steps else OWN_ERROR * samples
        if before - best.cost < max(least, FORM_TAKEN * form_energy(problem, best.fit, weight)):
            break
        if any(_is_shape(problem, weight, current, best, i) for i in range(len(current.effects))):
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
    return _Built(baseline, first, steps, all_trials)


def _is_shape(problem: Problem, weight: Array, current: Fit, best: Trial, index: int) -> bool:
    """Whether a further effect only makes good the shape of an earlier one."""
    gain = cost(problem, current, weight) - best.cost
    if flexible.explained(problem, current, weight, index) <= FREER * gain:
        return False
    return flexible.beyond(problem, current, weight, index, best.fit.prediction - current.prediction) < BEYOND * gain


def _tried(
    problem: Problem, weight: Array, current: Fit, scores: Sequence[Score], samples: float, progress: Callable[[str], None]
) -> list[Trial]:
    """One round: the shortlist fitted, what leads it also from an instant on and then with care; best first."""
    before = cost(problem, current, weight)
    trials, tried = [], Round(problem, weight, current, scores)
    for score in choose(scores, samples):
        progress(f"fitting {score.candidate.label}")
        trials.append(tried.everywhere(tried.try_effect(score)))
    trials = ranked(trials, before)
    trials[: PROMISING[0]] = [tried.begun_late(trial) for trial in trials[: PROMISING[0]]]
    trials = ranked(trials, before)
    if trials and timed(trials[0]):
        trials = ranked([tried.begun_late(trial) for trial in trials], before)
    close = sum(trial.cost < trials[0].cost + CLOSE * (before - trials[0].cost) for trial in trials)
    promising = int(np.clip(close, *PROMISING))
    trials[:promising] = [tried.deepen(trial) for trial in trials[:promising]]
    return ranked(trials, before)


def _confirmed(
    problem: Problem, noise: Noise, weight: Array, split: Split, baseline: Fit, steps: Sequence[_Step],
    samples: float, given: int, progress: Callable[[str], None],
) -> tuple[Fit, list[Found]]:
    """The steps that stand, each effect held against its rivals in the final model; the first ``given`` are those of every joint."""
    final, found = steps[-1][0] if steps else baseline, [item for _, item, _ in steps]
    for index in range(len(found)):
        progress(f"rivals of {found[index].score.candidate.label}")
        final, found[index] = _confront(problem, noise, weight, split, final, index, found[index], samples, stays=index < given)
    return final, found


def _foreign(with_pattern: float, named: Sequence[float], start: float) -> bool:
    """Whether one pattern outside the catalogue explains the recording clearly better than a name (which wins a draw), and as well
    as several.

    ``named``: cost with the only name, or with the first of several and with all of them.
    """
    margin = PATTERN_MARGIN * (start - named[-1])
    if len(named) == 1:
        return with_pattern < named[0] - margin
    return with_pattern < min(named[0] - margin, named[-1] + margin)


def _confront(
    problem: Problem, noise: Noise, weight: Array, split: Split, final: Fit, index: int, item: Found, samples: float, stays: bool
) -> tuple[Fit, Found]:
    """One accepted effect against its known and met rivals, everything else of the final model in place.

    One that ``stays`` is there on every joint: its rivals are told and do not take its place.
    """
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

    tried = Round(problem, weight, without, scores)
    tried.best = champion.cost
    # Where nothing stands beside it, these have been fitted as deeply before.
    known = {trial.candidate.effect.id: trial for trial in item.trials if trial.deep and len(trial.fit.effects) == 1}
    trials = [
        known[name]
        if name in known and not rest
        else tried.deepen_near(tried.everywhere(tried.try_effect(best[name])))
        for name in sorted(names)
        if name in best and best[name].explained > 0.3 * champion.score.explained
    ]
    group = ranked([champion, *trials], before)
    rivals = tied(problem, weight, split, group[0], group[1:], before, samples)
    if stays:
        chosen, rivals = champion, [trial for trial in (group[0], *rivals) if trial is not champion]
    else:
        chosen, rivals = simplest(group[0], rivals, before)
    names_left = tuple(dict.fromkeys(rival.candidate.effect.id for rival in rivals))[:6]
    effects = list(chosen.fit.effects)
    effects.insert(index, effects.pop())
    found = Found(chosen.score, names_left, (*item.trials, *trials), before - chosen.cost)
    if chosen is champion:
        return final, found
    return fit(problem, weight, effects, chosen.fit.x, tolerance=TRIAL_TOLERANCE), found


def _prune(
    steps: list[_Step], problem: Problem, weight: Array, samples: float, start: float, current: Fit
) -> tuple[list[_Step], Fit]:
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
    steps: Sequence[_Step], problem: Problem, weight: Array, start: float, samples: float, doubt: float
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


def _most(problem: Problem, noise: Noise, split: Split, built: _Built) -> int:
    """How many steps stand though much is left: each helps where it was not fitted, and together they are most of what is there.

    A name that stands is no less true for what else there is.
    """
    kept = 0
    fitted, held = (np.where(role, 1.0 / noise.sigma, 0.0) for role in (split.fit, split.held))
    start = [cost(problem, built.baseline, weight) for weight in (fitted, held)]
    noisy = [float(split.fit.sum()), float(split.held.sum())]
    last = start[1]
    for i, (result, _, _) in enumerate(built.steps):
        left = [cost(problem, result, weight) for weight in (fitted, held)]
        if last - left[1] < max(OWN_ERROR * noisy[1], SLIGHT * (start[1] - noisy[1])):
            break
        last = left[1]
        if all(before - after > MOST * (before - n) for before, after, n in zip(start, left, noisy, strict=True)):
            kept = i + 1
    return kept


def _beside(problem: Problem, weight: Array, pattern: Pattern, named: Fit, start: float) -> bool:
    """Whether names are needed beside a pattern: with it they still take most of what they take alone."""
    both = strongest(problem, named, weight).cost(problem, weight)
    return pattern.cost(problem, weight) - both > MOST * (start - cost(problem, named, weight))


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


def _always(scores: Sequence[Score]) -> list[Score]:
    """Without late variants, for a second effect: a wrong shape of the first shows at some events, which those fit like a glove."""
    return [score for score in scores if not score.candidate.since]
