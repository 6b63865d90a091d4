# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Are the 95 % intervals right? Vehicles drawn about the sheet, simulated with realistic sensors, calibrated, compared.

``python -m lugre_steering.calibration.coverage --cases 100`` prints the share of intervals that hold the truth. All in
memory; synthetic throughout.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lugre_steering.calibration.calibrate import chosen, parameter_rows
from lugre_steering.calibration.estimate import estimate
from lugre_steering.data.dataset import prepare
from lugre_steering.fitting.apply import apply_calibration
from lugre_steering.fitting.keys import KEYS
from lugre_steering.fitting.problem import Problem
from lugre_steering.recording import Kind, Recording, Signal
from lugre_steering.simulate.command import load_vehicle
from lugre_steering.simulate.manoeuvres import BUILT_IN, Hold, Manoeuvre, Sweep, motion_of
from lugre_steering.simulate.run import Simulated, sensing_of, simulate
from lugre_steering.vehicle import Vehicle

QUICK = (
    Manoeuvre("rates", "", (Hold(1.5), Sweep(14.0, 0.8, 1.0), Sweep(-14.0, 10.0, 1.0), Sweep(4.0, 3.0, 1.0))),
    Manoeuvre("loops", "", (Hold(1.5), Sweep(20.0, 8.0, 1.0), Sweep(14.0, 1.5, 0.5), Sweep(-12.0, 4.0, 1.0))),
)
"""Two short runs that see sliding, reversals and the Stribeck range, but no cooling."""


@dataclass(frozen=True)
class Row:
    """One parameter of one case."""

    name: str
    truth: float
    value: float
    ci95: tuple[float, float]
    determined: bool

    @property
    def covered(self) -> bool:
        return self.ci95[0] <= self.truth <= self.ci95[1]

    @property
    def error(self) -> float:
        """Relative."""
        return abs(self.value / self.truth - 1.0)


def as_recording(run: Simulated, name: str) -> Recording:
    """A simulated run as if read from a bag."""
    by_kind: dict[Kind, dict[str, Signal]] = {kind: {} for kind in Kind}
    for channel, signal in run.signals.items():
        by_kind[channel.kind][channel.name] = signal
    return Recording(
        name,
        0,
        by_kind[Kind.ANGLE],
        by_kind[Kind.PRESSURE],
        air_temperature=next(iter(by_kind[Kind.AIR_TEMPERATURE].values()), None),
        measured_torque=next(iter(by_kind[Kind.TORQUE].values()), None),
    )


def record(vehicle: Vehicle, manoeuvres: Sequence[Manoeuvre], seed: int, rate_Hz: float = 100.0) -> list[Recording]:
    """Synthetic recordings: sensors of the sheet, jitter, quantised pressures at half the rate of the angles."""
    recordings = []
    for number, manoeuvre in enumerate(manoeuvres):
        sensing = replace(
            sensing_of(vehicle),
            angle_rate_Hz=rate_Hz,
            pressure_rate_Hz=0.5 * rate_Hz,
            jitter_s=2e-4,
            pressure_resolution_Pa=500.0,
            seed=1000 * seed + number,
        )
        run = simulate(vehicle, motion_of(manoeuvre, vehicle), sensing)
        recordings.append(as_recording(run, f"synthetic_{seed}_{manoeuvre.name}"))
    return recordings


def draw_truth(sheet: Vehicle, problem: Problem, seed: int) -> Vehicle:
    """A vehicle whose unknown parameters differ from the sheet as the priors say, within the bounds."""
    rng = np.random.default_rng([seed, 7])
    x = np.zeros(problem.nuisances)
    for i, c in enumerate(problem.calibrations):
        x[i] = c.prior * rng.standard_normal()
        while not c.low < x[i] < c.high:
            x[i] = c.prior * rng.standard_normal()
    return apply_calibration(sheet, problem, x)


def cases(count: int, manoeuvres: Sequence[Manoeuvre] = QUICK, first: int = 0) -> Iterator[list[Row]]:
    """Calibrations of ``count`` drawn vehicles."""
    sheet = load_vehicle(None)
    calibrations = chosen(sheet)
    nominal = Problem(sheet, [prepare(r, sheet) for r in record(sheet, QUICK[:1], 0)], calibrations)
    for seed in range(first, first + count):
        truth = draw_truth(sheet, nominal, seed)
        runs = [prepare(recording, sheet) for recording in record(truth, manoeuvres, seed)]
        problem = Problem(sheet, runs, calibrations)
        result = estimate(problem, seed=seed)
        fitted = apply_calibration(sheet, problem, result.x)
        known = {key.key: key.read(truth) for key in KEYS}
        yield [
            Row(
                row.key,
                float(known[row.key] or 0.0),
                row.value,
                row.ci95,
                not row.prior_dominated,
            )
            for row in parameter_rows(problem, result, fitted, priors=True)
        ]


def main() -> None:
    parser = argparse.ArgumentParser(description="coverage of the 95 % intervals of calibrate on synthetic recordings")
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--manoeuvres", nargs="*", choices=list(BUILT_IN), help="two short runs if left out")
    arguments = parser.parse_args()
    chosen_runs = [BUILT_IN[name] for name in arguments.manoeuvres or ()] or QUICK
    rows: list[Row] = []
    for number, case in enumerate(cases(arguments.cases, chosen_runs), 1):
        rows += case
        if number % 10 == 0 or number == arguments.cases:
            covered = np.mean([row.covered for row in rows])
            print(f"{number} cases: {100.0 * covered:.1f} % of {len(rows)} intervals hold the truth", flush=True)
    for name in dict.fromkeys(row.name for row in rows):
        own = [row for row in rows if row.name == name]
        covered = 100.0 * np.mean([row.covered for row in own])
        determined = 100.0 * np.mean([row.determined for row in own])
        worst = 100.0 * max(row.error for row in own)
        print(f"{name:32s} covered {covered:5.1f} %  largest error {worst:6.2f} %  determined {determined:3.0f} %")


if __name__ == "__main__":
    main()
