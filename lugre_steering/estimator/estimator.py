# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The estimator of one vehicle: the compiled loop over messages, and its owner."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from types import NoneType
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from lugre_steering.chain.compose import Composition
from lugre_steering.chain.doors import doors, row
from lugre_steering.chain.layout import BASELINE, OUTPUT, STATE
from lugre_steering.chain.rates import MOTION
from lugre_steering.chain.step import Records, acting
from lugre_steering.effects.laws import is_law, slot
from lugre_steering.effects.registry import effect
from lugre_steering.errors import DataError
from lugre_steering.estimator.admission import REJECTED, admit
from lugre_steering.estimator.doubt import DOUBTS, GUARD
from lugre_steering.estimator.held import hold
from lugre_steering.estimator.known import known_range, like_seen, residual_bound
from lugre_steering.estimator.layout import (
    CHANNEL,
    CONFIG,
    ESTIMATE,
    REASONS,
    RESIDUAL,
    RESTART,
    WAITING,
    Core,
    records_of,
    rows_of,
)
from lugre_steering.estimator.lines import LIVED, watch_line
from lugre_steering.estimator.memory import Memory, hand_over, recall, remembered
from lugre_steering.estimator.rate import TRUST
from lugre_steering.estimator.residual import form_residuals
from lugre_steering.estimator.torque import advance
from lugre_steering.given_number import check_number
from lugre_steering.recording import Array, IntArray, Kind
from lugre_steering.schema import quantity
from lugre_steering.vehicle import Vehicle, vehicle_of
from lugre_steering.vehicle.cylinders import CylinderTable, gauge_offset
from lugre_steering.vehicle.model import Model, build_model, most_friction_of_all
from lugre_steering.vehicle.sensors import delay_s, lag_s
from lugre_steering.vehicle.size import fastest

RUBBER_DEGC = (-80.0, 150.0)
LINE_RING = 8192
PENDING_RING = 8192
WAITING_RING = 1024  # one side may come two seconds later than the other, at 500 Hz
PLAN_POINTS = 1024
LIMIT_FRICTION = 3.0
LIMIT_RATE_RAD_S = 1.0


@dataclass(frozen=True)
class Options:
    """Timing rules; the defaults suit sensors of 10 Hz and more."""

    pair_tolerance_s: float = quantity(0.0, 1.0, default=0.002)  # or half a sampling period, if that is more
    max_gap_s: float = quantity(0.001, 60.0, default=0.25)
    backward_jump_s: float = quantity(0.1, 1e6, default=2.0)
    forward_jump_s: float = quantity(0.1, 1e6, default=10.0)
    max_rate_rad_s: float = quantity(0.0, 1e3, default=0.0)  # 0: what no machine of its kind reaches (``vehicle.size.fastest``)
    feed_forward_horizon_s: float = quantity(0.0, 5.0, default=0.0)
    feed_forward_limit_Nm: float = quantity(0.0, 1e9, default=0.0)  # of each side; 0: LIMIT_FRICTION times what its friction reaches
    feed_forward_rate_limit_Nm_s: float = quantity(0.0, 1e12, default=0.0)  # 0: what the bristle's stiffness makes of LIMIT_RATE
    withdrawal_ramp_s: float = quantity(0.0, 60.0, default=0.2)
    recovery_ramp_s: float = quantity(0.0, 60.0, default=1.0)
    plan_tolerance_rad: float = quantity(0.0, 4.0, default=0.2)
    side_tolerance_rad: float = quantity(0.0, 4.0, default=0.2)

    def __post_init__(self) -> None:
        for item in fields(self):
            check_number(item.name, getattr(self, item.name), item.metadata["low"], item.metadata["high"])


