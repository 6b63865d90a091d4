# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Diagnosis from bags to verdict: check the data, recalibrate, fingerprint, detect, locate, name, verify, advise."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering import units
from lugre_steering.bag import read_recording
from lugre_steering.diagnosis import experiment, limits, locate, name, onset, unlisted, verify
from lugre_steering.diagnosis.apply import apply_calibration
from lugre_steering.diagnosis.bursts import set_aside
from lugre_steering.diagnosis.dataset import Run, prepare
from lugre_steering.diagnosis.fit import Fit, fit
from lugre_steering.diagnosis.investigate import investigate
from lugre_steering.diagnosis.noise import Noise, slow_part
from lugre_steering.diagnosis.problem import Candidate, Problem
from lugre_steering.diagnosis.quality import Quality, inspect
from lugre_steering.diagnosis.result import SCHEMA, BagTrace, Diagnosis, Evidence, finite
from lugre_steering.diagnosis.split import Split, split
from lugre_steering.effects.catalogue import CATALOGUE
from lugre_steering.errors import BagError, DataError
from lugre_steering.recording import Array, Finding, Recording
from lugre_steering.vehicle import EffectEntry, Vehicle, each_once

MIN_SLIDING, MIN_SAMPLES = 2.0, 500
"""Travel, in presliding lengths, below which friction level and stiffness cannot be told apart; samples that a fit needs."""
UNLISTED_EXCESS, FAST_EXCESS = 0.25, 1.0
"""Energy left over, in noise variances, that makes a verdict: slow and above the doubt about slow noise, or of any kind."""
FORETELLS = 0.1
"""Share of the held-out energy that a pattern outside the catalogue must explain to be a verdict, however little is left over."""
LOCATED_SIGMA, LOCATED_SHARE = 2.0, 0.2
"""Unlisted structure is located where its level over half a second exceeds both: noise levels, and a share of its peak."""
BOTH_SIDES = 0.5
"""Share of its largest angle below which an effect that acts to both sides must be silent to be called one of |angle|."""
TELLING = 0.5
"""Share of the held-out energy that a pattern outside the catalogue must explain for its own places to be told."""
CONTRADICTED = 0.02
"""Growth of the held-out error that overrules a name."""
MATERIAL_SHARE = 0.005
"""Default share of the torque amplitude above which an effect is called material; it only labels."""

Progress = Callable[[str], None]


def diagnose(
    bags: Sequence[Path],
    vehicle: Vehicle,
    *,
    seed: int = 1,
    material: float = MATERIAL_SHARE,
    progress: Progress = lambda _: None,
) -> Diagnosis:
    """Read and diagnose bags of one vehicle together; two of one name get numbers."""
    recordings: list[Recording] = []
    for bag in bags:
        if sum(bag.resolve() == other.resolve() for other in bags) > 1:
            raise BagError(f"{bag}: given more than once; a copy of a recording proves nothing, give each bag once")
        progress(f"reading {bag.name}")
        read = read_recording(bag, vehicle.channels)
        taken = {recording.name for recording in recordings}
        names = itertools.chain([read.name], (f"{read.name}_{number}" for number in itertools.count(2)))
        recordings.append(replace(read, name=next(name for name in names if name not in taken)))
    return diagnose_recordings(recordings, vehicle, seed=seed, material=material, progress=progress)


