# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A service whose answer takes time: worked out beside the executor, so that no torque waits for it, and given by the executor."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator
from concurrent.futures import Future
from functools import partial
from typing import Any

from rclpy.node import Node
from std_srvs.srv import Trigger

Work = Generator[Callable[[], Any], Any, tuple[bool, str]]
"""What a service does, in the executor; what it yields is called in a thread of its own. Returns success and message."""


class Later:
    """One ``Trigger`` service. rclpy's events executor knows no coroutines: the response is kept back, and sent by ``tick``."""

    def __init__(self, node: Node, name: str, work: Callable[[], Work], fault: Callable[[BaseException], None]) -> None:
        self._work, self._fault = work, fault
        self._waiting: list[tuple[Future[Any], Work, Callable[[bool, str], None]]] = []
        service = node.create_service(Trigger, name, lambda _, response: response)
        self._send, service.send_response = service.send_response, self._begin

    def tick(self) -> None:
        """Go on with what has been worked out; to be called often, by the executor."""
        done = [entry for entry in self._waiting if entry[0].done()]
        self._waiting = [entry for entry in self._waiting if entry not in done]
        for job, work, answer in done:
            error = job.exception()
            self._go_on(work, partial(work.throw, error) if error is not None else partial(work.send, job.result()), answer)

    def _begin(self, response: Trigger.Response, header: Any) -> None:
        def answer(success: bool, message: str) -> None:
            response.success, response.message = success, message
            self._send(response, header)

        work = self._work()
        self._go_on(work, partial(next, work), answer)

    def _go_on(self, work: Work, step: Callable[[], Callable[[], Any]], answer: Callable[[bool, str], None]) -> None:
        try:
            task = step()
        except StopIteration as end:
            answer(*end.value)
        except Exception as error:  # would end the service, and the caller would wait for ever
            self._fault(error)
            answer(False, f"{type(error).__name__}: {error}")
        else:
            job: Future[Any] = Future()
            threading.Thread(target=_run, args=(job, task), daemon=True).start()
            self._waiting.append((job, work, answer))


def _run(job: Future[Any], task: Callable[[], Any]) -> None:
    try:
        job.set_result(task())
    except BaseException as error:
        job.set_exception(error)
