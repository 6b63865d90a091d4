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

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

RATE_LIMIT = 100.0  # rad/s, far beyond any steering: such a rate counts as not given


AIR_LIMIT_DEGC = 100.0  # no air is warmer or colder: kelvin, or no temperature at all


class Kind(IntEnum):
    """What a channel carries; the number is the code used inside the compiled loop."""

    ANGLE = 0
    PRESSURE = 1
    AIR_TEMPERATURE = 2
    TORQUE = 3


@dataclass(frozen=True)
class Channel:
    """One wanted quantity and the topic (relative name) that carries it; ``joint`` selects inside a JointState.

    With ``ackermann`` (signed kingpin distance over wheelbase) the topic carries the other track, and this one's angle
    follows from the steering geometry.
    """

    kind: Kind
    name: str
    topic: str
    joint: str = ""
    ackermann: float = 0.0


@dataclass(frozen=True)
class Signal:
    """One channel: ``time_s`` (n,) strictly increasing seconds from the recording's first stamp, ``value`` (n,)."""

    time_s: Array
    value: Array


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


NODE = "steering_torque_estimator"
"""Name of the live node, in whose namespace its results are published and recorded."""
TRUTH = "synthetic_truth"
"""Name in whose namespace simulated recordings keep what a sensor cannot know."""


def unused_name(name: str, taken: Collection[str]) -> str:
    """``name``, or with the lowest number from 2 on that is not taken: run_a, run_a_2, run_a_3."""
    candidates = itertools.chain([name], (f"{name}_{number}" for number in itertools.count(2)))
    return next(candidate for candidate in candidates if candidate not in taken)
