# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Bursts: short events in a residual that the motion does not make.

A law of the motion acts again whenever the joint comes back to the same angle and rate; a kick from outside, or an
event in the measuring chain, does not. So each short event is held against the other visits to its state (recurrence in
state space, as Eckmann, Kamphorst, Ruelle, Europhys. Lett. 4 (1987) 973), and only those that stay alone are kept. Where they lie at the
starts, stops and reversals of the motion far more often than by chance, those that do are its own, whatever its state was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import binom

from lugre_steering.data.dataset import Run
from lugre_steering.recording import Array, Finding, IntArray, Mask
from lugre_steering.report.words import percent

THRESHOLD = 6.0
"""In robust standard deviations of what is left after a running median."""
MERGE_S = 0.1
LONGEST_S = 0.3
MARGIN_S = 0.05
"""What a burst may disturb before and after it, through the smoothing and the response of the joint."""
VISITS = 3
OTHER_VISIT_S = 1.0
SAME_STATE = 0.3
"""Farthest distance of a visit, in standard deviations of angle and rate."""
SLOW = 0.1
"""Share of the usual rate below which a joint counts as at rest."""
BY_CHANCE = 1e-3
"""Probability from which bursts at starts, stops and reversals lie there by chance."""
MIN_COUNT = 5
MIN_SHARE = 0.3
REGULAR = 0.8
"""Share of the pauses that must be whole multiples of the usual one."""


@dataclass(frozen=True)
class Bursts:
    """Events that do not come again with their state: ``intervals`` [s], signed ``peaks``, ``share`` of the residual
    energy, ``period_s`` where they follow each other regularly."""

    intervals: tuple[tuple[float, float], ...]
    peaks: tuple[float, ...]
    share: float
    period_s: float | None

    @property
    def matter(self) -> bool:
        """Whether there are enough of them, and big enough, to be reported and kept out of a fit."""
        return len(self.peaks) >= MIN_COUNT and self.share >= MIN_SHARE

    @property
    def statement(self) -> str:
        """One sentence for a report."""
        longest = max(end - start for start, end in self.intervals)
        series = "" if self.period_s is None else f", every {self.period_s:.2f} s"
        return (
            f"{len(self.peaks)} short bursts (longest {longest:.2f} s){series} hold {percent(self.share)} of what "
            "the model leaves over, and do not come again when the joint comes back to the same angle and rate: "
            "a disturbance from outside, not a law of the motion"
        )

    def covers(self, time: Array) -> Mask:
        """Samples (n,) inside a burst or its margin."""
        inside = np.zeros(time.size, bool)
        for start, end in self.intervals:
            inside |= (time >= start - MARGIN_S) & (time <= end + MARGIN_S)
        return inside


def find_bursts(run: Run, residual: Array) -> Bursts | None:
    """Short events in a residual (n,) of one run that its motion does not make; None without any."""
    groups = _events(run, residual)
    peaks = np.array([group[np.argmax(np.abs(residual[group]))] for group in groups], np.int64)
    turns = _at_turns(run, groups)
    alone = [i for i in range(len(groups)) if not turns[i] and not _comes_again(run, residual, peaks, i)]
    if not alone:
        return None
    groups, peaks = [groups[i] for i in alone], peaks[alone]
    return Bursts(
        tuple((float(run.time[g[0]]), float(run.time[g[-1]])) for g in groups),
        tuple(float(value) for value in residual[peaks]),
        float(sum(np.sum(residual[g] ** 2) for g in groups) / np.sum(residual[run.valid] ** 2)),
        _period(run.time[peaks]),
    )


def _events(run: Run, residual: Array) -> list[IntArray]:
    """Samples of each stretch of at most LONGEST_S that sticks out of the residual around it."""
    if not run.valid.any():
        return []
    width = 2 * round(LONGEST_S / float(run.time[1] - run.time[0])) + 1
    fast = np.abs(residual - median_filter(residual, width))
    above = np.flatnonzero((fast > THRESHOLD * 1.4826 * float(np.median(fast[run.valid]))) & run.valid)
    groups = np.split(above, np.flatnonzero(np.diff(run.time[above]) > MERGE_S) + 1)
    return [g for g in groups if g.size and run.time[g[-1]] - run.time[g[0]] <= LONGEST_S]


