# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the third simulator can hide, how large, and the laws that act beside the contact: forms of its own for every name.

Sizes are relative to the machine's own friction torque (``torque_scale``, sliding torque of both tracks) where they are torques,
so that a small carrier and a crane are equally hard.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lugre_steering.proof.made import Hidden

Array = NDArray[np.float64]

DEG = float(np.pi / 180.0)


class Size(NamedTuple):
    """Range of a parameter. ``amount``: grows with the wanted strength; ``either``: of either sign; ``torque``: times the
    machine's sliding torque; ``limit``: times its steering limit."""

    low: float
    high: float
    amount: bool = False
    either: bool = False
    torque: bool = False
    limit: bool = False


CONTACT: dict[str, dict[str, Size]] = {
    "backlash": {"width": Size(0.3 * DEG, 0.6 * DEG, amount=True), "torque": Size(0.008, 0.015, torque=True)},
    "linkage_compliance": {
        "compliance": Size(0.4 * DEG, 0.8 * DEG, amount=True),  # under the sliding torque of one track
        "torque": Size(0.3, 0.6, torque=True),
    },
    "viscous_friction": {"at_6_deg_s": Size(0.01, 0.025, amount=True, torque=True)},
    "static_ageing": {"amount": Size(0.015, 0.03, amount=True), "time": Size(0.5, 2.0), "slip": Size(2.0 * DEG, 5.0 * DEG)},
    "stress_relaxation": {"share": Size(0.03, 0.06, amount=True)},
    "surface_patch": {
        "amount": Size(-0.2, -0.12, amount=True), "low": Size(-0.6, 0.2, limit=True), "high": Size(0.35, 0.5, limit=True),
        "in_time": Size(0.0, 0.0),
    },
    "wear_polishing": {"amount": Size(0.06, 0.12, amount=True), "slip": Size(2.0, 5.0)},
    "direction_asymmetry": {"a": Size(0.02, 0.04, amount=True, either=True), "angle": Size(1.0 * DEG, 3.0 * DEG)},
    "carcass_heat_sink": {"conductance": Size(5.0, 12.0, amount=True), "capacity": Size(0.6, 1.5)},  # over loss, over capacity
    "heat_partition": {"lost_share": Size(0.3, 0.5, amount=True)},
}  # fmt: skip
ANGLE: dict[str, dict[str, Size]] = {"angle_offset": {"offset": Size(0.25 * DEG, 0.5 * DEG, amount=True, either=True)}}
PARALLEL: dict[str, dict[str, Size]] = {
    "end_stop": {"threshold": Size(0.82, 0.95, limit=True), "hertz": Size(20.0, 40.0, amount=True, torque=True), "loss": Size(0.2, 0.8)},
    "yaw_inertia": {"inertia": Size(0.02, 0.05, amount=True, torque=True)},
    "kingpin_jacking": {"slope": Size(0.08, 0.16, amount=True, either=True, torque=True), "caster": Size(0.2, 0.5, either=True)},
    "slope_bias": {"torque": Size(0.01, 0.02, amount=True, either=True, torque=True)},
}
LOSSES: dict[str, dict[str, Size]] = {
    "cylinder_friction": {"coulomb": Size(0.01, 0.025, amount=True, torque=True), "load_share": Size(0.01, 0.025, amount=True)},
    "line_loss_linear": {"at_6_deg_s": Size(0.015, 0.03, amount=True, torque=True)},
    "line_loss_quadratic": {"at_6_deg_s": Size(0.01, 0.02, amount=True, torque=True)},
    "trapped_pressure": {"share": Size(0.06, 0.14, amount=True), "time": Size(4.0, 15.0)},
}
SENSING: dict[str, dict[str, Size]] = {
    "time_delay": {"delay": Size(0.015, 0.035, amount=True, either=True)},
    "pressure_lag": {"tau": Size(0.015, 0.035, amount=True)},
    "pressure_offset": {"offset": Size(1e5, 2.5e5, amount=True, either=True), "line": Size(0.0, 1.0)},
    "pressure_drift": {"drift": Size(600.0, 1500.0, amount=True, either=True), "line": Size(0.0, 1.0)},
    "moment_arm_error": {"a": Size(0.05, 0.12, amount=True, either=True), "b": Size(0.1, 0.3, amount=True, either=True)},
}
CATALOGUE: dict[str, dict[str, Size]] = {**ANGLE, **CONTACT, **PARALLEL, **LOSSES, **SENSING}
IN_SERVICE = {
    "an end stop": "end_stop", "another pavement": "surface_patch", "cylinder friction": "cylinder_friction",
    "a stuck valve": "trapped_pressure",
}  # fmt: skip
"""What happens to a machine in service."""
ZONED: dict[str, dict[str, Size]] = {
    "end_stop": {"threshold": Size(1.02, 1.06, limit=True)},
    "surface_patch": {"low": Size(0.84, 0.9, limit=True)},
}
"""At the edge of what manoeuvres visit; the inner track goes some way beyond the mean angle's limit."""


