# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Executable ``estimator``: the live node. ``python -m lugre_steering.node --ros-args -p vehicle_file:=FILE``."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

HELP = """usage: estimator --ros-args -p vehicle_file:=FILE [-p NAME:=VALUE ...] [--params-file FILE] [-r FROM:=TO ...]

The live steering torque estimator. Its parameters: ros2 param describe /steering_torque_estimator NAME, while it runs;
topics and a parameter file to copy: docs/ros.md of lugre_steering."""


def arguments_of(vehicle: Path, parameters: Path | None, settings: Sequence[str], remaps: Sequence[str]) -> list[str]:
    """The node's arguments as ROS reads them; what is set by name stands above the file."""
    chosen = ["--params-file", str(parameters)] if parameters is not None else []
    for value in (f"vehicle_file:={vehicle}", *settings):
        chosen += ["-p", value]
    for rule in remaps:
        chosen += ["-r", rule]
    return ["estimator", "--ros-args", *chosen]


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; returns the exit code (0; 2 for bad parameters or a bad vehicle file)."""
    # Set before the heavy imports. Until the node spins there is nothing to tidy up, and an exception raised by a
    # handler may be swallowed (compiler callbacks) or turn the exit code into the signal's (CPython, inside exec).
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))
    arguments = sys.argv if args is None else args
    if {"-h", "--help"}.intersection(arguments):
        print(HELP)
        return 0
    from lugre_steering.live.run import run

    return run(arguments)


if __name__ == "__main__":
    sys.exit(main())
