# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Faulty sensors, found before any physics is named: each channel against itself, then all of them against the nominal model.

What a fault spoils is left out of the recording that diagnosis uses, never repaired; every removal is a finding. Thresholds
are multiples of the channel's own noise, never below the sheet's noise or one step of its resolution, so that noise-free
and coarsely quantised recordings stay silent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from lugre_steering import units
from lugre_steering.counted import counted
from lugre_steering.data.dataset import GAP_S
from lugre_steering.data.dead import HELD, inspect_angles, inspect_copies, inspect_dead
from lugre_steering.data.pieces import in_pieces
from lugre_steering.data.sensing import (
    FOURTH,
    LOUDER,
    WINDOW_S,
    local_noise,
    louder,
    samples_in,
    stretches,
    worse_than_said,
)
from lugre_steering.data.stamps import with_even_stamps
from lugre_steering.data.wiring import BLOCKING, inspect_wiring, span
from lugre_steering.recording import Array, Channel, Finding, Kind, Mask, Recording, Signal
from lugre_steering.report.words import percent
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.model import build_model

Intervals = tuple[tuple[float, float], ...]

STUCK_S = 1.0
"""An exact repeat longer than this is a stuck sensor, where noise or a jump shows that the value should have moved."""
LOST = 0.02
"""Share of lost messages from which it is told."""
CLIPPED_SAMPLES = 5
"""So many repeats in a row of a noisy channel's extreme value are a limit of the sensor, not chance."""
SPIKE_SIGMA = 8.0
SPIKE_SAMPLES = 3
"""Longer excursions are not isolated samples, and may be physics."""
FORGOTTEN = 5.0
"""Presliding lengths after which less than 1 % of a wrong bristle deflection is left."""
WENT_ON, EDGE_SAMPLES, EDGE_S, LONGEST_UNSEEN_S = 0.05, 10, 0.3, 1.0
"""Share of a presliding length by which the turn in a gap may miss that of the rates at its edges, samples that give those, or all of so
many seconds where these are too noisy, and the longest gap [s] in which a track may have begun to turn, or stopped, but not turned to
and fro."""
PARKED = 0.02
"""Share of a presliding length that a track at rest may seem to move by angle noise."""
LATE_S = 1.0
"""A channel that starts later or ends earlier than the others by more than this is missing there."""


@dataclass(frozen=True)
class Quality:
    """What is wrong with a recording, and the recording without the samples that may not be used."""

    findings: tuple[Finding, ...]
    recording: Recording

    @property
    def blocking(self) -> tuple[Finding, ...]:
        """Findings that make any verdict about physics meaningless."""
        return tuple(finding for finding in self.findings if finding.finding in BLOCKING)


def inspect(recording: Recording, vehicle: Vehicle) -> Quality:
    """All findings about one recording of ``vehicle``, and what diagnosis may use of it."""
    recording = _with_known_topics(recording, vehicle)
    findings = list(recording.findings) + _rejected(recording, vehicle)
    signals = {c: s for c in vehicle.channels if (s := _signal(recording, c)) is not None and s.time_s.size >= 20}
    looks = {c: _Look.of(s, _sheet_noise(vehicle, c)) for c, s in signals.items() if c.kind is not Kind.AIR_TEMPERATURE}
    clean: dict[Channel, Signal] = {}
    for channel, look in looks.items():
        others = [other for c, other in looks.items() if c is not channel and c.kind is channel.kind]
        found, keep = _examine(channel, look, others, vehicle.sensors.pressure_range_Pa)
        findings += found
        clean[channel] = signals[channel] if keep.all() else Signal(look.time[keep], look.value[keep])
    for finding in _memory_lost(clean, vehicle):
        findings.append(finding)
        for channel, signal in clean.items():
            if channel.kind is not Kind.ANGLE:
                clean[channel] = _without(signal, finding.intervals_s)
    usable = _with_signals(recording, clean)
    lost = tuple(_held_long(findings, looks))
    # What no sensor shows has no wiring to look at; angles in another unit have its noise too.
    wrong = lost or _against_model(usable, vehicle) or inspect_copies(recording, vehicle)
    if not wrong:
        findings += [finding for channel, look in looks.items() for finding in _sensor(channel, clean[channel], look, vehicle)]
    # One angle sensor for both tracks would say everything twice.
    return Quality(tuple(dict.fromkeys((*findings, *wrong))), usable)


