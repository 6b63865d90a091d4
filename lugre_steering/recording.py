# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Time base and named SI channels: what a recording is once it has left its file format.

Nomenclature of every measured signal (SI; positive angle and torque turn the track to the left):

=================  ==========================================  =======
channel            content                                     unit
=================  ==========================================  =======
angle/<side>       steering angle theta of one track           rad
rate/<side>        its rate omega, where the sensor gives one  rad/s
pressure/<line>    pressure of one hydraulic line              Pa
air_temperature    ambient air                                 degC
measured_torque    torque from a torque sensor                 N m
=================  ==========================================  =======
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lugre_steering.errors import DataError
from lugre_steering.given_number import check_number
from lugre_steering.result import html

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
Mask = NDArray[np.bool_]

RATE_LIMIT = 1000.0  # rad/s, far beyond any joint: such a rate counts as not given


AIR_LIMIT_DEGC = 100.0  # no air is warmer or colder: kelvin, or no temperature at all


FARTHEST = {"rad": np.pi, "m": 100.0}
"""Largest magnitude of an angle, or of the position of a linear axis, by its unit: beyond, it comes in another one."""
SLOWEST_S = 5.0
"""Sampling interval of no steering angle: beyond, times come in another unit."""
Samples = ArrayLike | tuple[ArrayLike, ArrayLike]
"""One channel as arrays: values on the clock of the recording, or a pair of its own times [s] and values."""
BySide = ArrayLike | Mapping[str, Samples]
_LIMITS = {
    "rate/": (RATE_LIMIT, "rad/s"), "pressure/": (1e9, "Pa"), "measured_torque": (1e9, "N m"), "air_temperature": (AIR_LIMIT_DEGC, "degC"),
}  # fmt: skip
"""Largest magnitude of each channel: beyond, it comes in another unit."""


class Kind(IntEnum):
    """What a channel carries; the number is the code used inside the compiled loop."""

    ANGLE = 0
    PRESSURE = 1
    AIR_TEMPERATURE = 2
    TORQUE = 3


@dataclass(frozen=True)
class Channel:
    """One wanted quantity and the topic (relative name) that carries it; ``joint`` selects inside a JointState.

    ``farthest``: largest magnitude of an angle [rad] or position [m]. With ``ackermann`` (signed kingpin distance over wheelbase) the topic
    carries the other track, and this one's angle follows from the steering geometry.
    """

    kind: Kind
    name: str
    topic: str
    joint: str = ""
    ackermann: float = 0.0
    farthest: float = FARTHEST["rad"]


@dataclass(frozen=True, eq=False)
class Signal:
    """One channel: ``time_s`` (n,) strictly increasing seconds from the recording's first stamp, ``value`` (n,).

    ``even``: stamps that came late by chance have been put back in their places, or none had.
    """

    time_s: Array
    value: Array
    even: bool = False


@dataclass(frozen=True)
class Finding:
    """Something about the data that a reader of any result must know (kept with the result, never only logged)."""

    finding: str
    topic: str
    statement: str
    intervals_s: tuple[tuple[float, float], ...] = ()


    def in_bag(self, bag: str) -> BagFinding:
        """The finding with the name of the bag it was made in."""
        return BagFinding(self.finding, self.topic, bag, self.intervals_s, self.statement)


@dataclass(frozen=True)
class BagFinding:
    """A finding about one bag: what (``finding``, one word), the topic if there is one, stretches [s] since the first stamp."""

    finding: str
    topic: str
    bag: str
    intervals_s: tuple[tuple[float, float], ...]
    statement: str


