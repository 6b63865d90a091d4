# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Two devices, two clocks: how late the torque's sensors are stamped against the angles, measured and taken out.

An offset shifts the whole torque, so what is left of a recalibrated baseline goes with the torque's slope, dM/dt. It is believed
where it is larger than what the rest of the residual makes of it by chance (scores summed over blocks; Liang and Zeger 1986)
and where a slow sensor, play or a spring does not explain it better. Larger ones are left to the check of wiring and to the catalogue.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lugre_steering.data.dataset import CLOCK_S, prepare
from lugre_steering.data.stamps import with_even_stamps
from lugre_steering.effects.entry import Effect
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.problem import TYPICAL, Candidate, Effects, Problem, SheetValue, is_rig
from lugre_steering.fitting.split import CLUSTER_S
from lugre_steering.recording import Array, Finding, Kind, Recording
from lugre_steering.vehicle import Vehicle

LONGEST_S = 0.045
"""Devices are up to 30 ms apart, and stamps on receipt 10 ms late and more with jitter; beyond, it is told by name (time_delay) or as
wiring (clock_skew)."""
SHORTEST_S, BELIEVED = 2e-4, 4.0
"""Smallest offset worth taking out, and standard deviations from which it is believed."""
ALIKE_S = 1e-3
"""How alike offsets of several recordings are that are one delay of the machine; clocks start anew each time."""
ON_RECEIPT_S = 5e-4
"""Scatter of stamps that are given on receipt; clocks that sample scatter by some tenths of a millisecond."""
ODDS = 3.0
"""Of one delay against clocks that happen to agree, from which it is one."""
WORTH_SAYING_S = 2e-3
"""Offset from which a finding is told: a fifth of a sample at 100 Hz."""
APART_S = 0.015
"""How far torque and angles may still be apart once their clocks are set, as that is done beside a friction law of another form; nothing
where the law is the recording's own."""
AT_BOUND = 0.99
"""Share of a sample from which the torque of a joint may as well be later still."""
ROUNDS = 6
"""Most rounds of setting the clocks and fitting."""
NO_CLOCK = 0.6
"""Share of the cost with an offset below which a slow sensor, or what else makes torque late, explains it better."""
LIKE_LATENESS = {"lag", "wind_up"}
"""Laws of what makes the torque late and is no clock."""


@dataclass(frozen=True)
class Offset:
    """How late [s] the torque of one bag is stamped against its angles, or ``at_least``, and its standard deviation."""

    late_s: float
    deviation_s: float
    at_least: bool = False

    @property
    def believed(self) -> bool:
        return abs(self.late_s) > max(SHORTEST_S, BELIEVED * self.deviation_s)


@dataclass(frozen=True)
class Synchronised:
    """Recordings prepared with one clock; ``late`` [s]: how late the torque of each was; findings, by name, where that is worth saying."""

    problem: Problem
    late: Array
    findings: dict[str, Finding]


def synchronised(
    recordings: Sequence[Recording],
    vehicle: Vehicle,
    calibrations: Sequence[SheetValue] | None = None,
    effects: Effects = (),
) -> Synchronised:
    """Recordings prepared with one clock; ``effects``: what is known to act beside, as physics left out can pass for an offset."""
    stamped, recordings = recordings, [with_even_stamps(recording) for recording in recordings]
    received = [_on_receipt(*both) for both in zip(stamped, recordings, strict=True)]

    def prepared(shifts: Array) -> Problem:
        runs = [prepare(earlier(recording, float(shift)), vehicle) for recording, shift in zip(recordings, shifts, strict=True)]
        return Problem(vehicle, [replace(run, on_receipt=late) for run, late in zip(runs, received, strict=True)], calibrations)

    def known(set_so: Synchronised, deviation: Array, least: float = CLOCK_S) -> Synchronised:
        sure = np.clip(deviation, least, TYPICAL * APART_S)
        runs = [replace(run, clock_s=float(own)) for run, own in zip(set_so.problem.runs, sure, strict=True)]
        return replace(set_so, problem=Problem(vehicle, runs, calibrations))

    problem = prepared(np.zeros(len(recordings)))
    as_stamped = Synchronised(problem, np.zeros(len(recordings)), {})
    if is_rig(vehicle):  # its inertia, which the sheet lacks, would pass for an offset
        return as_stamped
    if any(slows(CATALOGUE[entry.id]) for entry in vehicle.effects):
        return known(as_stamped, np.full(len(recordings), np.inf))
    start = _baseline(problem, effects, None)
    baseline, late = start, np.zeros(len(recordings))
    for _ in range(ROUNDS):
        offsets = clock_offsets(problem, baseline)
        deviation = np.array([offset.deviation_s for offset in offsets])
        # What is believed at all is then followed to its end.
        step = np.array([offset.late_s if offset.believed or begun else 0.0 for offset, begun in zip(offsets, late, strict=True)])
        if np.abs(step).max() < SHORTEST_S:
            break
        late = late + step
        if np.abs(late).max() > LONGEST_S:
            return known(as_stamped, deviation)
        problem = prepared(late)
        baseline = _baseline(problem, effects, baseline)
    if _alike(late, deviation) and not any(received):
        return known(as_stamped, deviation, SHORTEST_S)  # clocks that agree so well have not wandered
    if not late.any() or _no_clock(as_stamped.problem, start, baseline, late):
        return known(as_stamped, deviation)
    return known(Synchronised(problem, late, {
        recording.name: clock_finding(vehicle, float(shift), float(spread))
        for recording, shift, spread in zip(recordings, late, deviation, strict=True) if abs(shift) > WORTH_SAYING_S
    }), deviation)  # fmt: skip