def _against_model(usable: Recording, vehicle: Vehicle) -> tuple[Finding, ...]:
    """What the nominal model and the other channels say; of a long recording, about the pieces that will be examined."""
    pieces, _ = in_pieces([with_even_stamps(usable)])
    found: dict[tuple[str, str], Finding] = {}
    for finding in _each(inspect_dead, pieces, vehicle) or inspect_wiring(pieces, vehicle) or _each(inspect_angles, pieces, vehicle):
        first = found.setdefault((finding.finding, finding.topic), finding)
        if first is not finding:
            found[finding.finding, finding.topic] = replace(first, intervals_s=(*first.intervals_s, *finding.intervals_s))
    return tuple(found.values())


def _each(
    check: Callable[[Recording, Vehicle], tuple[Finding, ...]], pieces: Sequence[Recording], vehicle: Vehicle
) -> tuple[Finding, ...]:
    """A check of every piece; where the recording has several, its findings say in which."""
    found = [(finding, piece) for piece in pieces for finding in check(piece, vehicle)]
    return tuple(replace(f, intervals_s=f.intervals_s or span(piece)) if len(pieces) > 1 else f for f, piece in found)


def _held_long(findings: Sequence[Finding], looks: Mapping[Channel, _Look]) -> Iterator[Finding]:
    """Angles that stood at an end of their range, or still, for a good part of the recording."""
    for channel, look in looks.items():
        held = sum(
            _total(f.intervals_s) for f in findings if f.topic == channel.topic and f.finding in ("clipped_angle", "stuck_sensor")
        )
        duration = float(look.time[-1] - look.time[0])
        if channel.kind is Kind.ANGLE and held > HELD * duration:
            statement = f"{channel.topic}: shows no angle for {percent(held / duration)} of the recording; check its range and its zero"
            yield Finding("dead_sensor", channel.topic, statement)


def _sensor(channel: Channel, signal: Signal, look: _Look, vehicle: Vehicle) -> list[Finding]:
    """A finding where the sensor, its clock or the logger is worse than the vehicle file lets expect."""
    if signal.time_s.size < 100:
        return []
    unit = {Kind.ANGLE: vehicle.coordinate.unit, Kind.PRESSURE: "Pa", Kind.TORQUE: vehicle.coordinate.force_unit}[channel.kind]

    def say(value: float) -> str:
        return f"{np.degrees(value):.2g} deg" if unit == "rad" else f"{value:.2g} {unit}"

    said = worse_than_said(signal, look.sheet, say, jumps=channel.kind is Kind.TORQUE) if look.sheet > 0.0 else None
    found = [Finding("sensor_worse_than_sheet", channel.topic, f"{channel.topic}: {said}; taken into account")] if said else []
    lost = _lost(look)
    if lost > LOST:
        statement = f"{channel.topic}: {percent(lost)} of the messages are lost; what lies between the others is not taken for measured"
        found.append(Finding("lost_messages", channel.topic, statement))
    return found


def _lost(look: _Look) -> float:
    """Share of messages lost one by one or in short bursts, by how many the usual step would have brought; gaps are told as such."""
    step = np.diff(look.time)
    short = step[step <= _gap_limit(look.period)]
    return float(max(0.0, 1.0 - short.size * look.period / max(float(short.sum()), 1e-9)))


def _signal(recording: Recording, channel: Channel) -> Signal | None:
    if channel.kind is Kind.ANGLE:
        return recording.angle.get(channel.name)
    if channel.kind is Kind.PRESSURE:
        return recording.pressure.get(channel.name)
    return recording.measured_torque if channel.kind is Kind.TORQUE else None


def _with_signals(recording: Recording, clean: Mapping[Channel, Signal]) -> Recording:
    """The recording with these signals; rates only where the angle beside them was kept."""
    of = {kind: {c.name: signal for c, signal in clean.items() if c.kind is kind} for kind in Kind}
    rate = {}
    for name, signal in recording.rate.items():
        kept = np.isin(signal.time_s, of[Kind.ANGLE].get(name, signal).time_s)
        rate[name] = signal if kept.all() else Signal(signal.time_s[kept], signal.value[kept])
    return replace(
        recording, rate=rate, angle={**recording.angle, **of[Kind.ANGLE]}, pressure={**recording.pressure, **of[Kind.PRESSURE]},
        measured_torque=next(iter(of[Kind.TORQUE].values()), recording.measured_torque),
    )  # fmt: skip


