# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What can be hidden in a recording, how large, and the laws that act outside the contact patches.

Names and meanings follow the effect contract; the forms are nature's rather than the catalogue's: progressive, lossy,
smooth, delayed. ``strength`` 1 is a typical size; it scales the amplitudes (``Range.scales``) and leaves shapes alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from lugre_steering.chain.compiled import njit
from lugre_steering.errors import DataError
from lugre_steering.proof.made import Hidden

__all__ = ["CATALOGUE", "EFFECT_IDS", "UNLISTED_IDS", "Concealed", "FineMotion", "Hidden", "draw", "sensed"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Concealed:
    """One hidden effect: its name, its size, and what makes it hard to find.

    ``only_bag`` (0 or 1) limits it to one bag, ``from_time_s`` [s] lets it begin late, ``barely`` moves the zone in
    which it acts (ZONED effects) to the edge of what manoeuvres visit.
    """

    id: str
    strength: float = 1.0
    only_bag: int | None = None
    from_time_s: float | None = None
    barely: bool = False

    def __post_init__(self) -> None:
        if self.id not in CATALOGUE:
            raise DataError(f"concealed effect {self.id!r} is unknown; expected one of {', '.join(CATALOGUE)}")
        if self.barely and self.id not in ZONED:
            raise DataError(f"concealed effect {self.id!r} has no zone to move; expected one of {', '.join(ZONED)}")


class Range(NamedTuple):
    """Values a parameter is drawn from; ``signed`` draws its sign too, ``scales`` multiplies it by the strength."""

    low: float
    high: float
    unit: str
    scales: bool = False
    signed: bool = False


DEG = float(np.pi / 180.0)

# Sizes: typical values for a vehicle of this class. Entries marked "per side" act on each track, like everything in the
# contact; other torques are sums of both tracks. The rate of a loss is the mean rate of both tracks.
CONTACT: dict[str, dict[str, Range]] = {
    "backlash": {
        "width": Range(0.3 * DEG, 0.6 * DEG, "rad", scales=True),
        "soft_torque": Range(300.0, 600.0, "N m"),
    },
    "linkage_compliance": {
        "compliance": Range(0.4e-6, 0.7e-6, "rad/(N m)", scales=True),
        "stiffening_torque": Range(1.5e4, 3.0e4, "N m"),
    },
    "viscous_friction": {
        "sigma2": Range(6e3, 1.4e4, "N m s/rad", scales=True),
        "bend_speed": Range(0.08, 0.2, "rad/s"),
    },
    "static_ageing": {
        "rate": Range(0.015, 0.03, "1", scales=True),
        "time": Range(0.5, 2.0, "s"),
        "slip_scale": Range(2.0 * DEG, 5.0 * DEG, "rad"),
    },
    "stress_relaxation": {
        "share_per_decade": Range(0.02, 0.05, "1", scales=True),
        "erase_angle": Range(0.5 * DEG, 2.0 * DEG, "rad"),
    },
    "payne_softening": {"amount": Range(0.3, 0.8, "1", scales=True), "angle": Range(0.5 * DEG, 1.0 * DEG, "rad")},
    "mullins_softening": {"amount": Range(0.1, 0.3, "1", scales=True), "width": Range(0.5 * DEG, 1.0 * DEG, "rad")},
    "surface_patch": {
        "amount": Range(-0.2, -0.12, "1", scales=True),
        "low": Range(0.0, 0.0, "rad or s"),  # the window is placed by the simulator where the manoeuvre goes
        "high": Range(0.0, 0.0, "rad or s"),
        "edge": Range(0.0, 0.0, "rad or s"),
        "in_time": Range(0.0, 0.0, "1"),
    },
    "wear_polishing": {"amount": Range(0.05, 0.1, "1", scales=True), "slip_scale": Range(2.0, 5.0, "rad")},
    "direction_asymmetry": {
        "a": Range(0.02, 0.04, "1", scales=True, signed=True),
        "turn_angle": Range(1.0 * DEG, 3.0 * DEG, "rad"),
    },
    "distributed_contact": {"spread": Range(0.35, 0.5, "1", scales=True)},
    "carcass_heat_sink": {
        "conductance": Range(150.0, 400.0, "W/K", scales=True),
        "capacity": Range(0.8e4, 3.0e4, "J/K"),
    },
    "heat_partition": {"lost_share": Range(0.3, 0.5, "1", scales=True)},
    "flash_temperature": {"rise": Range(5.0, 10.0, "K", scales=True), "time": Range(0.2, 0.5, "s")},
    "ambient_drift": {"rise": Range(10.0, 20.0, "K", scales=True), "time": Range(50.0, 100.0, "s")},
}
ANGLE: dict[str, dict[str, Range]] = {
    "angle_offset": {"offset": Range(0.2 * DEG, 0.4 * DEG, "rad", scales=True, signed=True)},
    "angle_scale": {"scale": Range(0.01, 0.02, "1", scales=True, signed=True)},
}
PARALLEL: dict[str, dict[str, Range]] = {
    "end_stop": {  # per side
        "threshold": Range(25.0 * DEG, 29.0 * DEG, "rad"),
        "k1": Range(4e4, 8e4, "N m/rad", scales=True),
        "k3": Range(3e6, 6e6, "N m/rad^3", scales=True),
        "loss": Range(0.2, 0.4, "1"),
    },
    "yaw_inertia": {"inertia": Range(200.0, 500.0, "kg m2", scales=True)},  # per side
    "kingpin_jacking": {  # per side
        "amplitude": Range(1000.0, 2000.0, "N m", scales=True, signed=True),
        "caster_share": Range(0.3, 0.6, "1", signed=True),
    },
    "slope_bias": {"torque": Range(300.0, 600.0, "N m", scales=True, signed=True)},
    "soil_shear": {  # per side
        "torque": Range(1500.0, 3000.0, "N m", scales=True),
        "span": Range(4.0 * DEG, 8.0 * DEG, "rad"),
        "growth": Range(3.0, 6.0, "1/rad"),
    },
    "gear_ripple": {"torque": Range(300.0, 600.0, "N m", scales=True), "period": Range(3.0 * DEG, 6.0 * DEG, "rad")},
    "rate_memory": {  # per side
        "torque": Range(600.0, 1200.0, "N m", scales=True),
        "time": Range(2.0, 5.0, "s"),
    },
    "intermittent_contact": {
        "torque": Range(500.0, 1000.0, "N m", scales=True),
        "centre": Range(5.0 * DEG, 18.0 * DEG, "rad", signed=True),
        "width": Range(5.0 * DEG, 9.0 * DEG, "rad"),
        "burst_time": Range(0.2, 0.5, "s"),
    },
}
LOSSES: dict[str, dict[str, Range]] = {
    "cylinder_friction": {
        "coulomb": Range(400.0, 900.0, "N m", scales=True),
        "load_share": Range(0.01, 0.025, "1", scales=True),
        "viscous": Range(0.0, 2e3, "N m s/rad", scales=True),
        "bump": Range(0.1, 0.4, "1"),
        "holds": Range(0.0, 1.0, "1"),  # how much of it stays when the motion stops: seals differ
    },
    "line_loss_linear": {"b": Range(5e3, 1.2e4, "N m s/rad", scales=True)},
    "line_loss_quadratic": {"c": Range(5e4, 1e5, "N m s2/rad2", scales=True)},
    "back_pressure": {"pressure": Range(0.8e5, 2.2e5, "Pa", scales=True)},
    "trapped_pressure": {"share": Range(0.05, 0.12, "1", scales=True), "time": Range(4.0, 15.0, "s")},
    "body_mode": {  # unlisted: acts on the sum of both sides
        "gain": Range(0.05, 0.1, "1", scales=True),
        "frequency": Range(0.7, 1.5, "Hz"),
        "damping": Range(0.02, 0.05, "1"),
    },
}
SENSING: dict[str, dict[str, Range]] = {
    "time_delay": {"delay": Range(0.015, 0.03, "s", scales=True, signed=True)},
    "pressure_lag": {"tau": Range(0.015, 0.03, "s", scales=True)},
    "pressure_offset": {"offset": Range(5e4, 1e5, "Pa", scales=True, signed=True), "line": Range(0.0, 4.0, "index")},
    "pressure_drift": {
        "drift": Range(400.0, 900.0, "Pa/s", scales=True, signed=True),
        "line": Range(0.0, 4.0, "index"),
    },
    "relief_saturation": {"margin": Range(0.04, 0.08, "1", scales=True)},
    "moment_arm_error": {
        "a": Range(0.03, 0.08, "1/rad", scales=True, signed=True),
        "b": Range(0.1, 0.3, "1/rad2", scales=True, signed=True),
    },
}

CATALOGUE: dict[str, dict[str, Range]] = {**ANGLE, **CONTACT, **PARALLEL, **LOSSES, **SENSING}
# Zones at the edge: where the inner track or the load hardly ever comes.
ZONED: dict[str, dict[str, Range]] = {
    "end_stop": {"threshold": Range(31.0 * DEG, 32.0 * DEG, "rad")},
    "surface_patch": {"low": Range(25.0 * DEG, 28.0 * DEG, "rad")},
    "relief_saturation": {"margin": Range(0.01, 0.02, "1", scales=True)},
}
UNLISTED_IDS: tuple[str, ...] = ("gear_ripple", "body_mode", "rate_memory", "intermittent_contact")
EFFECT_IDS: tuple[str, ...] = tuple(name for name in CATALOGUE if name not in UNLISTED_IDS)


def draw(wanted: Concealed, rng: np.random.Generator) -> Hidden:
    """True parameter values of one effect; strength 0 gives zero amplitudes."""
    values = {}
    ranges = {**CATALOGUE[wanted.id], **(ZONED[wanted.id] if wanted.barely else {})}
    for name, wide in ranges.items():
        value, sign = rng.uniform(wide.low, wide.high), rng.choice([-1.0, 1.0])
        values[name] = float(value * (wanted.strength if wide.scales else 1.0) * (sign if wide.signed else 1.0))
    if wanted.id == "heat_partition":
        values["lost_share"] = min(values["lost_share"], 0.85)
    return Hidden(wanted.id, values, wanted.only_bag, -1e9 if wanted.from_time_s is None else wanted.from_time_s)


def gate(time: Array, start_s: float) -> Array:
    """0 before ``start_s`` [s], 1 one second later, smooth between."""
    x = np.clip(time - start_s, 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))


