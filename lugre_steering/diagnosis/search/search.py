# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Naming: propose candidates, compare the best one with the model without it, and stop where it takes too little.

Everything is compared beside the freedoms of the friction law and of the names that stand (``compare``), so that a name
neither makes up for their form nor is made up for by it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lugre_steering.diagnosis.search import flexible
from lugre_steering.diagnosis.search.compare import (
    ALIKE,
    SIZES,
    SURE,
    TIE,
    as_far_as_it_may,
    clearest,
    left,
    may_differ,
    needed,
    settled,
    simplest,
    tied,
    ties,
    worlds,
)
from lugre_steering.diagnosis.search.locate import contribution
from lugre_steering.diagnosis.search.propose import Proposal, closer, in_its_place, proposed
from lugre_steering.diagnosis.search.surely import SURE_OF_SIZE, idle, in_deviations, least_sure_part, maybe_idle
from lugre_steering.effects.entry import Effect
from lugre_steering.fitting import rig
from lugre_steering.fitting.clocks import still_apart
from lugre_steering.fitting.doubt import doubt, doubt_of
from lugre_steering.fitting.fingerprint import Score, screen
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import TYPICAL, Candidate, Effects, Problem, is_rig
from lugre_steering.fitting.sensors import fitted_with_sensors
from lugre_steering.fitting.split import Split
from lugre_steering.fitting.trial import PARTIAL, TRIAL_TOLERANCE, Round, Trial, ranked, refine, without_part
from lugre_steering.recording import Array

MAX_EFFECTS, MOST_RIVALS, FINGERPRINTS = 3, 6, 3
"""Most names, most rivals told of one, and how many of the best fingerprints are tried in place of what every joint has."""
EXCHANGES = 3
"""How often, on the average, each name is looked for anew at most."""
HOPELESS = 0.3
"""Share of the energy needed below which no closer look is taken."""
REST = 0.05
"""Share of what the freedoms take that a name without them may leave and be the simpler of two that explain the same."""
BY_NOISE = 0.95
"""Quantile of the doubts of noise draws up to which what names leave is no more in doubt than noise."""
BENT = 0.3
"""By how much of its own torque the law of a name may bend at any place, at most."""


@dataclass(frozen=True)
class Found:
    """An accepted effect: its screen score, its rivals that fit as well, the trials of its round and the energy [noise variances] it took.

    ``given``: it is what every joint may have, and was not looked for. ``in_place``: small changes of the friction law's form would
    explain as much, all of them together.
    """

    score: Score
    rivals: tuple[str, ...]
    trials: tuple[Trial, ...]
    gain: float
    given: bool = False
    in_place: bool = False


@dataclass(frozen=True)
class Search:
    """What the search came to: fits without and with what was found; scores of the first round and every trial, for the report.

    ``instead``: names of which each alone explains as much as the friction law's freedoms, where these stand and no name does.
    """

    baseline: Fit
    final: Fit
    found: tuple[Found, ...]
    first_scores: tuple[Score, ...]
    trials: tuple[Trial, ...]
    instead: tuple[Trial, ...] = ()


