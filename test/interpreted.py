# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The compiled loop, run by Python, so that coverage sees its lines: ``NUMBA_DISABLE_JIT=1 pytest -p interpreted ...``.

Numba leaves its functions as they are then; what only compiled code can do (addresses, records without a type) is done here in
Python. Tests that count processes, compilations or time fail in this form.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np
import pytest

from lugre_steering.chain import compiled, doors, hydraulics, step
from lugre_steering.chain.compose import Composition
from lugre_steering.chain.layout import LINE

if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
    raise RuntimeError("expected NUMBA_DISABLE_JIT=1 in the environment")


CASES = 2
"""Of each parametrised test so many are run: the cases of one differ in numbers more than in lines."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the further cases of each test."""
    met = Counter[str]()
    kept, left_out = [], []
    for item in items:
        name = item.nodeid.partition("[")[0]
        met[name] += 1
        (kept if met[name] <= CASES else left_out).append(item)
    items[:] = kept
    config.hook.pytest_deselected(items=left_out)


class Row:
    """One record of a ``Table``, its fields as attributes: ten times as fast as those of ``np.recarray``."""

    __slots__ = ("_columns", "_index", "_table")
    dtype: np.dtype[np.void]

    def __init__(self, table: Table, index: Any) -> None:
        self._table, self._columns, self._index = table, table.columns, index


def _field(place: int) -> property:
    def read(row: Row) -> Any:
        return row._columns[place][row._index]

    def write(row: Row, value: Any) -> None:
        row._columns[place][row._index] = value

    return property(read, write)


@cache
def _rows_of(kind: np.dtype[np.void]) -> type[Row]:
    fields = {name: _field(place) for place, name in enumerate(kind.names or ())}
    return type("Row", (Row,), {"__slots__": (), "dtype": kind, **fields})


class Table:
    """An array of records, each a ``Row``; the same memory. ``numbers``: rows of numbers that it is a view of."""

    def __init__(self, array: Any, numbers: Any = None) -> None:
        self.array, self.numbers, self.size, self.shape, self.dtype = array, numbers, array.size, array.shape, array.dtype
        self.columns = [array[name] for name in array.dtype.names]
        self._row = _rows_of(array.dtype)

    def __getitem__(self, index: Any) -> Any:
        return Table(self.array[index]) if isinstance(index, slice) else self._row(self, index)

    def __setitem__(self, index: Any, value: Any) -> None:
        self.array[index] = value._table.array[value._index] if isinstance(value, Row) else value

    def __array__(self, *_: Any, **__: Any) -> Any:
        return self.array


_tables: dict[tuple[int, Any], Table] = {}
"""By the address of the object: it lives as long as the table that stands here."""
_entries: dict[int, tuple[Any, Any]] = {}
KEPT = 64


def _row(numbers: Any, index: Any, kind: Any) -> Row:
    """A row of numbers as a record whose fields stand first in it."""
    key = id(numbers), kind
    if key not in _tables:
        if len(_tables) >= KEPT:
            _tables.clear()
        _tables[key] = Table(numbers[:, : kind.itemsize // 8].view(kind)[:, 0], numbers)
    return _tables[key][index]  # type: ignore[no-any-return]


def _as(row: Row, kind: Any) -> Row:
    return _row(row._table.numbers, row._index, kind)


_opened: list[Composition] = []


def _doors(composition: Composition) -> doors.Doors:
    if composition not in _opened:
        _opened.append(composition)
    return doors.Doors(*3 * (_opened.index(composition),))


def _call_step(door: Any, p: Any, s: Any, rubber: Any, out: Any, *numbers: Any) -> None:
    made = _opened[int(door)]
    doors._step_door([_as(p, made.parameters)], [_as(s, made.state)], rubber, len(rubber), [out], *numbers)


def _call_number(door: Any, row: Any, number: Any) -> Any:
    made = _opened[int(door)]
    if row.dtype == LINE:
        return doors._line_error_door([_as(row, made.lines)], number)
    return doors._arm_factor_door([_as(row, made.parameters)], number)


def _tabled(value: Any) -> Any:
    """Records as tables, as compiled code sees them; the same memory."""
    if isinstance(value, tuple):
        if id(value) not in _entries:
            if len(_entries) >= KEPT:
                _entries.clear()
            _entries[id(value)] = value, type(value)(*map(_tabled, value))
        return _entries[id(value)][1]
    return Table(value) if isinstance(value, np.ndarray) and value.dtype.names else value


def _entered(function: Callable[..., Any]) -> Callable[..., Any]:
    """A compiled entrance, for plain arrays."""

    def run(*arguments: Any) -> Any:
        with np.errstate(all="ignore"):  # compiled code divides by zero without a word
            return function(*map(_tabled, arguments))

    return run


vars(hydraulics.moment_arm)["py_func"] = hydraulics.moment_arm
vars(compiled)["_power_of_two"] = lambda shifted: math.ldexp(1.0, int(shifted - compiled._ROUND))
vars(doors).update(carray=lambda pointer, _: pointer)  # a list of one record, or the table itself
vars(doors).update(row=_row, call_step=_call_step, call_number=_call_number, doors=_doors)
vars(step).update(_run=_entered(step._run), _torques=_entered(step._torques))

from lugre_steering.estimator import estimator  # noqa: E402 (it takes over what stands in ``doors``)

vars(estimator)["_process"] = _entered(estimator._process)
