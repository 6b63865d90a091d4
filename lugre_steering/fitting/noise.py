# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Noise with a memory: what the sensors and the motion estimate can put into a residual without any missing physics.

Three sources, all measured on the recording itself: the slow torque noise of standstill stretches (by its
autocorrelation); in oil the fast one all along the recording, where it grows with load and motion (pump ripple), since no
physics of a steered contact is that fast for long; and the error that angle noise causes through smoother and chain (by
repeating both with fresh angle noise).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import toeplitz
from scipy.ndimage import uniform_filter1d
from scipy.optimize import nnls
from scipy.signal import butter, sosfiltfilt

from lugre_steering.chain.baseline import REST_RATE_RAD_S
from lugre_steering.data.dataset import Run, acceleration, averaged, impulse, motion
from lugre_steering.data.smoother import smooth_angle
from lugre_steering.fitting.problem import Candidate, Problem, Values, in_threads
from lugre_steering.recording import Array

AR_ORDER_S = 0.6
"""How far back the autoregression of the noise looks."""
CHUNK_S = 3.0
"""Pieces of standstill that are averaged."""
MEMORIES_S = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8)
"""Exponential memories of the noise of which the spectrum may consist."""
MIN_QUIET_S = 3.0
"""Standstill from which the noise is known; below, the sheet's counts."""
MOTION_PROFILE_S = 0.5
"""Over which the noise that motion makes is smoothed."""
SPLIT_HZ = 2.5
"""Between slow noise, known from standstill only, and fast noise, known from the residual wherever nothing sudden happens."""
WINDOW_S = 0.25
"""In which fast noise is taken: short against what happens, long against a sample."""
AT_LEAST = 0.5
"""Share of the noise that the sheet gives its sensors, below which none is believed to be."""
SLOW_MEMORY_S, SURENESS, LEAST_REST_S = 0.4, 3.0, 2.0
"""Memory of slow noise, standard deviations of its estimate that are allowed for, and the shortest standstill counted."""
ROUNDING_DOUBT = 0.75
"""Energy, in noise variances, by which the error of steps that no noise dithers may exceed its draws: it is no chance."""
SUDDEN = 3.0
"""Times its expected fast energy beyond which a window holds an event rather than noise."""


