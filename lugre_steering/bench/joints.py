# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Do the 95 % intervals of what a joint has beside friction hold the truth? Joints drawn at random, simulated, diagnosed, compared.

The vehicle file that diagnosis is given knows friction only, and that roughly. Synthetic throughout, all in memory.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from lugre_steering.diagnosis.engine import diagnose_recordings
from lugre_steering.effects.registry import CATALOGUE, effect
from lugre_steering.recording import Array, Kind, Recording, Signal
from lugre_steering.resources import config_folder
from lugre_steering.serialise import as_json
from lugre_steering.simulate.manoeuvres import Motion
from lugre_steering.simulate.run import sensing_of, simulate
from lugre_steering.vehicle import EffectEntry, Vehicle, load

TERMS = tuple((entry.id, entry.amplitudes[0]) for entry in CATALOGUE.values() if entry.of_every_joint and not entry.of_line)
"""What every joint may have, and the value by which it is counted."""
STEP_S = 5e-4
"""Of the simulation: its own error passes for 0.5 % of viscous friction at the 2 ms of recordings to look at."""
SMOOTHED = 3
"""Running means that round the corners of a motion."""


@dataclass(frozen=True)
class Joint:
    """A machine as it is, the vehicle file that is known of it, its recording, and the true value of each of TERMS."""

    real: Vehicle
    sheet: Vehicle
    recording: Recording
    truth: dict[str, float]


@dataclass(frozen=True)
class Told:
    """One of TERMS of one joint: the true value, and what was said of it (nothing: not told)."""

    term: str
    true: float
    value: float | None
    low: float = np.nan
    high: float = np.nan

    @property
    def held(self) -> bool:
        return self.low <= self.true <= self.high


def drawn(seed: int, *, ripple: bool = False, gear: str = "") -> Joint:
    """Torques are drawn against the Coulomb friction, so that all of them can be seen; sensors and motion over what is usual. ``ripple``:
    also a torque periodic in the angle, as of a motor's magnets, which no entry of the catalogue is; ``gear``: also friction in proportion
    to what gravity and inertia ask for, and the entry of the catalogue that it is."""
    rng = np.random.default_rng([seed, 16])

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    coulomb, stribeck = between(5.0, 100.0), between(0.5, 5.0)
    motion = _sweeps(rng, between(8.0, 60.0)) if seed % 2 else _sines(rng, between(8.0, 60.0))
    rate, acceleration = float(np.abs(motion.rate).max()), float(np.abs(motion.acceleration).max())
    values = {
        "amplitude": coulomb * between(0.5, 10.0), "torque": coulomb * between(0.1, 1.0) * float(rng.choice([-1.0, 1.0])),
        "sigma_2": coulomb * between(0.2, 2.0) / rate, "inertia": coulomb * between(0.2, 3.0) / acceleration,
    }  # fmt: skip
    truth = {name: values[parameter] for name, parameter in TERMS}
    plain = load(config_folder() / "single_joint_example.yaml").replace(gravity=None)
    assert plain.contact is not None
    assert plain.torque_sensor is not None
    contact = replace(
        plain.contact, coulomb_torque_Nm=coulomb, static_torque_Nm=coulomb * rng.uniform(1.0, 1.4), stribeck_speed_deg_s=stribeck,
        stiffness_Nm_per_deg=coulomb / between(0.05, 0.5), presliding_damping_Nms=0.0,
    )  # fmt: skip
    known = plain.replace(
        sensors=replace(plain.sensors, angle_noise_deg=between(0.001, 0.02)),
        torque_sensor=replace(plain.torque_sensor, noise_Nm=coulomb * between(0.003, 0.03)),
    )
    own = tuple(EffectEntry(name, {parameter: truth[name]}) for name, parameter in TERMS)
    real, wrong = known.replace(contact=contact, effects=own), between(0.7, 1.4)
    guess = replace(
        contact, coulomb_torque_Nm=wrong * coulomb, static_torque_Nm=1.2 * wrong * coulomb, stribeck_speed_deg_s=2.0,
        stiffness_Nm_per_deg=wrong * coulomb / 0.2,
    )  # fmt: skip
    hertz = between(25.0, 200.0)
    run = simulate(real, motion, replace(sensing_of(real), angle_rate_Hz=hertz, pressure_rate_Hz=hertz, seed=seed))
    signals = {channel.kind: signal for channel, signal in run.signals.items()}
    torque = signals[Kind.TORQUE]
    if ripple:
        periods = np.interp(torque.time_s, run.truth.motion.time, run.truth.motion.theta[0]) / np.radians(between(3.0, 12.0))
        torque = Signal(torque.time_s, torque.value + coulomb * between(0.1, 0.5) * np.sin(2.0 * np.pi * periods))
    if gear:
        truth[gear] = between(0.03, 0.3)
        theta = run.truth.motion.theta[0]
        carried = values["amplitude"] * np.sin(theta) + values["torque"] + values["inertia"] * run.truth.motion.acceleration[0]
        lost = truth[gear] * np.abs(carried) * _turned(theta, np.radians(between(0.02, 0.2)))
        torque = Signal(torque.time_s, torque.value + np.interp(torque.time_s, run.truth.motion.time, lost))
    recording = Recording(f"joint_{seed}", 0, {"left": signals[Kind.ANGLE]}, {}, measured_torque=torque)
    return Joint(real, known.replace(contact=guess), recording, truth)


