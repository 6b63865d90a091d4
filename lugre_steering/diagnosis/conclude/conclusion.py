# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From a finished search to the result: verified on held-out data, located, judged and put into words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from lugre_steering.diagnosis import verify
from lugre_steering.diagnosis.conclude import limits
from lugre_steering.diagnosis.conclude.augmented import augmented_vehicle
from lugre_steering.diagnosis.conclude.effects import named_effects
from lugre_steering.diagnosis.conclude.evidence import evidence, traces
from lugre_steering.diagnosis.conclude.experiment import next_experiment
from lugre_steering.diagnosis.conclude.joint import in_parallel
from lugre_steering.diagnosis.conclude.late import fitted_to_all
from lugre_steering.diagnosis.conclude.left_over import LeftOver, beside_laws, only_nearest
from lugre_steering.diagnosis.conclude.stands import CONTRADICTED, Stands, standing, without_laws
from lugre_steering.diagnosis.conclude.statement import statement
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.found_law import FoundLaw
from lugre_steering.diagnosis.laws.write import described, entries, formula, sentence
from lugre_steering.diagnosis.result import (
    AUGMENTED,
    FORMED,
    SCHEMA,
    Augmented,
    BagTrace,
    Diagnosis,
    Errors,
    FrictionForm,
    Limit,
    NamedEffect,
)
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fitting.causal import causal_rmse, filtered
from lugre_steering.fitting.clocks import Offset, clock_finding, offset_findings
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.recording import BagFinding, Recording
from lugre_steering.vehicle import Vehicle


def conclude(
    done: Finished, findings: Sequence[BagFinding], recordings: Sequence[Recording], *,
    seed: int, material: float, progress: Callable[[str], None],
) -> Diagnosis:
    """The result of a search; ``findings``: what the check of the data found in the recordings, ``material``: see ``diagnose``."""
    done, stands = standing(done, seed, progress)
    model, effects, vehicle, causal = _with_file(done, stands, recordings, material, seed)
    if stands.lawful is not None:
        bare = without_laws(done, stands, seed)
        other = _with_file(done, bare, recordings, material, seed)
        if causal > (1.0 + CONTRADICTED) * other.causal:  # explained when all is known, and a harm live
            stands, (model, effects, vehicle, causal) = bare, other
    form = _form(done, stands, vehicle, causal, recordings)
    if (clock := stands.clock) is not None and not stands.better:
        apart = clock_finding(done.problem.vehicle, clock.late_s, clock.deviation_s)
        late = [run.name for bag, run in enumerate(done.problem.runs) if clock.bags is None or bag in clock.bags]
        findings = [*findings, *map(apart.in_bag, late)]
    findings = [*findings, *(apart.in_bag(bag) for bag, apart in offset_findings(done.problem, model.late).items())]
    progress("next experiment")
    return _told(done, stands, model, effects, vehicle, causal, form, findings)


@dataclass(frozen=True)
class _Modelled:
    """What stands, fitted: ``final`` to the samples that may fit, ``whole`` to all, ``bent`` beside all freedoms; ``done`` has places for
    its laws, which ``laws`` describes and ``law`` says in a sentence, with what is ``left`` beside them; how ``late`` the torque of each
    bag of a joint is."""

    done: Finished
    final: Fit
    whole: Fit
    bent: Fit
    laws: tuple[FoundLaw, ...]
    law: str
    left: LeftOver
    late: tuple[Offset, ...] = ()


class _WithFile(NamedTuple):
    """What stands with its names and the vehicle file that has it, and the error [N m] of that file without looking ahead."""

    model: _Modelled
    effects: list[NamedEffect]
    vehicle: Vehicle
    causal: float


def _with_file(done: Finished, stands: Stands, recordings: Sequence[Recording], material: float, seed: int) -> _WithFile:
    model = _modelled(done, stands, seed)
    nearest = stands.lawful is None and only_nearest(done, stands.left)
    effects = named_effects(model.done, model.whole, model.bent, material, nearest) if stands.named else []
    vehicle, causal = filtered(_written(model, stands, effects), recordings, done.problem.runs)
    return _WithFile(model, effects, vehicle, causal)


def _modelled(done: Finished, stands: Stands, seed: int) -> _Modelled:
    final = done.found.final if stands.named or stands.clock else done.found.baseline
    whole, bent = _whole(done, final)
    if any(candidate.since for candidate, _ in final.effects):
        final = whole  # timed by all data
    if (lawful := stands.lawful) is None and stands.named and (form := stands.form) is not None:
        return _Modelled(replace(done, problem=form.problem), form.fitted, form.whole, bent, (), "", stands.left)
    if lawful is None:
        if stands.named and (joint := in_parallel(done, final, seed)) is not None:
            return _Modelled(joint.done, final, joint.whole, joint.bent, (), "", stands.left, joint.late)
        return _Modelled(done, final, whole, bent, (), "", stands.left)
    beside, whole, laws = replace(done, problem=lawful.problem), lawful.fit, described(lawful, stands.nearest)
    law = sentence(laws, done.torque)
    left = beside_laws(beside, stands.left, lawful.fitted, lawful.names, law, formula(laws, done.problem.vehicle))
    if (joint := stands.parallel) is not None:
        return _Modelled(joint.done, lawful.fitted, joint.whole, joint.bent, laws, law, left, joint.late)
    return _Modelled(beside, lawful.fitted, whole, bent, laws, law, left)