@dataclass(frozen=True)
class QuietNoise:
    """Torque noise seen at standstill: level relative to the sheet, and autocorrelation by lag, zero beyond the last."""

    level: float
    correlation: Array
    assumed: bool = False
    """Whether the recording rests too little to tell, so that the sheet's white noise stands for it."""

    def draw(self, size: int, rng: np.random.Generator) -> Array:
        """Standardised noise (size,) with unit variance times ``level``, by its spectrum (circulant embedding)."""
        lags, length = self.correlation.size - 1, size + self.correlation.size
        cyclic = np.zeros(length)
        cyclic[: lags + 1] = self.correlation
        cyclic[length - lags :] += self.correlation[:0:-1]
        # An estimated correlation need not be one: where its spectrum is negative, there is nothing.
        power = np.maximum(np.fft.rfft(cyclic).real, 0.0)
        power *= length / (power[0] + 2.0 * power[1 : (length + 1) // 2].sum() + (power[-1] if length % 2 == 0 else 0.0))
        drawn = np.fft.irfft(np.sqrt(power) * np.fft.rfft(rng.standard_normal(length)), length)[:size]
        return np.asarray(drawn * self.level)


def standstill(run: Run, minimum_s: float = 1.0) -> list[slice]:
    """Stretches in which no side moves, at least ``minimum_s`` long, without the first 0.3 s."""
    dt = run.time[1] - run.time[0]
    still = (np.abs(run.omega).max(axis=0) < REST_RATE_RAD_S * run.angle_unit) & run.valid
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    skip = round(0.3 / dt)
    return [
        slice(a + skip, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if (b - a - skip) * dt >= minimum_s
    ]


def quiet_noise(runs: Sequence[Run]) -> QuietNoise:
    """Level and memory of the standardised torque noise from all standstill stretches (sheet values if they are too short).

    Stretches are cut into chunks of one length and freed of offset and drift, which real holds may show. What that takes
    away from a slow disturbance is put back: the chunks' autocovariance is explained by white noise and exponential memories
    as they look after detrending, and exchanged for what those are before it.
    """
    dt = runs[0].time[1] - runs[0].time[0]
    stretches = [np.array([run.measured[part], run.sigma[part]]) for run in runs for part in standstill(run)]
    order = max(2, round(AR_ORDER_S / dt))
    size = min(round(CHUNK_S / dt), int(np.median([stretch.shape[1] for stretch in stretches]))) if stretches else 0
    chunks = [s[:, k : k + size] for s in stretches for k in range(0, s.shape[1] - size + 1, max(size, 1))]
    if size <= 2 * order or len(chunks) * size * dt < MIN_QUIET_S:
        return QuietNoise(1.0, _white(runs[0]), assumed=True)
    torque, sigma = np.moveaxis(np.array(chunks), 1, 0)
    clean = _detrend(torque.T) / sigma.T
    seen = _autocovariance(clean, order)
    memories = np.exp(-np.arange(size) / np.maximum(np.array(MEMORIES_S) / dt, 1e-9)[:, None])
    memories[0] = np.arange(size) == 0
    roots = (np.linalg.cholesky(toeplitz(memory) + 1e-9 * np.eye(size)) for memory in memories)
    shrunk = size * np.array([_autocovariance(_detrend(root), order) for root in roots])
    share, _ = nnls(shrunk.T, seen)
    covariance = seen + share @ (memories[:, : order + 1] - shrunk)
    # Taper: beyond the noise of its own estimate a lag says nothing.
    significance = covariance / covariance[0]
    significance[1:] = np.where(np.abs(significance[1:]) > 3.0 / np.sqrt(clean.size), significance[1:], 0.0)
    significance *= 1.0 - np.arange(order + 1) / (order + 1)
    return QuietNoise(float(np.sqrt(covariance[0])), significance)


def _white(run: Run) -> Array:
    """Autocorrelation of white noise, by lag, through the average of a run."""
    response = averaged(run, impulse(run.time.size))
    response = response[response > 0.0]
    correlation = np.convolve(response, response[::-1])[response.size - 1 :]
    return np.asarray(correlation / correlation[0])


def _detrend(columns: Array) -> Array:
    """Columns (n, m) without offset and linear drift."""
    trend = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, columns.shape[0]), 2))[0]
    return np.asarray(columns - trend @ (trend.T @ columns))


def _autocovariance(columns: Array, order: int) -> Array:
    """Mean of x(t) x(t + lag) over the columns (n, m), for lags 0 ... order; each lag by the number of its products."""
    n = columns.shape[0]
    return np.array([np.mean(columns[: n - lag] * columns[lag:]) for lag in range(order + 1)])


@dataclass(frozen=True)
class Noise:
    """Standard deviation of the residual that nothing hidden would leave (n,), and draws of such residuals (draws, n)."""

    sigma: Array
    draws: Array
    slow_doubt: float
    """Energy per sample, in noise variances, by which slow noise may exceed what the standstills show: short ones tell little."""

    @property
    def floor(self) -> float:
        """One number: root mean square of sigma [N m]."""
        return float(np.sqrt(np.mean(self.sigma**2)))


def slow_part(values: Array, dt: float) -> Array:
    """What varies slower than SPLIT_HZ, along the last axis, without shift in time."""
    corner = min(SPLIT_HZ, 0.1 / dt)
    return np.asarray(sosfiltfilt(butter(2, corner, fs=1.0 / dt, output="sos"), values))


def slow_doubt(run: Run) -> float:
    """Share by which the slow noise energy of a run may exceed the estimate: its own standstill holds few independent samples."""
    rest = sum(part.stop - part.start for part in standstill(run)) * float(run.time[1] - run.time[0])
    return SURENESS * float(np.sqrt(2.0 * SLOW_MEMORY_S / max(rest, LEAST_REST_S)))


