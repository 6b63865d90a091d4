# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The verdict in words: first for an engineer, then what speaks for it and what limits it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lugre_steering.diagnosis.conclude import headline
from lugre_steering.diagnosis.conclude.left_over import LeftOver
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.result import AUGMENTED, Experiment, FrictionForm, NamedEffect, Verdict
from lugre_steering.diagnosis.verify import Judged
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fitting.problem import STATIC, resized
from lugre_steering.report import words
from lugre_steering.vehicle.size import VEHICLE, Size


def at_end(effect: NamedEffect, size: Size = VEHICLE) -> list[tuple[str, float, str]]:
    """Name, value and unit of the amplitudes of a named effect that were fitted to an end of their range other than zero."""
    entry = resized(CATALOGUE[effect.id], size)
    amplitudes = {parameter.name: (parameter.low, parameter.high) for parameter in entry.parameters if not parameter.is_shape}
    alone = next(iter(amplitudes.values()), ())  # one that acts on a line goes by the name of the line
    return [
        (name, found.value, found.unit)
        for name, found in effect.parameters.items()
        if found.value is not None
        and any(end and math.isclose(found.value, end, rel_tol=1e-6) for end in (alone if entry.per_line else amplitudes.get(name, ())))
    ]


def calibrations_at_bounds(done: Finished) -> list[str]:
    """Baseline values that recalibration left at an end of their range, in words."""
    problem, x = done.problem, done.found.final.x
    low, high = problem.bounds()
    return [
        words.named(c.name)
        for c, value, least, most in zip(problem.calibrations, x, low, high, strict=False)
        # Static friction that is no more than the sliding one is nothing to wonder at.
        if min(np.inf if c.name == STATIC.name else value - least, most - value) < 1e-6 * (most - least)
    ]


def statement(
    done: Finished, verdict: Verdict, effects: Sequence[NamedEffect], judged: Judged, causal: float, form: FrictionForm | None,
    left: LeftOver, ended: Sequence[str], law: str, nearest: Sequence[str], advice: Experiment | None,
) -> tuple[str, str]:
    """Headline and statistics, for a reader who sees nothing else; ``judged``: on held-out data, ``causal``: error [N m] without
    looking ahead, ``form``: of the friction as laws, ``left``: what remains, ``ended``: effects that do not act in the last bag,
    ``law``: the one found for it, if any, ``nearest``: names in whose place it stands, ``advice``: the next experiment."""
    floor = f"Noise alone makes {done.torque(done.noise.floor)}."
    if verdict == "consistent":
        unseen = "From what size on an effect would have shown: detection_limits of diagnosis.json."
        return headline.consistent(done, judged.before, left.entry), " ".join([*_formed(done, form), floor, unseen])
    if verdict == "unlisted_physics":
        if law:
            rest = f"{left.text[:1].upper()}{left.text[1:]}."
            with_ = "the law" + _and_form(form)
            return headline.lawful(law, nearest), " ".join([_gain(done, judged, with_), floor, rest, *_formed(done, form)])
        lives = "Where it lives: unexplained in diagnosis.json."
        return headline.unlisted(done, judged.before, left.text), " ".join([*_formed(done, form), floor, lives])
    told = headline.missing(done, effects, law, advice, not ended)
    them = "it" if len(effects) == 1 and not law else "them"
    them += _and_form(form)
    remarks = _remarks(done, effects, judged, causal, left, ended, law)
    return told, " ".join([_gain(done, judged, them), floor, *remarks, *_formed(done, form)])


def _and_form(form: FrictionForm | None) -> str:
    return " and the form of this friction" if form is not None else ""


def _formed(done: Finished, form: FrictionForm | None) -> list[str]:
    """What the form of the friction is worth, in a sentence."""
    if form is None or form.heldout_rmse_Nm is None or form.improvement is None:
        return []
    less = f"{done.torque(form.heldout_rmse_Nm)} of the held-out data, {words.percent(form.improvement)} less"
    if form.file == AUGMENTED:
        return [f"The form of this friction is in augmented.yaml as laws; it leaves {less} than without it."]
    return [f"The file {form.file} is the same with the form of this friction as laws: it leaves {less}."]


def _gain(done: Finished, judged: Judged, with_: str) -> str:
    return (
        f"With {with_} the held-out error falls from {done.torque(judged.before)} to {done.torque(judged.after)} (improvement "
        f"{100 * judged.gain:.0f} %, 95 % interval {words.percents(*judged.interval)})."
    )


def _remarks(
    done: Finished, effects: Sequence[NamedEffect], judged: Judged, causal: float, left: LeftOver, ended: Sequence[str], law: str
) -> list[str]:
    """What limits named effects, one sentence each."""

    def inside(name: str) -> str:
        return headline.inside(done.title(name))

    remarks = [f"Without looking ahead, as the live node must, the error on all samples is {done.torque(causal)}."]
    if judged.rotated:
        remarks.append("Each third of the data was held out in turn, since one alone hardly shows it.")
    ties = [
        f"{inside(effect.id)} cannot be told from {' or '.join(map(inside, effect.indistinguishable_from))}"
        for effect in effects
        if effect.indistinguishable_from
    ]
    if ties:
        remarks.append(f"With these data {'; '.join(ties)}.")
    size = done.problem.size
    ends = [
        f"{inside(effect.id)} with {name.replace('_', ' ')} = {words.quantity(value, unit)}"
        for effect in effects
        for name, value, unit in at_end(effect, size)
    ]
    if ends:
        remarks.append(f"At the end of the range that is searched: {', '.join(ends)}; the cause may be more than that, or another.")
    if bounds := calibrations_at_bounds(done):
        remarks.append(f"Recalibrated as far as is allowed, so perhaps another machine or another law: {', '.join(bounds)}.")
    if ended:
        verb = "does" if len(ended) == 1 else "do"
        last = done.problem.runs[-1].name
        who = headline.sentence(" and ".join(map(inside, ended))).removesuffix(".")
        remarks.append(f"{who} {verb} not act in {last}, the last recording: augmented.yaml is without.")
    if left.structured:
        remarks.append(headline.sentence(left.text) if law else f"Structure is left: {left.text}.")
    elif done.needs_form:
        remarks.append(headline.sentence(left.entry.description))
    return remarks