@njit(nogil=True, cache=True)
def _process(core, first_line, channel, stamp_ns, value, rate, estimates, residuals):
    """Push messages in the order given; returns how many estimates and residuals were written."""
    n_estimates, n_residuals = np.int64(0), np.int64(0)  # plain zeros are types of their own, and all would be compiled twice
    for i in range(channel.size):
        k = channel[i]
        core.config[0].message += 1
        verdict = admit(core, k, stamp_ns[i], value[i])
        if verdict == REJECTED:
            continue
        ch = core.channels[k]
        ch.accepted += 1
        if ch.kind == Kind.ANGLE:
            n_estimates = advance(core, k, stamp_ns[i], value[i], rate[i], verdict, estimates, n_estimates)
        elif ch.kind == Kind.AIR_TEMPERATURE:
            ch.last_ns = stamp_ns[i]
            for side in range(core.motion.size):
                row(core.state, side, STATE).air_temperature = value[i]
                row(core.parameters, side, BASELINE).air_temperature = value[i]
            continue
        else:
            line = ch.index
            watch_line(ch, stamp_ns[i], value[i])
            ch.period_ns = stamp_ns[i] - ch.last_ns if ch.last_ns != 0 else 0
            ch.last_ns = stamp_ns[i]
            core.line_ns[line, ch.head % core.line_ns.shape[1]] = stamp_ns[i]
            core.line_value[line, ch.head % core.line_ns.shape[1]] = value[i]
            ch.head += 1
        n_residuals = form_residuals(core, first_line, residuals, n_residuals)
    return n_estimates, n_residuals


@njit(nogil=True, cache=True)
def _process_one(held, first_line, channel, stamp_ns, value, rate):
    """``_process`` of the one message that is given by its numbers."""
    single = held.single
    single.channel[0], single.stamp_ns[0], single.value[0], single.rate[0] = channel, stamp_ns, value, rate
    return _process(
        held.core, first_line, single.channel, single.stamp_ns, single.value, single.rate, single.estimates, single.residuals
    )


WHOLE = (int, np.integer)
LAST_NS = 2**63 - 1


class Snapshot(NamedTuple):
    """The state of an estimator, for one of the same model in the same process."""

    model: str
    arrays: list[np.ndarray[Any, Any]]


