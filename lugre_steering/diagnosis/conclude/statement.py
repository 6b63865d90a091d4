# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The verdict in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lugre_steering.diagnosis.conclude.finished import Finished
from lugre_steering.diagnosis.conclude.verify import Judged
from lugre_steering.diagnosis.result import NamedEffect, Verdict
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fitting.problem import STATIC, resized
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
        c.name.replace("_", " ")
        for c, value, least, most in zip(problem.calibrations, x, low, high, strict=False)
        # Static friction that is no more than the sliding one is nothing to wonder at.
        if min(np.inf if c.name == STATIC.name else value - least, most - value) < 1e-6 * (most - least)
    ]


def statement(
    done: Finished, verdict: Verdict, effects: Sequence[NamedEffect], judged: Judged, causal: float, left: str,
    ended: Sequence[str], lawful: bool,
) -> str:
    """The verdict for a reader who sees nothing else; ``judged``: on held-out data, ``causal``: error [N m] without
    looking ahead, ``left``: what remains,
    ``ended``: effects that do not act in the last bag, ``lawful``: a law was found for it."""
    floor, torque = done.torque(done.noise.floor), done.torque
    if verdict == "consistent":
        return (
            f"After recalibration the published model explains the recording: held-out error "
            f"{torque(judged.before)} at a noise floor of {floor}. No missing physics is needed; "
            "see detection_limits for what could have gone unseen."
        )
    if verdict == "unlisted_physics" and lawful:
        return (
            f"No entry of the catalogue explains what the recalibrated model leaves over, but {left}. With the law the held-out error "
            f"falls from {torque(judged.before)} to {torque(judged.after)} (improvement {100 * judged.gain:.0f} %, 95 % interval "
            f"{100 * judged.interval[0]:.0f} to {100 * judged.interval[1]:.0f} %) at a noise floor of {floor}. augmented.yaml has it "
            "under 'laws'."
        )
    if verdict == "unlisted_physics":
        return (
            f"The recalibrated model leaves {torque(judged.before)} on held-out data at a noise floor of {floor}, and no "
            f"entry of the catalogue explains it: {left}. The physics is unlisted; see unexplained for where it lives."
        )
    names = " and ".join(f"{done.title(effect.id).lower()} ({effect.id})" for effect in effects)
    ties = [
        f"{effect.id} cannot be told from {', '.join(effect.indistinguishable_from)}"
        for effect in effects
        if effect.indistinguishable_from
    ]
    ends = [
        f"{effect.id} with {name} = {value:.3g} {unit}"
        for effect in effects
        for name, value, unit in at_end(effect, done.problem.size)
    ]
    last = done.problem.runs[-1].name
    bounds = calibrations_at_bounds(done)
    return (
        f"The model leaves out {names}. With {'it' if len(effects) == 1 else 'them'} the held-out error falls "
        f"from {torque(judged.before)} to {torque(judged.after)} "
        f"(improvement {100 * judged.gain:.0f} %, 95 % interval "
        f"{100 * judged.interval[0]:.0f} to {100 * judged.interval[1]:.0f} %) at a noise floor of {floor}. "
        f"Without looking ahead, as the live node must, the error on all samples is {torque(causal)}."
        + (" Each third of the data was held out in turn, since one alone hardly shows it." if judged.rotated else "")
        + (f" With these data {'; '.join(ties)}." if ties else "")
        + (f" At the end of the range that is searched: {', '.join(ends)}; the cause may be more than that, or another." if ends else "")
        + (f" Recalibrated as far as is allowed, so perhaps another machine or another law: {', '.join(bounds)}." if bounds else "")
        + (f" {' and '.join(ended)} does not act in {last}, the last recording: augmented.yaml is without." if ended else "")
        + (f" Structure is left: {left}." if left else "")
    )
