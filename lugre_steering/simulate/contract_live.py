# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What every effect owes the estimator, by which it runs live and in replay."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lugre_steering.chain.step import Records
from lugre_steering.effects.entry import Effect
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import DataError
from lugre_steering.estimator import Estimator, Options
from lugre_steering.estimator.layout import ESTIMATE, RESIDUAL
from lugre_steering.recording import Array, IntArray, Kind
from lugre_steering.serialise import as_json
from lugre_steering.vehicle import EffectEntry, Vehicle

AHEAD = Options(feed_forward_horizon_s=0.3)
"""With a feed-forward that looks ahead."""
START_NS = 1_700_000_000_000_000_000
MEAN_PA, SWING_PA_RAD = 2e6, 1e6
"""Pressures that every line shows: they only have to change, so that residuals are formed."""
ROUNDING = 1e-9
"""Difference of torques, as a share of the largest, that is none."""


class Messages(NamedTuple):
    """What sensors send, in order, (n,) each; see ``Estimator.push_block``."""

    channel: IntArray
    stamp_ns: IntArray
    value: Array

    def part(self, begin: int, end: int | None = None) -> Messages:
        return Messages(self.channel[begin:end], self.stamp_ns[begin:end], self.value[begin:end])


class Answer(NamedTuple):
    """Estimates and residuals."""

    estimates: Records
    residuals: Records


def broken_live(effect: Effect, vehicle: Vehicle, time: Array, theta: Array) -> Iterator[str]:
    """The promises that an effect at its typical size breaks while angles ``theta`` (n,) [rad] come at ``time`` (n,) [s]."""
    messages = _messages(vehicle, time, theta)
    without = _in_one_go(Estimator(_in_place(vehicle), AHEAD), messages)
    estimator = Estimator(_in_place(vehicle, effect), AHEAD)
    fresh, half = estimator.snapshot(), len(messages.channel) // 2
    whole = _in_one_go(estimator, messages)
    if not all(np.isfinite(whole.estimates[name]).all() for name in ("torque", "total", "predicted", "feed_forward")):
        yield "live: the estimator gives no number"
        return
    if _close(whole.estimates["total"], without.estimates["total"]) and _close(whole.residuals["residual"], without.residuals["residual"]):
        yield "live: neither torque nor residual of the estimator changes at its typical size"
    estimator.restore(fresh)
    first = _one_by_one(estimator, messages.part(0, half))
    memory, there = as_json(estimator.memory), estimator.snapshot()
    rest = _one_by_one(estimator, messages.part(half))
    if not _same(Answer(*map(np.concatenate, zip(first, rest, strict=True))), whole):
        yield "live: samples one by one give other torques than all of them in one go, as in replay"
    estimator.restore(there)
    if not _same(_in_one_go(estimator, messages.part(half)), rest):
        yield "live: going on once more from the same state gives other torques (memory outside the state)"
    estimator.restore(fresh)
    try:
        estimator.resume(json.loads(memory))
    except DataError as error:
        yield f"live: its memory cannot be kept over a restart: {error}"
        return
    resumed = _in_one_go(estimator, messages.part(half))
    if not _close(resumed.estimates["total"], rest.estimates["total"]):
        yield "live: after a restart from its memory it gives other torques"
    estimator.restore(fresh)
    estimator.set_options(Options())
    if not _close(_in_one_go(estimator, messages).estimates["total"], whole.estimates["total"]):
        yield "live: looking ahead for the feed-forward changes the torque (memory outside the state)"


def _in_place(vehicle: Vehicle, effect: Effect | None = None) -> Vehicle:
    """A vehicle with the effect at its typical size; all others are there and neutral, so that one step is compiled for all of them."""
    entries: dict[str, dict[str, float]] = {name: {} for name in CATALOGUE}
    if effect is not None and effect.per_line and vehicle.hydraulics is not None:
        entries[effect.id] = {vehicle.hydraulics.lines[0]: effect.parameters[0].typical}
    elif effect is not None:
        entries[effect.id] = {parameter.name: parameter.typical for parameter in effect.parameters}
    return vehicle.replace(effects=tuple(EffectEntry(name, values) for name, values in entries.items()))


def _messages(vehicle: Vehicle, time: Array, theta: Array) -> Messages:
    """Every side at the same angle, and pressures beside it."""
    inputs = [i for i, channel in enumerate(vehicle.channels) if channel.kind in (Kind.ANGLE, Kind.PRESSURE)]
    values = [theta if vehicle.channels[i].kind is Kind.ANGLE else MEAN_PA + SWING_PA_RAD * theta for i in inputs]
    stamp_ns = START_NS + np.round(time * 1e9).astype(np.int64)
    return Messages(np.tile(inputs, time.size).astype(np.int64), np.repeat(stamp_ns, len(inputs)), np.stack(values, axis=1).ravel())


def _in_one_go(estimator: Estimator, messages: Messages) -> Answer:
    """As replay has it."""
    return Answer(*estimator.push_block(*messages, np.full(messages.value.size, np.nan)))


def _one_by_one(estimator: Estimator, messages: Messages) -> Answer:
    """As the live node has it."""
    estimates, residuals = [np.zeros(0, ESTIMATE)], [np.zeros(0, RESIDUAL)]
    for channel, stamp_ns, value in zip(*(column.tolist() for column in messages), strict=True):
        for rows, new in zip((estimates, residuals), estimator.push(channel, stamp_ns, value), strict=True):
            if new.size:
                rows.append(new.copy())
    return Answer(np.concatenate(estimates), np.concatenate(residuals))


def _same(a: Answer, b: Answer) -> bool:
    """To the last bit."""
    return all(mine.tobytes() == other.tobytes() for mine, other in zip(a, b, strict=True))


def _close(a: Array, b: Array) -> bool:
    return a.shape == b.shape and bool(np.abs(a - b).max(initial=0.0) <= ROUNDING * np.abs(b).max(initial=0.0))
