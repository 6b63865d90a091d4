# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle has been through, as plain data that outlive the process, and handed from one estimator to another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lugre_steering.chain.compose import Composition
from lugre_steering.chain.step import Records
from lugre_steering.errors import DataError
from lugre_steering.estimator.layout import Core, records_of

Memory = Mapping[str, Any]
"""Per side ``stamp_ns`` and ``angle`` [rad] of its last sample, the fastest rate [rad/s] that it has shown, whether its bristle is
not known after unseen motion, the records ``state`` and ``motion``; JSON can hold it."""

_STATES = ("state", "shadow", "earlier", "bounds")
_HANDED_OVER = (
    "motion", "trust", "guard", "output", "waiting", "pending", "line_ns", "line_value", "plan_ns", "plan_theta", "released",
)  # fmt: skip
_ONGOING = (
    "start_ns", "start_known", "start_residual", "start_residual_ns", "start_share", "begin_ns", "lagged", "lag_input",
    "lagged_ns", "pending_first", "pending_count", "plan_size", "plan_refused_ns", "swing_ns", "swing_from", "residual_ns", "agreed_ns",
    "residual_square", "measured_square", "estimate_square", "residual_now", "measured_now", "estimate_now", "residual_slow", "beyond",
    "released_ns", "weight", "message",
)  # fmt: skip


def remembered(core: Core, composition: Composition, sides: Sequence[str]) -> Memory:
    """The memory of each side that has begun, after its clock was set back anew; of one in doubt, the state that is trusted."""
    table: dict[str, Any] = {}
    states, shadows = (records_of(rows, composition.state) for rows in (core.state, core.shadow))
    for i, side in enumerate(sides):
        channel, guard = core.channels[i], core.guard[i]
        if states[i]["started"] == 0.0 or channel["last_ns"] == 0:
            continue
        doubted = guard["shadow_ns"] != 0
        stamp_ns, angle = (guard["shadow_ns"], guard["shadow_angle"]) if doubted else (channel["last_ns"], channel["last_value"])
        state = shadows[i] if doubted else states[i]
        unseen = guard["shadow_unseen"] if doubted else guard["unseen_ns"] != 0
        table[side] = {
            "stamp_ns": int(stamp_ns), "angle": float(angle), "fastest": float(guard["fastest"]), "unseen": bool(unseen),
            "state": _plain(state), "motion": _plain(core.motion[i]),
        }  # fmt: skip
    return {"start_ns": int(core.config[0]["start_ns"]), "sides": table}


def recall(core: Core, composition: Composition, sides: Sequence[str], memory: Memory) -> None:
    """Go on from there: the next sample of a side finds it as long ago as its stamp says, cooled and turned meanwhile.

    ``DataError``, and nothing changed, if the memory is not of this model.
    """
    states = records_of(core.state, composition.state)
    try:
        rows = [(i, memory["sides"][side]) for i, side in enumerate(sides) if side in memory["sides"]]
        records = [(_record(states, row["state"]), _record(core.motion, row["motion"])) for _, row in rows]
        last = [(int(row["stamp_ns"]), float(row["angle"]), float(row["fastest"]), bool(row["unseen"])) for _, row in rows]
        start_ns = int(memory["start_ns"])
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise DataError(f"it is not the memory of this model ({error})") from error
    core.config["start_ns"], core.config["start_known"] = start_ns, True
    parameters, bounds = records_of(core.parameters, composition.parameters), records_of(core.bounds, composition.state)
    for (i, _), (state, motion), (stamp_ns, angle, fastest, unseen) in zip(rows, records, last, strict=True):
        states[i], core.motion[i] = state, motion
        core.guard[i]["fastest"] = fastest
        core.guard[i]["still_ns"] = stamp_ns
        if unseen:
            core.guard[i]["unseen_ns"] = stamp_ns
            bounds[2 * i : 2 * i + 2] = state
            length = max(parameters[i]["static_torque"], parameters[i]["coulomb_torque"]) / parameters[i]["sigma_0"]
            bounds["z"][2 * i : 2 * i + 2] = length, -length
        core.channels[i]["last_ns"], core.channels[i]["last_value"] = stamp_ns, angle


def hand_over(old: Core, old_composition: Composition, new: Core, composition: Composition) -> None:
    """Everything that samples have made of the old core, into one of the same channels and another model."""
    for name in _HANDED_OVER:
        getattr(new, name)[...] = getattr(old, name)
    new.channels[...] = old.channels
    parameters = records_of(new.parameters, composition.parameters)
    known = old_composition.state.names or ()
    for name in _STATES:
        source, target = records_of(getattr(old, name), old_composition.state), records_of(getattr(new, name), composition.state)
        for field in composition.state.names or ():
            if field in known:
                target[field] = source[field]
            elif field in composition.starts:  # physics that is new begins as at the start of a recording
                start = composition.starts[field]
                # Of bounds there are two for each side.
                target[field] = np.repeat(parameters[start], target.size // parameters.size) if isinstance(start, str) else start
    for field in _ONGOING:
        new.config[field] = old.config[field]


def _plain(record: Records) -> dict[str, Any]:
    return {name: record[name].tolist() for name in record.dtype.names or ()}


def _record(like: Records, plain: Mapping[str, Any]) -> Records:
    names = set(like.dtype.names or ())
    if names != plain.keys():
        raise ValueError(f"other quantities: {', '.join(sorted(names ^ plain.keys()))}")
    record = np.zeros_like(like, shape=1)
    for name in names:
        record[name] = plain[name]
        if not np.isfinite(record[name]).all():
            raise ValueError(f"{name} is not a finite number")
    return record[0]  # type: ignore[no-any-return]
