# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A sequential detector of residuals that are no longer what they were: scores of each manoeuvre, pre-whitened, against what is usual.

A manoeuvre is a stretch of motion over ``MANOEUVRE`` breakaway angles; standing still counts for nothing. Its scores are the logarithms
of the root mean square and of the largest residual, and the mean residual in the direction of motion as a share of the static
friction: more error, a kick at some place, another level. What is usual of each (level, scatter and the memory of one manoeuvre for
the next) is learned from the machine itself: robustly, from the latest ``KEPT`` manoeuvres but for the newest ``LAG``, which an onset
may already have spoiled, and nothing while the model does not match. The squares of the innovations, cut at ``CUT`` standard
deviations, go into a cumulative sum (Page 1954, Biometrika 41, 100-115), which forgets ``SLACK`` a manoeuvre.

A machine that has never been as it should be is as usual to it. Where the vehicle file tells the error that its calibration left, one that
is far beyond is told at once as an implausible residual (``estimator.doubt``), and days of sound machines differ too much for a closer look
(``docs/online_watch.md``); where it does not, the watch says that it can tell changes only.

How often it speaks although nothing has changed is measured, not computed: ``python -m lugre_steering.bench watch``.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numba import njit

from lugre_steering.chain.step import Records
from lugre_steering.errors import DataError
from lugre_steering.estimator.known import residual_bound
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.model import baseline_parameters, most_friction_of_all

MANOEUVRE = 2.0
FLOOR_SHARE = 1e-3
"""Of the static friction: residuals below are no news however they grow."""
LEARN, KEPT, LAG, AGAIN = 60, 2000, 40, 20
"""Scores needed before anything is judged, kept (some hours: days are unlike), too new to count; after so many it is taken anew."""
CUT, SLACK = 3.0, 2.0
SCORES = 3
WIDE, WIDE_SIGMA = 0.95, 1.96
"""Quantile of the deviations that tells their scatter, and what it is of a normal one: days of two kinds have two humps."""
LEAST_SCATTER = (0.1, 0.01, 0.1)
"""A tenth more or less error, or a hundredth of the friction, is never unusual."""
THRESHOLD = 40.0
"""Of the cumulative sum, for one false alarm in about 1000 h; see ``bench watch``."""
MOST = 2.0
"""Times the threshold that the sum reaches at most, so that some dozens of manoeuvres as usual end an alarm."""

Memory = Mapping[str, str]
"""The record ``STATE`` as texts, and what it looked like."""

UNCALIBRATED = "the vehicle file has no calibration (lugre-steering calibrate), so that a model which is wrong from the start is usual"
RING = KEPT + LAG
STATE = np.dtype(
    [
        ("scores", np.float64, (RING, SCORES)),
        ("count", np.int64),
        ("level", np.float64, (SCORES,)),
        ("scatter", np.float64, (SCORES,)),
        ("memory", np.float64, (SCORES,)),
        ("sum", np.float64),
        ("last", np.float64, (SCORES,)),
        ("sound_ns", np.int64),  # stamp at which the sum was last zero
        ("since_ns", np.int64),  # stamp from which the model does not match, so that what comes is not what is usual; 0: it does
    ]
)
_FORM = str(STATE)  # made once: it takes longer than all that is in it


@njit(cache=True)
def _learn(s):
    """Level, scatter and memory of the scores that are old enough."""
    known = min(s.count, RING)
    old = known - LAG if known - LAG >= LEARN else min(known, LEARN)
    series = np.empty(old)
    for k in range(SCORES):
        for i in range(old):
            series[i] = s.scores[(s.count - known + i) % RING, k]
        level = np.median(series)
        away = series - level
        scatter = max(LEAST_SCATTER[k], np.quantile(np.abs(away), WIDE) / WIDE_SIGMA)
        cut = np.minimum(np.maximum(away, -CUT * scatter), CUT * scatter)
        s.level[k], s.scatter[k] = level, scatter
        s.memory[k] = min(max(np.sum(cut[1:] * cut[:-1]) / max(np.sum(cut * cut), 1e-12), 0.0), 0.9)


@njit(cache=True)
def weigh(s, scores):
    """The cumulative sum after the scores of one more manoeuvre; 0 while the usual is not known."""
    if s.since_ns == 0:
        for k in range(SCORES):
            s.scores[s.count % RING, k] = scores[k]
        s.count += 1
        if s.count == LEARN or (s.count > LEARN and s.count % AGAIN == 0):
            _learn(s)
    squares, known = 0.0, s.count >= LEARN
    for k in range(SCORES):
        if known:
            innovation = scores[k] - s.level[k] - s.memory[k] * (s.last[k] - s.level[k])
            squares += min(CUT**2, innovation**2 / (s.scatter[k] ** 2 * (1.0 - s.memory[k] ** 2)))
        s.last[k] = scores[k]
    if not known:
        return 0.0
    s.sum = max(0.0, s.sum + squares / SCORES - SLACK)
    return s.sum


