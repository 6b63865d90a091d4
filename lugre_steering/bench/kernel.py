# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Cost and error of one step of one track: the Numba kernel beside a C loop, a plain Python loop and SciPy's Radau."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping
from time import perf_counter

import numpy as np
from scipy.integrate import solve_ivp

from lugre_steering.bench.kernel_c import CLoop
from lugre_steering.chain.lanes import torque_sets
from lugre_steering.chain.step import Records, torque_in_phases, torque_side
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.recording import Array
from lugre_steering.resources import config_folder
from lugre_steering.serialise import as_json
from lugre_steering.vehicle import Vehicle, load
from lugre_steering.vehicle.model import build_model
from lugre_steering.vehicle.sections import EffectEntry
from lugre_steering.vehicle.tables import limit_device

RATE_HZ = 100.0
SETS = 512
BASELINE = "Numba kernel, baseline"


def every_effect() -> dict[str, float]:
    """A typical value of every effect parameter of the chain, by field of the parameter record."""
    return {
        f"{effect.id}_{p.name}": p.typical
        for effect in CATALOGUE.values()
        if effect.hooks and not effect.per_line
        for p in effect.parameters
    }


def manoeuvre(duration_s: float) -> tuple[Array, Array, Array]:
    """Time [s], angle [rad] and the rate [rad/s] of the step that ends at each sample (n,)."""
    time = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    theta = 0.45 * np.sin(0.5 * time) ** 2 * np.cos(0.11 * time)
    return time, theta, np.diff(theta, prepend=theta[0]) / np.diff(time, prepend=time[0] - 1.0 / RATE_HZ)


def laws(p: Records, rubber: Array, omega: float, temperature: float) -> tuple[float, float]:
    """Stiffness [N m/rad] and steady sliding torque g [N m] in plain Python."""
    low, step = float(p["table_low"][0]), float(p["table_step"][0])
    position = min(max((temperature - low) / step, 0.0), len(rubber) - 1.000001)
    row = int(position)
    stiffness, friction = rubber[row] + (position - row) * (rubber[row + 1] - rubber[row])
    fall = math.exp(-(abs(omega / float(p["stribeck_speed"][0])) ** float(p["stribeck_exponent"][0])))
    coulomb = float(p["coulomb_torque"][0])
    g = float(friction) * (coulomb + (float(p["static_torque"][0]) - coulomb) * fall)
    return float(p["sigma_0"][0]) * float(stiffness), g


def plain_loop(p: Records, rubber: Array, time: Array, theta: Array, omega: Array) -> Array:
    """The exact step in plain Python: torque [N m] (n,)."""
    capacity, cooling, air = (float(p[name][0]) for name in ("heat_capacity", "cooling", "air_temperature"))
    z, temperature = 0.0, float(p["rubber_temperature"][0])
    torque = np.empty(time.size)
    for i in range(time.size):
        before = max(i - 1, 0)
        dt, d_theta, rate = time[i] - time[before], theta[i] - theta[before], omega[i]
        stiffness, g = laws(p, rubber, rate, temperature)
        steady = math.copysign(g / stiffness, d_theta)
        z_next = steady + (z - steady) * math.exp(-stiffness * abs(d_theta) / g)
        sigma_1 = float(p["damping_factor"][0]) * math.sqrt(stiffness)
        work = g * (abs(d_theta) + math.copysign(1.0, d_theta) * (z - z_next)) + sigma_1 * rate * (z_next - z)
        heat = max(work - 0.5 * stiffness * (z_next**2 - z**2), 0.0)
        k = 0.5 * cooling * dt / capacity
        temperature = (temperature * (1.0 - k) + 2.0 * k * air + heat / capacity) / (1.0 + k)
        z = z_next
        damping = sigma_1 * (rate - abs(rate) * z * stiffness / g)
        torque[i] = stiffness * z + damping + float(p["aligning_torque"][0]) * math.sin(theta[i])
    return torque


