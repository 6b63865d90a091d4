# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Laws that no entry of the catalogue is: a channel through which torque arises, times a function of one coordinate.

All laws run through the same compiled code. What tells them apart are numbers of the parameter record: the ``cell`` (which
channel and coordinate, which memory, where the function begins and how fine it is) and the function ``f`` itself, as values
at ``KNOTS`` equally spaced places of the coordinate, linear between and held beyond (``reach``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from lugre_steering.chain.compiled import law, tanh
from lugre_steering.effects.entry import Effect, Parameter
from lugre_steering.effects.signs import SIGN_RATE_RAD_S
from lugre_steering.recording import Array

KNOTS = 513
"""Places at which a law is kept: a sinusoid of 60 periods is still met within 8 %, all that is smoother far closer."""

CHANNELS = {
    "friction_level": "1", "presliding_stiffness": "1", "conservative_torque": "N m", "coulomb_friction": "N m",
    "load_friction": "1", "viscous_loss": "N m s/rad", "turbulent_loss": "N m s2/rad2", "gain": "1", "inertia": "kg m2", "lag": "s",
    "linked_inertia": "kg m2",
}  # fmt: skip
"""How a torque arises, with the unit of f; all of one track. Shares act on the friction level, the stiffness and the torque. A linked
inertia is what moves by a crank or a linkage: of the angle alone."""
COORDINATES = {
    "none": "1", "angle": "rad", "abs_angle": "rad", "rate": "rad/s", "abs_rate": "rad/s", "direction": "1", "since_reversal": "rad",
    "torque": "N m", "abs_torque": "N m", "power": "W", "time": "s", "slip": "rad", "work": "J", "dwell": "s",
    "rubber_temperature": "degC", "air_temperature": "degC", "opposing_torque": "N m", "passes": "1",
}  # fmt: skip
"""What f may depend on, with its unit; angle, slip and work are those of one track. The opposing torque is that against the motion,
less than zero where it drives. Passes: how often this very place has been rubbed, half of the passage that is going on counted."""
MEMORIES = {"none": "", "lag": "s", "play": "", "relay": "", "ring": "s"}
"""What stands between the coordinate and f: nothing, a first-order lag of so many seconds, a play or a relay of a half width in
the unit of the coordinate; or how far beyond the coordinate a lightly damped mode of a period of so many seconds swings, excited by it."""
RINGS = ("conservative_torque", "torque")
"""Channel and coordinate of what rings."""
RING_DAMPING = 0.03
"""Damping ratio of a mode that rings."""
PLACE_RAD, PLACES = 0.02, 64
"""Width of a place that passes are counted of, a third of a usual breakaway angle, and how many there are: the first follows the last."""
CELL = ("channel", "coordinate", "memory", "memory_size", "low", "per_unit", "seen_low", "seen_high")
LEAST_STIFFENING = -0.9

LINKED = ("linked_inertia", "angle")
"""Channel and coordinate of a linked inertia."""
_LEVEL, _STIFFNESS, _TORQUE, _COULOMB, _LOAD, _VISCOUS, _TURBULENT, _GAIN, _INERTIA, _LAG, _LINKED = (float(i + 1) for i in range(11))
_RING = float(list(MEMORIES).index("ring"))
_PASSES = float(list(COORDINATES).index("passes"))


@law
def coordinate(which, theta, omega, direction, since, torque, slip, work, dwell, time, temperature, air):
    """The coordinate with this number among COORDINATES."""
    if which < 4.0:
        if which < 2.0:
            return theta if which == 1.0 else 0.0
        return abs(theta) if which == 2.0 else omega
    if which < 8.0:
        if which < 6.0:
            return abs(omega) if which == 4.0 else direction
        return since if which == 6.0 else torque
    if which < 12.0:
        if which < 10.0:
            return abs(torque) if which == 8.0 else torque * omega
        return time if which == 10.0 else slip
    if which < 14.0:
        return work if which == 12.0 else dwell
    if which < 16.0:
        return temperature if which == 14.0 else air
    return torque * direction


@law
def passed(places, theta, way, angle_unit):
    """How often the place at an angle has been passed, in its widths of the ``way`` to here, which the two nearest of ``places`` share."""
    at = theta / (PLACE_RAD * angle_unit)
    share = at - math.floor(at)
    here = math.floor(at) % PLACES
    following = (here + 1) % PLACES
    passage = way / (PLACE_RAD * angle_unit)
    places[here] += (1.0 - share) * passage
    places[following] += share * passage
    return (1.0 - share) * places[here] + share * places[following]


@law
def remembered(kind, size, kept, now, dt):
    """What a memory (its number among MEMORIES) makes of ``now``; ``kept``: what it made of it before."""
    if kind == 0.0:
        return now
    if kind == 1.0:
        return kept + (now - kept) * dt / (size + 0.5 * dt)  # exp(-dt / size) to second order
    if kind == 2.0:
        return min(max(kept, now - size), now + size)
    if now > size:
        return 1.0
    return -1.0 if now < -size else kept


@law
def rung(period, beyond, speed, change, dt):
    """Deflection of a mode beyond the static one and its rate, a step later; the force (in the unit of the deflection) has just changed.

    x'' + 2 d w x' + w^2 (x - force) = 0 with w = 2 pi / period, d = RING_DAMPING; exact for a force that stays.
    """
    w = 2.0 * math.pi / period
    decay, turn = RING_DAMPING * w * dt, math.sqrt(1.0 - RING_DAMPING**2) * w
    beyond -= change
    kept, turned = math.exp(-decay) * math.cos(turn * dt), math.exp(-decay) * math.sin(turn * dt) / turn
    pull = w * w * beyond + RING_DAMPING * w * speed
    return kept * beyond + turned * (speed + RING_DAMPING * w * beyond), kept * speed - turned * pull


@law
def looked_up(f, position):
    """f at a position counted in knots: linear between them, held beyond."""
    last = f.size - 1
    if not position > 0.0:  # also what is no number
        return f[0]
    if position >= last:
        return f[last]
    i = int(position)
    return f[i] + (position - i) * (f[i + 1] - f[i])


@law
def tangent(
    cell, f, size, value, kept, speed, before, since, slip, work, outside, places, theta, omega, direction, d_theta, resting, dwell, time,
    temperature, air_temperature, last_torque, dt, angle_unit,
):  # fmt: skip
    """Memories and the value of f at this step; and what it adds to the stiffness, if that is its channel."""
    moved = abs(d_theta)
    slip += moved
    work += abs(last_torque) * moved
    heading = direction if d_theta == 0.0 else math.copysign(1.0, d_theta)
    since = since + moved if heading == direction else moved
    if cell[1] == _PASSES:
        now = passed(places, theta, 0.0 if resting else moved, angle_unit)  # the noise of an angle at rest rubs nothing
    else:
        now = coordinate(cell[1], theta, omega, heading, since, last_torque, slip, work, dwell, time, temperature, air_temperature)
    if cell[2] == _RING:
        now -= value  # what it adds itself does not excite it: its period is that at which the torque rings
        if before != 0.0:  # what is there at the start has always been there
            kept, speed = rung(cell[3], kept, speed, now - before, dt)
        before = now
    else:
        kept = remembered(cell[2], cell[3], kept, now, dt)
    position = (kept - cell[4]) * cell[5]
    outside += 0.0 if cell[6] <= kept <= cell[7] else 1.0
    value = size * looked_up(f, position)
    return (max(value, LEAST_STIFFENING) if cell[0] == _STIFFNESS else 0.0), value, kept, speed, before, since, slip, work, outside


@law
def level(cell, value):
    """1 + f on the friction level."""
    return (1.0 + value if cell[0] == _LEVEL else 1.0), value


@law
def torque(cell, f, size, value, theta, omega, alpha):
    """f, or f alpha, and of a linked inertia f' omega^2 / 2 beside that [N m] (Lagrange's equation of 1/2 f(theta) omega^2)."""
    if cell[0] == _TORQUE:
        return value, value
    if cell[0] == _LINKED:
        position = (theta - cell[4]) * cell[5]
        slope = size * cell[5] * (looked_up(f, position + 0.5) - looked_up(f, position - 0.5))
        return value * alpha + 0.5 * slope * omega * omega, value
    return (value * alpha if cell[0] == _INERTIA else 0.0), value


@law
def loss(cell, value, omega, load):
    """f times the smooth sign of the rate, that times the load, the rate, or its square with its sign [N m]."""
    if cell[0] == _COULOMB:
        return value * tanh(omega / SIGN_RATE_RAD_S), value
    if cell[0] == _LOAD:
        return value * abs(load) * tanh(omega / SIGN_RATE_RAD_S), value
    if cell[0] == _VISCOUS:
        return value * omega, value
    return (value * omega * abs(omega) if cell[0] == _TURBULENT else 0.0), value


@law
def limit(cell, value, torque, last_torque, dt):
    """1 + f on the torque, or the torque through a lag of f seconds [N m]."""
    if cell[0] == _GAIN:
        return torque * (1.0 + value), value
    if cell[0] == _LAG and dt > 0.0:
        return last_torque + (torque - last_torque) * dt / (max(value, 0.0) + dt), value
    return torque, value


_HOOKS: dict[str, Callable[..., object]] = {"tangent": tangent, "level": level, "torque": torque, "loss": loss, "limit": limit}
_MEMORY: Mapping[str, float | str | tuple[float, ...]] = {
    **dict.fromkeys(("value", "kept", "speed", "before", "since", "slip", "work", "outside"), 0.0), "places": (0.0,) * PLACES,
}  # fmt: skip
_SIZE = Parameter("size", "1", "of the law as it was found", 1.0, 0.0, 10.0)
Form = Callable[..., Array]


def _constant(c: Array, value: float) -> Array:
    return np.full_like(c, value)


def _linear(c: Array, value: float, slope: float) -> Array:
    return value + slope * c


def _power(c: Array, value: float, scale: float, exponent: float) -> Array:
    shape: Array = np.float_power(np.abs(c / scale), exponent)
    return value * shape


def _exponential(c: Array, start: float, end: float, length: float) -> Array:
    left: Array = np.exp(-(c - c[0]) / length)
    return end + (start - end) * left


def _step(c: Array, before: float, after: float, at: float, width: float) -> Array:
    return before + 0.5 * (after - before) * (1.0 + np.tanh((c - at) / width))


def _hinge(c: Array, value: float, below: float, above: float, at: float) -> Array:
    return value + below * np.minimum(c - at, 0.0) + above * np.maximum(c - at, 0.0)


def _window(c: Array, outside: float, inside: float, start: float, end: float) -> Array:
    return np.where((c >= start) & (c <= end), inside, outside)


def _bump(c: Array, value: float, height: float, at: float, width: float) -> Array:
    return value + height * np.exp(-0.5 * ((c - at) / width) ** 2)


def _sinusoid(c: Array, value: float, sine: float, cosine: float, period: float) -> Array:
    return value + sine * np.sin(2.0 * np.pi * c / period) + cosine * np.cos(2.0 * np.pi * c / period)


FORMS: Mapping[str, Form] = {
    "constant": _constant, "linear": _linear, "power": _power, "exponential": _exponential, "step": _step, "hinge": _hinge,
    "window": _window, "bump": _bump, "sinusoid": _sinusoid,
}  # fmt: skip
"""Closed forms of f over increasing places of the coordinate; an exponential starts at the first of them."""
TABLE = "table"
CONTINUED = ("linear", "hinge", "sinusoid")
"""Forms that go on beyond the range seen, by half of it to each side, before they are held."""
POSITIVE = ("scale", "length", "width", "period")
"""Values of forms that must be above zero."""


def form_values(form: str) -> tuple[str, ...]:
    """Names of the values of a closed form."""
    names = FORMS[form].__code__.co_varnames[1 : FORMS[form].__code__.co_argcount]
    return tuple(names)


def sampled(form: str, values: Mapping[str, float], knots: Sequence[float], low: float, high: float) -> Array:
    """f (KNOTS,) over the range: a closed form, or a table of equally spaced ``knots``."""
    places = np.linspace(low, high, KNOTS)
    if form == TABLE:
        return np.asarray(np.interp(places, np.linspace(low, high, len(knots)), knots))
    with np.errstate(all="ignore"):  # a width of nothing makes a jump; what is not finite is refused by ``check_law``
        return np.asarray(FORMS[form](places, **values), np.float64)


def reach(form: str, values: Mapping[str, float], low: float, high: float) -> tuple[float, float]:
    """How far f goes on: for some forms half as far again to each side as it was seen, an arm of a hinge no further than it was."""
    more = 0.5 * (high - low) if form in CONTINUED else 0.0
    at = values.get("at", np.inf) if form == "hinge" else np.inf
    arms = (at - low, high - at) if low < at < high else (more, more)
    return low - min(more, arms[0]), high + min(more, arms[1])


def record(
    channel: str, coordinate: str, memory: str, memory_size: float, span: tuple[float, float], f: Array, size: float = 1.0,
    seen: tuple[float, float] | None = None,
) -> dict[str, float | Array]:
    """Fields of a law, without its id: its cell, f (KNOTS,) over a span of the coordinate, and its size; ``seen``: the part of the
    span that recordings showed, if not all."""
    low, high = span
    edge = 1e-6 * (high - low)
    seen_low, seen_high = seen or span
    per_unit = (KNOTS - 1) / (high - low)
    codes = [list(CHANNELS).index(channel) + 1, list(COORDINATES).index(coordinate), list(MEMORIES).index(memory)]
    cell = np.array([*codes, memory_size, low, per_unit, seen_low - edge, seen_high + edge], np.float64)
    return {"cell": cell, "f": f, "size": size}


def law_effect(identity: str, title: str, constants: Mapping[str, float | Array], **told: Any) -> Effect:
    """A law as an effect: its numbers in ``constants`` (see ``record``), so that all share one compiled code; ``told``: what else
    an entry says."""
    said = {
        "stage": "parallel_torque", "equation": "missing torque = channel x f(coordinate)", "source": "found in recordings",
        "trace": "as f says", "coordinate": "time", **told,
    }  # fmt: skip
    return Effect(
        id=identity, tier=3, title=title, parameters=(_SIZE,), hooks=_HOOKS, memory=_MEMORY, tables={"cell": len(CELL), "f": KNOTS},
        constants=constants, joint_title=title, **said,
    )  # fmt: skip


def is_law(effect: Effect) -> bool:
    """Whether an effect is such a law under a name."""
    return effect.hooks is _HOOKS


def slot(place: int) -> Effect:
    """The effect that runs the law with this place in the vehicle file."""
    return law_effect(f"law_{place + 1}", f"Law {place + 1}", {})
