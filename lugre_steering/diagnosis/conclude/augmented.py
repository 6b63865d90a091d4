# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The vehicle file of the result: recalibrated, with the effects that were named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lugre_steering.data.seen import seen_range
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.result import NamedEffect
from lugre_steering.effects.registry import ORIGINS
from lugre_steering.fitting.apply import apply_calibration
from lugre_steering.fitting.doubt import in_doubt
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.weather import initial_of, weather_findings
from lugre_steering.vehicle import EffectEntry, Vehicle, each_once


def augmented_vehicle(done: Finished, whole: Fit, effects: Sequence[NamedEffect], heldout_rmse: float) -> Vehicle:
    """Recalibrated vehicle with the named effects that act in the last bag; ``heldout_rmse`` [N m] was found before all
    data were fitted."""
    problem = in_doubt(done.problem, done.weight, whole)  # where the model errs, the sheet weighs against its errors, not the sensors'
    if not weather_findings(problem, whole):  # nothing speaks against the temperatures of the file
        problem = problem.with_known_weather()
    held = [(replace(candidate, free=()), values) for candidate, values in whole.effects]
    whole = replace(fit(problem, done.weight, held, whole.x[: problem.nuisances]), effects=whole.effects)
    entries = list(problem.vehicle.effects)
    last = len(problem.runs) - 1
    for candidate, values in whole.effects[: len(effects)]:
        if not candidate.active_in(last) or candidate.start(last) > problem.runs[last].time[-1]:
            continue
        keep = {p.name: float(values[p.name]) for p in candidate.effect.parameters if values.get(p.name)}
        for low, high in candidate.effect.places:
            ends = {key: keep.pop(key, 0.0) for key in (low, high)}
            if ends[low] < ends[high]:  # else everywhere
                keep |= ends
        if candidate.effect.per_line:
            (error,) = candidate.effect.amplitudes
            keep = {candidate.line: float(values[error])}
        else:  # found again: nothing of its old values stays
            entries = [entry for entry in entries if entry.id != candidate.effect.id]
        if keep:
            origin = ORIGINS.get(candidate.effect.id)
            source, sha256 = (origin.source, origin.sha256) if origin is not None else (None, None)
            entries.append(EffectEntry(candidate.effect.id, keep, source, sha256))
    provenance = {
        "made_by": "lugre-steering diagnose", "bags": [run.name for run in problem.runs],
        "heldout_rmse_Nm": round(heldout_rmse, 3),
        "recalibrated": {
            field: {"sheet": float(problem.model.parameters[0][0][field]), "now": round(value, 6)}
            for field, value in problem.fields(whole.x).items()
        },
    }  # fmt: skip
    changed = apply_calibration(problem.vehicle, problem, whole.x)
    written = replace(changed, effects=each_once(entries), initial=initial_of(problem, whole))
    return written.replace(provenance={**provenance, "seen": seen_range(written, problem.runs, problem.starts(whole.x))})
