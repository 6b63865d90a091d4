# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Laws that nobody listed, drawn at random: a channel times a function of a coordinate or of its memory.

A third lies outside such a product on purpose (OUTSIDE): what no table of one coordinate can write. Half have a memory. A
resonator that the torque itself excites has become a law since; it is counted as outside. A law is a pure function of a
``Scene``, so that every simulator can carry it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]

DEG = float(np.pi / 180.0)
RATE = 6.0 * DEG
"""Rate [rad/s] in which rates are counted."""
OUTSIDE_SHARE = 1.0 / 3.0


@dataclass(frozen=True)
class Scene:
    """What a law may depend on: series (n,) of time [s]; (2, n) of angle, rate, acceleration, each track's torque without the
    law [N m] and rubber temperature [degC]; steering limit [rad] and sliding torque of both tracks [N m] as sizes."""

    time: Array
    angle: Array
    rate: Array
    acceleration: Array
    torque: Array
    temperature: Array
    limit: float
    torque_scale: float

    @property
    def step(self) -> float:
        return float(self.time[1] - self.time[0])


class Modulation(NamedTuple):
    """What a law does: factors on strength and stiffness of the contact, and torque beside it [N m], each (2, n)."""

    level: Array
    stiffness: Array
    torque: Array


@dataclass(frozen=True)
class Law:
    """A drawn law. ``a``, ``b``, ``c`` are shape numbers (0 to 1), ``memory_s`` a time, ``play`` a width in units of the coordinate."""

    channel: str
    coordinate: str
    memory: str
    shape: str
    outside: str
    a: float
    b: float
    c: float
    memory_s: float
    play: float
    sign: float
    size: float

    def told(self) -> dict[str, str]:
        """What it is, in words that scores are grouped by."""
        memory = self.outside if self.outside in REMEMBERING else self.memory
        return {"channel": self.channel, "coordinate": self.coordinate, "memory": memory, "shape": self.shape, "outside": self.outside}


CHANNELS: dict[str, tuple[float, float]] = {
    "level": (0.05, 0.12), "stiffness": (0.25, 0.5), "conservative": (0.02, 0.05), "coulomb": (0.02, 0.05), "load": (0.02, 0.05),
    "viscous": (0.03, 0.06), "turbulent": (0.03, 0.06), "gain": (0.02, 0.06), "inertia": (0.02, 0.05), "lag": (0.02, 0.05),
}  # fmt: skip
"""Amplitudes: relative, or as a share of the sliding torque (at RATE, at 10 deg/s2), or a time [s] for the lag."""
COORDINATES = (
    "angle", "abs angle", "rate", "direction", "since reversal", "torque", "power", "time", "slip", "dwell", "temperature",
)  # fmt: skip
MOVING = ("angle", "rate", "direction", "since reversal", "torque", "power")
"""Coordinates that go up and down in every recording: what a delay, a mode or a catch needs to be felt."""
MEMORIES = ("none", "lag", "play")
SHAPES = ("linear", "power", "approach", "step", "hinge", "window", "bump", "wave", "product")
OUTSIDE = ("latched", "resonator", "retarded", "diagonal", "alternating", "bursts", "wiping")
REMEMBERING = frozenset({"latched", "resonator", "retarded", "alternating", "wiping"})


def draw_law(rng: np.random.Generator) -> Law:
    """Half of the laws inside the product have a memory; a third of all are outside."""
    channel = str(rng.choice(list(CHANNELS)))
    low, high = CHANNELS[channel]
    outside = str(rng.choice(OUTSIDE)) if rng.random() < OUTSIDE_SHARE else ""
    memory = str(rng.choice(MEMORIES[1:])) if not outside and rng.random() < 0.5 else "none"
    return Law(
        channel=channel, coordinate=str(rng.choice(MOVING if outside else COORDINATES)), memory=memory,
        shape=str(rng.choice(SHAPES)), outside=outside,
        a=float(rng.random()), b=float(rng.random()), c=float(rng.random()), memory_s=float(np.exp(rng.uniform(np.log(0.7), np.log(8.0)))),
        play=float(rng.uniform(0.1, 0.4)), sign=float(rng.choice([-1.0, 1.0])), size=float(rng.uniform(low, high)),
    )  # fmt: skip