def _written(model: _Modelled, stands: Stands, effects: Sequence[NamedEffect]) -> Vehicle:
    """The vehicle file with what stands."""
    vehicle = augmented_vehicle(model.done, model.whole, effects, stands.after)
    found = entries(stands.lawful) if stands.lawful is not None else ()
    form = stands.form.laws if stands.better and stands.form is not None else ()
    return vehicle.replace(laws=(*vehicle.laws, *found, *form))


def _form(done: Finished, stands: Stands, vehicle: Vehicle, causal: float, recordings: Sequence[Recording]) -> FrictionForm | None:
    """What the form of the friction as laws is worth: in the vehicle file of what is named, or in one of its own where nothing is, as
    augmented.yaml is the recalibrated baseline then."""
    if (found := stands.form) is None:
        return None
    if not stands.better:
        vehicle = augmented_vehicle(replace(done, problem=found.problem), found.whole, (), found.better.after)
        vehicle = vehicle.replace(laws=(*vehicle.laws, *found.laws))
        causal = causal_rmse(vehicle, recordings, done.problem.runs)
    laws = tuple(dict.fromkeys(entry.title or "" for entry in found.laws))
    return FrictionForm(
        AUGMENTED if stands.better else FORMED, found.better.after, found.better.gain, found.better.interval, causal, laws, vehicle
    )


def _told(
    done: Finished, stands: Stands, model: _Modelled, effects: Sequence[NamedEffect], vehicle: Vehicle, causal: float,
    form: FrictionForm | None, findings: Sequence[BagFinding],
) -> Diagnosis:
    """The result, in numbers and words."""
    problem, found, judged = done.problem, done.found, stands.judged
    kept = {entry.id for entry in vehicle.effects}
    ended = [effect.id for effect in effects if effect.id not in kept]
    advice = next_experiment(model.done, stands.verdict, model.whole, stands.lawful, stands.form)
    headline, statistics = statement(
        done, stands.verdict, effects, judged, causal, form, model.left, ended, model.law, stands.nearest, advice
    )
    return Diagnosis(
        schema=SCHEMA,
        bags=tuple(run.name for run in problem.runs),
        verdict=stands.verdict,
        statement=f"{headline} {statistics}",
        headline=headline,
        noise_floor_Nm=done.noise.floor,
        baseline=Errors(verify.rmse(problem, found.baseline, problem.valid), judged.before),
        augmented=Augmented(
            rmse_Nm=verify.rmse(problem, model.final, problem.valid),
            heldout_rmse_Nm=stands.after,
            improvement=judged.gain if stands.better else 0.0,
            improvement_ci95=judged.interval if stands.better else (0.0, 0.0),
            causal_rmse_Nm=causal,
            vehicle=vehicle,
        ),
        effects=tuple(effects),
        unexplained=model.left.entry,
        detection_limits=_limits(done, [effect.id for effect in effects]),
        data_quality=tuple(findings),
        next_experiment=advice,
        laws=model.laws,
        friction_form=form,
        traces=_shown(done, stands, model),
        evidence=evidence(done.compared, effects),
        coordinate_of={effect.id: CATALOGUE[effect.id].coordinate for effect in effects},
        sheet=problem.vehicle,
    ).in_words()


def _shown(done: Finished, stands: Stands, model: _Modelled) -> tuple[BagTrace, ...]:
    """Curves for the pictures; the error by cluster where the held-out third was judged as it was fitted."""
    alone = stands.named and not model.laws and stands.form is None
    judged = None if stands.judged.rotated else done.found.final if alone else model.final
    return traces(model.done, model.whole, model.final, judged)


def _whole(done: Finished, final: Fit) -> tuple[Fit, Fit]:
    """All valid data fitted, for the values that are reported, and the same beside all freedoms."""
    there = done.compared
    if not final.effects:
        return fit(done.problem, done.weight, (), final.x), there.found.baseline
    bent = fitted_to_all(there)
    return done.in_file(done.weight, bent.effects, bent.x), bent


def _limits(done: Finished, named: Sequence[str]) -> dict[str, Limit]:
    """Smallest amplitude of each effect that this recording would have revealed."""
    where = done.compared
    found = limits.smallest(where.problem, where.found.baseline, where.fitted, where.found.first_scores, named)
    return {
        effect: Limit(parameter.name, value, done.unit(parameter.unit))
        for effect, (parameter, value) in found.items()
    }
