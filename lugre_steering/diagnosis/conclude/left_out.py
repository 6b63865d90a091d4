# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the verdict would have been with the samples that the check of the data set aside, told where they are many."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lugre_steering.data.dataset import prepare
from lugre_steering.data.stamps import with_even_stamps
from lugre_steering.diagnosis.conclude.finished import Finished
from lugre_steering.errors import DataError
from lugre_steering.fitting.clocks import earlier
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.problem import Effects, Problem
from lugre_steering.fitting.split import Mask
from lugre_steering.recording import Array, Finding, Recording

MANY = 0.05
"""Share of the samples of a channel that may be left out without a word about the verdict."""


def share_left_out(raw: Recording, used: Recording) -> float:
    """The largest share of the samples of one channel that is not used."""
    pairs = [(raw.angle[side], used.angle[side]) for side in used.angle]
    pairs += [(raw.pressure[line], used.pressure[line]) for line in used.pressure]
    if raw.measured_torque is not None and used.measured_torque is not None:
        pairs.append((raw.measured_torque, used.measured_torque))
    return max((1.0 - kept.time_s.size / all_of_it.time_s.size for all_of_it, kept in pairs), default=0.0)


def left_out(done: Finished, effects: Effects, raw: Sequence[Recording], used: Sequence[Recording], late: Array) -> dict[str, Finding]:
    """By recording, where more than MANY of it was not used: what baseline and named ``effects`` leave of all samples.

    ``late`` [s]: by how much the clock of each torque was put right.
    """
    shares = [share_left_out(*pair) for pair in zip(raw, used, strict=True)]
    if max(shares, default=0.0) <= MANY:
        return {}
    problem = done.problem
    try:
        runs = [prepare(earlier(with_even_stamps(one), float(shift)), problem.vehicle) for one, shift in zip(raw, late, strict=True)]
    except DataError:
        return {}
    whole = Problem(problem.vehicle, runs, problem.calibrations)
    told = _told(done, whole, effects)
    return {
        one.name: Finding("left_out", "", f"{100 * share:.0f} % of a channel was not used (see the other findings); {told}")
        for one, share in zip(raw, shares, strict=True) if share > MANY
    }  # fmt: skip


def _told(done: Finished, whole: Problem, effects: Effects) -> str:
    """Errors with and without the samples that were set aside, in words."""
    fewer = (done.problem, done.problem.valid)
    before = [_error(done, *part, ()) for part in ((whole, whole.valid), fewer)]
    told = f"with all of it the recalibrated model errs by {done.torque(before[0])} instead of {done.torque(before[1])}"
    if not effects:
        return told
    gains = [1.0 - _error(done, *part, effects) / error for part, error in zip(((whole, whole.valid), fewer), before, strict=True)]
    same = "the names stand" if gains[0] > 0.0 else "the names would not stand"
    return f"{told}, and what is named takes {100 * gains[0]:.0f} % of that instead of {100 * gains[1]:.0f} %: {same}"


def _error(done: Finished, problem: Problem, valid: Mask, effects: Effects) -> float:
    """Root mean square error [N m] of a fit to all valid samples."""
    result = fit(problem, valid / done.noise.floor, effects, done.found.final.x[: problem.nuisances], linearisations=8)
    return float(np.sqrt(np.mean((problem.measured - result.prediction)[valid] ** 2)))
