# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Robust fit of the baseline and the covariance of what it found, when the residuals are coloured.

The fit is an M-estimator: its covariance is the sandwich A^-1 M A^-1 (Huber 1967), A the curvature and M the variance
of the score. White residuals would make M = A; here M is the larger, direction by direction, of two estimates: from the
residuals, their scores summed over blocks longer than their memory (clusters; Liang and Zeger 1986), and from repeated
draws of sensor noise through smoother and chain, which also hold the bias of the smoother that residuals cannot show.
The error of the chain's finite time step is taken out, and a quarter of it kept as uncertain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.signal import correlate

from lugre_steering.data.dataset import Run, motion
from lugre_steering.fitting.doubt import doubt
from lugre_steering.fitting.fit import ROBUST, Fit, fit
from lugre_steering.fitting.noise import noise_model, repeated_motion
from lugre_steering.fitting.problem import Effects, Problem
from lugre_steering.fitting.weather import weather_findings
from lugre_steering.recording import Array

DRAWS = 16
LINEARISATIONS = 40
BLOCK_S = 2.0
"""Shortest block over which scores are summed; longer where residuals remember longer."""
MEMORIES = 4.0
"""Block length in correlation times of the residual."""
FEWEST_BLOCKS = 12
MEDIAN = 0.6745
"""Of the size of normal errors, in their standard deviation."""
STEP_REMAINDER = 0.25
"""Share of the time step's error that may be left after it was taken out."""


@dataclass(frozen=True)
class Estimate:
    """A fit and its statistics; parameters in the order of ``Problem`` (calibration values, then initial bristles and weather), then
    those of effects fitted beside them.

    ``weight`` (n,) [1/(N m)] by the noise, or the errors where they are larger, zero where not used;
    ``noise_floor`` [N m], ``residual`` (n,) [N m], ``draws`` (draws, n) and ``step_error`` (n,) [N m] what noise
    and the finite time step may put into it, ``cluster`` (n,) the block of each sample, ``prior`` (p,) the weight
    of the priors, ``doubt`` how often it counts their information, ``covariance`` (p, p), ``quantile`` of a 95 %
    interval.
    """

    fit: Fit
    weight: Array
    noise_floor: float
    residual: Array
    draws: Array
    step_error: Array
    cluster: np.ndarray[tuple[int], np.dtype[np.int64]]
    prior: Array
    covariance: Array
    quantile: float
    doubt: float

    @property
    def x(self) -> Array:
        return self.fit.x

    def information(self, jacobian: Array) -> tuple[Array, Array]:
        """Curvature A and score variance M (p, p) of the data alone, for any ``jacobian`` (n, p) [N m per unit]."""
        weighted = jacobian * self.weight[:, None]
        z = self.residual * self.weight / ROBUST
        curvature = weighted.T @ (weighted * (1.0 + z**2)[:, None] ** -1.5)
        blocks = np.array([np.bincount(self.cluster, column * influence(ROBUST * z)) for column in weighted.T])
        count = blocks.shape[1]
        clustered = blocks @ blocks.T * count / (count - 1)
        scores = influence(self.draws * self.weight) @ weighted
        # Few draws leave directions unseen; nothing is less noisy than white noise there.
        drawn = scores.T @ scores / len(scores) + 1e-3 * curvature
        step = STEP_REMAINDER * (weighted.T @ (self.step_error * self.weight))
        return curvature, _larger(drawn, clustered) + np.outer(step, step)


def influence(z: Array) -> Array:
    """Influence of a standardised residual under the soft L1 loss of the fit."""
    return np.asarray(z / np.sqrt(1.0 + (z / ROBUST) ** 2))


