# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Fingerprints: the trace each effect would leave, after everything that recalibration can imitate has been taken out.

Frisch-Waugh-Lovell: a signature projected off the tangent space of the calibration keeps exactly the part that can be seen;
the rest is masked. The residual is compared with that part only.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy import stats

from lugre_steering.effects.entry import Effect, Seen, Variant
from lugre_steering.effects.registry import CATALOGUE, ORIGINS, sought
from lugre_steering.errors import EffectError
from lugre_steering.fitting import onset
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Candidate, Problem, Values, in_threads, is_rig, resized
from lugre_steering.recording import Array
from lugre_steering.vehicle import Vehicle

FAR = 0.05
"""What sine and cosine of the angles must leave of a constant, root mean square, for gravity to be something else than one."""
LATE = (0.3, 0.45, 0.6)
"""Shares of the longest recording at which an effect that begins late is tried."""


@dataclass(frozen=True)
class Score:
    """A candidate against a residual: energy it explains, share of the residual's energy, masked share, linear values.

    ``explained`` and ``null_explained`` are in units of the noise variance; ``coefficients`` multiply the parameter scales;
    ``visible`` is the energy that the signature at its scale would show.
    """

    candidate: Candidate
    explained: float
    share: float
    masked_share: float
    visible: float
    coefficients: tuple[float, ...]
    null_explained: Array
    trials: int = 1

    @property
    def p_value(self) -> float:
        """Chance that noise alone explains as much, for the best of all tried variants of this effect.

        A gamma distribution with the mean and variance of the null draws (a scaled chi-square under coloured noise).
        """
        mean, variance = float(np.mean(self.null_explained)), float(np.var(self.null_explained, ddof=1))
        shape = min(mean**2 / max(variance, 1e-12), 0.5 * max(len(self.candidate.free), 1))
        single = float(stats.gamma.sf(self.explained, shape, scale=max(mean, 1e-12) / shape))
        return min(1.0, max(single * self.trials, 1e-300))

    @property
    def values(self) -> dict[str, float]:
        """Starting values for the non-linear fit."""
        free = {
            name: c * self.candidate.parameter(name).scale
            for name, c in zip(self.candidate.free, self.coefficients, strict=True)
        }
        return {**dict(self.candidate.shapes), **free}


def possible(vehicle: Vehicle, effect: Effect) -> bool:
    """Whether a machine can have it: all that the effect needs is there, and a single joint has words for it."""
    if not sought(effect):
        return False
    if is_rig(vehicle) and effect.id not in ORIGINS and not effect.joint_title:
        return False
    if (effect.of_line if vehicle.coordinate.unit == "rad" else effect.of_angle):
        return False
    return all(getattr(vehicle, section) is not None for section in effect.needs)


def candidates(problem: Problem, without: Sequence[str] = ()) -> list[Candidate]:
    """Every variant of every observable effect for this data set: shapes over their grids, one per line where that matters."""
    found: list[Candidate] = []
    joint, far = is_rig(problem.vehicle), _turns_far(problem)
    for effect in CATALOGUE.values():
        if not effect.observable or effect.id in without or not possible(problem.vehicle, effect):
            continue
        effect = resized(_shown(effect, joint, far), problem.size)
        free = tuple(p.name for p in effect.parameters if not p.is_shape and not p.optional)
        if effect.variants is not None:
            for shapes in _suggested(effect, effect.variants, _seen(problem)):
                ends = {name for pair in effect.places for name in pair}
                unset = tuple(name for name in free if name not in shapes and name not in ends)
                found.append(Candidate(effect, tuple(shapes.items()), free=unset))
        elif effect.per_line:
            lines = problem.vehicle.hydraulics.lines if problem.vehicle.hydraulics is not None else ()
            found += [Candidate(effect, (), line, free=free) for line in lines]
        else:
            grids = [
                [(p.name, value * _unit(problem, p.relative_to)) for value in p.grid]
                for p in effect.parameters
                if p.is_shape
            ]
            found += [Candidate(effect, shapes, free=free) for shapes in itertools.product(*grids)]
    return found


