# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a recording shows of its own sensors: steps, noise and scatter of stamps, with the vehicle file as prior.

A sensor worse than its sheet is believed; one that seems better keeps the sheet's noise, which harms nothing but sensitivity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.stats import norm

from lugre_steering.data.stamps import evened
from lugre_steering.recording import Array, Mask, Signal

FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
"""Fourth difference: blind to motion and to pump ripple far below the sampling rate, sqrt(70) times white noise."""
SIXTH = np.convolve(FOURTH, [1.0, -2.0, 1.0])
"""Sixth difference, of slow channels: blind to motion up to a tenth of the sampling rate, sqrt(924) times white noise."""
WINDOW_S = 1.0
DITHERED = 0.3
"""White noise, in steps of the resolution, from which it makes the error of rounding white too."""
WORSE, LATE_S = 1.5, 1e-3
"""Times the sheet's noise, and scatter of stamps [s], from which a sensor or its clock is worth a finding."""
STEPS_SEEN = 0.9
"""Share of neighbouring levels that are whole multiples of the resolution, if it is one."""
LOUDER, LOUD_S, SLOWEST_HZ = 2.0, 2.0, 20.0
"""Times the usual noise, for longer than so many seconds, that is a change of it; slower channels cannot tell noise from motion."""
LEVELS, QUIETER = 8, 0.25
"""Parts of a channel's range of which each has its usual noise, as ripple grows with the load; and the share of a part's samples that
are quieter than that: the rest may be disturbed."""


@dataclass(frozen=True)
class SensorNoise:
    """``noise`` standard deviation of the white part of one sample (rounding included where noise dithers it), ``resolution`` its
    step (0: none seen), both in the channel's unit."""

    noise: float
    resolution: float

    @property
    def coarse(self) -> bool:
        """Whether rounding is not dithered by noise, so that its error stays as long as the value does."""
        return self.noise < DITHERED * self.resolution

    def sigma(self, averaged: int = 1) -> float:
        """Standard deviation of the mean of so many samples, rounding included."""
        white = self.noise / np.sqrt(max(averaged, 1))
        return float(np.hypot(white, self.resolution / np.sqrt(12.0))) if self.coarse else float(white)


def resolution(value: Array) -> float:
    """Step of a quantised signal (n,); 0 where its values lie on no grid."""
    levels = np.diff(np.unique(value))
    if levels.size == 0:
        return 0.0
    levels = levels[levels > 1e-9 * max(float(np.abs(value).max()), 1e-30)]
    if levels.size == 0:
        return 0.0
    step = float(np.quantile(levels, 0.1))
    share = np.abs(levels / step - np.round(levels / step)) < 0.05
    return step if float(share.mean()) > STEPS_SEEN else 0.0


def white_noise(signal: Signal) -> float:
    """Standard deviation of the white part of a channel: the usual one of windows of a second without a lost message. Of a slow channel
    it holds what the motion does between the samples, which is as unknown as noise; ``own_noise`` does not."""
    spacing = np.diff(signal.time_s)
    period = float(np.median(spacing))
    whole = sliding_window_view(spacing, 4).max(axis=1) < 1.5 * period
    squares = np.convolve(signal.value, FOURTH, mode="valid") ** 2
    window = (signal.time_s[2:-2] / WINDOW_S).astype(np.int64)
    window -= window[0]
    count = np.bincount(window, whole)
    full = count >= max(3.0, 0.2 * float(count.max()))
    if not full.any():
        return 0.0
    mean = np.bincount(window, squares * whole)[full] / count[full]
    return float(np.sqrt(np.median(mean) / (FOURTH @ FOURTH)))


def own_noise(signal: Signal, *, jumps: bool = False) -> float:
    """The same, of the sensor alone: of a slow channel, each of whose windows holds a start or a stop, the usual one of its samples; so of
    one that ``jumps``, as the torque of a friction does at each reversal."""
    spacing = np.diff(signal.time_s)
    period = float(np.median(spacing))
    if period < 1.1 / SLOWEST_HZ and not jumps:
        return white_noise(signal)
    if spacing.size < SIXTH.size - 1:
        return 0.0
    whole = sliding_window_view(spacing, SIXTH.size - 1).max(axis=1) < 1.5 * period
    size = np.abs(np.convolve(signal.value, SIXTH, mode="valid"))[whole]
    return float(np.median(size) / norm.ppf(0.75) / np.sqrt(SIXTH @ SIXTH)) if size.size else 0.0