def search(
    problem: Problem, noise: Noise, split: Split, baseline: Fit, progress: Callable[[str], None] = lambda _: None
) -> tuple[Problem, Search]:
    """Add names one at a time while the best of those proposed takes more than the doubts; with the problem that this led to."""
    weight = np.where(split.fit, 1.0 / noise.sigma, 0.0)
    found, current = _given(problem, noise, weight, baseline, progress)
    now, current = settled(problem, weight, current)
    found = [_told(item, _rivals(now, noise, weight, split, current, item, i)) for i, item in enumerate(found)]
    problem, baseline = (now, current) if not found else settled(problem, weight, baseline)
    given, first, tried, instead_of_form = len(found), tuple[Score, ...](), list[Trial](), tuple[Trial, ...]()
    sure, waiting = (found, now, current), False
    while len(found) < given + MAX_EFFECTS:
        progress("fingerprints")
        further = len(found) > given
        seen = [_round(world, noise, weight, current, further, progress) for world in ([now] if further else worlds(now))]
        first, tried = first or seen[0].scores, tried + [trial for own in seen for trial in own.trials]
        instead_of_form = instead_of_form if further else _as_well_as_form(seen, weight, split)
        step = _step(seen, current, found[given:], weight, split, progress)
        if step is None or (step.short and len(found) + 1 == given + MAX_EFFECTS):
            break
        there, both = step.problem, [*found, step.name]
        if step.instead is not None:
            problem, baseline = step.instead.problem, step.instead.current
        plain = problem.doubted(there.doubt, there.typical)
        there, found, current = (there, both, step.fit) if step.short else _pruned(plain, there, weight, both, step.fit)
        if len(found) == len(both) > given + 1:
            latest = found[-1]
            there, found, current = _exchanged(there, noise, weight, split, found, current, given, progress)
            if found[-1] is not latest and not step.short:
                plain = problem.doubted(there.doubt, there.typical)
                there, found, current = _pruned(plain, there, weight, found, current)
        if len(found) < len(both):
            found[-1] = _told(found[-1], _rivals(there, noise, weight, split, current, found[-1], len(found) - 1))
        now, current = _freed(plain, there, weight, current, given)
        if waiting and len(found) < len(both):
            break
        waiting = step.short  # what another one keeps in doubt may stand beside that one
        if not waiting:
            sure = found, now, current
    if (instead := _in_place(problem, noise, weight, split, sure, progress)) is not None:
        problem, baseline, sure = instead
    found, now, current = sure
    if found and is_rig(problem.vehicle):
        if len(found) > given:
            found, current = _given_beside(now, noise, weight, split, current, found)
            now, current = settled(now, weight, current)
            sure_ones, fitted = _of_sure_size(now, weight, split, current, found)
            if len(sure_ones) < len(found):
                found, current = _given_beside(now, noise, weight, split, fitted, sure_ones)
                now, current = settled(now, weight, current)
        found, current = _of_sure_size(now, weight, split, current, found, given=True)
        given = sum(item.given for item in found)
    now, current, found = _without_those_of_sensors(problem, now, weight, current, found)
    for i, item in enumerate(found[:-1]):  # with everything named there is less in doubt
        if item.rivals:
            bare, fitted = _without_own_bends(problem, now, weight, current, range(given, len(found)), i)
            found[i] = _told(item, _rivals(bare, noise, weight, split, fitted, item, i))
    if not any(item.in_place for item in found):
        problem, baseline = settled(problem, weight, baseline, now.doubt)
    more = np.zeros(now.nuisances - baseline.x.size)
    instead_of_form = () if len(found) > given else instead_of_form
    return now, Search(replace(baseline, x=np.append(baseline.x, more)), current, tuple(found), first, tuple(tried), instead_of_form)


def _exchanged(
    problem: Problem, noise: Noise, weight: Array, split: Split, found: Sequence[Found], current: Fit, given: int,
    progress: Callable[[str], None],
) -> tuple[Problem, list[Found], Fit]:
    """Each name anew beside all others, the latest first, until none would be another: the first was chosen when nothing was known of the
    others, and may stand for a part of what they are."""
    found = list(found)
    waiting, turns = list(reversed(found[given:])), EXCHANGES * (len(found) - given)
    while waiting and turns:
        old, turns = waiting.pop(0), turns - 1
        rest = [effect for effect, item in zip(current.effects, found, strict=True) if item is not old]
        own = _round(problem, noise, weight, replace(current, effects=tuple(rest)), True, progress)
        if own.trials and own.before - own.trials[0].cost > (1.0 + PARTIAL) * (own.before - current.cost):
            there, fitted, name = _closest([problem], weight, split, [own], own.current)
            if not as_far_as_it_may(fitted, 1):
                problem, current = there, fitted
                waiting = [item for item in reversed(found[given:]) if item is not old]
                found = [*(item for item in found if item is not old), name]
    return problem, found, current


