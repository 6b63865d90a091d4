# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How often the online watch speaks although nothing has changed, and how soon it does when something has.

Machines, friction and dirt are the third simulator's, which is not of the estimator's form. Of each machine the first bag
calibrates; both are then run through the live estimator and cut into manoeuvres. Hours of operation are made by drawing stretches
of neighbouring manoeuvres (30 on average) from either bag again and again: what a machine's residuals do from one manoeuvre to the
next is kept, and days unlike the one of the calibration come and go. The threshold that gives the nominal rate is found on
one half of the machines and checked on the other.

Beside it is told how large the error of a manoeuvre of each recording is (median), as a multiple of what the calibration left on held-out
stretches of the first: why no bound near that can tell a wrong model from another day.

The delay is counted from a change, after a thousand undisturbed manoeuvres, to manoeuvres of the same drive with a hidden effect.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from lugre_steering.bag.given import in_stamp_order
from lugre_steering.bag.load import read_recording
from lugre_steering.calibration.library import calibrate
from lugre_steering.errors import LugreSteeringError
from lugre_steering.estimator import Estimator
from lugre_steering.estimator.known import known_range
from lugre_steering.proof.campaign import NOISES
from lugre_steering.proof.field.hidden import IN_SERVICE as CHANGES
from lugre_steering.proof.field.simulator import Setting, draw_setting, simulate
from lugre_steering.proof.made import Wanted
from lugre_steering.recording import Array
from lugre_steering.vehicle import Vehicle, load
from lugre_steering.watch.detector import SCORES, STATE, THRESHOLD, Watch, weigh

STRETCH = 30.0
THRESHOLDS = np.array([5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0, 150.0, 200.0])
BEFORE = 1000
STRENGTH = 5.0
"""Of the change, in typical sizes of what the proof hides: a machine that is damaged, not one that is a little off."""


class Scores(NamedTuple):
    """Manoeuvres of one bag: their scores (n, SCORES), and how long each took [h], standing included."""

    scores: Array
    hours: float


def scores_of(vehicle: Vehicle, bag: Path) -> Scores:
    """Scores of all manoeuvres of a bag as the live node would see them."""
    recording = read_recording(bag, vehicle.channels)
    samples = in_stamp_order(recording, vehicle.channels)
    estimates, residuals = Estimator(vehicle).push_block(*samples)
    watch, found, at = Watch(vehicle, math.inf), [], 0
    angles = estimates["theta"][:, : len(vehicle.sides)].tolist()
    for row in residuals:
        while at < estimates.size and estimates["stamp_ns"][at] <= row["stamp_ns"]:
            watch.turned(angles[at])
            at += 1
        watch.scores = []
        watch.add(int(row["stamp_ns"]), float(row["residual"]))
        found += watch.scores
    span_h = (samples[1][-1] - samples[1][0]) / 3.6e12
    return Scores(np.array(found).reshape(-1, SCORES), span_h / max(len(found), 1))


@njit  # not cached: what it calls lives in another file, whose changes the cache would not see
def _excursions(state, scores, thresholds, counts):
    """Count, for each threshold, how often the cumulative sum rises above it anew from zero."""
    highest = 0.0
    for score in scores:
        level = weigh(state, score)
        if level > 0.0:
            highest = max(highest, level)
        else:
            for i in range(thresholds.size):
                if highest > thresholds[i]:
                    counts[i] += 1
            highest = 0.0
    for i in range(thresholds.size):
        if highest > thresholds[i]:
            counts[i] += 1


def drawn(bags: Sequence[Scores], hours: float, rng: np.random.Generator) -> Array:
    """Scores of so many hours: stretches of neighbours from the bags, by turns of random length."""
    parts, spent = [], 0.0
    while spent < hours:
        bag = bags[int(rng.integers(len(bags)))]
        begin, length = int(rng.integers(len(bag.scores))), 1 + int(rng.geometric(1.0 / STRETCH))
        parts.append(np.take(bag.scores, np.arange(begin, begin + length), axis=0, mode="wrap"))
        spent += length * bag.hours
    return np.concatenate(parts)


