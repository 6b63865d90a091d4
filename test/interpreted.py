# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The compiled loop, run by Python, so that coverage sees its lines: ``NUMBA_DISABLE_JIT=1 pytest -p interpreted --cov ...``.

Numba leaves its functions as they are then; what only compiled code can do (addresses, records without a type) is done here in
Python. Tests that count processes, compilations or time fail in this form.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from lugre_steering.chain import compiled, doors, hydraulics, step
from lugre_steering.chain.compose import Composition
from lugre_steering.chain.layout import LINE

if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
    raise RuntimeError("expected NUMBA_DISABLE_JIT=1 in the environment")


class Row:
    """A row of numbers as a record whose fields stand first in it."""

    __slots__ = ("numbers", "record")

    def __init__(self, numbers: Any, kind: Any) -> None:
        object.__setattr__(self, "numbers", numbers)
        object.__setattr__(self, "record", numbers[: kind.itemsize // 8].view(kind).view(np.recarray)[0])

    def __getattr__(self, name: str) -> Any:
        return getattr(self.record, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self.record, name, value)


_opened: list[Composition] = []


def _doors(composition: Composition) -> doors.Doors:
    if composition not in _opened:
        _opened.append(composition)
    return doors.Doors(*3 * (_opened.index(composition),))


def _call_step(door: Any, p: Any, s: Any, *others: Any) -> None:
    made = _opened[int(door)]
    made.step(Row(p.numbers, made.parameters), Row(s.numbers, made.state), *others)


def _call_number(door: Any, record: Any, number: Any) -> Any:
    made = _opened[int(door)]
    if record.record.dtype.names == LINE.names:
        return made.line_error(Row(record.numbers, made.lines), number)
    return made.arm_factor(Row(record.numbers, made.parameters), number)


def _attributes(value: Any) -> Any:
    """Records whose fields are attributes, as in compiled code; the same memory."""
    if isinstance(value, tuple):
        return type(value)(*map(_attributes, value))
    return value.view(np.recarray) if isinstance(value, np.ndarray) and value.dtype.names else value


def _entered(function: Callable[..., Any]) -> Callable[..., Any]:
    """A compiled entrance, for plain arrays."""

    def run(*arguments: Any) -> Any:
        with np.errstate(all="ignore"):  # compiled code divides by zero without a word
            return function(*map(_attributes, arguments))

    return run


vars(hydraulics.moment_arm)["py_func"] = hydraulics.moment_arm
vars(compiled)["_power_of_two"] = lambda shifted: math.ldexp(1.0, int(shifted - compiled._ROUND))
vars(doors).update(row=lambda numbers, index, kind: Row(numbers[index], kind), call_step=_call_step, call_number=_call_number, doors=_doors)
vars(step).update(_run=_entered(step._run), _torques=_entered(step._torques))

from lugre_steering.estimator import estimator  # noqa: E402 (it takes over what stands in ``doors``)

vars(estimator)["_process"] = _entered(estimator._process)