def diagnose_recordings(
    recordings: Sequence[Recording],
    vehicle: Vehicle,
    *,
    seed: int = 1,
    material: float = MATERIAL_SHARE,
    progress: Progress = lambda _: None,
) -> Diagnosis:
    """Diagnose recordings of one vehicle together; effects that the vehicle file already has stay in the baseline."""
    progress("checking the data")
    qualities = [inspect(recording, vehicle) for recording in recordings]
    findings = _findings(qualities)
    blocking = [f"{q.recording.name}: {f.statement}" for q in qualities for f in q.blocking]
    if blocking:
        return _insufficient(
            qualities, vehicle, findings, "The data must be put right first. " + " ".join(blocking), None
        )
    progress("estimating the motion")
    try:
        problem = Problem(vehicle, [prepare(quality.recording, vehicle) for quality in qualities])
    except DataError as error:
        return _insufficient(qualities, vehicle, findings, f"The data do not allow a diagnosis: {error}.", None)
    travel = max(float(np.ptp(run.theta)) for run in problem.runs) / problem.presliding
    roles = split(problem)
    if travel < MIN_SLIDING or roles.fit.sum() < MIN_SAMPLES:
        if travel < MIN_SLIDING:
            lacking = f"the contact turned by {travel:.1f} presliding lengths; at least {MIN_SLIDING:g} are needed"
        else:
            lacking = f"only {roles.fit.sum()} usable samples are left to fit; at least {MIN_SAMPLES} are needed (see data_quality)"
        advice = {
            "manoeuvre": "double-cycle: " + experiment.manoeuvres(problem)["double-cycle"].description,
            "separates": ["friction level", "stiffness"],
            "why": lacking,
        }
        statement = (
            f"The recording of {sum(float(run.time[-1] - run.time[0]) for run in problem.runs):.0f} s does not determine the "
            f"baseline: {lacking}. Nothing can be said about missing physics."
        )
        return _insufficient(qualities, vehicle, findings, statement, advice)
    progress("recalibrating the baseline")
    noise, roles, found = investigate(problem, seed, progress)
    left = problem.measured - found.final.prediction
    runs, disturbed = set_aside(problem.runs, np.split(left, problem.edges[1:-1]))
    if disturbed:
        # Physics is judged on what the motion makes; kicks from outside would hide what is small.
        findings += [_entry(finding, bag) for bag, finding in disturbed.items()]
        problem = Problem(vehicle, runs)
        noise, roles, found = investigate(problem, seed, progress)
    progress("verifying on held-out data")
    return _Conclusion(problem, noise, roles, found, seed, material, progress).diagnosis(findings)