def slows(effect: Effect) -> bool:
    """Whether an effect shifts the whole torque in time, as a clock does."""
    return bool(effect.hooks.keys() & {"delay", "lag"})


def _alike(late: Array, deviation: Array) -> bool:
    """Whether every one of several recordings shows the same delay: a property of the machine, which has a name."""
    if late.size < 2 or not late.all():
        return False
    spread = np.hypot(deviation, ALIKE_S)
    weight = spread**-2
    apart = float(np.sum(weight * (late - np.average(late, weights=weight)) ** 2))
    # Likelihood of one delay that lies anywhere, over that of as many clocks that each do.
    one = np.sqrt(2.0 * np.pi / weight.sum()) / np.prod(np.sqrt(2.0 * np.pi) * spread) * np.exp(-0.5 * apart)
    return bool(one * (2.0 * LONGEST_S) ** (late.size - 1) > ODDS)


def _on_receipt(stamped: Recording, even: Recording) -> bool:
    """Whether stamps of a recording were late by chance, as no clock samples by itself."""
    channels = [(stamped.angle, even.angle), (stamped.pressure, even.pressure)]
    late = [own[name].time_s - signal.time_s for own, evened in channels for name, signal in evened.items()]
    return any(each.size and float(np.std(each)) > ON_RECEIPT_S for each in late)


def _baseline(problem: Problem, effects: Effects, start: Fit | None) -> Fit:
    effects, x = (effects, None) if start is None else (start.effects, start.x)
    return fit(problem, problem.sensor_weight, effects, x, linearisations=20, robust=True, tolerance=1e-4)


def clock_offsets(problem: Problem, baseline: Fit) -> list[Offset]:
    """How late the torque of each bag is stamped, by what the baseline leaves of it beside all that was fitted."""
    weight = problem.sensor_weight
    residual = (problem.measured - baseline.prediction) * weight
    # Bounded influence, as in the fit: a few large errors must not decide.
    trust = 1.0 / np.sqrt(1.0 + (residual / max(3.0 * float(np.median(np.abs(residual))), 1e-30)) ** 2)
    basis = np.linalg.qr(baseline.jacobian * np.sqrt(trust)[:, None])[0]
    offsets = []
    for bag, run in enumerate(problem.runs):
        part = slice(problem.edges[bag], problem.edges[bag + 1])
        slope = np.zeros(residual.size)
        slope[part] = -np.gradient(baseline.prediction[part], run.time)
        slope *= weight * np.sqrt(trust)
        own = slope - basis @ (basis.T @ slope)
        power = float(own @ own)
        if power <= 0.0:
            offsets.append(Offset(0.0, np.inf))
            continue
        score = own * residual * np.sqrt(trust)
        late = float(score.sum()) / power
        left = score - late * own**2
        blocks = np.bincount(((run.time - run.time[0]) / CLUSTER_S).astype(np.int64), left[part])
        offsets.append(Offset(late, float(np.sqrt(blocks @ blocks)) / power))
    return offsets


