# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What is shown on a terminal while something is done, and nothing of it in a pipe."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rich.markup import escape
from rich.progress import Progress, TaskID

from lugre_steering.terminal import console


@contextmanager
def progress_bar() -> Iterator[Callable[[str, int, int | None], None]]:
    """A bar per task on a terminal, nothing in a pipe: call it with a name, how much is done, and of how much."""
    with Progress(console=console(), disable=not sys.stderr.isatty()) as bar:
        tasks: dict[str, TaskID] = {}

        def show(name: str, done: int, total: int | None) -> None:
            if name not in tasks:
                tasks[name] = bar.add_task(escape(name))
            bar.update(tasks[name], completed=done, total=total)

        yield show


@contextmanager
def spinner() -> Iterator[Callable[[str], None]]:
    """One line that says what is being done, on a terminal only: call it with each new text."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    with console().status("") as status:
        yield lambda text: status.update(escape(text))


@contextmanager
def step_bar(steps: Sequence[str]) -> Iterator[Callable[[str], None]]:
    """A bar over the named steps, on a terminal only: a text that begins with a step moves it there, any other is a detail."""
    with Progress(console=console(), disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task("", total=len(steps))
        reached = 0

        def show(text: str) -> None:
            nonlocal reached
            reached = max([reached, *(i for i, step in enumerate(steps) if text.startswith(step))])
            bar.update(task, description=escape(text), completed=reached)

        yield show
        bar.update(task, completed=len(steps))
