# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Inputs damaged at random, thousands of them: every one must be read or refused, and nothing may be lost in silence.

Each case runs in a process of its own that is watched from outside. A case has a number: the same number damages the
same input in the same way, so ``--first N --cases 1`` repeats one. A target is a module with ``corpus`` and ``attempt``.
"""

from __future__ import annotations

import argparse
import importlib
import multiprocessing
import resource
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple, Protocol, cast

from lugre_steering.serialise import as_json

TARGETS = {name: f"lugre_steering.bench.fuzz_{name}" for name in ("bag", "vehicle", "parameters", "effects", "import", "results")}
TIME_LIMIT_S, MEMORY_LIMIT_MB = 10.0, 1024.0
_RUNAWAY = 4 << 30  # bytes of address space, so that one case cannot take the machine with it
GOOD = ("read", "refused")  # any other verdict is a fault
FAULTS = ("traceback", "hang", "crash", "memory", "silent loss")


class Target(Protocol):
    """What a module gives to be fuzzed."""

    def corpus(self, folder: Path) -> None:
        """Write the sound inputs that are to be damaged."""

    def attempt(self, folder: Path, case: int) -> tuple[str, str]:
        """Damage an input as ``case`` says and use it: a verdict (``read``, ``refused``, ``silent loss``) and details.

        An exception that users should not see goes through and counts as a traceback.
        """


class Case(NamedTuple):
    """What became of one damaged input."""

    case: int
    verdict: str
    detail: str
    seconds: float
    peak_MB: float


def target(name: str) -> Target:
    """The module behind a name of ``TARGETS``."""
    return cast("Target", importlib.import_module(TARGETS[name]))


def _work(name: str, folder: Path, pipe: Connection) -> None:
    """Answer case numbers with verdicts until killed."""
    resource.setrlimit(resource.RLIMIT_AS, (_RUNAWAY, _RUNAWAY))
    module = target(name)
    while True:
        case = pipe.recv()
        try:
            verdict, detail = module.attempt(folder, case)
        except Exception as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            verdict, detail = "traceback", f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
        pipe.send((verdict, detail, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0))


class _Worker:
    """A process that takes cases, and is replaced when one of them has got the better of it."""

    def __init__(self, name: str, folder: Path) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_work, args=(name, folder, other), daemon=True)
        self._process.start()
        other.close()

        self.run(0, 60.0)  # loads the program

    def run(self, case: int, limit_s: float = TIME_LIMIT_S) -> Case:
        begin = time.perf_counter()
        verdict, detail, peak = "crash", "", 0.0
        try:
            self._pipe.send(case)
            if self._pipe.poll(limit_s):
                verdict, detail, peak = self._pipe.recv()
            else:
                verdict = "hang"
        except (EOFError, OSError):
            self._process.join()
            detail = f"exit code {self._process.exitcode}"
        if peak > MEMORY_LIMIT_MB and verdict in GOOD:
            verdict, detail = "memory", f"{peak:.0f} MB; {detail}"
        return Case(case, verdict, detail, time.perf_counter() - begin, peak)

    def stop(self) -> None:
        self._process.kill()
        self._process.join()
        self._pipe.close()


def fuzz(name: str, cases: Sequence[int], seconds: float) -> Iterator[Case]:
    """Run cases one after the other for at most some time."""
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory(prefix="lugre_steering_fuzz_") as temporary:
        folder = Path(temporary)
        target(name).corpus(folder)
        worker = _Worker(name, folder)
        try:
            for number in cases:
                if time.monotonic() > end:
                    return
                case = worker.run(number)
                if case.verdict not in (*GOOD, "traceback", "silent loss"):
                    worker.stop()
                    worker = _Worker(name, folder)
                yield case
        finally:
            worker.stop()


def scoreboard(cases: Sequence[Case]) -> dict[str, Any]:
    """How many cases ended how, the worst of them, and every fault."""
    counts = Counter(case.verdict for case in cases)
    return {
        "cases": len(cases),
        **{verdict: counts[verdict] for verdict in (*GOOD, *FAULTS)},
        "slowest_s": max((case.seconds for case in cases), default=0.0),
        "peak_MB": max((case.peak_MB for case in cases), default=0.0),
        "faults": [case._asdict() for case in cases if case.verdict not in GOOD],
    }


def run(argv: Sequence[str]) -> None:
    """Command line of this benchmark."""
    parser = argparse.ArgumentParser(prog="python -m lugre_steering.bench fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"what to fuzz: {', '.join(TARGETS)} [all]")
    parser.add_argument("--cases", type=int, default=2000, help="damaged inputs for each target [2000]")
    parser.add_argument("--first", type=int, default=0, help="number of the first case [0]")
    parser.add_argument("--seconds", type=float, default=600.0, help="longest time for each target [600]")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    options = parser.parse_args(argv)
    if unknown := set(options.targets) - set(TARGETS):
        parser.error(f"got {', '.join(sorted(unknown))}, expected {', '.join(TARGETS)}")
    numbers = range(options.first, options.first + options.cases)
    results = {name: scoreboard(list(fuzz(name, numbers, options.seconds))) for name in options.targets or TARGETS}
    if options.json:
        print(as_json(results))
        return
    for name, result in results.items():
        verdicts = ", ".join(f"{result[verdict]} {verdict}" for verdict in (*GOOD, *FAULTS))
        worst = f"slowest {result['slowest_s']:.2f} s, peak {result['peak_MB']:.0f} MB"
        print(f"fuzz, {name}: {result['cases']} cases: {verdicts}; {worst}")
        for fault in result["faults"]:
            print(f"  case {fault['case']}: {fault['verdict']}: {fault['detail']}")