def _with_known_topics(recording: Recording, vehicle: Vehicle) -> Recording:
    """What reading says about topics, by their names in the vehicle file: a bag has them with a slash, or a namespace."""

    def known(topic: str) -> str:
        return next((c.topic for c in vehicle.channels if f"/{topic}".endswith(f"/{c.topic.lstrip('/')}")), topic)

    return replace(
        recording, rejected={known(topic): reasons for topic, reasons in recording.rejected.items()},
        findings=tuple(replace(finding, topic=known(finding.topic)) for finding in recording.findings),
    )  # fmt: skip


def _rejected(recording: Recording, vehicle: Vehicle) -> list[Finding]:
    """One finding per topic of which reading left something out."""
    air = {channel.topic for channel in vehicle.channels if channel.kind is Kind.AIR_TEMPERATURE}
    found = []
    for topic, reasons in recording.rejected.items():
        count = ", ".join(f"{number} {reason.replace('_', ' ')}" for reason, number in reasons.items())
        statement = f"{topic}: {counted(sum(reasons.values()), 'message')} cannot be used ({count}); look at the driver and its clock"
        if topic in air and "absurd" in reasons:
            statement += ", and at the unit: degC is expected, kelvin is more by 273.15"
        found.append(Finding("rejected_samples", topic, statement))
    return found


def _sheet_noise(vehicle: Vehicle, channel: Channel) -> float:
    """Standard deviation of one sample as the vehicle file says, in the channel's unit."""
    if channel.kind is Kind.ANGLE:
        return vehicle.sensors.angle_sigma
    if channel.kind is Kind.TORQUE and vehicle.torque_sensor is not None:
        return vehicle.torque_sensor.noise_Nm
    return vehicle.sensors.pressure_noise_Pa


@dataclass(frozen=True)
class _Look:
    """One channel (n,) with what it shows of itself.

    ``period`` [s], ``resolution`` smallest step, ``sheet`` its noise by the vehicle file, ``sigma`` (n,) white noise around
    each sample beyond what stamp jitter explains, ``flickers`` (n,) where noise turns the signal around at every other sample.
    """

    time: Array
    value: Array
    period: float
    resolution: float
    sheet: float
    sigma: Array
    flickers: Mask

    @staticmethod
    def of(signal: Signal, sheet: float) -> _Look:
        time, value = signal.time_s, signal.value
        spacing = np.diff(time)
        period = float(np.median(spacing))
        levels = np.diff(np.unique(value))
        # Of a continuous signal this is next to nothing; of a quantised one its step, even if spikes lie off the grid.
        resolution = float(np.quantile(levels, 0.1)) if levels.size else 0.0
        sigma = local_noise(signal, period)
        turns = np.zeros(value.size)
        step = np.diff(value)
        turns[1:-1] = step[1:] * step[:-1] < 0.0
        loud = sigma > max(resolution, 1e-6 * float(np.ptp(value)), 0.05 * sheet)
        flickers = (uniform_filter1d(turns, samples_in(0.5, period)) > 0.35) & loud
        return _Look(time, value, period, resolution, sheet, sigma, flickers)

    @cached_property
    def noisy(self) -> bool:
        """The sensor shows noise well above its resolution somewhere, so it cannot repeat a value for long."""
        return float(self.flickers.sum()) * self.period >= 1.0

    @cached_property
    def floor(self) -> float:
        """Level below which nothing counts as noise."""
        return max(self.sheet, 0.5 * self.resolution, 1e-9 * float(np.abs(self.value).max()))

    def runs(self, mask: Mask, bridge_s: float = 0.0) -> list[tuple[int, int]]:
        """(first, last) sample of each stretch of ``mask``; stretches less than ``bridge_s`` apart count as one."""
        return stretches(self.time, mask, bridge_s)

    def intervals(self, runs: list[tuple[int, int]]) -> Intervals:
        """Stretches [s], half a period around their samples, and none before the first."""
        half = 0.5 * self.period
        return tuple((float(max(self.time[a] - half, self.time[0])), float(self.time[b] + half)) for a, b in runs)


