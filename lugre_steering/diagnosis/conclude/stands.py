# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What stands of what a search found: names verified on held-out data, laws beside or in place of them, or only a clock that is apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lugre_steering.diagnosis import verify
from lugre_steering.diagnosis.conclude.formed import Formed, formed, formed_beside
from lugre_steering.diagnosis.conclude.joint import Parallel, beside_laws, in_parallel, with_terms
from lugre_steering.diagnosis.conclude.late import begun_late, timed_by_all
from lugre_steering.diagnosis.conclude.left_over import LeftOver, left_over
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.laws.find import FoundLaws, find
from lugre_steering.diagnosis.laws.rival import (
    evident,
    in_place,
    in_place_of_one,
    keeps_names,
    leaves_names,
    room_for_laws,
)
from lugre_steering.diagnosis.loudness import beyond_calibration
from lugre_steering.diagnosis.result import Verdict
from lugre_steering.diagnosis.search.compare import SURE
from lugre_steering.diagnosis.search.locate import contribution
from lugre_steering.fitting.clocks import APART_S, LONGEST_S
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import Candidate, Problem
from lugre_steering.fitting.sheet import gone_too_far

SURELY = 2.0
"""Standard deviations by which a delay must be longer than those of clocks, where stamps are given on receipt."""
CONTRADICTED = 0.02
"""Growth of the held-out error that overrules a name."""
FAR_WORSE = 2.0**0.5
"""Growth of the error in one recording, from the instant of a late name on, that overrules it: twice the energy."""


class Apart(NamedTuple):
    """How late [s] the torque is stamped against the angles, the standard deviation of that, and in which recordings, if not all."""

    late_s: float
    deviation_s: float
    bags: tuple[int, ...] | None


class _Tested(NamedTuple):
    """Whether names stand, the clock that is apart if they are no more than that, how they do on held-out data, and with them the form of
    the friction law where without it they do harm."""

    named: bool
    clock: Apart | None
    judged: verify.Judged
    form: Formed | None


@dataclass(frozen=True)
class Stands:
    """What stands: names, laws beside or without them, or only a clock that is apart; ``judged`` on held-out data, ``left`` beside
    the names alone; ``form``: that of the friction law as laws, beside the names."""

    named: bool
    clock: Apart | None
    lawful: FoundLaws | None
    judged: verify.Judged
    left: LeftOver
    nearest: tuple[str, ...] = ()
    """Names in whose place laws stand."""
    form: Formed | None = None
    parallel: Parallel | None = None
    """Names and laws of a joint or axis in parallel."""

    @property
    def better(self) -> bool:
        return self.named or self.lawful is not None

    @property
    def after(self) -> float:
        """Error on held-out data [N m] with what stands."""
        return self.judged.after if self.better else self.judged.before

    @property
    def verdict(self) -> Verdict:
        if self.named:
            return "missing_physics"
        return "unlisted_physics" if self.lawful is not None or self.left.structured else "consistent"


def standing(done: Finished, seed: int, progress: Callable[[str], None]) -> tuple[Finished, Stands]:
    """What stands, and the search as it was judged: where only held-out data tell that a name began late, with that name timed by all."""
    tested = _tested(done, seed)
    if not tested.named and done.found.found and (late := timed_by_all(begun_late(done))) is not done:
        done, tested = late, _tested(late, seed)
    if not tested.named and done.of_every_joint is not done:
        done, tested = done.of_every_joint, _tested(done.of_every_joint, seed)
    done, stands = _in_parallel(*_beside_laws(done, tested, seed, progress), seed)
    if stands.lawful is not None:
        both = formed_beside(done, stands.lawful, seed)
        return done, stands if both is None else replace(stands, lawful=both[0], judged=both[0].judged, form=both[1])
    form = (tested.form if stands.named else None) or formed(timed_by_all(done) if stands.named else done, stands.named, seed)
    if form is not None and stands.named and len(acting := _acting(done, form)) < len(done.found.found):
        return standing(done.only(acting), seed, progress)
    return done, replace(stands, form=form, judged=form.judged if form is not None and stands.named else stands.judged)