@dataclass(frozen=True)
class _Conclusion:
    """From a finished search to the result, step by step."""

    problem: Problem
    noise: Noise
    roles: Split
    found: name.Search
    seed: int
    material: float
    progress: Progress

    def _unit(self, unit: str) -> str:
        return units.label(self.problem.vehicle, unit)

    def _title(self, effect: str) -> str:
        return units.title(self.problem.vehicle, CATALOGUE[effect])

    def _torque(self, value: float) -> str:
        digits = f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"
        return f"{digits} {self.problem.vehicle.coordinate.force_unit}"

    def diagnosis(self, findings: list[dict[str, Any]]) -> Diagnosis:
        problem, roles, found = self.problem, self.roles, self.found
        weight = np.where(problem.valid, 1.0 / self.noise.sigma, 0.0)
        judged = verify.verify(problem, weight, found.baseline, found.final, roles, self.seed)
        # The search has already tested significance; held-out data must not contradict it, though they may hardly see the effect.
        named = bool(found.found) and judged.gain > -CONTRADICTED
        final = found.final if named else found.baseline
        whole = self._whole(final, weight)
        if any(candidate.since for candidate, _ in final.effects):
            final = whole  # timed by all data
        residual = problem.measured - final.prediction
        left, left_text, structured = self._left_over(residual, final)
        if named:
            verdict = "missing_physics"
        elif structured:
            verdict = "unlisted_physics"
        else:
            verdict = "consistent"
        effects = self._effects(whole) if named else []
        vehicle = self._vehicle(whole, effects)
        baseline = {
            "rmse_Nm": verify.rmse(problem, found.baseline, problem.valid),
            "heldout_rmse_Nm": judged.before,
        }
        augmented: dict[str, Any] = {
            "rmse_Nm": verify.rmse(problem, final, problem.valid),
            "heldout_rmse_Nm": judged.after if named else judged.before,
            "improvement": judged.gain if named else 0.0,
            "improvement_ci95": list(judged.interval) if named else [0.0, 0.0],
        }
        self.progress("next experiment")
        json = {
            "schema": SCHEMA,
            "bags": [run.name for run in problem.runs],
            "verdict": verdict,
            "statement": self._statement(verdict, effects, baseline, augmented, left_text, judged.rotated),
            "noise_floor_Nm": self.noise.floor,
            "baseline": baseline,
            "augmented": augmented,
            "effects": effects,
            "unexplained": left,
            "detection_limits": self._limits([effect["id"] for effect in effects]),
            "data_quality": findings,
            "next_experiment": self._next(verdict, whole),
        }
        return Diagnosis(
            units.in_words(vehicle, finite(json)),
            vehicle,
            self._traces(whole, final),
            self._evidence(effects),
            {e["id"]: CATALOGUE[e["id"]].coordinate for e in effects},
        )

    def _whole(self, final: Fit, weight: Array) -> Fit:
        """All valid data fitted, for the values that are reported; what began late is timed anew."""
        whole = fit(self.problem, weight, final.effects, final.x)
        for index, (candidate, values) in enumerate(whole.effects):
            if candidate.since:
                effects = [*whole.effects]
                effects[index] = (replace(candidate, since=onset.timed(self.problem, weight, whole, index)), values)
                again = fit(self.problem, weight, effects, whole.x)
                whole = again if again.cost < whole.cost else whole
        return whole

    def _effects(self, whole: Fit) -> list[dict[str, Any]]:
        problem, found = self.problem, self.found
        weight = np.where(problem.valid, 1.0 / self.noise.sigma, 0.0)
        covariance = verify.robust_covariance(problem, whole, weight, self.roles.cluster)
        spread = verify.jackknife(problem, whole, weight)
        position, entries = 0, []
        start = name.cost(problem, found.baseline, np.where(self.roles.fit, 1.0 / self.noise.sigma, 0.0))
        removed = start - name.cost(problem, found.final, np.where(self.roles.fit, 1.0 / self.noise.sigma, 0.0))
        total = sum(item.gain for item in found.found)
        amplitude = float(np.percentile(np.abs(problem.measured), 99.0))
        for index, ((candidate, values), item) in enumerate(zip(whole.effects, found.found, strict=True)):
            parameters = {}
            for key in candidate.free:
                place = problem.nuisances + position
                half = verify.WIDTH * max(float(np.sqrt(max(covariance[place, place], 0.0))), float(spread[position]))
                label = candidate.line if candidate.effect.per_line else key
                parameters[label] = {
                    "value": values[key], "ci95": [values[key] - half, values[key] + half],
                    "unit": self._unit(candidate.parameter(key).unit),
                }  # fmt: skip
                position += 1
            part = locate.contribution(problem, whole, index)
            size = float(np.max(np.abs(part)))
            where = self._where(candidate, part)
            share = float(np.clip(removed / max(start, 1e-9) * item.gain / max(total, 1e-9), 0.0, 1.0))
            rivals = [rival for rival in item.rivals if rival != candidate.effect.id]
            law = units.law(problem.vehicle, candidate.effect.equation)
            label = "material" if size > self.material * amplitude else "small"
            entries.append({
                "id": candidate.effect.id, "stage": candidate.effect.stage,
                "statement": (
                    f"{self._title(candidate.effect.id)}: {law}. Up to {self._torque(size)} "
                    f"({100 * size / amplitude:.1f} % of the torque amplitude, {label}){self._since(candidate)}"
                    + self._lines(whole, index, item)
                    + (f"; the data cannot tell it from {', '.join(rivals)}." if rivals else ".")
                ),
                "p_value": item.score.p_value, "parameters": parameters, "where": where, "energy_share": share,
                "masked_share": float(np.clip(item.score.masked_share, 0.0, 1.0)), "indistinguishable_from": rivals,
            })  # fmt: skip
        return sorted(entries, key=lambda entry: -entry["energy_share"])

    def _lines(self, whole: Fit, index: int, item: name.Found) -> str:
        """Other pressure lines on which the same error would fit as well, with its size there."""
        problem, hydraulics = self.problem, self.problem.vehicle.hydraulics
        candidate, values = whole.effects[index]
        if not candidate.effect.per_line or hydraulics is None:
            return ""
        weight = np.where(problem.valid, 1.0 / self.noise.sigma, 0.0)
        rest = [effect for i, effect in enumerate(whole.effects) if i != index]

        def with_line(line: str) -> name.Trial:
            fitted = fit(problem, weight, [*rest, (replace(candidate, line=line), values)], whole.x, linearisations=6)
            return name.Trial(item.score, fitted, name.cost(problem, fitted, weight))

        own = with_line(candidate.line)
        others = [with_line(line) for line in hydraulics.lines if line != candidate.line]
        before = name.cost(problem, fit(problem, weight, rest, whole.x, linearisations=6), weight)
        tied = name.tied(problem, weight, self.roles, own, others, before, float(problem.valid.sum()), law=0.0)
        key = candidate.free[0]
        unit = self._unit(candidate.parameter(key).unit)
        found = [f"{trial.candidate.line} ({trial.fit.effects[-1][1][key]:.3g} {unit})" for trial in tied]
        return f"; line {candidate.line} cannot be told from {', '.join(found)}" if found else ""

    def _since(self, candidate: Candidate) -> str:
        """When an effect began that was not there from the start."""
        begun = [
            f"{run.name} from {since - run.time[0]:.0f} s on" if since <= run.time[-1] else f"not in {run.name}"
            for run, since in zip(self.problem.runs, candidate.since, strict=False)
            if since > run.time[0]
        ]
        return f", {', '.join(begun)}" if begun else ""

    def _where(self, candidate: Candidate, part: Array) -> list[dict[str, Any]]:
        entries = []
        for bag, run in enumerate(self.problem.runs):
            piece = part[self.problem.edges[bag] : self.problem.edges[bag + 1]]
            spans = locate.intervals(run.time, piece)
            if not candidate.active_in(bag) or not spans:
                continue
            axes = locate.coordinates(run, run.measured)
            axis = candidate.effect.coordinate if candidate.effect.coordinate in axes else "time"
            low, high = locate.active_range(axes[axis], piece)
            if axis == "steering angle" and low < 0.0 < high:
                # Beyond some angle to both sides says more than nearly everything between.
                low_size, high_size = locate.active_range(axes["|steering angle|"], piece)
                if low_size > BOTH_SIDES * high_size:
                    axis, low, high = "|steering angle|", low_size, high_size
            entries.append({
                "bag": run.name, "intervals_s": [list(span) for span in spans], "coordinate": axis,
                "range": [low, high], "unit": self._unit(locate.UNITS[axis]),
            })  # fmt: skip
        return entries

    def _left_over(self, residual: Array, final: Fit) -> tuple[dict[str, Any], str, bool]:
        """What remains after the final fit: contract entry, one sentence, and whether it is structure worth a verdict."""
        problem = self.problem
        weight = np.where(problem.valid, 1.0 / self.noise.sigma, 0.0)
        parts = [slice(a, b) for a, b in zip(problem.edges, problem.edges[1:], strict=False)]
        axes = [locate.coordinates(run, run.measured) for run in problem.runs]
        stacked = {key: np.concatenate([bag[key] for bag in axes]) for key in axes[0]}
        axis, share, _ = locate.telling_coordinate(stacked, residual, weight, self.noise.draws)
        used = weight > 0.0
        slow, nothing = self._slow_energy(residual * weight), self._slow_energy(self.noise.draws * weight)
        excess = float(np.mean((residual * weight)[used] ** 2)) - 1.0
        held = np.where(self.roles.held, weight, 0.0)
        pattern, gain = self.found.pattern if not final.effects else None, 0.0
        if pattern is not None:
            gain = 1.0 - pattern.cost(problem, held) / max(name.cost(problem, self.found.baseline, held), 1e-9)
        # Slow errors tell physics from ripple and vibration, which standstill does not show as they are in motion.
        loud = slow - nothing > max(UNLISTED_EXCESS, self.noise.slow_doubt) or excess > FAST_EXCESS
        if not loud and not gain > FORETELLS:
            return (
                {
                    "structured": False,
                    "description": "what is left is within noise and the simulation's own error",
                    "formula": None,
                    "where": None,
                },
                "",
                False,
            )
        if not final.effects:
            # A least-squares fit spreads what it cannot explain over the whole record; a robust one leaves it in its place.
            sound = fit(problem, np.where(self.roles.fit, weight, 0.0), (), final.x, robust=True, linearisations=25)
            residual = problem.measured - sound.prediction
            axis, share, _ = locate.telling_coordinate(stacked, residual, weight, self.noise.draws)
        formula = None
        fitted = np.where(self.roles.fit, weight, 0.0)
        proposal = unlisted.propose(stacked, residual, fitted, held, units.is_linear(problem.vehicle))
        shape = None
        if pattern is not None and gain > (proposal.gain if proposal is not None else 0.02):
            proposal = unlisted.Formula(f"torque [N m] = {pattern.text}", gain)
            # A pattern that explains most of it also says where it acts below the noise.
            shape = pattern.torque if gain > TELLING or not loud else None
        if proposal is not None:
            formula = f"{units.law(problem.vehicle, proposal.text)} (removes {100 * proposal.gain:.0f} % of the held-out residual energy)"
        where = []
        for run, part, values in zip(problem.runs, parts, axes, strict=True):
            if shape is None:
                smooth = np.sqrt(np.convolve((residual[part] * weight[part]) ** 2, np.ones(50) / 50.0, mode="same"))
                limit = max(LOCATED_SIGMA, LOCATED_SHARE * float(np.percentile(smooth, 99.5)))
                spans = locate.intervals(run.time, np.where(smooth > limit, smooth, 0.0))
                piece = residual[part] * (smooth > limit)
            else:
                spans, piece = locate.intervals(run.time, shape[part]), shape[part]
            if spans:
                where.append({
                    "bag": run.name, "intervals_s": [list(span) for span in spans], "coordinate": axis,
                    "range": list(locate.active_range(values[axis], piece)), "unit": self._unit(locate.UNITS[axis]),
                })  # fmt: skip
        text = (
            f"{100 * excess / (1.0 + excess):.0f} % of what the model leaves over is more than noise, most of it along {axis} "
            f"({100 * share:.0f} % of the residual energy follows it)"
            if loud
            else f"a pattern outside the catalogue foretells {100 * gain:.0f} % of the held-out residual energy"
        )
        return {"structured": True, "description": text, "formula": formula, "where": where}, text, True

    def _slow_energy(self, standardised: Array) -> float:
        """Mean square per used sample of the slow part of (..., n) errors in noise standard deviations."""
        problem = self.problem
        pieces = [
            slow_part(standardised[..., a:b], run.time[1] - run.time[0])
            for run, a, b in zip(problem.runs, problem.edges[:-1], problem.edges[1:], strict=True)
        ]
        return float(np.mean(np.concatenate(pieces, axis=-1)[..., problem.valid] ** 2))

    def _limits(self, named: Sequence[str]) -> dict[str, Any]:
        """Smallest amplitude of each effect that this recording would have revealed."""
        weight = np.where(self.roles.fit, 1.0 / self.noise.sigma, 0.0)
        found = limits.smallest(self.problem, self.found.baseline, weight, self.found.first_scores, named)
        return {
            effect: {"parameter": parameter.name, "smallest": value, "unit": self._unit(parameter.unit)}
            for effect, (parameter, value) in found.items()
        }

    def _vehicle(self, whole: Fit, effects: Sequence[dict[str, Any]]) -> Vehicle:
        """Recalibrated vehicle with the named effects that act in the last bag."""
        problem = self.problem
        entries = list(problem.vehicle.effects)
        last = len(problem.runs) - 1
        for candidate, values in whole.effects if effects else ():
            if not candidate.active_in(last) or candidate.start(last) > problem.runs[last].time[-1]:
                continue
            keep = {p.name: float(values[p.name]) for p in candidate.effect.parameters if values.get(p.name)}
            if candidate.effect.per_line:
                keep = {candidate.line: float(values[candidate.free[0]])}
            else:  # found again: nothing of its old values stays
                entries = [entry for entry in entries if entry.id != candidate.effect.id]
            if keep:
                entries.append(EffectEntry(candidate.effect.id, keep))
        provenance = {
            "made_by": "lugre-steering diagnose", "bags": [run.name for run in problem.runs],
            "heldout_rmse_Nm": round(verify.rmse(problem, whole, self.roles.held), 3),
            "recalibrated": {
                field: {"sheet": float(problem.model.parameters[0][0][field]), "now": round(value, 6)}
                for field, value in problem.fields(whole.x).items()
            },
        }  # fmt: skip
        changed = apply_calibration(problem.vehicle, problem, whole.x)
        return replace(changed, effects=each_once(entries), provenance=provenance)

    def _evidence(self, effects: Sequence[dict[str, Any]]) -> tuple[Evidence, ...]:
        problem, found = self.problem, self.found
        held = np.where(self.roles.held, 1.0 / self.noise.sigma, 0.0)
        before = name.cost(problem, found.baseline, held)
        named = {effect["id"] for effect in effects}
        ties = {rival for effect in effects for rival in effect["indistinguishable_from"]}
        trials: dict[str, name.Trial] = {}
        alone = len(found.baseline.effects) + 1
        for trial in found.trials:
            # Beside an effect found before, a gain would not be the candidate's own.
            if len(trial.fit.effects) == alone:
                trials.setdefault(trial.candidate.label, trial)
        rows, seen = [], set()
        for score in found.first_scores:
            label = score.candidate.label
            if label in seen:
                continue
            seen.add(label)
            tried = trials.get(label)
            gain = None
            if tried is not None and before > 0.0:
                gain = 1.0 - float(np.sqrt(name.cost(problem, tried.fit, held) / before))
            effect_id = score.candidate.effect.id
            if effect_id in named:
                verdict = "named"
            elif effect_id in ties:
                verdict = "cannot be told from the named effect"
            elif tried is not None:
                verdict = "fits worse than the named effect" if named else "explains too little of what is left over"
            elif score.p_value > name.FALSE_DISCOVERY_RATE:
                verdict = "not significant"
            else:
                verdict = "explains too little to be tried"
            rows.append(
                Evidence(
                    label,
                    self._title(score.candidate.effect.id),
                    score.share,
                    score.masked_share,
                    score.p_value,
                    gain,
                    verdict,
                )
            )
        return tuple(rows)

    def _traces(self, whole: Fit, final: Fit) -> tuple[BagTrace, ...]:
        problem, found = self.problem, self.found
        parts = {
            candidate.effect.id: locate.contribution(problem, whole, i)
            for i, (candidate, _) in enumerate(whole.effects)
        }
        traces = []
        for bag, run in enumerate(problem.runs):
            piece = slice(problem.edges[bag], problem.edges[bag + 1])
            traces.append(BagTrace(
                run.name, run.time, run.measured, found.baseline.prediction[piece], final.prediction[piece],
                self.roles.held[piece].astype(float), {key: part[piece] for key, part in parts.items()},
                {key: locate.intervals(run.time, part[piece]) for key, part in parts.items()}, locate.coordinates(run, run.measured),
            ))  # fmt: skip
        return tuple(traces)

    def _next(self, verdict: str, whole: Fit) -> dict[str, Any] | None:
        """For a tie the manoeuvre that separates the rivals best; otherwise what would show the effects this data masks."""
        for index, item in enumerate(self.found.found if verdict == "missing_physics" else ()):
            rivals = [trial for trial in item.trials if trial.candidate.effect.id in item.rivals]
            if rivals:
                chosen = whole.effects[index]
                energies = experiment.separation(
                    self.problem, whole, [chosen], [rivals[0].fit.effects[-1]], self.noise.floor
                )
                best, description, energy = experiment.recommend(self.problem, energies)
                others = ", ".join(f"{key} {np.sqrt(value):.0f}" for key, value in energies.items() if key != best)
                return {
                    "manoeuvre": f"{best}: {description}", "separates": [chosen[0].effect.id, rivals[0].candidate.effect.id],
                    "why": f"there the two explanations differ by {np.sqrt(energy):.0f} standard deviations in all after recalibration, "
                    f"more than in any other manoeuvre tried ({others})",
                }  # fmt: skip
        if verdict == "unlisted_physics":
            return {
                "manoeuvre": "varied-rates, then small-loops and hold-and-rest: each changes one of rate, amplitude and dwell only",
                "separates": ["dependence on rate", "on amplitude", "on dwell"],
                "why": "the structure follows none of the catalogue's laws; runs that vary one quantity at a time show which it depends on",
            }
        return None

    def _statement(
        self,
        verdict: str,
        effects: Sequence[dict[str, Any]],
        baseline: dict[str, float],
        augmented: dict[str, Any],
        left: str,
        rotated: bool,
    ) -> str:
        floor, number = self._torque(self.noise.floor), self._torque
        if verdict == "consistent":
            return (
                f"After recalibration the published model explains the recording: held-out error "
                f"{number(baseline['heldout_rmse_Nm'])} at a noise floor of {floor}. No missing physics is needed; "
                "see detection_limits for what could have gone unseen."
            )
        if verdict == "unlisted_physics":
            return (
                f"The recalibrated model leaves {number(baseline['heldout_rmse_Nm'])} on held-out data at a noise floor of {floor}, and no "
                f"entry of the catalogue explains it: {left}. The physics is unlisted; see unexplained for where it lives."
            )
        names = " and ".join(self._title(effect["id"]).lower() + f" ({effect['id']})" for effect in effects)
        ties = [
            f"{effect['id']} cannot be told from {', '.join(effect['indistinguishable_from'])}"
            for effect in effects
            if effect["indistinguishable_from"]
        ]
        return (
            f"The model leaves out {names}. With {'it' if len(effects) == 1 else 'them'} the held-out error falls "
            f"from {number(baseline['heldout_rmse_Nm'])} to {number(augmented['heldout_rmse_Nm'])} "
            f"(improvement {100 * augmented['improvement']:.0f} %, 95 % interval "
            f"{100 * augmented['improvement_ci95'][0]:.0f} to {100 * augmented['improvement_ci95'][1]:.0f} %) at a noise floor of {floor}."
            + (" Each third of the data was held out in turn, since one alone hardly shows it." if rotated else "")
            + (f" With these data {'; '.join(ties)}." if ties else "")
            + (f" Structure is left: {left}." if left else "")
        )


