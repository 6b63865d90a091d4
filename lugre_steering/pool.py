# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Work in several processes of this machine, one of which may die without harm to the rest.

Every worker has one task at a time and an executor of its own: who dies, by a signal or for want of memory, takes down the
task it had and no other.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait as wait_for_end
from typing import TypeVar

from lugre_steering.errors import LugreSteeringError

Progress = Callable[[str, int, "int | None"], None]
"""Called with the name of a piece of work, what is done of it, and what there is in all (None where not known)."""
T = TypeVar("T")
R = TypeVar("R")

_BLAS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
ATTEMPTS = 2
"""A task whose worker died is given to one more: memory may have been short for another's sake."""


class WorkerDiedError(LugreSteeringError):
    """The process that had a task ended without an answer, each time it was tried."""


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_processes(function: Callable[[T], R], tasks: Sequence[T], jobs: int) -> Iterator[tuple[int, R | WorkerDiedError]]:
    """``function`` of every task in ``jobs`` processes: number and result of each as it ends, in any order.

    An exception that ``function`` raises is raised here; a worker that dies is an answer.
    """
    jobs = max(1, min(jobs, len(tasks)))
    waiting = deque((number, 1) for number in range(len(tasks)))
    idle = [_worker(jobs) for _ in range(jobs)]
    busy: dict[Future[R], tuple[ProcessPoolExecutor, int, int]] = {}
    try:
        while waiting or busy:
            while waiting and idle:
                (number, attempt), worker = waiting.popleft(), idle.pop()
                try:
                    future = worker.submit(function, tasks[number])
                except BrokenProcessPool:  # it died while it had nothing to do
                    worker = _worker(jobs)
                    future = worker.submit(function, tasks[number])
                busy[future] = worker, number, attempt
            for future in wait(busy, return_when=FIRST_COMPLETED).done:
                worker, number, attempt = busy.pop(future)
                try:
                    result: R | WorkerDiedError = future.result()
                    idle.append(worker)
                except BrokenProcessPool:
                    worker.shutdown(wait=False)
                    idle.append(_worker(jobs))
                    if attempt < ATTEMPTS:
                        waiting.append((number, attempt + 1))
                        continue
                    result = WorkerDiedError(f"its worker process died {attempt} times (killed, or for want of memory)")
                yield number, result
    finally:
        for worker in [*idle, *(worker for worker, _, _ in busy.values())]:
            worker.shutdown(wait=False, cancel_futures=True)


def _worker(jobs: int) -> ProcessPoolExecutor:
    """A fresh interpreter: forking a process that has compiled code and threads is not safe."""
    threads = max(1, processors() // jobs)
    return ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=begin, initargs=(threads,))


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Where NumPy came before us, as in a notebook: matrices of fits are so narrow that BLAS threads only wait for each other (four to
    five times the processor time of a diagnosis). What the user has set stands."""
    if any(name in os.environ for name in _BLAS):
        yield
        return
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, user_api="blas"):
        yield


def begin(threads: int) -> None:
    """What every worker does first: take ``threads`` for itself, and end with the process that started it."""
    # Said before NumPy is imported. What the user has set stands.
    os.environ.setdefault("LUGRE_STEERING_THREADS", str(threads))
    for name in _BLAS:
        os.environ.setdefault(name, "1")
    if (parent := parent_process()) is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()


def _end_with(sentinel: int) -> None:
    wait_for_end([sentinel])
    os._exit(1)
