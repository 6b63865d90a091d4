# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How long faults of the angles go untold that leave next to nothing to see: two encoders that freeze together, one that drifts.

A vehicle stands for 4 s and then steers to and fro at 100 Hz, slower from row to row, with the pressures of the simulated plant and the
noise of the sheet. Both angles freeze at one of eight moments of half a stroke: readings that repeat, where their noise was to be seen
before or where there is none; or readings that go on with their noise about one place. Or the left angle drifts, and there are no
pressures.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import dataclass

import numpy as np

from lugre_steering.chain.step import Records
from lugre_steering.estimator import Estimator, doubts
from lugre_steering.recording import Array, Kind
from lugre_steering.resources import config_folder
from lugre_steering.simulate.manoeuvres import Motion
from lugre_steering.simulate.plant import run as plant
from lugre_steering.vehicle import Vehicle, load
from lugre_steering.vehicle.actuation import line_pressures, total_gains

PERIOD_S, STANDS_S, AMPLITUDE_RAD, RIGHT_SHARE = 0.01, 4.0, 0.3, 0.95
STROKES_S = (7.0, 28.0, 112.0)
MOMENTS = tuple(k / 16.0 for k in range(1, 9))
DRIFTS_RAD_S = (0.1, 0.05, 0.02, 0.01, 0.005)
DRIFT_STROKE_S, DRIFT_S = 9.0, 60.0
KINDS = ("repeats, noise was seen", "repeats, no noise", "keeps its noise")
SECOND = 1_000_000_000


@dataclass(frozen=True)
class Drive:
    """Time (n,) [s], angles (2, n) [rad] without noise, their noise, and pressures (lines, n) [Pa] with it."""

    time: Array
    angle: Array
    noise: Array
    pressure: Array


def drive(vehicle: Vehicle, stroke_s: float, seconds: float) -> Drive:
    """From a standstill at the end of a stroke."""
    time, rng = np.arange(0.0, seconds, PERIOD_S), np.random.default_rng(1)
    swing = AMPLITUDE_RAD * np.cos(2.0 * math.pi / stroke_s * np.maximum(0.0, time - STANDS_S))
    angle = np.array([swing, RIGHT_SHARE * swing])
    pressure = line_pressures(plant(vehicle, Motion(time, angle)).torque, total_gains(vehicle, angle))
    noise = rng.normal(0.0, math.radians(vehicle.sensors.angle_noise_deg), angle.shape)
    return Drive(time, angle, noise, pressure + rng.normal(0.0, vehicle.sensors.pressure_noise_Pa, pressure.shape))


def estimates(vehicle: Vehicle, time: Array, angle: Array, pressure: Array | None) -> Records:
    """What the live estimator says of readings (2, n) and, where there are any, pressures (lines, n)."""
    angles = [i for i, channel in enumerate(vehicle.channels) if channel.kind is Kind.ANGLE]
    lines = [i for i, channel in enumerate(vehicle.channels) if channel.kind is Kind.PRESSURE]
    channels = np.array(angles if pressure is None else [*lines, *angles])
    rows = angle if pressure is None else np.concatenate([pressure, angle])
    stamps = np.repeat((SECOND + np.rint(time * SECOND)).astype(np.int64), channels.size)
    values = np.ascontiguousarray(rows.T).ravel()
    return Estimator(vehicle).push_block(np.tile(channels, time.size), stamps, values, np.full(values.size, math.nan))[0]


def told_s(rows: Records, begin_s: float) -> tuple[float, str]:
    """Seconds from a time on until the first doubt, and what it is; NaN without any."""
    for row in rows[rows["stamp_ns"] > SECOND * (1.0 + begin_s)]:
        if row["doubts"]:
            return float(row["stamp_ns"] - SECOND) / SECOND - begin_s, ", ".join(doubts(row))
    return math.nan, "nothing"


def frozen(vehicle: Vehicle, stroke_s: float) -> dict[str, list[float]]:
    """For each kind of freeze how long it takes until it is told, at each moment."""
    sound = drive(vehicle, stroke_s, STANDS_S + 1.5 * stroke_s)
    found: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for moment in MOMENTS:
        begin = round((STANDS_S + moment * stroke_s) / PERIOD_S)
        for kind in KINDS:
            reading = sound.angle + (0.0 if kind == KINDS[1] else sound.noise)
            reading[:, begin:] = (sound.angle if kind == KINDS[2] else reading)[:, begin, None]
            if kind == KINDS[2]:
                reading[:, begin:] += sound.noise[:, begin:]
            found[kind].append(told_s(estimates(vehicle, sound.time, reading, sound.pressure), begin * PERIOD_S)[0])
    return found


def drifting(vehicle: Vehicle, rate: float) -> dict[str, float | str]:
    """When a left angle that drifts [rad/s] is told, and how wrong [N m] the torque has been by then."""
    sound = drive(vehicle, DRIFT_STROKE_S, DRIFT_S)
    begin_s = STANDS_S + DRIFT_STROKE_S
    clean = sound.angle + sound.noise
    wrong = clean + np.array([[rate], [0.0]]) * np.maximum(0.0, sound.time - begin_s)
    right, false = (estimates(vehicle, sound.time, reading, None) for reading in (clean, wrong))
    seconds, reason = told_s(false, begin_s)
    until = SECOND * (1.0 + begin_s + (seconds if math.isfinite(seconds) else DRIFT_S))
    _, i, j = np.intersect1d(right["stamp_ns"], false["stamp_ns"][false["stamp_ns"] < until], return_indices=True)
    return {"rate_rad_s": rate, "told_s": seconds, "reason": reason, "error_Nm": float(np.abs(right["total"][i] - false["total"][j]).max())}


def run(argv: list[str]) -> None:
    """``python -m lugre_steering.bench untold``: two tables, or JSON."""
    parser = argparse.ArgumentParser(prog="bench untold", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON instead of the tables")
    options = parser.parse_args(argv)
    vehicle = load(config_folder() / "test_vehicle.yaml")
    freezes = {2.0 * math.pi * AMPLITUDE_RAD / stroke_s: frozen(vehicle, stroke_s) for stroke_s in STROKES_S}
    drifts = [drifting(vehicle, rate) for rate in DRIFTS_RAD_S]
    if options.json:
        json.dump({"frozen": freezes, "drift": drifts}, sys.stdout, indent=2)
        print()
        return
    print(f"both angles frozen, told after [s] (shortest to longest)\n{'up to rad/s':>12}" + "".join(f"{kind:>26}" for kind in KINDS))
    for rate, found in freezes.items():
        print(f"{rate:12.3f}" + "".join(f"{f'{min(seconds):.2f} to {max(seconds):.2f}':>26}" for seconds in found.values()))
    print(f"\nleft angle drifts, no pressures\n{'rad/s':>12}{'told s':>8}{'error N m':>11}  reason")
    for row in drifts:
        print(f"{row['rate_rad_s']:12.3f}{row['told_s']:8.2f}{row['error_Nm']:11.0f}  {row['reason']}")
