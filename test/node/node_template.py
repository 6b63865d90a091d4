# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What each node would do again before it begins, done once: a process that has imported everything and loaded the compiled code.

Each line that comes in orders a node: a process of its own, forked from here before there is any thread or anything of ROS but its
modules; of a script, which breaks something in it, if one is given. Its number is answered; its exit code is left beside its log.
"""

from __future__ import annotations

import json
import os
import runpy
import signal
import sys
from pathlib import Path

from lugre_steering.estimator import Options
from lugre_steering.live import session
from lugre_steering.node import main
from lugre_steering.vehicle import load

logs: dict[int, str] = {}


def tell_ended(*_: object) -> None:
    """Leave the exit codes of all that have ended."""
    while logs:
        number, status = os.waitpid(-1, os.WNOHANG)
        if number == 0:
            return
        Path(f"{logs.pop(number)}.ended").write_text(str(os.waitstatus_to_exitcode(status)), encoding="ascii")


session.warm_up(load(sys.argv[1]), Options())
signal.signal(signal.SIGCHLD, tell_ended)
for line in iter(sys.stdin.readline, ""):
    order = json.loads(line)
    process = os.fork()
    if process == 0:
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        for stream, file in ((0, os.devnull), (1, order["log"]), (2, order["log"])):
            os.dup2(os.open(file, os.O_RDWR | os.O_APPEND), stream)
        os.environ.clear()
        os.environ.update(order["environment"])
        sys.argv = order["arguments"]
        if order["script"] is None:
            sys.exit(main(sys.argv))
        runpy.run_path(order["script"], run_name="__main__")
        sys.exit()
    logs[process] = order["log"]
    print(process, flush=True)