def _turns_far(problem: Problem) -> bool:
    """Whether a joint turns so far that the sine and the cosine of its angle do not make up for a constant."""
    if not is_rig(problem.vehicle) or problem.vehicle.coordinate.unit != "rad":
        return False
    theta = np.concatenate([run.theta[0] for run in problem.runs])
    both = np.column_stack([np.sin(theta), np.cos(theta)])
    rest = 1.0 - both @ np.linalg.lstsq(both, np.ones(theta.size), rcond=None)[0]
    return bool(np.sqrt(np.mean(rest**2)) > FAR)


@cache  # candidates are compared by their entries
def _shown(effect: Effect, joint: bool, far: bool) -> Effect:
    """An entry without what only joints, or joints that turn far, show."""
    if (joint or not any(p.signed_on_joints for p in effect.parameters)) and (far or not any(p.far_turning for p in effect.parameters)):
        return effect
    kept = [p for p in effect.parameters if far or not p.far_turning]
    gone = {p.name for p in effect.parameters} - {p.name for p in kept}
    bound = (replace(p, low=0.0) if p.signed_on_joints and not joint else p for p in kept)
    return replace(effect, parameters=tuple(bound), acts_by=tuple(name for name in effect.acts_by if name not in gone))


def _suggested(effect: Effect, variants: Callable[[Seen], Sequence[Variant]], seen: Seen) -> list[Variant]:
    """The shapes that an effect chooses for itself, checked: users write such functions too."""
    try:
        found: list[Variant] = [{name: float(value) for name, value in shapes.items()} for shapes in variants(seen)]
    except Exception as error:  # whatever a user's own Python raises
        raise EffectError(f"effect '{effect.id}': variants: {type(error).__name__}: {error}; expected values by parameter") from error
    own = {p.name for p in effect.parameters}
    if foreign := sorted({str(name) for shapes in found for name in shapes if name not in own}):
        raise EffectError(f"effect '{effect.id}': variants: got {', '.join(foreign)}, expected parameters of it ({', '.join(sorted(own))})")
    return found


def _unit(problem: Problem, relative_to: str) -> float:
    if relative_to == "max_angle":
        return max(float(np.max(np.abs(run.theta))) for run in problem.runs)
    if relative_to == "slip":
        return max(float(np.sum(np.abs(np.diff(run.theta[0])))) for run in problem.runs)
    if relative_to == "duration":
        return max(float(run.time[-1]) for run in problem.runs)
    return 1.0


def _seen(problem: Problem) -> Seen:
    return Seen(
        theta=np.concatenate([run.theta.mean(axis=0) for run in problem.runs]),
        lowest=min(float(run.theta.min()) for run in problem.runs),
        highest=max(float(run.theta.max()) for run in problem.runs),
        longest=max(float(run.time[-1]) for run in problem.runs),
        gains=np.concatenate([run.torque_per_line for run in problem.runs], axis=1),
        torque=problem.measured,
    )


def signature(problem: Problem, fit: Fit, base: Sequence[Array], candidate: Candidate, first: float | None = None) -> Array:
    """Change of the prediction (n, k), one column per free parameter at its scale (or the whole effect if none is free).

    ``first``: size of the first free parameter, which then alone is varied.
    """
    shapes = dict(candidate.shapes)
    sizes = {name: candidate.parameter(name).scale for name in candidate.free}
    if first is not None:
        sizes = {candidate.free[0]: first}
    trials: list[Values] = [
        {**dict.fromkeys(candidate.free, 0.0), **shapes, name: size} for name, size in sizes.items()
    ] or [shapes]
    columns = np.zeros((problem.measured.size, len(trials)))
    for bag in range(len(problem.runs)):
        if candidate.active_in(bag):
            part = slice(problem.edges[bag], problem.edges[bag + 1])
            for k, values in enumerate(trials):
                columns[part, k] = problem.predict(bag, fit.x, [*fit.effects, (candidate, values)]) - base[bag]
    return columns