def warm_up() -> None:
    """Compile, or load from the cache, what a manoeuvre calls."""
    weigh(np.zeros(1, STATE)[0], (0.0,) * SCORES)


class Watch:
    """The detector of one vehicle, fed with what the estimator returns."""

    def __init__(self, vehicle: Vehicle, threshold: float = THRESHOLD) -> None:
        self._friction = most_friction_of_all(vehicle)
        self._travel = MANOEUVRE * self._friction / len(vehicle.sides) / baseline_parameters(vehicle)["sigma_0"]
        self._threshold = threshold
        self._state: Records = np.zeros(1, STATE)
        self.bound_Nm = residual_bound(vehicle)
        """Residuals beyond it are implausible by the calibration; 0 without one."""
        self._angle, self._gone, self._fresh = math.nan, 0.0, False
        self._squares, self._directed, self._largest, self._count, self._direction = 0.0, 0.0, 0.0, 0, 0.0
        self.scores: list[tuple[float, ...]] = []
        """Scores of the manoeuvres that have come since somebody took them."""

    @property
    def since_ns(self) -> int:
        """Stamp from which the model seems not to match, as long as it does not; 0 while it does."""
        return int(self._state[0]["since_ns"])

    @property
    def learned(self) -> int:
        """Manoeuvres that have told what is usual."""
        return int(self._state[0]["count"])

    @property
    def words(self) -> str:
        """What it can tell now."""
        usual = f"once {LEARN} manoeuvres have told what is usual ({self.learned} so far)" if self.learned < LEARN else ""
        return " ".join(filter(None, ["changes", usual])) + ("" if self.bound_Nm else f"; {UNCALIBRATED}")

    @property
    def memory(self) -> Memory:
        """What it has learned and found, for ``resume``; of a manoeuvre that is under way nothing."""
        return {"form": _FORM, "record": base64.b64encode(self._state.tobytes()).decode("ascii")}

    def resume(self, memory: Memory) -> None:
        """Go on with what one of this vehicle has learned; ``DataError``, and nothing changed, if it is of another version."""
        if memory.get("form") != _FORM:
            raise DataError("what the watch had learned is of another version")
        try:
            record = np.frombuffer(base64.b64decode(memory["record"], validate=True), STATE)
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(f"what the watch had learned cannot be read ({error})") from error
        if record.shape != self._state.shape:
            raise DataError(f"what the watch had learned is of {record.size} vehicles")
        self._state[...] = record

    def turned(self, angles: Sequence[float]) -> None:
        """The sides [rad] are there now: the vehicle steers by their mean, whichever of them it has."""
        angle = sum(angles) / len(angles)
        if math.isnan(self._angle):
            self._angle = angle
        way = angle - self._angle
        # Noise turns nothing: a step counts when it is larger than a hundredth of a breakaway angle.
        if abs(way) > 0.005 * self._travel:
            self._gone += abs(way)
            self._angle, self._direction, self._fresh = angle, math.copysign(1.0, way), True

    def add(self, stamp_ns: int, residual: float) -> bool:
        """One more residual [N m]; whether an alarm begins with it."""
        if not self._state[0]["sound_ns"]:
            self._state[0]["sound_ns"] = stamp_ns
        if self._fresh or self._count:
            self._squares += residual * residual
            self._directed += self._direction * residual
            self._largest = max(self._largest, abs(residual))
            self._count += 1
        if self._gone < self._travel or self._count == 0:
            return False
        floor = FLOOR_SHARE * self._friction
        rms = math.sqrt(self._squares / self._count)
        scores = (
            math.log(math.hypot(rms, floor)),
            self._directed / self._count / self._friction,
            math.log(math.hypot(self._largest, floor)),
        )
        self._gone, self._squares, self._directed, self._largest, self._count = 0.0, 0.0, 0.0, 0.0, 0
        self._fresh = False
        self.scores = [*self.scores[-LAG:], scores]
        return self._judge(stamp_ns, scores)

    def _judge(self, stamp_ns: int, scores: tuple[float, ...]) -> bool:
        state = self._state[0]
        level = float(weigh(state, scores))
        state["sum"] = min(level, MOST * self._threshold)
        if level == 0.0:
            state["since_ns"], state["sound_ns"] = 0, stamp_ns
        elif level > self._threshold and not state["since_ns"]:
            state["since_ns"] = state["sound_ns"]
            return True
        return False