def draw(id_: str, strength: float, barely: bool, torque_scale: float, limit: float, lines: int, rng: np.random.Generator) -> Hidden:
    """True values (SI) of one effect for a machine; strength 0 gives zero amounts."""
    values: dict[str, float] = {}
    for name, size in {**CATALOGUE[id_], **(ZONED.get(id_, {}) if barely else {})}.items():
        value, sign = float(rng.uniform(size.low, size.high)), float(rng.choice([-1.0, 1.0]))
        value *= (strength if size.amount else 1.0) * (sign if size.either else 1.0)
        values[name] = value * (torque_scale if size.torque else 1.0) * (limit if size.limit else 1.0)
    if "line" in values:
        values["line"] = float(min(int(values["line"] * lines), lines - 1))
    return Hidden(id_, _finished(id_, values, torque_scale, rng), None, -1e9)


def _finished(id_: str, values: dict[str, float], torque_scale: float, rng: np.random.Generator) -> dict[str, float]:
    """Values that hang together."""
    if id_ == "surface_patch":
        values["high"] += values["low"]
        if rng.random() < 0.3:
            values |= {"low": rng.uniform(20.0, 35.0), "in_time": 1.0}
            values["high"] = values["low"] + rng.uniform(20.0, 30.0)
        values["amount"] = max(values["amount"], -0.85)
    elif id_ == "linkage_compliance":
        values["compliance"] /= 0.5 * torque_scale  # rad per N m
    elif id_ == "heat_partition":
        values["lost_share"] = min(values["lost_share"], 0.85)
    return values


# --- torques beside the contact: angle, rate, acceleration of both tracks (2, n) -> (2, n) [N m] -----------------------


@njit(cache=True)
def _buffer(angle: Array, rate: Array, left: float, right: float, hertz: float, loss: float) -> Array:
    """Hunt and Crossley (1975): Hertzian spring whose loss grows with penetration and its rate."""
    out = np.zeros(angle.size)
    for k in range(angle.size):
        deep, way = max(angle[k] - left, 0.0), 1.0
        if angle[k] < 0.0:
            deep, way = max(-right - angle[k], 0.0), -1.0
        out[k] = way * max(hertz * deep**1.5 * (1.0 + loss * way * rate[k] / 0.1), 0.0)
    return out


def end_stop(angle: Array, rate: Array, _acceleration: Array, v: dict[str, float]) -> Array:
    """Stops of the left and right end, half a degree apart and not of equal stiffness; ``hertz`` in N m/rad^1.5 of both tracks."""
    at = v["threshold"]
    sides = zip(angle, rate, ((at, at + 0.4 * DEG), (at + 0.3 * DEG, at)), (0.55, 0.45), strict=True)
    return np.stack([_buffer(a, r, left, right, share * v["hertz"], v["loss"]) for a, r, (left, right), share in sides])


def yaw_inertia(_angle: Array, _rate: Array, acceleration: Array, v: dict[str, float]) -> Array:
    """Mass that the sheet does not know, on a slightly soft mount (it lags by 30 ms)."""
    return v["inertia"] * _trailing(acceleration, 0.03)


def kingpin_jacking(angle: Array, _rate: Array, _acceleration: Array, v: dict[str, float]) -> Array:
    """Conservative torque of lift: odd part as sin 2x, even part as 1 - cos; ``slope`` [N m/rad] of both tracks."""
    return np.asarray(0.5 * v["slope"] * (0.5 * np.sin(2.0 * angle) + v["caster"] * (1.0 - np.cos(angle))))


def slope_bias(angle: Array, _rate: Array, _acceleration: Array, v: dict[str, float]) -> Array:
    """Side force of a slope on the trail."""
    return np.asarray(0.5 * v["torque"] * (1.0 - 0.4 * angle**2))


