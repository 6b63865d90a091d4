# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Feed-forward commands without a stamp: what a controller behind them needs to be safe."""

from __future__ import annotations

from collections.abc import Sequence

from lugre_steering.estimator.release import LONGEST_S


class CommandRamp:
    """Leads each command from the last one published to the wanted one, over a fixed time after every interruption: a
    silence, or ``restart``; never faster than the limit of rate.

    An effort controller may hold the last command it got; the topic therefore continues where it stopped. Before the
    first command a controller has none: the ramp starts at zero.
    """

    def __init__(self, timeout_s: float, ramp_s: float, rate_limit_Nm_s: float, joints: int) -> None:
        self.set_limits(timeout_s, ramp_s, rate_limit_Nm_s)
        self.published = [0.0] * joints
        self._start = self.published
        self._start_ns = 0
        self._last_ns: int | None = None

    def set(self, values: Sequence[float]) -> None:
        """Others have published these; the next command begins a ramp from there."""
        self.published = list(values)
        self._last_ns = None

    def set_limits(self, timeout_s: float, ramp_s: float, rate_limit_Nm_s: float) -> None:
        """Other times, from the next ramp on, and another limit of rate [N m/s]."""
        self._timeout_ns, self._ramp_ns, self._rate_limit = round(timeout_s * 1e9), round(ramp_s * 1e9), rate_limit_Nm_s

    def restart(self) -> None:
        """Begin the next ramp with the next command, however soon it comes."""
        self._last_ns = None

    def __call__(self, now_ns: int, wanted: Sequence[float]) -> list[float]:
        """The command [N m] of each joint to publish now."""
        passed_ns = 0 if self._last_ns is None else now_ns - self._last_ns
        if self._last_ns is None or not 0 <= passed_ns <= self._timeout_ns:
            self._start, self._start_ns = self.published, now_ns
        self._last_ns = now_ns
        since = now_ns - self._start_ns
        weight = since / self._ramp_ns if since < self._ramp_ns else 1.0
        reach = self._rate_limit * min(LONGEST_S, max(0.0, passed_ns * 1e-9))
        towards = (a + weight * (b - a) if weight < 1.0 else b for a, b in zip(self._start, wanted, strict=True))
        self.published = [max(last - reach, min(last + reach, to)) for last, to in zip(self.published, towards, strict=True)]
        return self.published


class Fade:
    """Leads the values last published to zero over a ramp."""

    def __init__(self, now_ns: int, values: Sequence[float], ramp_s: float) -> None:
        self._values, self._ramp_ns = list(values), ramp_s * 1e9
        self._last_ns, self._share = now_ns, 1.0

    def __call__(self, now_ns: int) -> list[float]:
        """What to publish now. A late call makes no larger step than ``LONGEST_S`` would; a clock set back none."""
        passed = min(LONGEST_S * 1e9, max(0, now_ns - self._last_ns))
        self._last_ns = now_ns
        self._share = max(0.0, self._share - passed / self._ramp_ns) if self._ramp_ns else 0.0
        return [self._share * value for value in self._values]
