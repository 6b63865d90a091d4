# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What remains after the final fit: whether it is structure worth a verdict, and where it lives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lugre_steering import units
from lugre_steering.diagnosis.conclude.headline import inside
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.loudness import beyond_calibration, excess, loudness
from lugre_steering.diagnosis.result import Place, Unexplained
from lugre_steering.diagnosis.search import locate
from lugre_steering.diagnosis.search.search import BENT
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.recording import Array
from lugre_steering.report import words

MOSTLY = 0.3
"""Share of the largest from which a freedom of the friction law is told."""
LOCATED_S, LOCATED_SIGMA, LOCATED_SHARE = 0.5, 2.0, 0.2
"""Unlisted structure is located where its level over so many seconds exceeds both: noise levels, and a share of its peak."""


class LeftOver(NamedTuple):
    """The contract's entry, the same in one sentence, and whether it is structure worth a verdict."""

    entry: Unexplained
    text: str
    structured: bool


def left_over(done: Finished, final: Fit, needs_form: bool = False) -> LeftOver:
    """Judge what ``final`` leaves of the measured torque; ``needs_form``: there is more than noise without the freedoms beside it."""
    residual = done.problem.measured - final.prediction
    excess, slow, loud = loudness(done.problem, done.noise, final)
    if not loud:
        description = "what is left is within noise and the simulation's own error"
        instead = tuple(trial.candidate.effect.id for trial in done.found.instead)
        alone = " or ".join(inside(done.title(name)) for name in instead)
        if needs_form:
            form = _form(done, final)
            other = f"friction of another form than the model's does, mostly {form}" if form else "the named laws do when bent a little"
            description = f"what is left beyond noise is within what {other}"
            if instead:
                description += f"; {alone} alone would do as much"
        elif instead:
            description += f"; {alone} would explain a part of it, and friction of another form than the model's as well"
        return LeftOver(Unexplained(False, description, indistinguishable_from=instead), "", False)
    if not final.effects:
        # A least-squares fit spreads what it cannot explain over the whole record; a robust one leaves it in its place.
        sound = fit(done.problem, done.fitted, (), final.x, robust=True, linearisations=25)
        residual = done.problem.measured - sound.prediction
    axes = [locate.coordinates(run, run.measured) for run in done.problem.runs]
    stacked = {key: np.concatenate([bag[key] for bag in axes]) for key in axes[0]}
    axis, share, _ = locate.telling_coordinate(stacked, residual, done.weight, done.noise.draws)
    more = max(excess, slow)  # the level of the noise may be overstated
    text = (
        f"{words.percent(more / (1.0 + more))} of what the model leaves over is more than noise, most of it along {axis} "
        f"({words.percent(share)} of the residual energy follows it)"
    )
    where = _where(done, axes, axis, residual)
    return LeftOver(Unexplained(True, text, None, tuple(where)), text, True)


def only_nearest(done: Finished, left: LeftOver) -> bool:
    """Whether names leave so much structure beside all freedoms that their laws would have to bend by more than laws may. Of a single
    joint or axis, which is compared without freedoms, it is not known."""
    there, found = done.compared, done.compared.found
    rest = excess(there.problem, found.final, there.fitted)
    return left.structured and bool(there.freedoms) and rest > BENT**2 * (excess(there.problem, found.baseline, there.fitted) - rest)


def _form(done: Finished, final: Fit) -> str:
    """Which freedoms of the friction law do most of what they do, in words; empty where names alone are free."""
    problem = done.problem
    parts = problem.bends * final.x[problem.first_bend : problem.nuisances]
    energy = {
        words: beyond_calibration(problem, final, parts[:, [own == words for own in done.form]].sum(axis=1))
        for words in dict.fromkeys(done.form) if words
    }
    most = max(energy.values(), default=0.0)
    return " and ".join(words for words in sorted(energy, key=lambda words: -energy[words]) if energy[words] > MOSTLY * most)


def beside_laws(done: Finished, before: LeftOver, fitted: Fit, names: int, law: str, formula: str) -> LeftOver:
    """Unlisted structure ``before`` once laws are found for it, after ``names`` effects of the fit, said in ``law`` and ``formula``; where
    nothing told of it, they say where it lives."""
    after, where = left_over(done, fitted), before.entry.where
    rest = f"beside the law, {after.text or after.entry.description}"
    if not before.structured:
        axes = [locate.coordinates(run, run.measured) for run in done.problem.runs]
        shape: Array = np.sum([locate.contribution(done.problem, fitted, i) for i in range(names, len(fitted.effects))], axis=0)
        stacked = {key: np.concatenate([bag[key] for bag in axes]) for key in axes[0]}
        axis, _, _ = locate.telling_coordinate(stacked, shape, done.weight, done.noise.draws)
        where = tuple(_where(done, axes, axis, shape, noisy=False))
    return LeftOver(Unexplained(True, f"{law}; {rest}", formula, where), rest, True)


def _where(
    done: Finished, axes: Sequence[Mapping[str, Array]], axis: str, torque: Array, *, noisy: bool = True
) -> list[Place]:
    """Stretches and range of ``axis`` that hold a torque (n,): where a ``noisy`` one, a residual, is loud, else where it acts."""
    problem = done.problem
    entries = []
    for bag, (run, values) in enumerate(zip(problem.runs, axes, strict=True)):
        part = slice(problem.edges[bag], problem.edges[bag + 1])
        if noisy:
            width = int(np.clip(round(LOCATED_S / (run.time[1] - run.time[0])), 1, run.time.size))
            smooth = np.sqrt(np.convolve((torque[part] * done.weight[part]) ** 2, np.ones(width) / width, mode="same"))
            limit = max(LOCATED_SIGMA, LOCATED_SHARE * float(np.percentile(smooth, 99.5)))
            spans = locate.intervals(run.time, np.where(smooth > limit, smooth, 0.0))
            piece = torque[part] * (smooth > limit)
        else:
            spans, piece = locate.intervals(run.time, torque[part]), torque[part]
        if spans:
            between = locate.active_range(values[axis], piece)
            entries.append(Place(run.name, tuple(spans), axis, between, done.unit(units.COORDINATE_UNITS[axis])))
    return entries
