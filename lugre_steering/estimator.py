# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The estimator: timestamped samples in, torque, temperature and residual out.

Live node and replay push the same messages through the same compiled loop, so equal inputs give equal numbers.

Rules of time (header stamps only, never arrival times):

* Each angle sample advances its own side exactly once. A torque is published when both sides have a sample of the same
  stamp, to within half a sampling period; samples wait for a partner that arrives late, and one that gets none is
  counted as unpaired (it has advanced its side all the same).
* The residual of a torque follows when every line has a pressure at or after its stamp; pressures are interpolated
  linearly, never held or extrapolated, and not across a gap.
* Duplicate, backward, zero, not finite, absurd and jumping samples are rejected and counted by reason. A jump is
  believed when the next sample of the same channel confirms it and, for an angle, the other side is there or jumps as
  well. A jump of both sides back in time starts the estimator anew; a side or line that jumps back alone loses its own
  samples in waiting, nothing else. So does a torque that is no finite number start it anew; ``restart`` counts them.
* A rate that no steering has, or none that is a number, counts as not given.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from lugre_steering.chain.hydraulics import CylinderTable, gauge_offset, moment_arm
from lugre_steering.chain.layout import OUTPUT, STATE
from lugre_steering.chain.model import build_model
from lugre_steering.chain.rates import MOTION, follow
from lugre_steering.chain.step import Records, has_effects, step
from lugre_steering.effects.sensors import SensorCorrection, sensor_correction
from lugre_steering.recording import RATE_LIMIT, Array, IntArray, Kind
from lugre_steering.vehicle import Vehicle

REASONS = (
    "duplicate", "backward", "zero_stamp", "not_finite", "absurd", "spike", "time_jump", "unpaired", "gap", "overrun",
    "restart", "absurd_rate",
)  # fmt: skip
(
    _DUPLICATE, _BACKWARD, _ZERO, _NOT_FINITE, _ABSURD, _SPIKE, _JUMP, _UNPAIRED, _GAP, _OVERRUN, _RESTART, _RATE,
) = range(len(REASONS))  # fmt: skip

LINE_RING = 8192
PENDING_RING = 8192
WAITING_RING = 1024  # one side may come two seconds later than the other, at 500 Hz
MAX_PAIR_TOLERANCE_NS = 50_000_000
CONFIRM_NS = 1_000_000_000  # a sample this soon after a suspect one can confirm it
PREVIEW_STEPS = 20
PLAN_POINTS = 1024

ESTIMATE = np.dtype(
    [
        ("stamp_ns", np.int64),
        ("theta", np.float64, (2,)),
        ("omega", np.float64, (2,)),
        ("torque", np.float64, (2,)),
        ("temperature", np.float64, (2,)),
        ("feed_forward", np.float64, (2,)),
        ("total", np.float64),
        ("predicted", np.float64),  # total as the pressure sensors would show it (lagged)
        ("message", np.int64),  # the pushed message that completed it, counted from 0
    ]
)
RESIDUAL = np.dtype(
    [("stamp_ns", np.int64), ("measured_torque", np.float64), ("residual", np.float64), ("message", np.int64)]
)