@dataclass(frozen=True)
class Recording:
    """Signals of one bag, each sorted and free of duplicates, with what was rejected on the way in."""

    name: str
    start_ns: int
    angle: Mapping[str, Signal]
    pressure: Mapping[str, Signal]
    rate: Mapping[str, Signal] = field(default_factory=dict)
    air_temperature: Signal | None = None
    measured_torque: Signal | None = None
    rejected: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def __repr__(self) -> str:
        channels = "; ".join(f"{row['channel']}: {row['samples']} samples to {row['until (s)']:.6g} s" for row in self._rows())
        return f"Recording({self.name!r}; {channels})"

    def _repr_html_(self) -> str:
        return html("Recording", self.name, self._rows())

    def _rows(self) -> list[dict[str, Any]]:
        """Its signals in a few lines."""
        signals: dict[str, Signal | None] = {f"angle/{side}": signal for side, signal in self.angle.items()}
        signals |= {f"rate/{side}": signal for side, signal in self.rate.items()}
        signals |= {f"pressure/{line}": signal for line, signal in self.pressure.items()}
        signals |= {"air_temperature": self.air_temperature, "measured_torque": self.measured_torque}
        return [
            {"channel": channel, "samples": signal.time_s.size, "until (s)": float(signal.time_s[-1])}
            for channel, signal in signals.items()
            if signal is not None and signal.time_s.size
        ]

    @classmethod
    def from_arrays(
        cls,
        time: ArrayLike,
        *,
        angle: BySide,
        torque: Samples | None = None,
        pressure: Mapping[str, Samples] | None = None,
        rate: BySide | None = None,
        air: Samples | None = None,
        name: str = "recording",
        unit: str = "rad",
        farthest: float | None = None,
    ) -> Recording:
        """A recording made of arrays, for everything that takes a bag.

        ``time`` (n,) [s] (or datetime64) strictly increasing, of any origin; ``angle`` [rad] and ``rate`` [rad/s] as {side:
        samples}, or one array for the joint 'left' of a vehicle with a single one; ``torque`` [N m] of a torque sensor, or
        ``pressure`` [Pa] as {line: samples}, gauge or absolute as the vehicle file says; ``air`` [degC]. Samples are an array
        (n,), or a pair (time, array) where a sensor has a clock of its own. Samples that are no finite number are left out and
        counted in ``rejected``. ``unit``: "m" where ``angle`` holds positions [m] of a linear axis, ``rate`` speeds [m/s] and ``torque``
        forces [N]; ``farthest``: largest magnitude that an angle or position can have, where that is more than half a turn or 100 m.
        ``DataError`` for anything that cannot be meant.
        """
        if not isinstance(name, str):
            raise DataError(f"name: got {name!r}, expected a text")
        if unit not in tuple(FARTHEST):
            raise DataError(f"unit: got {unit!r}, expected {' or '.join(FARTHEST)}")
        if farthest is not None:
            check_number("farthest", farthest, 0.0)
        angles = FARTHEST[unit] if farthest is None else farthest, unit
        given = {f"angle/{side}": samples for side, samples in _by_side(angle).items()}
        if not given:
            raise DataError("angle: got no side, expected {side: samples}, or the samples of a single joint")
        given |= {f"rate/{side}": samples for side, samples in _by_side({} if rate is None else rate).items()}
        lines = {} if pressure is None else pressure
        if not isinstance(lines, Mapping):
            raise DataError(f"pressure: got {type(lines).__name__}, expected a mapping {{line: samples}}")
        given |= {f"pressure/{line}": samples for line, samples in lines.items()}
        given |= {label: samples for label, samples in (("measured_torque", torque), ("air_temperature", air)) if samples is not None}
        clock = _clock(time, "time")
        if (step := float(np.median(np.diff(clock)))) > SLOWEST_S:
            raise DataError(f"time: got a sample every {step:g} s, expected times in seconds, at most {SLOWEST_S:g} s apart")
        signals, rejected = {}, {}
        for label, samples in given.items():
            signals[label], lost = _signal(label, samples, clock, angles)
            if lost:
                rejected[label] = {"not_finite": lost}
        start = min(float(signal.time_s[0]) for signal in signals.values())
        signals = {label: Signal(signal.time_s - start, signal.value) for label, signal in signals.items()}

        def part(kind: str) -> dict[str, Signal]:
            return {label.removeprefix(kind): signal for label, signal in signals.items() if label.startswith(kind)}

        return cls(
            name=name, start_ns=max(round(start * 1e9), 1), angle=part("angle/"), pressure=part("pressure/"), rate=part("rate/"),
            air_temperature=signals.get("air_temperature"), measured_torque=signals.get("measured_torque"), rejected=rejected,
        )  # fmt: skip