def _without(signal: Signal, intervals: Intervals) -> Signal:
    keep = np.ones(signal.time_s.size, bool)
    for start, end in intervals:
        keep &= (signal.time_s < start) | (signal.time_s > end)
    return Signal(signal.time_s[keep], signal.value[keep])


def _memory_lost(clean: Mapping[Channel, Signal], vehicle: Vehicle) -> Iterator[Finding]:
    """Where motion went unseen in a gap of an angle, until friction has forgotten it.

    The bristle holds what happened there: reversals, and the slower or faster sliding that set its level. An error of it falls
    by e for each presliding length that the angle turns afterwards. Nothing is lost while the other track was seen at rest.
    """
    record = build_model(vehicle).parameters[0]
    presliding = float(record["coulomb_torque"][0] / record["sigma_0"][0])
    angles = {channel: signal for channel, signal in clean.items() if channel.kind is Kind.ANGLE and signal.time_s.size > 1}
    for channel, signal in angles.items():
        time = signal.time_s
        period = float(np.median(np.diff(time)))
        lost: list[tuple[float, float]] = []
        for i in np.flatnonzero(np.diff(time) > _gap_limit(period)):
            if any(_parked(other, time[i], time[i + 1], presliding) for c, other in angles.items() if c is not channel):
                continue
            if _went_on(signal, int(i), presliding):
                continue
            after = slice(i + 1, None, samples_in(0.2, period))
            turned = np.cumsum(np.abs(np.diff(signal.value[after], prepend=signal.value[i + 1])))
            forgotten = np.searchsorted(turned, FORGOTTEN * presliding)
            start, end = float(time[i]), float(time[after][min(int(forgotten), turned.size - 1)])
            if lost and start <= lost[-1][1]:  # the next gap came before friction had forgotten the last one
                before, last = lost.pop()
                start, end = before, max(end, last)
            lost.append((start, end))
        if lost:
            far = units.distance(vehicle, FORGOTTEN * presliding, degrees=".0f")
            statement = (
                f"{channel.topic}: motion is missing in its gaps, so the friction torque is unknown until the angle has turned by "
                f"{far}; the measured torque is not used for {_total(tuple(lost)):.1f} s"
            )
            yield Finding("friction_memory_lost", channel.topic, statement, tuple(lost))


def _went_on(signal: Signal, last: int, presliding: float) -> bool:
    """The track turned one way through the gap after sample ``last``, so friction is as if it had been seen."""
    period = float(np.median(np.diff(signal.time_s)))
    widths = {EDGE_SAMPLES, max(EDGE_SAMPLES, round(EDGE_S / period))}
    return any(_turned_one_way(signal, last, width, period, WENT_ON * presliding) for width in widths)


def _turned_one_way(signal: Signal, last: int, width: int, period: float, slack: float) -> bool:
    """Whether one change from the rate before a gap to that after makes the track turn as far as it has, within ``slack`` [rad], or it
    went on at nearly one rate; ``width`` samples give the rates."""
    time, value = signal.time_s, signal.value
    gap = float(time[last + 1] - time[last])
    first, end = max(last - width, 0), min(last + 2 + width, time.size)
    others = np.flatnonzero(np.diff(time[first:end]) > _gap_limit(period)) + first
    first, end = int(max(others[others < last] + 1, default=first)), int(min(others[others > last] + 1, default=end))
    if min(last + 1 - first, end - last - 1) < 3:
        return False
    ends = [np.polyfit(time[part] - time[last], value[part], 1) for part in (slice(first, last + 1), slice(last + 1, end))]
    (before, from_), (after, back) = ends
    if before * after < -((slack / gap) ** 2):
        return False
    least, most = sorted((before * gap, after * gap))
    never_stood = min(abs(least), abs(most)) > max(slack, 0.5 * max(abs(least), abs(most)))
    one_way = least - slack < back + after * gap - from_ < most + slack
    return bool(one_way and (gap <= LONGEST_UNSEEN_S or never_stood))


def _parked(signal: Signal, start: float, end: float, presliding: float) -> bool:
    """This track was seen all the time between ``start`` and ``end`` [s] and hardly moved."""
    inside = (signal.time_s >= start) & (signal.time_s <= end)
    near = np.concatenate([[start], signal.time_s[inside], [end]])
    limit = _gap_limit(float(np.median(np.diff(signal.time_s))))
    return bool(inside.any()) and float(np.diff(near).max()) <= limit and float(np.ptp(signal.value[inside])) < PARKED * presliding