class _Step(NamedTuple):
    """A name that may come next, in its problem and fit; whether it is ``short`` of what it needs, or goes as far as it may; and the
    round without freedoms if it stands there ``instead`` of them."""

    problem: Problem
    fit: Fit
    name: Found
    short: bool
    instead: Proposal | None = None


def _step(
    seen: Sequence[Proposal], current: Fit, names: Sequence[Found], weight: Array, split: Split, progress: Callable[[str], None]
) -> _Step | None:
    """The best of what is proposed beside ``current``, unless it takes far too little; ``names``: those that stand there."""
    there, best = clearest(weight, seen)
    older, gains = len(current.effects), [item.gain for item in names]
    instead = None if names else _in_place_of_form(seen, weight)
    named = bool(best.effects[older:])
    step = None
    stands = may_differ(there, best, older, gains)
    if named and _taken(there, weight, current, best) >= HOPELESS * needed(there, best, weight, stands):
        progress(f"a closer look at {best.effects[-1][0].label}")
        there, best, one = _closest([there] if names else worlds(there), weight, split, seen, current)
        whole = _everywhere(there, weight, best, names)
        one = replace(one, gain=one.gain + best.cost - whole.cost)
        short = one.gain < needed(there, whole, weight, may_differ(there, whole, older, gains)) or as_far_as_it_may(whole, len(names) + 1)
        step = _Step(there, whole, one, short)
    if instead is not None and (step is None or step.short):
        step = _Step(*_simplest(instead, weight, split), short=False, instead=instead)
    return step


def _given(
    problem: Problem, noise: Noise, weight: Array, baseline: Fit, progress: Callable[[str], None]
) -> tuple[list[Found], Fit]:
    """What every joint or axis has and its recordings carry, with its fit; nothing of a vehicle."""
    found, current = list[Found](), baseline
    if is_rig(problem.vehicle):
        progress("inertia, viscous friction, offset and gravity")
        for result, score in rig.carried(problem, noise, weight, baseline):
            found.append(Found(score, (), (), current.cost - result.cost, given=True))
            current = result
    return found, current


def _given_beside(
    problem: Problem, noise: Noise, weight: Array, split: Split, current: Fit, found: Sequence[Found]
) -> tuple[list[Found], Fit]:
    """What every joint has anew, beside the names for which much of it may have stood; all of both, with their fit."""
    given, names = [item for item in found if item.given], [item for item in found if not item.given]
    current = rig.fitted(problem, weight, current.effects, current)
    for richer, score in rig.wanted(problem, noise, weight, current):
        given.insert(0, Found(score, (), (), current.cost - richer.cost, given=True))
        current = richer
    for index, leaner in rig.spared(problem, weight, current, len(given)):
        del given[index]
        current = leaner
    return [*(_told(item, _rivals(problem, noise, weight, split, current, item, i)) for i, item in enumerate(given)), *names], current


def _of_sure_size(
    problem: Problem, weight: Array, split: Split, current: Fit, found: Sequence[Found], *, given: bool = False
) -> tuple[list[Found], Fit]:
    """Without what may be nothing: names whose size is not sure, or whose law has acted before any recording shows it; with ``given`` also
    what every joint may have, and optional parts of that. So little is known of the friction of a single joint that they make up for it.

    What every joint may have is told with intervals from all samples, so it need only be as sure as those that are fitted allow.
    """
    kept, least_size = list(found), SURE_OF_SIZE * (float(np.sqrt(split.fit.sum() / problem.valid.sum())) if given else 1.0)
    while kept:
        sizes = [in_deviations(problem, weight, split, current, i) for i in range(len(kept))]
        whole = [max(own.values(), default=np.inf) if given or not item.given else np.inf for item, own in zip(kept, sizes, strict=True)]
        shapeless = [i for i, item in enumerate(kept) if not item.given and idle(problem, weight, split, current, i)]
        least = shapeless[-1] if shapeless else int(np.argmin(whole))
        goes = bool(shapeless) or whole[least] < least_size
        effects: Effects = current.effects
        if shapeless:
            terms = []
        elif goes:  # of two parts that do the same neither is sure, but what is left is
            terms = [least]
        else:
            terms = [i for i, item in enumerate(kept) if given and item.given]
        part = least_sure_part(problem, weight, split, current, terms)
        if part is not None:
            effects = without_part(effects, *part)
        elif goes:
            del kept[least]
            effects = [effect for i, effect in enumerate(effects) if i != least]
        else:
            return kept, current
        current = fit(problem, weight, effects, current.x)
    return kept, current