class StiffOde:
    """The same physics as a stiff ODE in (z, T), for SciPy's Radau. The rate is constant between samples."""

    def __init__(self, p: Records, rubber: Array, time: Array, theta: Array, omega: Array) -> None:
        self._p, self._rubber = p, rubber
        self._time, self._theta, self._omega = time, theta, omega
        self._capacity, self._cooling, self._air = (
            float(p[name][0]) for name in ("heat_capacity", "cooling", "air_temperature")
        )
        self._damping = float(p["damping_factor"][0])
        self._start = [0.0, float(p["rubber_temperature"][0])]

    def _terms(self, rate: float, z: float, temperature: float) -> tuple[float, float, float, float]:
        """Stiffness [N m/rad], dz/dt [rad/s], elastic and damping torque [N m]."""
        stiffness, g = laws(self._p, self._rubber, rate, temperature)
        dz = rate - stiffness * abs(rate) * z / g
        return stiffness, dz, stiffness * z, self._damping * math.sqrt(stiffness) * dz

    def _slope(self, rate: float, y: Array) -> list[float]:
        stiffness, dz, elastic, damping = self._terms(rate, y[0], y[1])
        power = max((elastic + damping) * rate - stiffness * y[0] * dz, 0.0)
        return [dz, (power - self._cooling * (y[1] - self._air)) / self._capacity]

    def _torque(self, states: Array) -> Array:
        """Torque [N m] (n,) of states (n, 2)."""
        friction = [sum(self._terms(float(r), *y)[2:]) for r, y in zip(self._omega, states, strict=True)]
        torque: Array = np.array(friction) + float(self._p["aligning_torque"][0]) * np.sin(self._theta)
        return torque

    def by_sample(self, rtol: float) -> Array:
        """One call of the solver per sample, which lands on every jump of the rate: torque [N m] (n,)."""
        states = np.array([self._start] * self._time.size)
        for i in range(1, self._time.size):
            rate = float(self._omega[i])
            span = self._time[i - 1], self._time[i]
            solution = solve_ivp(
                lambda _, y, rate=rate: self._slope(rate, y), span, states[i - 1], "Radau", rtol=rtol, atol=rtol * 1e-3
            )
            states[i] = solution.y[:, -1]
        return self._torque(states)

    def in_one_call(self, rtol: float) -> Array:
        """One call for the whole record, so that the solver may step over samples: torque [N m] (n,)."""
        last = self._omega.size - 1

        def slope(t: float, y: Array) -> list[float]:
            return self._slope(float(self._omega[min(int(t * RATE_HZ) + 1, last)]), y)

        span, atol = (self._time[0], self._time[-1]), [rtol * 1e-2, rtol]  # z is some 0.01 rad, T some 20 degC
        solution = solve_ivp(slope, span, self._start, "Radau", self._time, rtol=rtol, atol=atol)
        return self._torque(solution.y.T)


def best_time(task: Callable[[], object], repeats: int) -> float:
    """Shortest duration [s] of several runs: the one least disturbed by others on the machine."""
    best = math.inf
    for _ in range(repeats):
        start = perf_counter()
        task()
        best = min(best, perf_counter() - start)
    return best


Row = dict[str, object]


def measure() -> list[Row]:
    """One row per way: name, nanoseconds per step and track, largest error relative to the torque range."""
    vehicle = load(config_folder() / "test_vehicle.yaml")
    model = build_model(vehicle)
    p, rubber = model.parameters[0], model.rubber
    long, short = manoeuvre(60.0), manoeuvre(20.0)
    ode = StiffOde(p, rubber, *short)
    truth = ode.by_sample(1e-9)
    rows = _kernels(vehicle, p, rubber, truth)

    sets = np.repeat(p, SETS)
    torque_sets(sets, rubber, *short)
    seconds = best_time(lambda: torque_sets(sets, rubber, *long), 5)
    torque = torque_sets(sets, rubber, *short)[:, -1]
    rows.append(_row(f"lanes, {SETS} sets, per set", seconds, long[0].size * SETS, torque, truth))
    for name, way, rtols in (
        ("plain Python loop", lambda _: plain_loop(p, rubber, *short), (0.0,)),
        ("Radau, whole record at once", ode.in_one_call, (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)),
        ("Radau, sample by sample", ode.by_sample, (1e-1, 1e-2, 1e-3)),
    ):
        for rtol in rtols:
            start = perf_counter()
            result = way(rtol)
            seconds = perf_counter() - start
            rows.append(_row(f"{name}, rtol {rtol:g}" if rtol else name, seconds, short[0].size, result, truth))
    return rows


def _row(name: str, seconds: float, steps: int, torque: Array | None, truth: Array) -> Row:
    error = math.nan if torque is None else float(np.abs(torque - truth).max() / np.ptp(truth))
    return {"name": name, "ns_per_step_and_track": 1e9 * seconds / steps, "relative_error": error}