@dataclass(frozen=True)
class FineMotion:
    """Motion of both tracks (2, n) on the fine grid (n,) [s]: angle [rad], rate [rad/s], acceleration [rad/s2]."""

    time: Array
    angle: Array
    rate: Array
    acceleration: Array

    @property
    def step(self) -> float:
        return float(self.time[1] - self.time[0])


Values = dict[str, float]


def _low_pass(value: Array, step: float, tau: float) -> Array:
    """First-order lag along the last axis, at rest in the first value."""
    keep = np.exp(-step / tau)
    start = np.take(value, [0], axis=-1) * keep
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], value, axis=-1, zi=start)[0])


# --- torques beside the contact: both sides (2, n) -> (2, n) [N m] -------------------------------------------------


@njit(cache=True)
def _end_stop(angle: Array, low: float, high: float, k1: float, k3: float, loss: float) -> Array:
    """Progressive rubber stop; the return branch is lower by ``loss``, reached over 0.4 deg of unloading."""
    out = np.zeros(angle.size)
    unloading, before = 0.0, 0.0
    for k in range(angle.size):
        beyond = angle[k] - high if angle[k] > 0.0 else low - angle[k]
        soft = 0.004
        x = soft * np.log1p(np.exp(min(beyond / soft, 50.0))) if beyond < 50.0 * soft else beyond
        unloading = min(max(unloading + (before - x) / 0.007, 0.0), 1.0)
        before = x
        out[k] = np.sign(angle[k]) * (k1 * x + k3 * x**3) * (1.0 - loss * unloading)
    return out


