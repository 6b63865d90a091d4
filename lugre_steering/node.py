# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Executable ``estimator``: the live node. ``python -m lugre_steering.node --ros-args -p vehicle_file:=FILE``."""

from __future__ import annotations

import signal
import sys


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; returns the exit code (0; 2 for bad parameters or a bad vehicle file)."""
    # Before the heavy imports, so that a stop during start-up is as clean as a later one.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        from lugre_steering.live.run import run

        return run(sys.argv if args is None else args)
    except KeyboardInterrupt:
        return 0


if __name__ == "__main__":
    sys.exit(main())