AXIS = "; unit='m' says that they are positions [m] of a linear axis, farthest= that a joint turns further"


def _by_side(samples: BySide) -> Mapping[str, Samples]:
    return samples if isinstance(samples, Mapping) else {"left": samples}


def _clock(time: ArrayLike, label: str) -> Array:
    """Times (n,) [s], checked."""
    clock = _numbers(_seconds(time), label)
    if clock.size < 2 or not np.isfinite(clock).all() or not (np.diff(clock) > 0.0).all():
        raise DataError(f"{label}: got {clock.size} times, expected at least two finite ones [s] that increase strictly")
    return clock


def _seconds(time: ArrayLike) -> ArrayLike:
    """Dates and durations of NumPy or pandas as seconds, dates since 1970."""
    kind = getattr(getattr(time, "dtype", None), "kind", "")
    if kind == "M":  # those of pandas with a time zone are counted in UTC
        return _seconds(np.asarray(time, "datetime64[ns]") - np.datetime64(0, "s"))
    return np.asarray(time) / np.timedelta64(1, "s") if kind == "m" else time


def _signal(label: str, samples: Samples, clock: Array, angles: tuple[float, str]) -> tuple[Signal, int]:
    """The finite samples of one channel, checked, and how many are left out; ``angles``: largest magnitude and unit of these."""
    if isinstance(samples, tuple):
        if len(samples) != 2:
            raise DataError(f"{label}: got {len(samples)} arrays, expected an array or a pair (time, array)")
        clock, samples = _clock(samples[0], f"time of {label}"), samples[1]
    value = _numbers(samples, label)
    if value.size != clock.size:
        raise DataError(f"{label}: got {value.size} samples for {clock.size} times, expected one for each")
    finite = np.isfinite(value)
    if not finite.any():
        raise DataError(f"{label}: got no finite sample, expected some")
    limits = {"angle/": angles, **_LIMITS}
    limit, unit = next(bound for kind, bound in limits.items() if label.startswith(kind))
    largest = float(np.abs(value[finite]).max())
    if largest > limit:
        raise DataError(f"{label}: got {largest:g}, expected values in {unit} up to {limit:g}{AXIS if unit == 'rad' else ''}")
    return Signal(clock[finite], value[finite]), int((~finite).sum())


def _unmasked(values: Any) -> NDArray[Any]:
    """An array with nan for each masked sample, whose mask NumPy would forget."""
    if isinstance(values, np.ma.MaskedArray):
        return np.where(np.ma.getmaskarray(values), np.nan, values.data)
    return np.asarray(values)


def _numbers(values: ArrayLike, label: str) -> Array:
    try:
        given = _unmasked(values)
        if given.dtype.kind in "cmM":  # NumPy would drop the imaginary part, or the unit of time
            raise DataError(f"{label}: got {given.dtype}, expected real numbers")
        array = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        raise DataError(f"{label}: got {type(values).__name__}, expected an array of numbers") from None
    if array.ndim != 1:
        raise DataError(
            f"{label}: got an array of shape {array.shape}, expected (n,); of several sides or lines a mapping {{name: samples}}, "
            "with a clock of its own a tuple (time, samples)"
        )
    return array


NODE = "steering_torque_estimator"
"""Name of the live node, in whose namespace its results are published and recorded."""
COMMAND = "steering/command"
"""Topic of planned angles, live and recorded."""
TRUTH = "synthetic_truth"
"""Name in whose namespace simulated recordings keep what a sensor cannot know."""


def unused_name(name: str, taken: Collection[str]) -> str:
    """``name``, or with the lowest number from 2 on that is not taken: run_a, run_a_2, run_a_3."""
    candidates = itertools.chain([name], (f"{name}_{number}" for number in itertools.count(2)))
    return next(candidate for candidate in candidates if candidate not in taken)
