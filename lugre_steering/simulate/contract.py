# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What every effect owes the chain and the estimator, checked on the test vehicle: ``broken`` says what an effect fails to keep."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from lugre_steering.chain.step import Records, new_state, run_side, torque_side
from lugre_steering.effects.entry import Effect, Parameter
from lugre_steering.recording import Array
from lugre_steering.resources import config_folder
from lugre_steering.simulate.contract_live import broken_live
from lugre_steering.vehicle import load
from lugre_steering.vehicle.model import build_model

UNIT = re.compile(r"(1|[0-9]|N|m|rad|deg|s|K|W|J|Pa|kg|degC|[/^() ])+")
NEUTRAL = {"arm": 1.0, "line": 0.0, "delay": 0.0, "lag": 0.0}
"""Laws of sensors that are no part of the step, and what they give where every amplitude is zero."""
NOTICED = 1e-6
"""Change of the torque, as a share of its amplitude, from which a parameter acts."""
SLOWER = 10
"""Samples of the chain for one of the estimator's: a law holds at any sample time, and this is the longest that suits the estimator."""

Driven = tuple[Array, Array, Array, Array]


def broken(effect: Effect) -> list[str]:
    """The promises that an effect breaks, in words; empty if it keeps all. It must stand in the catalogue."""
    vehicle = load(config_folder() / "test_vehicle.yaml")
    model = build_model(vehicle)
    found = [f"unit: {p.name} has '{p.unit}', expected SI units" for p in effect.parameters if not UNIT.fullmatch(p.unit)]
    found += _sensed(effect)
    if not effect.hooks.keys() <= NEUTRAL.keys():
        bench = _Bench(effect, model.parameters[0], model.rubber)
        for check in (_neutral, _acting, _finite, _in_pieces, _causal, _mirrored, _passive):
            found += check(bench)
    if effect.hooks and not found:  # what the chain shows would be told once more
        time, theta, *_ = _cycles()
        found += broken_live(effect, vehicle, time[::SLOWER], theta[::SLOWER])
    return found


def _sensed(effect: Effect) -> Iterator[str]:
    """What laws of sensors break over some angles and times."""
    hooks = [hook for hook in NEUTRAL if hook in effect.hooks]
    theta, elapsed = np.linspace(-0.5, 0.5, 11), np.linspace(0.0, 60.0, 11)

    def laws(**changes: float) -> Array:
        values = {parameter.name: changes.get(parameter.name, parameter.typical) for parameter in effect.parameters}
        with np.errstate(all="ignore"):
            given = [effect.law(hook, values, theta=theta, elapsed=elapsed) for hook in hooks]
        return np.array([np.broadcast_to(part, theta.shape) for part in given])

    typical = laws()
    if not np.isfinite(typical).all():
        yield "finite: a law of a sensor gives no number at its typical size"
    for hook, given in zip(hooks, laws(**dict.fromkeys(effect.amplitudes, 0.0)), strict=True):
        if not np.allclose(given, NEUTRAL[hook], rtol=0.0, atol=1e-12):
            yield f"neutral: the law '{hook}' does not give {NEUTRAL[hook]:g} where every amplitude is zero"
    read = {name for hook in hooks for name in effect.reads(hook)}
    for parameter in effect.parameters:
        if parameter.name in read and np.array_equal(laws(**{parameter.name: _other(parameter)}), typical):
            yield f"acting: no law of a sensor changes with {parameter.name}"


def _other(parameter: Parameter) -> float:
    """Another value than the typical one."""
    value = parameter.typical
    return 1.2 * value if value != 0.0 else 0.1 * parameter.scale


class _Bench:
    """One track with an effect at its typical size, driven through two cycles with rests and small reversals."""

    def __init__(self, effect: Effect, baseline: Records, rubber: Array) -> None:
        self.effect, self.baseline, self.rubber = effect, baseline, rubber
        self.motion = _cycles()
        self.plain = self.torque(baseline)

    def parameters(self, **changes: float) -> Records:
        p = self.baseline.copy()
        values = {parameter.name: changes.get(parameter.name, parameter.typical) for parameter in self.effect.parameters}
        for field, number in self.effect.fields(values).items():
            p[field] = number
        return p

    def torque(self, p: Records, motion: Driven | None = None) -> Array:
        return torque_side(p, self.rubber, *(motion or self.motion))

    def change(self, a: Array, b: Array) -> float:
        return float(np.sqrt(np.mean((a - b) ** 2)) / np.abs(self.plain).max())


