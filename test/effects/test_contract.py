# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Every effect keeps what it owes the chain, and the check notices one that does not."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterator

import pytest

from lugre_steering.chain.compiled import law
from lugre_steering.chain.compose import check
from lugre_steering.effects import Effect, Parameter, registry
from lugre_steering.errors import EffectError
from lugre_steering.simulate.contract import broken


@pytest.mark.parametrize("effect", registry.CATALOGUE)
def test_every_effect_keeps_the_contract(effect: str) -> None:
    assert broken(registry.effect(effect)) == []


def made(function: object, *parameters: Parameter, hook: str = "torque", **more: object) -> Effect:
    data = {"stage": "parallel_torque", "tier": 2, "title": "t", "equation": "", "source": "", "trace": "", "coordinate": "time"}
    return Effect(id="tried", parameters=parameters, hooks={hook: law(function)}, **{**data, **more})  # type: ignore[arg-type]


SIZE = Parameter("size", "N m", "amplitude", 500.0)


def not_neutral(size):  # type: ignore[no-untyped-def]
    return 100.0 + size


def one_sided(theta, size):  # type: ignore[no-untyped-def]
    return size * max(theta, 0.0)


def idle(theta, size, edge):  # type: ignore[no-untyped-def]
    return size * math.sin(theta) + 0.0 * edge


def endless(theta, dt, size):  # type: ignore[no-untyped-def]
    return size * math.sin(theta) * 0.01 / dt


def blind(size, edge):  # type: ignore[no-untyped-def]
    return 1.0 + size + 0.0 * edge


def quick(theta, dt, size):  # type: ignore[no-untyped-def]
    return size * math.sin(theta) if dt < 0.05 else 0.0


def growing(theta, size, grown):  # type: ignore[no-untyped-def]
    return size * math.sin(theta), 1e4 * grown + 1.0


def driving(omega, size):  # type: ignore[no-untyped-def]
    return -400.0 * size * omega


BREAKING = {
    f"breaking_{i}": (dataclasses.replace(effect, id=f"breaking_{i}"), word)
    for i, (effect, word) in enumerate([
        (made(one_sided, SIZE), "mirror"),
        (made(idle, SIZE, Parameter("edge", "rad", "read, but to no end", 0.1, grid=(0.1,))), "acting: .* edge"),
        (made(endless, SIZE), "finite: two samples"),
        (made(driving, SIZE), "passive"),
        (made(one_sided, dataclasses.replace(SIZE, unit="lbf ft"), one_sided=True), "unit"),
        (made(not_neutral, Parameter("size", "N m", "", 5.0), acts_by=("size",), one_sided=False), "mirror"),
        (made(blind, SIZE, Parameter("edge", "rad", "read, but to no end", 0.1, grid=(0.1,)), hook="arm"), "acting: .* edge"),
        (made(not_neutral, SIZE, hook="delay"), "neutral: the law 'delay'"),
        (made(quick, SIZE), "live: neither torque nor residual"),
        (made(growing, SIZE, memory={"grown": 0.0}), "live: its memory cannot be kept over a restart: .*grown"),
    ])
}  # fmt: skip


@pytest.fixture(scope="module")
def _all_known() -> Iterator[None]:
    """All at once in the catalogue, so that one step is compiled for all of them."""
    registry.CATALOGUE.update({name: effect for name, (effect, _) in BREAKING.items()})
    yield
    for name in BREAKING:
        del registry.CATALOGUE[name]


@pytest.mark.usefixtures("_all_known")
@pytest.mark.parametrize("name", BREAKING)
def test_what_an_effect_breaks_is_told(name: str) -> None:
    effect, word = BREAKING[name]
    found = broken(effect)
    assert any(re.match(word, line) for line in found), found


def forgetful(theta, size, wound):  # type: ignore[no-untyped-def]
    return size * theta * wound, wound


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        (made(one_sided, SIZE, hook="torsion"), "expected one of angle"),
        (made(idle, SIZE), "got the argument 'edge'"),
        (made(one_sided, SIZE, Parameter("other", "1", "", 1.0)), "other: no law reads it"),
        (made(forgetful, SIZE, Parameter("wound", "1", "", 1.0), memory={"wound": 0.0}), "expected each name once"),
    ],
)
def test_wiring_that_leads_nowhere_is_refused(effect: Effect, words: str) -> None:
    with pytest.raises(EffectError, match=words):
        check(effect)
