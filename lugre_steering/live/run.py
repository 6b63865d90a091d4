# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Process of the node: start, spin, stop."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from lugre_steering.errors import LugreSteeringError
from lugre_steering.live.estimator_node import SteeringTorqueEstimator

_SLICE_S = 0.1  # how long a signal may go unnoticed
_FAULTS = 100  # of the middleware in a row, and no callback between: a supervisor must know
_PATIENCE = 5
_BREATH_S = 0.05  # after each further such fault: no core is kept busy with nothing
_BACKLOG_S = 2.0
"""An executor that has not emptied its queue for so long is replaced: of each message that the middleware drops meanwhile an event
stays in that queue, which would grow for ever."""


def run(args: list[str]) -> int:
    """Run the node until the context is shut down; returns the exit code."""
    try:
        # Signals become rclpy's once the node spins; a context that is shut down before that breaks start-up.
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy raises several private types for arguments it cannot parse
        return _refused(error)
    try:
        node = SteeringTorqueEstimator()
        node.start()
        # What exists now lives until the end: a collection during a callback need not look at it.
        gc.collect()
        gc.freeze()
        if not spin(node, node.settings.executor, node.fault, lambda: node.callbacks, node.late):
            return _refused(RuntimeError(f"no callback runs any more; the last of {_FAULTS} faults: {node.last_exception}"))
        if rclpy.ok():
            node.leave()
        else:
            node.save()
    except (LugreSteeringError, ParameterException, RCLError) as error:  # rclpy's: its own parameters, names of topics
        return _refused(error)
    finally:
        rclpy.try_shutdown()
    return 0


def _refused(error: BaseException) -> int:
    print(f"estimator: {' '.join(str(error).split())}", file=sys.stderr)
    return 2


def spin(
    node: Node,
    executor_kind: str,
    fault: Callable[[Exception], None],
    callbacks: Callable[[], int],
    late: Callable[[], None] = lambda: None,
) -> bool:
    """Run callbacks until SIGINT, SIGTERM or shutdown; what the middleware raises between them goes to ``fault``, not out of the node.

    The context is left as it is: there is something to be said before the node goes. A second signal ends the process at once.
    False if it raises again and again and no callback runs any more, as the count of ``callbacks`` tells. ``late`` is called
    whenever more has come for ``_BACKLOG_S`` than could be worked off.
    """
    executor = _joined(executor_kind, node)
    stopped, over = False, threading.Event()
    part, began = Future(), time.monotonic()

    def stop(*_: object) -> None:
        nonlocal stopped
        if stopped:
            os._exit(0)
        stopped = True
        part.set_result(None)

    def relieve() -> None:
        while not over.wait(0.25 * _BACKLOG_S):
            if time.monotonic() - began > _BACKLOG_S:
                part.set_result(None)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    threading.Thread(target=relieve, daemon=True).start()
    try:
        faults = 0
        while rclpy.ok() and not stopped and faults < _FAULTS:
            before = callbacks()
            part, began = Future(), time.monotonic()
            sound = _spin_some(executor, part, fault)
            if sound or callbacks() > before:
                faults = 0
            else:
                faults += 1
                if faults > _PATIENCE:
                    time.sleep(_BREATH_S)
            if not stopped and time.monotonic() - began > _BACKLOG_S:
                executor.shutdown()
                executor = _joined(executor_kind, node)
                late()
    except ExternalShutdownException:
        return True
    finally:
        over.set()
        executor.shutdown()
    return faults < _FAULTS


def _spin_some(executor: Executor, part: Future, fault: Callable[[Exception], None]) -> bool:
    """Run callbacks for ``_SLICE_S``, or until ``part`` is done; whether nothing was raised."""
    try:
        # Not spin(): the one of EventsExecutor in rclpy 7.1 keeps a core busy and ignores SIGTERM. And this one looks at the time only
        # where its queue is empty.
        executor.spin_until_future_complete(part, timeout_sec=_SLICE_S)
    except ExternalShutdownException:
        raise
    except Exception as error:
        fault(error)
        return False
    return True


def _joined(kind: str, node: Node) -> Executor:
    """A new executor with the node in it."""
    executor = make_executor(kind)
    executor.add_node(node)
    return executor


def make_executor(kind: str) -> Executor:
    """An executor by its parameter name."""
    if kind == "single":
        return SingleThreadedExecutor()
    from rclpy.experimental.events_executor import EventsExecutor

    return EventsExecutor()