def screen(
    problem: Problem, fit: Fit, weight: Array, draws: Array, without: Sequence[str] = (), among: Sequence[Candidate] | None = None
) -> list[Score]:
    """Every candidate (or those ``among``) against the residual of ``fit``, best first; ``draws`` (m, n) are residuals that hide nothing.

    ``weight`` (n,) is 1 / sigma, zero where samples are withheld.
    """
    basis = fit.tangent()
    below = np.vstack([-fit.pulled, np.zeros((len(draws), fit.pulled.size))])
    residuals = np.hstack([np.vstack([problem.measured - fit.prediction, draws]) * weight, below])
    residuals = residuals - (residuals @ basis) @ basis.T
    base = [problem.predict(bag, fit.x, fit.effects) for bag in range(len(problem.runs))]
    energy = float(residuals[0] @ residuals[0])
    longest = max(float(run.time[-1]) for run in problem.runs)
    starts = [*((share * longest,) * len(problem.runs) for share in LATE), onset.suggested(problem, residuals[0, : weight.size])]
    begun = [np.concatenate([run.time >= s for run, s in zip(problem.runs, start, strict=True)]) for start in starts]

    def score(candidate: Candidate) -> list[Score]:
        columns = signature(problem, fit, base, candidate) * weight[:, None]
        full = score_columns(candidate, columns, basis, residuals, energy)
        found = [full] if full is not None else []
        if candidate.bags is None and len(problem.runs) > 1:
            for bag in range(len(problem.runs)):
                alone = replace(candidate, bags=(bag,))
                part = score_columns(alone, columns * (problem.bag == bag)[:, None], basis, residuals, energy)
                found += [part] if part is not None else []
        if candidate.bags is None and not candidate.effect.never_late:
            for start, after in zip(starts, begun, strict=True):
                late = replace(candidate, since=start)
                if candidate.effect.counts_from_start:
                    changed = signature(problem, fit, base, late) * weight[:, None]
                else:
                    changed = columns * after[:, None]
                part = score_columns(late, changed, basis, residuals, energy)
                found += [part] if part is not None else []
        return found

    scores = list(itertools.chain.from_iterable(in_threads(score, candidates(problem, without) if among is None else among)))
    trials: dict[str, int] = {}
    for item in scores:
        trials[item.candidate.effect.id] = trials.get(item.candidate.effect.id, 0) + 1
    scores = [replace(item, trials=trials[item.candidate.effect.id]) for item in scores]
    return sorted(scores, key=lambda item: -item.explained)


def score_columns(candidate: Candidate, columns: Array, basis: Array, residuals: Array, energy: float) -> Score | None:
    """Projection of the residual (first row) and the null draws (other rows) on what of a signature is not masked.

    ``basis`` (n + q, k) and ``residuals`` (m, n + q) have the errors of q priors below those of n samples.

    Columns whose parameter would leave its allowed sign explain nothing, since no such physics exists.
    """
    total = float(np.sum(columns**2))
    if total < 1e-12:
        return None
    columns = np.vstack([columns, np.zeros((basis.shape[0] - columns.shape[0], columns.shape[1]))])
    visible = columns - basis @ (basis.T @ columns)
    seen = float(np.sum(visible**2))
    nothing = None
    active = [k for k in range(columns.shape[1]) if np.sum(visible[:, k] ** 2) > 1e-10 * max(total, 1e-30)]
    while active:
        q, r = np.linalg.qr(visible[:, active])
        if abs(r[-1, -1]) < 1e-6 * abs(r[0, 0]):
            active.pop()
            continue
        along = residuals @ q
        coefficients = np.linalg.solve(r, along[0])
        wrong = [
            k for k, c in zip(active, coefficients, strict=True)
            if (candidate.free and c < 0.0 <= candidate.parameter(candidate.free[k]).low) or (not candidate.free and c < 0.3)
        ]  # fmt: skip
        values = np.zeros(len(candidate.free))
        if candidate.free:
            values[active] = coefficients
        explained = float(along[0] @ along[0])
        found = Score(
            candidate, explained, explained / max(energy, 1e-30), 1.0 - seen / total, seen,
            tuple(float(v) for v in values), np.sum(along[1:] ** 2, axis=1),
        )  # fmt: skip
        if not wrong:
            return found
        nothing = replace(found, explained=0.0, share=0.0, coefficients=(0.0,) * len(candidate.free))
        active = [k for k in active if k not in wrong]
    return nothing