def fast_variance(run: Run, residual: Array, known: Array) -> Array:
    """Variance (n,) of the fast torque noise of a run [N2 m2]: shares that are constant, go with the load, or with motion.

    ``residual`` (n,) of a fitted model; ``known`` (n,) is the fast energy that another source has put into it.
    """
    moving = np.abs(run.omega).max(axis=0) > REST_RATE_RAD_S * run.angle_unit
    shape = np.array([run.sigma**2, run.measured**2, moving * run.sigma**2])
    energy = _without_motion(run, residual) ** 2 - known
    windows = np.arange(energy.size) // max(1, round(WINDOW_S / (run.time[1] - run.time[0])))
    used = run.valid.astype(float)
    count = np.maximum(np.bincount(windows, used), 1.0)
    means = np.array([np.bincount(windows, row * used) / count for row in (*shape, energy)])
    scale = np.maximum(means[:-1].mean(axis=1), 1e-30)
    rows, target = (means[:-1] / scale[:, None]).T, means[-1]
    sound = np.bincount(windows, used) > 0.5 * count.max()
    middle = max(float(np.median(target[sound])) if sound.any() else 0.0, 1e-30)
    expected = np.full(target.size, middle)
    share = np.zeros(scale.size)
    for _ in range(4):
        quiet = sound & (target < SUDDEN * expected)
        if quiet.sum() < 3 * scale.size:
            break
        share, _ = nnls(rows[quiet] / expected[quiet, None], target[quiet] / expected[quiet])
        expected = np.maximum(rows @ share, 1e-3 * middle)
    return np.asarray((share / scale) @ shape)


def _without_motion(run: Run, residual: Array) -> Array:
    """Fast part of a residual (n,) without what is proportional to motion and torque or their changes: that is physics."""
    dt = run.time[1] - run.time[0]
    omega, alpha, torque = run.omega.sum(axis=0), run.alpha.sum(axis=0), run.measured - residual
    direction = np.sign(omega) * (np.abs(omega) > REST_RATE_RAD_S * run.angle_unit)
    drivers = np.array([omega, alpha, torque, np.gradient(torque, dt), direction, residual])
    fast = drivers - slow_part(drivers, dt)
    causes = fast[:-1, run.valid].T / np.maximum(np.std(fast[:-1, run.valid], axis=1), 1e-30)
    shares = np.linalg.lstsq(causes, fast[-1, run.valid], rcond=1e-8)[0]
    return np.asarray(fast[-1] - shares @ (fast[:-1] / np.maximum(np.std(fast[:-1, run.valid], axis=1), 1e-30)[:, None]))


def _parts(problem: Problem) -> list[tuple[Run, slice]]:
    edges = zip(problem.edges, problem.edges[1:], strict=False)
    return [(run, slice(a, b)) for run, (a, b) in zip(problem.runs, edges, strict=True)]


def repeated_motion(problem: Problem, draws: int, seed: int) -> list[list[Run]]:
    """The runs of each bag with their motion as ``draws`` fresh draws of angle noise would have shown it."""
    def repeat(bag: int) -> list[Run]:
        rng, run = np.random.default_rng([seed, bag]), problem.runs[bag]
        # One sensor for both tracks makes one error.
        sensors = 1 if problem.vehicle.sensors.angle_from else len(run.theta)
        sigma = run.angle.sigma() or problem.vehicle.sensors.angle_sigma
        repeated = []
        for _ in range(draws):
            noisy = _sensed_again(run, sigma, rng, sensors)
            theta = np.array([smooth_angle(row, sigma, inert=problem.vehicle.rubber is None) for row in noisy])
            omega, alpha = motion(run.time, theta)
            sharp = None if run.sharp is None else run.sharp + acceleration(run.time, noisy - run.theta)
            repeated.append(replace(run, theta=theta, omega=omega, alpha=alpha, sharp=sharp))
        return repeated

    return in_threads(repeat, range(len(problem.runs)))


