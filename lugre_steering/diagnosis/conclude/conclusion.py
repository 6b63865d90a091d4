# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From a finished search to the result: verified on held-out data, located, judged and put into words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from lugre_steering.diagnosis.conclude import limits, verify
from lugre_steering.diagnosis.conclude.augmented import augmented_vehicle
from lugre_steering.diagnosis.conclude.causal import causal_rmse
from lugre_steering.diagnosis.conclude.effects import named_effects
from lugre_steering.diagnosis.conclude.evidence import evidence, traces
from lugre_steering.diagnosis.conclude.experiment import next_experiment
from lugre_steering.diagnosis.conclude.finished import Finished
from lugre_steering.diagnosis.conclude.late import begun_late
from lugre_steering.diagnosis.conclude.left_over import LeftOver, beside_laws, left_over
from lugre_steering.diagnosis.conclude.statement import statement
from lugre_steering.diagnosis.laws.find import FoundLaws, find
from lugre_steering.diagnosis.laws.rival import in_place, leaves_names
from lugre_steering.diagnosis.laws.write import described, entries, formula, sentence
from lugre_steering.diagnosis.result import SCHEMA, Augmented, Diagnosis, Errors, Limit, Verdict
from lugre_steering.diagnosis.search import onset
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fitting.clocks import LONGEST_S
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import is_rig
from lugre_steering.fitting.sheet import LEVELS, at_bounds
from lugre_steering.recording import BagFinding, Recording

CONTRADICTED = 0.02
"""Growth of the held-out error that overrules a name."""


class _Tested(NamedTuple):
    """Whether names stand, whether they are only a clock that is apart, and how they do on held-out data."""

    named: bool
    clock: bool
    judged: verify.Judged


@dataclass(frozen=True)
class _Stands:
    """What stands: names, laws beside or without them, or only a clock that is apart; ``judged`` on held-out data, ``left`` beside
    the names alone."""

    named: bool
    clock: bool
    lawful: FoundLaws | None
    judged: verify.Judged
    left: LeftOver
    nearest: tuple[str, ...] = ()
    """Names in whose place laws stand."""

    @property
    def better(self) -> bool:
        return self.named or self.lawful is not None

    @property
    def verdict(self) -> Verdict:
        if self.named:
            return "missing_physics"
        return "unlisted_physics" if self.lawful is not None or self.left.structured else "consistent"


def conclude(
    done: Finished, findings: Sequence[BagFinding], recordings: Sequence[Recording], *,
    seed: int, material: float, progress: Callable[[str], None],
) -> Diagnosis:
    """The result of a search; ``findings``: what the check of the data found in the recordings, ``material``: see ``diagnose``."""
    tested = _tested(done, seed)
    if not tested.named and done.found.found and (late := begun_late(done)) is not done:
        done, tested = late, _tested(late, seed)
    stands, problem, found = _stands(done, tested, seed, progress), done.problem, done.found
    final = found.final if stands.named or stands.clock else found.baseline
    whole, bent = _whole(done, final)
    if any(candidate.since for candidate, _ in final.effects):
        final = whole  # timed by all data
    beside, laws, law, left = done, [], "", stands.left
    if (lawful := stands.lawful) is not None:
        beside, final, whole, laws = replace(done, problem=lawful.problem), lawful.fitted, lawful.fit, described(lawful, stands.nearest)
        law = sentence(laws, done.torque)
        left = beside_laws(left, left_over(beside, final), law, formula(laws, problem.vehicle))
    effects = named_effects(beside, whole, bent, material) if stands.named else []
    judged = stands.judged
    after = judged.after if stands.better else judged.before
    vehicle = augmented_vehicle(beside, whole, effects, after)
    if lawful is not None:
        vehicle = vehicle.replace(laws=(*vehicle.laws, *entries(lawful)))
    kept = {entry.id for entry in vehicle.effects}
    ended = [effect.id for effect in effects if effect.id not in kept]
    causal = causal_rmse(vehicle, recordings, problem.runs)
    progress("next experiment")
    advice = next_experiment(done, stands.verdict, whole, lawful)
    headline, statistics = statement(done, stands.verdict, effects, judged, causal, left, ended, law, stands.nearest, advice)
    return Diagnosis(
        schema=SCHEMA,
        bags=tuple(run.name for run in problem.runs),
        verdict=stands.verdict,
        statement=f"{headline} {statistics}",
        headline=headline,
        noise_floor_Nm=done.noise.floor,
        baseline=Errors(verify.rmse(problem, found.baseline, problem.valid), judged.before),
        augmented=Augmented(
            rmse_Nm=verify.rmse(problem, final, problem.valid),
            heldout_rmse_Nm=after,
            improvement=judged.gain if stands.better else 0.0,
            improvement_ci95=judged.interval if stands.better else (0.0, 0.0),
            causal_rmse_Nm=causal,
            vehicle=vehicle,
        ),
        effects=tuple(effects),
        unexplained=left.entry,
        detection_limits=_limits(done, [effect.id for effect in effects]),
        data_quality=tuple(findings),
        next_experiment=advice,
        laws=tuple(laws),
        traces=traces(beside, whole, final, None if judged.rotated else found.final if stands.named and not laws else final),
        evidence=evidence(done.compared, effects),
        coordinate_of={effect.id: CATALOGUE[effect.id].coordinate for effect in effects},
        sheet=problem.vehicle,
    ).in_words()