class Estimator:
    """Steering-torque estimator of one vehicle; a thin owner of the compiled core."""

    def __init__(self, vehicle: Vehicle | str | Path, options: Options | None = None) -> None:
        """``vehicle``: one, or the path of its file. The step is compiled for the effects of this file alone, once per set of them."""
        if not isinstance(options, (Options, NoneType)):
            raise DataError(f"options: got {options!r}, expected Options(...)")
        self.vehicle = vehicle_of(vehicle)
        self.options = options or Options()
        self.channels = self.vehicle.channels
        self._first_line = len(self.vehicle.sides)
        self._composition, self._core = _new_core(self.vehicle, self.options)
        self._estimates = np.zeros(1, ESTIMATE)
        self._residuals = np.zeros(PENDING_RING, RESIDUAL)
        self._held = hold(self._core, self._estimates, self._residuals)

    def push(self, channel: int, stamp_ns: int, value: float, rate: float = math.nan) -> tuple[Records, Records]:
        """One message -> new estimates (0 or 1) and residuals (0 or more), as views that the next push overwrites.

        ``DataError`` for a channel that ``channels`` does not have: the compiled loop would write beside its memory.
        """
        if not isinstance(channel, WHOLE) or not 0 <= channel < len(self.channels):
            raise self._no_channel(channel)
        if not isinstance(stamp_ns, WHOLE) or abs(stamp_ns) > LAST_NS:
            raise DataError(f"stamp_ns: got {stamp_ns!r}, expected a whole number of at most 64 bits")
        try:
            value, rate = float(value), float(rate)
        except (TypeError, ValueError):
            raise DataError(f"value, rate: got {value!r}, {rate!r}, expected numbers") from None
        e, r = _process_one(self._held, self._first_line, channel, stamp_ns, value, rate)
        return self._estimates[:e], self._residuals[:r]

    def push_block(self, channel: ArrayLike, stamp_ns: ArrayLike, value: ArrayLike, rate: ArrayLike) -> tuple[Records, Records]:
        """Many messages in recorded order, (n,) each -> all their estimates and residuals. ``DataError`` as in ``push``."""
        channel, stamp_ns = _whole_numbers("channel", channel), _whole_numbers("stamp_ns", stamp_ns)
        value, rate = _numbers("value", value), _numbers("rate", rate)
        if not channel.shape == stamp_ns.shape == value.shape == rate.shape == (channel.size,):
            sizes = ", ".join(str(column.shape) for column in (channel, stamp_ns, value, rate))
            raise DataError(f"channel, stamp_ns, value, rate: got arrays of shapes {sizes}, expected (n,) of all")
        if channel.size and not 0 <= channel.min() <= channel.max() < len(self.channels):
            raise self._no_channel(channel[(channel < 0) | (channel >= len(self.channels))][0])
        estimates, residuals = np.zeros(channel.size, ESTIMATE), np.zeros(channel.size + PENDING_RING, RESIDUAL)
        e, r = _process(
            self._core, self._first_line, channel, stamp_ns, value, rate, estimates, residuals
        )
        return estimates[:e], residuals[:r]

    def _no_channel(self, channel: object) -> DataError:
        return DataError(f"channel: got {channel}, expected 0 to {len(self.channels) - 1}, the place in channels")

    def begin_at(self, rubber_degC: float) -> None:
        """Rubber temperature [degC] from which every start is made, in place of the vehicle file's; to be given before the first sample.

        Raises ``DataError`` for a vehicle without rubber or a temperature that no rubber has.
        """
        if self.vehicle.rubber is None:
            raise DataError("initial temperature: this vehicle has no rubber, so nothing of it depends on temperature")
        low, high = RUBBER_DEGC
        if not isinstance(rubber_degC, (int, float, np.number)) or not low <= rubber_degC <= high:
            raise DataError(f"initial temperature: got {rubber_degC!r}, expected {low:g} to {high:g} degC")
        self._parameters["rubber_temperature"] = rubber_degC

    def set_plan(self, stamp_ns: ArrayLike, theta: ArrayLike) -> None:
        """Planned angles ahead: absolute times (n,) [ns] and angles (sides, n) [rad]; replaces the former plan.

        ``DataError`` if it is none, is faster than an angle may be, or begins too far from the present one: see ``refuse_plan``.
        Without points there is no plan any more.
        """
        stamp_ns, theta = _whole_numbers("stamp_ns", stamp_ns), _numbers("theta", theta)
        if theta.shape != (len(self.vehicle.sides), stamp_ns.size):
            raise DataError(f"{stamp_ns.size} times and angles of shape {theta.shape}; expected an angle of each side at each time")
        if stamp_ns.size > PLAN_POINTS:
            raise DataError(f"more than {PLAN_POINTS} points")
        farthest = self.vehicle.farthest
        if not (np.abs(theta) <= farthest).all():  # nan is refused too
            bounds = "-pi to pi" if farthest == math.pi else f"{-farthest:g} to {farthest:g}"
            raise DataError(f"an angle that is not a number from {bounds}")
        if (np.diff(stamp_ns) <= 0).any():
            raise DataError("points that are not in order of time")
        if (np.abs(np.diff(theta)) > self._fastest * np.diff(stamp_ns) * 1e-9).any():
            raise DataError(f"faster than {self._fastest:g} rad/s")
        if stamp_ns.size and self._away(stamp_ns, theta):
            raise DataError(f"more than {self.options.plan_tolerance_rad:g} rad from the present angle")
        self._core.plan_ns[: stamp_ns.size] = stamp_ns
        self._core.plan_theta[:, : stamp_ns.size] = theta
        self._core.config[0]["plan_size"], self._core.config[0]["plan_refused_ns"] = stamp_ns.size, 0

    def refuse_plan(self) -> None:
        """A command came that is no plan: what is wanted is not known until the next one, and the feed-forward goes to zero.

        Without a plan in force it follows the present motion again half a second later.
        """
        newest_ns = max(int(self._core.channels[i]["last_ns"]) for i in range(len(self.vehicle.sides)))
        self._core.config[0]["plan_refused_ns"] = max(1, newest_ns)

    @property
    def _fastest(self) -> float:
        """Rate [rad/s] beyond which a change of an angle is a spike."""
        return float(self._core.config[0]["max_rate"])

    def _away(self, stamp_ns: IntArray, theta: Array) -> bool:
        """Whether a plan, at the newest angle's stamp or where it begins later, cannot be gone to from there."""
        for channel, angles in zip(self._core.channels, theta, strict=False):
            now_ns = int(channel["last_ns"])
            if now_ns and now_ns <= stamp_ns[-1]:
                reach = self.options.plan_tolerance_rad + self._fastest * max(0.0, (stamp_ns[0] - now_ns) * 1e-9)
                since = (stamp_ns - stamp_ns[0]) * 1e-9
                planned = np.interp((now_ns - stamp_ns[0]) * 1e-9, since, angles)
                if abs(planned - channel["last_value"]) > reach:
                    return True
        return False

    @property
    def counters(self) -> Mapping[str, Mapping[str, int]]:
        """Accepted samples and rejected ones by reason, per channel name."""
        table: dict[str, dict[str, int]] = {}
        for channel, counted in zip(self.channels, self._core.channels, strict=True):
            counts = {reason: int(n) for reason, n in zip(REASONS, counted["reasons"], strict=True) if n}
            table[_label(channel.kind, channel.name)] = {"accepted": int(counted["accepted"]), **counts}
        return table

    @property
    def rejections(self) -> IntArray:
        """What ``counters`` tell of rejected samples, as numbers only (channels, reasons)."""
        reasons: IntArray = self._core.channels["reasons"].copy()
        return reasons

    @property
    def line_troubles(self) -> list[str]:
        """Which pressure lines are not believed now, and why; while there are any no residual is formed."""
        names = [_label(channel.kind, channel.name) for channel in self.channels]
        lines = [i for i, channel in enumerate(self.channels) if channel.kind is Kind.PRESSURE]
        rows = self._core.channels
        found = [f"{names[i]} frozen" for i in lines if rows[i]["frozen"] and rows[i]["lived"] >= LIVED]
        found += [f"{names[i]} below its range" for i in lines if rows[i]["below"]]
        found += [f"{names[i]} jumped" for i in lines if rows[i]["wrong_until_ns"] > rows[i]["last_ns"]]
        if pair := int(self._core.config[0]["exchanged"]):
            first, second = divmod(pair - 1, len(lines))
            found.append(f"{names[lines[first]]} and {names[lines[second]]} exchanged")
        return found

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
        return int(self._state["saturated"].sum())

    @property
    def memory(self) -> Memory:
        """What the vehicle has been through: rubber temperatures, bristles, memories of effects."""
        return remembered(self._core, self._composition, self.vehicle.sides)

    def resume(self, memory: Memory) -> None:
        """Begin with such a memory, before the first sample; ``DataError`` if it is of another model."""
        recall(self._core, self._composition, self.vehicle.sides, memory)

    def check_continued(self, vehicle: Vehicle) -> None:
        """``DataError`` if a file has other sides or inputs, so that no estimator of it can go on where this one is."""
        if vehicle.channels != self.channels or vehicle.sides != self.vehicle.sides:
            raise DataError("it has other sides, topics or joints")

    def continued(self, vehicle: Vehicle) -> Estimator:
        """An estimator with the model of another file of this vehicle that goes on where this one is, no sample lost.

        ``DataError`` if that file has other sides or inputs.
        """
        self.check_continued(vehicle)
        new = Estimator(vehicle, self.options)
        hand_over(self._core, self._composition, new._core, new._composition)
        return new

    def set_options(self, options: Options) -> None:
        """Go on with other options."""
        _set_options(self._core.config, self._parameters, options, self.vehicle)
        self.options = options

    @property
    def rate_limit(self) -> float:
        """Fastest change of the feed-forward of each side [N m/s]: the option's, or what the vehicle makes of its default."""
        return float(self._core.config[0]["rate_limit"])

    def set_released(self, feed_forward: Sequence[float]) -> None:
        """The feed-forward [N m] of each side was last this; it comes back from there over the recovery ramp."""
        self._core.released[: len(feed_forward)] = feed_forward
        self._core.config["weight"] = 0.0

    @property
    def law_left_steps(self) -> Mapping[str, int]:
        """Steps so far with the coordinate of a law outside the range on which it was seen, by the law's place in the file; what
        was counted before a restart is forgotten."""
        return {place: int(self._state[field].sum()) for place, field in _law_left(self.vehicle).items()}

    def snapshot(self) -> Snapshot:
        """A copy of the whole state, for ``restore``."""
        return Snapshot(self._composition.name, [array.copy() for array in self._core])

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot of an estimator of the same vehicle; ``DataError``, and nothing changed, if it is of another."""
        of_this = isinstance(snapshot, Snapshot) and snapshot.model == self._composition.name
        if not of_this or [array.shape for array in self._core] != [array.shape for array in snapshot.arrays]:
            raise DataError("it is not the snapshot of this model")
        for array, saved in zip(self._core, snapshot.arrays, strict=True):
            array[...] = saved

    @property
    def _parameters(self) -> Records:
        return records_of(self._core.parameters, self._composition.parameters)

    @property
    def _state(self) -> Records:
        return records_of(self._core.state, self._composition.state)


def _whole_numbers(name: str, values: ArrayLike) -> IntArray:
    given = np.asarray(values)
    if given.size and given.dtype.kind not in "iu":
        raise DataError(f"{name}: got {given.dtype}, expected whole numbers")
    return np.asarray(given, np.int64)


def _numbers(name: str, values: ArrayLike) -> Array:
    try:
        return np.asarray(values, np.float64)
    except (TypeError, ValueError):
        raise DataError(f"{name}: got {type(values).__name__}, expected numbers") from None


def doubts(row: Records) -> list[str]:
    """Why the feed-forward of an estimate is held back, in words; nothing where it is not."""
    bits = int(row["doubts"])
    return [text for bit, text in enumerate(DOUBTS) if bits >> bit & 1]


def _law_left(vehicle: Vehicle) -> dict[str, str]:
    """Fields of the state that count the steps outside the range of a law, by the law's place in the file."""
    kept = {f"effects[{i}]": entry.id for i, entry in enumerate(vehicle.effects) if is_law(effect(entry.id))}
    ids = {**kept, **{f"laws[{i}]": slot(i).id for i in range(len(vehicle.laws))}}
    return {place: f"{identity}_outside" for place, identity in ids.items()}


