# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The verdict in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lugre_steering.diagnosis.conclude.finished import Finished
from lugre_steering.effects.registry import CATALOGUE


def at_end(effect: Mapping[str, Any]) -> list[tuple[str, float, str]]:
    """Name, value and unit of the amplitudes of a named effect that were fitted to an end of their range other than zero."""
    entry = CATALOGUE[effect["id"]]
    amplitudes = {parameter.name: (parameter.low, parameter.high) for parameter in entry.parameters if not parameter.is_shape}
    alone = next(iter(amplitudes.values()), ())  # one that acts on a line goes by the name of the line
    return [
        (name, found["value"], found["unit"])
        for name, found in effect["parameters"].items()
        if any(end and math.isclose(found["value"], end, rel_tol=1e-6) for end in (alone if entry.per_line else amplitudes.get(name, ())))
    ]


def statement(
    done: Finished, verdict: str, effects: Sequence[Mapping[str, Any]], baseline: Mapping[str, float],
    augmented: Mapping[str, Any], left: str, rotated: bool, ended: Sequence[str],
) -> str:
    """The verdict for a reader who sees nothing else; ``left``: what remains, ``rotated``: see ``verify.Verdict``,
    ``ended``: effects that do not act in the last bag."""
    floor, torque = done.torque(done.noise.floor), done.torque
    if verdict == "consistent":
        return (
            f"After recalibration the published model explains the recording: held-out error "
            f"{torque(baseline['heldout_rmse_Nm'])} at a noise floor of {floor}. No missing physics is needed; "
            "see detection_limits for what could have gone unseen."
        )
    if verdict == "unlisted_physics" and augmented["improvement"] > 0.0:
        return (
            f"No entry of the catalogue explains what the recalibrated model leaves over, but {left}. With the law the held-out error "
            f"falls from {torque(baseline['heldout_rmse_Nm'])} to {torque(augmented['heldout_rmse_Nm'])} (improvement "
            f"{100 * augmented['improvement']:.0f} %, 95 % interval {100 * augmented['improvement_ci95'][0]:.0f} to "
            f"{100 * augmented['improvement_ci95'][1]:.0f} %) at a noise floor of {floor}. augmented.yaml has it under 'laws'."
        )
    if verdict == "unlisted_physics":
        return (
            f"The recalibrated model leaves {torque(baseline['heldout_rmse_Nm'])} on held-out data at a noise floor of {floor}, and no "
            f"entry of the catalogue explains it: {left}. The physics is unlisted; see unexplained for where it lives."
        )
    names = " and ".join(f"{done.title(effect['id']).lower()} ({effect['id']})" for effect in effects)
    ties = [
        f"{effect['id']} cannot be told from {', '.join(effect['indistinguishable_from'])}"
        for effect in effects
        if effect["indistinguishable_from"]
    ]
    ends = [f"{effect['id']} with {name} = {value:.3g} {unit}" for effect in effects for name, value, unit in at_end(effect)]
    last = done.problem.runs[-1].name
    return (
        f"The model leaves out {names}. With {'it' if len(effects) == 1 else 'them'} the held-out error falls "
        f"from {torque(baseline['heldout_rmse_Nm'])} to {torque(augmented['heldout_rmse_Nm'])} "
        f"(improvement {100 * augmented['improvement']:.0f} %, 95 % interval "
        f"{100 * augmented['improvement_ci95'][0]:.0f} to {100 * augmented['improvement_ci95'][1]:.0f} %) at a noise floor of {floor}."
        + (" Each third of the data was held out in turn, since one alone hardly shows it." if rotated else "")
        + (f" With these data {'; '.join(ties)}." if ties else "")
        + (f" At the end of the range that is searched: {', '.join(ends)}; the cause may be more than that, or another." if ends else "")
        + (f" {' and '.join(ended)} does not act in {last}, the last recording: augmented.yaml is without." if ended else "")
        + (f" Structure is left: {left}." if left else "")
    )