def _kernels(vehicle: Vehicle, p: Records, rubber: Array, truth: Array) -> list[Row]:
    """Rows of the compiled step in its variants, and of the C loop; the errors of those without additions."""
    long, short = manoeuvre(60.0), manoeuvre(20.0)
    still = np.zeros(long[0].size)

    def kernel(parameters: Records) -> Callable[[], Array]:
        return lambda: torque_side(parameters, rubber, *long, still)

    def in_place(parameters: Records) -> Callable[[], Array]:
        name = next(f"{effect.id}_{effect.amplitudes[0]}" for effect in CATALOGUE.values() if effect.hooks and not effect.per_line)
        never = [(-math.inf, parameters), (math.inf, _with(parameters, {name: 1.0}))]  # keeps the stages, of which none acts
        return lambda: torque_in_phases(never, rubber, *long, still)

    stopped = vehicle.replace(effects=(limit_device(),))
    loop = CLoop.build()
    tasks = {
        BASELINE: kernel(p),
        "C loop, gcc -O3": kernel(p) if loop is None else lambda: loop.torque_side(p, rubber, *long),
        "Numba kernel, effect stages in place, neutral": in_place(p),
        "Numba kernel, one effect on (end stop)": kernel(build_model(stopped).parameters[0]),
        "Numba kernel composed for a file with the end stop": kernel(build_model(stopped, lean=True).parameters[0]),
        "Numba kernel, all effects on at once": kernel(_with(p, every_effect())),
    }
    best = by_turns(tasks, 60)
    torque = {
        BASELINE: torque_side(p, rubber, *short, still[: short[0].size]),
        "C loop, gcc -O3": None if loop is None else loop.torque_side(p, rubber, *short),
    }
    return [
        _row(name, seconds, long[0].size, torque.get(name), truth)
        for name, seconds in best.items()
        if loop is not None or not name.startswith("C loop")
    ]


def each_effect() -> list[Row]:
    """The step composed for a file with one effect at its typical size, as replay and live node run it: each effect of the chain."""
    vehicle = load(config_folder() / "test_vehicle.yaml")
    time, theta, omega = manoeuvre(60.0)
    still = np.zeros(time.size)

    def composed(*effects: EffectEntry) -> Callable[[], Array]:
        model = build_model(vehicle.replace(effects=effects), lean=True)
        return lambda: torque_side(model.parameters[0], model.rubber, time, theta, omega, still)

    tasks = {BASELINE: composed()}
    for effect in CATALOGUE.values():
        if effect.hooks and not effect.per_line:
            tasks[effect.id] = composed(EffectEntry(effect.id, {p.name: p.typical for p in effect.parameters}))
    best = by_turns(tasks, 40)
    order = [BASELINE, *sorted(best.keys() - {BASELINE}, key=lambda name: -best[name])]
    return [_row(name, best[name], time.size, None, np.zeros(2)) for name in order]


def _with(p: Records, values: Mapping[str, float]) -> Records:
    changed = p.copy()
    for field, value in values.items():
        changed[field] = value
    return changed


def by_turns(tasks: Mapping[str, Callable[[], object]], turns: int) -> dict[str, float]:
    """Shortest duration [s] of each task; by turns, so that all see the same machine."""
    best = dict.fromkeys(tasks, math.inf)
    for _ in range(turns):
        for name, task in tasks.items():
            best[name] = min(best[name], best_time(task, 1))
    return best


def verdict(rows: list[dict[str, object]]) -> str:
    """The kernel against the quickest Radau that errs no more, and against the quickest of all."""
    number = {
        str(row["name"]): (float(str(row["ns_per_step_and_track"])), float(str(row["relative_error"]))) for row in rows
    }
    own_ns, own_error = number[BASELINE]
    solver = {name: value for name, value in number.items() if name.startswith("Radau")}
    said = []
    for what, limit in (("of no larger error", own_error), ("of any error", math.inf)):
        within = {name: ns for name, (ns, error) in solver.items() if error <= limit}
        if within:
            name = min(within, key=lambda name: within[name])
            error = solver[name][1] / own_error
            said.append(
                f"Quickest Radau {what}: {name}, {within[name] / own_ns:,.0f} times the kernel's time, "
                f"{error:.2g} times its error."
            )
        else:
            said.append(f"No Radau {what} among these.")
    return "\n".join(said)


def run(arguments: list[str]) -> None:
    """Print the table, or JSON with ``--json``."""
    parser = argparse.ArgumentParser(prog="bench kernel", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--each", action="store_true", help="in place of the rest, the step composed for each effect of the chain alone")
    options = parser.parse_args(arguments)
    rows = each_effect() if options.each else measure()
    if options.json:
        print(as_json({"kernel": rows}))
        return
    print("one step of one track; error: the largest, as a share of the torque range")
    print(f"{'way':<50} {'ns/step':>11} {'/ kernel':>9} {'error':>8}")
    base = float(str(rows[0]["ns_per_step_and_track"]))
    for row in rows:
        ns, error = float(str(row["ns_per_step_and_track"])), float(str(row["relative_error"]))
        shown = "-" if math.isnan(error) else f"{error:.1e}"
        print(f"{row['name']!s:<50} {ns:>11,.1f} {ns / base:>9,.4g} {shown:>8}")
    if options.each:
        return
    print(verdict(rows))
    if not any("C loop" in str(row["name"]) for row in rows):
        print("C loop skipped: gcc not found.")