def _trailing(value: Array, time_s: float, step: float = 2e-3) -> Array:
    """The mean of the last ``2 time_s`` along the last axis."""
    width = max(round(2.0 * time_s / step), 1)
    summed = np.cumsum(np.concatenate([np.repeat(value[..., :1], width, axis=-1), value], axis=-1), axis=-1)
    return np.asarray((summed[..., width:] - summed[..., :-width]) / width)


# --- losses on the way to the cylinders: total torque (n,) and mean rate (n,) -> additional torque (n,) [N m] ---------


def cylinder_friction(torque: Array, rate: Array, v: dict[str, float]) -> Array:
    """Seals pressed on by the load; the sign arrives over 0.1 deg/s as x / sqrt(1 + x^2), falls by a tenth from rest to sliding."""
    x = rate / (0.1 * DEG)
    sign = x / np.sqrt(1.0 + x**2)
    return np.asarray(sign * (v["coulomb"] + v["load_share"] * np.abs(torque)) * (0.95 + 0.1 / (1.0 + np.abs(x) / 10.0)))


def line_loss_linear(_torque: Array, rate: Array, v: dict[str, float]) -> Array:
    """Laminar loss of oil that shear-thins a little."""
    x = rate / (6.0 * DEG)
    return np.asarray(v["at_6_deg_s"] * x * (1.0 + np.abs(x)) ** -0.1 * 2.0**0.1)


def line_loss_quadratic(_torque: Array, rate: Array, v: dict[str, float]) -> Array:
    """Turbulent loss that begins laminar below 1 deg/s: x^2 / (1 + 1/6 / x) with x in units of 6 deg/s."""
    x = np.abs(rate) / (6.0 * DEG)
    return np.asarray(np.sign(rate) * v["at_6_deg_s"] * (7.0 / 6.0) * x**3 / (x + 1.0 / 6.0))


def trapped_pressure(torque: Array, rate: Array, v: dict[str, float]) -> Array:
    """A closed valve that leaks through an orifice: the load falls as 1/(1 + t/time) towards (1 - share) of itself."""
    return -v["share"] * torque * _bled(np.abs(rate) < 0.1 * DEG, 2e-3, v["time"])


@njit(cache=True)
def _bled(parked: NDArray[np.bool_], step: float, time: float) -> Array:
    out = np.zeros(parked.size)
    rested = 0.0
    for k in range(1, parked.size):
        rested = rested + step if parked[k] else 0.0
        goal = 1.0 - 1.0 / (1.0 + rested / time)
        out[k] = goal if parked[k] else out[k - 1] * (1.0 - step / 0.2)
    return out


# --- what the line sensors make of pressures (lines, n) [Pa] -----------------------------------------------------------


def time_delay(pressure: Array, time: Array, v: dict[str, float]) -> Array:
    """A logger that stamps late (or early) by a constant."""
    return np.stack([np.interp(time - v["delay"], time, line) for line in pressure])


def pressure_lag(pressure: Array, _time: Array, v: dict[str, float]) -> Array:
    """Snubber and hose: the mean of the last 2 tau."""
    return _trailing(pressure, v["tau"]) if v["tau"] > 1e-3 else pressure


def pressure_offset(pressure: Array, _time: Array, v: dict[str, float]) -> Array:
    """One zero is off, slightly less under load."""
    out = pressure.copy()
    out[int(v["line"])] += v["offset"] * (1.0 - 0.05 * np.clip(pressure[int(v["line"])] / 2e7, 0.0, 1.0))
    return out


def pressure_drift(pressure: Array, time: Array, v: dict[str, float]) -> Array:
    """One zero wanders off, slowly bending."""
    out = pressure.copy()
    out[int(v["line"])] += v["drift"] * time / (1.0 + time / 900.0)
    return out


PARALLEL_LAWS: dict[str, Callable[[Array, Array, Array, dict[str, float]], Array]] = {
    law.__name__: law for law in (end_stop, yaw_inertia, kingpin_jacking, slope_bias)
}
LOSS_LAWS: dict[str, Callable[[Array, Array, dict[str, float]], Array]] = {
    law.__name__: law for law in (cylinder_friction, line_loss_linear, line_loss_quadratic, trapped_pressure)
}
SENSING_LAWS: dict[str, Callable[[Array, Array, dict[str, float]], Array]] = {
    law.__name__: law for law in (time_delay, pressure_lag, pressure_offset, pressure_drift)
}
