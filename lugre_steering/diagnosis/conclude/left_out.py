# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the verdict would have been with the samples that the check of the data set aside, told where they are many."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lugre_steering.data.dataset import prepare
from lugre_steering.data.stamps import with_even_stamps
from lugre_steering.diagnosis import verify
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.errors import DataError
from lugre_steering.fitting.clocks import earlier
from lugre_steering.fitting.fit import fit
from lugre_steering.fitting.problem import Effects, Problem
from lugre_steering.fitting.split import split
from lugre_steering.recording import Array, Finding, Recording
from lugre_steering.report import words

MANY = 0.05
"""Share of the samples of a channel that may be left out without a word about the verdict."""


def share_left_out(raw: Recording, used: Recording) -> float:
    """The largest share of the samples of one channel that is not used."""
    pairs = [(raw.angle[side], used.angle[side]) for side in used.angle]
    pairs += [(raw.pressure[line], used.pressure[line]) for line in used.pressure]
    if raw.measured_torque is not None and used.measured_torque is not None:
        pairs.append((raw.measured_torque, used.measured_torque))
    return max((1.0 - kept.time_s.size / every.time_s.size for every, kept in pairs), default=0.0)


def left_out(
    done: Finished, effects: Effects, raw: Sequence[Recording], used: Sequence[Recording], late: Array | None, seed: int
) -> dict[str, Finding]:
    """By recording, where more than MANY of it was not used: what baseline and named ``effects`` leave of held-out data with all of it.

    ``late`` [s]: by how much the clock of each torque was put right; None where only pieces of the recordings were examined.
    """
    shares = {one.name: share_left_out(one, kept) for one, kept in zip(raw, used, strict=True)}
    if max(shares.values(), default=0.0) <= MANY:
        return {}
    told = "what it would have changed was not examined"
    if late is not None:
        try:
            even = [with_even_stamps(earlier(one, float(shift))) for one, shift in zip(raw, late, strict=True)]
            told = _told(done, effects, even, seed)
        except DataError as error:
            told = f"with it nothing could be examined ({error})"
    return {
        name: Finding("left_out", "", f"{words.percent(share)} of a channel was not used (see the other findings); {told}")
        for name, share in shares.items() if share > MANY
    }  # fmt: skip


def _told(done: Finished, effects: Effects, recordings: Sequence[Recording], seed: int) -> str:
    """Held-out errors with and without the samples that were set aside, in words."""
    vehicle = done.problem.vehicle
    whole = Problem(vehicle, [prepare(recording, vehicle) for recording in recordings], done.problem.calibrations)
    with_all, without = (_judged(done, problem, effects, seed) for problem in (whole, done.problem))
    errors = f"{done.torque(with_all.before)} instead of {done.torque(without.before)}"
    told = f"with all of it the recalibrated model errs on held-out data by {errors}"
    if not effects:
        return told
    verdict = "would stand" if with_all.interval[0] > 0.0 else "would not stand"
    return f"{told}, what is named takes {words.percent(with_all.gain)} of that instead of {words.percent(without.gain)}, and {verdict}"


def _judged(done: Finished, problem: Problem, effects: Effects, seed: int) -> verify.Judged:
    """Baseline against named effects, both fitted anew."""
    roles, weight = split(problem), problem.valid / done.noise.floor
    fitted, x = np.where(roles.fit, weight, 0.0), done.found.final.x[: problem.nuisances]
    baseline = fit(problem, fitted, (), x, linearisations=8)
    return verify.verify(problem, weight, baseline, fit(problem, fitted, effects, x, linearisations=8), roles, seed)