CONFIG = np.dtype(
    [
        ("pair_tolerance_ns", np.int64),
        ("max_gap_ns", np.int64),
        ("backward_jump_ns", np.int64),
        ("forward_jump_ns", np.int64),
        ("max_angle", np.float64),
        ("max_rate", np.float64),
        ("max_pressure", np.float64),
        ("angle_noise", np.float64),
        ("gauge_offset", np.float64),
        ("pressure_gain", np.float64),
        ("delay_ns", np.int64),
        ("lag", np.float64),
        ("arm_linear", np.float64),
        ("arm_quadratic", np.float64),
        ("horizon", np.float64),
        ("start_ns", np.int64),
        ("lagged", np.float64),
        ("lagged_ns", np.int64),
        ("pending_first", np.int64),
        ("pending_count", np.int64),
        ("plan_size", np.int64),
        ("effects", np.bool_),
        ("message", np.int64),  # number of the message being processed, from 0
    ]
)
CHANNEL = np.dtype(
    [
        ("kind", np.int64),
        ("index", np.int64),
        ("last_ns", np.int64),
        ("suspect_ns", np.int64),
        ("suspect_value", np.float64),
        ("last_value", np.float64),
        ("accepted", np.int64),
        ("period_ns", np.int64),  # from the last but one accepted sample to the last
        ("head", np.int64),  # samples stored so far in the ring of this line or side
        ("cursor", np.int64),  # first ring sample that may still be needed
        ("offset", np.float64),  # sensor offset [Pa]
        ("drift", np.float64),  # sensor drift [Pa/s]
        ("reasons", np.int64, (len(REASONS),)),
    ]
)
WAITING = np.dtype(
    [
        ("stamp_ns", np.int64),
        ("theta", np.float64),
        ("omega", np.float64),
        ("torque", np.float64),
        ("temperature", np.float64),
        ("feed_forward", np.float64),
    ]
)


@dataclass(frozen=True)
class Options:
    """Timing rules; the defaults suit sensors of 20 Hz and more."""

    pair_tolerance_s: float = 0.002  # or half a sampling period, if that is more
    max_gap_s: float = 0.25
    backward_jump_s: float = 2.0
    forward_jump_s: float = 10.0
    max_rate_rad_s: float = 10.0
    feed_forward_horizon_s: float = 0.0


class Core(NamedTuple):
    """Everything the compiled loop reads and writes; arrays only, so that it can be copied and restored."""

    config: Records
    channels: Records
    parameters: Records
    state: Records
    motion: Records
    output: Records
    waiting: Records
    rubber: Array
    pending: Records
    line_ns: IntArray
    line_value: Array
    geometry: Array
    areas: Array
    lines: IntArray
    plan_ns: IntArray
    plan_theta: Array
    scratch_value: Array
    scratch_state: Records
    scratch_output: Records


@njit
def _clear(ch):
    """Forget the samples of one channel, not its counters."""
    ch.last_ns = 0
    ch.suspect_ns = 0
    ch.period_ns = 0
    ch.head = 0
    ch.cursor = 0


@njit
def _begin_side(core, side):
    """Forget what one side has been through, but for the count of its steps outside the rubber table."""
    saturated = core.state[side].saturated
    core.state[side] = np.zeros_like(core.state)[side]
    core.motion[side] = np.zeros_like(core.motion)[side]
    core.state[side].saturated = saturated
    _clear(core.channels[side])


@njit
def _restart(core, k):
    """Forget the past, except the counters; counted for channel ``k``, like the torques that still lack pressures."""
    for side in range(core.state.size):  # slice assignment would compile for ten seconds more
        _begin_side(core, side)
    for i in range(core.channels.size):
        _clear(core.channels[i])
    c = core.config[0]
    core.channels[k].reasons[_RESTART] += 1
    core.channels[k].reasons[_OVERRUN] += c.pending_count
    c.start_ns = 0
    c.lagged_ns = 0
    c.pending_count = 0
    c.plan_size = 0


_DOUBTED, _SHARED, _THERE = range(3)