def _label(kind: Kind, name: str) -> str:
    return {Kind.ANGLE: f"angle/{name}", Kind.PRESSURE: f"pressure/{name}"}.get(kind, kind.name.lower())


def _set_options(config: Records, parameters: Records, options: Options, vehicle: Vehicle) -> None:
    """Write the options as the compiled loop reads them."""
    for name in ("pair_tolerance", "max_gap", "backward_jump", "forward_jump"):
        config[f"{name}_ns"] = round(getattr(options, f"{name}_s") * 1e9)
    config["max_rate"] = options.max_rate_rad_s or fastest(vehicle)
    config["horizon"] = options.feed_forward_horizon_s
    config["limit"] = options.feed_forward_limit_Nm or LIMIT_FRICTION * most_friction_of_all(vehicle) / len(vehicle.sides)
    config["rate_limit"] = options.feed_forward_rate_limit_Nm_s or LIMIT_RATE_RAD_S * parameters["sigma_0"].max()
    config["withdrawal_ramp"], config["recovery_ramp"] = options.withdrawal_ramp_s, options.recovery_ramp_s
    config["plan_tolerance"], config["side_tolerance"] = options.plan_tolerance_rad, options.side_tolerance_rad


def _side_ratio(vehicle: Vehicle) -> float:
    """Of Ackermann's geometry from the first side to the second (see ``other_track``); NaN where there is none."""
    if vehicle.axle is None or len(vehicle.sides) < 2:
        return math.nan
    ratio = vehicle.axle.kingpin_distance_m / vehicle.axle.wheelbase_m
    return ratio if vehicle.sides[0] == "left" else -ratio