def _acting(done: Finished, form: Formed) -> list[int]:
    """Which names do more than a recalibration would beside the form of the friction where that runs in the chain, not only linear as
    they were compared: one that had stood for what is not linear in it does nothing there."""
    there = done.compared
    # As much evidence as where names are compared, on samples that are more but no means.
    more = np.count_nonzero(done.fitted) / (np.count_nonzero(there.fitted) * there.problem.mean_of)
    least = SURE * there.problem.doubt * more
    parts = [contribution(form.problem, form.fitted, i) for i in range(len(done.found.found))]
    return [i for i, part in enumerate(parts) if beyond_calibration(form.problem, form.fitted, part) > least]


def without_laws(done: Finished, stands: Stands, seed: int) -> Stands:
    """The same without its laws: names as they are without them, or nothing in the place of what laws explained."""
    found = done.found
    judged = verify.verify(done.problem, done.weight, found.baseline, found.final, done.roles, seed, done.refitted)
    return replace(stands, lawful=None, judged=judged, form=None, nearest=(), parallel=None)


def _in_parallel(done: Finished, stands: Stands, seed: int) -> tuple[Finished, Stands]:
    """Laws beside the names of a joint or axis as they are in parallel; none where they are nothing there."""
    if (lawful := stands.lawful) is None or not stands.named:
        return done, stands
    if (parallel := in_parallel(replace(done, problem=lawful.problem), lawful.fit, seed)) is None:
        return done, stands
    if (beside := beside_laws(done, lawful, parallel, seed)) is None:
        return done, without_laws(done, stands, seed)
    return beside.done, replace(stands, lawful=beside.lawful, judged=beside.judged, parallel=parallel)


def _tested(done: Finished, seed: int) -> _Tested:
    """The search has already tested significance; held-out data must not contradict it, though they may hardly see the effect,
    and an improvement that may be none is none: beside the freedoms with which names are compared, as without them the form of the
    friction law may be most of the error. In a vehicle file a name must do no harm, alone or with the form of the friction as laws."""
    problem, found, there = done.problem, done.found, done.compared
    judged = verify.verify(problem, done.weight, found.baseline, found.final, done.roles, seed, done.refitted)
    beside, form = judged, None
    if found.found and done.needs_form and not any(item.in_place for item in found.found):
        beside = verify.verify(there.problem, there.weight, there.found.baseline, there.found.final, there.roles, seed)
        form = formed(timed_by_all(done), True, seed) if judged.gain <= -CONTRADICTED and beside.interval[0] > 0.0 else None
    clock = _clock(done)
    stuck = gone_too_far(done.compared.problem, done.compared.found.final.x)
    harmless = max(judged.gain, -np.inf if form is None else form.judged.gain) > -CONTRADICTED
    surely = beside.interval[0] > 0.0 or (judged.interval[0] > 0.0 and beside.interval[1] > 0.0)
    together = _of_one_vehicle([candidate for candidate, _ in found.final.effects], len(problem.runs))
    there_too = not _missed_by(problem, found.baseline, found.final)
    named = bool(found.found) and harmless and surely and clock is None and not stuck and together and there_too
    return _Tested(named, clock, judged, form)


def _missed_by(problem: Problem, baseline: Fit, final: Fit) -> bool:
    """Whether a late name makes far worse what it is said to act on in one of the recordings: then another one's event named it."""
    time = np.concatenate([run.time for run in problem.runs])
    for candidate, _ in final.effects:
        for bag, start in enumerate(candidate.since):
            after = problem.valid & (problem.bag == bag) & (time > start)
            if not candidate.active_in(bag) or not after.any():
                continue
            if verify.rmse(problem, final, after) > FAR_WORSE * verify.rmse(problem, baseline, after):
                return True
    return False


def _of_one_vehicle(names: Sequence[Candidate], bags: int) -> bool:
    """Whether every two names have a recording in common. Two things that no recording shows together make up, each in its own, for one
    that is in all: a vehicle may change between recordings, but hardly loses one peculiarity as it gets another."""
    acting = [{bag for bag in range(bags) if name.active_in(bag)} for name in names]
    return all(one & other for i, one in enumerate(acting) for other in acting[:i])


