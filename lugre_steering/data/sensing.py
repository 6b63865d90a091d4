# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a recording shows of its own sensors: steps, noise and scatter of stamps, with the vehicle file as prior.

A sensor worse than its sheet is believed; one that seems better keeps the sheet's noise, which harms nothing but sensitivity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from lugre_steering.data.stamps import evened
from lugre_steering.recording import Array, Signal

FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
"""Fourth difference: blind to motion and to pump ripple far below the sampling rate, sqrt(70) times white noise."""
WINDOW_S = 1.0
DITHERED = 0.3
"""White noise, in steps of the resolution, from which it makes the error of rounding white too."""
WORSE, LATE_S = 1.5, 1e-3
"""Times the sheet's noise, and scatter of stamps [s], from which a sensor or its clock is worth a finding."""
STEPS_SEEN = 0.9
"""Share of neighbouring levels that are whole multiples of the resolution, if it is one."""


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
    """Standard deviation of the white part of a channel: the usual one of windows of a second without a lost message."""
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


def worse_than_said(signal: Signal, sheet: float, say: Callable[[float], str]) -> str | None:
    """What a channel shows of its sensor that is clearly worse than its noise by the vehicle file, in words; None if it is not."""
    even, scatter = evened(signal)
    sensor = sensed(even)
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


def sensed(signal: Signal) -> SensorNoise:
    """Steps and noise of a channel."""
    return SensorNoise(white_noise(signal), resolution(signal.value))
