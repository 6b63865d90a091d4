# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The simulators behind one door: a case in, a maker of recordings out, whatever physics stands behind it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lugre_steering.proof import hydraulics, manoeuvres, simulator
from lugre_steering.proof.campaign import Hiding
from lugre_steering.proof.conceal import Concealed
from lugre_steering.proof.field import simulator as field
from lugre_steering.proof.made import Hidden, Made, Probe, Wanted, seen_variance
from lugre_steering.proof.sensors import PERIOD_S
from lugre_steering.proof.simulator import BagData, Case, CaseData
from lugre_steering.proof.vehicle_draw import Sheet, load_sheet

Array = NDArray[np.float64]
Maker = Callable[[Sequence[Wanted]], Made]

LAW = "law"


@dataclass(frozen=True)
class SecondCase:
    """A case of the second simulator (see ``made.Made``)."""

    data: CaseData

    @property
    def hidden(self) -> tuple[Hidden, ...]:
        return self.data.hidden

    @property
    def bags(self) -> tuple[BagData, ...]:
        return self.data.bags

    @property
    def limit(self) -> float:
        return manoeuvres.LIMIT_RAD

    def noise_variance(self, bag: int) -> float:
        return simulator.noise_variance(self.data, self.bags[bag])

    def seen_noise_variance(self, bag: int) -> float:
        """Lower than ``noise_variance`` for white noise, since interpolation averages: what is left to a perfect model there."""
        return seen_variance(
            self.bags[bag], 0.1 * PERIOD_S, lambda seen, angles: hydraulics.torque_of(seen, hydraulics.line_gain(self.data.sheet, angles))
        )

    def tangents(self) -> Array:
        return self._tangents

    @cached_property
    def _tangents(self) -> Array:
        return simulator.tangents(self.data)

    def told(self, effect: Hidden) -> dict[str, float | str]:
        if effect.id == LAW:
            return {**effect.values, **self.data.law.told()}
        return {key: self.data.sheet.lines[int(value)] if key == "line" else value for key, value in effect.values.items()}

    def write(self, seen: Path, unseen: Path) -> list[Path]:
        return simulator.write_case(self.data, seen, unseen)

    def probe(self, angles: Array, step: float) -> Probe:
        assert step == manoeuvres.STEP_S
        return simulator.probe(self.data, angles)


def maker(hiding: Hiding, sheet_file: Path) -> Maker:
    """What makes this case's recordings; everything but the effects is drawn already."""
    return _third(hiding) if hiding.simulator == 3 else _second(hiding, load_sheet(sheet_file))


def _second(hiding: Hiding, sheet: Sheet) -> Maker:
    def make(wanted: Sequence[Wanted]) -> SecondCase:
        effects = tuple(Concealed(*one) for one in wanted if one.id != LAW)
        law = next((one.strength for one in wanted if one.id == LAW), None)
        return SecondCase(simulator.simulate_case(Case(hiding.seed, effects, hiding.noise, law=law), sheet))

    return make


def _third(hiding: Hiding) -> Maker:
    setting = field.draw_setting(hiding.seed, hiding.kind, hiding.noise, hiding.which)
    return lambda wanted: field.simulate(setting, wanted)


def mistake_of(made: Made) -> dict[str, object]:
    """What is wrong with the sheet of a case, and the entries that a good answer suspects; empty for a right sheet."""
    if not isinstance(made, field.FieldCase) or not made.setting.mistake:
        return {}
    return {"what": made.setting.mistake, "suspects": list(made.setting.suspects)}