def machine_of(seed: int, folder: Path) -> tuple[Setting, Vehicle, list[Scores]]:
    """One dirty machine, with white or coloured noise or ripple of its pressures, calibrated on its first bag, and its undisturbed
    manoeuvres."""
    setting = draw_setting(seed, "dirty", NOISES[seed % len(NOISES)])
    bags = simulate(setting, []).write(folder, folder / "unseen")
    vehicle = calibrate([bags[0]], load(folder / "vehicle.yaml")).with_provenance()
    return setting, vehicle, [found for bag in bags if (found := scores_of(vehicle, bag)).scores.shape[0] >= 10]


def delays(setting: Setting, vehicle: Vehicle, bags: Sequence[Scores], folder: Path, rng: np.random.Generator) -> dict[str, float]:
    """Manoeuvres until each change is told; inf where it is not within the bag, repeated up to 200 manoeuvres."""
    found = {}
    for name, effect in CHANGES.items():
        changed = simulate(setting, [Wanted(effect, STRENGTH)]).write(folder / effect, folder / effect / "unseen")
        after = np.concatenate([scores_of(vehicle, bag).scores for bag in changed])
        before = drawn(bags, BEFORE * bags[0].hours, rng)
        state = np.zeros(1, STATE)
        for score in before:
            weigh(state[0], score)
        state[0]["sum"] = 0.0
        told = (i for i in range(200) if weigh(state[0], after[i % len(after)]) > THRESHOLD)
        found[name] = 1.0 + next(told, math.inf)
    return found


def run(argv: list[str]) -> None:
    """``python -m lugre_steering.bench watch``: a table, or JSON."""
    parser = argparse.ArgumentParser(prog="bench watch", description=__doc__)
    parser.add_argument("--machines", type=int, default=24)
    parser.add_argument("--hours", type=float, default=500.0, help="of each machine")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="print JSON instead of the table")
    options = parser.parse_args(argv)
    counts, hours = np.zeros((options.machines, THRESHOLDS.size), np.int64), np.zeros(options.machines)
    late: list[dict[str, float]] = []
    for i in range(options.machines):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            try:
                setting, vehicle, bags = machine_of(1000 * options.seed + i, folder)
            except LugreSteeringError as error:
                print(f"machine {i}: left out ({error})", file=sys.stderr, flush=True)
                continue
            if not bags:
                print(f"machine {i}: left out (too little motion)", file=sys.stderr, flush=True)
                continue
            rng = np.random.default_rng([options.seed, i])
            _excursions(np.zeros(1, STATE)[0], drawn(bags, options.hours, rng), THRESHOLDS, counts[i])
            hours[i] = options.hours
            if i % 4 == 0:
                late.append(delays(setting, vehicle, bags, folder, rng))
            times = ", ".join(f"{np.exp(np.median(bag.scores[:, 0])) / known_range(vehicle).rmse:.1f}" for bag in bags)
            print(f"machine {i}: {counts[i].tolist()}; errors {times} times the calibration's", file=sys.stderr, flush=True)
    _tell(counts, hours, late, options.json)


def _tell(counts: Any, hours: Array, late: list[dict[str, float]], as_json: bool) -> None:
    halves = [counts[part::2].sum(axis=0) / max(hours[part::2].sum(), 1e-9) * 1000.0 for part in (0, 1)]
    delay = {name: sorted(row[name] for row in late) for name in CHANGES}
    if as_json:
        rows = [{"threshold": t, "per_1000_h": [a, b]} for t, a, b in zip(THRESHOLDS, *halves, strict=True)]
        json.dump({"hours": hours.sum(), "false_alarms": rows, "delay_manoeuvres": delay}, sys.stdout, indent=2, default=float)
        print()
        return
    print(f"{hours.sum():.0f} h; false alarms per 1000 h, machines of even and of odd number\n{'threshold':>9} {'even':>8} {'odd':>8}")
    for threshold, even, odd in zip(THRESHOLDS, *halves, strict=True):
        print(f"{threshold:9.0f} {even:8.2f} {odd:8.2f}")
    for name, values in delay.items():
        print(f"{name}: told after {', '.join(f'{value:.0f}' for value in values)} manoeuvres")