def _config(vehicle: Vehicle, model: Model) -> Records:
    """What the compiled loop needs to know of the vehicle, but for the options."""
    config = np.zeros(1, CONFIG)
    config["max_angle"] = vehicle.farthest
    config["pressure_range"], config["max_pressure"] = vehicle.sensors.pressure_range_Pa, 4.0 * vehicle.sensors.pressure_range_Pa
    config["angle_noise"] = model.parameters[0]["angle_noise"][0]
    config["gauge_offset"] = gauge_offset(vehicle) if vehicle.hydraulics is not None else 0.0
    config["pressure_gain"] = vehicle.sensors.pressure_gain
    config["accelerates"] = vehicle.sensors.rate_filter_s is not None
    config["delay_ns"] = round(delay_s(vehicle) * 1e9)
    config["lag"] = lag_s(vehicle)
    config["effects"] = np.bitwise_or.reduce([acting(p) for p in model.parameters])
    config["message"] = -1
    config["step_door"], config["arm_door"], config["line_door"] = doors(model.composition)
    config["friction"] = most_friction_of_all(vehicle)
    config["weight"] = 1.0
    config["side_ratio"] = _side_ratio(vehicle)
    known = known_range(vehicle)
    config["seen_angle"], config["seen_rate"], config["residual_bound"] = known.angle, known.rate, residual_bound(vehicle)
    config["seen_coldest"], config["seen_warmest"] = -math.inf, math.inf
    if vehicle.rubber is not None:
        p = model.parameters[0][0]
        degC = p["table_low"] + p["table_step"] * np.arange(len(model.rubber))
        config["seen_coldest"], config["seen_warmest"] = like_seen(known.rubber, degC, model.rubber[:, 1])
    return config


