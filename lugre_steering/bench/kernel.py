# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Cost and error of one step of one track: the Numba kernel beside a C loop, a plain Python loop and SciPy's Radau."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp

from lugre_steering.bench.kernel_c import CLoop
from lugre_steering.chain.lanes import torque_sets
from lugre_steering.chain.layout import EFFECT_FIELDS
from lugre_steering.chain.model import build_model
from lugre_steering.chain.step import Records, torque_side
from lugre_steering.effects.catalogue import CATALOGUE
from lugre_steering.recording import Array
from lugre_steering.resources import config_folder
from lugre_steering.vehicle import load

RATE_HZ = 100.0
SETS = 512
# Where a typical size alone would leave an effect idle: inside the angles, times and torques of the manoeuvre.
_PLACED = {
    "end_stop_engage_angle": 0.3,
    "surface_patch_angle_low": 0.0,
    "surface_patch_angle_high": 0.2,
    "surface_patch_time_start": 5.0,
    "surface_patch_time_end": 30.0,
    "relief_saturation_ceiling": 35_000.0,
}


def every_effect() -> dict[str, float]:
    """A typical value of every effect parameter of the chain, by field of the parameter record."""
    typical = {f"{effect.id}_{p.name}": p.scale for effect in CATALOGUE.values() for p in effect.parameters}
    return {field: _PLACED.get(field, typical[field]) for field in EFFECT_FIELDS}


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


def radau(p: Records, rubber: Array, time: Array, theta: Array, omega: Array, rtol: float) -> Array:
    """The stiff ODE in (z, T) by SciPy's Radau, sample by sample (the rate jumps there): torque [N m] (n,)."""
    capacity, cooling, air = (float(p[name][0]) for name in ("heat_capacity", "cooling", "air_temperature"))
    state = np.array([0.0, float(p["rubber_temperature"][0])])
    torque = np.empty(time.size)
    for i in range(time.size):
        rate = float(omega[i])

        def terms(z: float, temperature: float, rate: float = rate) -> tuple[float, float, float, float]:
            stiffness, g = laws(p, rubber, rate, temperature)
            dz = rate - stiffness * abs(rate) * z / g
            return stiffness, dz, stiffness * z, float(p["damping_factor"][0]) * math.sqrt(stiffness) * dz

        def slope(
            _t: float, y: Array, rate: float = rate, terms: Callable[..., tuple[float, ...]] = terms
        ) -> list[float]:
            stiffness, dz, elastic, damping = terms(y[0], y[1])
            power = max((elastic + damping) * rate - stiffness * y[0] * dz, 0.0)
            return [dz, (power - cooling * (y[1] - air)) / capacity]

        if i:
            state = solve_ivp(slope, (time[i - 1], time[i]), state, "Radau", rtol=rtol, atol=rtol * 1e-3).y[:, -1]
        _, _, elastic, damping = terms(state[0], state[1])
        torque[i] = elastic + damping + float(p["aligning_torque"][0]) * math.sin(theta[i])
    return torque


def best_time(task: Callable[[], object], repeats: int) -> float:
    """Shortest duration [s] of several runs: the one least disturbed by others on the machine."""
    best = math.inf
    for _ in range(repeats):
        start = perf_counter()
        task()
        best = min(best, perf_counter() - start)
    return best


def measure() -> list[dict[str, object]]:
    """One row per way: name, nanoseconds per step and track, largest error relative to the torque range."""
    model = build_model(load(config_folder() / "test_vehicle.yaml"))
    p, rubber = model.parameters[0], model.rubber
    long, short = manoeuvre(60.0), manoeuvre(4.0)
    still = np.zeros(long[0].size)
    truth = radau(p, rubber, *short, 1e-11)
    rows: list[dict[str, object]] = []

    def row(name: str, seconds: float, steps: int, torque: Array | None) -> float:
        error = math.nan if torque is None else float(np.abs(torque - truth).max() / np.ptp(truth))
        rows.append({"name": name, "ns_per_step_and_track": 1e9 * seconds / steps, "relative_error": error})
        return error

    def kernel(parameters: Records) -> Callable[[], Array]:
        return lambda: torque_side(parameters, rubber, *long, still)

    # The C loop and the kernel by turns, so that both see the same machine.
    loop = CLoop.build()
    kernel(p)()
    ours, theirs = math.inf, math.inf
    for _ in range(60):
        ours = min(ours, best_time(kernel(p), 1))
        if loop is not None:
            theirs = min(theirs, best_time(lambda: loop.torque_side(p, rubber, *long), 1))
    own_error = row(
        "Numba kernel, baseline", ours, long[0].size, torque_side(p, rubber, *short, still[: short[0].size])
    )
    if loop is not None:
        row("C loop, gcc -O3", theirs, long[0].size, loop.torque_side(p, rubber, *short))

    one, every = p.copy(), p.copy()
    one["end_stop_stiffness"], one["end_stop_engage_angle"] = 5e4, 0.3
    for field, value in every_effect().items():
        every[field] = value
    row("Numba kernel, one effect on (end stop)", best_time(kernel(one), 20), long[0].size, None)
    row("Numba kernel, all effects on at once", best_time(kernel(every), 20), long[0].size, None)

    sets = np.repeat(p, SETS)
    torque_sets(sets, rubber, *short)
    seconds = best_time(lambda: torque_sets(sets, rubber, *long), 5)
    row(
        f"lanes, {SETS} parameter sets, per set", seconds, long[0].size * SETS, torque_sets(sets, rubber, *short)[:, -1]
    )
    row(
        "plain Python loop",
        best_time(lambda: plain_loop(p, rubber, *short), 1),
        short[0].size,
        plain_loop(p, rubber, *short),
    )
    for rtol in (1e-3, 1e-5, 1e-7, 1e-9):
        start = perf_counter()
        torque = radau(p, rubber, *short, rtol)
        seconds = perf_counter() - start
        if np.abs(torque - truth).max() / np.ptp(truth) <= own_error:
            break
    row(f"SciPy Radau, rtol {rtol:g}", seconds, short[0].size, torque)
    return rows


def run(arguments: list[str]) -> None:
    """Print the table, or JSON with ``--json``."""
    parser = argparse.ArgumentParser(prog="bench kernel", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    options = parser.parse_args(arguments)
    rows = measure()
    if options.json:
        print(json.dumps({"kernel": [{k: None if v != v else v for k, v in row.items()} for row in rows]}, indent=2))
        return
    table = Table(title="One step of one track, quickest of several runs")
    for header in ("way", "ns per step", "times the kernel", "largest error / torque range"):
        table.add_column(header, justify="left" if header == "way" else "right")
    base = float(str(rows[0]["ns_per_step_and_track"]))
    for row in rows:
        ns, error = float(str(row["ns_per_step_and_track"])), float(str(row["relative_error"]))
        table.add_row(str(row["name"]), f"{ns:,.1f}", f"{ns / base:,.2f}", "-" if math.isnan(error) else f"{error:.1e}")
    console = Console()
    console.print(table)
    if not any("C loop" in str(row["name"]) for row in rows):
        console.print("C loop skipped: gcc not found.")