def _at_turns(run: Run, groups: Sequence[IntArray]) -> Mask:
    """Which events lie where the motion starts, stops or turns back; none where they do so no more often than by chance.

    As near as the longest of them lasts: friction lets go only once the contact is wound up.
    """
    rate = run.omega.mean(axis=0)
    way = np.sign(rate) * (np.abs(rate) > SLOW * float(np.sqrt(np.mean(rate[run.valid] ** 2))))
    turns = run.time[np.flatnonzero(np.diff(way))]
    if not turns.size or not groups:
        return np.zeros(len(groups), bool)

    def near(time: Array) -> Mask:
        after = np.clip(np.searchsorted(turns, time), 1, max(turns.size - 1, 1))
        return np.asarray(np.minimum(np.abs(time - turns[after - 1]), np.abs(turns[np.minimum(after, turns.size - 1)] - time)) < LONGEST_S)

    found = near(np.array([0.5 * (run.time[group[0]] + run.time[group[-1]]) for group in groups]))
    share = float(np.mean(near(run.time[run.valid])))
    return found & (float(binom.sf(np.count_nonzero(found) - 1, len(groups), share)) < BY_CHANCE)


def _comes_again(run: Run, residual: Array, peaks: IntArray, index: int) -> bool:
    """Whether half of the nearest visits to the state of one event see one like it; true without any other visit.

    A visit is a stretch of time close to that state; in between, the joint was elsewhere.
    """
    at = peaks[index]
    state = np.concatenate([run.theta, run.omega])
    distance = np.sqrt(np.mean(((state - state[:, [at]]) / (state.std(axis=1, keepdims=True) + 1e-12)) ** 2, axis=0))
    close = np.flatnonzero(distance < SAME_STATE)
    stretches = np.split(close, np.flatnonzero(np.diff(close) > 1) + 1)
    visits = [stretch[np.argmin(distance[stretch])] for stretch in stretches if at not in stretch]
    visits = [visit for visit in visits if abs(run.time[visit] - run.time[at]) > OTHER_VISIT_S]
    visits = sorted(visits, key=lambda visit: float(distance[visit]))[:VISITS]
    like = run.time[peaks[residual[peaks] * residual[at] > 0.25 * residual[at] ** 2]]
    seen = sum(bool(np.any(np.abs(like - run.time[visit]) <= 2.0 * MARGIN_S)) for visit in visits)
    return seen >= 0.5 * len(visits)


def _period(times: Array) -> float | None:
    """Usual pause [s] if nearly all pauses are whole multiples of it."""
    pauses = np.diff(times)
    if pauses.size < MIN_COUNT - 1:
        return None
    usual = float(np.median(pauses))
    multiples = pauses / usual
    near = np.abs(multiples - np.round(multiples)) < 0.1 * np.maximum(multiples, 1.0)
    return usual if np.mean(near & (multiples > 0.5)) >= REGULAR else None


def all_bursts(runs: Sequence[Run], residuals: Sequence[Array]) -> list[Bursts | None]:
    """``find_bursts`` of each run, where they matter."""
    found = [find_bursts(run, residual) for run, residual in zip(runs, residuals, strict=True)]
    return [item if item is not None and item.matter else None for item in found]


def set_aside(runs: Sequence[Run], residuals: Sequence[Array]) -> tuple[list[Run], dict[str, Finding]]:
    """The runs with their bursts marked as not valid, and a finding for each run that has any, by its name."""
    cleaned, findings = [], {}
    for run, bursts in zip(runs, all_bursts(runs, residuals), strict=True):
        if bursts is None:
            cleaned.append(run)
            continue
        cleaned.append(replace(run, valid=run.valid & ~bursts.covers(run.time)))
        findings[run.name] = Finding("outside_disturbance", "", bursts.statement, bursts.intervals)
    return cleaned, findings
