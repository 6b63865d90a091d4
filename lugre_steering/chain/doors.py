# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The functions of any composition behind one C signature each, so that a loop around them is compiled once for all of them.

Records differ from composition to composition, and with them everything that Numba compiles of a loop that takes them. Here the loop
takes rows of numbers, of which it knows the fields of the baseline (they stand first), and the address of the step: another
set of effects then costs the compilation of its step alone, a tenth of the whole.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from llvmlite import ir
from numba import carray, cfunc, types  # type: ignore[attr-defined]
from numba.extending import intrinsic
from numba.np.numpy_support import from_dtype

from lugre_steering.chain.compiled import inner
from lugre_steering.chain.compose import Composition
from lugre_steering.chain.layout import OUTPUT
from lugre_steering.chain.step import arm_factor, line_error, step

_NUMBER = types.float64
_OPTIONS: Any = {"fastmath": {"contract"}, "error_model": "numpy", "cache": True}
_POINTER, _INTEGER, _DOUBLE = ir.IntType(8).as_pointer(), ir.IntType(64), ir.DoubleType()


class Doors(NamedTuple):
    """Addresses of the compiled functions of one composition; see ``chain.step``."""

    step: int
    arm_factor: int
    line_error: int


_opened: dict[str, tuple[Doors, tuple[Any, ...]]] = {}
"""By the composition's name, with the compiled functions, which live as long as their addresses are known."""


def doors(composition: Composition) -> Doors:
    """The doors of a composition, compiled at the first call."""
    if composition.name not in _opened:
        p, q, s, out, table = (
            types.CPointer(kind)
            for kind in (
                from_dtype(composition.parameters), from_dtype(composition.lines), from_dtype(composition.state),
                from_dtype(OUTPUT), _NUMBER,
            )
        )  # fmt: skip
        compiled = (
            cfunc(types.void(p, s, table, types.int64, out, *4 * (_NUMBER,), types.int64), **_OPTIONS)(_step_door),
            cfunc(_NUMBER(p, _NUMBER), **_OPTIONS)(_arm_factor_door),
            cfunc(_NUMBER(q, _NUMBER), **_OPTIONS)(_line_error_door),
        )
        _opened[composition.name] = Doors(*(function.address for function in compiled)), compiled  # type: ignore[arg-type]
    return _opened[composition.name][0]


def _step_door(p, s, rubber, rows, out, dt, theta, omega, alpha, effects):
    table = carray(rubber, (rows, 2))
    step(carray(p, 1)[0], carray(s, 1)[0], table, carray(out, 1)[0], dt, theta, omega, alpha, effects)


def _arm_factor_door(p, theta):
    return arm_factor(carray(p, 1)[0], theta)


def _line_error_door(q, elapsed):
    return line_error(carray(q, 1)[0], elapsed)


def _row(typing_context: Any, numbers: Any, index: Any, kind: Any) -> Any:  # noqa: ARG001 (signature fixed by Numba)
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        offset = builder.mul(arguments[1], builder.extract_value(array.strides, 0))
        place = builder.gep(builder.bitcast(array.data, _POINTER), [offset])
        return builder.bitcast(place, context.get_value_type(signature.return_type))

    return kind.dtype(numbers, types.intp, kind), codegen


@inner
def copy_row(to, at, source, index):
    """Row ``index`` of ``source`` (rows, n) -> row ``at`` of ``to`` (rows, n)."""
    for i in range(source.shape[1]):
        to[at, i] = source[index, i]


def _call_step(
    typing_context: Any, door: Any, p: Any, s: Any, rubber: Any, out: Any, dt: Any, theta: Any, omega: Any, alpha: Any, effects: Any,  # noqa: ARG001
) -> Any:  # fmt: skip
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        door, p, s, rubber, out, *numbers, effects = arguments
        table = context.make_array(signature.args[3])(context, builder, rubber)
        p, s, table_data, out = (builder.bitcast(pointer, _POINTER) for pointer in (p, s, table.data, out))
        kind = ir.FunctionType(ir.VoidType(), [_POINTER, _POINTER, _POINTER, _INTEGER, _POINTER, *4 * [_DOUBLE], _INTEGER])
        rows = builder.extract_value(table.shape, 0)
        arguments = [p, s, table_data, rows, out, *numbers, effects]
        builder.call(builder.inttoptr(door, kind.as_pointer()), arguments)
        return context.get_dummy_value()

    return types.void(types.int64, p, s, rubber, out, *4 * (_NUMBER,), types.int64), codegen


def _call_number(typing_context: Any, door: Any, record: Any, number: Any) -> Any:  # noqa: ARG001
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        door, record, number = arguments
        kind = ir.FunctionType(_DOUBLE, [_POINTER, _DOUBLE])
        return builder.call(builder.inttoptr(door, kind.as_pointer()), [builder.bitcast(record, _POINTER), number])

    return _NUMBER(types.int64, record, _NUMBER), codegen


row: Any = intrinsic(_row)
"""For compiled code: ``row(numbers, index, kind)`` is row ``index`` of ``numbers`` (rows, n), C-contiguous, as a record of ``kind``,
whose fields stand first there."""
call_step: Any = intrinsic(_call_step)
"""For compiled code: ``step`` by its door, with records that begin where its own do."""
call_number: Any = intrinsic(_call_number)
"""For compiled code: ``arm_factor`` or ``line_error`` by its door, with such a record and a number."""
