# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What every simulator of the proof hands over: recordings with their truth, whatever physics made them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lugre_steering.proof.sensors import Samples

Array = NDArray[np.float64]

ACTIVE_SHARE = 0.05
"""An effect acts where its torque exceeds this share of its largest."""


class Hidden(NamedTuple):
    """A drawn effect: parameter values (SI), and the bag (0 or 1) or the time [s] that limits it."""

    id: str
    values: dict[str, float]
    only_bag: int | None
    start_s: float


class Wanted(NamedTuple):
    """One effect to hide: its size (1 is typical) and what makes it hard to find, see ``campaign.Hiding``."""

    id: str
    strength: float = 1.0
    only_bag: int | None = None
    from_time_s: float | None = None
    barely: bool = False


class BagTruth(Protocol):
    """One bag on a clean uniform grid ``time`` (n,) [s]: torque [N m] that noise-free sensors show with every effect and with none,
    the part that each adds, and the stretches [s] in which each acts."""

    @property
    def manoeuvre(self) -> str: ...
    @property
    def time(self) -> Array: ...
    @property
    def torque(self) -> Array: ...
    @property
    def torque_without(self) -> Array: ...
    @property
    def effect_torque(self) -> dict[str, Array]: ...
    @property
    def intervals(self) -> dict[str, list[tuple[float, float]]]: ...


class SensedBag(BagTruth, Protocol):
    """A bag with what its sensors recorded, and the clean angles (2, n) [rad] on the grid ``time``."""

    @property
    def angles(self) -> Sequence[Samples]: ...
    @property
    def pressures(self) -> Sequence[Samples]: ...
    @property
    def clean_angles(self) -> Array: ...


@dataclass(frozen=True)
class Probe:
    """Noise-free total torque (n,) [N m] on a motion chosen for measuring: as hidden, and without one effect each."""

    torque: Array
    without: dict[str, Array]


class Made(Protocol):
    """A case: bags of one vehicle, and what scoring asks of their maker."""

    @property
    def hidden(self) -> tuple[Hidden, ...]: ...
    @property
    def bags(self) -> Sequence[BagTruth]: ...
    @property
    def limit(self) -> float:
        """Mean angle [rad] to which the vehicle steers."""
        ...

    def noise_variance(self, bag: int) -> float:
        """Variance [N2 m2] of the measured torque about the noise-free one."""
        ...

    def seen_noise_variance(self, bag: int) -> float:
        """The same on a common clock that interpolates between samples."""
        ...

    def tangents(self) -> Array:
        """Changes of the torque of all bags in one row with each parameter that a recalibration may move, unit columns."""
        ...

    def told(self, effect: Hidden) -> dict[str, float | str]:
        """Parameters of a hidden effect for the truth (a line by its name)."""
        ...

    def write(self, seen: Path, unseen: Path) -> list[Path]:
        """Bags and ``vehicle.yaml`` into ``seen``, all else into ``unseen``; returns the bags."""
        ...

    def probe(self, angles: Array, step: float) -> Probe:
        """The same vehicle on other angles (2, n) [rad]."""
        ...


def seen_variance(bag: SensedBag, step: float, torque_of: Callable[[Array, Array], Array]) -> float:
    """Variance [N2 m2] of the torque that sensors show about the noise-free one, on a clock of ``step`` [s] that reads between
    the samples of every channel, all phases alike; ``torque_of`` (pressures, angles) as the sheet's geometry has it."""
    start = max(0.0, *(samples.time[0] for samples in (*bag.angles, *bag.pressures)))
    time = np.arange(start, min(samples.time[-1] for samples in bag.pressures), step)
    angles = np.stack([np.interp(time, bag.time, angle) for angle in bag.clean_angles])
    seen = np.stack([np.interp(time, samples.time, samples.value) for samples in bag.pressures])
    return float(np.mean((torque_of(seen, angles) - np.interp(time, bag.time, bag.torque)) ** 2))


def pooled_noise(made: Made) -> float:
    """Noise variance of all bags together [N2 m2]."""
    sizes = [bag.time.size for bag in made.bags]
    return float(np.average([made.noise_variance(i) for i in range(len(sizes))], weights=sizes))


def removable_of(bag: BagTruth) -> float:
    """Mean square [N2 m2] of what the effects add to the noise-free torque of a bag, not about its mean."""
    return float(np.mean((bag.torque - bag.torque_without) ** 2))


def pooled_removable(made: Made) -> float:
    return float(np.average([removable_of(bag) for bag in made.bags], weights=[bag.time.size for bag in made.bags]))


def recalibrated(made: Made) -> float:
    """``pooled_removable`` less what moving the baseline's parameters can imitate [N2 m2]."""
    return left_over(np.concatenate([bag.torque - bag.torque_without for bag in made.bags]), made.tangents())


def beside(made: Made) -> dict[str, float]:
    """Of each of several effects, what neither recalibration nor the others at any size can imitate of its torque [N2 m2]."""
    if len(made.hidden) < 2:
        return {}
    parts = {effect.id: np.concatenate([_part(bag, effect.id) for bag in made.bags]) for effect in made.hidden}
    tangents = made.tangents()
    return {
        own: left_over(row, np.column_stack([tangents, *(unit(other) for name, other in parts.items() if name != own)]))
        for own, row in parts.items()
    }


def _part(bag: BagTruth, id_: str) -> Array:
    return bag.effect_torque.get(id_, np.zeros(bag.time.size))


def unit(column: Array) -> Array:
    return np.asarray(column / max(float(np.linalg.norm(column)), 1e-300))


def left_over(torque: Array, columns: Array) -> float:
    """Mean square of what least squares on the columns leaves."""
    left = torque - columns @ np.linalg.lstsq(columns, torque, rcond=1e-9)[0]
    return float(np.mean(left**2))


def active_intervals(time: Array, part: Array) -> list[tuple[float, float]]:
    """Stretches [s] in which ``|part|`` exceeds ACTIVE_SHARE of its maximum; gaps below half a second are bridged."""
    size, period = np.abs(part), float(time[1] - time[0])
    if not size.any():
        return []
    at = np.flatnonzero(size > ACTIVE_SHARE * size.max())
    ends = np.flatnonzero(np.diff(at) > 0.5 / period)
    starts, stops = at[np.concatenate([[0], ends + 1])], at[np.concatenate([ends, [at.size - 1]])]
    return [(float(time[a]), float(time[b])) for a, b in zip(starts, stops, strict=True) if b - a > 0.1 / period]