def _beside_laws(done: Finished, tested: _Tested, seed: int, progress: Callable[[str], None]) -> tuple[Finished, Stands]:
    """What remains of the names beside laws for what they leave over; where that is not loud, of laws beside the freedoms alone what is
    as evident as a name. In place of what every joint has no law is sought: with the search as it stands."""
    found, bare, (named, clock, judged, _) = done.found, done.of_every_joint, tested
    left = _left(done, named or clock is not None)
    rivals = not named or (not all(item.given for item in found.found) and room_for_laws(done))
    if not left.structured and (clock is not None or not rivals):
        return done, Stands(named, clock, None, judged, left)
    without = found.baseline if bare is done else bare.found.final
    alone = find(done, without, seed, progress, freely=not named and not left.structured) if rivals else None
    if not named:
        if alone is not None and not left.structured and not evident(done, alone):
            alone = None
        if alone is not None and (richer := _richer(done, alone, seed, progress)) is not None:
            done, alone = richer
            judged = verify.verify(alone.problem, done.weight, found.baseline, alone.fitted, done.roles, seed)
            return done, Stands(True, clock, alone, judged, _left(done, True))
        return done, Stands(False, clock, alone, judged if alone is None else alone.judged, left)
    found_beside = find(done, done.freely, seed, progress) if left.structured else None
    if found_beside is not None and (richer := _richer(done, found_beside, seed, progress)) is not None:
        done, found_beside = richer
        bare, left = done.of_every_joint, _left(done, True)
    beside = found_beside if found_beside is not None and leaves_names(done, found_beside) else None
    if alone is not None and in_place(done, alone, beside):
        swapped = in_place_of_one(done, alone, seed)
        beside = swapped or found_beside or find(done, done.freely, seed, progress)
        if beside is None or not (swapped or keeps_names(done, beside, alone)):
            nearest = tuple(item.score.candidate.effect.id for item in found.found if bare is done or not item.given)
            judged = verify.verify(alone.problem, done.weight, found.baseline, alone.fitted, done.roles, seed)
            return bare, Stands(bare is not done, clock, alone, judged, _left(bare, bare is not done), nearest)
    if beside is not None:
        judged = verify.verify(beside.problem, done.weight, found.baseline, beside.fitted, done.roles, seed)
    return done, Stands(True, clock, beside, judged, left)


def _richer(done: Finished, laws: FoundLaws, seed: int, progress: Callable[[str], None]) -> tuple[Finished, FoundLaws] | None:
    """The search with what every joint may have and only shows beside laws, and laws beside all that; None where there is nothing more."""
    more = with_terms(done, laws)
    beside = None if more is None else find(more, more.freely, seed, progress)
    return None if more is None or beside is None else (more, beside)


def _left(done: Finished, named: bool) -> LeftOver:
    """What is left beside the freedoms of the friction law and of the names, all fitted to all data: what they may be wrong by where they
    were not fitted, as after many losses, is no structure."""
    there = done.compared
    known = there.found.final if named else there.found.baseline
    return left_over(there, fit(there.problem, there.weight, known.effects, known), done.needs_form)


def _clock(done: Finished) -> Apart | None:
    """The clock that is apart, where all that was found is what clocks may be: in one recording, or in several that are stamped on receipt.
    What all of several show is else the machine's, unless it is no more than clocks may still be apart beside a law of another form."""
    found, longest, received = done.compared.found, LONGEST_S, any(run.on_receipt for run in done.problem.runs)
    if len(found.found) != 1 or not found.final.effects:
        return None
    best, candidate = found.found[0], found.final.effects[-1][0]
    if len(done.problem.runs) > 1 and candidate.bags is None and not received:
        longest = APART_S if done.needs_form else 0.0
    alike = {candidate.effect.id, *(best.rivals if received else ())}
    for trial in (trial for trial in best.trials if trial.candidate.effect.id in alike):
        own, values = trial.fit.effects[-1]
        if "delay" not in own.effect.hooks:
            continue
        late, spread = float(own.effect.law("delay", values)), float(trial.fit.covariance[-1, -1])
        apart = Apart(late, float(np.sqrt(max(done.compared.problem.doubt * spread, 0.0))), candidate.bags)
        if abs(late) - SURELY * apart.deviation_s * received < longest:
            return apart
    return None
