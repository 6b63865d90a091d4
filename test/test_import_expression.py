# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Formulas from files: arithmetic as Python does it, and nothing but arithmetic."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lugre_steering.expression import FUNCTIONS, ExpressionError, parse

NAMES = ("x", "load", "p[1]", "log.a")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0.5 / 4 * x * load / 885", 0.5 / 4 * 3.0 * -2.0 / 885),
        ("2*x**2 - -x", 21.0),
        ("-x**2", -9.0),
        ("2**x**0.5", 2.0 ** math.sqrt(3.0)),
        ("p[1] + log.a", 12.0),
        ("abs(load) + sign(load) + sqrt(x) + exp(x) + log(x) + tanh(x) + sin(x) + cos(x)",
         2 - 1 + math.sqrt(3) + math.exp(3) + math.log(3) + math.tanh(3) + math.sin(3) + math.cos(3)),
        ("min(x, load, 1) * 10 + max(x, load)", -17.0),
        ("x\n  + 1", 4.0),
        ("1 / 3 * x", 1.0),
    ],
)  # fmt: skip
def test_a_formula_means_what_it_says(text: str, value: float) -> None:
    values = {"x": np.array([3.0, 3.0]), "load": -2.0, "p[1]": np.array([5.0, 5.0]), "log.a": 7.0}
    formula = parse(text, NAMES)
    assert np.broadcast_to(formula.evaluate(values), 2) == pytest.approx([value, value], rel=1e-14)


def test_the_normalised_source_is_python_and_gives_the_same() -> None:
    formula = parse("x ** 2 / (load+1) - max(x,2,load)*tanh( x )", NAMES)
    assert formula.names == ("x", "load")
    assert formula.source == "x ** 2 / (load + 1.0) - max(x, 2.0, load) * tanh(x)"
    # The formula was checked, so Python may run it here: an independent evaluation.
    same = eval(formula.source, {"__builtins__": {}}, {**FUNCTIONS, "x": 0.3, "load": 4.0})
    assert float(formula.evaluate({"x": 0.3, "load": 4.0})) == pytest.approx(same, rel=1e-14)
    assert parse(formula.source, NAMES).source == formula.source


def test_what_is_undefined_is_no_number_and_no_error() -> None:
    values = parse("1 / x + log(load) + (-2) ** 0.5", NAMES).evaluate({"x": np.array([0.0]), "load": np.array([-1.0])})
    assert not np.isfinite(values).any()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x + lod", "at character 5: no 'lod'; did you mean 'load'"),
        ("1 + y", r"at character 5: no 'y'; names here: x, load, p\[1\], log\.a"),
        ("x +", "invalid syntax"),
        ("", "invalid syntax"),
        ("x ^ 2", "at character 1: 'x \\^ 2' is not allowed; a power is written \\*\\*"),
        ("__import__('os').system('true')", "no function"),
        ("open('/etc/passwd')", "no function 'open'"),
        ("x.__class__", "no 'x.__class__'"),
        ("(lambda: 1)()", "no function"),
        ("[x for x in load]", "not allowed"),
        ("x if load else 1", "not allowed"),
        ("x < 1", "not allowed"),
        ("'text'", "not allowed"),
        ("True", "not allowed"),
        ("1j", "not allowed"),
        ("sin(x, x)", "sin takes one argument"),
        ("min(x)", "min takes two or more"),
        ("max(*p)", "two or more"),
        ("log(x=1)", "log takes one"),
        ("10 ** 400 + 1e999", "at character 13: a number too large"),
        ("x" + " + x" * 400, "nested more than 100 deep"),
        ("(" * 900 + "x" + ")" * 900, "expected numbers, names"),
        ("-" * 1900 + "x", "expression '---"),
        ("9" * 2500, "has 2500 characters"),
        ("x \0", "expression 'x "),
    ],
)
def test_whatever_else_is_refused_with_its_place(text: str, message: str) -> None:
    with pytest.raises(ExpressionError, match=message) as error:
        parse(text, NAMES)
    assert len(str(error.value)) < 500


def test_a_power_of_powers_costs_nothing() -> None:
    assert np.isinf(parse("9 ** 9 ** 9 ** 9 ** 9", NAMES).evaluate({}))