def end_stop(motion: FineMotion, v: Values, _rng: np.random.Generator) -> Array:
    """Rubber buffers of the four stops; their thresholds differ by half a degree or so."""
    shift = 0.5 * DEG
    at = v["threshold"]
    stops = ((-at + 0.4 * shift, at + shift), (-at - shift, at - 0.4 * shift))
    sides = zip(motion.angle, stops, strict=True)
    return np.stack([_end_stop(angle, low, high, v["k1"], v["k3"], v["loss"]) for angle, (low, high) in sides])


def yaw_inertia(motion: FineMotion, v: Values, _rng: np.random.Generator) -> Array:
    """D'Alembert torque of mass that the sheet does not know."""
    return v["inertia"] * motion.acceleration


def kingpin_jacking(motion: FineMotion, v: Values, _rng: np.random.Generator) -> Array:
    """Lift about an inclined kingpin (odd in the angle) with a caster part (even)."""
    s = np.sin(motion.angle)
    return np.asarray(v["amplitude"] * (s + v["caster_share"] * s**2))


def slope_bias(motion: FineMotion, v: Values, _rng: np.random.Generator) -> Array:
    """Side force of the slope on the kingpin trail, which shortens as the track turns; a sum over both sides."""
    return np.asarray(0.5 * v["torque"] * np.cos(motion.angle))