def _examine(
    channel: Channel, look: _Look, others: list[_Look], pressure_range: float
) -> tuple[list[Finding], Mask]:
    """Findings about one channel by itself, and which of its samples may be used."""
    topic, found, keep = channel.topic, [], np.ones(look.value.size, bool)

    def report(name: str, intervals: Intervals, statement: str) -> None:
        if intervals:
            found.append(Finding(name, topic, f"{topic}: {statement}", intervals))

    gaps = _gaps(look, others)
    report("dropout", gaps, f"no samples for {_total(gaps):.2f} s; check the cable, the driver and the load of the logger")

    stuck, clipped = _held(look, others, None if channel.kind is not Kind.PRESSURE else pressure_range, channel.kind)
    at = look.intervals(stuck)
    off = all(look.value[first] == 0.0 for first, _ in stuck)
    frozen = f"repeats one value exactly for {_total(at):.1f} s; not used there, replace the sensor or its driver"
    zero = f"reads exactly zero for {_total(at):.1f} s, switched off or a broken wire; not used there"
    report("stuck_sensor", at, zero if off else frozen)
    at = look.intervals(clipped)
    name, extreme = ("clipped_angle", "end") if channel.kind is Kind.ANGLE else ("saturation", "upper limit")
    report(name, at, f"stands at the {extreme} of its range for {_total(at):.1f} s; the true value lies beyond, not used there")
    for first, last in stuck + clipped:
        keep[first : last + 1] = False

    spikes = [(a, b) for a, b in look.runs(_spikes(look) & keep) if b - a < SPIKE_SAMPLES and _returns(look, a, b)]
    for first, last in spikes:
        keep[first : last + 1] = False
    noisy = _noise_change(look, keep, channel.kind)
    if channel.kind is Kind.ANGLE:  # what it seems to move there would pass for friction
        for first, last in noisy:
            keep[first : last + 1] = False
    # Where the noise changes, the scatter that spikes are measured by is wrong.
    spikes = [(a, b) for a, b in spikes if not any(first <= b and a <= last for first, last in _widened(look, noisy))]
    report("spikes", look.intervals(spikes), f"{counted(len(spikes), 'isolated outlier')}, not used; check shielding and connectors")
    at = look.intervals(noisy)
    where, so = ("of the rest of the run", "not used") if channel.kind is Kind.ANGLE else ("usual at such a load", "counts as much less")
    report("noise_change", at, f"noise more than {LOUDER:g} times that {where} for {_total(at):.1f} s; {so} there")
    return found, keep