def _channel_rows(vehicle: Vehicle) -> tuple[Records, int]:
    """A row for each channel, and the number of lines among them (a torque sensor counts as one)."""
    rows = np.zeros(len(vehicle.channels), CHANNEL)
    lines = 0
    for i, channel in enumerate(vehicle.channels):
        rows[i]["kind"] = int(channel.kind)
        if channel.kind is Kind.ANGLE:
            rows[i]["index"] = vehicle.sides.index(channel.name)
        elif channel.kind in (Kind.PRESSURE, Kind.TORQUE):
            rows[i]["index"] = lines
            lines += 1
    return rows, lines


def _cylinders(vehicle: Vehicle) -> tuple[Array, Array, IntArray]:
    """Geometry, areas and lines of the cylinders; empty without hydraulics."""
    if vehicle.hydraulics is None:
        return np.zeros((0, 5)), np.zeros((0, 2)), np.zeros((0, 2), np.int64)
    table = CylinderTable(vehicle.hydraulics, vehicle.sides)
    return table.geometry, table.areas, table.lines


def _place(kind: np.dtype[np.void], field: str) -> int:
    """Which number of a row a field of a record is."""
    assert kind.fields is not None
    return kind.fields[field][1] // 8


def _new_core(vehicle: Vehicle, options: Options) -> tuple[Composition, Core]:
    """The composition of a vehicle's effects, and the core that runs it."""
    model = build_model(vehicle, lean=True)
    composition = model.composition
    sides = len(vehicle.sides)
    config, parameters = _config(vehicle, model), np.concatenate(model.parameters)
    _set_options(config, parameters, options, vehicle)
    channels, lines = _channel_rows(vehicle)
    geometry, areas, line_index = _cylinders(vehicle)
    line_parameters = model.lines if vehicle.hydraulics is not None else np.zeros(lines, composition.lines)
    return composition, Core(
        config=config,
        channels=channels,
        parameters=rows_of(parameters),
        line_parameters=rows_of(line_parameters),
        state=rows_of(np.zeros(sides, composition.state)),
        motion=np.zeros(sides, MOTION),
        trust=np.zeros(sides, TRUST),
        guard=np.zeros(sides, GUARD),
        nothing=np.zeros(1, [("motion", MOTION), ("trust", TRUST), ("guard", GUARD)]),
        shadow=rows_of(np.zeros(sides, composition.state)),
        earlier=rows_of(np.zeros(sides, composition.state)),
        bounds=rows_of(np.zeros(2 * sides, composition.state)),
        released=np.zeros(sides),
        output=np.zeros(sides, OUTPUT),
        waiting=np.zeros((sides, WAITING_RING), WAITING),
        rubber=model.rubber,
        pending=np.zeros(PENDING_RING, ESTIMATE),
        line_ns=np.zeros((lines, LINE_RING), np.int64),
        line_value=np.zeros((lines, LINE_RING)),
        geometry=geometry,
        areas=areas,
        lines=line_index,
        law_left=np.array([_place(composition.state, field) for field in _law_left(vehicle).values()], np.int64),
        plan_ns=np.zeros(PLAN_POINTS, np.int64),
        plan_theta=np.zeros((sides, PLAN_POINTS)),
        scratch_value=np.zeros(lines),
        scratch_state=rows_of(np.zeros(1, composition.state)),
        scratch_output=np.zeros(1, OUTPUT),
    )