@njit
def _other_side(core, k, stamp_ns):
    """What the other side says to a jump of angle channel ``k``: it is not there, it jumps as well, or it is there.

    A side without any sample yet (or without another) agrees.
    """
    near_ns = min(CONFIRM_NS, core.config[0].backward_jump_ns // 2)
    for side in range(core.state.size):
        other = core.channels[side]
        if side == k or other.last_ns == 0:
            continue
        if abs(stamp_ns - other.last_ns) < near_ns:
            return _THERE
        if other.suspect_ns == 0 or abs(stamp_ns - other.suspect_ns) >= near_ns:
            return _DOUBTED
    return _SHARED


@njit
def _admit(core, k, stamp_ns, value):
    """Whether channel ``k`` accepts the sample; counts the reason if not."""
    c, ch = core.config[0], core.channels[k]
    if stamp_ns <= 0:
        ch.reasons[_ZERO] += 1
        return False
    if not math.isfinite(value):
        ch.reasons[_NOT_FINITE] += 1
        return False
    if (ch.kind == 0 and abs(value) > c.max_angle) or (ch.kind == 1 and abs(value) > c.max_pressure):
        ch.reasons[_ABSURD] += 1
        return False
    if (ch.kind == 2 and not -100.0 < value < 100.0) or abs(value) > 1e12:
        ch.reasons[_ABSURD] += 1
        return False
    if ch.last_ns == 0:
        return True
    ahead = stamp_ns - ch.last_ns
    if ahead == 0:
        ch.reasons[_DUPLICATE] += 1
        return False
    if -c.backward_jump_ns < ahead < 0:
        ch.reasons[_BACKWARD] += 1
        return False
    if ch.kind == 2:  # air may come as rarely as it likes, and no sample of it is needed at any instant
        return True
    follows_suspect = ch.suspect_ns != 0 and 0 < stamp_ns - ch.suspect_ns < CONFIRM_NS
    if ahead < 0 or ahead > c.forward_jump_ns:
        other_side = _other_side(core, k, stamp_ns) if ch.kind == 0 else _THERE
        if not follows_suspect or other_side == _DOUBTED:
            ch.reasons[_JUMP] += 1
            ch.suspect_ns = stamp_ns
            ch.suspect_value = value
            return False
        if ahead < 0:
            if other_side == _SHARED:
                _restart(core, k)
                return True
            if ch.kind != 0:
                _clear(ch)
                return True
            # This side alone had strayed ahead: it goes on from the sample before, which the stray one made suspect.
            ch.last_ns = ch.suspect_ns
            ch.cursor = ch.head
            ahead = stamp_ns - ch.last_ns
    if ch.kind == 0:
        reach = c.max_rate * ahead * 1e-9 + 10.0 * c.angle_noise
        if abs(value - ch.last_value) > reach:
            near = (
                follows_suspect
                and abs(value - ch.suspect_value) <= c.max_rate * (stamp_ns - ch.suspect_ns) * 1e-9 + reach
            )
            if not near:
                ch.reasons[_SPIKE] += 1
                ch.suspect_ns = stamp_ns
                ch.suspect_value = value
                return False
            if ch.head == 1:  # two agree against the first one
                _begin_side(core, ch.index)
                return True
    if ahead > c.max_gap_ns:
        ch.reasons[_GAP] += 1
    ch.suspect_ns = 0
    return True


@njit
def _planned(core, side, stamp_ns):
    """Planned angle of a side at a time, linear between points, held at the last; NaN before or without a plan."""
    n = core.config[0].plan_size
    if n == 0 or stamp_ns < core.plan_ns[0]:
        return math.nan
    if stamp_ns >= core.plan_ns[n - 1]:
        return core.plan_theta[side, n - 1]
    i = 1
    while core.plan_ns[i] < stamp_ns:
        i += 1
    weight = (stamp_ns - core.plan_ns[i - 1]) / (core.plan_ns[i] - core.plan_ns[i - 1])
    return core.plan_theta[side, i - 1] + weight * (core.plan_theta[side, i] - core.plan_theta[side, i - 1])


@njit
def _preview(core, side, stamp_ns):
    """Torque [N m] that this side will need one horizon ahead: along the plan, or at the present rate without one.

    A plan that has run out says nothing about what is ahead, and is not used any more.
    """
    c, motion = core.config[0], core.motion[side]
    if c.horizon <= 0.0:
        return core.output[side].torque
    planning = c.plan_size > 0 and stamp_ns < core.plan_ns[c.plan_size - 1]
    core.scratch_state[0] = core.state[side]
    dt = c.horizon / PREVIEW_STEPS
    theta = motion.theta
    for i in range(1, PREVIEW_STEPS + 1):
        planned = _planned(core, side, stamp_ns + np.int64(i * dt * 1e9)) if planning else math.nan
        target = theta + motion.omega * dt if math.isnan(planned) else planned
        omega = (target - theta) / dt
        step(
            core.parameters[side],
            core.scratch_state[0],
            core.rubber,
            core.scratch_output[0],
            dt,
            target,
            omega,
            0.0,
            c.effects,
        )
        theta = target
    return core.scratch_output[0].torque


@njit
def _pair(core):
    """Drop waiting samples that can get no partner; stamp of the pair now at the head of the sides' queues, or 0."""
    sides, ring = core.waiting.shape
    period_ns = MAX_PAIR_TOLERANCE_NS
    for side in range(sides):
        if core.channels[side].period_ns > 0:
            period_ns = min(period_ns, core.channels[side].period_ns)
    tolerance_ns = max(core.config[0].pair_tolerance_ns, period_ns // 2)
    while True:
        latest = 0
        for side in range(sides):
            ch = core.channels[side]
            if ch.head == ch.cursor:
                return 0
            latest = max(latest, core.waiting[side, ch.cursor % ring].stamp_ns)
        paired = True
        for side in range(sides):
            ch = core.channels[side]
            if latest - core.waiting[side, ch.cursor % ring].stamp_ns > tolerance_ns:
                ch.cursor += 1
                ch.reasons[_UNPAIRED] += 1
                paired = False
        if paired:
            return latest


@njit
def _angle(core, k, stamp_ns, value, rate, estimates, count):
    """One accepted angle sample: advance its side, and publish when the other side has the same stamp."""
    c, ch = core.config[0], core.channels[k]
    side = ch.index
    if abs(rate) >= RATE_LIMIT:
        ch.reasons[_RATE] += 1
        rate = math.nan
    if c.start_ns == 0 or stamp_ns < c.start_ns:
        c.start_ns = stamp_ns
    dt = 0.0
    if ch.last_ns == 0:
        core.state[side].time = max(0.0, (stamp_ns - c.start_ns) * 1e-9)
    else:
        ch.period_ns = stamp_ns - ch.last_ns
        dt = ch.period_ns * 1e-9
    ch.last_ns = stamp_ns
    ch.last_value = value
    motion = core.motion[side]
    follow(motion, dt, value, rate, c.angle_noise)
    step(
        core.parameters[side],
        core.state[side],
        core.rubber,
        core.output[side],
        dt,
        motion.theta,
        motion.omega,
        motion.alpha,
        c.effects,
    )
    ring = core.waiting.shape[1]
    if ch.head - ch.cursor == ring:
        ch.reasons[_UNPAIRED] += 1
        ch.cursor += 1
    waiting = core.waiting[side, ch.head % ring]
    ch.head += 1
    waiting.stamp_ns = stamp_ns
    waiting.theta = core.state[side].theta
    waiting.omega = motion.omega
    waiting.torque = core.output[side].torque
    waiting.temperature = core.output[side].temperature
    waiting.feed_forward = _preview(core, side, stamp_ns)
    latest = _pair(core)
    if latest == 0:
        return count
    e = estimates[count]
    e.stamp_ns = latest
    e.message = c.message
    e.total = 0.0
    for other in range(core.waiting.shape[0]):
        w = core.waiting[other, core.channels[other].cursor % ring]
        core.channels[other].cursor += 1
        e.theta[other] = w.theta
        e.omega[other] = w.omega
        e.torque[other] = w.torque
        e.temperature[other] = w.temperature
        e.feed_forward[other] = w.feed_forward
        e.total += w.torque
    if not math.isfinite(e.total):
        e.predicted = e.total
        _restart(core, k)
        return count + 1
    if c.lag > 0.0 and c.lagged_ns != 0:
        c.lagged = e.total + (c.lagged - e.total) * math.exp(-(latest - c.lagged_ns) * 1e-9 / c.lag)
    else:
        c.lagged = e.total
    c.lagged_ns = latest
    e.predicted = c.lagged
    if c.pending_count == core.pending.size:
        c.pending_first = (c.pending_first + 1) % core.pending.size
        c.pending_count -= 1
        ch.reasons[_OVERRUN] += 1
    core.pending[(c.pending_first + c.pending_count) % core.pending.size] = e
    c.pending_count += 1
    return count + 1


@njit
def _measured_torque(core, e, value):
    """Torque [N m] on the steering axis from the interpolated line values (or the torque sensor as it is)."""
    c = core.config[0]
    if core.lines.shape[0] == 0:
        return value[0]
    torque = 0.0
    for i in range(core.lines.shape[0]):
        side = int(core.geometry[i, 0])
        theta = e.theta[side]
        force = 0.0
        if core.lines[i, 0] >= 0:
            force += value[core.lines[i, 0]] * core.areas[i, 0]
        if core.lines[i, 1] >= 0:
            force -= value[core.lines[i, 1]] * core.areas[i, 1]
        arm = moment_arm(theta, core.geometry[i, 1], core.geometry[i, 2], core.geometry[i, 3], core.geometry[i, 4])
        torque += force * arm * (1.0 + c.arm_linear * theta + c.arm_quadratic * theta * theta)
    return torque * c.pressure_gain


@njit
def _residuals(core, first_line, residuals, count):
    """Form every residual whose pressures have all come, in stamp order."""
    c = core.config[0]
    lines = core.line_ns.shape[0]
    value = core.scratch_value
    while c.pending_count > 0:
        e = core.pending[c.pending_first]
        at_ns = e.stamp_ns + c.delay_ns
        for line in range(lines):
            ch = core.channels[first_line + line]
            if ch.head == 0 or ch.last_ns < at_ns:
                return count
        usable = True
        for line in range(lines):
            ch = core.channels[first_line + line]
            ring = core.line_ns.shape[1]
            cursor = max(ch.cursor, ch.head - ring)
            while cursor < ch.head and core.line_ns[line, cursor % ring] < at_ns:
                cursor += 1
            ch.cursor = cursor
            after_ns = core.line_ns[line, cursor % ring]
            after = core.line_value[line, cursor % ring]
            if after_ns == at_ns:
                p = after
            elif cursor == max(0, ch.head - ring) or after_ns - core.line_ns[line, (cursor - 1) % ring] > c.max_gap_ns:
                usable = False
                break
            else:
                before_ns = core.line_ns[line, (cursor - 1) % ring]
                before = core.line_value[line, (cursor - 1) % ring]
                p = before + (after - before) * ((at_ns - before_ns) / (after_ns - before_ns))
            value[line] = p - c.gauge_offset - ch.offset - ch.drift * (at_ns - c.start_ns) * 1e-9
        c.pending_first = (c.pending_first + 1) % core.pending.size
        c.pending_count -= 1
        if not usable:
            continue
        r = residuals[count]
        r.stamp_ns = e.stamp_ns
        r.measured_torque = _measured_torque(core, e, value)
        r.residual = r.measured_torque - e.predicted
        r.message = c.message
        count += 1
    return count


@njit(nogil=True, cache=True)
def _process(core, first_line, channel, stamp_ns, value, rate, estimates, residuals):
    """Push messages in the order given; returns how many estimates and residuals were written."""
    n_estimates, n_residuals = 0, 0
    for i in range(channel.size):
        k = channel[i]
        core.config[0].message += 1
        if not _admit(core, k, stamp_ns[i], value[i]):
            continue
        ch = core.channels[k]
        ch.accepted += 1
        if ch.kind == 0:
            n_estimates = _angle(core, k, stamp_ns[i], value[i], rate[i], estimates, n_estimates)
        elif ch.kind == 2:
            ch.last_ns = stamp_ns[i]
            for side in range(core.state.size):
                core.state[side].air_temperature = value[i]
                core.parameters[side].air_temperature = value[i]
            continue
        else:
            line = ch.index
            ch.last_ns = stamp_ns[i]
            core.line_ns[line, ch.head % core.line_ns.shape[1]] = stamp_ns[i]
            core.line_value[line, ch.head % core.line_ns.shape[1]] = value[i]
            ch.head += 1
        n_residuals = _residuals(core, first_line, residuals, n_residuals)
    return n_estimates, n_residuals


class Estimator:
    """Steering-torque estimator of one vehicle; a thin owner of the compiled core."""

    def __init__(self, vehicle: Vehicle, options: Options | None = None) -> None:
        self.vehicle = vehicle
        self.options = options or Options()
        self.channels = vehicle.channels
        self._first_line = len(vehicle.sides)
        self._core = _new_core(vehicle, self.options)
        self._single = (np.empty(1, np.int64), np.empty(1, np.int64), np.empty(1), np.empty(1))
        self._estimates = np.zeros(1, ESTIMATE)
        self._residuals = np.zeros(PENDING_RING, RESIDUAL)

    def push(self, channel: int, stamp_ns: int, value: float, rate: float = math.nan) -> tuple[Records, Records]:
        """One message -> new estimates (0 or 1) and residuals (0 or more), as views that the next push overwrites."""
        single = self._single
        single[0][0], single[1][0], single[2][0], single[3][0] = channel, stamp_ns, value, rate
        e, r = _process(self._core, self._first_line, *single, self._estimates, self._residuals)
        return self._estimates[:e], self._residuals[:r]

    def push_block(self, channel: IntArray, stamp_ns: IntArray, value: Array, rate: Array) -> tuple[Records, Records]:
        """Many messages in recorded order -> all their estimates and residuals."""
        estimates, residuals = np.zeros(channel.size, ESTIMATE), np.zeros(channel.size + PENDING_RING, RESIDUAL)
        e, r = _process(
            self._core, self._first_line, channel.astype(np.int64), stamp_ns, value, rate, estimates, residuals
        )
        return estimates[:e], residuals[:r]

    def set_plan(self, stamp_ns: IntArray, theta: Array) -> None:
        """Planned angles ahead: absolute times (n,) [ns] and angles (sides, n) [rad]; replaces the former plan."""
        n = min(stamp_ns.size, self._core.plan_ns.size)
        self._core.plan_ns[:n] = stamp_ns[:n]
        self._core.plan_theta[:, :n] = theta[:, :n]
        self._core.config[0]["plan_size"] = n

    @property
    def counters(self) -> Mapping[str, Mapping[str, int]]:
        """Accepted samples and rejected ones by reason, per channel name."""
        table: dict[str, dict[str, int]] = {}
        for channel, row in zip(self.channels, self._core.channels, strict=True):
            counts = {reason: int(n) for reason, n in zip(REASONS, row["reasons"], strict=True) if n}
            table[_label(channel.kind, channel.name)] = {"accepted": int(row["accepted"]), **counts}
        return table

    @property
    def latest_ns(self) -> Mapping[str, int]:
        """Stamp of the latest accepted sample per channel name; 0 before the first."""
        return {
            _label(c.kind, c.name): int(r["last_ns"]) for c, r in zip(self.channels, self._core.channels, strict=True)
        }

    @property
    def restarts(self) -> int:
        """How often it began anew, because time was set back or a torque was no finite number."""
        return int(self._core.channels["reasons"][:, _RESTART].sum())

    @property
    def saturated_steps(self) -> int:
        """Steps so far with a rubber temperature outside the rubber table."""
        return int(self._core.state["saturated"].sum())

    def snapshot(self) -> list[np.ndarray[Any, Any]]:
        """A copy of the whole state, for ``restore``."""
        return [array.copy() for array in self._core]

    def restore(self, snapshot: list[np.ndarray[Any, Any]]) -> None:
        """Go back to a snapshot of an estimator of the same vehicle."""
        for array, saved in zip(self._core, snapshot, strict=True):
            array[...] = saved


def _label(kind: Kind, name: str) -> str:
    return {Kind.ANGLE: f"angle/{name}", Kind.PRESSURE: f"pressure/{name}"}.get(kind, kind.name.lower())


def _new_core(vehicle: Vehicle, options: Options) -> Core:
    model = build_model(vehicle)
    correction: SensorCorrection = sensor_correction(vehicle)
    sides = len(vehicle.sides)
    config = np.zeros(1, CONFIG)
    config["pair_tolerance_ns"] = round(options.pair_tolerance_s * 1e9)
    config["max_gap_ns"] = round(options.max_gap_s * 1e9)
    config["backward_jump_ns"] = round(options.backward_jump_s * 1e9)
    config["forward_jump_ns"] = round(options.forward_jump_s * 1e9)
    config["max_angle"] = math.pi
    config["max_rate"] = options.max_rate_rad_s
    config["max_pressure"] = 4.0 * vehicle.sensors.pressure_range_Pa
    config["angle_noise"] = model.parameters[0]["angle_noise"][0]
    config["gauge_offset"] = gauge_offset(vehicle) if vehicle.hydraulics is not None else 0.0
    config["pressure_gain"] = vehicle.sensors.pressure_gain
    config["delay_ns"] = round(correction.delay_s * 1e9)
    config["lag"] = correction.lag_s
    config["arm_linear"], config["arm_quadratic"] = correction.arm_linear, correction.arm_quadratic
    config["effects"] = any(has_effects(p) for p in model.parameters)
    config["horizon"] = options.feed_forward_horizon_s
    config["message"] = -1

    channels = np.zeros(len(vehicle.channels), CHANNEL)
    lines = 0
    for row, channel in zip(channels, vehicle.channels, strict=True):
        row["kind"] = int(channel.kind)
        if channel.kind is Kind.ANGLE:
            row["index"] = vehicle.sides.index(channel.name)
        elif channel.kind in (Kind.PRESSURE, Kind.TORQUE):
            row["index"] = lines
            row["offset"] = correction.offset_Pa.get(channel.name, 0.0)
            row["drift"] = correction.drift_Pa_s.get(channel.name, 0.0)
            lines += 1
    if vehicle.hydraulics is not None:
        table = CylinderTable(vehicle.hydraulics, vehicle.sides)
        geometry, areas, line_index = table.geometry, table.areas, table.lines
    else:
        geometry, areas, line_index = np.zeros((0, 5)), np.zeros((0, 2)), np.zeros((0, 2), np.int64)
    return Core(
        config=config,
        channels=channels,
        parameters=np.concatenate(model.parameters),
        state=np.zeros(sides, STATE),
        motion=np.zeros(sides, MOTION),
        output=np.zeros(sides, OUTPUT),
        waiting=np.zeros((sides, WAITING_RING), WAITING),
        rubber=model.rubber,
        pending=np.zeros(PENDING_RING, ESTIMATE),
        line_ns=np.zeros((lines, LINE_RING), np.int64),
        line_value=np.zeros((lines, LINE_RING)),
        geometry=geometry,
        areas=areas,
        lines=line_index,
        plan_ns=np.zeros(PLAN_POINTS, np.int64),
        plan_theta=np.zeros((sides, PLAN_POINTS)),
        scratch_value=np.zeros(lines),
        scratch_state=np.zeros(1, STATE),
        scratch_output=np.zeros(1, OUTPUT),
    )