def _tested(done: Finished, seed: int) -> _Tested:
    """The search has already tested significance; held-out data must not contradict it, though they may hardly see the effect,
    and an improvement that may be none is none: beside the freedoms with which names are compared, as without them the form of the
    friction law may be most of the error. In a vehicle file, which cannot hold freedoms, a name must do no harm."""
    problem, found, there = done.problem, done.found, done.compared
    judged = verify.verify(problem, done.weight, found.baseline, found.final, done.roles, seed)
    beside = judged
    if found.found and done.needs_form and judged.gain > -CONTRADICTED:
        beside = verify.verify(there.problem, there.weight, there.found.baseline, there.found.final, there.roles, seed)
    clock = _clocks_alone(found.final, len(problem.runs))
    # Beside a baseline that has gone as far as it may, a name only makes up for it; what an unknown rig's sheet says is a guess anyhow.
    stuck = not is_rig(problem.vehicle) and bool(at_bounds(done.compared.problem, done.compared.found.final.x, LEVELS))
    better = judged.gain > -CONTRADICTED and beside.gain > -CONTRADICTED and beside.interval[0] > 0.0
    named = bool(found.found) and better and not clock and not stuck
    return _Tested(named, clock, judged)


def _stands(done: Finished, tested: _Tested, seed: int, progress: Callable[[str], None]) -> _Stands:
    """What remains of the names beside laws for what they leave over."""
    problem, found, (named, clock, judged) = done.problem, done.found, tested
    left = _left(done, named or clock)
    if not left.structured and not (named and done.needs_form):
        return _Stands(named, clock, None, judged, left)
    alone = find(problem, done.noise, done.roles, found.baseline, seed, progress)
    if not named:
        return _Stands(False, clock, alone, judged if alone is None else alone.judged, left)
    beside = find(problem, done.noise, done.roles, found.final, seed, progress) if left.structured else None
    if alone is not None and in_place(done, alone, beside):
        nearest = tuple(candidate.effect.id for candidate, _ in found.final.effects)
        return _Stands(False, clock, alone, alone.judged, _left(done, False), nearest)
    if beside is not None and not leaves_names(done, beside):
        beside = None
    if beside is not None:
        judged = verify.verify(beside.problem, done.weight, found.baseline, beside.fitted, done.roles, seed)
    return _Stands(True, clock, beside, judged, left)


def _left(done: Finished, named: bool) -> LeftOver:
    """What is left beside the freedoms of the friction law and of the names."""
    there = done.compared.found
    return left_over(done.compared, there.final if named else there.baseline, done.needs_form)


def _clocks_alone(final: Fit, bags: int) -> bool:
    """Whether all that was found is what two clocks may be apart in one recording; what all of several show is the machine's."""
    return bool(final.effects) and all(
        "delay" in candidate.effect.hooks
        and abs(candidate.effect.law("delay", values)) < LONGEST_S
        and (bags == 1 or candidate.bags is not None)
        for candidate, values in final.effects
    )


def _whole(done: Finished, final: Fit) -> tuple[Fit, Fit]:
    """All valid data fitted, for the values that are reported, and the same beside all freedoms; what began late is timed anew."""
    there = done.compared
    if not final.effects:
        return fit(done.problem, done.weight, (), final.x), there.found.baseline
    bent = fit(there.problem, there.weight, there.found.final.effects, there.found.final)
    for index, (candidate, values) in enumerate(bent.effects):
        if candidate.since:
            effects = [*bent.effects]
            effects[index] = (replace(candidate, since=onset.timed(there.problem, there.weight, bent, index)), values)
            again = fit(there.problem, there.weight, effects, bent)
            bent = again if again.cost < bent.cost else bent
    return fit(done.problem, done.weight, bent.effects, bent.x[: done.problem.nuisances], linearisations=20), bent


def _limits(done: Finished, named: Sequence[str]) -> dict[str, Limit]:
    """Smallest amplitude of each effect that this recording would have revealed."""
    where = done.compared
    found = limits.smallest(where.problem, where.found.baseline, where.fitted, where.found.first_scores, named)
    return {
        effect: Limit(parameter.name, value, done.unit(parameter.unit))
        for effect, (parameter, value) in found.items()
    }