def _without_those_of_sensors(
    plain: Problem, problem: Problem, weight: Array, current: Fit, found: list[Found]
) -> tuple[Problem, Fit, list[Found]]:
    """Without names that sound sensors may be as well, with the problem of the fit; ``plain``: without bends of any name.

    What sensors do not do of such a name is in doubt again; what they do leaves the others as sure as they were.
    """
    given = sum(item.given for item in found)
    while (index := _of_sensors(problem, weight, current, found)) is not None:
        bare, without = _spared(plain, problem, weight, current, range(given, len(found)), index)
        problem, current = settled(bare, weight, without, doubt(*fitted_with_sensors(bare, weight, without), weight))
        found = [item for i, item in enumerate(found) if i != index]
    return problem, current, found


def _of_sensors(problem: Problem, weight: Array, current: Fit, found: Sequence[Found]) -> int | None:
    """Which name of a fit, if any, is the least evident of those that sound sensors may be as well, in the sizes that data sheets allow."""
    names = [i for i, item in enumerate(found) if not item.given]
    if not names:
        return None
    there, beside = fitted_with_sensors(problem, weight, current)

    def taken(index: int) -> float:
        rest = [effect for i, effect in enumerate(beside.effects) if i != index]
        return fit(there, weight, rest, beside, linearisations=6).cost - beside.cost

    takes = {i: taken(i) for i in names}
    least = min(names, key=lambda i: takes[i])
    return least if takes[least] < SURE * problem.doubt else None


def _closest(
    those: Sequence[Problem], weight: Array, split: Split, seen: Sequence[Proposal], current: Fit
) -> tuple[Problem, Fit, Found]:
    """The best of all proposed beside ``current``, after a closer look in ``those`` worlds: the simplest that ties, with its rivals."""
    seen = [closer(world, weight, seen) for world in those]
    own = closer(clearest(weight, seen)[0], weight, seen)
    best, *others = ranked([*own.trials, *in_its_place(own.problem, weight, own, own.trials[0])], own.before)
    chosen, rivals = simplest(best, tied(own.problem, weight, split, best, others, own.before), own.before, own.problem.doubt)
    there, result = settled(own.problem, weight, chosen.fit)
    return there, result, Found(chosen.score, _names(rivals), (best, *others), _taken(there, weight, current, result))


def _everywhere(problem: Problem, weight: Array, current: Fit, names: Sequence[Found]) -> Fit:
    """The fit where those of ``names``, which stand before its last one, act everywhere that alone seemed to act in one recording or
    from an instant on, to make up for it."""
    for i, item in enumerate(names, len(current.effects) - 1 - len(names)):
        candidate, values = current.effects[i]
        if candidate.bags is None and not candidate.since:
            continue
        whole = replace(candidate, bags=None, since=()), values
        effects = [whole if i == j else own for j, own in enumerate(current.effects)]
        tried = fit(problem, weight, effects, current.x, linearisations=20, tolerance=TRIAL_TOLERANCE)
        if tried.cost < current.cost + PARTIAL * item.gain:
            current = tried
    return current


