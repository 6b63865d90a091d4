# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The same work on a Dask cluster that is there already: its own scheduling, retries, spilling and dashboard."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from lugre_steering.errors import LugreSteeringError
from lugre_steering.pool import ATTEMPTS, WorkerDiedError

T = TypeVar("T")
R = TypeVar("R")
PATIENCE = "20s"


def on_cluster(function: Callable[[T], R], tasks: Sequence[T], address: str) -> Iterator[tuple[int, R | WorkerDiedError]]:
    """``function`` of every task on the workers of a scheduler: number and result of each as it ends.

    The workers see the same paths and have the same version of this package.
    """
    if importlib.util.find_spec("distributed") is None:
        raise LugreSteeringError("--scheduler: needs Dask (pip install 'lugre_steering[fleet]'); leave it out to use local processes")
    from distributed import Client, KilledWorker, as_completed

    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError, TypeError) as error:
        raise LugreSteeringError(f"--scheduler {address}: no Dask scheduler answers there ({error or type(error).__name__})") from error
    with client:
        futures = client.map(function, tasks, pure=False, retries=ATTEMPTS - 1)
        numbers = {future.key: number for number, future in enumerate(futures)}
        for future in as_completed(futures):
            number = numbers[future.key]
            try:
                yield number, future.result()
            except KilledWorker as error:
                yield number, WorkerDiedError(f"the workers that had it died: {error}")
            future.release()
