# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Cells of the grammar: what each channel makes of a unit law, and along what it may vary, both traced by the chain itself."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline

from lugre_steering.chain.step import Records, run_side, torque_side
from lugre_steering.effects import laws
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fitting.fit import Fit
from lugre_steering.fitting.problem import Problem, in_threads, is_rig
from lugre_steering.recording import Array

PIECES, HATS, FINE = 10, 3, 36
"""Cubic B-splines of a free f; coordinates that only take signs need no more than three hats, and what is made of teeth more."""
CYCLES = np.arange(2.0, 40.5, 0.5)
"""Periods over the visited range that are tried: a sine and a cosine show finer teeth than pieces can."""
TOOTHED = ("friction_level", "conservative_torque", "coulomb_friction", "gain")
"""Channels whose f over the angle may be fine."""
LAGS_S = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Time constants that are tried: finer ones follow by NEARER."""
PLAYS = (0.05, 0.15)
"""Half widths of play and relay that are tried, as shares of the travel."""
RINGS_HZ, RINGS_TRIED, RING_STEPS = (0.3, 8.0), 32, 10.0
"""Lowest and highest frequency of a mode, how many are tried, and samples that a period must have."""
NEARER = (0.5, 0.6, 0.7, 0.8, 0.9, 1.1, 1.25, 1.4, 1.6, 1.8, 2.1)
"""Sizes of a memory that are tried once one has shown, times its own."""
NEARER_RING = (0.94, 0.95, 0.96, 0.97, 0.98, 0.99, 1.01, 1.02, 1.03, 1.04, 1.05, 1.06)
"""The same of what rings, which does so at its own period only."""
SMALL = {"conservative_torque": 1.0, "coulomb_friction": 1.0, "load_friction": 1e-3, "lag": 1e-3}
"""Sizes of the unit laws by which channels are traced."""
SMALLEST = 1e-4
"""The same for the other channels, as a share of the torque amplitude."""
RARE, SEEN = 0.005, 0.1
"""Share of the time at either end of a coordinate that is too little to know f there, and share of its whole range that is left then."""
TRACER, WIDE = 1e-6, 1e9
"""Size of the law that carries a coordinate out of the chain, and a range that holds any."""
FORM = "opposing_torque"
"""What the stiffness of another friction law depends on, which its freedoms have; no law of its own is sought there."""
REMEMBERING = ("friction_level", "conservative_torque", "gain")
"""Channels whose laws may remember beside names, whose work a remembered loss or inertia would take over; where none stands all may."""


@dataclass(frozen=True)
class Axis:
    """What f depends on: a coordinate, or what a memory makes of it."""

    coordinate: str
    memory: str = "none"
    memory_size: float = 0.0


@dataclass(frozen=True)
class Cell:
    """Channel x f(axis), with the range [low, high] on which the recordings show the axis; ``period``: of a free f that repeats;
    ``often``: the range beyond which they hardly do, where a free f is held."""

    channel: str
    axis: Axis
    low: float
    high: float
    pieces: int = PIECES
    period: float = 0.0
    often: tuple[float, float] = (-np.inf, np.inf)

    def basis(self, places: Array) -> Array:
        """Columns (n, pieces) of a free f at some places, held beyond the range that was often seen."""
        if self.pieces == 1:
            return np.ones((places.size, 1))
        low, high = max(self.low, self.often[0]), min(self.high, self.often[1])
        inside = np.clip(places, low, high)
        if self.period:
            phase = 2.0 * np.pi * inside / self.period
            return np.column_stack([np.sin(phase), np.cos(phase)])
        degree = 1 if self.pieces == HATS else 3
        knots = np.concatenate([[low] * degree, np.linspace(low, high, self.pieces - degree + 1), [high] * degree])
        return np.asarray(BSpline.design_matrix(inside, knots, degree).toarray())

    def slope(self, places: Array) -> Array:
        """Its derivative (n, pieces), over the step that the law itself takes it by."""
        step = (self.high - self.low) / (laws.KNOTS - 1)
        return np.asarray((self.basis(places + 0.5 * step) - self.basis(places - 0.5 * step)) / step)

    def fields(self, f: Array, size: float = 1.0) -> dict[str, float | Array]:
        """The law with f (KNOTS,) as ``effects.laws.record`` has it."""
        axis = self.axis
        return laws.record(self.channel, axis.coordinate, axis.memory, axis.memory_size, (self.low, self.high), f, size)


@dataclass(frozen=True)
class Traces:
    """Through the chain at a fit, by bag (sides, n): change of the torque per unit of each channel, and the axes."""

    signals: dict[str, list[Array]]
    axes: dict[Axis, list[Array]]
    swings: list[Array]
    """Change of the torque per unit of the slope of a linked inertia."""
    remembering: Collection[str]
    """Channels whose laws may remember."""

    def cells(self) -> Iterator[Cell]:
        """Every cell that the recordings can show."""
        for axis, values in self.axes.items():
            low = min(float(bag.min()) for bag in values)
            high = max(float(bag.max()) for bag in values)
            if axis.coordinate == "none":
                low, high = -1.0, 1.0
            if not high - low > 1e-9 * max(abs(low), abs(high)):
                continue
            first, last = np.quantile(np.concatenate(values, axis=None), (RARE, 1.0 - RARE))
            often = (float(first), float(last)) if last - first > SEEN * (high - low) else (low, high)
            few = axis.memory in ("relay", "ring") or axis == Axis("direction")
            pieces = 1 if axis.coordinate == "none" else HATS if few else PIECES
            for channel in self.channels(axis):
                yield Cell(channel, axis, low, high, pieces, often=often)
                if axis == Axis("angle") and channel in TOOTHED:
                    yield Cell(channel, axis, low, high, FINE, often=often)
                    for cycles in CYCLES:
                        yield Cell(channel, axis, low, high, 2, float((high - low) / cycles), often)

    def channels(self, axis: Axis) -> Collection[str]:
        """Those that may depend on an axis."""
        if axis.memory == "ring":
            return laws.RINGS[:1]
        channels = self.signals if axis.memory == "none" else self.remembering
        return [channel for channel in channels if channel != laws.LINKED[0] or axis == Axis(laws.LINKED[1])]

    def pieces(self, cell: Cell) -> list[Array]:
        """What each piece of a free f is, by bag (sides, n, pieces); the same for every channel."""
        return [np.array([cell.basis(place) for place in bag]) for bag in self.axes[cell.axis]]

    def columns(self, cell: Cell, pieces: Sequence[Array]) -> Array:
        """Change of the torque (n of all bags, pieces) by each piece of a free f."""
        columns = _summed(self.signals[cell.channel], pieces)
        if cell.channel == laws.LINKED[0]:
            slopes = [np.array([cell.slope(place) for place in bag]) for bag in self.axes[cell.axis]]
            columns = columns + _summed(self.swings, slopes)
        return columns


def _summed(signals: Sequence[Array], pieces: Sequence[Array]) -> Array:
    bags = zip(signals, pieces, strict=True)
    return np.concatenate([np.einsum("sn,snp->np", np.asarray(signal), piece) for signal, piece in bags])


def axes_of(problem: Problem) -> list[Axis]:
    """All coordinates but that of the friction law's own form, and memories of those that may have one."""
    travel = max(float(np.ptp(run.theta)) for run in problem.runs)
    torque = float(np.ptp(problem.measured)) / len(problem.vehicle.sides)
    plain = [Axis(name) for name in laws.COORDINATES if name not in ("rubber_temperature", "air_temperature", FORM)]
    if problem.vehicle.rubber is not None:
        plain += [Axis("rubber_temperature"), Axis("air_temperature")]
    lagged = [Axis(name, "lag", tau) for name in ("rate", "direction", "torque", "power") for tau in LAGS_S]
    widths = [("angle", travel), ("torque", torque)]
    shortest = max(float(run.time[1] - run.time[0]) for run in problem.runs) * RING_STEPS
    # The torque of a joint or axis holds that of its inertia, and what smoothing takes from an acceleration looks like a mode.
    highest = 0.0 if is_rig(problem.vehicle) else min(RINGS_HZ[1], 1.0 / shortest)
    rings = [Axis(laws.RINGS[1], "ring", 1.0 / f) for f in np.geomspace(RINGS_HZ[0], highest, RINGS_TRIED)] if highest > RINGS_HZ[0] else []
    return plain + lagged + rings + [Axis(name, kind, share * of) for name, of in widths for kind in ("play", "relay") for share in PLAYS]