def _in_place_of_form(seen: Sequence[Proposal], weight: Array) -> Proposal | None:
    """The round without freedoms, if one name does there nearly all that the freedoms do without it."""
    free, exact = seen[0], seen[-1]
    if free is exact or not exact.trials or not exact.problem.bends.shape[1]:
        return None
    best = exact.trials[0]
    if exact.before - best.cost < needed(exact.problem, best.fit, weight):
        return None
    return exact if best.cost - free.before < REST * (exact.before - free.before) else None


def _as_well_as_form(seen: Sequence[Proposal], weight: Array, split: Split) -> tuple[Trial, ...]:
    """Names, best first, of which one without the freedoms explains what these do without it: the data cannot tell it from friction of
    another form."""
    free, exact = seen[0], seen[-1]
    if free is exact or not exact.problem.bends.shape[1]:
        return ()
    believed = [trial for trial in exact.trials if exact.before - trial.cost >= needed(exact.problem, trial.fit, weight)]
    return tuple(trial for trial in believed if ties(free.problem, weight, split, free.current, trial, exact.before))


def _in_place(
    problem: Problem, noise: Noise, weight: Array, split: Split, sure: tuple[list[Found], Problem, Fit],
    progress: Callable[[str], None],
) -> tuple[Problem, Fit, tuple[list[Found], Problem, Fit]] | None:
    """Names beside those of a vehicle that stand for ``sure``, or together where none does, where all without freedoms are clearly more
    evident than the former with them, by SURE for each name where none stands, and leave no more in doubt than the former do or noise
    alone may, as they would of friction of another form, and each is needed: with problem and baseline without freedoms.
    ``problem``: without bends of names.
    """
    found, there, free = sure
    exact = problem.doubted(there.doubt, TYPICAL * SIZES[0])
    if there.typical <= exact.typical or not problem.bends.shape[1]:
        return None
    stands = may_differ(there, free, len(free.effects), [item.gain for item in found])
    now, current, best = exact, _settled_in(exact, weight, free.effects, free.x), None
    by_noise = np.quantile([doubt_of(exact, draw * weight, weight) for draw in noise.draws], BY_NOISE)
    most = max((1.0 + ALIKE) * there.doubt, float(by_noise))
    while len(found) < MAX_EFFECTS:
        own = _round(now, noise, weight, current, True, progress)
        if not own.trials or own.before - own.trials[0].cost < HOPELESS * needed(now, own.best, weight, stands):
            break
        _, current, name = _simplest(own, weight, split)
        if name.gain < needed(now, current, weight, stands):
            break
        found = [*found, name]
        now, x = _shaped(exact, now, current, range(len(found)))
        current = fit(now, weight, current.effects, x, linearisations=20, tolerance=TRIAL_TOLERANCE)
        clearly = TIE if sure[0] else SURE * len(found)
        if left(now, current) < left(there, free) - clearly * there.doubt and doubt(now, current, weight) < most:
            best = found, now, current
    if best is None:
        return None
    found, now, current = best
    least = needed(now, current, weight, stands)
    for index in range(len(found)):
        if _spared(exact, now, weight, current, range(len(found)), index)[1].cost - current.cost < least:
            return None
        if _acts_before_it_shows(now, weight, split, current, index):
            return None
    return exact, _settled_in(exact, weight, (), free.x), best


def _acts_before_it_shows(problem: Problem, weight: Array, split: Split, current: Fit, index: int) -> bool:
    """Whether the law of a name may have acted before any recording shows it: beside others it is a part of the friction's own form."""
    candidate, _ = current.effects[index]
    return any(not candidate.parameter(key).optional for key in maybe_idle(problem, weight, split, current, index))


def _settled_in(problem: Problem, weight: Array, effects: Effects, x: Array) -> Fit:
    return fit(problem, weight, effects, x[: problem.nuisances], linearisations=20, tolerance=TRIAL_TOLERANCE)


