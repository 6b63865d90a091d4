# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What /diagnostics says is wrong, on the console too: once when it begins or changes, then now and then."""

from __future__ import annotations

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.impl.rcutils_logger import CallerId, RcutilsLogger

REPEAT_S = 30.0
GRACE_S = 3.0
"""Inputs may come up after the node."""


class Console:
    """Throttled warnings, one source of them per component."""

    def __init__(self, logger: RcutilsLogger) -> None:
        self._logger = logger
        self._told: dict[str, tuple[str, float]] = {}
        CallerId()  # rclpy's first look for who logs goes through every loaded module: 40 ms, which no callback may wait for

    def tell(self, statuses: Iterable[DiagnosticStatus], since_start_s: float) -> None:
        """Say what is new in the statuses or has not been said for long; ``since_start_s`` [s] is the time."""
        for status in statuses:
            if status.level == DiagnosticStatus.OK or since_start_s < GRACE_S:
                continue
            said, when = self._told.get(status.name, ("", -REPEAT_S))
            if (status.message != said and since_start_s - when >= 1.0) or since_start_s - when >= REPEAT_S:
                self._told[status.name] = status.message, since_start_s
                self._logger.warning(f"{status.name.split(': ')[-1]}: {status.message}")
