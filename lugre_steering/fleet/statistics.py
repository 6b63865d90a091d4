# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Estimates of many recordings as one, changes and trends among them, and one budget of false discoveries over all that is claimed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, stats

from lugre_steering.diagnosis.investigate import NULL_DRAWS
from lugre_steering.recording import Array, Mask

CONFIDENCE = 0.95
LEAST_CHANGE, LEAST_TREND = 6, 8
"""Recordings that it takes to tell a change, and a trend."""
ORDERS, ROUNDS, ENOUGH = 2000, 40, 20
"""Random orders at a time, how often at most, and how many as good as the true one settle that it is none (Besag and Clifford 1991)."""
MOST = 400
"""Values of a longer series are averaged in groups, so that its cost does not grow with its square."""
OWN_ERROR = 1.0
"""What smoothing and simulation may leave in every estimate alike, in its standard deviations: up to 0.6 of them on recordings that
hide nothing. It does not average out, so joint evidence counts from there."""
KNOWN = NULL_DRAWS
"""Degrees of freedom with which the error of one estimate is known, at least: the draws that hide nothing, of one recording."""
ALIKE = 0.05
"""Chance of their differences below which values are taken to differ by more than their errors."""
OUTLIER = 3.5
"""Robust standard deviations from the median, after Iglewicz and Hoaglin."""


@dataclass(frozen=True)
class Combined:
    """Several estimates as one: ``value``, its standard ``error`` and interval, ``p_value`` against none, ``between``: standard
    deviation of what differs beyond the errors, ``alike_p``: chance of such differences where there are none, ``floor``: size up to
    which there may be nothing, ``hint_p``: the p-value if differences were hardly more than errors."""

    value: float
    error: float
    low: float
    high: float
    p_value: float
    between: float
    alike_p: float
    floor: float
    hint_p: float


def combined(value: ArrayLike, sd: ArrayLike, sign: int = 0, floor: float | None = None) -> Combined:
    """Random-effects mean of ``value`` (n,), n > 1, with errors ``sd`` (n,); ``sign`` 1: only values above zero are possible.

    Variance between after Paule and Mandel (1982), interval after Hartung and Knapp (2001), never narrower than that without a variance
    between. ``p_value`` is that of a mean as large as ``floor`` (OWN_ERROR where none is given). Values that agree within their
    errors are judged by these, which are known from KNOWN draws each, values that do not by how they differ: a few of them tell little
    about that, so that of few recordings only what is strong would stand.
    """
    y, s2 = np.asarray(value, np.float64), np.asarray(sd, np.float64) ** 2

    def excess(tau2: float) -> float:
        weight = 1.0 / (s2 + tau2)
        return float(np.sum(weight * (y - np.average(y, weights=weight)) ** 2)) - (y.size - 1)

    tau2, differs = 0.0, excess(0.0)
    if differs > 0.0:
        tau2 = float(optimize.brentq(excess, 0.0, 10.0 * float(np.var(y)) * y.size))
    alike = float(stats.chi2.sf(differs + y.size - 1, y.size - 1))
    mean, error = _mean(y, s2 + tau2)
    reach = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, y.size - 1)) * error
    least = OWN_ERROR * float(np.mean(1.0 / s2)) ** -0.5 if floor is None else floor
    plain, freedom = float(np.average(y, weights=1.0 / s2)), KNOWN + y.size - 1
    scale = max(1.0, (differs + freedom) / freedom)  # the scatter, drawn towards the errors that are known
    hint = _beyond(plain, least, float(np.sqrt(scale / np.sum(1.0 / s2))), freedom, sign)
    p = _beyond(mean, least, error, y.size - 1, sign) if alike < ALIKE else hint
    return Combined(mean, error, mean - reach, mean + reach, p, tau2**0.5, alike, least, hint)


def _beyond(mean: float, least: float, error: float, freedom: int, sign: int) -> float:
    """p-value of a mean (of this sign, or of either) against one of size ``least``."""
    return min(1.0, (1.0 if sign else 2.0) * float(stats.t.sf(((mean if sign else abs(mean)) - least) / error, freedom)))


def _mean(y: Array, variance: Array) -> tuple[float, float]:
    """Weighted mean of ``y`` (n,) and its standard error: by the ``variance`` (n,) of each, or by the scatter if that is larger."""
    weight = 1.0 / variance
    mean = float(np.average(y, weights=weight))
    spread = float(np.sum(weight * (y - mean) ** 2)) / (y.size - 1)
    return mean, float(np.sqrt(max(spread, 1.0) / weight.sum()))