def estimate(
    problem: Problem, effects: Effects = (), *, priors: bool = True, seed: int = 0, draws: int = DRAWS
) -> Estimate:
    """Fit all valid samples, learn the noise, fit again with it, and work out the covariance; ``effects`` are fitted as well."""
    first = fit(problem, problem.sensor_weight, effects, linearisations=LINEARISATIONS, robust=True, priors=priors)
    noise = noise_model(problem, first.x, first.effects, repeated_motion(problem, draws, seed), seed=seed)
    weight = problem.valid / noise.sigma
    step = step_error(problem, first.x, first.effects)
    # Where the law is not that of the recording, its errors are larger than noise and last: they say less about sheet and weather.
    error = np.abs(problem.measured - first.prediction)[problem.valid] * weight[problem.valid]
    weight = weight / max(1.0, float(np.median(error)) / MEDIAN)
    refined = problem.doubted(doubt(problem, first, weight), problem.typical)
    refined.measured = problem.measured - step  # the same as adding the error to every prediction
    final = fit(refined, weight, first.effects, first.x, linearisations=LINEARISATIONS, robust=True, priors=priors)
    information = final.pull**2  # as the prior rows of the fit have it
    if problem.vehicle.rubber is not None and not weather_findings(refined, final):
        # Values hold beside the temperatures of the file, against which nothing speaks; intervals know that these are not exact.
        known = refined.with_known_weather()
        final = fit(known, weight, final.effects, final.x, linearisations=LINEARISATIONS, robust=True, priors=priors)
    residual = refined.measured - final.prediction
    cluster = _clusters(problem, residual * weight)
    blocks = np.unique(cluster[weight > 0.0]).size
    result = Estimate(
        final, weight, noise.floor, residual, noise.draws, step, cluster, information,
        np.empty(0), float(stats.t.ppf(0.975, max(blocks - information.size, 3))), refined.doubt,
    )  # fmt: skip
    curvature, score = result.information(physical_jacobian(result))
    bread = np.linalg.pinv(curvature + np.diag(information), hermitian=True)
    return replace(result, covariance=bread @ (score + refined.doubt * np.diag(information)) @ bread)


def physical_jacobian(result: Estimate) -> Array:
    """Change of the predicted torque per unit of each parameter (n, p) [N m]; zero where a sample has no weight."""
    weight = np.where(result.weight > 0.0, result.weight, 1.0)
    return np.asarray(result.fit.jacobian / weight[:, None])


def step_error(problem: Problem, x: Array, effects: Effects = ()) -> Array:
    """Error of the chain's finite time step (n,) [N m]: the change when it is doubled (Richardson, first order); none of a joint, whose
    steps are of second order."""
    errors = []
    for bag, run in enumerate(problem.runs):
        if run.midway:
            errors.append(np.zeros(run.time.size))
            continue
        whole = problem.torque(bag, x, effects)
        doubled = problem.torque(bag, x, effects, run=_every_second(run))
        errors.append(np.interp(run.time, run.time[::2], whole[::2] - doubled))
    return np.concatenate(errors)


def _every_second(run: Run) -> Run:
    # Contiguous, or the compiled chain is compiled once more for another memory layout.
    time, theta = run.time[::2].copy(), run.theta[:, ::2].copy()
    omega, alpha = motion(time, theta)
    return replace(run, time=time, theta=theta, omega=omega, alpha=alpha)


def _larger(a: Array, b: Array) -> Array:
    """``a`` (positive definite) raised to ``b`` in those of their common eigen-directions in which ``b`` is larger."""
    # Residuals far out in the soft loss leave no curvature in some directions; rounding then makes it negative.
    root = np.linalg.cholesky(a + (1e-12 * float(np.trace(a)) + 1e-300) * np.eye(len(a)))
    inverse = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(inverse @ b @ inverse.T)
    half = root @ vectors * np.sqrt(np.maximum(values, 1.0))
    return np.asarray(half @ half.T)


def _clusters(problem: Problem, z: Array) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Number of the block of each sample: long against the residual's memory, but at least FEWEST_BLOCKS in all."""
    duration = sum(float(run.time[-1] - run.time[0]) for run in problem.runs)
    memory = max(_memory_s(run, z[problem.edges[bag] : problem.edges[bag + 1]]) for bag, run in enumerate(problem.runs))
    length = min(max(BLOCK_S, MEMORIES * memory), duration / FEWEST_BLOCKS)
    number = np.zeros(z.size, np.int64)
    first = 0
    for bag, run in enumerate(problem.runs):
        part = slice(problem.edges[bag], problem.edges[bag + 1])
        number[part] = first + ((run.time - run.time[0]) / length).astype(np.int64)
        first = int(number[part][-1]) + 1
    return number


def _memory_s(run: Run, z: Array) -> float:
    """Integral correlation time [s]: autocorrelation summed up to where it first falls below 0.05."""
    centred = z - z.mean()
    correlation = correlate(centred, centred, method="fft")[z.size - 1 :]
    if correlation[0] <= 0.0:
        return 0.0
    correlation = correlation / correlation[0]
    below = np.flatnonzero(correlation < 0.05)
    return float(correlation[: below[0] if below.size else z.size].sum() * (run.time[1] - run.time[0]))
