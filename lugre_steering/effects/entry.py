# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What an effect is: data that names physics, says where it acts and how it shows in a recording, and its laws."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from lugre_steering.recording import Array

STAGES = ("motion", "contact", "thermal", "parallel_torque", "measurement")
NEEDS = ("hydraulics", "rubber", "contact")
"""Sections of the vehicle file that an effect may need."""
RELATIVE_TO = ("max_angle", "slip", "duration")
"""Properties of a recording [rad, rad, s] that a parameter may be relative to."""

LOG_SCALE = 0.3


@dataclass(frozen=True)
class Parameter:
    """One number of an effect. Amplitudes (no ``grid``) are neutral at zero; shapes are tried over a grid before the fit.

    ``scale`` is a typical size in the given unit, used for signatures and finite differences. ``relative_to`` multiplies grid
    and scale by a property of the recording (RELATIVE_TO).
    """

    name: str
    unit: str
    meaning: str
    scale: float
    low: float = -math.inf
    high: float = math.inf
    grid: tuple[float, ...] = ()
    relative_to: str = ""
    optional: bool = False
    """Refinement of the shape: zero (or as the vehicle sheet has it) in the screen, fitted only once the effect is accepted."""
    signed_on_joints: bool = False
    """Sought below zero on a single joint or axis only; on tracks other entries are there for that."""
    far_turning: bool = False
    """Sought on a single joint that turns so far that it is something else than a constant torque; otherwise it is none."""
    place: bool = False
    """A place on the way, or a distance between two: joints and axes may turn further than its bounds, which are those of tracks."""
    example: float | None = None
    """A value at which it acts in an ordinary double cycle, where ``scale`` would leave it idle."""
    pull: float = 0.0
    """Weight with which a fit pulls it to zero, per ``scale`` and noise standard deviation."""

    @property
    def typical(self) -> float:
        return self.scale if self.example is None else self.example

    @property
    def is_shape(self) -> bool:
        return bool(self.grid)

    @property
    def logarithmic(self) -> bool:
        """Positive shapes (times, angles, capacities) are fitted by their logarithm: halving is as far as doubling."""
        return self.is_shape and self.low > 0.0

    def scaled(self, value: float) -> float:
        """The value as fits see it: about one unit is a change worth seeing."""
        return math.log(value) / LOG_SCALE if self.logarithmic else value / self.scale

    def unscaled(self, number: float) -> float:
        return math.exp(number * LOG_SCALE) if self.logarithmic else number * self.scale

    def slope(self, number: float) -> float:
        """Change of the value per unit of its scaled number."""
        return LOG_SCALE * self.unscaled(number) if self.logarithmic else self.scale


@dataclass(frozen=True)
class Seen:
    """What a recording shows of itself to an effect that chooses its own variants: mean angle of the tracks (n,) and lowest
    and highest angle of any [rad], longest recording [s], torque per pressure of each line (lines, n) [N m/Pa] and
    measured torque (n,) [N m]."""

    theta: Array
    lowest: float
    highest: float
    longest: float
    gains: Array
    torque: Array


Variant = Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Effect:
    """Physics that the baseline leaves out.

    ``equation`` in the field's notation, ``source`` the primary literature, ``trace`` how it looks in a residual,
    ``coordinate`` the axis along which it tells itself, ``rivals`` the entries it is easily taken for
    (each pair is declared once; ``registry.rivals`` gives all of an entry). ``hooks`` are its
    laws by the place where they act (``chain.compose.HOOKS``); ``memory`` is what they remember, with its value at the
    start (a number, numbers, or the name of a baseline parameter).
    """

    id: str
    stage: str
    tier: int
    title: str
    equation: str
    source: str
    trace: str
    coordinate: str
    parameters: tuple[Parameter, ...] = ()
    hooks: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    memory: Mapping[str, float | str | tuple[float, ...]] = field(default_factory=dict)
    rivals: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    """Sections of the vehicle file without which it means nothing (NEEDS)."""
    not_recorded: str = ""
    """What the standard topics would lack to show it; such an effect is offered, never named."""
    per_line: bool = False
    """The single amplitude exists once per pressure line; the parameter is then named like the line."""
    places: tuple[tuple[str, str], ...] = ()
    """Pairs of parameters that are the ends of a range; neither given: everywhere."""
    counts_from_start: bool = False
    """Begun late, it leaves another trace than the end of the same always there (heat, path, time and age are remembered)."""
    never_late: bool = False
    """It has its own window in time, or acts at the start only."""
    play: str = ""
    """Its parameter that is a free play [rad], by which a torque looks as if it were stamped late."""
    of_every_joint: bool = False
    """Every joint or axis may have it beside friction; such terms are fitted together before anything is looked for."""
    one_sided: bool = False
    """Left and right turns differ by it; else the torque of mirrored motion is the mirrored torque."""
    of_angle: bool = False
    """Its law is one of an angle and means nothing along a line."""
    of_line: bool = False
    """Sought along a line only: what turns has another law for it."""
    joint_title: str = ""
    """Title for a single joint, which has no tracks and no kingpin."""
    variants: Callable[[Seen], Sequence[Variant]] | None = None
    """Its shapes as a recording suggests them, in place of the grids."""
    acts_by: tuple[str, ...] = ()
    """Parameters any of which makes it act, where that is more than its plain amplitudes."""
    tables: Mapping[str, int] = field(default_factory=dict)
    """Rows of numbers that its laws read beside the parameters, with their lengths."""
    constants: Mapping[str, float | Array] = field(default_factory=dict)
    """What stands in its tables, and what its parameters are where nothing is given."""
    sha256: str = ""
    """Hash of the source that foreign physics comes from: code compiled of another one is not its own."""

    @property
    def observable(self) -> bool:
        return not self.not_recorded

    @property
    def amplitudes(self) -> tuple[str, ...]:
        """Parameters any of which makes it act: neither shapes, nor refinements, nor ends of ranges (unless declared)."""
        ends = {name for pair in self.places for name in pair}
        plain = (p.name for p in self.parameters if not p.is_shape and not p.optional and p.name not in ends)
        return self.acts_by or tuple(plain)

    def fields(self, values: Mapping[str, float] | Mapping[str, float | Array]) -> dict[str, float | Array]:
        """What the parameter record holds of it, by field: its tables, and the given values of its parameters."""
        return {f"{self.id}_{name}": value for name, value in {**self.constants, **values}.items()}

    def reads(self, hook: str) -> tuple[str, ...]:
        """What a law asks for, by name; nothing where it has none."""
        compiled = self.hooks.get(hook)
        return () if compiled is None else _arguments(getattr(compiled, "py_func", compiled))

    def law(self, hook: str, values: Mapping[str, float], **quantities: Any) -> Any:
        """A law without memory over arrays: its own parameters from ``values`` (0 where absent)."""
        compiled = self.hooks[hook]
        plain = getattr(compiled, "py_func", compiled)
        values = {"torque_unit": 1.0, "angle_unit": 1.0, **values}
        arguments = [quantities.get(name, values.get(name, 0.0)) for name in _arguments(plain)]
        try:
            return plain(*arguments)
        except (TypeError, ValueError):  # math.sin, or an if: written for one number at a time
            return np.vectorize(compiled, otypes=[np.float64])(*arguments)


@lru_cache(maxsize=1024)
def _arguments(plain: Callable[..., Any]) -> tuple[str, ...]:
    """What a law asks for, by name; looked up once, as a fit asks for it tens of thousands of times."""
    return tuple(inspect.signature(plain).parameters)