def _turned(theta: Array, width: float) -> Array:
    """Direction of the motion (n,), from one to the other over twice an angle [rad]: a stop operator, no bristle."""
    way = np.zeros(theta.size)
    for i, step in enumerate(np.diff(theta) / width, 1):
        way[i] = min(max(way[i - 1] + step, -1.0), 1.0)
    return way


def _sweeps(rng: np.random.Generator, fastest_deg_s: float) -> Motion:
    """Sweeps to and fro at several rates, with rests between them."""
    time, angle, side = [0.0, 2.0], [0.0, 0.0], 1.0
    for _ in range(int(rng.integers(8, 13))):
        to, rate = side * rng.uniform(12.0, 40.0), fastest_deg_s * rng.uniform(0.2, 1.0)
        arrival = time[-1] + abs(to - angle[-1]) / rate
        time, angle, side = [*time, arrival, arrival + rng.uniform(0.3, 2.0)], [*angle, to, to], -side
    return _rounded(rng, np.array(time), np.array(angle))


def _sines(rng: np.random.Generator, fastest_deg_s: float) -> Motion:
    """A periodic sum of sines that begins and ends at rest, as joints are excited for identification."""
    slowest_Hz = rng.uniform(0.04, 0.1)
    time = np.arange(0.0, 60.0, STEP_S)
    harmonics = np.arange(1, 6)
    angle = sum(rng.normal() / k * np.sin(2.0 * np.pi * slowest_Hz * k * time + rng.uniform(0.0, 2.0 * np.pi)) for k in harmonics)
    angle *= np.clip(np.minimum(time - 2.0, time[-1] - 2.0 - time) / 2.0, 0.0, 1.0)
    scale = min(fastest_deg_s / np.abs(np.gradient(angle, STEP_S)).max(), 40.0 / np.abs(angle).max())
    return _rounded(rng, time, scale * angle)


def _rounded(rng: np.random.Generator, time: Array, angle_deg: Array) -> Motion:
    grid = np.arange(0.0, time[-1], STEP_S)
    theta = np.interp(grid, time, np.radians(angle_deg))
    width = round(rng.uniform(0.04, 0.2) / STEP_S)
    for _ in range(SMOOTHED):
        theta = uniform_filter1d(theta, width, mode="nearest")
    return Motion(grid, theta[None])


def judged(seed: int, *, ripple: bool = False, gear: str = "") -> tuple[list[Told], list[str]]:
    """What diagnosis says of each of TERMS of a drawn joint, of its ``gear`` if there is one, and names that the joint does not have."""
    joint = drawn(seed, ripple=ripple, gear=gear)
    found = {named.id: named.parameters for named in diagnose_recordings([joint.recording], joint.sheet).effects}
    told = []
    for name, parameter in (*TERMS, (gear, effect(gear).amplitudes[0])) if gear else TERMS:
        value = found[name][parameter] if name in found else None
        low, high = (None, None) if value is None else value.ci95
        if value is None or low is None or high is None:
            told.append(Told(name, joint.truth[name], None))
        else:
            told.append(Told(name, joint.truth[name], value.value, low, high))
    return told, sorted(found.keys() - joint.truth.keys())


def table(told: Sequence[Told]) -> dict[str, dict[str, float]]:
    """Per term, and of all: how many were told, the share held, the median half width of an interval and the median error, each over the
    true value."""
    rows = {}
    for term in (*dict.fromkeys(each.term for each in told), "all"):
        own = [each for each in told if each.value is not None and term in (each.term, "all")]
        rows[term] = {
            "told": len(own), "held": float(np.mean([each.held for each in own])),
            "half_width": float(np.median([0.5 * (each.high - each.low) / abs(each.true) for each in own])),
            "error": float(np.median([abs(each.value / each.true - 1.0) for each in own if each.value is not None])),
        }  # fmt: skip
    return rows


def run(argv: Sequence[str]) -> None:
    """Command line of this benchmark."""
    parser = argparse.ArgumentParser(prog="python -m lugre_steering.bench joints", description=__doc__)
    parser.add_argument("--joints", type=int, default=24, help="joints drawn, one recording each [24]")
    parser.add_argument("--seed", type=int, default=1, help="of the first joint [1]")
    parser.add_argument("--ripple", action="store_true", help="beside a torque periodic in the angle, which no entry of the catalogue is")
    parser.add_argument("--gear", default="", metavar="ID", help="with friction in proportion to the load, to be told by this name")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    options = parser.parse_args(argv)
    told: list[Told] = []
    foreign: list[str] = []
    for seed in range(options.seed, options.seed + options.joints):
        of_joint, more = judged(seed, ripple=options.ripple, gear=options.gear)
        told, foreign = told + of_joint, foreign + more
    rows = table(told)
    if options.json:
        print(as_json({"joints": options.joints, "names_it_does_not_have": foreign, "rows": rows}))
        return
    print(f"95 % intervals of {options.joints} drawn joints; names that they do not have: {', '.join(foreign) or 'none'}")
    print(f"{'':18s}{'told':>6s}{'held':>8s}{'half width':>12s}{'error':>8s}   (medians, over the true value)")
    for term, row in rows.items():
        print(f"{term:18s}{row['told']:6.0f}{row['held']:8.1%}{row['half_width']:12.2%}{row['error']:8.2%}")