@dataclass(frozen=True)
class Change:
    """A step in a series: number of the first value after it, means before and after, chance of as large a one in any order."""

    first: int
    before: float
    after: float
    p_value: float


def change(value: ArrayLike, sd: ArrayLike, seed: int) -> Change | None:
    """The largest step in ``value`` (n,) in order of time, with errors ``sd`` (n,); None for less than LEAST_CHANGE values."""
    y, weight = np.asarray(value, np.float64), np.asarray(sd, np.float64) ** -2.0
    if y.size < LEAST_CHANGE:
        return None
    groups = np.array_split(np.arange(y.size), min(y.size, MOST))
    wy = np.array([(weight * y)[group].sum() for group in groups])
    w = np.array([weight[group].sum() for group in groups])
    rng = np.random.default_rng(seed)
    (size,), before, after = _steps(w[None], wy[None])
    first = int(size.argmax())
    tried = as_good = 1
    for _ in range(ROUNDS):
        orders = rng.permuted(np.tile(np.arange(w.size), (ORDERS, 1)), axis=1)
        chance = _steps(w[orders], wy[orders])[0].max(axis=1)
        tried, as_good = tried + ORDERS, as_good + int(np.sum(chance >= size[first] * (1.0 - 1e-12)))
        if as_good > ENOUGH:
            break
    begin = int(groups[first + 2][0])
    return Change(begin, float(before[0, first]), float(after[0, first]), as_good / tried)


def _steps(w: Array, wy: Array) -> tuple[Array, Array, Array]:
    """Size over error of every step in series (m, n) of weights and weighted values, and the means before and after it (m, n - 3).

    Two values at least lie on either side: one is an outlier.
    """
    w_before, wy_before = np.cumsum(w, axis=1)[:, 1:-2], np.cumsum(wy, axis=1)[:, 1:-2]
    w_after, wy_after = w.sum(axis=1, keepdims=True) - w_before, wy.sum(axis=1, keepdims=True) - wy_before
    before, after = wy_before / w_before, wy_after / w_after
    return np.abs(after - before) / np.sqrt(1.0 / w_before + 1.0 / w_after), before, after


@dataclass(frozen=True)
class Trend:
    """Change of one quantity per unit of another (Theil and Sen), and the chance of such an order (Kendall)."""

    slope: float
    p_value: float


def trend(x: ArrayLike, y: ArrayLike) -> Trend | None:
    """Of ``y`` (n,) over ``x`` (n,); None for less than LEAST_TREND values, or an ``x`` that stands still."""
    a, b = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if a.size < LEAST_TREND or np.ptp(a) == 0.0:
        return None
    p = float(stats.kendalltau(a, b).pvalue)
    few = np.linspace(0, a.size - 1, min(a.size, MOST)).astype(int)
    i, j = np.triu_indices(few.size, 1)
    run, rise = a[few][j] - a[few][i], b[few][j] - b[few][i]
    return Trend(float(np.median(rise[run != 0.0] / run[run != 0.0])), 1.0 if np.isnan(p) else p)


def outliers(value: Array) -> Mask:
    """Which of the values (n,) lie far from the others; none of fewer than five."""
    distance = np.abs(value - np.median(value))
    middle = float(np.median(distance))
    if value.size < 5 or middle == 0.0:
        return np.zeros(value.size, np.bool_)
    return np.asarray(0.6745 * distance / middle > OUTLIER)


def budgeted(p_value: ArrayLike, weight: ArrayLike = 1.0) -> Array:
    """q-values (n,): the least share of false ones, whatever hangs on whatever, among all that are claimed with as small a p-value.

    Benjamini and Yekutieli, Ann. Statist. 29 (2001) 1165. ``weight`` (n,), one on average and fixed beforehand, gives more of the
    budget to some (Genovese, Roeder and Wasserman, Biometrika 93 (2006) 509).
    """
    p = np.asarray(p_value, np.float64) / np.asarray(weight, np.float64)
    if not p.size:
        return p
    rank = np.arange(1, p.size + 1)
    order = np.argsort(p, kind="stable")
    steps = p[order] * p.size * np.sum(1.0 / rank) / rank
    q = np.empty_like(p)
    q[order] = np.minimum.accumulate(np.minimum(steps, 1.0)[::-1])[::-1]
    return q
