# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Formulas from a user's file: numbers, allowed names, + - * / ** and a few functions. Parsed and walked, never run as
Python, so a formula can do nothing but arithmetic."""

from __future__ import annotations

import ast
import difflib
import functools
import operator
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lugre_steering.errors import LugreSteeringError
from lugre_steering.recording import Array

MAX_LENGTH = 2000
"""Characters of a formula."""
MAX_DEPTH = 100
"""Nested operations, so that walking one never exhausts the stack."""

FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "abs": np.abs, "sign": np.sign, "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "tanh": np.tanh, "sin": np.sin,
    "cos": np.cos, "min": lambda *x: functools.reduce(np.minimum, x), "max": lambda *x: functools.reduce(np.maximum, x),
}  # fmt: skip
"""Functions of a formula and what they mean; min and max take two or more arguments, the others one (angles in rad)."""
_SEVERAL = ("min", "max")

_BINARY: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: np.true_divide, ast.Pow: np.float_power,
}  # fmt: skip
_UNARY: Mapping[type[ast.unaryop], Callable[[Any], Any]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}


class ExpressionError(LugreSteeringError):
    """A formula that is none, or that uses what is not allowed."""


@dataclass(frozen=True)
class Expression:
    """A checked formula. ``names``: those it uses, in order of appearance. ``source``: the same formula as normalised
    Python (one spelling for equal formulas; calls only ``FUNCTIONS``, numbers are floats but for whole exponents)."""

    text: str
    names: tuple[str, ...]
    source: str
    _tree: ast.expr

    def evaluate(self, values: Mapping[str, Array | float]) -> Array:
        """The value, of the shape the ``values`` broadcast to. What is undefined (1/0, log of -1) is inf or NaN."""
        with np.errstate(all="ignore"):
            return np.asarray(_value(self._tree, values), np.float64)


def parse(text: str, names: Collection[str]) -> Expression:
    """Check a formula of the allowed ``names``; these may look like ``a``, ``a.b`` or ``a[1]``."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression has {len(text)} characters, expected at most {MAX_LENGTH}")
    try:
        tree = ast.parse(" ".join(text.split()), mode="eval").body
    except SyntaxError as error:
        where = f"at character {error.offset}: " if error.offset else ""
        raise ExpressionError(f"expression '{_clip(text)}': {where}{error.msg}; expected {_LANGUAGE}") from None
    except (ValueError, RecursionError, MemoryError):  # zero bytes; brackets without end
        raise ExpressionError(f"expression '{_clip(text)}': cannot be read; expected {_LANGUAGE}") from None
    used: dict[str, None] = {}
    checked = _Check(text, names, used).visit(tree, 0)
    return Expression(text, tuple(used), ast.unparse(checked), checked)


_LANGUAGE = f"numbers, names, + - * / ** and the functions {', '.join(FUNCTIONS)}"


class _Check:
    """Walks a formula once; returns it with its numbers normalised."""

    def __init__(self, text: str, names: Collection[str], used: dict[str, None]) -> None:
        self.text, self.names, self.used = text, names, used

    def fail(self, node: ast.expr, what: str) -> ExpressionError:
        return ExpressionError(f"expression '{_clip(self.text)}': at character {node.col_offset + 1}: {what}")

    def visit(self, node: ast.expr, depth: int, exponent: bool = False) -> ast.expr:
        if depth > MAX_DEPTH:
            raise self.fail(node, f"nested more than {MAX_DEPTH} deep")
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            return ast.copy_location(ast.Constant(self.number(node, exponent)), node)
        if isinstance(node, (ast.Name, ast.Attribute, ast.Subscript)):
            return self.name(node)
        if isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
            return ast.UnaryOp(node.op, self.visit(node.operand, depth + 1, exponent))
        if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
            left = self.visit(node.left, depth + 1)
            return ast.BinOp(left, node.op, self.visit(node.right, depth + 1, isinstance(node.op, ast.Pow)))
        if isinstance(node, ast.Call):
            return self.call(node, depth)
        power = isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor)
        hint = "a power is written **" if power else f"expected {_LANGUAGE}"
        raise self.fail(node, f"'{_short(node)}' is not allowed; {hint}")

    def number(self, node: ast.Constant, exponent: bool) -> int | float:
        """As a float; a whole exponent stays whole, as powers by multiplication are faster and exact."""
        value: Any = node.value
        if exponent and isinstance(value, int) and value <= 64:
            return value
        try:
            number = float(value)
        except OverflowError:
            number = float("inf")
        if not np.isfinite(number):
            raise self.fail(node, "a number too large")
        return number

    def name(self, node: ast.expr) -> ast.expr:
        name = ast.unparse(node)
        if name not in self.names:
            near = difflib.get_close_matches(name, self.names, n=1, cutoff=0.6)
            allowed = f"did you mean '{near[0]}'?" if near else f"names here: {_listed(self.names)}"
            raise self.fail(node, f"no '{_short(node)}'; {allowed}")
        self.used[name] = None
        return node

    def call(self, node: ast.Call, depth: int) -> ast.expr:
        function = ast.unparse(node.func)
        if function not in FUNCTIONS:
            raise self.fail(node, f"no function '{_short(node.func)}'; functions: {', '.join(FUNCTIONS)}")
        fits = len(node.args) >= 2 if function in _SEVERAL else len(node.args) == 1
        if not fits or node.keywords:
            wanted = "two or more arguments" if function in _SEVERAL else "one argument"
            raise self.fail(node, f"{function} takes {wanted}")
        return ast.Call(node.func, [self.visit(argument, depth + 1) for argument in node.args], [])


def _value(node: ast.expr, values: Mapping[str, Array | float]) -> Any:
    match node:
        case ast.Constant(value=number):
            return number
        case ast.UnaryOp(op=op, operand=operand):
            return _UNARY[type(op)](_value(operand, values))
        case ast.BinOp(left=left, op=operation, right=right):
            return _BINARY[type(operation)](_value(left, values), _value(right, values))
        case ast.Call(func=function, args=arguments):
            return FUNCTIONS[ast.unparse(function)](*(_value(argument, values) for argument in arguments))
    return values[ast.unparse(node)]


def _short(node: ast.expr) -> str:
    return _clip(ast.unparse(node), 40)


def _clip(text: str, length: int = 120) -> str:
    return text if len(text) <= length else f"{text[: length - 3]}..."


def _listed(names: Collection[str]) -> str:
    """Names for a message: all of a few, some of many."""
    shown = ", ".join(list(names)[:20])
    return f"{shown} and {len(names) - 20} more" if len(names) > 20 else shown or "none"