def _findings(qualities: Sequence[Quality]) -> list[dict[str, Any]]:
    return [_entry(finding, quality.recording.name) for quality in qualities for finding in quality.findings]


def _entry(f: Finding, bag: str) -> dict[str, Any]:
    return {
        "finding": f.finding, "topic": f.topic, "bag": bag,
        "intervals_s": [list(span) for span in f.intervals_s], "statement": f.statement,
    }  # fmt: skip


def _insufficient(
    qualities: Sequence[Quality],
    vehicle: Vehicle,
    findings: list[dict[str, Any]],
    statement: str,
    advice: dict[str, Any] | None,
) -> Diagnosis:
    """The verdict when nothing can be concluded: the vehicle stays as it was."""
    floor = 1.0
    if vehicle.hydraulics is not None:
        floor = max(1.0, vehicle.sensors.pressure_noise_Pa * 5e-3)
    fit_entry: dict[str, Any] = {"rmse_Nm": 0.0, "heldout_rmse_Nm": None}
    json = {
        "schema": SCHEMA, "bags": [quality.recording.name for quality in qualities], "verdict": "insufficient_data",
        "statement": statement, "noise_floor_Nm": floor, "baseline": fit_entry,
        "augmented": {**fit_entry, "improvement": None, "improvement_ci95": None}, "effects": [],
        "unexplained": {"structured": False, "description": "not examined", "formula": None, "where": None},
        "detection_limits": {}, "data_quality": findings, "next_experiment": advice,
    }  # fmt: skip
    return Diagnosis(units.in_words(vehicle, finite(json)), vehicle)


__all__ = ["Run", "diagnose", "diagnose_recordings"]