def _simplest(exact: Proposal, weight: Array, split: Split) -> tuple[Problem, Fit, Found]:
    """Of the names that do what the freedoms do the simplest that ties, without them."""
    own = closer(exact.problem, weight, [exact])
    rivals = tied(own.problem, weight, split, own.trials[0], own.trials[1:], own.before)
    chosen, rivals = simplest(own.trials[0], rivals, own.before, own.problem.doubt)
    found = Found(chosen.score, _names(rivals), tuple(own.trials), own.before - chosen.cost, in_place=True)
    return own.problem, chosen.fit, found


def _names(rivals: Sequence[Trial]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(rival.candidate.effect.id for rival in rivals))[:MOST_RIVALS]


def _taken(there: Problem, weight: Array, current: Fit, best: Fit) -> float:
    """Energy that the last name of ``best`` takes, the bends as large as the data ask for without it and with it.

    What the earlier ones have beside it may be better without it too: that is none of its own.
    """
    starts = [(current.effects, current.x), (best.effects[: len(current.effects)], best.x[: there.nuisances])]
    without = (settled(there, weight, fit(there, weight, effects, x), there.doubt) for effects, x in starts)
    return min(left(*model) for model in without) - left(there, best)


def _round(
    problem: Problem, noise: Noise, weight: Array, current: Fit, further: bool, progress: Callable[[str], None]
) -> Proposal:
    """What is proposed beside a fit."""
    current = fit(problem, weight, current.effects, current)
    scores = screen(problem, current, weight, noise.draws, [candidate.effect.id for candidate, _ in current.effects])
    if further:  # a wrong shape of the first shows at some events, which late variants fit like a glove
        scores = [score for score in scores if not score.candidate.since]
    return Proposal(problem, current, tuple(scores), proposed(problem, weight, current, scores, progress))


def _rivals(
    problem: Problem, noise: Noise, weight: Array, split: Split, current: Fit, item: Found, index: int
) -> list[Trial]:
    """Rivals that would do as well as one effect of a fit: of those it has had, or of a given one the known ones and best fingerprints."""
    own = current.effects[index]
    rest = [effect for i, effect in enumerate(current.effects) if i != index]
    without = fit(problem, weight, rest, current, linearisations=6)
    if item.given:
        trials = _beside_given(problem, noise, weight, without, own[0].effect)
    else:
        had = {trial.candidate.effect.id: trial for trial in reversed(item.trials)}
        beside = replace(current, effects=tuple(rest))  # as the champion has it: what does the same leaves it so
        trials = [_again(problem, weight, beside, had[name], own[0]) for name in sorted(item.rivals)]
    champion = Trial(item.score, replace(current, effects=(*rest, own)), current.cost)
    return tied(problem, weight, split, champion, trials, without.cost)


def _beside_given(problem: Problem, noise: Noise, weight: Array, without: Fit, given: Effect) -> list[Trial]:
    """The known rivals of a given effect and the best fingerprints, each in its place."""
    best: dict[str, Score] = {}
    for score in screen(problem, without, weight, noise.draws, [candidate.effect.id for candidate, _ in without.effects]):
        best.setdefault(score.candidate.effect.id, score)
    tried = Round(problem, weight, without, list(best.values()))
    names = {*given.rivals, *list(best)[:FINGERPRINTS]} & {*best} - {given.id}
    return [tried.try_effect(best[name]) for name in sorted(names) if best[name].explained > 0.0]


def _again(problem: Problem, weight: Array, beside: Fit, trial: Trial, champion: Candidate) -> Trial:
    """An effect with all parts that its law had when it was tried, and what others it needs now that more is known, beside what a fit has;
    one that acted in part of the recordings does so where the ``champion`` does now."""
    candidate, values = trial.fit.effects[-1]
    if candidate.bags is not None or candidate.since:
        candidate = replace(candidate, bags=champion.bags, since=champion.since)
    effects = [*beside.effects, (candidate, values)]
    fitted = fit(problem, weight, effects, beside.x, linearisations=12, tolerance=TRIAL_TOLERANCE)
    again = Trial(trial.score, fitted, fitted.cost)
    tied_already = fitted.cost < beside.cost + TIE * problem.doubt  # the cost with the champion, whose fit it was
    return again if tied_already else refine(problem, weight, again)