def coordinate(name: str, scene: Scene) -> Array:
    """A coordinate (2, n), scaled so that a usual recording spans about one unit."""
    angle, rate, torque = scene.angle, scene.rate, scene.torque / (0.5 * scene.torque_scale)
    if name == "time":
        return np.broadcast_to(scene.time / 60.0, angle.shape).copy()
    if name == "slip":
        return np.asarray(np.cumsum(np.abs(rate), axis=1) * scene.step / 4.0)
    if name in ("since reversal", "dwell"):
        turn, rest = zip(*(_histories(a, r, scene.step) for a, r in zip(angle, rate, strict=True)), strict=True)
        return np.stack(turn) / (10.0 * DEG) if name == "since reversal" else np.log1p(np.stack(rest))
    known: dict[str, Callable[[], Array]] = {
        "angle": lambda: angle / scene.limit, "abs angle": lambda: np.abs(angle) / scene.limit, "rate": lambda: rate / RATE,
        "direction": lambda: np.tanh(rate / (0.2 * DEG)), "torque": lambda: torque, "power": lambda: torque * rate / RATE,
        "temperature": lambda: (scene.temperature - scene.temperature[:, :1]) / 10.0,
    }  # fmt: skip
    return np.asarray(known[name]())


@njit(cache=True)
def _histories(angle: Array, rate: Array, step: float) -> tuple[Array, Array]:
    """Angle since the last reversal [rad] and time at rest [s]."""
    since, rest = np.zeros(angle.size), np.zeros(angle.size)
    way, turned = 0.0, angle[0]
    for k in range(1, angle.size):
        if abs(rate[k]) > 1e-3 and np.sign(rate[k]) != way:
            way, turned = np.sign(rate[k]), angle[k]
        since[k] = abs(angle[k] - turned)
        rest[k] = rest[k - 1] + step if abs(rate[k]) < 2e-3 else 0.0
    return since, rest


def remembered(law: Law, value: Array, step: float) -> Array:
    """The coordinate through the law's memory: a first-order lag, or a play."""
    if law.memory == "lag":
        keep = np.exp(-step / law.memory_s)
        return np.asarray(lfilter([1.0 - keep], [1.0, -keep], value, axis=-1, zi=keep * value[:, :1])[0])
    if law.memory == "play":
        return np.stack([_play(row, law.play) for row in value])
    return value


@njit(cache=True)
def _play(value: Array, width: float) -> Array:
    out = np.empty(value.size)
    at = value[0]
    for k in range(value.size):
        at = min(max(at, value[k] - width), value[k] + width)
        out[k] = at
    return out


def shaped(law: Law, x: Array, y: Array) -> Array:
    """A function of x of the order of one; ``product`` takes a second coordinate y too."""
    middle, width = -0.6 + 1.2 * law.a, 0.15 + 0.35 * law.b
    known: dict[str, Callable[[], Array]] = {
        "linear": lambda: x, "power": lambda: np.sign(x) * np.abs(x) ** (0.5 + 2.5 * law.a),
        "approach": lambda: 1.0 - np.exp(-np.abs(x) / width), "step": lambda: 0.5 + 0.5 * np.tanh((x - middle) / (0.3 * width)),
        "hinge": lambda: np.maximum(x - middle, 0.0), "window": lambda: (np.abs(x - middle) < width).astype(float),
        "bump": lambda: np.exp(-(((x - middle) / width) ** 2)),
        "wave": lambda: np.sin(2.0 * np.pi * (x / (0.3 + 0.7 * law.b) + law.c)),
        "product": lambda: np.tanh(x / width) * (y - middle),
    }  # fmt: skip
    return np.asarray(np.clip(known[law.shape](), -3.0, 3.0))


# --- outside the product -----------------------------------------------------------------------------------------------


@njit(cache=True)
def _latched(value: Array, on: float, off: float) -> Array:
    """Something catches where the coordinate rises above ``on`` and lets go only below ``off``."""
    out = np.zeros(value.size)
    caught = False
    for k in range(value.size):
        caught = value[k] > on if not caught else value[k] > off
        out[k] = 1.0 if caught else 0.0
    return out


@njit(cache=True)
def _resonator(force: Array, step: float, pulsation: float, damping: float) -> Array:
    """Displacement of a mode beyond the static one."""
    out = np.zeros(force.size)
    x, speed = force[0], 0.0
    for k in range(force.size):
        speed += step * (pulsation**2 * (force[k] - x) - 2.0 * damping * pulsation * speed)
        x += step * speed
        out[k] = x - force[k]
    return out