def nearer(axis: Axis) -> list[Axis]:
    """The same with other sizes of its memory."""
    near = {"none": (), "ring": NEARER_RING}.get(axis.memory, NEARER)
    return [replace(axis, memory_size=float(share) * axis.memory_size) for share in near]


def trace(problem: Problem, fitted: Fit, place: int, axes: Sequence[Axis]) -> Traces:
    """Run the chain with a small unit law in each channel, and once per axis with a law that carries it out, in the place
    ``place`` of the problem's laws and beside the effects of the fit; the air stays as it was at the start."""
    slot = laws.slot(place)
    gain, amplitude = problem.gain(fitted.x), float(np.abs(fitted.prediction).max())

    def record(bag: int, values: dict[str, float | Array]) -> Records:
        p = problem.model.parameters[0].copy()
        for field, value in problem.fields(fitted.x).items():
            p[field] = value
        p["initial_bristle"] = fitted.x[len(problem.calibrations) + bag] * problem.presliding
        acting = [(known.effect, own) for known, own in fitted.effects if known.active_in(bag) and not known.effect.per_line]
        standing = {field: number for effect, own in acting for field, number in effect.fields(own).items()}
        for field, number in {**standing, **slot.fields(values)}.items():
            p[field] = number
        return p

    def sides(bag: int, values: dict[str, float | Array], carried: bool) -> Array:
        run, p = problem.runs[bag], record(bag, values)
        time, *motion = run.steps
        rubber, tracks = problem.model.rubber, zip(*motion, strict=True)
        if carried:
            return np.array([run_side(p, rubber, time, *track)["parallel"] for track in tracks])[:, :: 1 + run.midway]
        return np.array([torque_side(p, rubber, time, *track) for track in tracks])[:, :: 1 + run.midway]

    bags: Sequence[int] = range(len(problem.runs))
    nothing = Cell("gain", Axis("none"), -1.0, 1.0, 1).fields(np.zeros(laws.KNOTS))
    base = {carried: [sides(bag, nothing, carried) for bag in bags] for carried in (False, True)}

    def signal(channel: str) -> list[Array]:
        rate = max(float(np.abs(run.omega).max()) for run in problem.runs)
        acceleration = max(float(np.abs(run.alpha).max()) for run in problem.runs)
        per = {"viscous_loss": rate, "turbulent_loss": rate**2, "inertia": acceleration, "linked_inertia": acceleration}.get(channel)
        small = SMALL.get(channel, 1e-2 if per is None else SMALLEST * amplitude / per)
        values = Cell(channel, Axis("none"), -1.0, 1.0, 1).fields(np.full(laws.KNOTS, small))
        return [(sides(bag, values, False) - base[False][bag]) / small / gain for bag in bags]

    def along(axis: Axis) -> list[Array]:
        cell = Cell("conservative_torque", axis, -WIDE, WIDE)
        values = cell.fields(np.linspace(-WIDE, WIDE, laws.KNOTS), TRACER)
        return [(sides(bag, values, True) - base[True][bag]) / TRACER for bag in bags]

    signals = dict(zip(laws.CHANNELS, in_threads(signal, list(laws.CHANNELS)), strict=True))
    squares = (0.5 * run.omega**2 for run in problem.runs)
    return Traces(
        signals, dict(zip(axes, in_threads(along, axes), strict=True)),
        [torque * square for torque, square in zip(signals[laws.RINGS[0]], squares, strict=True)],
        REMEMBERING if any(candidate.effect.id in CATALOGUE for candidate, _ in fitted.effects) else tuple(laws.CHANNELS),
    )