def _cycles() -> Driven:
    """Time, angle, rate, acceleration (n,): two cycles of 25 deg at 6 deg/s with rests at the limits, then reversals of 3 deg."""
    corners = np.radians([0.0, 25.0, 25.0, -25.0, -25.0, 25.0, 25.0, -25.0, -25.0, 0.0, 0.0])
    at = np.cumsum(np.concatenate([[1.0], np.maximum(np.abs(np.diff(corners)) / np.radians(6.0), 2.0)]))
    time = np.asarray(np.arange(round((at[-1] + 12.0) * 100.0)) / 100.0, np.float64)
    theta = np.convolve(np.interp(time, at, corners), np.full(21, 1.0 / 21.0), mode="same")
    late = time > at[-1] + 1.0
    theta[late] += np.radians(3.0) * np.sin(1.5 * (time[late] - time[late][0]))
    omega = np.diff(theta, prepend=theta[0]) * 100.0
    return time, theta, omega, np.asarray(np.gradient(omega, time))


def _neutral(bench: _Bench) -> Iterator[str]:
    off = bench.parameters(**dict.fromkeys(bench.effect.amplitudes, 0.0))
    if not np.allclose(bench.torque(off), bench.plain, rtol=1e-12, atol=1e-9):
        yield "neutral: the torque is not that of the baseline where every amplitude is zero"


def _acting(bench: _Bench) -> Iterator[str]:
    typical = bench.torque(bench.parameters())
    if bench.change(typical, bench.plain) < NOTICED:
        yield "acting: the torque does not change at its typical size; give parameters an 'example' at which it does"
        return
    windows = [{}, *(dict.fromkeys(pair, 0.0) for pair in bench.effect.places)]  # one range hides what another does
    read = {name for hook in bench.effect.hooks.keys() - NEUTRAL.keys() for name in bench.effect.reads(hook)}
    for parameter in (p for p in bench.effect.parameters if p.name in read):
        other = {parameter.name: _other(parameter)}
        changes = [
            bench.change(bench.torque(bench.parameters(**rest)), bench.torque(bench.parameters(**rest, **other)))
            for rest in windows
            if parameter.name not in rest
        ]
        if max(changes) < NOTICED:
            yield f"acting: the torque does not change with {parameter.name}"


def _finite(bench: _Bench) -> Iterator[str]:
    time, theta, omega, alpha = bench.motion
    gap = time + np.where(np.arange(time.size) > 500, 1e4, 0.0)
    twice = np.repeat(time[:400], 2), np.repeat(theta[:400], 2), np.repeat(omega[:400], 2), np.repeat(alpha[:400], 2)
    for what, motion in (("a gap of hours", (gap, theta, omega, alpha)), ("two samples of one time", twice)):
        if not np.isfinite(bench.torque(bench.parameters(), motion)).all():
            yield f"finite: {what} makes the torque no number"


def _in_pieces(bench: _Bench) -> Iterator[str]:
    p, cut = bench.parameters(), 1200
    state = new_state(p)
    time, theta, omega, alpha = bench.motion
    run_side(p, bench.rubber, time[:cut], theta[:cut], omega[:cut], alpha[:cut], state)
    rest = run_side(p, bench.rubber, time[cut:], theta[cut:], omega[cut:], alpha[cut:], state, float(time[cut - 1]))
    whole = run_side(p, bench.rubber, *bench.motion)  # the same code: what fits run is compiled apart, and may round otherwise
    if not np.array_equal(rest["torque"], whole["torque"][cut:]):
        yield "pieces: a run that is interrupted and goes on from its state gives another torque (memory outside the state)"


def _causal(bench: _Bench) -> Iterator[str]:
    time, *columns = bench.motion
    changed = [np.where(np.arange(time.size) < 1700, column, 0.9 * column) for column in columns]
    p = bench.parameters()
    if not np.array_equal(bench.torque(p, (time, changed[0], changed[1], changed[2]))[:1700], bench.torque(p)[:1700]):
        yield "causal: what comes later changes the torque of before"


def _mirrored(bench: _Bench) -> Iterator[str]:
    time, theta, omega, alpha = bench.motion
    odd = bench.change(bench.torque(bench.parameters()), -bench.torque(bench.parameters(), (time, -theta, -omega, -alpha)))
    if odd > NOTICED and not bench.effect.one_sided:
        yield "mirror: left and right turns differ; declare one_sided if that is meant"
    if odd <= NOTICED and bench.effect.one_sided:
        yield "mirror: left and right turns are alike, but one_sided is declared"


def _passive(bench: _Bench) -> Iterator[str]:
    """Over whole cycles no effect gives back more energy than the friction takes."""
    time, theta, *_ = bench.motion
    once = (time > 14.0) & (time <= 14.0 + 2.0 * (50.0 / 6.0 + 2.0))  # from one passage to the next
    work = float(np.sum(bench.torque(bench.parameters())[1:][once[1:]] * np.diff(theta)[once[1:]]))
    if work < 0.0:
        yield f"passive: a whole cycle gives {-work:.3g} J back"
