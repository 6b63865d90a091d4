# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Statistics, time axis and curves of data that stream by: bounded memory, however long the recording."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from lugre_steering.recording import Array, IntArray
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.model import most_friction_of_all

BINS = 2048  # columns of a curve: more than a picture has pixels
FIRST_BIN_S = 1e-3
BROKEN_S = 0.5  # a curve is broken where nothing came for longer than this
LARGE_SHARE = 0.7
ALIKE, WRONG_TIMES, UNIT_TIMES = 0.85, 1.6, 30.0
"""Correlation about zero from which measured and estimated torque have one shape, the factor between them that no nominal value and
hardly any weather explains, and the one from which units are likelier."""
NOTABLE_SHARE = 0.05
"""Of the static friction: below, the torque is too small to compare with."""


@dataclass
class Range:
    """Smallest and largest value seen, and when."""

    low: float = math.inf
    low_s: float = 0.0
    high: float = -math.inf
    high_s: float = 0.0

    def add(self, time_s: Array, value: Array) -> None:
        """``time_s`` (n,), ``value`` (n,), n > 0."""
        i, j = int(value.argmin()), int(value.argmax())
        self.merge(Range(float(value[i]), float(time_s[i]), float(value[j]), float(time_s[j])))

    def merge(self, other: Range) -> None:
        """Take in what another one saw."""
        if other.low < self.low:
            self.low, self.low_s = other.low, other.low_s
        if other.high > self.high:
            self.high, self.high_s = other.high, other.high_s


@dataclass(frozen=True)
class Peaks:
    """Largest and smallest torque [N m], and when [s]."""

    max_Nm: float
    max_at_s: float
    min_Nm: float
    min_at_s: float


@dataclass(frozen=True)
class PeaksOfBoth:
    """Peaks of the measured torque (of cylinders or a torque sensor) and of the estimate."""

    cylinder_torque: Peaks
    estimate: Peaks


@dataclass(frozen=True)
class Agreement:
    """How well estimates agree with measured torque: RMSE and bias (mean residual) [N m], R2 (None where the measured torque never
    changes), and peaks."""

    samples: int
    rmse_Nm: float
    r2: float | None
    bias_Nm: float
    peaks: PeaksOfBoth


@dataclass
class Comparison:
    """Estimates against measured torque [N m] as they come.

    Mean and variance are merged from batches after Chan, Golub and LeVeque (1983), The American Statistician 37(3),
    which loses no digits to a large mean, unlike sums of squares.
    """

    count: int = 0
    mean: float = 0.0  # of the measured torque
    spread: float = 0.0  # sum of (measured - mean)^2
    error: float = 0.0  # sum of residuals
    squares: float = 0.0  # sum of residual^2
    estimates: float = 0.0  # sum of estimate^2
    measured: Range = field(default_factory=Range)
    estimate: Range = field(default_factory=Range)

    def add(self, time_s: Array, measured: Array, residual: Array) -> None:
        """n samples at ``time_s`` (n,); residual = measured - estimate."""
        if not measured.size:
            return
        mean = float(measured.mean())
        batch = Comparison(
            measured.size,
            mean,
            float(((measured - mean) ** 2).sum()),
            float(residual.sum()),
            float((residual**2).sum()),
            float(((measured - residual) ** 2).sum()),
        )
        batch.measured.add(time_s, measured)
        batch.estimate.add(time_s, measured - residual)
        self.merge(batch)

    def merge(self, other: Comparison) -> None:
        """Take in the samples of another one."""
        if not other.count:
            return
        count = self.count + other.count
        apart = other.mean - self.mean
        self.spread += other.spread + apart * apart * self.count * other.count / count
        self.mean += apart * other.count / count
        self.count = count
        self.error += other.error
        self.squares += other.squares
        self.estimates += other.estimates
        self.measured.merge(other.measured)
        self.estimate.merge(other.estimate)

    def result(self) -> Agreement | None:
        """What they came to; None without samples."""
        if not self.count:
            return None

        def peaks(seen: Range) -> Peaks:
            return Peaks(seen.high, seen.high_s, seen.low, seen.low_s)

        return Agreement(
            samples=self.count,
            rmse_Nm=math.sqrt(self.squares / self.count),
            r2=1.0 - self.squares / self.spread if self.spread > 0.0 else None,
            bias_Nm=self.error / self.count,
            peaks=PeaksOfBoth(peaks(self.measured), peaks(self.estimate)),
        )


def is_large(residual_rms: float, estimate_rms: float, measured_rms: float, vehicle: Vehicle) -> bool:
    """Whether a residual is so large beside the torque that wrong units, signs or plugs are likelier than missing physics."""
    friction = most_friction_of_all(vehicle)
    return estimate_rms > NOTABLE_SHARE * friction and residual_rms > LARGE_SHARE * min(estimate_rms, measured_rms)