def _widened(look: _Look, runs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    width = samples_in(WINDOW_S, look.period)
    return [(first - width, last + width) for first, last in runs]


def _total(intervals: Intervals) -> float:
    return sum(end - start for start, end in intervals)


def _gap_limit(period: float) -> float:
    """The longest step [s] of a channel that diagnosis bridges."""
    return max(GAP_S, 3.0 * period)


def _gaps(look: _Look, others: list[_Look]) -> Intervals:
    """Stretches without samples: those that diagnosis cannot bridge, and where it starts late or ends early.

    Late against channels of its kind: a whole device that starts late, or has another clock, has no dropout.
    """
    time, limit = look.time, _gap_limit(look.period)
    span = min([time[0], *(o.time[0] for o in others)]), max([time[-1], *(o.time[-1] for o in others)])
    at = np.flatnonzero(np.diff(time) > limit)
    gaps = [(float(time[i]), float(time[i + 1])) for i in at]
    if time[0] - span[0] > LATE_S:
        gaps.insert(0, (float(span[0]), float(time[0])))
    if span[1] - time[-1] > LATE_S:
        gaps.append((float(time[-1]), float(span[1])))
    return tuple(gaps)


def _held(
    look: _Look, others: list[_Look], upper: float | None, kind: Kind
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Stretches of a repeated value: (stuck, clipped). A constant value alone is no fault: parked vehicles have them."""
    value, low, high = look.value, float(look.value.min()), float(look.value.max())
    if low == high:
        alive = any(other.noisy or _moved(other, look.time[0], look.time[-1]) for other in others)
        return ([(0, value.size - 1)] if alive else []), []
    changes = (np.diff(value) != 0.0) | (np.diff(look.time) > _gap_limit(look.period))
    stuck, pinned = [], np.zeros(value.size, bool)
    if upper is not None:
        pinned |= value >= 0.999 * upper
    starts = np.concatenate([[0], np.flatnonzero(changes) + 1])
    ends = np.append(starts[1:], value.size) - 1
    long = ends - starts + 1 >= CLIPPED_SAMPLES
    for first, last in zip(starts[long].tolist(), ends[long].tolist(), strict=True):
        lasting, extreme = look.time[last] - look.time[first] > STUCK_S, value[first] in (low, high)
        if not (lasting or extreme):
            continue
        jumps = _jumps(look, first, last)
        if extreme and look.noisy and not jumps:
            # A pressure sensor that cannot read below zero rests at zero: no fault.
            pinned[first : last + 1] |= kind is not Kind.PRESSURE or value[first] > 0.0
        elif lasting and (
            look.noisy or jumps or (kind is Kind.ANGLE and any(_moved(o, look.time[first], look.time[last]) for o in others))
        ):
            stuck.append((first, last))
    return stuck, [run for run in look.runs(pinned, GAP_S) if run[1] - run[0] + 1 >= CLIPPED_SAMPLES]


def _jumps(look: _Look, first: int, last: int) -> bool:
    """The value jumps into or out of a stretch, far beyond noise and beyond how quickly it moves just outside."""
    value, time = look.value, look.time
    for inside, outside, beyond in ((first, first - 1, slice(max(first - 11, 0), first)), (last, last + 1, slice(last + 1, last + 12))):
        if 0 <= outside < value.size and abs(time[outside] - time[inside]) < 3.0 * look.period:
            usual = float(np.abs(np.diff(value[beyond])).max(initial=0.0))
            if abs(value[outside] - value[inside]) > max(10.0 * look.floor, 10.0 * look.resolution, 5.0 * usual):
                return True
    return False


def _moved(look: _Look, start: float, end: float) -> bool:
    """Far beyond its noise within [start, end] s."""
    part = look.value[(look.time >= start) & (look.time <= end)]
    return part.size > 0 and float(np.ptp(part)) > 40.0 * max(look.floor, look.resolution)


def _spikes(look: _Look) -> Mask:
    """Samples off the running median by SPIKE_SIGMA of the local scatter and the slope of one sample."""
    width = 2 * SPIKE_SAMPLES + 1
    middle = median_filter(look.value, width, mode="nearest")
    trend = uniform_filter1d(middle, width)
    flat = look.value - trend  # on a slope an outlier would only swap ranks with its neighbours
    off = np.abs(flat - median_filter(flat, width, mode="nearest"))
    scatter = 1.4826 * median_filter(off, samples_in(WINDOW_S, look.period), mode="reflect")
    noise = 1.4826 * float(np.median(np.abs(np.convolve(look.value, FOURTH, mode="valid")))) / np.sqrt(FOURTH @ FOURTH)
    steepest = uniform_filter1d(np.abs(np.gradient(trend, look.time)) * look.period, width)
    limit = SPIKE_SIGMA * np.maximum(scatter, max(look.floor, look.resolution, noise)) + steepest
    found: Mask = (off > limit) & (np.abs(look.value - middle) > 0.5 * limit)  # the latter is blind to steps
    return found


def _returns(look: _Look, first: int, last: int) -> bool:
    """The signal goes on after an excursion about where it was before: not the front of a step or of a decaying pulse."""
    before, after = look.value[max(first - 1, 0)], look.value[min(last + 1, look.value.size - 1)]
    height = float(np.abs(look.value[first : last + 1] - 0.5 * (before + after)).min())
    usual = float(np.median(np.abs(np.diff(look.value[max(first - 10, 0) : last + 11]))))
    return bool(abs(after - before) < 0.5 * height + (last - first + 2) * usual)


def _noise_change(look: _Look, keep: Mask, kind: Kind) -> list[tuple[int, int]]:
    """Stretches where a channel is clearly noisier than usual."""
    kept = np.flatnonzero(keep)
    if kept.size < 2:
        return []
    loud = np.zeros(keep.size, bool)
    signal = Signal(look.time[kept], look.value[kept])
    loud[kept] = louder(signal, look.sheet, by_level=kind is not Kind.ANGLE, jumps=kind is Kind.TORQUE) > 1.0
    return look.runs(loud, 0.5 * WINDOW_S)