def _no_clock(original: Problem, start: Fit, shifted: Fit, late: Array) -> bool:
    """Whether a slow sensor, or play or springs before the contact, which give late too, explain the recordings as stamped better than
    offsets of the clock do."""
    weight = original.sensor_weight
    used = np.count_nonzero(weight)
    for effect in (effect for effect in CATALOGUE.values() if effect.hooks.keys() & LIKE_LATENESS):
        values = {p.name: 0.0 if p.optional else p.scale for p in effect.parameters}
        if slows(effect):
            if late.mean() <= 0.0:
                continue
            values = dict.fromkeys(values, float(late.mean()))
        one = Candidate(effect, free=tuple(values)), values
        fitted = fit(original, weight, [*start.effects, one], start.x, linearisations=10, robust=True, tolerance=1e-4)
        if fitted.cost - used < NO_CLOCK * (shifted.cost - used) and fitted.cost < shifted.cost:
            return True
    return False


def earlier(recording: Recording, shift: float) -> Recording:
    """The recording with what gives the torque stamped ``shift`` [s] earlier."""
    torque = recording.measured_torque
    return replace(
        recording, pressure={line: replace(s, time_s=s.time_s - shift) for line, s in recording.pressure.items()},
        measured_torque=None if torque is None else replace(torque, time_s=torque.time_s - shift),
    )  # fmt: skip


def clock_finding(vehicle: Vehicle, late: float, deviation: float, *, at_least: bool = False) -> Finding:
    """That the torque of a recording is stamped ``late`` [s] against its angles, give or take ``deviation``, or by ``at_least`` as much."""
    size = f"{'at least ' if at_least else ''}{1e3 * abs(late):.1f} ms{'' if at_least else f' (+-{2e3 * deviation:.1f})'}"
    topics = ", ".join(dict.fromkeys(c.topic for c in vehicle.channels if c.kind in (Kind.PRESSURE, Kind.TORQUE)))
    return Finding(
        "clock_offset", topics,
        f"{topics}: stamped {size} too {'late' if late > 0.0 else 'early'} against the angles; "
        "taken out here; synchronise the clocks of the devices, or stamp where the sensor is read",
    )  # fmt: skip


def still_apart(problem: Problem, torque: Array) -> Array:
    """Columns (n, bags): what a torque (n,) changes by if the sensors of a bag are APART_S apart, whatever the friction is like."""
    return APART_S * _per_second(problem, torque)


def still_unknown(problem: Problem, torque: Array) -> Array:
    """The same for as far as they may be apart by what is known of the clocks of each bag."""
    return np.asarray(_per_second(problem, torque) * np.array([run.clock_s / TYPICAL for run in problem.runs]))


def beside_clocks(problem: Problem, fitted: Fit) -> Problem:
    """The problem of a joint or axis with the torque of each bag, as ``fitted``, up to one sample late or early as bends: within a sample
    stamps do not tell when a value was measured. As it is of a vehicle, or where something is known to make the torque late."""
    if not is_rig(problem.vehicle) or any(slows(candidate.effect) for candidate, _ in (*problem.standing, *fitted.effects)):
        return problem
    return problem.bent([_per_second(problem, fitted.prediction) * _steps(problem)])


def offsets_beside(problem: Problem, x: Array, deviations: Array) -> tuple[Offset, ...]:
    """What the nuisances ``x`` of such a problem say of the clock of each bag, with the standard deviations of all values."""
    if not problem.shapes:
        return ()
    clocks, steps = slice(problem.nuisances - problem.shapes, problem.nuisances), _steps(problem)
    found = zip(x[clocks], deviations[clocks], steps, strict=True)
    return tuple(Offset(-float(size * step), float(known * step), bool(abs(size) > AT_BOUND)) for size, known, step in found)


def offset_findings(problem: Problem, offsets: Sequence[Offset]) -> dict[str, Finding]:
    """Those that are sure and worth saying, by recording."""
    return {
        run.name: clock_finding(problem.vehicle, offset.late_s, offset.deviation_s, at_least=offset.at_least)
        for run, offset in zip(problem.runs, offsets, strict=False) if offset.believed and abs(offset.late_s) > WORTH_SAYING_S
    }  # fmt: skip


def _steps(problem: Problem) -> Array:
    """Time between samples (bags,) [s]."""
    return np.array([float(run.time[1] - run.time[0]) for run in problem.runs])


def _per_second(problem: Problem, torque: Array) -> Array:
    """Columns (n, bags): slope of a torque (n,) by the time [N m/s] in one bag, zero in all others."""
    parts = zip(problem.runs, np.split(torque, problem.edges[1:-1]), strict=True)
    changes = np.concatenate([np.gradient(part, run.time) for run, part in parts])
    return np.where(problem.bag[:, None] == np.arange(len(problem.runs)), changes[:, None], 0.0)
