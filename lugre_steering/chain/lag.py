# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""First-order lag of a sampled signal: one law for the node, replay, diagnosis and simulation."""

from __future__ import annotations

import math

import numpy as np

from lugre_steering.chain.compiled import law
from lugre_steering.recording import Array

SHORT = 0.02
"""Time constants below this share of the sampling interval change nothing."""


@law
def lag_weights(dt, tau):
    """Weights of the last output, the present and the last input: tau dy/dt = x - y, exact for x linear over ``dt`` [s].

    y = decay y_last + (1 - ramp) x + (ramp - decay) x_last, decay = exp(-dt / tau), ramp = (1 - decay) tau / dt.
    """
    if tau < SHORT * dt or dt <= 0.0:
        return 0.0, 1.0, 0.0
    decay = math.exp(-dt / tau)
    ramp = (1.0 - decay) * tau / dt
    return decay, 1.0 - ramp, ramp - decay


def lagged(value: Array, dt: float, tau: float) -> Array:
    """A uniformly sampled signal (n,) behind a lag of ``tau`` [s], at rest in its first value."""
    from scipy.signal import lfilter

    decay, present, last = lag_weights(dt, tau)
    filtered, _ = lfilter([present, last], [1.0, -decay], value, zi=[value[0] * (1.0 - present)])
    return np.asarray(filtered)
