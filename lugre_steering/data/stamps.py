# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Stamps given on receipt: a sensor that samples evenly, and messages that come late by a varying delay.

The sampling frequency is where stamps are most coherent, |mean exp(2 pi i f t)| (Rayleigh test); losses do not move it. Late
stamps are told from truly uneven sampling by the values: a late stamp leaves them on the even grid.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lugre_steering.recording import Array, IntArray, Recording, Signal

COHERENT = 0.3
"""Coherence below which there is no grid to return to: scatter of a quarter of a period."""
ABOUT = 0.15
"""Share of the frequency within which it is sought around that of the median step, which rounding and losses move."""
FIRST, GROWTH = 400, 4.0
"""Periods that the first search uses, and by how much each next one is longer and finer."""
BLOCK_S = 120.0
"""Longest stretch that counts as one clock: device clocks wander."""
PLACES = 24
"""Places of the grid within a period that are tried: no message comes early, but the latest may come a period late."""
DIFFERENCE = np.array([1.0, -3.0, 3.0, -1.0])
SMOOTHED, TOGETHER = 9, 50
"""Samples over which a slope is taken, as noise in it would pass for late stamps, and differences that count as one error."""
SURE = 2.0
"""Standard deviations by which values must deny their stamps."""
SCATTER_S = 2e-4
"""Scatter that harms nothing."""


@dataclass(frozen=True)
class Grid:
    """Even sampling behind stamps (n,): ``even`` (n,) [s] where they would be without scatter, ``number`` (n,) of each sample,
    ``scatter`` [s] standard deviation, ``period`` [s]."""

    even: Array
    number: IntArray
    scatter: float
    period: float


def sampling_grid(time: Array) -> Grid | None:
    """The grid of one channel; None where stamps are not even enough to tell."""
    if time.size < 20:
        return None
    blocks = np.array_split(np.arange(time.size), max(1, round((time[-1] - time[0]) / BLOCK_S)))
    parts = [_grid(time[block]) for block in blocks]
    if any(part is None for part in parts):
        return None
    found = [part for part in parts if part is not None]
    ends = np.cumsum([0, *(int(part.number[-1]) + 2 for part in found)])
    return Grid(
        np.concatenate([part.even for part in found]),
        np.concatenate([part.number + end for part, end in zip(found, ends, strict=False)]),
        float(np.sqrt(np.mean([part.scatter**2 for part in found]))),
        float(np.mean([part.period for part in found])),
    )


def _grid(time: Array) -> Grid | None:
    elapsed = time - time[0]
    step = np.diff(elapsed)
    about = 1.0 / float(np.median(step))
    width, reach = ABOUT * about, FIRST / about
    while True:
        part = elapsed[elapsed <= reach]
        trial = about + np.linspace(-width, width, max(3, 2 * int(np.ceil(4.0 * width * reach)) + 1))
        turned, further = np.exp(2j * np.pi * np.outer([trial[0], trial[1] - trial[0]], part))
        coherences = np.empty(trial.size)
        for i in range(trial.size):
            coherences[i] = abs(np.add.reduce(turned)) / part.size
            turned *= further  # one turn further per trial: no exponential of each, and no more memory than that of one
        best = int(coherences.argmax())
        about, coherence = float(trial[best]), float(coherences[best])
        if reach >= elapsed[-1]:
            break
        width, reach = 0.5 / reach, min(reach * GROWTH, float(elapsed[-1]))
    if coherence < COHERENT:
        return None
    starts = np.arange(PLACES) / (PLACES * about)
    number = min((np.floor((elapsed - start) * about) for start in starts), key=lambda n: _disorder(elapsed * about, n)).astype(np.int64)
    # Messages keep their order: one that comes a whole period late shares the place of the next.
    order = np.arange(number.size)
    number = np.minimum.accumulate((number - order)[::-1])[::-1] + order
    slope, offset = np.polyfit(number, elapsed, 1)
    even = offset + slope * number
    return Grid(time[0] + even, number, float(np.std(elapsed - even)), float(slope))


def _disorder(periods: Array, number: Array) -> float:
    """Share of samples that share a place of the grid, and the variance of all about theirs, ``periods`` (n,) being their times."""
    return float(np.mean(np.diff(number) == 0.0)) + 4.0 * float(np.var(periods - number))


def with_even_stamps(recording: Recording) -> Recording:
    """The recording with even stamps where those that it has are late by chance, and known to be so."""

    def even(signal: Signal) -> Signal:
        return replace(evened(signal)[0], even=True)

    torque = recording.measured_torque
    return replace(
        recording,
        angle={name: even(signal) for name, signal in recording.angle.items()},
        pressure={name: even(signal) for name, signal in recording.pressure.items()},
        measured_torque=None if torque is None else even(torque),
    )


def evened(signal: Signal) -> tuple[Signal, float]:
    """The signal with even stamps where those it has are late by chance, and their scatter [s] (zero where they may stay)."""
    if signal.even:
        return signal, 0.0
    grid = sampling_grid(signal.time_s)
    if grid is None or grid.scatter < SCATTER_S:
        return signal, 0.0
    width = DIFFERENCE.size
    runs = np.lib.stride_tricks.sliding_window_view(grid.number, width)
    whole = runs[:, -1] - runs[:, 0] == width - 1
    if whole.sum() < 20:
        return signal, 0.0
    slope = _slopes(grid.even, signal.value)
    late = np.lib.stride_tricks.sliding_window_view((signal.time_s - grid.even) * slope, width)[whole] @ DIFFERENCE
    change = np.lib.stride_tricks.sliding_window_view(signal.value, width)[whole] @ DIFFERENCE
    power = float(late @ late)
    if power <= 0.0:
        return signal, 0.0
    # Of truly uneven sampling the values follow the stamps with a factor of one, of late stamps not at all.
    factor = float(late @ change) / power
    errors = np.add.reduceat(late * (change - factor * late), np.arange(0, late.size, TOGETHER))
    if factor + SURE * float(np.linalg.norm(errors)) / power > 0.5:
        return signal, 0.0
    return Signal(grid.even, signal.value), grid.scatter


def _slopes(time: Array, value: Array) -> Array:
    """Slope (n,) of the straight line through the SMOOTHED samples around each, wherever losses have left them."""
    here = np.arange(time.size)
    sums = np.zeros((4, time.size))
    for shift in range(-(SMOOTHED // 2), SMOOTHED // 2 + 1):
        there = np.clip(here + shift, 0, time.size - 1)
        t, v = time[there] - time, value[there] - value
        sums += t, v, t * v, t * t
    t, v, tv, tt = sums / SMOOTHED
    return np.asarray((tv - t * v) / (tt - t * t))