@njit(cache=True)
def _alternating(rate: Array) -> Array:
    """Every other stroke."""
    out = np.zeros(rate.size)
    way, stroke = 0.0, 0
    for k in range(rate.size):
        if abs(rate[k]) > 3e-3 and np.sign(rate[k]) != way:
            way, stroke = np.sign(rate[k]), stroke + 1
        out[k] = stroke % 2
    return out


@njit(cache=True)
def _wiping(value: Array, relays: int) -> Array:
    """Preisach (1935) memory of a triangle of relays: nested reversals are remembered until a larger one wipes them out."""
    out = np.zeros(value.size)
    state = -np.ones((relays, relays))
    edges = np.linspace(-1.0, 1.0, relays)
    for k in range(value.size):
        total = 0.0
        for i in range(relays):
            for j in range(i + 1):
                if value[k] >= edges[i]:
                    state[i, j] = 1.0
                elif value[k] <= edges[j]:
                    state[i, j] = -1.0
                total += state[i, j]
        out[k] = total * 2.0 / (relays * (relays + 1.0))
    return out


def _outside(law: Law, scene: Scene) -> Array:
    x = coordinate(law.coordinate, scene)
    if law.outside == "latched":
        return np.stack([_latched(row, 0.2 + 0.5 * law.a, -0.5 + 0.5 * law.b) for row in x])
    if law.outside == "resonator":
        pulsation = 2.0 * np.pi * (0.4 + 1.2 * law.a)
        return np.stack([4.0 * _resonator(row, scene.step, pulsation, 0.02 + 0.1 * law.b) for row in x])
    if law.outside == "retarded":
        return np.stack([np.interp(scene.time - law.memory_s, scene.time, row) for row in x])
    if law.outside == "diagonal":
        along = scene.angle / scene.limit + (0.3 + law.b) * scene.rate / RATE
        return np.asarray(np.sin(2.0 * np.pi * along / (0.5 + law.a) + 6.0 * law.c))
    if law.outside == "alternating":
        return np.stack([_alternating(row) for row in scene.rate]) * (0.5 + np.abs(scene.angle) / scene.limit)
    if law.outside == "bursts":
        chance = np.random.default_rng(int(law.c * 2**31))
        hold = max(round((0.3 + law.a) / scene.step), 1)
        on = np.repeat(chance.random(scene.time.size // hold + 1) < 0.4, hold)[: scene.time.size]
        return np.broadcast_to(on.astype(float), scene.angle.shape) * np.exp(-((x - law.b) ** 2))
    return np.stack([_wiping(np.clip(row, -1.0, 1.0), 9) for row in scene.angle / scene.limit])


# --- what it does --------------------------------------------------------------------------------------------------------


def modulate(law: Law, strength: float, scene: Scene) -> Modulation:
    """Factors and torque of a law at ``strength`` (1: its drawn size) on one scene."""
    if law.outside:
        f = np.clip(_outside(law, scene), -3.0, 3.0)
    else:
        x = remembered(law, coordinate(law.coordinate, scene), scene.step)
        other = COORDINATES[(COORDINATES.index(law.coordinate) + 1 + int(law.c * (len(COORDINATES) - 1))) % len(COORDINATES)]
        f = shaped(law, x, coordinate(other, scene) if law.shape == "product" else x)
    f = law.sign * strength * law.size * f
    level, stiffness, torque = (np.ones_like(f), np.ones_like(f), np.zeros_like(f))
    if law.channel == "level":
        level = np.clip(1.0 + f, 0.2, 3.0)
    elif law.channel == "stiffness":
        stiffness = np.clip(1.0 + f, 0.2, 4.0)
    else:
        torque = f * _carrier(law.channel, scene)
    return Modulation(level, stiffness, torque)


def _carrier(channel: str, scene: Scene) -> Array:
    """What a factor of one adds in a channel [N m] to each track."""
    half = 0.5 * scene.torque_scale
    x = scene.rate / RATE
    known: dict[str, Callable[[], Array]] = {
        "conservative": lambda: np.full_like(x, half), "coulomb": lambda: half * np.tanh(scene.rate / (0.1 * DEG)),
        "load": lambda: np.abs(scene.torque) * np.tanh(scene.rate / (0.1 * DEG)), "viscous": lambda: half * x,
        "turbulent": lambda: half * x * np.abs(x), "gain": lambda: scene.torque,
        "inertia": lambda: half * scene.acceleration / (10.0 * DEG),
        "lag": lambda: -np.gradient(scene.torque, scene.step, axis=1),
    }  # fmt: skip
    return np.asarray(known[channel]())