def sheet_words(residual_squares: float, estimate_squares: float, measured_squares: float, vehicle: Vehicle) -> str | None:
    """What to say where the measured torque follows the estimate in shape but not in size, so that entries of the vehicle file are
    likely wrong; None where it does not. Sums of squares over the same samples [N2 m2].

    The sum of products follows from them, residual = measured - estimate; the best factor on the estimate is that over the
    estimate's squares.
    """
    friction = most_friction_of_all(vehicle)
    product = 0.5 * (measured_squares + estimate_squares - residual_squares)
    if not product > ALIKE * math.sqrt(estimate_squares * measured_squares) or friction <= 0.0:
        return None
    times = product / estimate_squares
    if not WRONG_TIMES < max(times, 1.0 / times) < UNIT_TIMES:
        return None
    level = "friction.coulomb" if vehicle.friction is not None else "contact.coulomb_torque_Nm"
    entries = [*(["axle.load_N"] if vehicle.axle is not None else []), level]
    entries.append("bores" if vehicle.hydraulics is not None else "the unit of the torque sensor")
    warm = ", and how warm the rubber was (--initial-temperature)" if vehicle.rubber is not None else ""
    return f"measured torque is {times:.2g} times what this sheet can give; check {', '.join(entries)}{warm}"


def r2_words(r2: float | None, name: str = "R2") -> str:
    """R2 after a comma; beyond -1 its size says nothing more."""
    if r2 is None:
        return ""
    return f", {name} {r2:.5f}" if r2 >= -1.0 else f", {name} below -1"


class Timeline:
    """Stamps as seconds since a start that never run backward: where a clock was set back, time goes on."""

    def __init__(self, start_ns: int) -> None:
        self._origin_ns = start_ns
        self._last_ns = start_ns
        self.set_back = 0

    def __call__(self, stamp_ns: IntArray) -> Array:
        """Seconds (n,) of the next stamps (n,) [ns]."""
        step = np.diff(stamp_ns, prepend=self._last_ns)
        if stamp_ns.size:
            self._last_ns = int(stamp_ns[-1])
        back = np.minimum(step, 0).cumsum()
        self.set_back += int((step < 0).sum())
        seconds: Array = (stamp_ns - back - self._origin_ns) * 1e-9
        if stamp_ns.size:
            self._origin_ns += int(back[-1])
        return seconds


class Curves:
    """Curves over one time axis, reduced on the fly to the smallest and largest value per bin, so that peaks survive.

    When time outgrows the bins, neighbours are merged and the bins become twice as wide.
    """

    def __init__(self, count: int) -> None:
        self.bin_s = FIRST_BIN_S
        self._low = np.full((count, BINS), np.inf)
        self._high = np.full((count, BINS), -np.inf)

    def add(self, time_s: Array, values: Array) -> None:
        """``time_s`` (n,) seconds, not negative, never falling; ``values`` (curves, n)."""
        if not time_s.size:
            return
        while time_s[-1] >= BINS * self.bin_s:
            self._widen()
        column = (time_s / self.bin_s).astype(np.int64)
        first = np.flatnonzero(np.diff(column, prepend=-1))
        at = column[first]
        self._low[:, at] = np.minimum(self._low[:, at], np.minimum.reduceat(values, first, axis=1))
        self._high[:, at] = np.maximum(self._high[:, at], np.maximum.reduceat(values, first, axis=1))

    def _widen(self) -> None:
        self.bin_s *= 2.0
        for edge, reduce, empty in ((self._low, np.minimum, np.inf), (self._high, np.maximum, -np.inf)):
            edge[:, : BINS // 2] = reduce(edge[:, ::2], edge[:, 1::2])
            edge[:, BINS // 2 :] = empty

    def bins(self) -> tuple[Array, Array, Array]:
        """Middle of each filled bin (m,) [s], smallest and largest values (curves, m)."""
        filled = np.flatnonzero(np.isfinite(self._low).any(axis=0))
        middle: Array = (filled + 0.5).astype(np.float64) * self.bin_s
        return middle, self._low[:, filled], self._high[:, filled]

    def lines(self) -> tuple[Array, Array]:
        """Time (m,) and curves (k, m) that go through the smallest and largest value of every bin; NaN breaks them."""
        middle, low, high = self.bins()
        both = np.stack([low, high], axis=-1).reshape(len(low), -1)
        time = np.repeat(middle, 2)
        breaks = 2 * (np.flatnonzero(np.diff(middle) > max(BROKEN_S, 2.0 * self.bin_s)) + 1)
        return np.insert(time, breaks, np.nan), np.insert(both, breaks, np.nan, axis=1)