@njit(cache=True)
def _berm(angle: Array, torque: float, span: float, growth: float) -> Array:
    """Heaped soil pushed outward at both ends of the swept sector; a part slumps back whenever the track leaves it."""
    out = np.zeros(angle.size)
    left, right = 0.0, 0.0
    for k in range(angle.size):
        left, right = max(left, angle[k]), min(right, angle[k])
        ahead = 1.0 / (1.0 + np.exp((left - 0.5 * span - angle[k]) / (0.12 * span)))
        behind = 1.0 / (1.0 + np.exp((angle[k] - right - 0.5 * span) / (0.12 * span)))
        out[k] = torque * (ahead * (1.0 - np.exp(-growth * left)) - behind * (1.0 - np.exp(growth * right)))
    return out


def soil_shear(motion: FineMotion, v: Values, _rng: np.random.Generator) -> Array:
    """Berms that grow with the ground they have swept."""
    return np.stack([_berm(angle, v["torque"], v["span"], v["growth"]) for angle in motion.angle])


def gear_ripple(motion: FineMotion, v: Values, _rng: np.random.Generator) -> Array:
    """Unlisted: torque periodic in the angle, as of a toothed ring; a sum over both sides."""
    phase = 2.0 * np.pi * motion.angle / v["period"]
    return np.asarray(0.5 * v["torque"] * (np.sin(phase) + 0.25 * np.sin(2.0 * phase + 1.0)))


def rate_memory(motion: FineMotion, v: Values, _rng: np.random.Generator) -> Array:
    """Unlisted: a fluid that remembers seconds (Maxwell) and thins with rate; ``torque`` is reached at 0.1 rad/s."""
    drive = np.sign(motion.rate) * np.sqrt(np.abs(motion.rate) / 0.1)
    return v["torque"] * _low_pass(np.asarray(drive), motion.step, v["time"])


