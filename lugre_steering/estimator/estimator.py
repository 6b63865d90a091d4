# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The estimator of one vehicle: the compiled loop over messages, and its owner."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numba import njit

from lugre_steering.chain.layout import OUTPUT
from lugre_steering.chain.rates import MOTION
from lugre_steering.chain.step import Records, has_effects
from lugre_steering.effects.laws import slot
from lugre_steering.errors import DataError
from lugre_steering.estimator.admission import admit
from lugre_steering.estimator.layout import CHANNEL, CONFIG, ESTIMATE, REASONS, RESIDUAL, RESTART, WAITING, Core
from lugre_steering.estimator.rate import TRUST
from lugre_steering.estimator.residual import form_residuals
from lugre_steering.estimator.torque import advance
from lugre_steering.recording import Array, IntArray, Kind
from lugre_steering.schema import quantity
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.cylinders import CylinderTable, gauge_offset
from lugre_steering.vehicle.model import build_model
from lugre_steering.vehicle.sensors import delay_s, lag_s

LINE_RING = 8192
PENDING_RING = 8192
WAITING_RING = 1024  # one side may come two seconds later than the other, at 500 Hz
PLAN_POINTS = 1024


@dataclass(frozen=True)
class Options:
    """Timing rules; the defaults suit sensors of 20 Hz and more."""

    pair_tolerance_s: float = quantity(0.0, 1.0, default=0.002)  # or half a sampling period, if that is more
    max_gap_s: float = quantity(0.001, 60.0, default=0.25)
    backward_jump_s: float = quantity(0.1, 1e6, default=2.0)
    forward_jump_s: float = quantity(0.1, 1e6, default=10.0)
    max_rate_rad_s: float = quantity(0.01, 1e3, default=10.0)
    feed_forward_horizon_s: float = quantity(0.0, 5.0, default=0.0)

    def __post_init__(self) -> None:
        for item in fields(self):
            value, low, high = getattr(self, item.name), item.metadata["low"], item.metadata["high"]
            if not low <= value <= high:  # nan is refused too
                raise DataError(f"{item.name}: got {value:g}, expected {low:g} to {high:g}")


@njit(nogil=True, cache=True)
def _process(core, first_line, channel, stamp_ns, value, rate, estimates, residuals):
    """Push messages in the order given; returns how many estimates and residuals were written."""
    n_estimates, n_residuals = 0, 0
    for i in range(channel.size):
        k = channel[i]
        core.config[0].message += 1
        if not admit(core, k, stamp_ns[i], value[i]):
            continue
        ch = core.channels[k]
        ch.accepted += 1
        if ch.kind == Kind.ANGLE:
            n_estimates = advance(core, k, stamp_ns[i], value[i], rate[i], estimates, n_estimates)
        elif ch.kind == Kind.AIR_TEMPERATURE:
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
        n_residuals = form_residuals(core, first_line, residuals, n_residuals)
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
        return int(self._core.channels["reasons"][:, RESTART].sum())

    @property
    def saturated_steps(self) -> int:
        """Steps so far with a rubber temperature outside the rubber table."""
        return int(self._core.state["saturated"].sum())

    @property
    def law_left_steps(self) -> Mapping[str, int]:
        """Steps so far with the coordinate of a law outside the range on which it was seen, by the law's place in the file; what
        was counted before a restart is forgotten."""
        state = self._core.state
        return {f"laws[{i}]": int(state[f"{slot(i).id}_outside"].sum()) for i in range(len(self.vehicle.laws))}

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
    model = build_model(vehicle, lean=True)
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
    config["delay_ns"] = round(delay_s(vehicle) * 1e9)
    config["lag"] = lag_s(vehicle)
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
        line_parameters=model.lines if vehicle.hydraulics is not None else np.zeros(lines, model.composition.lines),
        state=np.zeros(sides, model.composition.state),
        motion=np.zeros(sides, MOTION),
        trust=np.zeros(sides, TRUST),
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
        scratch_state=np.zeros(1, model.composition.state),
        scratch_output=np.zeros(1, OUTPUT),
    )