def _without_own_bends(
    plain: Problem, problem: Problem, weight: Array, current: Fit, names: Iterable[int], index: int
) -> tuple[Problem, Fit]:
    """The problem where one of the ``names`` has no bends of its own, as its rivals have none, and the fit there.

    ``plain``: without bends of any name.
    """
    others = [i for i in names if i != index]
    bare, x = _shaped(plain.doubted(problem.doubt, problem.typical), problem, current, others)
    return bare, fit(bare, weight, current.effects, x)


def _spared(
    plain: Problem, problem: Problem, weight: Array, current: Fit, names: Iterable[int], index: int
) -> tuple[Problem, Fit]:
    """The fit without one of the ``names`` and without its bends, with the problem of that fit; ``plain``: without bends of any name."""
    rest = [effect for i, effect in enumerate(current.effects) if i != index]
    bare, x = _shaped(plain.doubted(problem.doubt, problem.typical), problem, current, [i for i in names if i != index])
    return bare, fit(bare, weight, rest, x, linearisations=20, tolerance=TRIAL_TOLERANCE)


def _told(item: Found, rivals: Sequence[Trial]) -> Found:
    """An effect with other rivals, and how these fit."""
    return replace(item, rivals=tuple(trial.candidate.effect.id for trial in rivals), trials=(*rivals, *item.trials))


def _pruned(
    plain: Problem, problem: Problem, weight: Array, found: Sequence[Found], current: Fit
) -> tuple[Problem, list[Found], Fit]:
    """Without earlier names that the latest one has made superfluous: they had only filled in for its shape; with the problem of the fit.

    ``plain``: without any bends of names; those of a name that goes would stand in for it.
    """
    kept = list(found)
    for index in range(len(kept) - 2, -1, -1):
        if kept[index].given:
            continue
        earlier = [i for i, item in enumerate(kept[:-1]) if not item.given]
        bare, without = _spared(plain, problem, weight, current, earlier, index)
        if without.cost - current.cost < needed(problem, current, weight):
            dropped = kept.pop(index)
            # Together they explained what the latest now explains alone; what goes may too, or what tied with it.
            last, standing = kept[-1], {candidate.effect.id for candidate, _ in without.effects}
            rivals = dict.fromkeys((dropped.score.candidate.effect.id, *last.rivals, *dropped.rivals))
            told = tuple(name for name in rivals if name not in standing)[:MOST_RIVALS]
            kept[-1] = replace(last, gain=last.gain + dropped.gain, rivals=told, trials=(*last.trials, *dropped.trials))
            problem, current = bare, without
    return problem, kept, current


def _freed(plain: Problem, problem: Problem, weight: Array, current: Fit, given: int) -> tuple[Problem, Fit]:
    """The problem where the law of each name may bend too, and what it adds be late; ``plain``: without any bends of names."""
    freed, x = _shaped(plain, problem, current, range(given, len(current.effects)))
    return settled(freed, weight, fit(freed, weight, current.effects, x))


def _shaped(plain: Problem, problem: Problem, current: Fit, names: Sequence[int]) -> tuple[Problem, Array]:
    """A problem where the laws of some effects of a fit may bend too, and where its fit there begins."""
    shapes = [flexible.bends(problem, current, i) for i in names]
    columns = [BENT * shape for shape in shapes if shape.shape[1] >= flexible.FEWEST]
    if plain.bends.shape[1] and names:
        columns.append(still_apart(problem, np.sum([contribution(problem, current, i) for i in names], axis=0)))
    shaped = plain.bent(columns)
    return shaped, np.append(current.x[: plain.nuisances], np.zeros(shaped.nuisances - plain.nuisances))