def local_noise(signal: Signal, period: float, *, jumps: bool = False) -> Array:
    """Standard deviation (n,) of the white part around each sample, from fourth differences over WINDOW_S: their mean, or where the signal
    ``jumps`` their median.

    What stamp jitter makes of a slope is taken off; windows with a lost message do not count.
    """
    time, value = signal.time_s, signal.value
    width = samples_in(WINDOW_S, period)
    spacing = np.diff(time)
    regular = np.zeros(value.size)
    regular[2:-2] = sliding_window_view(spacing, 4).max(axis=1) < 1.5 * period
    size = np.zeros(value.size)
    size[2:-2] = np.abs(np.convolve(value, FOURTH, mode="valid"))
    if jumps and regular.any():
        told = regular > 0.0
        usual = np.interp(time, time[told], median_filter(size[told], width, mode="reflect")) / norm.ppf(0.75)
    else:
        share = uniform_filter1d(regular, width)
        usual = uniform_filter1d(size * regular, width) / np.maximum(share, 0.1) * np.sqrt(np.pi / 2.0)
    sigma = usual / np.sqrt(FOURTH @ FOURTH)
    jitter = 1.4826 * float(np.median(np.abs(spacing - period)))
    slope = np.gradient(uniform_filter1d(value, samples_in(0.1, period)), time)
    excess = sigma**2 - jitter**2 * uniform_filter1d(slope**2, width)
    return np.asarray(np.sqrt(np.maximum(excess, 0.0)))


def louder(signal: Signal, sheet: float, *, by_level: bool, jumps: bool = False) -> Array:
    """How many times its usual noise, that of its ``sheet`` at least, a channel has around each sample (n,); 1 unless it is LOUDER for
    LOUD_S.

    ``by_level``: what is usual goes with the level of the signal, as ripple with the load; ``jumps``: of a torque of a joint.
    """
    period = float(np.median(np.diff(signal.time_s)))
    found = np.ones(signal.value.size)
    if period > 1.0 / SLOWEST_HZ or signal.value.size < 2 * samples_in(WINDOW_S, period):
        return found
    sigma, level = local_noise(signal, period, jumps=jumps), np.abs(uniform_filter1d(signal.value, samples_in(WINDOW_S, period)))
    floor = max(sheet, 0.5 * resolution(signal.value), 1e-9 * float(level.max()))
    parts = np.array_split(np.argsort(level), LEVELS if by_level else 1)
    middles = [float(np.median(level[part])) for part in parts]
    usual = np.maximum(np.interp(level, middles, [float(np.quantile(sigma[part], QUIETER)) for part in parts]), floor)
    for first, last in stretches(signal.time_s, sigma > LOUDER * usual, 0.5 * WINDOW_S):
        if signal.time_s[last] - signal.time_s[first] > LOUD_S:
            found[first : last + 1] = np.maximum(sigma[first : last + 1] / usual[first : last + 1], 1.0)
    return found


def stretches(time: Array, mask: Mask, bridge_s: float = 0.0) -> list[tuple[int, int]]:
    """(first, last) sample of each stretch of ``mask`` (n,); stretches less than ``bridge_s`` apart count as one."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    merged: list[tuple[int, int]] = []
    for first, last in zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True):
        if merged and time[first] - time[merged[-1][1]] < bridge_s:
            merged[-1] = (merged[-1][0], last)
        else:
            merged.append((first, last))
    return merged


def samples_in(duration_s: float, period: float) -> int:
    """Samples in a stretch of time, three at least."""
    return max(3, round(duration_s / period))


def worse_than_said(signal: Signal, sheet: float, say: Callable[[float], str], *, jumps: bool = False) -> str | None:
    """What a channel shows of its sensor that is clearly worse than its noise by the vehicle file, in words; None if it is not."""
    even, scatter = evened(signal)
    sensor = replace(sensed(even), noise=own_noise(even, jumps=jumps))
    said = []
    if sensor.coarse and sensor.sigma() > WORSE * sheet:
        said.append(f"steps of {say(sensor.resolution)}")
    elif sensor.noise > WORSE * sheet:
        said.append(f"noise of {say(sensor.noise)} per sample")
    if said:
        said[0] += f" (the vehicle file allows {say(sheet)})"
    if scatter > LATE_S:
        said.append(f"messages stamped on receipt, {1e3 * scatter:.1f} ms apart by chance; put back on the even clock of the sensor")
    return "; ".join(said) or None


def sensed(signal: Signal, *, jumps: bool = False) -> SensorNoise:
    """Steps and noise of a channel."""
    return SensorNoise(own_noise(signal, jumps=True) if jumps else white_noise(signal), resolution(signal.value))