def intermittent_contact(motion: FineMotion, v: Values, rng: np.random.Generator) -> Array:
    """Unlisted: something rubs now and then inside an angle zone, in bursts that nothing recorded predicts."""
    n, hold = motion.time.size, max(int(v["burst_time"] / motion.step), 1)
    bursts = np.repeat(rng.random(n // hold + 1) < 0.45, hold)[:n].astype(float)
    bursts = _low_pass(bursts, motion.step, 0.1 * v["burst_time"])
    mean = motion.angle.mean(axis=0)
    zone = np.exp(-(((mean - v["centre"]) / (0.5 * v["width"])) ** 4))
    rub = 0.5 * v["torque"] * bursts * zone * np.tanh(motion.rate.mean(axis=0) / 0.01)
    return np.stack([rub, rub])


# --- losses between the hinges and the cylinders: total torque (n,) -> additional torque (n,) [N m] -----------------


@njit(cache=True)
def _seal_memory(rate: Array, step: float, angle: float) -> Array:
    """Dahl seal: the sign of the motion, reached over ``angle`` [rad] and kept at rest."""
    out = np.zeros(rate.size)
    for k in range(1, rate.size):
        out[k] = out[k - 1] + step / angle * (rate[k] - abs(rate[k]) * out[k - 1])
    return out


def cylinder_friction(torque: Array, motion: FineMotion, v: Values) -> Array:
    """Seal friction that grows with the load, with a Stribeck bump; at rest a part of it stays (0 none, 1 all)."""
    rate = motion.rate.mean(axis=0)
    kept = _seal_memory(rate, motion.step, 0.05 * DEG)
    moving = np.tanh(rate / (0.15 * DEG))
    sign = v["holds"] * kept + (1.0 - v["holds"]) * moving
    bump = 1.0 + v["bump"] * np.exp(-np.abs(rate) / (1.0 * DEG))
    return np.asarray(sign * (v["coulomb"] + v["load_share"] * np.abs(torque)) * bump + v["viscous"] * rate)


def line_loss_linear(_torque: Array, motion: FineMotion, v: Values) -> Array:
    """Laminar hose loss; the oil warms with the distance moved and thins by up to a third."""
    rate = motion.rate.mean(axis=0)
    moved = np.cumsum(np.abs(rate)) * motion.step
    return np.asarray(v["b"] * rate * (1.1 - 0.3 * (1.0 - np.exp(-moved / 6.0))))


def line_loss_quadratic(_torque: Array, motion: FineMotion, v: Values) -> Array:
    """Turbulent loss with the exponent of a rough hose (1.85), equal to ``c rate^2`` at 0.1 rad/s."""
    rate = motion.rate.mean(axis=0)
    return np.asarray(v["c"] * 0.01 * np.sign(rate) * np.abs(rate / 0.1) ** 1.85)


def back_pressure(_torque: Array, motion: FineMotion, v: Values) -> Array:
    """Pressure at the return ports that the sensors at the valve do not see: builds with flow, gone at rest.

    ``pressure`` acts on the return areas times their arms, 5.75e-3 m3 for the reference vehicle, at 0.1 rad/s.
    """
    rate = motion.rate.mean(axis=0)
    return np.asarray(v["pressure"] * 5.75e-3 * np.tanh(rate / (1.0 * DEG)) * (0.7 + 0.3 * np.abs(rate) / 0.1))


def trapped_pressure(torque: Array, motion: FineMotion, v: Values) -> Array:
    """A closing valve leaks: while parked the load falls towards (1 - share) of itself; motion brings it back."""
    parked = np.abs(motion.rate.mean(axis=0)) < 0.15 * DEG
    return -v["share"] * torque * _leak(parked, motion.step, v["time"])


@njit(cache=True)
def _leak(parked: NDArray[np.bool_], step: float, time: float) -> Array:
    out = np.zeros(parked.size)
    for k in range(1, parked.size):
        out[k] = out[k - 1] + step * ((1.0 - out[k - 1]) / time if parked[k] else -out[k - 1] / 0.15)
    return out


def body_mode(torque: Array, motion: FineMotion, v: Values) -> Array:
    """Unlisted: the chassis rocks on its other tracks, a lightly damped mode that the steering torque excites."""
    return v["gain"] * (_mode(torque, motion.step, 2.0 * np.pi * v["frequency"], v["damping"]) - torque)


@njit(cache=True)
def _mode(force: Array, step: float, pulsation: float, damping: float) -> Array:
    out = np.empty(force.size)
    x, speed = force[0], 0.0
    for k in range(force.size):
        speed += step * (pulsation**2 * (force[k] - x) - 2.0 * damping * pulsation * speed)
        x += step * speed
        out[k] = x
    return out


PARALLEL_LAWS: dict[str, Callable[[FineMotion, Values, np.random.Generator], Array]] = {
    law.__name__: law
    for law in (
        end_stop, yaw_inertia, kingpin_jacking, slope_bias, soil_shear, gear_ripple, rate_memory, intermittent_contact,
    )
}
LOSS_LAWS: dict[str, Callable[[Array, FineMotion, Values], Array]] = {
    law.__name__: law
    for law in (
        cylinder_friction, line_loss_linear, line_loss_quadratic, back_pressure, trapped_pressure, body_mode,
    )
}


# --- what the pressure sensors see: (lines, n) [Pa] -> (lines, n) [Pa] -----------------------------------------------


def sensed(pressures: Array, time: Array, hidden: Hidden) -> Array:
    """Apply one sensing effect to line pressures; ``relief_saturation`` and ``moment_arm_error`` act before this."""
    v, on = hidden.values, gate(time, hidden.start_s)
    step = float(time[1] - time[0])
    out = pressures.copy()
    if hidden.id == "time_delay":  # clocks drift apart a little: the delay wanders by a tenth over the record
        delay = v["delay"] * on * (1.0 + 0.1 * np.sin(2.0 * np.pi * time / time[-1]))
        return np.stack([np.interp(time - delay, time, line) for line in pressures])
    if hidden.id == "pressure_lag":  # a slow filter behind a quicker damping orifice; their sum is tau
        if v["tau"] == 0.0:
            return out
        lagged = _low_pass(_low_pass(pressures, step, 0.75 * v["tau"]), step, 0.25 * v["tau"])
        return np.asarray(pressures + on * (lagged - pressures))
    if hidden.id == "pressure_offset":  # settles within the first minute as the sensor warms up
        out[int(v["line"])] += on * v["offset"] * (1.0 - 0.15 * np.exp(-time / 20.0))
    if hidden.id == "pressure_drift":  # linear at first, then slower
        later = np.maximum(time - max(hidden.start_s, 0.0), 0.0)
        out[int(v["line"])] += v["drift"] * 300.0 * (1.0 - np.exp(-later / 300.0))
    return out
