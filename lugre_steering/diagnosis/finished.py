# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A finished search, as every part of the conclusion needs it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lugre_steering import units
from lugre_steering.diagnosis.freedom import Freedom
from lugre_steering.diagnosis.loudness import loudness
from lugre_steering.diagnosis.search.search import Found, Search
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.fitting.fit import Fit, fit
from lugre_steering.fitting.noise import Noise
from lugre_steering.fitting.problem import Effects, Problem
from lugre_steering.fitting.split import Split, split
from lugre_steering.recording import Array
from lugre_steering.report import words


def amplitude_of(torque: Array) -> float:
    """What one of a hundred samples (n,) exceeds [N m]."""
    return float(np.percentile(np.abs(torque), 99.0))


@dataclass(frozen=True)
class Finished:
    """The problem, its noise, the roles of its samples and what the search found; weights are one over sigma, (n,) [1/(N m)]."""

    problem: Problem
    noise: Noise
    roles: Split
    found: Search
    beside_form: Finished | None = None
    """The same beside the freedoms of the friction law and of what is named."""
    form: tuple[str, ...] = ()
    """What each of these freedoms is, in words, empty for those of a name; of a problem that has them."""
    freedoms: tuple[Freedom, ...] = ()
    """The laws whose shapes are the first of them."""
    around: bool = False
    """Whether names have the values that they have beside the freedoms, and the baseline is recalibrated around them: where the form of
    the friction law is more than noise, other values would make up for it."""

    @property
    def compared(self) -> Finished:
        """Where the names were compared."""
        return self.beside_form or self

    @cached_property
    def needs_form(self) -> bool:
        """Whether names alone leave more than noise."""
        return loudness(self.problem, self.noise, self.found.final).loud

    @cached_property
    def weight(self) -> Array:
        """Of all valid samples."""
        return np.where(self.problem.valid, 1.0 / self.noise.sigma, 0.0)

    @cached_property
    def fitted(self) -> Array:
        """Of the samples that may fit."""
        return np.where(self.roles.fit, 1.0 / self.noise.sigma, 0.0)

    @cached_property
    def held(self) -> Array:
        """Of the samples held out."""
        return np.where(self.roles.held, 1.0 / self.noise.sigma, 0.0)

    def in_file(self, weight: Array, effects: Effects, x: Array) -> Fit:
        """What a vehicle file can hold of effects, which have their values beside the freedoms, fitted from some nuisances."""
        if not self.around:
            return fit(self.problem, weight, effects, x[: self.problem.nuisances], linearisations=20)
        held = [(replace(candidate, free=()), values) for candidate, values in effects]
        fitted = fit(self.problem, weight, held, x[: self.problem.nuisances], linearisations=20)
        return replace(fitted, effects=tuple((candidate, dict(values)) for candidate, values in effects))

    @cached_property
    def freely(self) -> Fit:
        """What was found with the values that explain most, be it the form of the friction law."""
        final = self.found.final
        return replace(self, around=False).in_file(self.fitted, final.effects, final.x) if self.around else final

    def with_more(self, more: Sequence[Found], effects: Effects) -> Finished:
        """The same with more before what it has, fitted anew."""
        found = replace(
            self.found, found=(*more, *self.found.found),
            final=fit(self.problem, self.fitted, [*effects, *self.found.final.effects], self.found.final.x, linearisations=20),
        )  # fmt: skip
        beside = None if self.beside_form is None else self.beside_form.with_more(more, effects)
        return replace(self, found=found, beside_form=beside)

    def only(self, kept: Sequence[int]) -> Finished:
        """The same with some of its names alone, fitted anew."""
        names, effects = tuple(self.found.found[i] for i in kept), [self.found.final.effects[i] for i in kept]
        final = fit(self.problem, self.fitted, effects, self.found.final.x, linearisations=20)
        beside = None if self.beside_form is None else self.beside_form.only(kept)
        return replace(self, found=replace(self.found, found=names, final=final), beside_form=beside)

    @cached_property
    def of_every_joint(self) -> Finished:
        """The same with what every joint or axis has alone; itself where nothing else was found, or nothing of that."""
        given = [i for i, item in enumerate(self.found.found) if item.given]
        return self.only(given) if 0 < len(given) < len(self.found.found) else self

    def refitted(self, phase: int) -> Fit:
        """What was found, fitted to all but one third of the samples (see ``split``)."""
        there, final = self.compared, self.found.final
        if self.around:
            fitted = np.where(split(there.problem, phase).fit, there.weight, 0.0)
            final = fit(there.problem, fitted, there.found.final.effects, there.found.final.x, linearisations=8)
        return self.in_file(np.where(split(self.problem, phase).fit, self.weight, 0.0), final.effects, self.found.final.x)

    def unit(self, unit: str) -> str:
        """A unit in the words of the vehicle's coordinate."""
        return units.label(self.problem.vehicle, unit)

    def title(self, effect: str) -> str:
        """Title of an effect of the catalogue, likewise; what is none keeps its name."""
        return units.title(self.problem.vehicle, CATALOGUE[effect]) if effect in CATALOGUE else effect

    @cached_property
    def amplitude(self) -> float:
        """Of the measured torque [N m]."""
        return amplitude_of(self.problem.measured)

    def torque(self, value: float) -> str:
        """A torque (or force) in few digits, with its unit."""
        return words.torque(self.problem.vehicle, value)