def _sensed_again(run: Run, sigma: float, rng: np.random.Generator, sensors: int) -> Array:
    """Angles (sides, n) [rad] as the sensor might have shown them too: white noise, and steps where it does not dither them."""
    draw = rng.standard_normal((sensors, run.time.size))
    if not run.angle.coarse:
        return np.asarray(run.theta + sigma * draw)
    step, shift = run.angle.resolution, rng.uniform(0.0, 1.0, (sensors, 1))
    return np.asarray((np.round((run.theta + run.angle.noise * draw) / step + shift) - shift) * step)


def rounding_error(run: Run, rng: np.random.Generator) -> Array:
    """Torque error (n,) [N m] that coarse pressure sensors make: rounding of smoothed pressures at a drawn place of the grid."""
    error = np.zeros(run.time.size)
    width = max(1, round(WINDOW_S / (run.time[1] - run.time[0])))
    for step, gain, pressure in zip(run.rounding, run.torque_per_line, run.pressure, strict=False):
        if step > 0.0:
            place = uniform_filter1d(pressure, width) / step + rng.uniform()
            error += gain * step * (np.round(place) - place)
    return error


def noise_model(
    problem: Problem, x: Array, effects: Sequence[tuple[Candidate, Values]], repeated: Sequence[Sequence[Run]], *, seed: int
) -> Noise:
    """Noise of the residual at a fitted model; ``repeated`` motion tells what the angle noise makes of it."""
    quiet = quiet_noise(problem.runs)
    base = problem.predict_all(x, effects)
    parts, draws = _parts(problem), len(repeated[0])

    def changes(bag: int) -> Array:
        """Change of the prediction of one bag by each repetition (draws, n) [N m]."""
        change = np.array([problem.predict(bag, x, effects, run) for run in repeated[bag]]) - base[parts[bag][1]]
        return change * parts[bag][0].valid if parts[bag][0].average_s else change  # an average is none at the ends

    errors = in_threads(changes, range(len(parts)))
    # Only oil carries pump ripple; a torque sensor is as noisy in motion as at rest.
    hydraulic = problem.vehicle.hydraulics is not None
    sigmas, doubts, residuals = [], [], []
    for bag, (run, part) in enumerate(parts):
        rng, dt = np.random.default_rng([seed, bag, 1]), run.time[1] - run.time[0]
        torque = np.array([quiet.draw(run.time.size, rng) for _ in range(draws)])
        slow = slow_part(torque, dt)
        swift = torque - slow
        swift_sigma = np.std(swift) * run.sigma
        if hydraulic:
            known = np.mean((errors[bag] - slow_part(errors[bag], dt)) ** 2, axis=0)
            swift_sigma = np.maximum(np.sqrt(fast_variance(run, problem.measured[part] - base[part], known)), AT_LEAST * run.sigma)
            if quiet.assumed:  # white noise is as strong below as above
                slow *= float(np.mean(swift_sigma / (np.std(swift) * run.sigma)))
        if run.rounding.size:
            errors[bag] = errors[bag] + np.array([rounding_error(run, rng) for _ in range(draws)])
        variance = uniform_filter1d(np.mean(errors[bag] ** 2, axis=0), max(1, round(MOTION_PROFILE_S / dt)))
        slow_variance = np.var(slow) * run.sigma**2
        sigmas.append(np.sqrt(slow_variance + swift_sigma**2 + variance))
        coarse = ROUNDING_DOUBT if run.angle.coarse or run.rounding.size else 0.0
        doubts.append(slow_doubt(run) * slow_variance / sigmas[-1] ** 2 + coarse)
        residuals.append(slow * run.sigma + swift / np.std(swift) * swift_sigma - errors[bag])
    sigma = np.concatenate(sigmas)
    return Noise(sigma, np.concatenate(residuals, axis=1), float(np.mean(np.concatenate(doubts))))
